//! The one error of work on files.

use std::path::Path;

use crate::files::FileError;

/// Why work on files ended early, as one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// From the library.
    #[error(transparent)]
    Library(#[from] crate::Error),
    /// From a file or folder.
    #[error(transparent)]
    File(#[from] FileError),
    /// A likely mistake in an input, where such are refused.
    #[error("{0} (refused by --strict)")]
    Doubt(String),
    /// A request that does not fit the scene or itself.
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
    crate::audit::AuditError,
    crate::chart::ChartError,
    crate::datasets::DatasetError,
    crate::engine::BackendError,
    crate::job::JobError,
    crate::export::ExportError,
    crate::near_field::NearFieldError,
    crate::problem::ProblemError,
    crate::psog::GridError,
    crate::psog::PsogFileError,
    crate::rig::RigError,
    crate::scan::ScanError,
    crate::scan::VisibilityError,
    crate::scan::conditions::ConditionError,
    crate::scene::DescriptionError,
    crate::score::ObjectiveError,
    crate::search::SearchError,
    crate::study::StudyError,
    crate::vehicle::PlacementError,
    crate::vehicle::PoseGridError,
    crate::vehicle::PlacementFileError,
    crate::vehicle::SensorError,
    crate::worlds::WorldError,
);

impl Error {
    /// Names the file or folder in an error of the operating system.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |source| FileError::io(path)(source).into()
    }
}
