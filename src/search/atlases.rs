//! A pose atlas for each scene, over one grid of poses.

use std::borrow::Cow;
use std::collections::HashMap;
use std::sync::Arc;

use rayon::prelude::*;

use super::atlas::{Atlas, Union};
use super::evaluator::Evaluator;
use crate::engine::BackendError;
use crate::problem::{Content, KINDS, REPEATS, Tally};
use crate::score::{Needed, Objective, SEEN, percent_down, percent_up};
use crate::targets::{MountPoses, OutOfReach, Sight, SightBeams};
use crate::vehicle::{PoseGrid, Requirement, UnknownSensor};

/// Fixed-point sum by which the worth of one unit is found: a power of two, and large, so that it is as
/// exact as the objective's own factors.
const UNITS: u64 = 1 << 40;

/// One [`Atlas`] per scene over one grid of poses; all hold the same poses.
pub struct Atlases {
    /// At least one.
    each: Vec<Atlas>,
    /// Targets that a search looks for, and the beams on them of every pose held so far.
    sight: Option<Arc<Sight>>,
    targets: HashMap<u32, SightBeams>,
}

/// Growth of a gain with each fixed-point unit that a scene's sums grow by; 0 where the gain does not exist.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Units {
    /// By kind of information, for voxels that no LiDAR covered before.
    pub once: [f64; KINDS],
    /// For near information: voxels that one LiDAR, and two, covered before.
    pub repeated: [f64; REPEATS],
}

/// Union of held poses: coverage in each scene, and the poses themselves.
#[derive(Debug, Clone, Default)]
pub(crate) struct Unions {
    each: Vec<Union>,
    poses: Vec<u32>,
}

impl From<Atlas> for Atlases {
    fn from(atlas: Atlas) -> Self {
        Self { each: vec![atlas], sight: None, targets: HashMap::new() }
    }
}

impl Atlases {
    /// Empty atlases of the evaluator's scenes that hold at most about `bytes` together; see [`Atlas::new`].
    pub fn new(evaluator: &Evaluator, grid: &PoseGrid, needed: Needed, bytes: u64) -> Self {
        let share = bytes / evaluator.members().len().max(1) as u64;
        let atlas = |member: &super::suite::Member| {
            Atlas::new(member.problem().clone(), grid.clone(), needed, share)
                .of_mirror_image(member.is_mirrored())
        };
        let mut each: Vec<Atlas> = evaluator.members().map(|(member, _)| atlas(member)).collect();
        let capacity = each.iter().map(Atlas::capacity).min().unwrap_or(0);
        each.iter_mut().for_each(|atlas| atlas.capacity = capacity);
        Self { each, sight: evaluator.sight().cloned(), targets: HashMap::new() }
    }

    /// Like [`Atlas::forget_beyond`], for all scenes together.
    pub(super) fn forget_beyond(&mut self, poses: usize, bytes: u64) {
        let share = bytes / self.each.len().max(1) as u64;
        self.each.iter_mut().for_each(|atlas| atlas.forget_beyond(poses, share));
    }

    /// The grid of their poses.
    pub fn grid(&self) -> &PoseGrid {
        self.each[0].grid()
    }

    pub(crate) fn capacity(&self) -> usize {
        self.each[0].capacity()
    }

    /// Bytes of one pose in all scenes, at most.
    pub fn page_bytes(&self) -> usize {
        self.each.iter().map(Atlas::page_bytes).sum()
    }

    /// Poses cast so far, each counted once for all scenes.
    pub fn poses_cast(&self) -> u64 {
        self.each[0].poses_cast()
    }

    /// Like [`Atlas::hold`], in every scene.
    pub(crate) fn hold(
        &mut self,
        evaluator: &mut Evaluator,
        poses: &[u32],
    ) -> Result<(), BackendError> {
        self.hold_while(evaluator, poses, &mut |_| true).map(drop)
    }

    pub(super) fn hold_while(
        &mut self,
        evaluator: &mut Evaluator,
        poses: &[u32],
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<bool, BackendError> {
        for (atlas, backend) in self.each.iter_mut().zip(evaluator.backends_mut()) {
            if !atlas.hold_while(&mut **backend, poses, go_on)? {
                return Ok(false);
            }
        }
        let Some(sight) = &self.sight else { return Ok(true) };
        let mut new: Vec<u32> =
            poses.iter().copied().filter(|pose| !self.targets.contains_key(pose)).collect();
        new.sort_unstable();
        new.dedup();
        let grid = self.each[0].grid();
        let beams = new.par_iter().map(|&pose| Ok((pose, sight.sampled_beams(&grid.pose(pose))?)));
        self.targets.extend(beams.collect::<Result<Vec<_>, UnknownSensor>>()?);
        Ok(true)
    }

    /// The union of held poses.
    pub(crate) fn union(&self, poses: &[u32], unions: &mut Unions) {
        unions.each.resize_with(self.each.len(), Union::default);
        let each = self.each.iter().zip(&mut unions.each);
        each.for_each(|(atlas, union)| atlas.union(poses, union));
        unions.poses = poses.to_vec();
    }

    pub(super) fn has_sight(&self) -> bool {
        self.sight.is_some()
    }

    /// Requirements that no rig meets whose poses are among those held, in words: areas, then rules on targets, ground and
    /// overlap. `mounts` says for each mount the fewest and most sensors that it holds and the numbers of its poses. See
    /// [`Sight::out_of_reach`].
    pub(super) fn out_of_reach(&self, mounts: &[([usize; 2], Vec<u32>)]) -> Vec<OutOfReach> {
        let used = mounts.iter().filter(|([_, most], _)| *most > 0);
        let poses: Vec<u32> = used.flat_map(|(_, poses)| poses).copied().collect();
        let mut all = self.areas_out_of_reach(&poses);
        let Some(sight) = &self.sight else { return all };
        let held = |pose: &u32| self.targets.get(pose);
        let mounts: Vec<MountPoses<'_>> = mounts
            .iter()
            .map(|(count, poses)| MountPoses {
                count: *count,
                poses: poses.iter().filter_map(held).collect(),
            })
            .collect();
        let count: usize = mounts.iter().map(|mount| mount.poses.len()).sum();
        let over =
            format!("measured over {count} poses of a grid over the mounts; others may see more");
        let in_words = |rule: OutOfReach| {
            let full = if rule.beams.is_some() { "every mount full, " } else { "" };
            match rule.is_measured {
                true => OutOfReach { words: format!("{} ({full}{over})", rule.words), ..rule },
                false => rule,
            }
        };
        all.extend(sight.out_of_reach(&mounts).into_iter().map(in_words));
        all
    }

    pub(super) fn areas(&self) -> impl Iterator<Item = &Requirement> {
        self.each[0].problem().content().areas().iter().map(|area| &area.required)
    }

    /// Share of each required area that held poses see together; a mean over scenes.
    pub(super) fn area_shares(&self, poses: &[u32]) -> Vec<f64> {
        let shares: Vec<Vec<f64>> =
            self.each.iter().map(|atlas| atlas.area_shares(poses)).collect();
        let mean =
            |area: usize| shares.iter().map(|of| of[area]).sum::<f64>() / shares.len() as f64;
        (0..self.areas().count()).map(mean).collect()
    }

    /// Targets, near ground and overlap that a search looks for.
    pub(super) fn sight(&self) -> Option<&Sight> {
        self.sight.as_deref()
    }

    /// Beams of a held pose on them; `None` where a search looks for none.
    pub(super) fn beams_of(&self, pose: u32) -> Option<&SightBeams> {
        self.targets.get(&pose)
    }

    /// Areas that all these poses together see too little of, in words.
    fn areas_out_of_reach(&self, poses: &[u32]) -> Vec<OutOfReach> {
        let areas = self.areas().zip(self.area_shares(poses));
        let beyond = areas.filter(|(required, share)| *share < required.share);
        let frames: usize = self.each.iter().map(|atlas| atlas.problem().frame_count()).sum();
        let in_words = |(required, share): (&Requirement, f64)| {
            let words = format!(
                "{}: even a LiDAR at every pose looked at on each mount leaves it {:.1} % {SEEN}, {:.1} % required; lower `share`, move \
                 the box, add or widen mounts, or take other sensors (measured over {} poses of a grid over the mounts and {frames} \
                 frames)",
                required.name,
                percent_down(share),
                percent_up(required.share),
                poses.len()
            );
            OutOfReach { words, beams: None, share, is_measured: true }
        };
        beyond.map(in_words).collect()
    }

    /// Shares that a union and one more held pose, if any, lack: beams on a car all round, and places of the rules on
    /// targets; see [`Sight::rules_missing`].
    pub(super) fn unmet_with(&self, unions: &Unions, pose: Option<u32>, roomy: bool) -> [f64; 2] {
        let Some(sight) = &self.sight else { return [0.0; 2] };
        let poses = unions.poses.iter().copied().chain(pose);
        let each: Vec<&SightBeams> = poses.filter_map(|pose| self.targets.get(&pose)).collect();
        let mut all = SightBeams::default();
        each.iter().for_each(|beams| all.add(beams));
        let rules = if sight.has_rules() { sight.rules_missing(&each, roomy) } else { 0.0 };
        [sight.car_missing(&all).unwrap_or(0.0), rules]
    }

    /// The objective of unions and one held pose more, over all scenes; `None` where it does not exist.
    pub(crate) fn value_with(
        &self,
        objective: &Objective,
        unions: &Unions,
        pose: u32,
    ) -> Option<f64> {
        let tally = |(atlas, union): (&Atlas, &Union)| atlas.tally_with(union, pose);
        let tallies = self.each.iter().zip(&unions.each).map(tally);
        objective.value_over_scenes(
            tallies.zip(&self.each).map(|(tally, atlas)| with_content(tally, atlas)),
        )
    }

    pub(super) fn has_areas(&self) -> bool {
        self.each.iter().any(Atlas::has_areas)
    }

    /// Share that unions, and one more held pose if any, miss of required areas; a mean over scenes.
    pub(super) fn missing_with(&self, unions: &Unions, pose: Option<u32>) -> f64 {
        let each = self.each.iter().zip(&unions.each);
        each.map(|(atlas, union)| atlas.missing_with(union, pose)).sum::<f64>()
            / self.each.len() as f64
    }

    /// Growth of a gain with each fixed-point unit in each scene: (objective of a sum of 2⁴⁰ units) / 2⁴⁰.
    pub(super) fn worth_units(&self, objective: &Objective) -> Vec<Units> {
        let unit = |scene: usize, grown: &dyn Fn(&mut Tally)| {
            let tallies = (0..self.each.len()).map(|index| {
                let mut tally = Tally { covered: 1, covered_nonzero: 1, ..Tally::default() };
                if index == scene {
                    grown(&mut tally);
                }
                with_content(tally, &self.each[index])
            });
            objective.value_over_scenes(tallies).unwrap_or(0.0) / UNITS as f64
        };
        let units = |scene| Units {
            once: std::array::from_fn(|kind| unit(scene, &|tally| tally.entropy[kind] = UNITS)),
            repeated: std::array::from_fn(|level| {
                unit(scene, &|tally| tally.near_repeated[level] = UNITS)
            }),
        };
        (0..self.each.len()).map(units).collect()
    }

    /// Like [`Atlas::occupied_of`], scene after scene.
    pub(super) fn occupied_of(&self, pose: u32) -> Cow<'_, [u64]> {
        match &self.each[..] {
            [atlas] => Cow::Borrowed(atlas.occupied_of(pose)),
            all => all.iter().flat_map(|atlas| atlas.occupied_of(pose)).copied().collect(),
        }
    }

    /// The fixed-point entropies of each bit of [`Self::occupied_of`], and the number of its scene; of a
    /// single scene those of one frame, since all its frames have the same.
    pub(super) fn worths(&self) -> Vec<([u32; KINDS], usize)> {
        let of_scene = |(scene, atlas): (usize, &Atlas)| {
            let frames = if self.each.len() > 1 { atlas.problem().frame_count() } else { 1 };
            let worths: Vec<_> = atlas.worths().into_iter().map(|worth| (worth, scene)).collect();
            worths.repeat(frames)
        };
        self.each.iter().enumerate().flat_map(of_scene).collect()
    }
}

fn with_content(tally: Tally, atlas: &Atlas) -> (Tally, &Content, usize) {
    (tally, atlas.problem().content(), atlas.problem().frame_count())
}
