//! A folder of files that is either whole or not there.

use std::path::Path;
use std::time::Duration;

use super::folder::{is_empty, lock_folder};
use super::guard::{self, holds_no_input, is_no_input};
use super::paths::{folder_of, target};
use super::whole::sync_disk;
use super::{FileError, is_forced};

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
        let message = "is a file where a folder is wanted; name another place";
        return Err(FileError::io(path)(std::io::Error::other(message)));
    }
    let around = folder_of(&target);
    let there = around.ancestors().find(|folder| folder.is_dir()).unwrap_or(Path::new("."));
    guard::sweep(there);
    tempfile::tempfile_in(there).map(drop).map_err(FileError::io(path))
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
    std::fs::create_dir_all(around).map_err(FileError::io(path))?;
    let prefix = guard::temporary_prefix();
    let beside = tempfile::Builder::new().prefix(&prefix).suffix(".tmp").tempdir_in(around);
    let beside = beside.map_err(FileError::io(path))?;
    for (name, bytes) in files {
        let place = path.join(name);
        std::fs::write(beside.path().join(name), bytes).map_err(FileError::io(&place))?;
    }
    sync_disk(beside.path());
    as_readable_as_any(beside.path(), path)?;
    if !target.exists() || is_empty(&target).is_ok() {
        // An empty folder gives way to a whole one.
        std::fs::rename(beside.path(), &target).map_err(FileError::io(path))?;
        let _ = beside.keep();
    } else {
        let _lock = lock_folder(&target, Duration::ZERO)?;
        for (name, _) in files {
            let place = path.join(name);
            is_no_input(&place)?;
            std::fs::rename(beside.path().join(name), target.join(name))
                .map_err(FileError::io(&place))?;
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
            .map_err(FileError::io(path))?;
        std::fs::remove_dir(&plain).map_err(FileError::io(path))?;
        std::fs::set_permissions(folder, permissions).map_err(FileError::io(path))?;
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
    fn a_folder_is_whole_or_not_there() {
        let around = tempfile::tempdir().unwrap();
        let out = around.path().join("deep/out");
        write_folder(&out, &files("one")).unwrap();
        let read = |name: &str| std::fs::read_to_string(out.join(name)).unwrap();
        assert_eq!((read("a.txt"), read("b.txt")), ("one".to_owned(), "one".to_owned()));
        assert_eq!(std::fs::read_dir(around.path().join("deep")).unwrap().count(), 1);
        // A second one needs --force, and a name that cannot be a file leaves nothing of the others.
        let refused = write_folder(&out, &files("two")).unwrap_err().to_string();
        assert!(refused.contains("is not empty"), "{refused}");
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
