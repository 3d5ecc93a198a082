//! Why a grid, a P-SOG, its file or a vote was refused.

use std::path::{Path, PathBuf};

use lidar_cast::grid::GridError;
use lidar_cast::memory::OutOfMemory;

/// The arrays of a P-SOG file, in the order they are written.
pub(super) const ARRAYS: [&str; 7] =
    ["roi_min", "voxel", "shape", "frames", "classes", "index", "counts"];

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

    /// A spacing so narrow that a scan would not end.
    #[error(
        "psog.scan.spacing: {spacing} m makes {beams} beams in each frame, at most {limit} may be cast; give a wider one, \
         or leave it out"
    )]
    TooManyBeams { spacing: f64, beams: u64, limit: u64 },

    /// A scan of a scene that was stopped after `done` of its frames.
    #[error(
        "stopped after {done} of {frames} frames were scanned for the P-SOG; nothing of it is kept, give it more time"
    )]
    Stopped { done: usize, frames: usize },

    #[error("frames is 0; a P-SOG needs at least one frame")]
    NoFrames,
    #[error(
        "frame {frame} is one too many: a voxel's count holds at most {limit} frames; build from fewer frames"
    )]
    TooManyFrames { frame: u64, limit: u32 },
    #[error("classes is empty; name at least one class")]
    NoClasses,
    #[error("classes has {classes} names, at most {limit} fit; merge some classes")]
    TooManyClasses { classes: usize, limit: usize },
    /// A class name that is empty, longer than 200 characters or holds a control character, as a line break is.
    #[error(
        "classes[{position}] is {name:?}; a class name has 1 to 200 characters and holds no control character (names are joined by line breaks, the last one ends without)"
    )]
    ClassName { position: usize, name: String },
    #[error(
        "classes[{position}] is \"empty\"; empty is what the counts leave over, so remove that class and its column"
    )]
    ClassEmpty { position: usize },
    #[error(
        "classes[{position}] repeats the name {name:?} of classes[{first}]; give every class its own name"
    )]
    ClassTwice { position: usize, first: usize, name: String },

    /// `counts` does not hold one row a voxel.
    #[error("counts has {found} values; {voxels} voxels × {classes} classes need {need}", need = *voxels as u128 * *classes as u128)]
    CountsLength { found: usize, voxels: usize, classes: usize },
    #[error("index[{position}] is {value}, but the grid has {voxels} voxels, so the last index is {last}", last = voxels - 1)]
    IndexRange { position: usize, value: u64, voxels: u64 },
    /// Voxels out of order, or one listed twice.
    #[error("index[{position}] is {value}, not above index[{before}] = {previous}; list every voxel once, in rising order", before = position - 1)]
    IndexOrder { position: usize, value: u64, previous: u64 },
    /// More labelled frames than frames.
    #[error(
        "counts[{position}] (voxel {voxel}) adds up to {sum} frames, but frames is {frames}; a voxel has one class a frame"
    )]
    CountsOverFrames { position: usize, voxel: u64, sum: u64, frames: u32 },

    #[error(
        "the P-SOGs have different {field} ({left:?} and {right:?}); only P-SOGs of one grid can be merged"
    )]
    MergeGrid { field: &'static str, left: [f64; 3], right: [f64; 3] },
    #[error(
        "the P-SOGs differ at classes[{position}] ({left:?} and {right:?}); only P-SOGs with the same classes in the same order can be merged"
    )]
    MergeClasses { position: usize, left: String, right: String },
    #[error("the merged P-SOG would have {frames} frames, at most {limit} fit; merge fewer", limit = u32::MAX)]
    MergeFrames { frames: u64 },
    #[error("voxel {voxel} would have class {class:?} in {count} frames, at most {limit} fit; merge fewer", limit = u16::MAX)]
    MergeCount { voxel: u64, class: String, count: u32 },

    #[error(
        "a point of frame {frame} votes for class {class}, but there are {classes} classes; map its label first"
    )]
    VoteClass { frame: u64, class: u16, classes: usize },
    #[error(
        "a point of frame {frame} votes in voxel {voxel}, but the grid has {voxels}; vote in the grid the P-SOG is built on"
    )]
    VoteVoxel { frame: u64, voxel: u64, voxels: u64 },

    #[error("{}: cannot be read: {source}; give a P-SOG file, as `sightline psog build` writes it", path.display())]
    Open { path: PathBuf, source: std::io::Error },
    /// The file is no zip archive, or has lost its end.
    #[error("{} is not a readable .npz archive ({cause}); if it was cut short, copy or write it again", path.display())]
    Archive { path: PathBuf, cause: String },
    #[error("{}: `{member}` is not an array of a P-SOG, which holds {}; leave it out", path.display(), ARRAYS.join(", "))]
    UnknownArray { path: PathBuf, member: String },
    #[error("{}: array `{array}` {fault}", path.display())]
    Array { path: PathBuf, array: &'static str, fault: ArrayFault },
    /// The numbers of a file break a rule of the P-SOG.
    #[error("{}: {fault}", path.display())]
    InFile { path: PathBuf, fault: Box<PsogError> },
}

/// Fault with an array of a P-SOG file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages name every field
pub enum ArrayFault {
    #[error("is missing; a P-SOG holds {}", ARRAYS.join(", "))]
    Missing,
    #[error("is in the archive twice; keep one")]
    Twice,
    #[error("is packed with {method}; write the file with np.savez or np.savez_compressed")]
    Method { method: String },
    #[error("is damaged ({cause}); copy or write the file again")]
    Damaged { cause: String },
    #[error("has no usable .npy header ({cause}); write the file with np.savez")]
    Header { cause: String },
    #[error("has dtype {found}, wanted {wanted}; {}", conversion(found, wanted))]
    Dtype { found: String, wanted: &'static str },
    #[error("has shape {found}, wanted {wanted}")]
    Shape { found: String, wanted: String },
    /// The header promises other than the archive holds.
    #[error(
        "is promised {need} bytes by its header, the archive holds {have}; write the file again"
    )]
    Size { need: u64, have: u64 },
    #[error("is not UTF-8 from byte {at} on; encode the names as UTF-8")]
    NotUtf8 { at: usize },
    /// An element breaks a rule of the P-SOG.
    #[error(transparent)]
    Value(Box<PsogError>),
}

impl ArrayFault {
    pub(super) fn damaged(error: impl ToString) -> Self {
        Self::Damaged { cause: error.to_string() }
    }

    /// Names file and array.
    pub(super) fn of(self, path: &Path, array: &'static str) -> PsogError {
        let path = path.to_owned();
        match self {
            // Its message names the array and the element.
            Self::Value(fault) => PsogError::InFile { path, fault },
            fault => PsogError::Array { path, array, fault },
        }
    }
}

/// How to come from one element type to another in NumPy, whose `astype` takes no texts for bytes.
fn conversion(found: &str, wanted: &str) -> String {
    if wanted == "uint8" && found.contains(['U', 'S', 'O']) {
        return "join the names by \\n and write np.frombuffer(text.encode(), np.uint8)".to_owned();
    }
    format!("convert it with .astype(np.{wanted})")
}
