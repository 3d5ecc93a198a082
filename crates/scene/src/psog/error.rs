//! Why a grid, a P-SOG, its file or a vote was refused.

use std::path::{Path, PathBuf};

use lidar_cast::grid::GridError;
use lidar_cast::memory::OutOfMemory;

/// Why a grid, a P-SOG, its file or a vote was refused.
///
/// Field names (`roi_min`, `voxel`, `shape`, `frames`, `classes`, `index`, `counts`) match the P-SOG file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum PsogError {
    /// The voxel grid.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// The trees of a scene that is scanned do not fit into memory.
    #[error(transparent)]
    OutOfMemory(#[from] OutOfMemory),
    /// A scan of a scene that was stopped after `done` of its frames.
    #[error(
        "stopped after {done} of {frames} frames were scanned for the P-SOG; nothing of it is kept, give it more time"
    )]
    Stopped { done: usize, frames: usize },
    #[error("{}: cannot be read: {source}; give a P-SOG file, as `sightline psog build` writes it", path.display())]
    Open { path: PathBuf, source: std::io::Error },
    /// Any other setting, number, class, vote or file; the sentence names it and the mend.
    #[error("{0}")]
    Refused(String),
}

/// A [`PsogError::Refused`] of a format string and its values.
macro_rules! refused {
    ($($sentence:tt)*) => { PsogError::Refused(format!($($sentence)*)) };
}
pub(super) use refused;

impl PsogError {
    /// Names the file that has the fault.
    pub(super) fn in_file(self, path: &Path) -> Self {
        refused!("{}: {self}", path.display())
    }
}
