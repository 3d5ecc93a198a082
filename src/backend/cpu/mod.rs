//! The CPU reference: every stage as a plain function, run in parallel over sensors or placements.

mod beam;
mod cast;
mod cover;
mod lockstep;
mod packets;
mod reduce;

use std::sync::Arc;
use std::time::Instant;

use super::{
    Backend, BackendError, Chunk, ChunkLimits, DevicePose, Problem, StageTimes, Tally, split,
};
use crate::bvh::Hit;
use crate::placement::Placement;

pub use beam::beam_direction;
pub use cast::cast_closest;
pub use cover::{bitmap_words, cover_voxels};
pub use lockstep::{WalkScratch, cover_sensor};
pub use packets::cast_packets;
pub use reduce::reduce;
pub(super) use reduce::set_bits;

/// Bytes of buffers that one chunk uses at most: more gains nothing, since a chunk of this size
/// already keeps every core busy.
const CHUNK_BYTES: u64 = 256 << 20;

/// Evaluates batches on the host's cores.
pub struct CpuBackend {
    problem: Arc<Problem>,
    memory: u64,
    times: StageTimes,
    /// Kept from batch to batch.
    hits: Vec<Hit>,
    bitmaps: Vec<u64>,
}

impl CpuBackend {
    /// A backend that uses at most about `memory` bytes beside the problem itself.
    pub fn new(problem: Arc<Problem>, memory: u64) -> Self {
        Self {
            problem,
            memory,
            times: StageTimes::default(),
            hits: Vec::new(),
            bitmaps: Vec::new(),
        }
    }

    fn poses(&self, placements: &[Placement]) -> Vec<DevicePose> {
        let roi = self.problem.roi();
        placements.iter().flat_map(|p| &p.lidars).map(|l| DevicePose::new(l, roi)).collect()
    }

    fn chunks(&self, placements: &[Placement]) -> Result<Vec<Chunk>, BackendError> {
        let lidars: Vec<usize> = placements.iter().map(|p| p.lidars.len()).collect();
        let widest = lidars.iter().copied().max().unwrap_or(1);
        let bitmap = 8 * bitmap_words(self.problem.roi()) as u64;
        let hits = size_of::<Hit>() as u64 * self.problem.table().directions().len() as u64;
        let each = bitmap + hits;
        let limit = self.memory.min(CHUNK_BYTES.max(each * widest as u64));
        Ok(split(&lidars, ChunkLimits::from_bytes(widest, &[("work buffers", each, limit)])?))
    }

    /// Fills the buffers with the covered voxels of each sensor in one frame, and with the hits where
    /// the coverage needs them.
    fn cover_frame(&mut self, poses: &[DevicePose], frame: usize, range: f32) {
        let start = Instant::now();
        let problem = &*self.problem;
        if let Some(bvh) = problem.bvh(frame) {
            cast_packets(poses, problem.table(), bvh, range, &mut self.hits);
        }
        self.times.cast += start.elapsed();
        let start = Instant::now();
        let hits = problem.bvh(frame).map(|_| self.hits.as_slice());
        cover_voxels(poses, problem.table(), problem.roi(), hits, range, &mut self.bitmaps);
        self.times.cover += start.elapsed();
    }
}

impl Backend for CpuBackend {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn adapter(&self) -> &str {
        "CPU reference"
    }

    fn tally(&mut self, placements: &[Placement], range: f32) -> Result<Vec<Tally>, BackendError> {
        let mut tallies = Vec::with_capacity(placements.len());
        for chunk in self.chunks(placements)? {
            let placements = &placements[chunk.placements];
            let poses = self.poses(placements);
            let classes = self.problem.content().classes().len();
            let mut sums: Vec<Tally> =
                placements.iter().map(|p| Tally::zero(classes, p.lidars.len())).collect();
            for frame in 0..self.problem.frame_count() {
                self.cover_frame(&poses, frame, range);
                let start = Instant::now();
                let hits = self.problem.bvh(frame).map(|_| self.hits.as_slice());
                let directions = self.problem.table().directions().len();
                let of_frame =
                    reduce(placements, self.problem.content(), &self.bitmaps, hits, directions);
                for (sum, tally) in sums.iter_mut().zip(&of_frame) {
                    *sum += tally;
                }
                self.times.reduce += start.elapsed();
            }
            tallies.append(&mut sums);
        }
        Ok(tallies)
    }

    fn hits(&mut self, placement: &Placement, frame: usize) -> Result<Vec<Hit>, BackendError> {
        let frames = self.problem.geometry_frame_count();
        let bvh = self.problem.geometry(frame).ok_or(BackendError::NoFrame { frame, frames })?;
        let start = Instant::now();
        let table = self.problem.table();
        let poses = self.poses(std::slice::from_ref(placement));
        let mut hits = Vec::new();
        cast_packets(&poses, table, bvh, table.range(), &mut hits);
        self.times.cast += start.elapsed();
        Ok(hits)
    }

    fn covered(&mut self, placement: &Placement, frame: usize) -> Result<Vec<u64>, BackendError> {
        let frames = self.problem.frame_count();
        if frame >= frames {
            return Err(BackendError::NoFrame { frame, frames });
        }
        let placements = std::slice::from_ref(placement);
        self.chunks(placements)?;
        let range = self.problem.table().range();
        self.cover_frame(&self.poses(placements), frame, range);
        let bitmaps = &self.bitmaps;
        let words = bitmap_words(self.problem.roi());
        Ok(set_bits(|w| bitmaps[w..].iter().step_by(words).fold(0, |or, x| or | x), words))
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}
