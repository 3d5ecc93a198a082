//! Region of interest, voxels, P-SOG, entropy.
//!
//! | file | holds |
//! |---|---|
//! | `roi` | the voxel grid, and the rule that gives a hit its voxel |
//! | `counts` | frames counted per voxel and class |
//! | `npz`, `npz_member` | the P-SOG file, and one array of it |
//! | `npz_out` | writing of `.npz` archives |
//! | `entropy` | entropy of each voxel, in nats and in fixed point |
//! | `vote` | labelled points to one class a voxel and frame, frames to a P-SOG |
//! | `info` | what `psog info` prints |

mod counts;
pub(crate) mod entropy;
mod error;
mod info;
mod npz;
pub(crate) mod npz_member;
mod npz_out;
pub(crate) mod roi;
#[cfg(test)]
mod tests;
pub(crate) mod vote;

pub use counts::Psog;
pub(crate) use entropy::{ENTROPY_ONE, EntropyKind, EntropyTable, fixed, to_nats};
pub use error::GridError;
pub use info::PsogInfo;
pub use npz::{read_psog, write_psog};
pub use npz_member::PsogFileError;
pub(crate) use npz_out::{NpzOut, write_npz};
pub(crate) use roi::HIT_PUSH;
pub use roi::Roi;
pub use vote::BuildReport;
pub(crate) use vote::{FrameVotes, PsogBuilder};
