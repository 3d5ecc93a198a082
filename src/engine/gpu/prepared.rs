use std::ops::Range;

use super::bricks::Bricks;
use super::casting::Packing;
use crate::engine::{Chunk, ChunkLimits, split};
use crate::problem::{DevicePose, Problem};
use crate::vehicle::Placement;

/// A chunk put together on the host: none of it needs the device.
pub(super) struct Prepared {
    /// Its placements in the batch.
    pub(super) batch: Range<usize>,
    pub(super) poses: Vec<DevicePose>,
    /// First sensor in the chunk, and number of them, of each placement.
    pub(super) placements: Vec<[u32; 2]>,
    pub(super) slices: Vec<Slice>,
    /// Where beams are cast in packets.
    pub(super) packing: Option<Packing>,
}

/// Placements of a chunk whose bitmaps are made at a time.
pub(super) struct Slice {
    pub(super) placements: Range<usize>,
    pub(super) first_sensor: u32,
    pub(super) sensors: u32,
    /// Whether all beams go from brick to brick, or some voxel by voxel.
    pub(super) in_bricks: bool,
}

impl Prepared {
    /// The chunk of a batch, with the bitmaps of at most `in_slice` sensors made at a time.
    pub(super) fn new(
        problem: &Problem,
        batch: &[Placement],
        chunk: &Chunk,
        in_slice: usize,
        in_packets: bool,
    ) -> Self {
        let placements = &batch[chunk.placements.clone()];
        let poses = poses(problem, placements);
        let packing = in_packets.then(|| Packing::new(&poses, problem));
        let lidars: Vec<usize> = placements.iter().map(|p| p.lidars.len()).collect();
        let bricks = Bricks::new(problem.roi());
        let limits = ChunkLimits { sensors: in_slice, placements: usize::MAX };
        let slices = split(&lidars, limits)
            .into_iter()
            .map(|slice| Slice {
                placements: slice.placements,
                first_sensor: slice.sensors.start as u32,
                sensors: slice.sensors.len() as u32,
                in_bricks: poses[slice.sensors].iter().all(|pose| bricks.lead_from(pose)),
            })
            .collect();
        let placements = lidars
            .iter()
            .scan(0, |first, &count| {
                let entry = [*first, count as u32];
                *first += count as u32;
                Some(entry)
            })
            .collect();
        Self { batch: chunk.placements.clone(), poses, placements, slices, packing }
    }
}

/// Poses of all sensors in order.
pub(super) fn poses(problem: &Problem, placements: &[Placement]) -> Vec<DevicePose> {
    let roi = problem.roi();
    placements.iter().flat_map(|p| &p.lidars).map(|l| DevicePose::new(l, roi)).collect()
}
