//! Placements whose LiDARs stand on poses of a grid: rules they keep, poses to hold, values, greedy choice, guards.

use std::cmp::Ordering;
use std::collections::{BTreeSet, HashMap};

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::atlas::POSES_AT_ONCE;
use super::atlases::{Atlases, Unions};
use super::error::SearchError;
use super::evaluator::Evaluator;
use super::seat::FRAMES_AT_ONCE;
use crate::score::{Objective, Standing};
use crate::vehicle::{Constraints, Placement, PoseGrid};

/// Stale gains that lazy greedy looks at again at once: enough to keep every core busy.
const LAZY_BLOCK: usize = 64;
/// Most poses cast between two looks at the time.
const HELD_AT_ONCE: usize = 256;
/// Most casts, poses × frames, between two looks at the time.
const HELD_FRAMES: usize = 2048;

/// Slack of the least distance, as in [`Constraints::violations`].
const SLACK: f64 = 1e-9;

/// Positions and kinds of a grid's poses, for many questions of [`GridSearch::fits`].
pub(super) struct Places {
    positions: Vec<DVec3>,
    /// True for each pose outside of every box that is kept free.
    clear: Vec<bool>,
    /// Kind of slot of each pose, and the LiDARs of each kind.
    kinds: Vec<usize>,
    pub lidars_by_kind: Vec<usize>,
    /// Least distance between two LiDARs, in metres.
    least: f64,
}

impl Places {
    pub(crate) fn kind(&self, pose: u32) -> usize {
        self.kinds[pose as usize]
    }

    /// See [`GridSearch::fits`].
    pub(crate) fn fits(&self, pose: u32, others: &[u32]) -> bool {
        let at = |pose: u32| self.positions[pose as usize];
        let apart = |&other: &u32| other != pose && at(pose).distance(at(other)) >= self.least;
        let kind = self.kinds[pose as usize];
        let alike = others.iter().filter(|&&other| self.kinds[other as usize] == kind).count();
        self.clear[pose as usize] && alike < self.lidars_by_kind[kind] && others.iter().all(apart)
    }
}

/// Searches placements whose LiDARs stand on poses of a grid.
pub struct GridSearch {
    pub(super) atlas: Atlases,
    pub(super) objective: Objective,
    pub(super) constraints: Constraints,
    pub(super) evaluations: u64,
    /// Most poses to cast: beyond it no climb begins another turn.
    pub(super) most_casts: u64,
    /// Poses that a climb moves LiDARs to where it may move them anywhere; `None` for all of the grid.
    pub(super) pool: Option<BTreeSet<u32>>,
    /// Penalty for a missing share of 1, taken off the objective; 0 without requirements.
    pub(super) penalty: f64,
    /// Penalty for a car that no beam meets, taken off the objective; 0 where the search does not look for cars.
    pub(super) blind: f64,
    /// True if more places of targets are wanted than the rules ask for.
    pub(super) roomy: bool,
    /// True if LiDARs are to look away from the own body.
    pub(super) looks_away: bool,
    /// Placements whose rules and guards were looked at, which takes a cast of all their LiDARs.
    looked_at: HashMap<Vec<u32>, Standing>,
}

/// A placement on the grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GridPlacement {
    /// Numbers of its poses in the grid.
    pub poses: Vec<u32>,
    /// Its objective.
    pub value: f64,
}

impl GridPlacement {
    /// Poses in the ego frame.
    pub fn placement(&self, grid: &PoseGrid, name: &str) -> Placement {
        let lidars = self.poses.iter().map(|&pose| grid.pose(pose)).collect();
        Placement { name: name.to_owned(), lidars }
    }
}

/// Order of (candidate pose, objective with it): better ones first, of equal ones the lower number.
pub(super) fn better_first(a: &(u32, f64), b: &(u32, f64)) -> Ordering {
    b.1.total_cmp(&a.1).then(a.0.cmp(&b.0))
}

impl GridSearch {
    /// A search of placements that keep the evaluator's constraints.
    pub fn new(atlas: impl Into<Atlases>, objective: Objective, evaluator: &Evaluator) -> Self {
        Self {
            atlas: atlas.into(),
            objective,
            constraints: evaluator.constraints().clone(),
            evaluations: 0,
            most_casts: u64::MAX,
            pool: None,
            penalty: 0.0,
            blind: 0.0,
            roomy: false,
            looks_away: false,
            looked_at: HashMap::new(),
        }
    }

    /// Adds poses to the pool: from the first call on climbs move LiDARs to its poses alone.
    pub(super) fn keep_to(&mut self, poses: impl IntoIterator<Item = u32>) {
        self.pool.get_or_insert_default().extend(poses);
    }

    /// Poses one step along one field from those of a placement that are not in the pool, rising.
    pub(super) fn next_to(&self, placement: &[u32]) -> Vec<u32> {
        let Some(pool) = &self.pool else { return Vec::new() };
        let near = placement.iter().flat_map(|&pose| self.atlas.grid().along(pose, 1));
        let new: BTreeSet<u32> = near.filter(|pose| !pool.contains(pose)).collect();
        new.into_iter().collect()
    }

    /// True if a climb may begin another turn: casts are left, and `go_on`, called with the poses cast, agrees.
    pub(super) fn may_turn(&self, go_on: &mut dyn FnMut(u64) -> bool) -> bool {
        let cast = self.atlas.poses_cast();
        cast < self.most_casts && go_on(cast)
    }

    /// The atlas that it reads of each scene.
    pub fn atlas(&self) -> &Atlases {
        &self.atlas
    }

    /// LiDARs of a placement.
    pub fn lidars(&self) -> usize {
        self.constraints.lidars()
    }

    /// Numbers of the poses of a placement moved to the grid, a LiDAR and its mirror image side by
    /// side where the rules want pairs; `None` where it breaks a rule there.
    pub fn start_of(&self, placement: &Placement) -> Option<Vec<u32>> {
        let grid = self.atlas.grid();
        let mut placement = placement.clone();
        if self.constraints.kinds().len() > 1 {
            placement.lidars = self.constraints.ordered(&placement.lidars)?;
        }
        let poses = grid.numbers_of(&placement, self.constraints.ties);
        let snapped = GridPlacement { poses, value: 0.0 };
        let keeps = self.constraints.violations(&snapped.placement(grid, "start")).is_empty();
        keeps.then_some(snapped.poses)
    }

    /// Casts the poses that are not held yet.
    ///
    /// # Errors
    /// From the backend, or more poses than the atlas holds.
    pub fn hold(&mut self, evaluator: &mut Evaluator, poses: &[u32]) -> Result<(), SearchError> {
        Ok(self.atlas.hold(evaluator, poses)?)
    }

    /// Like [`Self::hold`], some poses after others; `go_on` is asked in between and after every 2048 casts of a pose in
    /// a frame, with the number of poses cast. Returns the poses that are held then, in the order given: all, where
    /// `go_on` never says no.
    pub(crate) fn hold_while(
        &mut self,
        evaluator: &mut Evaluator,
        poses: &[u32],
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Vec<u32>, SearchError> {
        let frames = evaluator.frame_count().max(1);
        let chunks = poses.len().div_ceil((HELD_FRAMES / frames).clamp(1, HELD_AT_ONCE));
        for chunk in 0..chunks {
            // Each chunk is spread over the whole grid: those that are held first stand for all.
            let some: Vec<u32> = poses.iter().skip(chunk).step_by(chunks).copied().collect();
            let is_held = self.atlas.hold_while(evaluator, &some, go_on)?;
            if !is_held || (!go_on(self.atlas.poses_cast()) && chunk + 1 < chunks) {
                let held = chunk + usize::from(is_held);
                let held = (0..poses.len()).filter(|at| at % chunks < held);
                return Ok(held.map(|at| poses[at]).collect());
            }
        }
        self.hold(evaluator, poses)?;
        Ok(poses.to_vec())
    }

    /// True if a pose may stand beside others: in no box that is kept free, another pose, and far
    /// enough away. Ties between LiDARs are not looked at.
    pub fn fits(&self, pose: u32, others: &[u32]) -> bool {
        let least = self.constraints.min_distance - SLACK;
        let pose_itself = self.atlas.grid().pose(pose);
        let position = pose_itself.position();
        let apart = others.iter().all(|&other| {
            other != pose && position.distance(self.atlas.grid().pose(other).position()) >= least
        });
        let grid = self.atlas.grid();
        let kind = grid.kind(pose);
        let alike = others.iter().filter(|&&other| grid.kind(other) == kind).count();
        let has_place = alike < grid.lidars_by_kind()[kind];
        apart && has_place && self.constraints.is_clear(&pose_itself)
    }

    /// Positions and kinds of all poses of the grid, for many questions of [`Self::fits`].
    pub(super) fn places(&self) -> Places {
        let grid = self.atlas.grid();
        let poses = (0..grid.len()).map(|pose| grid.pose(pose));
        let (positions, clear) =
            poses.map(|pose| (pose.position(), self.constraints.is_clear(&pose))).unzip();
        let kinds = (0..grid.len()).map(|pose| grid.kind(pose)).collect();
        let (lidars_by_kind, least) =
            (grid.lidars_by_kind().to_vec(), self.constraints.min_distance - SLACK);
        Places { positions, clear, kinds, lidars_by_kind, least }
    }

    /// LiDAR after LiDAR, the candidate that makes the objective largest; `None` where no candidate
    /// fits any more.
    ///
    /// For an information gain this reaches at least 1 − 1/e of the best placement of these candidates where LiDARs
    /// need no least distance (Nemhauser, Wolsey, Fisher 1978). Gains then only shrink as sensors join. Old gains are
    /// bounds, so most are not computed again (Minoux 1978); the result is the same.
    pub fn greedy(
        &mut self,
        evaluator: &mut Evaluator,
        candidates: &[u32],
    ) -> Result<Option<GridPlacement>, SearchError> {
        self.hold(evaluator, candidates)?;
        let lazy = self.objective.is_information_gain();
        let mut placement = GridPlacement { poses: Vec::new(), value: 0.0 };
        let mut bounds: Vec<(u32, f64)> = candidates.iter().map(|&c| (c, f64::INFINITY)).collect();
        while placement.poses.len() < self.lidars() {
            bounds.retain(|&(pose, _)| self.fits(pose, &placement.poses));
            if bounds.is_empty() {
                return Ok(None);
            }
            let mut fresh: Vec<(u32, f64)> = Vec::new();
            let block = if lazy { LAZY_BLOCK } else { bounds.len() };
            let mut best = f64::NEG_INFINITY;
            while fresh.len() < bounds.len() && (!lazy || bounds[fresh.len()].1 >= best) {
                let end = (fresh.len() + block).min(bounds.len());
                let some: Vec<u32> = bounds[fresh.len()..end].iter().map(|b| b.0).collect();
                let values = self.values_with(&placement.poses, &some);
                let gains = values.into_iter().map(|(pose, value)| (pose, value - placement.value));
                fresh.extend(gains);
                best = fresh.iter().fold(best, |best, gain| best.max(gain.1));
            }
            let looked_at = fresh.len();
            bounds[..looked_at].copy_from_slice(&fresh);
            bounds.sort_by(better_first);
            let (pose, gain) = bounds[0];
            placement.poses.push(pose);
            placement.value += gain;
        }
        // Poses in the order of the slots.
        placement.poses.sort_by_key(|&pose| self.atlas.grid().kind(pose));
        placement.value = self.value(evaluator, &placement.poses)?;
        Ok(Some(placement))
    }

    /// The standing of a placement, which keeps the rules as every placement of the grid search does.
    pub fn standing(
        &mut self,
        evaluator: &mut Evaluator,
        placement: &GridPlacement,
    ) -> Result<Standing, SearchError> {
        let standing = self.standing_while(evaluator, placement, &mut |_| true)?;
        Ok(standing.expect("nobody stops it"))
    }

    /// Like [`Self::standing`]; over more than [`FRAMES_AT_ONCE`] frames `None` once `go_on`, which is asked every few
    /// frames, says no.
    pub(super) fn standing_while(
        &mut self,
        evaluator: &mut Evaluator,
        placement: &GridPlacement,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<Standing>, SearchError> {
        if let Some(&known) = self.looked_at.get(&placement.poses) {
            return Ok(Some(Standing { value: Some(placement.value), ..known }));
        }
        let scored = [placement.placement(self.atlas.grid(), "standing")];
        let (cast, is_few) = (self.atlas.poses_cast(), evaluator.frame_count() <= FRAMES_AT_ONCE);
        let scores = evaluator.scores_while(&scored, &mut || is_few || go_on(cast))?;
        let Some(scores) = scores.map(|mut scores| scores.remove(0)) else { return Ok(None) };
        let at_body = self.at_own_body(evaluator, &placement.poses)?;
        let (violation, guards) = (scores.missing(), scores.doubts() + at_body);
        let standing = Standing { violation, guards, value: Some(placement.value), blind: 0.0 };
        self.looked_at.insert(placement.poses.clone(), standing);
        Ok(Some(standing))
    }

    /// The better of two placements, the first of equal ones; the first, too, once `go_on`, which is asked as by
    /// [`Self::standing_while`], says no.
    pub fn preferred(
        &mut self,
        evaluator: &mut Evaluator,
        first: GridPlacement,
        second: GridPlacement,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<GridPlacement, SearchError> {
        let Some(a) = self.standing_while(evaluator, &first, go_on)? else { return Ok(first) };
        let b = self.standing_while(evaluator, &second, go_on)?;
        Ok(if b.is_some_and(|b| b.beats(&a)) { second } else { first })
    }

    /// The objective of held poses and one candidate more, for each candidate; `−∞` where it does not
    /// exist.
    pub(super) fn values_with(&mut self, poses: &[u32], candidates: &[u32]) -> Vec<(u32, f64)> {
        let mut union = Unions::default();
        self.atlas.union(poses, &mut union);
        self.evaluations += candidates.len() as u64;
        candidates.par_iter().map(|&pose| (pose, self.value_with(&union, pose))).collect()
    }

    /// Like [`Self::values_with`], for groups of one or two candidates.
    pub(super) fn values_with_groups(
        &mut self,
        poses: &[u32],
        groups: &[(u32, Option<u32>)],
    ) -> Vec<f64> {
        let mut union = Unions::default();
        self.atlas.union(poses, &mut union);
        self.evaluations += groups.len() as u64;
        let value = |&(one, other): &(u32, Option<u32>)| match other {
            None => self.value_with(&union, one),
            Some(other) => {
                let mut both = Unions::default();
                self.atlas.union(&[poses, &[one]].concat(), &mut both);
                self.value_with(&both, other)
            }
        };
        groups.par_iter().map(value).collect()
    }

    /// Poses looked at between two calls of `go_on`, where each is looked at `times` times.
    pub(super) fn poses_at_once(&self, times: usize) -> usize {
        let quick = BYTES_AT_ONCE / (times * self.atlas.page_bytes()).max(1);
        quick.clamp(POSES_AT_ONCE, u32::MAX as usize)
    }

    /// The objective of a union in each scene and one held pose more; `−∞` where it does not exist.
    pub(super) fn value_with(&self, unions: &Unions, pose: u32) -> f64 {
        let value = self.atlas.value_with(&self.objective, unions, pose);
        let mut value = value.unwrap_or(f64::NEG_INFINITY);
        if self.penalty > 0.0 && self.atlas.has_areas() {
            value -= self.penalty * self.atlas.missing_with(unions, Some(pose));
        }
        if self.atlas.has_sight() && (self.blind > 0.0 || self.penalty > 0.0) {
            let [car, rules] = self.atlas.unmet_with(unions, Some(pose), self.roomy);
            value -= self.blind * car + self.penalty * rules;
        }
        value
    }

    pub(super) fn has_requirements(&self) -> bool {
        self.atlas.has_areas() || self.atlas.sight().is_some_and(|s| s.has_rules())
    }

    /// Puts requirements first from now on: `penalty` times each missing share is taken off the objective.
    pub(super) fn require(&mut self, penalty: f64) {
        self.penalty = if self.has_requirements() { penalty } else { 0.0 };
    }

    /// Takes `blind` off the objective from now on for a car that no beam meets, where the evaluator looks for cars.
    pub(super) fn watch_cars(&mut self, blind: f64) {
        self.blind = if self.atlas.has_sight() { blind } else { 0.0 };
    }

    /// Share that held poses miss of the requirements, summed over areas and targets.
    pub(super) fn missing(&self, poses: &[u32]) -> f64 {
        self.lacks(poses)[0]
    }

    /// Share that held poses miss of the requirements, and the penalty for unseen cars in their value.
    pub(super) fn lacks(&self, poses: &[u32]) -> [f64; 2] {
        let mut unions = Unions::default();
        self.atlas.union(poses, &mut unions);
        let [car, rules] = self.atlas.unmet_with(&unions, None, false);
        [self.atlas.missing_with(&unions, None) + rules, self.blind * car]
    }

    /// The objective of held poses, 0 for none, less the penalties for missing shares and unseen cars.
    pub(super) fn held_value(&mut self, poses: &[u32]) -> f64 {
        let Some((&last, others)) = poses.split_last() else {
            return -self.penalty * self.missing(poses) - self.blind;
        };
        self.values_with(others, &[last])[0].1
    }

    /// The objective of a placement.
    pub fn value(&mut self, evaluator: &mut Evaluator, poses: &[u32]) -> Result<f64, SearchError> {
        let Some((&last, others)) = poses.split_last() else { return Ok(f64::NEG_INFINITY) };
        self.hold(evaluator, poses)?;
        Ok(self.values_with(others, &[last])[0].1)
    }

    /// Like [`Self::value`]; `None` once `go_on`, which is asked as by [`Self::hold_while`], says no.
    pub(super) fn value_while(
        &mut self,
        evaluator: &mut Evaluator,
        poses: &[u32],
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<f64>, SearchError> {
        let is_held = self.atlas.hold_while(evaluator, poses, go_on)?;
        is_held.then(|| self.value(evaluator, poses)).transpose()
    }
}

/// Bytes of bitmaps that are read between two questions whether to go on: less than a second's, and few in the tests of
/// this crate.
const BYTES_AT_ONCE: usize = if cfg!(test) { 1 << 12 } else { 1 << 30 };
