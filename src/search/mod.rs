//! From placements to scores, and the search that asks for better ones.

mod certificate;
mod evaluator;
mod run;
mod swaps;

pub use certificate::{Certificate, GainBound, LipschitzBound, bound_gain, lipschitz_bound};
pub use evaluator::Evaluator;
pub use run::{Best, GenerationRecord, Search, SearchError, SearchSettings};
pub use swaps::{GridPlacement, GridSearch, Moves};
