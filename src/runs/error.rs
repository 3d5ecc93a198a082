//! The one error of work on files.

use std::path::Path;

use crate::files::FileError;

/// Why work on files ended early, as one sentence.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// From the library, files and folders among it.
    #[error(transparent)]
    Library(crate::Error),
    /// A likely mistake in an input, where such are refused.
    #[error("{0} (refused by --strict)")]
    Doubt(String),
    /// Work that the watcher stopped before it had anything to leave.
    #[error("{0}")]
    Interrupted(String),
    /// A request that does not fit the scene or itself.
    #[error("{0}")]
    Usage(String),
}

/// Errors of the library's modules, so that `?` takes them in one step.
impl<E> From<E> for RunError
where
    crate::Error: From<E>,
{
    fn from(error: E) -> Self {
        Self::Library(error.into())
    }
}

impl RunError {
    /// Names the file or folder in an error of the operating system.
    pub(crate) fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        |source| FileError::io(path)(source).into()
    }
}
