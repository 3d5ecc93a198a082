//! Files that a run was begun with and their SHA-256, so that it does not go on with others.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::FileError;

/// Bytes that are read at once.
const AT_ONCE: usize = 1 << 16;

/// A file and the SHA-256 of its bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    file: PathBuf,
    sha256: String,
}

impl Input {
    /// A file as it is now.
    pub fn read(file: &Path) -> Result<Self, FileError> {
        let mut hash = Sha256::new();
        let mut opened = super::open(file).map_err(FileError::io(file))?;
        let mut bytes = vec![0; AT_ONCE];
        loop {
            match opened.read(&mut bytes) {
                Ok(0) => break,
                Ok(read) => hash.update(&bytes[..read]),
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(FileError::io(file)(error)),
            }
        }
        let sha256 = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
        Ok(Self { file: file.to_owned(), sha256 })
    }

    /// Paths and SHA-256 digests of several files, such as a scene's.
    pub fn of(files: &[PathBuf]) -> Result<Vec<Self>, FileError> {
        files.iter().map(|file| Self::read(file)).collect()
    }

    /// Like [`Self::of`], by the names of the files alone: the same from any working directory.
    pub fn names_of(files: &[PathBuf]) -> Result<Vec<Self>, FileError> {
        let name = |input: Self| Self {
            file: input.file.file_name().map(PathBuf::from).unwrap_or(input.file),
            ..input
        };
        Ok(Self::of(files)?.into_iter().map(name).collect())
    }

    /// First file that differs between `before` and `now`, in words.
    pub fn change(before: &[Self], now: &[Self]) -> Option<String> {
        let name = |input: &Self| input.file.display().to_string();
        let pairs = before.iter().zip(now);
        if let Some((was, is)) = pairs.into_iter().find(|(was, is)| was != is) {
            return Some(match was.file == is.file {
                true => format!("`{}` has changed", name(is)),
                false => format!("`{}` has taken the place of `{}`", name(is), name(was)),
            });
        }
        let (shorter, longer) = (before.len().min(now.len()), before.len().max(now.len()));
        let more = if before.len() < longer { now } else { before };
        more.get(shorter).map(|input| match now.len() == longer {
            true => format!("`{}` has come in", name(input)),
            false => format!("`{}` is gone", name(input)),
        })
    }

    /// Refuses to go on in a folder that was begun with other files.
    pub fn check(folder: &Path, before: &[Self], now: &[Self]) -> Result<(), FileError> {
        let is_new = |input: &&Self| !before.contains(input);
        match now.iter().find(is_new).or(before.iter().find(|input| !now.contains(input))) {
            None => Ok(()),
            Some(Self { file, .. }) => Err(FileError::Refused(format!(
                "{}: has changed; {} was begun with another one, so put that back or start a new run",
                file.display(),
                folder.display()
            ))),
        }
    }
}
