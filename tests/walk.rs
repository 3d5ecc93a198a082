//! One walk a sensor against casting beam by beam: the same bits, whatever the sensor and the scene.

use lidar_cast::bvh::{NO_HIT, Ray};
use lidar_cast::cast::{Caster, Instructions, TreeView, cast_closest};
use lidar_cast::task::{DevicePose, beam_direction};
use rand_chacha::ChaCha8Rng;

use crate::common::*;

const RANGE: f32 = 60.0;
const ALL: [Instructions; 3] = [Instructions::Best, Instructions::Avx2, Instructions::Plain];

/// Rounds of random sensors, many where everything is asked for.
fn rounds(few: usize) -> usize {
    if std::env::var_os("SIGHTLINE_FULL").is_some() { 40 * few } else { few }
}

fn device(pose: &SensorPose) -> DevicePose {
    DevicePose::new(&pose.ego_from_sensor(), &Roi::new([-8.0; 3], [0.5; 3], [32; 3]).unwrap())
}

/// A square of `cells` × `cells` cells, each of two triangles, with corners where `at` puts them.
fn patch(soup: &mut TriangleSoup, cells: u32, at: impl Fn(f32, f32) -> [f32; 3]) {
    let base = soup.vertices.len() as u32;
    for i in 0..=cells {
        for j in 0..=cells {
            soup.vertices.push(at(i as f32 / cells as f32, j as f32 / cells as f32));
        }
    }
    for i in 0..cells {
        for j in 0..cells {
            let corner = |i, j| base + i * (cells + 1) + j;
            let [a, b, c, d] =
                [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            soup.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    soup.face_class = vec![0; soup.faces.len()];
}

/// Ground with corners at whole metres, hills, level walls at the height of sensors, and closed boxes
/// with faces that coincide.
fn town(seed: u64, cells: u32) -> TriangleSoup {
    let mut rng = rng(seed);
    let mut soup = TriangleSoup::default();
    patch(&mut soup, cells, |s, t| [80.0 * s - 40.0, 80.0 * t - 40.0, 0.0]);
    patch(&mut soup, cells, |s, t| {
        let (x, y) = (100.0 * s - 50.0, 100.0 * t - 50.0);
        [x, y, 0.7 * (0.3 * x).sin() * (0.4 * y).cos() - 0.2]
    });
    for _ in 0..20 {
        let middle = random_vec(&mut rng, 20.0).round();
        let half = random_vec(&mut rng, 3.0).abs().ceil();
        for axis in 0..3 {
            for side in [-1.0, 1.0] {
                patch(&mut soup, cells.div_ceil(20), |s, t| {
                    let mut place = [0.0; 3];
                    place[axis] = side;
                    place[(axis + 1) % 3] = 2.0 * s - 1.0;
                    place[(axis + 2) % 3] = 2.0 * t - 1.0;
                    [0, 1, 2].map(|k| middle[k] + half[k] * place[k])
                });
            }
        }
    }
    soup
}

/// Small and thin triangles far away, some without area, and doubled ones.
fn splinters(seed: u64) -> TriangleSoup {
    let mut rng = rng(seed);
    let mut soup = TriangleSoup::default();
    for face in 0..3000_u32 {
        let middle = random_vec(&mut rng, 30.0);
        let size = [3.0, 0.1, 1e-3, 1e-5][face as usize % 4];
        let along = random_vec(&mut rng, size);
        let thin = [1.0, 1e-2, 1e-4, 0.0][face as usize / 4 % 4];
        let across = thin * random_vec(&mut rng, size);
        let corners =
            [middle, middle + along, middle + rng.random_range(0.0..2.0) * along + across];
        soup.vertices.extend(corners.map(|corner| corner.to_array()));
        soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
    }
    soup.faces.extend_from_within(..300);
    soup.face_class = vec![0; soup.faces.len()];
    soup
}

/// Grids of many shapes: channels in any order, up to the poles, with offsets; few and many steps; whole
/// turns and sectors.
fn tables(rng: &mut ChaCha8Rng) -> Vec<BeamTable> {
    let range = f64::from(RANGE);
    let spinning = |channels: &[(f64, f64)], n| BeamTable::spinning(channels, n, range).unwrap();
    let sector =
        |channels: &[(f64, f64)], at, n| BeamTable::sector(channels, at, n, range).unwrap();
    let even = |n: usize, low: f64, high: f64| -> Vec<(f64, f64)> {
        (0..n).map(|k| (low + (high - low) * k as f64 / (n - 1) as f64, 0.0)).collect()
    };
    let mut offset = |n: usize, most: f64| -> Vec<(f64, f64)> {
        (0..n).map(|_| (rng.random_range(-90.0..90.0), rng.random_range(-most..most))).collect()
    };
    vec![
        spinning(&even(16, -24.8, 2.0), 97),
        spinning(&even(19, -90.0, 90.0), 40),
        spinning(&offset(21, 7.0), 61),
        spinning(&offset(5, 180.0), 7),
        spinning(&even(40, -20.0, 20.0), 250),
        spinning(&[(85.0, 0.3)], 33),
        spinning(&[(0.0, 0.0)], 1),
        spinning(&[(0.0, 0.0), (89.9, 1.0), (-89.95, -1.0), (-90.0, 0.0)], 90),
        sector(&even(24, -12.0, 12.0), [-60.0, 0.77], 150),
        sector(&offset(9, 4.0), [170.3, 1.9], 21),
        sector(&even(8, -5.0, 60.0), [10.0, 0.3], 1111),
        sector(&even(3, -5.0, 5.0), [0.0, 350.0], 1),
        sector(&offset(7, 20.0), [-90.0, 3.6], 100),
    ]
}

/// Sensors of any rotation, and level ones exactly above and inside the corners and edges of a town.
fn poses(rng: &mut ChaCha8Rng, count: usize) -> Vec<SensorPose> {
    let mut pose = |index: usize| {
        let [x, y, z] = random_vec(rng, 15.0).as_dvec3().to_array();
        let turn = [3.1, 0.3, 0.0, 0.0][index % 4];
        let [roll, pitch, yaw] = [0; 3].map(|_| turn * rng.random_range(-1.0..1.0));
        let whole = index % 4 == 3;
        let [x, y, z] = if whole { [x, y, z].map(f64::round) } else { [x, y, z / 3.0 + 3.0] };
        SensorPose::from_values([x, y, z, roll, pitch, yaw])
    };
    (0..count).map(&mut pose).collect()
}

fn assert_same(got: &[Hit], want: &[Hit], what: &str) {
    assert_eq!(got.len(), want.len());
    for (index, (got, want)) in got.iter().zip(want).enumerate() {
        let same = (got.t.to_bits(), got.prim) == (want.t.to_bits(), want.prim);
        assert!(same, "{what}: beam {index} hits {got:?}, not {want:?}");
    }
}

/// Compares all instructions in some scenes; beams, and how many of them hit.
fn compare(soups: &[TriangleSoup], seed: u64, count: usize) -> [usize; 2] {
    let mut rng = rng(seed);
    let [mut beams, mut found] = [0; 2];
    for (index, soup) in soups.iter().enumerate() {
        let bvh = Bvh::build(soup, RANGE);
        for (which, table) in tables(&mut rng).iter().enumerate() {
            let poses: Vec<_> = poses(&mut rng, count).iter().map(device).collect();
            let range = [RANGE, 7.0][which % 2];
            let want = cast_closest(&poses, table, &bvh, range);
            for instructions in ALL {
                let caster = Caster::by(instructions, table);
                let mut got = vec![Hit { t: f32::NAN, prim: 77 }; 5];
                caster.closest_hits(&poses, &bvh, range, &mut got);
                let what = format!("{instructions:?}, seed {seed}, scene {index}, table {which}");
                assert_same(&got, &want, &what);
            }
            beams += want.len();
            found += want.iter().filter(|hit| hit.is_hit()).count();
        }
    }
    [beams, found]
}

#[test]
fn a_walk_gives_the_bits_of_single_beams() {
    let soups = [
        town(1, 20),
        splinters(2),
        random_soup(3, 700, 6.0),
        random_soup(4, 5, 6.0),
        random_soup(5, 2000, 1e-3),
        TriangleSoup::default(),
    ];
    for seed in 0..rounds(1) as u64 {
        let [beams, found] = compare(&soups, 100 + seed, 4);
        assert!(found * 10 > beams, "only {found} of {beams} beams hit: the scenes are trivial");
    }
}

#[test]
fn a_walk_of_many_triangles_gives_the_bits_of_single_beams() {
    for round in 0..rounds(1) as u64 {
        let large =
            if round % 2 == 0 { town(6 + round, 220) } else { random_soup(round, 50_000, 40.0) };
        let [beams, found] = compare(&[large], 200 + round, 4);
        assert!(found * 4 > beams, "only {found} of {beams} beams hit: the scene is trivial");
    }
}

#[test]
fn beams_along_edges_and_into_corners_have_the_same_bits() {
    // Sensors at whole metres, beams in whole directions: every one ends on an edge or a corner, or runs
    // along a face.
    let soup = town(7, 40);
    let bvh = Bvh::build(&soup, RANGE);
    let channels = [-90.0, -45.0, -30.0, 0.0, 45.0, 60.0, 90.0].map(|e| (e, 0.0));
    let table = BeamTable::spinning(&channels, 72, f64::from(RANGE)).unwrap();
    let quarter = std::f64::consts::FRAC_PI_2;
    let mut rng = rng(8);
    let poses: Vec<DevicePose> = (0..60)
        .map(|_| {
            let [x, y, z] = random_vec(&mut rng, 12.0).as_dvec3().round().to_array();
            let mut turn = || quarter * f64::from(rng.random_range(-2..=2_i32));
            device(&SensorPose::from_values([x, y, z.abs(), turn(), turn(), turn()]))
        })
        .collect();
    let want = cast_closest(&poses, &table, &bvh, RANGE);
    for instructions in ALL {
        let caster = Caster::by(instructions, &table);
        let mut got = Vec::new();
        caster.closest_hits(&poses, &bvh, RANGE, &mut got);
        assert_same(&got, &want, &format!("{instructions:?}"));
    }
}

#[test]
fn hits_are_replaced_where_others_are_closer() {
    let mut rng = rng(9);
    let scattered: Vec<DVec3> = (0..301).map(|_| random_vec(&mut rng, 1.0).as_dvec3()).collect();
    let list = BeamTable::from_directions(scattered, f64::from(RANGE)).unwrap();
    let soups = [town(10, 20), random_soup(11, 300, 10.0), town(10, 20), random_soup(12, 3, 4.0)];
    let trees: Vec<Bvh> = soups.iter().map(|soup| Bvh::build(soup, RANGE)).collect();
    // The third is the first again: equal distances go to the lower face.
    let firsts = [400_000, 7, 0, 1_000_000];
    for table in tables(&mut rng).into_iter().chain([list]) {
        let poses: Vec<Vec<DevicePose>> =
            (0..4).map(|_| poses(&mut rng, 4).iter().map(device).collect()).collect();
        for own in &poses {
            // A pose in each tree's frame; the first and the third are in the same one.
            let own = [own[0], own[1], own[0], own[3]];
            let mut want = vec![Hit { t: 9.0, prim: NO_HIT }; table.directions().len()];
            for ((bvh, pose), first) in trees.iter().zip(&own).zip(firsts) {
                for (hit, &direction) in want.iter_mut().zip(table.directions()) {
                    let origin = pose.rows.map(|row| row[3]).into();
                    let ray = Ray::new(origin, beam_direction(pose, direction), 9.0);
                    let found = bvh.closest_hit(&ray);
                    let found = Hit { t: found.t, prim: found.prim.saturating_add(first) };
                    if found.t < hit.t || found.t == hit.t && found.prim < hit.prim {
                        *hit = found;
                    }
                }
            }
            let parts: Vec<TreeView<'_>> = trees
                .iter()
                .zip(own)
                .zip(firsts)
                .map(|((bvh, pose), first_prim)| TreeView { bvh, pose, first_prim })
                .collect();
            for instructions in ALL {
                let caster = Caster::by(instructions, &table);
                let mut got = vec![Hit { t: 9.0, prim: NO_HIT }; want.len()];
                caster.closer_hits(&parts, &mut got);
                assert_same(&got, &want, &format!("{instructions:?}, at once"));
                got.fill(Hit { t: 9.0, prim: NO_HIT });
                parts.iter().rev().for_each(|part| caster.closer_hits(&[*part], &mut got));
                assert_same(&got, &want, &format!("{instructions:?}, one by one"));
            }
        }
    }
}

#[test]
fn what_cannot_be_walked_is_cast_beam_by_beam() {
    let table = BeamTable::spinning(&[(-10.0, 0.0), (10.0, 0.0)], 33, 1e9).unwrap();
    let far = |shift: f32| {
        let mut soup = random_soup(13, 500, 6.0);
        soup.vertices.iter_mut().for_each(|vertex| vertex[0] += shift);
        soup
    };
    for shift in [0.0, 1e5, 1e8] {
        let bvh = Bvh::build(&far(shift), 100.0);
        let x = f64::from(shift);
        let mut pose = device(&SensorPose::from_values([x, 0.1, 0.2, 0.3, 0.2, 0.1]));
        for stretch in [1.0, 1.5] {
            // A pose that is no rotation.
            pose.rows[0][0] *= stretch;
            let want = cast_closest(&[pose], &table, &bvh, 100.0);
            let mut got = Vec::new();
            Caster::new(&table).closest_hits(&[pose], &bvh, 100.0, &mut got);
            assert_same(&got, &want, &format!("shift {shift}, stretch {stretch}"));
        }
    }
}
