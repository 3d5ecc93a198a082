use serde::{Deserialize, Serialize};

/// Largest population.
pub(super) const MAX_POPULATION: usize = 1_000_000;

/// How a [`super::Cma`] searches, beside mean and step size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CmaOptions {
    /// Candidates of a generation, λ; `None` takes 4 + ⌊3 ln n⌋.
    pub population: Option<usize>,
    /// Whether bad candidates take part in the covariance update with negative weights.
    pub active: bool,
    /// 1/4 for the tutorial of 2023, 0 for that of 2016.
    pub c_mu_offset: f64,
    /// Seed of all samples.
    pub seed: u64,
    /// (lower, upper) of each variable; the search space is then scaled to [0, 1] and every
    /// candidate is feasible.
    pub bounds: Option<Vec<(f64, f64)>>,
    /// Least standard deviation of each variable in the caller's units, until the final polish; see
    /// [`super::Cma::polish`].
    pub min_std: Option<Vec<f64>>,
    /// Cost at which the search has found what it was for.
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

/// What cannot be searched with.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum OptimizeError {
    /// A number that must be finite, or positive.
    #[error("{name} = {value} is not usable; give a finite {name}{}", positive(.name))]
    BadNumber {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A vector of another length than the mean.
    #[error("{name} has {got} entries, the mean has {want}; give one for each variable")]
    WrongLength {
        /// Which.
        name: &'static str,
        /// Entries given.
        got: usize,
        /// Entries needed.
        want: usize,
    },
    /// A generation, or its costs, of another number than was asked for.
    #[error("{got} {name} were told of a generation of {want}; tell one for each candidate asked")]
    WrongCount {
        /// Which.
        name: &'static str,
        /// Entries given.
        got: usize,
        /// Entries needed.
        want: usize,
    },
    /// Bounds out of order, or not finite.
    #[error("bounds {lower} to {upper} of variable {index} are not in order")]
    BadBounds {
        /// Variable.
        index: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// No variable, or none with width.
    #[error("there is nothing to search: no variable has room to vary")]
    NoVariable,
    /// Too few or too many candidates.
    #[error("a population of {population} is not usable; take 2 to {MAX_POPULATION}")]
    BadPopulation {
        /// As given.
        population: usize,
    },
}

fn positive(name: &str) -> &'static str {
    if name == "step size" { " above zero" } else { "" }
}

/// That bounds or the like are as many as the variables, finite and in order.
pub(super) fn check_bounds(
    name: &'static str,
    bounds: &[(f64, f64)],
    want: usize,
) -> Result<(), OptimizeError> {
    check_length(name, bounds.len(), want)?;
    for (index, &(lower, upper)) in bounds.iter().enumerate() {
        if !(lower <= upper && (upper - lower).is_finite()) {
            return Err(OptimizeError::BadBounds { index, lower, upper });
        }
    }
    Ok(())
}

pub(super) fn check_length(
    name: &'static str,
    got: usize,
    want: usize,
) -> Result<(), OptimizeError> {
    if got == want { Ok(()) } else { Err(OptimizeError::WrongLength { name, got, want }) }
}
