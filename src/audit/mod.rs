//! Trials against the metric itself: what fools a score, and which guard notices.

mod trial;

pub use trial::{Trial, Verdict, gaming_placements, jittered};
