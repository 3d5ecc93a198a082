//! Folders of runs: made, checked and locked before long work begins.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::{FileError, guard};

/// Pause between two looks at a folder that another program holds.
const BETWEEN_TRIES: Duration = Duration::from_millis(50);

/// Folders that are missing before a run makes them; those that are empty at its end go again.
pub struct Missing(Vec<PathBuf>);

impl Missing {
    /// Empty list, for a folder that exists: nothing is removed at the end.
    pub fn none() -> Self {
        Self(Vec::new())
    }

    /// The folder and those around it.
    pub fn of(path: &Path) -> Self {
        let missing = path.ancestors().take_while(|folder| !folder.exists());
        Self(missing.filter(|f| !f.as_os_str().is_empty()).map(Path::to_owned).collect())
    }
}

impl Drop for Missing {
    fn drop(&mut self) {
        let _ = self.0.iter().try_for_each(std::fs::remove_dir);
    }
}

/// Like [`shared_folder`], for the files of one run: while the lock lives, a second program that names the folder is
/// refused, since the files of two would not belong together. A program that holds the folder already may end within
/// `patience`. `None` where folders cannot be opened, as on some network drives: nobody is kept out.
pub fn lock_folder(path: &Path, patience: Duration) -> Result<Option<File>, FileError> {
    let until = Instant::now() + patience;
    loop {
        shared_folder(path)?;
        let Ok(folder) = File::open(path) else { return Ok(None) };
        match folder.try_lock() {
            // One that its last holder has taken away with its lock is made again.
            Ok(()) if !is_at(&folder, path) => {}
            Err(TryLockError::WouldBlock) if Instant::now() >= until => {
                return Err(FileError::Refused(format!(
                    "{}: another run writes into it; wait for its end, or name another folder",
                    path.display()
                )));
            }
            Err(TryLockError::WouldBlock) => std::thread::sleep(BETWEEN_TRIES),
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(Some(folder)),
        }
    }
}

/// True if an open folder is the one at a path.
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
pub fn is_empty(path: &Path) -> Result<(), FileError> {
    let mut entries = std::fs::read_dir(path).map_err(FileError::io(path))?;
    match entries.next() {
        None => Ok(()),
        Some(_) => Err(FileError::Refused(format!(
            "{}: is not empty, and files in it might be overwritten; name a new folder, or give --force",
            path.display()
        ))),
    }
}

/// Makes a folder and checks that files can be written into it, before long work begins. Removes temporary files of
/// killed processes.
pub fn shared_folder(path: &Path) -> Result<(), FileError> {
    if path.exists() && !path.is_dir() {
        let message = "is a file where a folder is wanted; name another place";
        return Err(FileError::io(path)(std::io::Error::other(message)));
    }
    std::fs::create_dir_all(path).map_err(FileError::io(path))?;
    guard::sweep(path);
    tempfile::tempfile_in(path).map_err(FileError::io(path))?;
    Ok(())
}
