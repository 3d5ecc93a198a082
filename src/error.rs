//! One error for callers that use several modules.

use crate::audit::AuditError;
use crate::chart::ChartError;
use crate::datasets::DatasetError;
use crate::export::ExportError;
use crate::files::FileError;
use crate::job::JobError;
use crate::near_field::NearFieldError;
use crate::problem::ProblemError;
use crate::psog::PsogFileError;
use crate::rig::RigError;
use crate::scan::ScanError;
use crate::score::ObjectiveError;
use crate::study::StudyError;
use crate::vehicle::{PlacementFileError, PoseGridError};
use crate::worlds::WorldError;

/// Any error of this library, so that `?` works across its modules.
///
/// Each variant prints the module's own sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the types tell the modules")]
pub enum Error {
    #[error(transparent)]
    Placements(#[from] PlacementFileError),
    #[error(transparent)]
    Rig(#[from] RigError),
    #[error(transparent)]
    PoseGrid(#[from] PoseGridError),
    #[error(transparent)]
    PsogFile(#[from] PsogFileError),
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    #[error(transparent)]
    Scan(#[from] ScanError),
    #[error(transparent)]
    Export(#[from] ExportError),
    #[error(transparent)]
    Problem(#[from] ProblemError),
    #[error(transparent)]
    Job(JobError),
    #[error(transparent)]
    File(#[from] FileError),
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
    #[error(transparent)]
    Chart(#[from] ChartError),
    #[error(transparent)]
    NearField(#[from] NearFieldError),
    #[error(transparent)]
    Audit(#[from] AuditError),
    #[error(transparent)]
    World(#[from] WorldError),
    #[error(transparent)]
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
