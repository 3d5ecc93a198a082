//! Objectives of placements on a grid, from the bitmaps of an atlas.

use rayon::prelude::*;

use super::error::SearchError;
use super::evaluator::Evaluator;
use super::grid_search::GridSearch;
use crate::search::atlas::POSES_AT_ONCE;
use crate::search::atlases::Unions;

/// Bytes of bitmaps that are read between two questions whether to go on: less than a second's, and few in the tests of
/// this crate.
const BYTES_AT_ONCE: usize = if cfg!(test) { 1 << 12 } else { 1 << 30 };

impl GridSearch {
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
        self.atlas.has_areas() || self.atlas.has_target_rules()
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
