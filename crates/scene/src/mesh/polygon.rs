//! Polygons of mesh files, cut into triangles that cover the polygon alone.

use std::cmp::Ordering;

use earcut::Earcut;
use glam::DVec3;

use super::RawMesh;
use sightline_files::Note;

/// Most corners of a polygon that is not a fan: ear clipping takes time with their square or worse.
const MOST_CORNERS: usize = 10_000;
/// Share of a polygon's area that rounding may turn over.
const SLIVER: f64 = 1e-9;
/// Share of a polygon's reach from which a corner lies outside its plane.
const BENT: f64 = 1e-6;
/// Most corners of a bent polygon that are all kept: the search takes time with their cube.
const MOST_BENT: usize = 300;
/// Relative difference of areas above which a polygon crosses itself.
const CROSSED: f64 = 1e-6;

/// Cuts polygons, with memory that they share.
pub(super) struct Cutter {
    earcut: Earcut<f64>,
    cut: Vec<u32>,
    polygons: usize,
    /// Polygons that cross themselves, and the first of them.
    crossed: (usize, usize),
    /// Faces with fewer than three corners.
    small: usize,
}

impl Default for Cutter {
    fn default() -> Self {
        Self { earcut: Earcut::new(), cut: Vec::new(), polygons: 0, crossed: (0, 0), small: 0 }
    }
}

impl Cutter {
    /// Adds the triangles of a polygon, whose corners are vertices of the mesh.
    ///
    /// A fan from the first corner is kept where it covers the polygon alone. All others are cut by ear clipping in
    /// the plane that their normal (Newell's) is steepest to.
    ///
    /// # Errors
    /// Too many triangles or corners.
    pub(super) fn add(
        &mut self,
        mesh: &mut RawMesh,
        corners: &[u32],
        material: u32,
    ) -> Result<(), String> {
        self.polygons += 1;
        match *corners {
            [] | [_] | [_, _] => {
                self.small += 1;
                return Ok(());
            }
            [a, b, c] => return mesh.triangle([a, b, c], material),
            _ => {}
        }
        let start = mesh.vertices[corners[0] as usize];
        let arm = |i: usize| mesh.vertices[corners[i] as usize] - start;
        let parts = || (1..corners.len() - 1).map(|i| arm(i).cross(arm(i + 1)));
        let normal: DVec3 = parts().sum();
        let size = normal.length_squared();
        let flat = !(size > 0.0 && size.is_finite());
        // Areas on both sides of a crossing cancel out; a line has no area at all.
        let reach = (1..corners.len()).map(|i| arm(i).length_squared()).fold(0.0, f64::max);
        if size == 0.0 && parts().any(|part| part.length() > SLIVER * reach) {
            self.cross();
        }
        if flat || parts().all(|part| part.dot(normal) >= -SLIVER * size) {
            return fan(mesh, corners, material);
        }
        if corners.len() > MOST_CORNERS {
            let count = corners.len();
            return Err(format!(
                "has {count} corners and is not convex, {MOST_CORNERS} may be there; split it"
            ));
        }
        let drop = normal.abs().max_position();
        let [u, v] = [[1, 2], [0, 2], [0, 1]][drop];
        let plane: Vec<[f64; 2]> = (0..corners.len()).map(|i| [arm(i)[u], arm(i)[v]]).collect();
        self.earcut.earcut(plane.iter().copied(), &[], &mut self.cut);
        let area = |t: &[u32]| {
            let [a, b, c] = [t[0], t[1], t[2]].map(|i| plane[i as usize]);
            ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
        };
        let covered: f64 = self.cut.chunks_exact(3).map(area).sum();
        let meant = normal[drop].abs();
        if (covered - meant).abs().partial_cmp(&(CROSSED * meant)).is_none_or(Ordering::is_gt) {
            self.cross();
        }
        if self.cut.is_empty() {
            return fan(mesh, corners, material);
        }
        // Corners in a line as seen from above make no triangle there, and one in space.
        let bulge = (1..corners.len()).map(|i| arm(i).dot(normal).abs()).fold(0.0, f64::max);
        if bulge > BENT * (reach * size).sqrt() {
            self.keep_corners(&plane);
        }
        let mut triangles = self.cut.chunks_exact(3);
        triangles.try_for_each(|t| {
            mesh.triangle([t[0], t[1], t[2]].map(|i| corners[i as usize]), material)
        })
    }

    /// Cuts a polygon once more where corners were left out; counts one that cannot be cut as one that crosses itself.
    fn keep_corners(&mut self, plane: &[[f64; 2]]) {
        if self.cut.len() < 3 * (plane.len() - 2) {
            match ears(plane) {
                Some(cut) => self.cut = cut,
                None => self.cross(),
            }
        }
    }

    /// Counts the last polygon as one that crosses itself.
    fn cross(&mut self) {
        let (count, first) = self.crossed;
        self.crossed = (count + 1, if count == 0 { self.polygons - 1 } else { first });
    }

    /// Notes polygons that are likely slips of their author.
    pub(super) fn notes(&self, mesh: &mut RawMesh) {
        let (crossed, first) = self.crossed;
        if crossed > 0 {
            mesh.notes.push(Note::doubt(format!(
                "{crossed} of {} faces cross themselves, face {first} first; their triangles may cover more or less \
                 than is meant, so split them into triangles",
                self.polygons
            )));
        }
        if self.small > 0 {
            mesh.notes.push(Note::fact(format!(
                "{} of {} faces have fewer than three corners and are passed over: they have no area",
                self.small, self.polygons
            )));
        }
    }
}

/// Triangles of all corners of a polygon in its plane, also those between corners in a line; `None` where it crosses
/// itself, or has too many corners.
fn ears(plane: &[[f64; 2]]) -> Option<Vec<u32>> {
    if plane.len() > MOST_BENT {
        return None;
    }
    let area = |a: u32, b: u32, c: u32| {
        let [a, b, c] = [a, b, c].map(|i| plane[i as usize]);
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    };
    let last = plane.len() as u32 - 1;
    let sense = (1..last).map(|i| area(0, i, i + 1)).sum::<f64>().signum();
    let mut left: Vec<u32> = (0..=last).collect();
    let mut cut = Vec::with_capacity(3 * plane.len());
    while left.len() > 3 {
        let count = left.len();
        let corner = |i: usize| [left[(i + count - 1) % count], left[i], left[(i + 1) % count]];
        let inside = |[a, b, c]: [u32; 3], p: u32| {
            [(a, b), (b, c), (c, a)].iter().all(|(from, to)| sense * area(*from, *to, p) > 0.0)
        };
        let is_ear = |i: &usize| {
            let ear @ [a, b, c] = corner(*i);
            sense * area(a, b, c) >= 0.0 && left.iter().all(|p| ear.contains(p) || !inside(ear, *p))
        };
        let ear = (0..count).find(is_ear)?;
        cut.extend(corner(ear));
        left.remove(ear);
    }
    cut.extend(left);
    Some(cut)
}

fn fan(mesh: &mut RawMesh, corners: &[u32], material: u32) -> Result<(), String> {
    let mut pairs = corners[1..].windows(2);
    pairs.try_for_each(|pair| mesh.triangle([corners[0], pair[0], pair[1]], material))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Area and triangles of a polygon, and its notes.
    fn cut(points: &[DVec3]) -> (f64, Vec<[u32; 3]>, Vec<Note>) {
        let mut mesh = RawMesh { vertices: points.to_vec(), ..RawMesh::default() };
        let corners: Vec<u32> = (0..points.len() as u32).collect();
        let mut cutter = Cutter::default();
        cutter.add(&mut mesh, &corners, 0).unwrap();
        cutter.notes(&mut mesh);
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|v| mesh.vertices[v as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        (mesh.faces.iter().map(area).sum(), mesh.faces, mesh.notes)
    }

    /// An L of 11 m², upright, level or tilted, far from the origin.
    fn l_shapes() -> Vec<Vec<DVec3>> {
        let l = [[0.0, 0.0], [6.0, 0.0], [6.0, 1.0], [1.0, 1.0], [1.0, 6.0], [0.0, 6.0]];
        let far = DVec3::new(85_000.0, 447_000.0, 1.0);
        let planes = [
            (DVec3::X, DVec3::Y),
            (DVec3::Y, DVec3::Z),
            (DVec3::Z, DVec3::X),
            (DVec3::new(0.6, 0.8, 0.0), DVec3::new(0.0, 0.0, 1.0)),
            (DVec3::new(2.0, 1.0, 2.0) / 3.0, DVec3::new(-2.0, 2.0, 1.0) / 3.0),
        ];
        planes.map(|(u, v)| l.map(|[a, b]| far + u * a + v * b).to_vec()).to_vec()
    }

    #[test]
    fn concave_polygons_are_covered_alone_from_every_corner_and_in_both_senses() {
        for mut polygon in l_shapes() {
            for _ in 0..2 {
                for _ in 0..polygon.len() {
                    polygon.rotate_left(1);
                    let (area, faces, notes) = cut(&polygon);
                    assert!((area - 11.0).abs() < 1e-6, "{area}: {polygon:?}");
                    assert!(faces.len() == 4 && notes.is_empty(), "{notes:?}");
                }
                polygon.reverse();
            }
        }
    }

    /// trimesh's `polygonfaces.obj`: its fifth corner stands over the edge from the third to the fourth. The square has
    /// 4 m², and the lost triangle stands on it.
    #[test]
    fn corners_over_an_edge_keep_their_triangle() {
        let p = |x, y, z| DVec3::new(x, y, z);
        let mut polygon = vec![
            p(-1.0, 0.0, 1.0),
            p(1.0, 0.0, 1.0),
            p(1.0, 0.0, -1.0),
            p(-1.0, 0.0, -1.0),
            p(0.0, 1.0, -1.0),
        ];
        for turn in 0..5 {
            let (area, faces, notes) = cut(&polygon);
            let mut used: Vec<u32> = faces.as_flattened().to_vec();
            used.sort_unstable();
            used.dedup();
            assert!(faces.len() == 3 && used.len() == 5 && notes.is_empty(), "{turn}: {faces:?}");
            // Each edge of the outline is one of the surface's border: once in all triangles.
            let edges = |a: u32, b: u32| {
                faces.iter().filter(|face| face.contains(&a) && face.contains(&b)).count()
            };
            assert!((0..5).all(|i| edges(i, (i + 1) % 5) == 1), "{turn}: {faces:?}");
            assert!(area > 3.0, "{area}");
            polygon.rotate_left(1);
        }
    }

    #[test]
    fn convex_polygons_stay_fans() {
        let ring = |i: u32| DVec3::new(f64::from(i).cos(), f64::from(i).sin(), 0.5);
        let (_, faces, notes) = cut(&[0, 1, 2, 3, 4, 5].map(ring));
        assert_eq!(faces, [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]]);
        assert!(notes.is_empty());
    }

    /// A square of 16 m² with a hole of 4 m², whose outline runs to the hole and back.
    #[test]
    fn a_hole_on_a_bridge_with_repeated_and_straight_corners_stays_open() {
        let p = |x, y| DVec3::new(x, y, 2.0);
        let outline = [
            p(0.0, 0.0),
            p(2.0, 0.0),
            p(4.0, 0.0),
            p(4.0, 0.0),
            p(4.0, 4.0),
            p(0.0, 4.0),
            p(0.0, 0.0),
            p(1.0, 1.0),
            p(1.0, 3.0),
            p(3.0, 3.0),
            p(3.0, 1.0),
            p(1.0, 1.0),
        ];
        let (area, _, notes) = cut(&outline);
        assert!((area - 12.0).abs() < 1e-9 && notes.is_empty(), "{area}: {notes:?}");
    }

    #[test]
    fn crossed_and_degenerate_polygons_end_in_triangles_and_a_doubt() {
        let p = |x, y| DVec3::new(x, y, 0.0);
        let bow = [p(0.0, 0.0), p(4.0, 4.0), p(4.0, 0.0), p(0.0, 3.0), p(-1.0, 1.0)];
        let (_, faces, notes) = cut(&bow);
        assert!(!faces.is_empty());
        assert!(notes.len() == 1 && notes[0].is_doubt(), "{notes:?}");
        for none in [
            [p(0.0, 0.0); 5],
            [0.0, 1.0, 2.0, 3.0, 1.5].map(|x| p(x, x)),
            [p(f64::NAN, 0.0); 5],
            [p(1e300, -1e300); 5],
        ] {
            assert_eq!(cut(&none).1.len(), 3);
        }
        let huge: Vec<DVec3> =
            (0..9).map(|i| p(f64::from(i % 3) * 1e160, f64::from(i * i % 5) * 1e160)).collect();
        assert!(!cut(&huge).1.is_empty());
    }

    #[test]
    fn many_corners_in_disorder_take_a_moment() {
        use rand::{RngExt, SeedableRng};
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut point = || DVec3::new(rng.random(), rng.random(), rng.random());
        let start = std::time::Instant::now();
        let polygon: Vec<DVec3> = (0..MOST_CORNERS).map(|_| point()).collect();
        assert!(!cut(&polygon).1.is_empty());
        assert!(start.elapsed().as_secs() < 20, "{:?}", start.elapsed());
    }
}
