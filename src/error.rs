//! One error for callers that use several modules.

use crate::audit::AuditError;
use crate::chart::ChartError;
use crate::datasets::DatasetError;
use crate::engine::BackendError;
use crate::export::ExportError;
use crate::files::FileError;
use crate::job::JobError;
use crate::near_field::NearFieldError;
use crate::problem::ProblemError;
use crate::psog::{GridError, PsogFileError};
use crate::rig::RigError;
use crate::scan::conditions::ConditionError;
use crate::scan::{ScanError, VisibilityError};
use crate::scene::DescriptionError;
use crate::score::ObjectiveError;
use crate::search::SearchError;
use crate::study::StudyError;
use crate::vehicle::{PlacementError, PlacementFileError, PoseGridError, SensorError};
use crate::worlds::WorldError;

/// Any error of this library, so that `?` works across its modules.
///
/// Each variant prints the module's own sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// From reading a scene.
    #[error(transparent)]
    Scene(#[from] DescriptionError),
    /// From reading placements.
    #[error(transparent)]
    Placements(#[from] PlacementFileError),
    /// From a placement.
    #[error(transparent)]
    Placement(#[from] PlacementError),
    /// From a rig of another program.
    #[error(transparent)]
    Rig(#[from] RigError),
    /// From a grid of sensor poses.
    #[error(transparent)]
    PoseGrid(#[from] PoseGridError),
    /// From the voxels of a P-SOG.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// From a P-SOG file.
    #[error(transparent)]
    PsogFile(#[from] PsogFileError),
    /// From labelled frames.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// From scanning a scene.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// From scores under conditions.
    #[error(transparent)]
    Visibility(#[from] VisibilityError),
    /// From weather and faults as they are written.
    #[error(transparent)]
    Condition(#[from] ConditionError),
    /// From writing a data set.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// From the sensor.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// From parts that do not make a problem.
    #[error(transparent)]
    Problem(#[from] ProblemError),
    /// From a job that cannot be posed, scored or searched.
    #[error(transparent)]
    Job(#[from] JobError),
    /// From a file or folder.
    #[error(transparent)]
    File(#[from] FileError),
    /// From evaluating.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// From the objective.
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
    /// From a setting of the chart.
    #[error(transparent)]
    Chart(#[from] ChartError),
    /// From the near field of a scene.
    #[error(transparent)]
    NearField(#[from] NearFieldError),
    /// From the search.
    #[error(transparent)]
    Search(#[from] SearchError),
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
