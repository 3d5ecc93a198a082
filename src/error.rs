//! One error for callers that use several modules.

use crate::chart::ChartError;
use crate::files::FileError;
use crate::job::JobError;
use crate::near_field::NearFieldError;
use crate::problem::ProblemError;
use crate::rig::FormatError;
use crate::score::ObjectiveError;
use crate::study::StudyError;
use crate::vehicle::{PlacementFileError, PoseGridError};
use crate::worlds::WorldError;

/// Any error of this library, so that `?` works across its modules.
///
/// Each variant prints the module's own sentence.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the types tell the modules")]
pub enum Error {
    Placements(#[from] PlacementFileError),
    PoseGrid(#[from] PoseGridError),
    Format(#[from] FormatError),
    Problem(#[from] ProblemError),
    Job(JobError),
    File(#[from] FileError),
    Objective(#[from] ObjectiveError),
    Chart(#[from] ChartError),
    NearField(#[from] NearFieldError),
    World(#[from] WorldError),
    Study(#[from] StudyError),
}

impl<E> From<E> for Error
where
    JobError: From<E>,
{
    fn from(error: E) -> Self {
        Self::Job(error.into())
    }
}
