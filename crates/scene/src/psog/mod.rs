//! Region of interest, voxels, P-SOG, entropy.
//!
//! | file | holds |
//! |---|---|
//! | `counts` | frames counted per voxel and class |
//! | `npz`, `npz_member` | the P-SOG file, and one array of it |
//! | `npz_out` | writing of `.npz` archives |
//! | `entropy` | entropy of each voxel, in nats and in fixed point |
//! | `vote` | labelled points to one class a voxel and frame, frames to a P-SOG |
//! | `info` | what `psog info` prints |

mod counts;
pub mod entropy;
mod error;
mod info;
mod npz;
pub mod npz_member;
mod npz_out;
#[cfg(test)]
mod tests;
pub mod vote;

pub use counts::Psog;
pub use entropy::{ENTROPY_ONE, EntropyKind, EntropyTable, fixed, to_nats};
pub use error::PsogError;
pub use info::PsogInfo;
pub use lidar_cast::grid::{GridError, Roi};
pub use npz::{read_psog, write_psog};
pub use npz_member::PsogFileError;
pub use npz_out::{NpzOut, write_npz};
pub use vote::BuildReport;
pub use vote::{FrameVotes, PsogBuilder};
