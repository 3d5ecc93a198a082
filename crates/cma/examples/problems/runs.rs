//! One run of one problem.

use serde::Serialize;
use sightline_cma::{CmaOptions, RestartOptions, RestartStrategy, Restarts};

use crate::problems::{File, Noise, TestFunction};

/// Largest distance from the box that counts as rounding.
const TOLERANCE: f64 = 1e-12;

/// Means of restarts are drawn from ±`START`, times the problem's `x0_scale`.
const START: f64 = 4.0;

/// Result of one run.
#[derive(Serialize)]
pub(crate) struct Attempt {
    /// Evaluations to the target; `None` if it was not reached.
    pub evaluations: Option<u64>,
    /// Evaluations until the end of the run, whether it reached the target or not.
    pub spent: u64,
    pub success: bool,
    /// Points outside the bounds.
    pub infeasible: u64,
    pub stop: String,
}

/// Runs one problem until its target, its budget or a stop of the optimizer.
pub(crate) fn run(file: &File, problem: &TestFunction, run: usize) -> Result<Attempt, String> {
    let cost = file.cost(problem).ok_or_else(|| format!("{}: unknown function", problem.id))?;
    let mut noise = Noise::new(problem, run);
    let bounds = problem.lower.zip(problem.upper);
    let options = CmaOptions {
        population: problem.popsize,
        seed: run as u64 + 1,
        bounds: bounds.map(|bounds| vec![bounds; problem.n]),
        ..CmaOptions::default()
    };
    let reach = START * problem.x0_scale;
    let restarts = RestartOptions {
        strategy: RestartStrategy::Ipop,
        region: Some(vec![(-reach, reach); problem.n]),
    };
    // Within bounds the step size is a share of their range.
    let step_size = problem.sigma0 / bounds.map_or(1.0, |(low, high)| high - low);
    let start = file.start(problem, run);
    let mut search =
        Restarts::new(&start, step_size, options, restarts).map_err(|e| e.to_string())?;
    let of_mean = problem.indicator == "mean";
    let (mut evaluations, mut infeasible) = (0, 0);
    let end = |spent, success: bool, infeasible, stop: String| {
        Ok(Attempt { evaluations: success.then_some(spent), spent, success, infeasible, stop })
    };
    loop {
        if evaluations >= problem.budget {
            return end(evaluations, false, infeasible, "budget".into());
        }
        let candidates = search.ask();
        let mut costs = Vec::with_capacity(candidates.len());
        for (index, candidate) in candidates.iter().enumerate() {
            if let Some((low, high)) = bounds {
                let inside = |x: &f64| *x >= low - TOLERANCE && *x <= high + TOLERANCE;
                infeasible += u64::from(!candidate.point().iter().all(inside));
            }
            let true_cost = cost(candidate.point());
            if !of_mean && true_cost <= problem.target {
                return end(evaluations + index as u64 + 1, true, infeasible, "target".into());
            }
            costs.push(noise.observe(true_cost));
        }
        evaluations += candidates.len() as u64;
        search.tell(&candidates, &costs).map_err(|error| error.to_string())?;
        if of_mean && cost(&search.running().mean_point()) <= problem.target {
            return end(evaluations, true, infeasible, "target".into());
        }
        if let (None, Some(ended)) = (&problem.restart, search.ended().first()) {
            return end(evaluations, false, infeasible, ended.reason.to_string());
        }
    }
}
