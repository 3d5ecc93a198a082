//! Integer sums over covered voxels: the plain reference and the fast copy that gives its bits.

mod entropy_index;
mod reference;

pub(crate) use entropy_index::{Worth, add_sums, take_sums, take_sums_spread};
pub use reference::reduce;
