//! Region of interest, voxels, P-SOG, entropy.
//!
//! | file | holds |
//! |---|---|
//! | `counts` | frames counted per voxel and class; why a P-SOG, its file or a vote was refused |
//! | `npz` | the P-SOG file; arrays of `.npz` archives, read and written |
//! | `entropy` | entropy of each voxel, in nats and in fixed point; sums that `psog info` prints |
//! | `vote` | labelled points to one class a voxel and frame, frames to a P-SOG |

mod counts;
pub mod entropy;
mod npz;
mod vote;

pub use counts::{Psog, PsogError};
pub use entropy::{ENTROPY_ONE, EntropyKind, EntropyTable, PsogInfo, fixed, to_nats};
pub use lidar_cast::grid::{GridError, Roi};
pub use npz::{NpzOut, read_psog, write_npz, write_psog};
pub use vote::{BuildReport, FrameVotes, PsogBuilder};

#[cfg(test)]
mod tests;
