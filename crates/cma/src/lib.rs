//! Covariance matrix adaptation evolution strategy (CMA-ES): pure numbers, knows no GPU and no scene.
//!
//! After N. Hansen, "The CMA Evolution Strategy: A Tutorial", arXiv:1604.00772; equation numbers in
//! the code are the tutorial's. Only the ranks of the costs matter.

mod bounds;
mod cma;
mod constants;
mod options;
mod restarts;
mod state;
mod stop;
#[cfg(test)]
mod tests;

pub use bounds::BoundTransform;
pub use cma::{Candidate, Cma};
pub use constants::Constants;
pub use options::{CmaOptions, OptimizeError};
pub use restarts::{Ended, RestartOptions, RestartStrategy, Restarts};
pub use state::State;
pub use stop::StopReason;
