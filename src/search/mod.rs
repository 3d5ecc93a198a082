//! From placements to scores, and the search that asks for better ones.

mod best;
mod certificate;
mod climb;
mod columns;
mod evaluator;
mod gain_bound;
mod pairs;
mod run;
mod swaps;

pub use best::{SWAP_SPACING, SwapSettings, Swapped, best_placement, swap_from};
pub use certificate::{Certificate, GridSample, LipschitzBound};
pub use climb::Moves;
pub use evaluator::Evaluator;
pub use gain_bound::{GainBound, bound_gain};
pub use run::{Best, GenerationRecord, Search, SearchError, SearchSettings, SearchStop};
pub use swaps::{GridPlacement, GridSearch};
