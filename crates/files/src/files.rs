//! Files that are read and written: one guard of inputs, outputs beside their place until they are whole, folders of
//! runs that can go on after an interruption.
//!
//! | file | holds |
//! |---|---|
//! | `guard` | inputs of a command, and the outputs that must not replace them |
//! | `paths` | where paths lead, names that become files, references of one file to another |
//! | `whole` | files, and folders of files, that are either whole or not there |
//! | `folder`, `run_dir` | folders that are locked, files that a run was begun with, and the state of a run |

mod folder;
mod guard;
mod paths;
mod run_dir;
mod whole;

use std::fmt::Display;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

pub use crate::npy::{LinePerElement, write_npy};
pub use folder::{Input, shared_folder, writable_folder, write_folder};
pub use guard::{
    Session, Temporary, is_forced, is_no_input, open, read, read_own, remove_temporaries, sweep,
    will_read,
};
pub use paths::{FileNames, is_sink, safe_name, safe_names, stays_inside, target, trust_paths};
pub use run_dir::{RunDir, changed_input, check_new_folder, command_of, holds_run};
pub use whole::{Output, begin_in, sync_disk, writable_file, write_as, write_pair, write_whole};

/// Why a file or folder cannot be read, written or gone on with.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum FileError {
    #[error("{}: {source}", path.display())]
    Io { path: PathBuf, source: std::io::Error },
    #[error("{}: cannot be written: {source}", path.display())]
    Write { path: PathBuf, source: std::io::Error },
    #[error("{}: the disk is full; make room and run again", path.display())]
    Full { path: PathBuf },
    #[error("{}: {source}", path.display())]
    Json { path: PathBuf, source: serde_json::Error },
    /// A file or folder that must not be used so; the sentence names it and the mend.
    #[error("{0}")]
    Refused(String),
}

impl FileError {
    /// Names a file or folder that must not be used so.
    fn refused(path: &Path, words: impl Display) -> Self {
        Self::Refused(format!("{}: {words}", path.display()))
    }

    /// Names the file or folder in an error of the operating system.
    pub fn io(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| match kind(&source) {
            ErrorKind::InvalidData => Self::refused(path, "is not UTF-8 text; save it as UTF-8"),
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
                Self::Full { path: path.to_owned() }
            }
            ErrorKind::FileTooLarge if !is_read(&source) => Self::refused(
                path,
                "grows larger than the system lets a file be; raise the limit (`ulimit -f`), or name a place on \
                 another disk",
            ),
            _ => Self::Io { path: path.to_owned(), source: without_place(source) },
        }
    }

    /// Names the place that could not be written; sentences of this program stay as they are.
    pub fn write(path: &Path) -> impl FnOnce(std::io::Error) -> Self + '_ {
        move |source| match Self::io(path)(source) {
            Self::Io { path, source } if source.kind() != ErrorKind::Other => {
                Self::Write { path, source }
            }
            other => other,
        }
    }

    /// Names the file in an error of its JSON.
    pub fn json(path: &Path) -> impl FnOnce(serde_json::Error) -> Self + '_ {
        move |source| match source.io_error_kind() {
            Some(kind) => Self::io(path)(kind.into()),
            None => Self::Json { path: path.to_owned(), source },
        }
    }
}

/// Kind of an error, also of one that a writer of archives has wrapped.
fn kind(source: &std::io::Error) -> ErrorKind {
    let inner = source.get_ref().and_then(|inner| inner.source());
    let inner = inner.and_then(|inner| inner.downcast_ref::<std::io::Error>());
    inner.filter(|_| source.kind() == ErrorKind::Other).map_or(source.kind(), |inner| inner.kind())
}

/// True if an error is that of a file too large to be read, and not of one that grows too large.
fn is_read(source: &std::io::Error) -> bool {
    source.get_ref().is_some_and(|inner| inner.is::<guard::TooLargeToRead>())
}

/// Removes from an error the temporary path that `tempfile` adds: the user has never named it.
fn without_place(source: std::io::Error) -> std::io::Error {
    let text = source.to_string();
    match text.split_once(" at path \"") {
        Some((cause, _)) if source.get_ref().is_some() => {
            std::io::Error::new(source.kind(), cause.to_owned())
        }
        _ => source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_and_a_temporary_file_are_told_by_the_name_that_the_user_gave() {
        let path = Path::new("scores.json");
        let full = FileError::io(path)(ErrorKind::StorageFull.into());
        assert_eq!(full.to_string(), "scores.json: the disk is full; make room and run again");
        let json = serde_json::Error::io(ErrorKind::QuotaExceeded.into());
        assert_eq!(FileError::json(path)(json).to_string(), full.to_string());
        let limited = FileError::io(path)(ErrorKind::FileTooLarge.into()).to_string();
        assert!(limited.starts_with("scores.json: grows larger than the system lets"), "{limited}");
        let nowhere = tempfile::Builder::new().tempfile_in("/no/such/folder").unwrap_err();
        assert!(nowhere.to_string().contains("/no/such/folder"), "{nowhere}");
        let told = FileError::io(path)(nowhere).to_string();
        assert!(told.starts_with("scores.json: ") && !told.contains("/no/such"), "{told}");
        let told = |error: std::io::Error| FileError::write(path)(error).to_string();
        assert_begins!(told(ErrorKind::NotFound.into()), "scores.json: cannot be written: ");
        let own = std::io::Error::other("is a directory; name a file in it");
        assert_eq!(told(own), "scores.json: is a directory; name a file in it");
        assert_eq!(told(ErrorKind::StorageFull.into()), full.to_string());
    }
}
