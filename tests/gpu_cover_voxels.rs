//! `cover_voxels` against its CPU twin: sensors in the grid by the kernel, others by the host.

use lidar_cast::cover::{BitOrder, cover_voxels};
use lidar_cast::task::DevicePose;

use crate::common::*;

/// Along the axes, through edges and corners of voxels all the way, through some of them, and any.
fn directions(seed: u64) -> Vec<DVec3> {
    let mut directions: Vec<DVec3> = (0..125)
        .map(|k| DVec3::from([k / 25 - 2, k / 5 % 5 - 2, k % 5 - 2].map(f64::from)))
        .filter(|&d| d != DVec3::ZERO)
        .collect();
    let mut rng = rng(seed);
    for _ in 0..200 {
        let d = DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
        // Some nearly level, which cross a plane of one axis at most.
        directions.extend([d, d * DVec3::new(1.0, 1.0, 1e-6), d * DVec3::new(1e-9, 1.0, 1e-3)]);
    }
    directions
}

/// Level sensors `outside` voxels beyond the grid or within it, on corners, faces and anywhere.
fn poses(roi: &Roi, outside: f64, count: usize, seed: u64) -> Vec<SensorPose> {
    let mut rng = rng(seed);
    let mut pose = |kind: usize| {
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let n = f64::from(roi.shape()[axis]);
            let at = rng.random_range(-outside..n + outside);
            let at = if kind % 4 > axis { at.floor() } else { at };
            roi.min()[axis] + at * roi.voxel()[axis]
        });
        SensorPose { x, y, z, ..SensorPose::default() }
    };
    (0..count).map(&mut pose).collect()
}

/// Compares the bitmaps and the sums; returns the voxels covered.
fn compare(roi: Roi, poses: &[SensorPose], range: f64, seed: u64) -> u64 {
    let table = BeamTable::from_directions(directions(seed), range).unwrap();
    let content = random_content(seed, &roi);
    let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![], false)));
    let on_device: Vec<DevicePose> =
        poses.iter().map(|pose| DevicePose::new(&pose.ego_from_sensor(), &roi)).collect();
    let mut want = Vec::new();
    cover_voxels(&on_device, problem.sensors().table(0), &roi, None, range as f32, &mut want);
    let mut device = gpu(&problem);
    let got = device.bitmaps(poses, 0).unwrap();
    let linear = BitOrder::linear(&roi);
    let maps = got.sensors().zip(want.chunks(linear.words()));
    for (sensor, (map, want)) in maps.enumerate() {
        assert!(got.order.convert(map, &linear) == want, "{:?}, {:?}", roi.shape(), poses[sensor]);
    }
    let name = String::new;
    let placements: Vec<Placement> =
        poses.chunks(3).map(|p| Placement { name: name(), lidars: p.to_vec() }).collect();
    let tallies = cpu(&problem).tally(&placements, Some(range as f32)).unwrap();
    assert_eq!(tallies, device.tally(&placements, Some(range as f32)).unwrap());
    want.iter().map(|word| u64::from(word.count_ones())).sum()
}

#[test]
fn grids_of_any_shape_are_covered_alike() {
    let shapes = [[24, 20, 13], [41, 7, 3], [5, 66, 2], [1, 1, 70], [3, 1, 1], [33_000, 2, 2]];
    for (seed, shape) in (71..).zip(shapes) {
        let roi = Roi::new([-3.0, 1.0, -0.5], [0.5; 3], shape).unwrap();
        // In the grid, about it, and far from it.
        assert!(compare(roi, &poses(&roi, 0.0, 24, seed), 400.0, seed) > 70, "{shape:?}");
        for outside in [3.0, 60.0] {
            compare(roi, &poses(&roi, outside, 12, seed), 400.0, seed);
        }
    }
}

#[test]
fn beams_that_end_anywhere_are_covered_alike() {
    let roi = Roi::new([-3.0; 3], [0.5, 0.25, 0.125], [24, 48, 30]).unwrap();
    let poses = poses(&roi, 0.0, 16, 81);
    // On planes that beams along the axes cross, between them, within the first voxel.
    for range in [0.01, 0.125, 0.25, 0.5, 1.0, 1.3, 2.0, 3.7] {
        assert!(compare(roi, &poses, range, 82) > 15, "{range}");
    }
}
