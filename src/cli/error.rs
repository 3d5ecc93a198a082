use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use sightline::chart::FidelityError;
use sightline::engine::BackendError;
use sightline::problem::ProblemError;
use sightline::psog::{GridError, KittiError, PsogFileError};
use sightline::scene::SceneError;
use sightline::score::ObjectiveError;
use sightline::search::SearchError;
use sightline::vehicle::{PlacementError, PoseGridError, ReadError, SensorError};

/// Everything that ends a command with exit code 2; printed as one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// From reading a scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// From reading placements.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// From a placement.
    #[error(transparent)]
    Placement(#[from] PlacementError),
    /// From a grid of sensor poses.
    #[error(transparent)]
    PoseGrid(#[from] PoseGridError),
    /// From the P-SOG.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// From a P-SOG file.
    #[error(transparent)]
    PsogFile(#[from] PsogFileError),
    /// From labelled frames.
    #[error(transparent)]
    Kitti(#[from] KittiError),
    /// From the sensor.
    #[error(transparent)]
    Sensor(#[from] SensorError),
    /// From putting scene and P-SOG together.
    #[error("{files}: {source}")]
    Problem {
        /// Of the scene, and of the P-SOG where it has one.
        files: String,
        /// Why they do not fit.
        source: ProblemError,
    },
    /// From evaluating.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// From the objective.
    #[error(transparent)]
    Objective(#[from] ObjectiveError),
    /// From a setting of the chart.
    #[error(transparent)]
    Fidelity(#[from] FidelityError),
    /// From the search.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// A file or folder that cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// From the operating system.
        source: std::io::Error,
    },
    /// JSON that is not what was expected.
    #[error("{}: {source}", path.display())]
    Json {
        /// File.
        path: PathBuf,
        /// Where and why.
        source: serde_json::Error,
    },
    /// Arguments that do not fit the scene or each other.
    #[error("{0}")]
    Usage(String),
}

impl Error {
    /// Names the file or folder in an error of the operating system.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| match source.kind() {
            ErrorKind::InvalidData => {
                Self::Usage(format!("{}: is not UTF-8 text; save it as UTF-8", path.display()))
            }
            _ => Self::Io { path: path.to_owned(), source },
        }
    }
}
