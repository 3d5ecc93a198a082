//! `cast_closest` against its CPU twin, bit by bit.

use lidar_cast::cast::cast_closest;
use lidar_cast::task::DevicePose;

use crate::common::*;

const RANGE: f64 = 40.0;

fn level(x: f64, y: f64, z: f64) -> SensorPose {
    SensorPose { x, y, z, ..SensorPose::default() }
}

/// Casts all sensors at once, up to the range of the table.
fn assert_same_hits(soup: &TriangleSoup, table: BeamTable, lidars: Vec<SensorPose>, least: f64) {
    let range = table.range();
    let roi = Roi::new([-4.0; 3], [0.5; 3], [16; 3]).unwrap();
    let poses: Vec<DevicePose> =
        lidars.iter().map(|l| DevicePose::new(&l.ego_from_sensor(), &roi)).collect();
    let bvh = Arc::new(Bvh::build(soup, range));
    let want = cast_closest(&poses, &table, &bvh, range);
    let share = want.iter().filter(|h| h.is_hit()).count() as f64 / want.len() as f64;
    assert!(share > least, "only {share} of the beams hit: the scene is trivial");
    let problem = Problem::from(Task::new(roi, random_content(1, &roi), table, vec![bvh], true));
    let problem = Arc::new(problem);
    let got = gpu(&problem).hits(&lidars, 0).unwrap();
    let differ = want.iter().zip(&got);
    let differ = differ.filter(|(a, b)| (a.t.to_bits(), a.prim) != (b.t.to_bits(), b.prim));
    assert_eq!(differ.count(), 0, "of {} hits", want.len());
}

/// A grid of squares over ±`half` metres, two triangles each.
fn ground(squares: u32, half: f32, height: impl Fn(f32, f32) -> f32) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    let at = |i: u32| half * (2.0 * i as f32 / squares as f32 - 1.0);
    for i in 0..=squares {
        let row = (0..=squares).map(|j| [at(i), at(j), height(at(i), at(j))]);
        soup.vertices.extend(row);
    }
    for i in 0..squares {
        for j in 0..squares {
            let corner = |i: u32, j: u32| i * (squares + 1) + j;
            let [a, b, c, d] =
                [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            soup.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    soup.face_class = vec![0; soup.faces.len()];
    soup
}

#[test]
fn sensors_of_one_rotation_and_of_many() {
    // Many sensors of three rotations, and sensors of rotations of their own.
    let mut rng = rng(71);
    let mut lidars = Vec::new();
    for (count, yaw) in [(130, 0.0), (40, 0.31), (10, -2.0)] {
        for _ in 0..count {
            let [x, y] = [0; 2].map(|_| rng.random_range(-0.8..0.8));
            lidars.push(SensorPose { yaw, ..level(x, y, rng.random_range(1.5..2.5)) });
        }
    }
    for _ in 0..12 {
        let [roll, pitch, yaw] = [0; 3].map(|_| rng.random_range(-1.5..1.5));
        lidars.push(SensorPose { roll, pitch, yaw, ..level(0.1, -0.2, 2.0) });
    }
    let channels: Vec<(f64, f64)> = (0..7).map(|k| (-31.0 + 7.0 * f64::from(k), 0.2)).collect();
    let table = || BeamTable::spinning(&channels, 41, RANGE).unwrap();
    let fine = ground(220, 30.0, |x, y| 0.2 * (0.7 * x).sin() * (0.9 * y).cos());
    assert_same_hits(&fine, table(), lidars.clone(), 0.5);
    assert_same_hits(&random_soup(72, 4000, 25.0), table(), lidars, 0.5);
}

#[test]
fn beams_through_edges_corners_and_degenerate_triangles() {
    // Everything at whole numbers and in multiples of 45°: beams run in faces, through edges and
    // corners, and beside flat boxes by a rounding.
    let mut soup = ground(16, 16.0, |_, _| 0.0);
    let walls = ground(16, 8.0, |_, _| 5.0);
    for turn in 0..2 {
        let first = soup.vertices.len() as u32;
        soup.vertices.extend(
            walls.vertices.iter().map(|&[x, y, z]| if turn == 0 { [z, x, y] } else { [x, -z, y] }),
        );
        soup.faces.extend(walls.faces.iter().map(|face| face.map(|corner| corner + first)));
    }
    // A point, a line and a sliver, twice.
    for corners in [
        [[3.0, 0.0, 1.0], [3.0, 0.0, 1.0], [3.0, 0.0, 1.0]],
        [[2.0, -1.0, 1.0], [2.0, 0.0, 1.0], [2.0, 1.0, 1.0]],
        [[4.0, -2.0, 1.0], [4.0, 2.0, 1.0], [4.0, 2.0, 1.0 + 1e-6]],
    ] {
        for _ in 0..2 {
            let first = soup.vertices.len() as u32;
            soup.vertices.extend(corners);
            soup.faces.push([first, first + 1, first + 2]);
        }
    }
    soup.face_class = vec![0; soup.faces.len()];
    let channels: Vec<(f64, f64)> = (-2..=2).map(|k| (45.0 * f64::from(k), 0.0)).collect();
    let table = || BeamTable::spinning(&channels, 8, RANGE).unwrap();
    let grid = |count: i32, step: f64| -> Vec<SensorPose> {
        (0..count * count)
            .map(|k| level(step * f64::from(k / count), step * f64::from(k % count), 1.0))
            .collect()
    };
    assert_same_hits(&soup, table(), grid(9, 0.5), 0.3);
    // All in one point, and on their own.
    assert_same_hits(&soup, table(), vec![level(0.0, 0.0, 1.0); 64], 0.3);
    let turned = |k: u32| SensorPose { yaw: f64::from(k) * 0.25, ..level(1.0, 1.0, 1.0) };
    assert_same_hits(&soup, table(), (0..9).map(turned).collect(), 0.3);
}

#[test]
fn sizes_at_which_devices_flush_or_overflow_are_cast_alike() {
    // Products of coordinates of 1e-19 m are denormal, which a device may flush to zero; those of 1e13 m and more lie
    // outside the kernel's range. The host casts such beams.
    let channels: Vec<(f64, f64)> = (-4..=4).map(|k| (17.0 * f64::from(k), 0.1)).collect();
    for scale in [1e-38, 1e-31, 1e-22, 1e-19, 1e-17, 1e-12, 1e6, 1e13, 1e15] {
        let table = BeamTable::spinning(&channels, 24, RANGE.max(RANGE * scale)).unwrap();
        let mut soup = random_soup(73, 120, 4.0);
        // Some sides on whole numbers, so that some coordinates are equal and some zero.
        for (index, vertex) in soup.vertices.iter_mut().enumerate() {
            let vertex_in_grid = vertex.map(|v| if index % 4 == 0 { v.round() } else { v });
            *vertex = vertex_in_grid.map(|v| (f64::from(v) * scale) as f32);
        }
        let at = |k: i32| level(f64::from(k / 3) * scale, f64::from(k % 3) * scale, 0.25 * scale);
        // Below 1e-31 m no distance is above zero.
        let least = if scale < 1e-30 { -1.0 } else { 0.05 };
        assert_same_hits(&soup, table, (0..9).map(at).collect(), least);
    }
}

/// A short stack leaves most beams to the host, which casts them to the same bits.
#[test]
fn stacks_that_overflow_change_no_bit() {
    let problem = random_problem(11, true);
    let sensors = [level(0.0, 0.0, 0.0), level(1.5, -2.0, 0.5)];
    let want = cpu(&problem).hits(&sensors, 0).unwrap();
    let mut device = gpu(&problem);
    let mut hits = vec![device.hits(&sensors, 0).unwrap()];
    device.rewrite_kernels(|_, source| {
        let (long, short) = ("STACK_ENTRIES: u32 = 24u", "STACK_ENTRIES: u32 = 4u");
        assert!(source.contains(long), "the kernels changed, and this test has to");
        source.replace(long, short)
    });
    hits.push(device.hits(&sensors, 0).unwrap());
    assert!(want.iter().filter(|hit| hit.is_hit()).count() > 100);
    for got in hits {
        let equal = |(a, b): (&Hit, &Hit)| (a.t.to_bits(), a.prim) == (b.t.to_bits(), b.prim);
        assert!(want.iter().zip(&got).all(equal) && want.len() == got.len());
    }
}
