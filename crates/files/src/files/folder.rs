//! Folders of runs (made, checked and locked before long work begins), and the files that a run was begun with.
//!
//! Files are known by their SHA-256, so that a run does not go on with others.

use std::fs::{File, TryLockError};
use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::guard::{holds_no_input, is_no_input};
use super::paths::{folder_of, target};
use super::whole::sync_disk;
use super::{FileError, guard, is_forced};

/// Pause between two looks at a folder that another program holds.
const BETWEEN_TRIES: Duration = Duration::from_millis(50);

/// Error of a file in the place of a folder.
fn file_as_folder(path: &Path) -> FileError {
    let message = "is a file where a folder is wanted; name another place";
    FileError::write(path)(std::io::Error::other(message))
}

/// Folders that are missing before a run makes them; those that are empty at its end go again.
pub(super) struct MissingFolders(Vec<PathBuf>);

impl MissingFolders {
    /// The folder and those around it; none of a folder that exists.
    pub(super) fn of(path: &Path) -> Self {
        let missing = path.ancestors().take_while(|folder| !folder.exists());
        Self(missing.filter(|f| !f.as_os_str().is_empty()).map(Path::to_owned).collect())
    }
}

/// Locks a folder of which `made` were missing; where another run has its lock, that run made them, and they stay.
pub(super) fn lock_new_folder(
    path: &Path,
    made: &mut MissingFolders,
) -> Result<Option<File>, FileError> {
    let lock = lock_folder(path, Duration::ZERO);
    if matches!(lock, Err(FileError::Refused(_))) {
        made.0.clear();
    }
    lock
}

impl Drop for MissingFolders {
    fn drop(&mut self) {
        let _ = self.0.iter().try_for_each(std::fs::remove_dir);
    }
}

/// Like [`shared_folder`], for the files of one run: while the lock lives, a second program that names the folder is
/// refused, since the files of two would not belong together. A program that holds the folder already may end within
/// `patience`. `None` where folders cannot be opened, as on some network drives: nobody is kept out.
pub(super) fn lock_folder(path: &Path, patience: Duration) -> Result<Option<File>, FileError> {
    let until = Instant::now() + patience;
    loop {
        shared_folder(path)?;
        let Ok(folder) = File::open(path) else { return Ok(None) };
        match folder.try_lock() {
            // One that its last holder has taken away with its lock is made again.
            Ok(()) if !is_at(&folder, path) => {}
            Err(TryLockError::WouldBlock) if Instant::now() >= until => {
                let words = "another run writes into it; wait for its end, or name another folder";
                return Err(FileError::refused(path, words));
            }
            Err(TryLockError::WouldBlock) => std::thread::sleep(BETWEEN_TRIES),
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(Some(folder)),
        }
    }
}

fn is_at(folder: &File, path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        let numbers = |meta: std::fs::Metadata| (meta.dev(), meta.ino());
        folder.metadata().map(numbers).ok() == std::fs::metadata(path).map(numbers).ok()
    }
    #[cfg(not(unix))]
    {
        let _ = folder;
        path.exists()
    }
}

/// Refuses a folder that holds anything. To be asked while [`lock_folder`] keeps others out.
pub(super) fn is_empty(path: &Path) -> Result<(), FileError> {
    let mut entries = std::fs::read_dir(path).map_err(FileError::io(path))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(FileError::refused(
            path,
            "is not empty, and files in it might be overwritten; name a new folder, or give --force",
        )),
    }
}

/// Makes a folder and checks that files can be written into it, before long work begins. Removes temporary files of
/// killed processes.
pub fn shared_folder(path: &Path) -> Result<(), FileError> {
    if path.exists() && !path.is_dir() {
        return Err(file_as_folder(path));
    }
    std::fs::create_dir_all(path).map_err(FileError::write(path))?;
    guard::sweep(path);
    tempfile::tempfile_in(path).map_err(FileError::write(path))?;
    Ok(())
}

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

    /// Path of the file.
    pub fn file(&self) -> &Path {
        &self.file
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
            Some(Self { file, .. }) => {
                let words = format!(
                    "has changed; {} was begun with another one, so put that back or start a new run",
                    folder.display()
                );
                Err(FileError::refused(file, words))
            }
        }
    }
}

/// Checks, before long work, that a folder could be written: its place is new or an empty folder, or `--force` was
/// given; no input of the command lies in it.
///
/// # Errors
/// Such a place; one whose surrounding folder cannot be written into.
pub fn writable_folder(path: &Path) -> Result<(), FileError> {
    let target = target(path)?;
    if target.is_dir() {
        if is_forced() {
            holds_no_input(&target)?;
        } else {
            is_empty(path)?;
        }
    } else if target.exists() {
        is_no_input(path)?;
        return Err(file_as_folder(path));
    }
    let around = folder_of(&target);
    let there = around.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("."));
    guard::sweep(there);
    tempfile::tempfile_in(there).map(drop).map_err(FileError::write(path))
}

/// Writes all files of a folder: beside its place, then moved there in one step once the disk has them. In a folder
/// that exists, with `--force`, each file takes the place of the one of its name; others stay.
///
/// # Errors
/// See [`writable_folder`]. Then the place is as it was before, unless moving one of several files failed.
pub fn write_folder(path: &Path, files: &[(String, Vec<u8>)]) -> Result<(), FileError> {
    writable_folder(path)?;
    let target = target(path)?;
    let around = folder_of(&target);
    std::fs::create_dir_all(around).map_err(FileError::write(path))?;
    let prefix = guard::temporary_prefix();
    let beside = tempfile::Builder::new().prefix(&prefix).suffix(".tmp").tempdir_in(around);
    let beside = beside.map_err(FileError::write(path))?;
    for (name, bytes) in files {
        let place = path.join(name);
        std::fs::write(beside.path().join(name), bytes).map_err(FileError::write(&place))?;
    }
    sync_disk(beside.path());
    as_readable_as_any(beside.path(), path)?;
    if !target.exists() || is_empty(&target).is_ok() {
        // An empty folder gives way to a whole one.
        std::fs::rename(beside.path(), &target).map_err(FileError::write(path))?;
        let _ = beside.keep();
    } else {
        let _lock = lock_folder(&target, Duration::ZERO)?;
        for (name, _) in files {
            let place = path.join(name);
            is_no_input(&place)?;
            std::fs::rename(beside.path().join(name), target.join(name))
                .map_err(FileError::write(&place))?;
        }
    }
    sync_disk(around);
    Ok(())
}

/// Gives a temporary folder, which only its user may read, the permissions of a folder that any program makes.
fn as_readable_as_any(folder: &Path, path: &Path) -> Result<(), FileError> {
    #[cfg(unix)]
    {
        let plain = folder.join("plain");
        let permissions = std::fs::create_dir(&plain)
            .and_then(|()| std::fs::metadata(&plain))
            .map(|meta| meta.permissions())
            .map_err(FileError::write(path))?;
        std::fs::remove_dir(&plain).map_err(FileError::write(path))?;
        std::fs::set_permissions(folder, permissions).map_err(FileError::write(path))?;
    }
    let _ = (folder, path);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(text: &str) -> Vec<(String, Vec<u8>)> {
        ["a.txt", "b.txt"].map(|name| (name.to_owned(), text.as_bytes().to_vec())).to_vec()
    }

    #[test]
    fn a_folder_that_another_run_has_made_stays() {
        let around = tempfile::tempdir().unwrap();
        let out = around.path().join("runs/one");
        // Both look before one has made it.
        let mut made = [MissingFolders::of(&out), MissingFolders::of(&out)];
        let first = lock_new_folder(&out, &mut made[0]).unwrap();
        assert!(lock_new_folder(&out, &mut made[1]).is_err());
        let [of_first, of_second] = made;
        drop(of_second);
        assert!(out.is_dir());
        drop((first, of_first));
        assert!(!around.path().join("runs").exists());
    }

    #[test]
    fn a_folder_is_whole_or_not_there() {
        let around = tempfile::tempdir().unwrap();
        let out = around.path().join("deep/out");
        write_folder(&out, &files("one")).unwrap();
        let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
        assert_eq!((read("a.txt"), read("b.txt")), ("one".to_owned(), "one".to_owned()));
        assert_eq!(std::fs::read_dir(around.path().join("deep")).unwrap().count(), 1);
        // A second one needs --force, and a name that cannot be a file leaves nothing of the others.
        assert_holds!(write_folder(&out, &files("two")).unwrap_err(), "is not empty");
        assert_eq!(read("a.txt"), "one");
        let mut bad = files("three");
        bad.push(("no/folder.txt".to_owned(), Vec::new()));
        let other = around.path().join("other");
        assert!(write_folder(&other, &bad).is_err());
        assert!(!other.exists());
        assert_eq!(std::fs::read_dir(around.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_empty_folder_is_filled_and_a_file_is_not_replaced() {
        let around = tempfile::tempdir().unwrap();
        write_folder(around.path(), &files("one")).unwrap();
        assert_eq!(std::fs::read_to_string(around.path().join("b.txt")).unwrap(), "one");
        let refused = write_folder(&around.path().join("b.txt"), &files("two")).unwrap_err();
        assert!(refused.to_string().contains("a file where a folder is wanted"), "{refused}");
    }

    #[cfg(unix)]
    #[test]
    fn others_may_read_it_as_any_new_folder() {
        use std::os::unix::fs::PermissionsExt;
        let around = tempfile::tempdir().unwrap();
        let [plain, out] = ["plain", "out"].map(|name| around.path().join(name));
        std::fs::create_dir(&plain).unwrap();
        write_folder(&out, &files("one")).unwrap();
        let mode = |path: &Path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&out), mode(&plain));
    }
}
