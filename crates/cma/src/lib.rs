//! Covariance matrix adaptation evolution strategy: ask, tell, stop.
//!

#![cfg_attr(test, allow(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]

mod bounds;
mod cma;
mod constants;
mod error;
mod maths;
mod options;
mod restarts;
mod state;
mod stop;
#[cfg(test)]
mod tests;

pub use cma::Cma;
pub use constants::Constants;
pub use error::CmaError;
pub use options::{Candidate, CmaOptions};
pub use restarts::{Ended, RestartOptions, RestartStrategy, Restarts};
pub use stop::StopReason;
