//! Additions to the tutorial's update: plateaus, floors of the deviations, points on the bounds.

use super::{Cma, MAX_STEP_SIZE};
use crate::constants;
use crate::options::{Candidate, CandidateOrigin};

/// Deviations count as on their floor up to this multiple of it.
const ON_FLOOR: f64 = 2.0;
/// Farthest move of the best point onto a bound, as a share of the variable's range.
const NEAR_BOUND: f64 = 0.1;
/// Growth of the step size on a plateau that the search does not leave.
const OFF_PLATEAU: f64 = 10.0;
/// Longest pause between clipped points, in generations.
const LONGEST_PAUSE: u32 = 16;

impl Cma {
    /// Applies all additions after an update; `order` sorts the candidates, best first.
    pub(super) fn adjust(&mut self, candidates: &[Candidate], order: &[usize]) {
        if self.progress.stuck_on_plateau() {
            self.state.step_size *= OFF_PLATEAU;
        }
        self.state.step_size = self.state.step_size.min(MAX_STEP_SIZE * self.first_step_size);
        self.raise_deviations();
        self.clip_next(candidates, order);
    }

    /// Grows σ by exp(0.2 + c_σ/d_σ): a generation of equal costs shows no direction.
    pub(super) fn widen(&mut self) {
        let c = &self.constants;
        self.state.step_size *= constants::exp(0.2 + c.c_sigma / c.d_sigma);
    }

    /// Standard deviation of variable `k` in the search space, σ √C_kk.
    pub(super) fn deviation(&self, k: usize) -> f64 {
        self.state.step_size * self.state.cov[(k, k)].sqrt()
    }

    /// Moves the best point onto the bounds near it, for the next generation to evaluate.
    ///
    /// No clipped point comes twice in a row. A clipped point in the worse half doubles the
    /// generations until the next one, up to [`LONGEST_PAUSE`]; one in the better half ends the pause.
    fn clip_next(&mut self, candidates: &[Candidate], order: &[usize]) {
        let Some(space) = &self.space else { return };
        let rank = order.iter().position(|&i| candidates[i].origin == CandidateOrigin::Clipped);
        self.clip_wait = self.clip_wait.saturating_sub(1);
        if let Some(rank) = rank {
            self.last_clip = self.clip.take();
            let good = rank < self.constants.mu;
            self.clip_wait = if good { 0 } else { self.clip_pause };
            self.clip_pause = if good { 1 } else { (2 * self.clip_pause).min(LONGEST_PAUSE) };
        }
        let near = |k: usize| self.deviation(k).min(NEAR_BOUND);
        self.clip = if self.clip_wait > 0 || self.constants.population < 4 {
            None
        } else {
            let clipped = space.clipped(candidates[order[0]].point(), near);
            clipped.filter(|clipped| self.last_clip.as_ref() != Some(clipped))
        };
    }

    /// Raises every standard deviation to its floor, below which the cost is constant.
    ///
    /// Releases the floors once all deviations are on them and the costs no longer fall; see
    /// [`Self::polish`].
    fn raise_deviations(&mut self) {
        let Some(floors) = &self.min_std else { return };
        if self.polishing {
            return;
        }
        let on_floor =
            floors.iter().enumerate().all(|(k, floor)| self.deviation(k) <= ON_FLOOR * floor);
        if on_floor && !self.progress.falls() {
            self.polishing = true;
            return;
        }
        for (k, floor) in floors.iter().enumerate() {
            let least = (floor / self.state.step_size).powi(2);
            if least.is_finite() && self.state.cov[(k, k)] < least {
                self.state.cov[(k, k)] = least;
            }
        }
    }
}
