use std::cmp::Ordering;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::{Evaluator, SearchError};
use crate::atlas::{Atlas, Union};
use crate::backend::Tally;
use crate::placement::{Placement, PoseGrid};
use crate::score::Objective;

/// Stale gains that lazy greedy looks at again at once: enough to keep every core busy.
const LAZY_BLOCK: usize = 64;
/// Best swaps of a sensor that are offered to the guards before the sensor stays where it is.
const OFFERS: usize = 4;

/// Searches placements whose LiDARs stand on poses of a grid.
pub struct GridSearch {
    atlas: Atlas,
    objective: Objective,
    min_distance: f64,
    lidars: usize,
    evaluations: u64,
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
    /// As poses in the ego frame.
    pub fn placement(&self, grid: &PoseGrid, name: &str) -> Placement {
        let lidars = self.poses.iter().map(|&pose| grid.pose(pose)).collect();
        Placement { name: name.to_owned(), lidars }
    }
}

/// To which poses a climb may move a LiDAR.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Moves {
    /// As many steps along one pose field.
    Along(u32),
    /// As many steps along every field at once.
    Around(u32),
    /// Anywhere on the grid.
    Anywhere,
}

/// A candidate pose and what the objective becomes with it; better ones come first, and of equal
/// ones the lower number.
pub(super) fn better_first(a: &(u32, f64), b: &(u32, f64)) -> Ordering {
    b.1.total_cmp(&a.1).then(a.0.cmp(&b.0))
}

impl GridSearch {
    /// A search of placements of as many LiDARs and at least as far apart as the evaluator's
    /// constraints say. Pages of the atlas are kept in the evaluator's store, if it has one.
    pub fn new(mut atlas: Atlas, objective: Objective, evaluator: &Evaluator) -> Self {
        if let Some(store) = evaluator.page_store() {
            atlas.keep_in(store.clone());
        }
        let constraints = evaluator.constraints();
        let (min_distance, lidars) = (constraints.min_distance, constraints.lidars);
        Self { atlas, objective, min_distance, lidars, evaluations: 0 }
    }

    /// The atlas it reads.
    pub fn atlas(&self) -> &Atlas {
        &self.atlas
    }

    /// LiDARs of a placement.
    pub fn lidars(&self) -> usize {
        self.lidars
    }

    /// Placements looked at so far.
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }

    /// Casts the poses that are not held yet.
    ///
    /// # Errors
    /// From the backend, or more poses than the atlas holds.
    pub fn hold(&mut self, evaluator: &mut Evaluator, poses: &[u32]) -> Result<(), SearchError> {
        Ok(self.atlas.hold(evaluator.backend_mut(), poses)?)
    }

    /// Whether a pose may stand beside others: another pose, and far enough away.
    pub fn fits(&self, pose: u32, others: &[u32]) -> bool {
        // The same slack as in `Constraints::violations`.
        let least = self.min_distance - 1e-9;
        let position = self.atlas.grid().pose(pose).position();
        others.iter().all(|&other| {
            other != pose && position.distance(self.atlas.grid().pose(other).position()) >= least
        })
    }

    /// What the objective becomes when each candidate joins held poses; `−∞` where it does not exist.
    pub(super) fn values_with(&mut self, poses: &[u32], candidates: &[u32]) -> Vec<(u32, f64)> {
        let mut union = Union::default();
        self.atlas.union(poses, &mut union);
        self.evaluations += candidates.len() as u64;
        let (problem, objective) = (self.atlas.problem(), &self.objective);
        let frames = problem.frame_count();
        let value = |&pose: &u32| {
            let tally = self.atlas.tally_with(&union, pose);
            let value = objective.value_of_tally(&tally, problem.content(), frames);
            (pose, value.unwrap_or(f64::NEG_INFINITY))
        };
        candidates.par_iter().map(value).collect()
    }

    /// The objective of held poses, 0 for none.
    pub(super) fn held_value(&mut self, poses: &[u32]) -> f64 {
        let Some((&last, others)) = poses.split_last() else { return 0.0 };
        self.values_with(others, &[last])[0].1
    }

    /// What an information gain grows by with each unit of the two tasks' entropies; 0 where it does
    /// not exist.
    pub(super) fn worth_units(&self) -> [f64; 2] {
        let problem = self.atlas.problem();
        [0, 1].map(|task| {
            // A power of two, and large: as exact as the objective's own factors.
            let sum = 1u64 << 40;
            let mut tally = Tally { covered: 1, covered_nonzero: 1, ..Tally::default() };
            tally.entropy[task] = sum;
            let content = problem.content();
            let value = self.objective.value_of_tally(&tally, content, problem.frame_count());
            value.unwrap_or(0.0) / sum as f64
        })
    }

    /// The objective of a placement.
    ///
    /// # Errors
    /// As [`Self::hold`].
    pub fn value(&mut self, evaluator: &mut Evaluator, poses: &[u32]) -> Result<f64, SearchError> {
        let Some((&last, others)) = poses.split_last() else { return Ok(f64::NEG_INFINITY) };
        self.hold(evaluator, poses)?;
        Ok(self.values_with(others, &[last])[0].1)
    }

    /// LiDAR after LiDAR, the candidate that makes the objective largest; `None` where no candidate
    /// fits any more.
    ///
    /// For an information gain this reaches at least 1 − 1/e of the best placement of these
    /// candidates where no distance is asked for (Nemhauser, Wolsey, Fisher 1978). Gains then only
    /// shrink as sensors join, so that old ones are bounds and most are not looked at again
    /// (Minoux 1978); the result is the same.
    ///
    /// # Errors
    /// As [`Self::hold`].
    pub fn greedy(
        &mut self,
        evaluator: &mut Evaluator,
        candidates: &[u32],
    ) -> Result<Option<GridPlacement>, SearchError> {
        self.hold(evaluator, candidates)?;
        let lazy = self.objective.is_information_gain();
        let mut placement = GridPlacement { poses: Vec::new(), value: 0.0 };
        let mut bounds: Vec<(u32, f64)> = candidates.iter().map(|&c| (c, f64::INFINITY)).collect();
        while placement.poses.len() < self.lidars {
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
        placement.value = self.value(evaluator, &placement.poses)?;
        Ok(Some(placement))
    }

    /// Moves one LiDAR at a time to the best pose it may move to, until none gains any more.
    ///
    /// A swap is only taken to a placement that violates no guard, so that the climb cannot game the
    /// objective, and from one that violates a guard to any that does not. `go_on` is asked before each LiDAR, with the poses that the atlas has cast so far.
    ///
    /// # Errors
    /// As [`Self::hold`].
    pub fn climb(
        &mut self,
        evaluator: &mut Evaluator,
        start: &[u32],
        moves: Moves,
        go_on: &dyn Fn(u64) -> bool,
    ) -> Result<GridPlacement, SearchError> {
        let value = self.value(evaluator, start)?;
        let mut here = GridPlacement { poses: start.to_vec(), value };
        let mut least =
            if self.is_guarded(evaluator, &here)? { f64::NEG_INFINITY } else { here.value };
        let mut settled = 0;
        let mut lidar = 0;
        while settled < here.poses.len() && go_on(self.atlas.poses_cast()) {
            let mut others = here.poses.clone();
            let old = others.remove(lidar);
            let grid = self.atlas.grid();
            let reach = match moves {
                Moves::Along(radius) => grid.along(old, radius),
                Moves::Around(radius) => grid.around(old, radius),
                Moves::Anywhere => (0..grid.len()).collect(),
            };
            let fitting: Vec<u32> =
                reach.into_iter().filter(|&pose| self.fits(pose, &others)).collect();
            match self.best_swap(evaluator, &others, &fitting, least)? {
                Some((pose, value)) => {
                    here.poses[lidar] = pose;
                    here.value = value;
                    least = value;
                    settled = 0;
                }
                None => settled += 1,
            }
            lidar = (lidar + 1) % here.poses.len();
        }
        Ok(here)
    }

    /// Whether a placement violates a guard.
    ///
    /// # Errors
    /// As [`Self::hold`].
    pub fn is_guarded(
        &self,
        evaluator: &mut Evaluator,
        placement: &GridPlacement,
    ) -> Result<bool, SearchError> {
        let placement = placement.placement(self.atlas.grid(), "guarded");
        Ok(!evaluator.scores(&[placement])?[0].guards.is_empty())
    }

    /// The better of two placements: one that violates a guard comes after any that does not.
    ///
    /// # Errors
    /// As [`Self::hold`].
    pub fn preferred(
        &self,
        evaluator: &mut Evaluator,
        first: GridPlacement,
        second: GridPlacement,
    ) -> Result<GridPlacement, SearchError> {
        let [a, b] = [self.is_guarded(evaluator, &first)?, self.is_guarded(evaluator, &second)?];
        let second_wins = if a == b { second.value > first.value } else { a };
        Ok(if second_wins { second } else { first })
    }

    /// The best candidate that beats `least` and leads to no violated guard.
    fn best_swap(
        &mut self,
        evaluator: &mut Evaluator,
        others: &[u32],
        candidates: &[u32],
        least: f64,
    ) -> Result<Option<(u32, f64)>, SearchError> {
        let room = self.atlas.capacity().saturating_sub(others.len()).max(1);
        let mut values = Vec::with_capacity(candidates.len());
        for some in candidates.chunks(room) {
            self.hold(evaluator, &[others, some].concat())?;
            values.extend(self.values_with(others, some));
        }
        values.retain(|&(_, value)| value > least);
        values.sort_by(better_first);
        for &(pose, value) in values.iter().take(OFFERS) {
            let poses = [others, &[pose]].concat();
            if !self.is_guarded(evaluator, &GridPlacement { poses, value })? {
                return Ok(Some((pose, value)));
            }
        }
        Ok(None)
    }

    /// The best of all placements of the candidates, by trying each; for small grids.
    ///
    /// # Errors
    /// As [`Self::hold`].
    pub fn exhaustive(
        &mut self,
        evaluator: &mut Evaluator,
        candidates: &[u32],
    ) -> Result<Option<GridPlacement>, SearchError> {
        self.hold(evaluator, candidates)?;
        let mut best: Option<GridPlacement> = None;
        let mut chosen = Vec::new();
        self.try_all(candidates, &mut chosen, &mut best);
        Ok(best)
    }

    fn try_all(
        &mut self,
        candidates: &[u32],
        chosen: &mut Vec<u32>,
        best: &mut Option<GridPlacement>,
    ) {
        let fitting = |search: &Self| -> Vec<u32> {
            candidates.iter().copied().filter(|&pose| search.fits(pose, chosen)).collect()
        };
        if chosen.len() + 1 == self.lidars {
            let candidates = fitting(self);
            let values = self.values_with(chosen, &candidates);
            let Some(&(pose, value)) = values.iter().min_by(|a, b| better_first(a, b)) else {
                return;
            };
            if best.as_ref().is_none_or(|best| value > best.value) {
                let poses = [&chosen[..], &[pose]].concat();
                *best = Some(GridPlacement { poses, value });
            }
            return;
        }
        for (index, &pose) in candidates.iter().enumerate() {
            if self.fits(pose, chosen) {
                chosen.push(pose);
                self.try_all(&candidates[index + 1..], chosen, best);
                chosen.pop();
            }
        }
    }
}
