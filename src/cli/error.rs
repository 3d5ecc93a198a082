//! The one error of the program.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Everything that ends a command with exit code 2; printed as one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// From the library.
    #[error(transparent)]
    Library(#[from] sightline::Error),
    /// A file or folder that cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// From the operating system.
        source: std::io::Error,
    },
    /// JSON of another form than expected.
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
    sightline::engine::BackendError,
    sightline::engine::OpenError,
    sightline::problem::ProblemError,
    sightline::psog::GridError,
    sightline::psog::KittiError,
    sightline::psog::PsogFileError,
    sightline::scene::DescriptionError,
    sightline::score::ObjectiveError,
    sightline::search::SearchError,
    sightline::study::StudyError,
    sightline::vehicle::PlacementError,
    sightline::vehicle::PoseGridError,
    sightline::vehicle::PlacementFileError,
    sightline::vehicle::SensorError,
);

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
