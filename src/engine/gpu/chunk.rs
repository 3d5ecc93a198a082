//! A batch of placements, and a part of it that lies on the device at once.

use super::layout::LONG_AXIS;
use crate::engine;
use crate::problem::{DevicePose, Problem};
use crate::psog::Roi;
use crate::vehicle::Placement;

/// Placements in chunks, and the frames that they are evaluated in.
pub(super) struct Batch<'a> {
    pub(super) placements: &'a [Placement],
    pub(super) chunks: Vec<engine::Chunk>,
    pub(super) frames: &'a [usize],
    /// Metres.
    pub(super) range: f32,
    /// Whether the reductions run, or bitmaps are read.
    pub(super) sums: bool,
}

/// Placements that lie on the device together.
pub(super) struct Chunk {
    /// Where they stand in the batch.
    pub(super) cut: engine::Chunk,
    pub(super) poses: Vec<DevicePose>,
    /// First sensor in the chunk and number of sensors, by placement.
    pub(super) sensors: Vec<[u32; 2]>,
    /// Sensors whose beams the host covers.
    pub(super) covered_by_host: Vec<usize>,
}

impl Chunk {
    /// The chunk of a batch.
    pub(super) fn new(problem: &Problem, batch: &[Placement], cut: &engine::Chunk) -> Self {
        let (roi, placements) = (problem.roi(), &batch[cut.placements.clone()]);
        let poses: Vec<DevicePose> =
            placements.iter().flat_map(|p| &p.lidars).map(|l| DevicePose::new(l, roi)).collect();
        let mut first = 0;
        let sensors_of = |placement: &Placement| {
            let sensors = [first, placement.lidars.len() as u32];
            first += sensors[1];
            sensors
        };
        let sensors = placements.iter().map(sensors_of).collect();
        let covered_by_host = (0..poses.len()).filter(|&s| !is_covered(&poses[s], roi)).collect();
        Self { cut: cut.clone(), poses, sensors, covered_by_host }
    }
}

/// Whether `cover_voxels` covers the beams of a sensor: one in the grid, and no axis is long.
fn is_covered(pose: &DevicePose, roi: &Roi) -> bool {
    let mut axes = roi.shape().into_iter().zip(pose.in_grid);
    axes.all(|(n, p)| n < LONG_AXIS && (0.0..n as f32).contains(&p))
}
