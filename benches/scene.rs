//! Seeded street scenes of any size: terrain, blocks of houses, cars, poles and crowns.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sightline::geom::TriangleSoup;

/// Half the edge of the square that is built over, in metres.
const HALF: f32 = 150.0;
/// Width of a street, and distance from one to the next.
const STREET: f32 = 16.0;
const BLOCK: f32 = 60.0;

/// A scene of about `triangles` triangles; the same seed gives the same scene.
///
/// Half of them are terrain; the rest is spread over a fixed set of objects, which become finer.
pub(crate) fn street_scene(triangles: usize, seed: u64) -> TriangleSoup {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut soup = TriangleSoup::default();
    let steps = ((triangles as f32 / 4.0).sqrt() as usize).max(2);
    patch(&mut soup, steps, steps, |s, t| {
        let (x, y) = (HALF * (2.0 * s - 1.0), HALF * (2.0 * t - 1.0));
        let z = 0.04 * (0.31 * x).sin() * (0.27 * y).cos() + 0.02 * (1.3 * x + 0.9 * y).sin();
        [x, y, z]
    });
    // Squares a side of a box, by the triangles that are left: about 900 boxes of six sides.
    let fine = ((triangles as f32 / 2.0 / (900.0 * 12.0)).sqrt().round() as usize).max(1);
    for _ in 0..200 {
        let at = off_street(&mut rng, 12.0);
        let half =
            [rng.random_range(4.0..10.0), rng.random_range(4.0..10.0), rng.random_range(2.0..12.0)];
        let yaw = if rng.random_bool(0.8) { 0.0 } else { rng.random_range(0.0..3.0) };
        block(&mut soup, [at[0], at[1], half[2] - 0.1], half, yaw, fine);
    }
    for _ in 0..100 {
        let (x, y) = loop {
            let (x, y): (f32, f32) =
                (rng.random_range(-100.0..100.0), rng.random_range(-60.0..60.0));
            if to_street(x, y) < STREET / 2.0 && (x.abs() > 5.0 || y.abs() > 2.6) {
                break (x, y);
            }
        };
        let yaw = if to_street(0.0, y) < STREET / 2.0 { rng.random_range(-0.1..0.1) } else { 1.57 };
        block(&mut soup, [x, y, 0.65], [2.2, 0.9, 0.4], yaw, fine);
        block(&mut soup, [x, y, 1.25], [1.2, 0.8, 0.3], yaw, fine);
    }
    for _ in 0..300 {
        let [x, y] = off_street(&mut rng, 0.5);
        let (half, height) = (rng.random_range(0.04..0.15), rng.random_range(1.5..4.0));
        block(&mut soup, [x, y, height - 0.1], [half, half, height], 0.0, fine);
    }
    for _ in 0..200 {
        let [x, y] = off_street(&mut rng, 1.5);
        let r: f32 = rng.random_range(1.0..2.5);
        patch(&mut soup, 3 * fine, 2 * fine, |s, t| {
            let (sin_a, cos_a) = (std::f32::consts::TAU * s).sin_cos();
            let (sin_e, cos_e) = (std::f32::consts::PI * (t - 0.5)).sin_cos();
            [x + r * cos_e * cos_a, y + r * cos_e * sin_a, r + 2.0 + 1.2 * r * sin_e]
        });
    }
    soup.face_class = vec![0; soup.faces.len()];
    soup
}

/// Distance to the axis of the nearest street.
fn to_street(x: f32, y: f32) -> f32 {
    let along = |v: f32| (v - (v / BLOCK).round() * BLOCK).abs();
    along(x).min(along(y))
}

fn off_street(rng: &mut ChaCha8Rng, margin: f32) -> [f32; 2] {
    loop {
        let [x, y] = [0; 2].map(|_| rng.random_range(-HALF..HALF));
        if to_street(x, y) > STREET / 2.0 + margin {
            return [x, y];
        }
    }
}

/// A grid of `u` × `v` squares with shared corners, two triangles each.
fn patch(soup: &mut TriangleSoup, u: usize, v: usize, at: impl Fn(f32, f32) -> [f32; 3]) {
    let base = soup.vertices.len() as u32;
    for i in 0..=u {
        for j in 0..=v {
            soup.vertices.push(at(i as f32 / u as f32, j as f32 / v as f32));
        }
    }
    for i in 0..u as u32 {
        for j in 0..v as u32 {
            let corner = |i: u32, j: u32| base + i * (v as u32 + 1) + j;
            let [a, b, c, d] =
                [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            soup.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
}

/// A box turned about z, each side of `fine` × `fine` squares.
fn block(soup: &mut TriangleSoup, centre: [f32; 3], half: [f32; 3], yaw: f32, fine: usize) {
    let (sin, cos) = yaw.sin_cos();
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            patch(soup, fine, fine, |s, t| {
                let mut p = [0.0; 3];
                p[axis] = side * half[axis];
                p[(axis + 1) % 3] = (2.0 * s - 1.0) * half[(axis + 1) % 3];
                p[(axis + 2) % 3] = (2.0 * t - 1.0) * half[(axis + 2) % 3];
                [
                    centre[0] + cos * p[0] - sin * p[1],
                    centre[1] + sin * p[0] + cos * p[1],
                    centre[2] + p[2],
                ]
            });
        }
    }
}
