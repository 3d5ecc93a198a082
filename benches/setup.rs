//! Sensors, placements and worths of voxels on which the CPU stages are timed.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use lidar_cast::bvh::Bvh;
use lidar_cast::cast::Caster;
use lidar_cast::task::{DevicePose, KINDS, beam_direction};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use sightline::problem::{Content, OccupiedVoxel};
use sightline::psog::Roi;
use sightline::vehicle::{BeamTable, Placement, SensorPose};

/// Metres.
pub(crate) const RANGE: f32 = 100.0;

/// The region that is scored, with cubes of this edge in metres.
pub(crate) fn roi(edge: f64) -> Roi {
    Roi::from_bounds([-40.0, -40.0, -0.5], [40.0, 40.0, 5.5], [edge; 3]).unwrap()
}

/// Sixteen channels from −24.8° to 2°.
pub(crate) fn table(azimuth_steps: u32) -> BeamTable {
    let channels: Vec<(f64, f64)> =
        (0..16).map(|k| (-24.8 + 26.8 * f64::from(k) / 15.0, 0.0)).collect();
    BeamTable::spinning(&channels, azimuth_steps, f64::from(RANGE)).unwrap()
}

/// The sensors of all placements.
pub(crate) fn poses(placements: &[Placement], roi: &Roi) -> Vec<DevicePose> {
    placements
        .iter()
        .flat_map(|p| &p.lidars)
        .map(|l| DevicePose::new(&l.ego_from_sensor(), roi))
        .collect()
}

/// Placements of four LiDARs, rolled and pitched by up to `turn` radians.
pub(crate) fn placements(count: usize, turn: f64, seed: u64) -> Vec<Placement> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut within = |low: f64, high: f64| rng.random_range(low..=high);
    let mut pose = || SensorPose {
        x: within(-0.6, 0.6),
        y: within(-0.6, 0.6),
        z: within(2.2, 2.8),
        roll: within(-turn, turn),
        pitch: within(-turn, turn),
        ..SensorPose::default()
    };
    (0..count)
        .map(|i| Placement { name: format!("p{i}"), lidars: (0..4).map(|_| pose()).collect() })
        .collect()
}

/// The voxels in which beams of some sensors end, with arbitrary entropies, in five classes.
pub(crate) fn content(
    roi: &Roi,
    poses: &[DevicePose],
    table: &BeamTable,
    bvh: &Bvh,
    seed: u64,
) -> Content {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut hits = Vec::new();
    Caster::new(table).closest_hits(poses, bvh, RANGE, &mut hits);
    let mut voxels = Vec::new();
    for (pose, hits) in poses.iter().zip(hits.chunks(table.directions().len())) {
        let origin = DVec3::from(pose.rows.map(|row| f64::from(row[3])));
        for (&direction, hit) in table.directions().iter().zip(hits).filter(|(_, hit)| hit.is_hit())
        {
            let along = beam_direction(pose, direction).as_dvec3() * f64::from(hit.t);
            voxels.extend(roi.voxel_of_hit(origin, origin + along).map(|voxel| voxel as u32));
        }
    }
    voxels.sort_unstable();
    voxels.dedup();
    let mut by_class = vec![Vec::new(); 5];
    let mut occupied = Vec::new();
    for index in voxels {
        let entropy = [0; KINDS].map(|_| rng.random_range(0..1_u32 << 28));
        occupied.push(OccupiedVoxel { index, entropy });
        by_class[rng.random_range(0..5_usize)].push(index);
    }
    Content::new((0..5).map(|c| c.to_string()).collect(), occupied, &by_class, true)
}
