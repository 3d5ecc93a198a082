//! Upper bounds, sampled and proven, on the objective of every placement that the mount allows.

mod branch_and_bound;
mod first_poses;
mod on_grid;
mod open_sets;
mod pair_overlaps;
mod required;
mod sample;
mod voxel_groups;

pub use branch_and_bound::{Effort, GainBound, bound_gain};
pub use on_grid::Certificate;
#[cfg(test)]
pub(crate) use on_grid::tests::bound_of;
pub(super) use on_grid::{Bounds, bounds};
pub use sample::GridSample;
