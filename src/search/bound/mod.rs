//! How good the result is: sampled and proven upper bounds on what the mount allows.

mod certificate;
mod columns;
mod gain_bound;
mod pairs;

pub use certificate::{Certificate, GridSample, LipschitzBound};
pub use gain_bound::{GainBound, bound_gain};
