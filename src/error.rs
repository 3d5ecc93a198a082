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
pub enum Error {
    /// From reading placements.
    #[error(transparent)]
    Placements(#[from] PlacementFileError),
    /// From a rig of another program.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// From a grid of sensor poses.
    #[error(transparent)]
    PoseGrid(#[from] PoseGridError),
    /// From a P-SOG file.
    #[error(transparent)]
    PsogFile(#[from] PsogFileError),
    /// From labelled frames.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// From scanning a scene.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// From writing a data set.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// From parts that do not make a problem.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// From a job, or one of its parts: scenes, sensors, weather, engines, searches.
    #[error(transparent)]
    Job(JobError),
    /// From a file or folder.
    #[error(transparent)]
    File(#[from] FileError),
    /// From the objective.
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
    /// From a setting of the chart.
    #[error(transparent)]
    Chart(#[from] ChartError),
    /// From the near field of a scene.
    #[error(transparent)]
    NearField(#[from] NearFieldError),
    /// From an audit.
    #[error(transparent)]
    Audit(#[from] AuditError),
    /// From making a world.
    #[error(transparent)]
    World(#[from] WorldError),
    /// From a study.
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
