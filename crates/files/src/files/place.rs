//! Where paths lead: links followed, pipes and devices told apart.

use std::path::{Path, PathBuf};

use super::FileError;

/// Links that are followed before a path is taken for a loop.
const MOST_LINKS: usize = 40;

/// Where a path leads when links are followed. The links to open files in `/proc` name no place.
pub fn target(path: &Path) -> Result<PathBuf, FileError> {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        match std::fs::read_link(&at) {
            Ok(link) if !is_open_file(&at) => at = folder_of(&at).join(link),
            _ => return Ok(at),
        }
    }
    let message = "a loop of symbolic links; name a file";
    Err(FileError::io(path)(std::io::Error::other(message)))
}

pub(super) fn is_open_file(path: &Path) -> bool {
    path.starts_with("/proc") || path.starts_with("/dev/fd")
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// True if a path names a pipe or a device, which must not be replaced by a file.
pub fn is_sink(path: &Path) -> bool {
    is_open_file(path)
        || std::fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir())
}
