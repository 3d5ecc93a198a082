//! Progress of the costs, and the reasons to stop that come from it.

use std::collections::VecDeque;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::options::MOST_COUNTED;
use crate::{CmaOptions, constants};

/// Generations whose costs must all agree before the search counts as converged.
const AGREEING: usize = 10;
/// Generations that the test for stagnation compares, spread evenly over its memory.
const KEPT: usize = 40;
/// Largest window of a saved search.
const MOST_WINDOW: usize = 1 << 32;
/// Rounding of a cost, as a share of it; smaller differences count as none.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Reason to end a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[non_exhaustive]
pub enum StopReason {
    /// A cost reached the target.
    Target,
    /// The limit of evaluations is reached.
    Budget,
    /// All costs of ten generations, and the best ones of 10 + 30 n/λ, agree within the tolerance.
    TolFun,
    /// Neither the best nor the median costs have fallen over 200 + 200 n^1.5/λ generations.
    Stagnation,
    /// Every standard deviation is below 10⁻¹² of the first step size or, after
    /// [`super::Cma::polish`], below 10⁻³ of its floor.
    TolX,
    /// The condition number of C passed 10¹⁴.
    Condition,
    /// C is not finite, has no positive eigenvalue, or its eigenvectors were not found.
    Decomposition,
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Target => "target: a cost reached the target",
            Self::Budget => "evaluations: the limit is reached",
            Self::TolFun => "tolfun: the costs agree within the tolerance",
            Self::Stagnation => "stagnation: the costs have not fallen for long",
            Self::TolX => "tolx: the search distribution has shrunk to a point",
            Self::Condition => "condition: the covariance matrix is ill-conditioned",
            Self::Decomposition => "decomposition: the covariance matrix has no eigenvectors",
        })
    }
}

/// Costs of one generation, NaN left out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct Costs {
    best: f64,
    median: f64,
    worst: f64,
}

/// Record of the costs, read by the stop criteria alone: the update reads ranks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct CostHistory {
    target: Option<f64>,
    budget: Option<u64>,
    tolerance: f64,
    /// Generations whose best costs must agree before the search counts as converged.
    window: usize,
    /// Generations from one entry of `sparse` to the next.
    stride: u64,
    /// Generations of the last two windows.
    recent: VecDeque<Costs>,
    /// First generation of each stride.
    sparse: VecDeque<Costs>,
    generations: u64,
    best: Option<f64>,
    pub(super) evaluations: u64,
}

impl CostHistory {
    pub(super) fn new(options: &CmaOptions, n: usize, population: usize) -> Self {
        let (n, population) = (n as f64, population as f64);
        let memory = 200.0 + 200.0 * constants::pow(n, 1.5) / population;
        Self {
            target: options.target,
            budget: options.budget,
            tolerance: options.tol_fun,
            window: 10 + (30.0 * n / population).ceil() as usize,
            stride: (memory / KEPT as f64).ceil() as u64,
            recent: VecDeque::new(),
            sparse: VecDeque::new(),
            generations: 0,
            best: None,
            evaluations: 0,
        }
    }

    /// True if the record can be gone on with.
    pub(super) fn is_whole(&self) -> bool {
        (1..=MOST_WINDOW).contains(&self.window)
            && self.recent.len() <= 2 * self.window
            && self.sparse.len() <= KEPT
            && self.stride > 0
            && self.generations.max(self.evaluations) <= MOST_COUNTED
    }

    /// Records a generation; NaN is left out, and ±∞ becomes ±`f64::MAX`.
    pub(super) fn note(&mut self, costs: &[f64]) {
        self.evaluations += costs.len() as u64;
        let mut known: Vec<f64> = costs.iter().copied().filter(|c| !c.is_nan()).collect();
        if known.is_empty() {
            return;
        }
        let middle = known.len() / 2;
        let (lower, median, upper) = known.select_nth_unstable_by(middle, f64::total_cmp);
        let best = lower.iter().copied().fold(*median, f64::min);
        let worst = upper.iter().copied().fold(*median, f64::max);
        // JSON, the usual form of a saved search, has no infinities.
        let finite = |cost: f64| cost.clamp(f64::MIN, f64::MAX);
        let costs = Costs { best: finite(best), median: finite(*median), worst: finite(worst) };
        self.best = Some(self.best.map_or(costs.best, |best| best.min(costs.best)));
        push(&mut self.recent, costs, 2 * self.window);
        if self.generations.is_multiple_of(self.stride) {
            push(&mut self.sparse, costs, KEPT);
        }
        self.generations += 1;
    }

    pub(super) fn stop(&self) -> Option<StopReason> {
        if self.target.is_some_and(|target| self.best.is_some_and(|best| best <= target)) {
            Some(StopReason::Target)
        } else if self.budget.is_some_and(|budget| self.evaluations >= budget) {
            Some(StopReason::Budget)
        } else if self.agree() {
            Some(StopReason::TolFun)
        } else if self.stagnates() {
            Some(StopReason::Stagnation)
        } else {
            None
        }
    }

    /// True if the costs agree within the tolerance without being equal: equal costs are a plateau, and
    /// widen the search instead.
    fn agree(&self) -> bool {
        if self.recent.len() < self.window {
            return false;
        }
        let bests = self.recent.iter().rev().take(self.window).map(|c| c.best);
        let (low, high) = bests.fold((f64::MAX, f64::MIN), |(l, h), b| (l.min(b), h.max(b)));
        let worsts = self.recent.iter().rev().take(AGREEING).map(|c| c.worst);
        let range = worsts.fold(high, f64::max) - low;
        range > 0.0 && range < self.tolerance.max(ROUNDING * low.abs())
    }

    /// True if no cost has fallen over the memory, unless every generation kept was a plateau.
    fn stagnates(&self) -> bool {
        let flat = |costs: &Costs| costs.best == costs.worst;
        self.sparse.len() == KEPT && !self.sparse.iter().all(flat) && !falls(&self.sparse)
    }

    /// True if the best or the median costs of the last 2 (10 + 30 n/λ) generations fall; true while
    /// there are fewer.
    pub(super) fn falls(&self) -> bool {
        self.recent.len() < 2 * self.window || falls(&self.recent)
    }

    /// True if no cost falls and two generations have the same best cost, which happens on plateaus
    /// alone. True clears the window, so that the next answer waits for a new one.
    pub(super) fn stuck_on_plateau(&mut self) -> bool {
        if self.falls() {
            return false;
        }
        let mut bests: Vec<f64> = self.recent.iter().map(|c| c.best).collect();
        bests.sort_by(f64::total_cmp);
        let stuck = bests.windows(2).any(|pair| pair[0] == pair[1]);
        if stuck {
            self.recent.clear();
        }
        stuck
    }
}

fn push(past: &mut VecDeque<Costs>, costs: Costs, most: usize) {
    if past.len() == most {
        past.pop_front();
    }
    past.push_back(costs);
}

/// Compares two halves of a history: true if the best or the median costs fall from the earlier to the later.
fn falls(past: &VecDeque<Costs>) -> bool {
    let half = past.len() / 2;
    let middle = |of: fn(&Costs) -> f64, start: usize| {
        let mut costs: Vec<f64> = past.iter().skip(start).take(half).map(of).collect();
        *costs.select_nth_unstable_by(half / 2, f64::total_cmp).1
    };
    [|c: &Costs| c.best, |c: &Costs| c.median]
        .into_iter()
        .any(|of| middle(of, half) < middle(of, 0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn progress() -> CostHistory {
        let options = CmaOptions { target: Some(-5.0), budget: Some(4000), ..Default::default() };
        CostHistory::new(&options, 2, 4)
    }

    #[test]
    fn each_reason_of_the_costs_is_found() {
        let told = |generation: &dyn Fn(usize) -> [f64; 4], count: usize| {
            let mut progress = progress();
            (0..count).for_each(|g| progress.note(&generation(g)));
            progress.stop()
        };
        assert_eq!(told(&|_| [0.0, 1.0, 2.0, f64::NAN], 100), None);
        assert_eq!(told(&|g| [-(g as f64), 9.0, 9.0, 9.0], 6), Some(StopReason::Target));
        assert_eq!(told(&|g| [9.0 / g as f64, 9.0, 9.0, 9.0], 1000), Some(StopReason::Budget));
        assert_eq!(told(&|_| [1.0, 1.0, 1.0, 1.0 + 1e-14], 40), Some(StopReason::TolFun));
        assert_eq!(told(&|_| [1.0, 1.0, 1.0, 2.0], 500), Some(StopReason::Stagnation));
        assert_eq!(told(&|g| [1.0, 2.0, 3.0 - 1e-3 * g as f64, 3.0], 500), None);
    }

    #[test]
    fn a_plateau_is_no_convergence_and_nonsense_no_progress() {
        let mut progress = progress();
        (0..60).for_each(|_| progress.note(&[1.0; 4]));
        assert_eq!(progress.stop(), None);
        (0..60).for_each(|_| progress.note(&[f64::NAN; 4]));
        assert_eq!(progress.stop(), None);
        progress.note(&[f64::NEG_INFINITY, f64::INFINITY, f64::NAN, 0.0]);
        assert_eq!(progress.stop(), Some(StopReason::Target));
        let text = serde_json::to_string(&progress).unwrap();
        assert_eq!(serde_json::from_str::<CostHistory>(&text).unwrap(), progress);
    }
}
