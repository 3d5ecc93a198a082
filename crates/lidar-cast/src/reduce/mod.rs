//! Integer sums over covered voxels: the plain reference and the fast copy that gives its bits.

mod entropy_index;
mod reference;

pub use entropy_index::{EntropyIndex, take_sums};
pub use reference::reduce;
