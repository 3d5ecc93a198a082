//! Whether two backends agree to the bit, and the reference with arithmetic it shares nothing with.

mod compare;
mod oracle;
mod placements;

pub use compare::{Differences, compare_backends};
pub use oracle::{Agreement, EDGE_TOLERANCE, Explanation, explain, sample_reference};
pub use placements::hostile_placements;
