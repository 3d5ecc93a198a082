//! The one error of the program.

use std::path::Path;

use sightline::internals::FileError;

/// Everything that ends a command with exit code 2; printed as one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// From the library.
    #[error(transparent)]
    Library(#[from] sightline::Error),
    /// From a file or folder.
    #[error(transparent)]
    File(#[from] FileError),
    /// Arguments that do not fit the scene or each other.
    #[error("{0}")]
    Usage(String),
}

/// Errors of the library's modules, so that `?` takes them in one step.
macro_rules! from_modules {
    ($($error:path),* $(,)?) => {$(
        impl From<$error> for Error {
            fn from(error: $error) -> Self {
                Self::Library(error.into())
            }
        }
    )*};
}

from_modules!(
    sightline::audit::AuditError,
    sightline::chart::ChartError,
    sightline::datasets::DatasetError,
    sightline::engine::BackendError,
    sightline::engine::OpenError,
    sightline::export::ExportError,
    sightline::near_field::NearFieldError,
    sightline::problem::ProblemError,
    sightline::psog::GridError,
    sightline::psog::PsogFileError,
    sightline::rig::RigError,
    sightline::scan::ScanError,
    sightline::scan::VisibilityError,
    sightline::scene::DescriptionError,
    sightline::score::ObjectiveError,
    sightline::search::SearchError,
    sightline::study::StudyError,
    sightline::vehicle::PlacementError,
    sightline::internals::PoseGridError,
    sightline::vehicle::PlacementFileError,
    sightline::vehicle::SensorError,
    sightline::worlds::WorldError,
);

impl Error {
    /// Names the file or folder in an error of the operating system.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |source| FileError::io(path)(source).into()
    }
}
