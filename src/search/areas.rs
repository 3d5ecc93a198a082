//! What sensor poses of a grid see of the areas that must be seen.

use std::borrow::Cow;

use rayon::prelude::*;

use super::error::SearchError;
use super::evaluator::Evaluator;
use crate::engine::Backend;
use crate::problem::{Content, Problem};
use crate::vehicle::{PoseGrid, SensorPose};

/// Poses whose bitmaps are held at once.
const POSES_AT_ONCE: usize = 32;

/// What each pose sees, scene by scene.
pub(super) struct Areas {
    scenes: Vec<Sheet>,
    /// Least share of each area.
    shares: Vec<f64>,
}

/// Voxels of all areas in one scene, frame after frame, as bits of each pose.
struct Sheet {
    /// `[poses × frames × words]`.
    bits: Vec<u64>,
    /// Words of one frame.
    words: usize,
    frames: usize,
    /// First bit of each area and the end.
    starts: Vec<usize>,
}

impl Areas {
    /// Casts all poses of a grid in every frame of every scene.
    pub fn cast(evaluator: &mut Evaluator, grid: &PoseGrid) -> Result<Self, SearchError> {
        let areas = evaluator.problem().content().areas();
        let shares: Vec<f64> = areas.iter().map(|area| area.required.share).collect();
        if shares.is_empty() {
            return Ok(Self { scenes: Vec::new(), shares });
        }
        let members: Vec<_> =
            evaluator.members().map(|(m, _)| (m.problem().clone(), m.is_mirrored())).collect();
        let poses: Vec<SensorPose> = (0..grid.len()).map(|number| grid.pose(number)).collect();
        let scenes =
            members.iter().zip(evaluator.backends_mut()).map(|((problem, is_image), b)| {
                let poses = match is_image {
                    true => Cow::Owned(poses.iter().map(SensorPose::mirrored).collect()),
                    false => Cow::Borrowed(&poses),
                };
                Sheet::cast(problem, &mut **b, &poses)
            });
        Ok(Self { scenes: scenes.collect::<Result<_, _>>()?, shares })
    }

    /// What some poses see together, scene by scene.
    pub fn union(&self, poses: &[u32]) -> Vec<Vec<u64>> {
        self.scenes.iter().map(|sheet| sheet.union(poses)).collect()
    }

    /// Share of each area that is seen, a mean over scenes and frames.
    fn seen(&self, unions: &[Vec<u64>]) -> Vec<f64> {
        let mut mean = vec![0.0; self.shares.len()];
        for (sheet, union) in self.scenes.iter().zip(unions) {
            let shares = sheet.seen(union);
            mean.iter_mut().zip(shares).for_each(|(m, s)| *m += s / self.scenes.len() as f64);
        }
        mean
    }

    /// Shares that are seen, each no further than it must be, added up.
    fn kept_in(&self, unions: &[Vec<u64>]) -> f64 {
        self.seen(unions).iter().zip(&self.shares).map(|(seen, least)| seen.min(*least)).sum()
    }

    /// What some poses see, as one number that is largest when all that must be seen is.
    pub fn kept(&self, poses: &[u32]) -> f64 {
        self.kept_in(&self.union(poses))
    }

    /// The same with one pose more beside a [`Self::union`].
    pub fn kept_with(&self, unions: &[Vec<u64>], pose: u32) -> f64 {
        let with = |(sheet, union): (&Sheet, &Vec<u64>)| {
            union.iter().zip(sheet.of(pose)).map(|(a, b)| a | b).collect()
        };
        self.kept_in(&self.scenes.iter().zip(unions).map(with).collect::<Vec<_>>())
    }

    /// Share that is missing of what must be seen, over all areas.
    pub fn missing(&self, poses: &[u32]) -> f64 {
        let seen = self.seen(&self.union(poses));
        seen.iter().zip(&self.shares).map(|(seen, least)| (least - seen).max(0.0)).sum()
    }
}

impl Sheet {
    fn cast(
        problem: &Problem,
        backend: &mut dyn Backend,
        poses: &[SensorPose],
    ) -> Result<Self, SearchError> {
        let (voxels, starts) = voxels(problem.content());
        let (words, frames) = (voxels.len().div_ceil(64).max(1), problem.frame_count());
        let mut bits = vec![0; poses.len() * frames * words];
        let sheets = bits.chunks_mut(POSES_AT_ONCE * frames * words);
        for (some, out) in poses.chunks(POSES_AT_ONCE).zip(sheets) {
            for frame in 0..frames {
                let bitmaps = backend.bitmaps(some, frame)?;
                let at: Vec<u32> = voxels.iter().map(|&v| bitmaps.order.bit_of(v)).collect();
                let maps = bitmaps.words.par_chunks(bitmaps.order.words());
                out.par_chunks_mut(frames * words).zip(maps).for_each(|(out, map)| {
                    let out = &mut out[frame * words..(frame + 1) * words];
                    for (k, &bit) in at.iter().enumerate() {
                        let set = map[bit as usize / 64] >> (bit % 64) & 1;
                        out[k / 64] |= set << (k % 64);
                    }
                });
            }
        }
        Ok(Self { bits, words, frames, starts })
    }

    fn of(&self, pose: u32) -> &[u64] {
        let each = self.frames * self.words;
        &self.bits[pose as usize * each..(pose as usize + 1) * each]
    }

    fn union(&self, poses: &[u32]) -> Vec<u64> {
        let mut union = vec![0; self.frames * self.words];
        for &pose in poses {
            union.iter_mut().zip(self.of(pose)).for_each(|(or, bits)| *or |= bits);
        }
        union
    }

    /// Share of each area that is seen in a union, a mean over frames.
    fn seen(&self, union: &[u64]) -> Vec<f64> {
        let area = |range: &[usize]| {
            let count = |words: &[u64]| ones_below(words, range[1]) - ones_below(words, range[0]);
            let all: u64 = union.chunks(self.words).map(count).sum();
            all as f64 / (self.frames * (range[1] - range[0])).max(1) as f64
        };
        self.starts.windows(2).map(area).collect()
    }
}

/// Bits set below a number.
fn ones_below(words: &[u64], end: usize) -> u64 {
    let whole: u64 = words[..end / 64].iter().map(|word| u64::from(word.count_ones())).sum();
    let part = words.get(end / 64).map_or(0, |word| word & ((1 << (end % 64)) - 1));
    whole + u64::from(part.count_ones())
}

/// Linear indices of the voxels of all areas, area after area, and where each begins.
fn voxels(content: &Content) -> (Vec<u32>, Vec<usize>) {
    let (mut voxels, mut starts) = (Vec::new(), vec![0]);
    for set in content.classes().len()..content.set_count() {
        voxels.extend_from_slice(content.voxels_of_class(set));
        starts.push(voxels.len());
    }
    (voxels, starts)
}
