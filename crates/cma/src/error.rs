//! Errors of settings, points and costs, and the checks that find them.

/// Largest population.
pub(crate) const MAX_POPULATION: usize = 1_000_000;
/// Largest count of generations or evaluations of a saved search: far beyond any run, far below overflow.
pub(crate) const MOST_COUNTED: u64 = 1 << 53;

/// Bad input: the search cannot start, or cannot go on.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
pub enum CmaError {
    /// A number that must be finite, or positive.
    #[error("{name} = {value} is not usable; give a finite {name}{}", positive(.name))]
    BadNumber {
        /// Setting or vector that holds the number.
        name: &'static str,
        /// The number.
        value: f64,
    },
    /// A vector of another length than the mean.
    #[error("{name} has {got} entries, the mean has {want}; give one for each variable")]
    WrongLength {
        /// List of the wrong length.
        name: &'static str,
        /// Entries given.
        got: usize,
        /// Entries needed.
        want: usize,
    },
    /// Candidates, ranks or costs that are not one for each candidate of the generation.
    #[error("{got} {name} were told of a generation of {want}; tell one for each candidate asked")]
    WrongCount {
        /// List of the wrong length.
        name: &'static str,
        /// Entries given.
        got: usize,
        /// Entries needed.
        want: usize,
    },
    /// Bounds out of order, or not finite.
    #[error("bounds {lower} to {upper} of variable {index} are not in order")]
    BadBounds {
        /// Variable, from 0.
        index: usize,
        /// Lower bound.
        lower: f64,
        /// Upper bound.
        upper: f64,
    },
    /// No variable, or none with width.
    #[error("there is nothing to search: no variable has room to vary")]
    NoVariable,
    /// A saved search whose parts do not belong together.
    #[error("the saved search cannot be gone on with: {what}")]
    BadState {
        /// The fault.
        what: &'static str,
    },
    /// Too few or too many candidates.
    #[error("a population of {population} is not usable; take 2 to {MAX_POPULATION}")]
    BadPopulation {
        /// Text as given.
        population: usize,
    },
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
