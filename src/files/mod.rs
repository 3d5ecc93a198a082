//! Files that are whole at any time: outputs beside their place until they are done, folders of runs that
//! can go on after an interruption.

mod arrays;
mod folder;
mod input;
mod run_dir;
mod whole;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

pub use arrays::{LinePerElement, write_npy};
pub use folder::shared_folder;
pub use input::Input;
pub use run_dir::{RunDir, holds_run};
pub use whole::{is_sink, target, writable_file, write_whole};

/// Why a file or folder cannot be read, written or gone on with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// The operating system says why.
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
    /// A file or folder that must not be used so; the sentence names it and the mend.
    #[error("{0}")]
    Refused(String),
}

impl FileError {
    /// Names the file or folder in an error of the operating system.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| match source.kind() {
            ErrorKind::InvalidData => {
                Self::Refused(format!("{}: is not UTF-8 text; save it as UTF-8", path.display()))
            }
            _ => Self::Io { path: path.to_owned(), source },
        }
    }
}
