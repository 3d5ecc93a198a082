//! Surfaces that pairs of LiDARs share, and whether pairs connect all LiDARs: for the study of overlap and for rules on it.
//!
//! - **Surface voxel** of a LiDAR: a voxel of the region in which one of its beams ends at a surface other than the own
//!   body. Shared by two LiDARs: both have a hit in it in the same frame.
//! - **Overlap** of two LiDARs: shared surface voxels as a share of the voxels of the LiDAR that has fewer, summed over frames.
//!
//! | file | holds |
//! |---|---|
//! | `pairs` | pairs that connect LiDARs: groups, and the strongest chain |
//! | `surfaces` | surface voxels of a LiDAR, and the pairs of several |
//! | `required` | the rule of a vehicle in one scene |

mod pairs;
mod required;
mod surfaces;

pub(crate) use pairs::{Pair, chain, groups};
pub(crate) use required::{RequiredOverlap, Shares, connected_without, cut_off, part_connected};
pub(crate) use surfaces::{Shared, Surfaces, connected_up_to, surface_voxels};
