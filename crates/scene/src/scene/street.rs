//! A generated street of any number of triangles, for benchmarks.

use std::f64::consts::TAU;

use glam::DVec3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::DEFAULT_CLASSES;
use crate::mesh::MOST_TRIANGLES;
use lidar_cast::geom::TriangleSoup;
use lidar_cast::maths;

/// Fewest triangles of a street.
pub const FEWEST_STREET_TRIANGLES: usize = 4000;
/// Most triangles of a street that a scene holds beside a few vehicles.
pub const MOST_STREET_TRIANGLES: usize = MOST_TRIANGLES - 1000;

/// Metres from the middle to the end of the ground.
const HALF: f64 = 120.0;
/// Half the width of both streets, kerb to kerb.
const STREET: f64 = 5.0;
const HOUSES: usize = 24;
const VEHICLES: usize = 24;
const TREES: usize = 40;

/// Builds a crossing of two streets with house fronts, parked vehicles and trees.
///
/// The street has exactly `triangles` triangles, at least [`FEWEST_STREET_TRIANGLES`], and depends on
/// `seed` alone. Streets run along x and y on the ground z = 0, in metres. About 15 % of the triangles
/// are ground, 30 % fronts with recessed windows, 20 % vehicles, 35 % trunks and leaves; more triangles
/// make the same objects finer. Classes are ids of [`DEFAULT_CLASSES`].
pub fn street(triangles: usize, seed: u64) -> TriangleSoup {
    let triangles = triangles.max(FEWEST_STREET_TRIANGLES);
    let mut street =
        StreetBuilder { soup: TriangleSoup::default(), rng: ChaCha8Rng::seed_from_u64(seed) };
    let share = |percent: usize, things: usize| triangles * percent / (100 * things);
    street.ground(share(14, 1));
    for house in 0..HOUSES {
        street.house(house, share(29, HOUSES));
    }
    for vehicle in 0..VEHICLES {
        street.vehicle(vehicle, share(19, VEHICLES));
    }
    for tree in 0..TREES {
        // The last tree takes the remainder of the rounding.
        let left = triangles - street.soup.faces.len();
        street.tree(tree, left / (TREES - tree));
    }
    street.soup
}

struct StreetBuilder {
    soup: TriangleSoup,
    rng: ChaCha8Rng,
}

fn class(name: &str) -> u16 {
    DEFAULT_CLASSES.iter().position(|c| *c == name).unwrap_or_default() as u16
}

impl StreetBuilder {
    fn triangle(&mut self, corners: [u32; 3], class: u16) {
        self.soup.faces.push(corners);
        self.soup.face_class.push(class);
    }

    fn vertex(&mut self, p: DVec3) -> u32 {
        self.soup.vertices.push(p.as_vec3().to_array());
        self.soup.vertices.len() as u32 - 1
    }

    /// A surface of `n` × `m` quads; `at` takes (i/n, j/m) to a point, `class` to its class.
    fn patch(
        &mut self,
        [n, m]: [usize; 2],
        mut at: impl FnMut(f64, f64) -> DVec3,
        class: impl Fn(f64, f64) -> u16,
    ) {
        let base = self.soup.vertices.len() as u32;
        let (n, m) = (n.max(1), m.max(1));
        for i in 0..=n {
            for j in 0..=m {
                let point = at(i as f64 / n as f64, j as f64 / m as f64);
                self.vertex(point);
            }
        }
        for i in 0..n {
            for j in 0..m {
                let class = class((i as f64 + 0.5) / n as f64, (j as f64 + 0.5) / m as f64);
                let corner = |i: usize, j: usize| base + (i * (m + 1) + j) as u32;
                let [a, b] = [corner(i, j), corner(i + 1, j)];
                let [c, d] = [corner(i + 1, j + 1), corner(i, j + 1)];
                self.triangle([a, b, c], class);
                self.triangle([a, c, d], class);
            }
        }
    }

    fn ground(&mut self, budget: usize) {
        let n = ((budget / 2) as f64).sqrt() as usize;
        let place = |u: f64| HALF * (2.0 * u - 1.0);
        let on_street = |x: f64, y: f64| x.abs().min(y.abs()) < STREET;
        let (road, walk) = (class("road"), class("sidewalk"));
        self.patch(
            [n, n],
            |u, v| {
                let (x, y) = (place(u), place(v));
                let kerb = if on_street(x, y) { 0.0 } else { 0.12 };
                DVec3::new(x, y, kerb)
            },
            |u, v| if on_street(place(u), place(v)) { road } else { walk },
        );
    }

    /// A house at its place on one of four street sides; windows lie 20 cm behind the wall.
    fn house(&mut self, index: usize, budget: usize) {
        let height = self.rng.random_range(6.0..18.0);
        let (width, depth) = (self.rng.random_range(12.0..16.0), 12.0);
        let along = 18.0 + 18.0 * (index / 8) as f64;
        let centre = match index % 8 {
            k @ 0..4 => [along * sign(k & 1), (STREET + 3.0 + 0.5 * depth) * sign(k & 2), 0.0],
            k => [(STREET + 3.0 + 0.5 * depth) * sign(k & 1), along * sign(k & 2), 0.0],
        };
        let centre = DVec3::from(centre);
        let half = DVec3::new(0.5 * width, 0.5 * depth, 0.0);
        let ring = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let corner = |k: usize| centre + half * DVec3::new(ring[k % 4][0], ring[k % 4][1], 0.0);
        let wall = class("building");
        let n = ((budget / 8) as f64).sqrt() as usize;
        for k in 0..4 {
            let (from, to) = (corner(k), corner(k + 1));
            let inward = DVec3::Z.cross(to - from).normalize();
            let windowed = |u: f64, v: f64| {
                let (a, b) = ((5.0 * u).fract(), (height / 3.0 * v).fract());
                u > 0.0 && u < 1.0 && (0.3..0.7).contains(&a) && (0.4..0.8).contains(&b)
            };
            self.patch(
                [n, n],
                |u, v| {
                    let back = if windowed(u, v) { 0.2 * inward } else { DVec3::ZERO };
                    from.lerp(to, u) + DVec3::Z * (height * v) + back
                },
                |_, _| wall,
            );
        }
        let roof = |u: f64, v: f64| {
            centre + half * DVec3::new(2.0 * u - 1.0, 2.0 * v - 1.0, 0.0) + DVec3::Z * height
        };
        self.patch([1, 1], roof, |_, _| wall);
    }

    /// A rounded body parked beside a street.
    fn vehicle(&mut self, index: usize, budget: usize) {
        let along = sign(index & 1) * self.rng.random_range(8.0..60.0);
        let side = sign(index & 2) * (STREET - 1.2);
        let centre = if index & 4 == 0 { [along, side] } else { [side, along] };
        let turned = index & 4 != 0;
        let size = DVec3::new(2.2, 0.9, 0.5 * self.rng.random_range(1.4..2.4));
        let n = ((budget / 2) as f64).sqrt() as usize;
        let rounded = |v: f64| v.signum() * maths::pow(v.abs(), 0.4);
        self.patch(
            [n, n],
            |u, v| {
                let (sin_a, cos_a) = maths::sin_cos(TAU * u);
                let (sin_e, cos_e) = maths::sin_cos(0.5 * TAU * (v - 0.5));
                let [r, up] = [rounded(cos_e), rounded(sin_e)];
                let body = size * DVec3::new(r * rounded(cos_a), r * rounded(sin_a), up);
                let body = if turned { DVec3::new(-body.y, body.x, body.z) } else { body };
                DVec3::new(centre[0], centre[1], size.z + 0.25) + body
            },
            |_, _| class("vehicle"),
        );
    }

    /// A trunk under a ball of leaves, of exactly `budget` triangles; leaves shrink as they multiply.
    fn tree(&mut self, index: usize, budget: usize) {
        let along = sign(index & 1) * self.rng.random_range(8.0..90.0);
        let side = sign(index & 2) * (STREET + self.rng.random_range(1.0..2.5));
        let foot = if index & 4 == 0 { [along, side] } else { [side, along] };
        let foot = DVec3::new(foot[0], foot[1], 0.1);
        let before = self.soup.faces.len();
        if budget > 24 {
            let trunk = |u: f64, v: f64| {
                let (sin, cos) = maths::sin_cos(TAU * u);
                foot + DVec3::new(0.15 * cos, 0.15 * sin, 3.0 * v)
            };
            self.patch([8, 1], trunk, |_, _| class("vegetation"));
        }
        let leaves = budget - (self.soup.faces.len() - before);
        let radius = self.rng.random_range(1.2..2.2);
        let size = (2.0 * radius / (leaves.max(1) as f64).sqrt()).min(0.4);
        for _ in 0..leaves {
            let centre = foot + DVec3::Z * (3.0 + 0.7 * radius) + radius * self.in_ball();
            let corners = [0; 3].map(|_| centre + size * self.in_ball());
            let corners = corners.map(|c| self.vertex(c));
            self.triangle(corners, class("vegetation"));
        }
    }

    fn in_ball(&mut self) -> DVec3 {
        loop {
            let p = DVec3::from([0; 3].map(|_| self.rng.random_range(-1.0..1.0)));
            if p.length_squared() <= 1.0 {
                return p;
            }
        }
    }
}

fn sign(bit: usize) -> f64 {
    if bit == 0 { 1.0 } else { -1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_street_has_the_triangles_asked_for_and_repeats_itself() {
        for triangles in [4000, 20_000, 50_001] {
            let soup = street(triangles, 1);
            assert_eq!((soup.faces.len(), soup.face_class.len()), (triangles, triangles));
            assert_eq!(soup, street(triangles, 1));
            assert_ne!(soup, street(triangles, 2));
            for (name, percent) in
                [("sidewalk", 8), ("building", 20), ("vehicle", 10), ("vegetation", 30)]
            {
                let count = soup.face_class.iter().filter(|c| **c == class(name)).count();
                assert!(100 * count > percent * triangles, "{count} of {name} in {triangles}");
            }
            let inside = |v: &[f32; 3]| v[0].abs() <= 121.0 && v[1].abs() <= 121.0 && v[2] < 25.0;
            assert!(soup.vertices.iter().all(inside));
        }
    }
}
