//! Trials against the metric itself: what fools a score, and which guard notices.

mod ranking;
mod trial;

pub use ranking::{kendall_tau, mean_height, spearman};
pub use trial::{Trial, Verdict, gaming_placements, jittered};
