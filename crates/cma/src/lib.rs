//! Covariance matrix adaptation evolution strategy: ask, tell, stop.
//!

#![cfg_attr(test, allow(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]

mod bounds;
mod cma;
mod constants;
mod options;
mod restarts;
mod state;
mod stop;

pub use cma::Cma;
pub use constants::Constants;
pub use options::{Candidate, CmaError, CmaOptions};
pub use restarts::{Ended, RestartOptions, RestartStrategy, Restarts};
pub use stop::StopReason;

#[cfg(test)]
mod tests;
