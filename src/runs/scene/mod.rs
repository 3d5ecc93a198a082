//! Scene files: made by rule, taken over from maps and scans, counted.

mod import;
mod info;
mod new;
mod target;

pub use import::{Origin, import};
pub use info::{SceneCounts, count, counts_text};
pub use new::{new_street, new_world};
