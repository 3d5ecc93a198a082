//! A search that asks for placements and is told their values, whatever these are.

use std::sync::{Mutex, MutexGuard, PoisonError};

use numpy::PyArrayDyn;
use pyo3::prelude::*;
use sightline::internals::Standing;
use sightline::{Constraints, Placement};
use sightline_cma::{Candidate, CmaOptions, RestartOptions, Restarts};

use crate::arguments;
use crate::arrays::numbers;
use crate::errors::bad;
use crate::placements::PyPlacement;
use crate::space::{PySpace, poses_of};

/// Step size at the start, in the search space scaled to [0, 1].
const STEP_SIZE: f64 = 0.3;
/// Generations in a row without a placement that keeps the rules, after which the search gives up.
const BARREN: usize = 1000;

/// CMA-ES with restarts over a `Space`, one generation after another: `ask` gives poses, `tell` takes their values.
///
/// Placements that break rules of the mount are never asked about; they rank behind all others. Equal seeds and values give
/// equal placements. `population` is the number of placements of a generation, unless given by the number of variables.
/// Raises `ValueError` for a space in which nothing may vary.
#[pyclass(name = "Search", module = "sightline", frozen)]
pub(crate) struct PySearch {
    rules: Constraints,
    state: Mutex<GenerationState>,
}

struct GenerationState {
    cma: Restarts,
    asked: Option<PendingGeneration>,
    best: Option<(Placement, f64)>,
    told: u64,
}

/// A generation that waits for its values.
struct PendingGeneration {
    candidates: Vec<Candidate>,
    placements: Vec<Placement>,
    /// Metres and radians by which each breaks the rules.
    broken: Vec<f64>,
}

impl PendingGeneration {
    fn kept(&self) -> impl Iterator<Item = &Placement> {
        let all = self.placements.iter().zip(&self.broken);
        all.filter(|(_, broken)| **broken == 0.0).map(|(placement, _)| placement)
    }
}

impl GenerationState {
    /// The next generation, drawn.
    fn draw(&mut self, rules: &Constraints) -> PendingGeneration {
        let candidates = self.cma.ask();
        let placement = |candidate: &Candidate| Placement {
            name: "asked".to_owned(),
            lidars: rules.poses_of(candidate.point()),
        };
        let placements: Vec<Placement> = candidates.iter().map(placement).collect();
        // From plus zero: an empty sum is minus zero.
        let amount =
            |one: &Placement| rules.violations(one).iter().fold(0.0, |sum, v| sum + v.amount());
        let broken = placements.iter().map(amount).collect();
        PendingGeneration { candidates, placements, broken }
    }

    /// Ranks a generation by its rules first, then by values, none of which may be missing but for `NaN`.
    fn rank(&mut self, asked: &PendingGeneration, values: &[f64]) -> PyResult<()> {
        let mut values = values.iter().map(|value| Some(*value).filter(|value| !value.is_nan()));
        let standing = |&violation: &f64| match violation == 0.0 {
            true => Standing { violation, guards: 0, value: values.next().flatten(), blind: 0.0 },
            false => Standing::outside(violation),
        };
        let standings: Vec<Standing> = asked.broken.iter().map(standing).collect();
        let costs: Vec<f64> = standings.iter().map(Standing::cost).collect();
        let told = self.cma.tell_ranked(&asked.candidates, &Standing::ranks(&standings), &costs);
        told.map_err(|error| bad(error.to_string()))?;
        for (placement, standing) in asked.placements.iter().zip(&standings) {
            let Some(value) = standing.value else { continue };
            self.told += 1;
            if self.best.as_ref().is_none_or(|(_, best)| value > *best) {
                self.best = Some((placement.clone(), value));
            }
        }
        Ok(())
    }
}

#[pymethods]
impl PySearch {
    #[new]
    #[pyo3(signature = (space, *, seed = 1, population = None))]
    fn new(
        space: &Bound<'_, PySpace>,
        #[pyo3(from_py_with = arguments::seed)] seed: u64,
        #[pyo3(from_py_with = arguments::population)] population: Option<usize>,
    ) -> PyResult<Self> {
        let rules = space.get().constraints().clone();
        let bounds = rules.variable_bounds();
        let middle: Vec<f64> = bounds.iter().map(|(low, high)| 0.5 * (low + high)).collect();
        let options =
            CmaOptions { population, seed, bounds: Some(bounds), ..CmaOptions::default() };
        let cma = Restarts::new(&middle, STEP_SIZE, options, RestartOptions::default());
        let cma = cma.map_err(|error| bad(format!("space: {error}")))?;
        let state = Mutex::new(GenerationState { cma, asked: None, best: None, told: 0 });
        Ok(Self { rules, state })
    }

    /// f64 `[n, L, 6]`: placements of the next generation that keep all rules of the mount; the same ones until they are told.
    /// n differs from generation to generation. Raises `ValueError` where no draw keeps the rules.
    fn ask<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let kept = self.generation()?;
        poses_of(py, &kept, &[kept.len(), self.rules.lidars(), 6])
    }

    /// Placements of the next generation, with models and phases; `ask` gives their poses alone. Raises `ValueError` as `ask`.
    fn ask_placements(&self) -> PyResult<Vec<PyPlacement>> {
        Ok(self.generation()?.into_iter().map(PyPlacement).collect())
    }

    /// Takes the `values` `[n]` of the placements asked about last, in their order; larger is better, `NaN` is worst. Raises `ValueError` for
    /// another number of values, and where nothing was asked.
    fn tell(&self, values: &Bound<'_, PyAny>) -> PyResult<()> {
        let wanted = "[n]: a value for each placement that was asked about";
        let array = numbers::<f64>("values", values, wanted)?;
        let values: Vec<f64> = array.as_array().iter().copied().collect();
        let mut state = self.state();
        let asked =
            state.asked.take().ok_or_else(|| bad("values: nothing was asked; call ask first"))?;
        let count = asked.kept().count();
        if values.len() != count {
            state.asked = Some(asked);
            let found = values.len();
            return Err(bad(format!(
                "values: has the length {found}; give one for each placement, {count} in all"
            )));
        }
        state.rank(&asked, &values)
    }

    /// The best placement that was told, and its value; `None` while there is none.
    fn result(&self) -> Option<(PyPlacement, f64)> {
        let state = self.state();
        state.best.as_ref().map(|(placement, value)| (PyPlacement(placement.clone()), *value))
    }

    /// Number of values told so far, `NaN` left out.
    #[getter]
    fn told(&self) -> u64 {
        self.state().told
    }

    fn __repr__(&self) -> String {
        let state = self.state();
        let best = state.best.as_ref().map_or("none".to_owned(), |(_, value)| value.to_string());
        format!("Search({} values told, best {best})", state.told)
    }
}

impl PySearch {
    fn state(&self) -> MutexGuard<'_, GenerationState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Placements of the next generation that keep the rules, at least one.
    fn generation(&self) -> PyResult<Vec<Placement>> {
        let mut state = self.state();
        for _ in 0..BARREN {
            let asked = match state.asked.take() {
                Some(asked) => asked,
                None => state.draw(&self.rules),
            };
            let kept: Vec<Placement> = asked.kept().cloned().collect();
            if !kept.is_empty() {
                state.asked = Some(asked);
                return Ok(kept);
            }
            state.rank(&asked, &[])?;
        }
        Err(bad(format!(
            "space: no placement of {BARREN} generations keeps the rules of the mount; widen it, or lower min_distance"
        )))
    }
}
