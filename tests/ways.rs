//! Casting a batch against the reference: the same bits for every soup, table and set of poses.

use lidar_cast::bvh::NO_HIT;
use lidar_cast::cast::{Caster, cast_closest};
use lidar_cast::task::DevicePose;
use sightline::geom::Pose;
use sightline::internals::hostile_placements;
use sightline::problem::{Frame, Instance};

use crate::common::*;

fn roi() -> Roi {
    Roi::new([-8.0; 3], [0.5; 3], [32; 3]).unwrap()
}

/// Random soups, and what triangles are at their worst: flat in an axis, thin, without area, doubled,
/// huge, tiny, far away, none at all.
fn soups() -> Vec<TriangleSoup> {
    let mut soups = vec![TriangleSoup::default(), random_soup(1, 1, 6.0), random_soup(2, 700, 6.0)];
    let mut ugly = random_soup(3, 200, 6.0);
    let mut rng = rng(4);
    for (index, face) in ugly.faces.clone().into_iter().enumerate() {
        let [a, b, c] = face.map(|v| v as usize);
        match index % 8 {
            0 => (0..3).for_each(|k| ugly.vertices[face[k] as usize][index % 3] = 2.0),
            1 => ugly.vertices[b] = ugly.vertices[a].map(|v| v + 1e-6),
            2 => ugly.vertices[c] = ugly.vertices[a],
            3 => ugly.faces.push(face),
            4 => (0..3).for_each(|k| {
                ugly.vertices[face[k] as usize] = ugly.vertices[face[k] as usize].map(|v| 1e4 * v)
            }),
            5 => (0..3).for_each(|k| {
                ugly.vertices[face[k] as usize] = ugly.vertices[face[k] as usize].map(|v| 1e-3 * v)
            }),
            6 => ugly.vertices[a] = ugly.vertices[rng.random_range(0..ugly.vertices.len())],
            _ => (0..3).for_each(|k| ugly.vertices[face[k] as usize][0] += 1e5),
        }
    }
    ugly.face_class = vec![0; ugly.faces.len()];
    soups.push(ugly);
    soups
}

fn tables() -> Vec<BeamTable> {
    let spinning =
        |channels: &[(f64, f64)], steps| BeamTable::spinning(channels, steps, 30.0).unwrap();
    let mut rng = rng(5);
    let scattered: Vec<DVec3> = (0..201).map(|_| random_vec(&mut rng, 1.0).as_dvec3()).collect();
    let axes = [DVec3::X, -DVec3::X, DVec3::Y, -DVec3::Y, DVec3::Z, -DVec3::Z, DVec3::ONE];
    vec![
        spinning(&[(-30.0, 0.0), (-10.0, 0.2), (0.0, 0.0), (45.0, 0.0), (90.0, 0.0)], 37),
        BeamTable::from_directions(scattered, 30.0).unwrap(),
        BeamTable::from_directions(axes, 30.0).unwrap(),
    ]
}

/// Poses in which all rotations are equal, some are, and none are.
fn pose_sets() -> Vec<Vec<SensorPose>> {
    let mut rng = rng(6);
    let mut pose = |turn: f64| {
        let [x, y, z] = random_vec(&mut rng, 3.0).as_dvec3().to_array();
        let [roll, pitch, yaw] = [0; 3].map(|_| turn * rng.random_range(-1.0..1.0));
        SensorPose::from_values([x, y, z, roll, pitch, yaw])
    };
    let level: Vec<_> = (0..100).map(|_| pose(0.0)).collect();
    let tilted: Vec<_> =
        (0..30).map(|_| SensorPose { pitch: 0.1, yaw: 1.0, ..pose(0.0) }).collect();
    let free: Vec<_> = (0..37).map(|_| pose(3.0)).collect();
    let hostile = hostile_placements(&roi(), 28, 7).into_iter().flat_map(|p| p.lidars).collect();
    let mixed = [&level[..70], &tilted, &free[..5]].concat();
    vec![level[..1].to_vec(), free[..3].to_vec(), level, free, mixed, hostile]
}

/// A tree in the ego frame, once for each of `numbers`, from which its triangles are numbered.
fn frame(tree: &Arc<Bvh>, numbers: &[u32]) -> Frame {
    let ego_from_instance = Pose::IDENTITY;
    let instance = |&first_prim| Instance { tree: tree.clone(), ego_from_instance, first_prim };
    Frame::new(numbers.iter().map(instance))
}

#[test]
fn grids_and_lists_of_beams_give_the_bits_of_the_reference() {
    let (mut beams, mut found) = (0, 0);
    for soup in soups() {
        let bvh = Arc::new(Bvh::build(&soup, 30.0));
        for table in tables() {
            for poses in pose_sets() {
                let sensors: Vec<_> = poses.iter().map(|p| p.ego_from_sensor()).collect();
                let poses: Vec<_> =
                    poses.iter().map(|p| DevicePose::new(&p.ego_from_sensor(), &roi())).collect();
                let faces = soup.faces.len();
                for range in [30.0, 2.5] {
                    let want = cast_closest(&poses, &table, &bvh, range);
                    // Values of before must not shine through.
                    let mut got = vec![Hit { t: f32::NAN, prim: 77 }; 5000];
                    let caster = Caster::new(&table);
                    caster.closest_hits(&poses, &bvh, range, &mut got);
                    assert!(bits(&got) == bits(&want), "{faces} triangles");
                    // Twice in a frame, numbered from 0 and from 7 on, in either order: of equal
                    // distances the lower number counts.
                    for numbers in [vec![0, 7], vec![7, 0], vec![7]] {
                        caster.cast_frame(&sensors, &frame(&bvh, &numbers), range, &mut got);
                        let lowest = numbers.iter().min().copied().unwrap_or(0);
                        let moved = |hit: &Hit| match hit.prim {
                            NO_HIT => *hit,
                            prim => Hit { t: hit.t, prim: prim + lowest },
                        };
                        let want: Vec<Hit> = want.iter().map(moved).collect();
                        assert!(bits(&got) == bits(&want), "{faces} × {numbers:?}");
                    }
                    beams += want.len();
                    found += want.iter().filter(|h| h.is_hit()).count();
                }
            }
        }
    }
    assert!(found * 10 > beams, "only {found} of {beams} beams hit: the scenes are trivial");
}
