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

/// True if a path is the link to an open pipe or device, or to this program's stdout or stderr, whatever they are. An
/// open plain file is a file like any other: it may be an input.
fn is_open_file(path: &Path) -> bool {
    let Some(owner) = descriptor_of(path) else { return false };
    let is_plain = std::fs::metadata(path).is_ok_and(|meta| meta.is_file());
    !is_plain || (owner == Owner::This && named(path, &["1", "2"]))
}

/// True if a path is the link to this program's stdout.
pub(super) fn is_stdout(path: &Path) -> bool {
    descriptor_of(path) == Some(Owner::This) && named(path, &["1"])
}

fn named(path: &Path, names: &[&str]) -> bool {
    path.file_name().is_some_and(|name| names.iter().any(|known| name == *known))
}

/// Process that has a file open.
#[derive(Debug, PartialEq, Eq)]
enum Owner {
    This,
    Other,
}

/// Process whose open file a path is: `N` in `/dev/fd`, `/proc/PID/fd` or `/proc/PID/task/TID/fd`, however that folder is
/// spelled. Everything else in `/proc` leads to a file or folder, as `/proc/self/cwd/scene.json` does.
fn descriptor_of(path: &Path) -> Option<Owner> {
    let folder = folder_of(path).canonicalize().ok()?;
    if folder == Path::new("/dev/fd") {
        return Some(Owner::This);
    }
    let parts: Vec<&str> = folder.to_str()?.split('/').collect();
    match parts[..] {
        ["", "proc", process, "fd"] | ["", "proc", process, "task", _, "fd"] => {
            let is_own = process.parse() == Ok(std::process::id());
            Some(if is_own { Owner::This } else { Owner::Other })
        }
        _ => None,
    }
}

pub(super) fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// True if a path names a pipe or a device, which must not be replaced by a file.
pub fn is_sink(path: &Path) -> bool {
    is_open_file(path)
        || std::fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir())
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::os::fd::AsRawFd;

    use super::*;

    #[test]
    fn of_what_proc_holds_only_open_pipes_and_the_own_output_are_no_files() {
        let folder = tempfile::tempdir().expect("a folder");
        let plain = folder.path().join("plain");
        std::fs::write(&plain, "x").expect("a file");
        let open = std::fs::File::open(&plain).expect("the file");
        let null = std::fs::File::open("/dev/null").expect("a device");
        let at = |folder: &str, file: &std::fs::File| format!("{folder}/{}", file.as_raw_fd());
        for fd in [
            "/proc/self/fd",
            "/dev/fd",
            "/proc/thread-self/fd",
            "/proc/self/cwd/../../../../../proc/self/fd",
        ] {
            let (file, device) = (at(fd, &open), at(fd, &null));
            assert_eq!(target(Path::new(&file)).expect("a place"), plain, "{file}");
            assert!(!is_sink(Path::new(&file)) && is_sink(Path::new(&device)), "{fd}");
            assert!(is_stdout(Path::new(&format!("{fd}/1"))), "{fd}");
        }
        let file = format!("/proc/self/root{}", plain.display());
        assert!(!is_sink(Path::new(&file)) && !is_stdout(Path::new("/proc/1/fd/1")));
        assert!(!is_sink(Path::new("/proc/self/cwd/new.json")));
    }
}
