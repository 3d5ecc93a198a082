//! What is asked of a batch of placements, and where its answers go.

use std::io::Write;
use std::path::{Path, PathBuf};

use crate::files::{safe_name, write_many, write_npy, write_own, write_whole};
use crate::job::Tolerance;
use crate::runs::{RunError, TableFormat};
use crate::scan::conditions::Condition;
use crate::vehicle::Placement;

/// Placements that are read, scored and printed at a time.
pub(super) const BLOCK: usize = 1024;

/// A batch of placements to be scored.
#[derive(Debug, Clone, Default)]
pub struct ScoreRequest {
    /// Scene files, and placements.
    pub files: Vec<PathBuf>,
    /// Form of the scores.
    pub format: TableFormat,
    /// File for the scores, in place of the caller's writer.
    pub out: Option<PathBuf>,
    /// Folder for the covered voxels of each placement.
    pub coverage_out: Option<PathBuf>,
    /// Whether the scores of an interrupted batch are gone on with, from `FILE.partial` beside the file.
    pub resume: bool,
    /// Frames to average over; all if none.
    pub frames: Option<u32>,
    /// Whether the near field is scored, too.
    pub near_field: bool,
    /// Draw of what is left to chance; other than 0 takes one scene.
    pub draw: u64,
    /// Mounting tolerance within which requirements are to hold.
    pub tolerance: Tolerance,
    /// Weather and faults.
    pub conditions: Vec<Condition>,
}

/// Hands out the file of the request, which is whole at any time, or the caller's writer.
pub(super) fn write_out(
    request: &ScoreRequest,
    out: &mut dyn Write,
    print: impl FnOnce(&Path, &mut dyn Write) -> Result<(), RunError>,
) -> Result<(), RunError> {
    match &request.out {
        Some(path) => write_whole(path, |file| print(path, file)),
        None => print(Path::new("stdout"), out),
    }
}

/// Says how far a batch came whose scores are not kept; `total` is 0 where it is not known.
pub(super) fn interrupted(request: &ScoreRequest, scored: u64, total: u64) -> RunError {
    let all = if total > 0 { format!(" of {total}") } else { String::new() };
    let left = request.out.as_ref().map(|out| format!("; {} is not written", out.display()));
    let left = left.unwrap_or_default();
    RunError::Interrupted(format!("interrupted after {scored}{all} placements{left}"))
}

/// Writes the covered voxels of a placement, in rising order.
pub(super) fn write_coverage(
    folder: &Path,
    placement: &Placement,
    covered: Vec<u64>,
    resumes: bool,
) -> Result<(), RunError> {
    let path = folder.join(format!("{}.npy", safe_name(&placement.name)));
    // The last block of an interrupted batch is written again.
    match resumes && path.exists() {
        true => write_own(&path, |file| write_npy(file, covered).map_err(RunError::io(&path))),
        false => write_many(&path, |file| write_npy(file, covered).map_err(RunError::io(&path))),
    }
}
