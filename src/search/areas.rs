//! What sensor poses of a grid see of the areas that must be seen.

use rayon::prelude::*;

use super::error::SearchError;
use super::evaluator::Evaluator;
use crate::problem::Problem;
use crate::vehicle::PoseGrid;

/// Poses whose bitmaps are held at once.
const POSES_AT_ONCE: usize = 32;

/// Voxels of all areas, frame after frame, as bits of each pose.
pub(super) struct Areas {
    /// `[poses × frames × words]`.
    bits: Vec<u64>,
    /// Words of one frame.
    words: usize,
    frames: usize,
    /// First bit of each area and the end.
    starts: Vec<usize>,
    /// Least share of each area.
    shares: Vec<f64>,
}

impl Areas {
    /// Casts `poses`, numbered from 0, in every frame of the evaluator's problem.
    pub fn cast(
        evaluator: &mut Evaluator,
        grid: &PoseGrid,
        poses: &[u32],
    ) -> Result<Self, SearchError> {
        let problem = evaluator.shared_problem();
        let (voxels, starts) = voxels(&problem);
        let (words, frames) = (voxels.len().div_ceil(64), problem.frame_count());
        let mut bits = vec![0; poses.len() * frames * words];
        let shares = problem.content().areas().iter().map(|area| area.share).collect();
        if words > 0 {
            for (some, out) in
                poses.chunks(POSES_AT_ONCE).zip(bits.chunks_mut(POSES_AT_ONCE * frames * words))
            {
                let some: Vec<_> = some.iter().map(|&pose| grid.pose(pose)).collect();
                for frame in 0..frames {
                    let bitmaps = evaluator.backend_mut().bitmaps(&some, frame)?;
                    let at: Vec<u32> = voxels.iter().map(|&v| bitmaps.order.bit_of(v)).collect();
                    let each = bitmaps.order.words();
                    let maps = bitmaps.words.par_chunks(each);
                    out.par_chunks_mut(frames * words).zip(maps).for_each(|(out, map)| {
                        let out = &mut out[frame * words..(frame + 1) * words];
                        for (k, &bit) in at.iter().enumerate() {
                            let set = map[bit as usize / 64] >> (bit % 64) & 1;
                            out[k / 64] |= set << (k % 64);
                        }
                    });
                }
            }
        }
        Ok(Self { bits, words, frames, starts, shares })
    }

    fn of(&self, pose: u32) -> &[u64] {
        let each = self.frames * self.words;
        &self.bits[pose as usize * each..(pose as usize + 1) * each]
    }

    /// What some poses see together.
    pub fn union(&self, poses: &[u32]) -> Vec<u64> {
        let mut union = vec![0; self.frames * self.words];
        for &pose in poses {
            union.iter_mut().zip(self.of(pose)).for_each(|(or, bits)| *or |= bits);
        }
        union
    }

    /// Share of each area that is seen in a union, a mean over frames.
    fn seen(&self, union: &[u64]) -> Vec<f64> {
        let area = |range: &[usize]| {
            let count = |frame: usize| {
                let bit = |k: &usize| union[frame * self.words + k / 64] >> (k % 64) & 1 == 1;
                (range[0]..range[1]).filter(bit).count()
            };
            let all: usize = (0..self.frames).map(count).sum();
            all as f64 / (self.frames * (range[1] - range[0])).max(1) as f64
        };
        self.starts.windows(2).map(area).collect()
    }

    /// Shares that are seen, each no further than it must be, added up.
    fn kept_in(&self, union: &[u64]) -> f64 {
        self.seen(union).iter().zip(&self.shares).map(|(seen, least)| seen.min(*least)).sum()
    }

    /// [`Self::union`] of some poses, as one number that is largest when all that must be seen is.
    pub fn kept(&self, poses: &[u32]) -> f64 {
        self.kept_in(&self.union(poses))
    }

    /// The same with one pose more.
    pub fn kept_with(&self, union: &[u64], pose: u32) -> f64 {
        if self.words == 0 {
            return 0.0;
        }
        let both: Vec<u64> = union.iter().zip(self.of(pose)).map(|(a, b)| a | b).collect();
        self.kept_in(&both)
    }

    /// Share that is missing of what must be seen, over all areas.
    pub fn missing(&self, poses: &[u32]) -> f64 {
        let seen = self.seen(&self.union(poses));
        seen.iter().zip(&self.shares).map(|(seen, least)| (least - seen).max(0.0)).sum()
    }
}

/// Linear indices of the voxels of all areas, area after area, and where each begins.
fn voxels(problem: &Problem) -> (Vec<u32>, Vec<usize>) {
    let content = problem.content();
    let (mut voxels, mut starts) = (Vec::new(), vec![0]);
    for set in content.classes().len()..content.set_count() {
        voxels.extend_from_slice(content.voxels_of_class(set));
        starts.push(voxels.len());
    }
    (voxels, starts)
}
