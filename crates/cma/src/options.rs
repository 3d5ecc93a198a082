//! Options of a search, candidates, and errors.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Settings of a [`super::Cma`] beside its mean and its step size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CmaOptions {
    /// Candidates of a generation, λ; `None` takes 4 + ⌊3 ln n⌋.
    pub population: Option<usize>,
    /// True if the worse half of the candidates takes part in the covariance update, with negative
    /// weights.
    pub active: bool,
    /// Addition α_µ in the learning rate c_µ, eq. 58: 1/4 in the tutorial of 2023, 0 in that of 2016.
    pub c_mu_offset: f64,
    /// Seed of all samples.
    pub seed: u64,
    /// (lower, upper) of each variable; the search space is then scaled to [0, 1] and every
    /// candidate is feasible.
    pub bounds: Option<Vec<(f64, f64)>>,
    /// Floor of the standard deviation of each variable, in the caller's units, until
    /// [`super::Cma::polish`].
    pub min_std: Option<Vec<f64>>,
    /// Cost at which the search ends: [`super::StopReason::Target`].
    pub target: Option<f64>,
    /// Evaluations after which the search ends, at the end of a generation.
    pub budget: Option<u64>,
    /// Difference of costs below which they count as equal.
    pub tol_fun: f64,
}

impl Default for CmaOptions {
    fn default() -> Self {
        Self {
            population: None,
            active: true,
            c_mu_offset: 0.25,
            seed: 0,
            bounds: None,
            min_std: None,
            target: None,
            budget: None,
            tol_fun: 1e-11,
        }
    }
}

impl CmaOptions {
    /// Checks every number, and every length against the mean's.
    pub(super) fn check(&self, mean: &[f64], step_size: f64) -> Result<(), CmaError> {
        let want = mean.len();
        if let Some(&value) = mean.iter().find(|m| !m.is_finite()) {
            return Err(CmaError::BadNumber { name: "mean", value });
        }
        if !(step_size > 0.0 && step_size.is_finite()) {
            return Err(CmaError::BadNumber { name: "step size", value: step_size });
        }
        if let Some(std) = &self.min_std {
            check_length("the least standard deviation", std.len(), want)?;
            if let Some(&value) = std.iter().find(|s| !s.is_finite()) {
                return Err(CmaError::BadNumber { name: "least standard deviation", value });
            }
        }
        for (name, number) in [("target", self.target), ("tolerance", Some(self.tol_fun))] {
            if let Some(value) = number.filter(|v| !v.is_finite()) {
                return Err(CmaError::BadNumber { name, value });
            }
        }
        self.bounds.as_ref().map_or(Ok(()), |bounds| check_bounds("the bounds", bounds, want))
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum CandidateOrigin {
    /// Drawn from the distribution.
    Sampled,
    /// Given by the caller: [`crate::Cma::inject`].
    Injected,
    /// Best point of the generation before, moved onto the bounds near it.
    Clipped,
}

/// A point to evaluate.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Coordinates in the search space.
    pub(super) x: DVector<f64>,
    /// Coordinates in the caller's space.
    pub(super) point: Vec<f64>,
    pub(super) origin: CandidateOrigin,
    /// ‖C^(−1/2) (x − m)/σ‖² = ‖z‖² of a sample; 0 of other origins.
    pub(super) length: f64,
}

impl Candidate {
    /// Coordinates in the caller's space, within the bounds.
    pub fn point(&self) -> &[f64] {
        &self.point
    }
}

/// Largest population.
pub(crate) const MAX_POPULATION: usize = 1_000_000;
/// Largest count of generations or evaluations of a saved search: far beyond any run, far below overflow.
pub(crate) const MOST_COUNTED: u64 = 1 << 53;

/// Bad input: the search cannot start, or cannot go on.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum CmaError {
    /// A number that must be finite, or positive.
    #[error("{name} = {value} is not usable; give a finite {name}{}", positive(.name))]
    BadNumber { name: &'static str, value: f64 },
    /// A vector of another length than the mean.
    #[error("{name} has {got} entries, the mean has {want}; give one for each variable")]
    WrongLength { name: &'static str, got: usize, want: usize },
    /// Candidates, ranks or costs that are not one for each candidate of the generation.
    #[error("{got} {name} were told of a generation of {want}; tell one for each candidate asked")]
    WrongCount { name: &'static str, got: usize, want: usize },
    /// Bounds out of order, or not finite.
    #[error("bounds {lower} to {upper} of variable {index} are not in order")]
    BadBounds { index: usize, lower: f64, upper: f64 },
    /// No variable, or none with width.
    #[error("there is nothing to search: no variable has room to vary")]
    NoVariable,
    /// A saved search whose parts do not belong together.
    #[error("the saved search cannot be gone on with: {what}")]
    BadState { what: &'static str },
    /// Too few or too many candidates.
    #[error("a population of {population} is not usable; take 2 to {MAX_POPULATION}")]
    BadPopulation { population: usize },
}

/// Addition to the mend of numbers that must also be positive.
fn positive(name: &str) -> &'static str {
    if name == "step size" { " above zero" } else { "" }
}

/// Checks that there is one (lower, upper) a variable, finite and in order.
pub(super) fn check_bounds(
    name: &'static str,
    bounds: &[(f64, f64)],
    want: usize,
) -> Result<(), CmaError> {
    check_length(name, bounds.len(), want)?;
    for (index, &(lower, upper)) in bounds.iter().enumerate() {
        if !(lower <= upper && (upper - lower).is_finite()) {
            return Err(CmaError::BadBounds { index, lower, upper });
        }
    }
    Ok(())
}

/// Checks that a list has one entry a variable.
pub(super) fn check_length(name: &'static str, got: usize, want: usize) -> Result<(), CmaError> {
    if got == want { Ok(()) } else { Err(CmaError::WrongLength { name, got, want }) }
}
