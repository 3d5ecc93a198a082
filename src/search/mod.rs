//! From placements to scores, and the search that asks for better ones.

mod evaluator;
mod run;

pub use evaluator::Evaluator;
pub use run::{Best, GenerationRecord, Search, SearchError, SearchSettings};
