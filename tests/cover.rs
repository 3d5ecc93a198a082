//! Covered voxels against a slab test of every voxel in f64.

use lidar_cast::bvh::NO_HIT;
use lidar_cast::cast::cast_frame_closest;
use lidar_cast::task::{DevicePose, beam_direction};
use sightline::geom::Pose;

use crate::common::*;

/// How long a beam [0, t_end] stays inside a voxel grown by `grow` metres on every side; negative
/// when it misses.
fn stay(roi: &Roi, voxel: [u32; 3], o: DVec3, d: DVec3, t_end: f64, grow: f64) -> f64 {
    let (mut enter, mut leave) = (0.0_f64, t_end + grow);
    for axis in 0..3 {
        let low = roi.min()[axis] + f64::from(voxel[axis]) * roi.voxel()[axis] - grow;
        let high = low + roi.voxel()[axis] + 2.0 * grow;
        if d[axis] == 0.0 {
            if o[axis] < low || o[axis] >= high {
                return -1.0;
            }
            continue;
        }
        let (a, b) = ((low - o[axis]) / d[axis], (high - o[axis]) / d[axis]);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    leave - enter
}

#[test]
fn coverage_agrees_with_a_slab_test_of_every_voxel() {
    // Rounding may decide about a voxel only where the beam clips it by less than this (m).
    const TOLERANCE: f64 = 2e-5;
    let (mut checked, mut undecided) = (0_u64, 0_u64);
    for (seed, ends_at_hits) in [(11, true), (12, true), (13, false)] {
        let problem = random_problem(seed, ends_at_hits);
        let roi = problem.roi();
        for placement in random_placements(seed, 6, 7.0) {
            let covered = cpu(&problem).covered(&placement, 0).unwrap();
            let poses: Vec<DevicePose> = placement
                .lidars
                .iter()
                .map(|l| DevicePose::new(&l.ego_from_sensor(), roi))
                .collect();
            let table = problem.sensors().table(0);
            let sensors: Vec<Pose> = placement.lidars.iter().map(|l| l.ego_from_sensor()).collect();
            let frame = problem.geometry(0).unwrap();
            let hits = cast_frame_closest(&sensors, table, frame, table.range());
            let mut beams = Vec::new();
            for (pose, row) in poses.iter().zip(hits.chunks(table.directions().len())) {
                for (&direction, hit) in table.directions().iter().zip(row) {
                    let hit_end = f64::from(hit.t) + 1e-3;
                    let ends = ends_at_hits && hit.prim != NO_HIT;
                    let t_end = if ends { hit_end } else { f64::from(table.range()) };
                    let origin = Vec3::from(pose.rows.map(|r| r[3])).as_dvec3();
                    beams.push((origin, beam_direction(pose, direction).as_dvec3(), t_end));
                }
            }
            for index in 0..roi.voxel_count() {
                let [_, ny, nz] = roi.shape().map(u64::from);
                let voxel = [index / (ny * nz), index / nz % ny, index % nz].map(|i| i as u32);
                let best = |grow: f64| {
                    let stays = beams.iter().map(|&(o, d, t)| stay(roi, voxel, o, d, t, grow));
                    stays.fold(-1.0_f64, f64::max)
                };
                let ours = covered.binary_search(&index).is_ok();
                checked += 1;
                if best(-TOLERANCE) > 0.0 {
                    assert!(ours, "voxel {voxel:?} is traversed, but not covered");
                } else if best(TOLERANCE) < 0.0 {
                    assert!(!ours, "voxel {voxel:?} is covered, but not traversed");
                } else {
                    undecided += 1;
                }
            }
        }
    }
    assert!(undecided * 100 < checked, "{undecided} of {checked} voxels went unchecked");
}
