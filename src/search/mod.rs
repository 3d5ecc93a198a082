//! From placements to scores, and the search that asks for better ones.

pub mod atlas;
mod best;
mod bound;
mod climb;
mod evaluator;
mod run;
mod swaps;

pub use best::{SWAP_SPACING, SwapSettings, Swapped, best_placement, swap_from};
pub use bound::{Certificate, GainBound, GridSample, LipschitzBound, bound_gain};
pub use climb::Moves;
pub use evaluator::Evaluator;
pub use run::{Best, GenerationRecord, Search, SearchError, SearchSettings, SearchStop};
pub use swaps::{GridPlacement, GridSearch};
