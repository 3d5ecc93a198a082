//! References of one file to another: they stay inside its folder unless the user trusts them.

use std::path::{Component, Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::FileError;

/// Tells whether references may leave their folder.
static TRUSTED: AtomicBool = AtomicBool::new(false);

/// Lets the files of this process refer to files outside their folders (`--trust-paths`), or forbids it.
pub fn trust_paths(trusted: bool) {
    TRUSTED.store(trusted, Ordering::Relaxed);
}

/// Path of the file that a file in `folder` refers to, `../../secret.bin` for example.
///
/// # Errors
/// The path leaves the folder, by its words or through links, and [`trust_paths`] does not allow it.
pub fn stays_inside(folder: &Path, reference: &str) -> Result<PathBuf, FileError> {
    let path = folder.join(reference);
    if TRUSTED.load(Ordering::Relaxed) || is_inside(folder, reference, &path) {
        return Ok(path);
    }
    Err(FileError::Refused(format!(
        "{reference:?} leaves the folder {}; copy the file into it, or give --trust-paths if you trust the file that \
         refers to it",
        if folder.as_os_str().is_empty() { Path::new(".") } else { folder }.display()
    )))
}

/// Follows links as far as the path exists; a path that does not exist is judged by its words.
fn is_inside(folder: &Path, reference: &str, path: &Path) -> bool {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    match (folder.canonicalize(), path.canonicalize()) {
        (Ok(folder), Ok(path)) => path.starts_with(folder),
        _ => goes_down(Path::new(reference)),
    }
}

/// True if no part of a path is above its start.
fn goes_down(reference: &Path) -> bool {
    let mut depth = 0_i64;
    reference.components().all(|part| {
        depth += match part {
            Component::Normal(_) => 1,
            Component::CurDir => 0,
            Component::ParentDir => -1,
            Component::RootDir | Component::Prefix(_) => return false,
        };
        depth >= 0
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn references_stay_inside_by_their_words_and_through_links() {
        let outer = tempfile::tempdir().unwrap();
        let folder = outer.path().join("mesh");
        std::fs::create_dir_all(folder.join("sub")).unwrap();
        for file in ["out.bin", "mesh/in.bin", "mesh/sub/in.bin"] {
            std::fs::write(outer.path().join(file), b"x").unwrap();
        }
        let within = folder.join("in.bin");
        let within = within.to_str().unwrap();
        for right in [
            "in.bin",
            "./in.bin",
            "sub/in.bin",
            "sub/../in.bin",
            "../mesh/in.bin",
            "no.bin",
            within,
        ] {
            assert_eq!(stays_inside(&folder, right).unwrap(), folder.join(right));
        }
        let without = outer.path().join("out.bin");
        let without = without.to_str().unwrap();
        for wrong in ["../out.bin", "sub/../../out.bin", "../no.bin", "/etc/no.bin", without] {
            let message = stays_inside(&folder, wrong).unwrap_err().to_string();
            assert!(message.contains(wrong) && message.contains("--trust-paths"), "{message}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(outer.path(), folder.join("link")).unwrap();
            std::os::unix::fs::symlink("../out.bin", folder.join("linked.bin")).unwrap();
            std::os::unix::fs::symlink("sub", folder.join("down")).unwrap();
            assert!(stays_inside(&folder, "down/in.bin").is_ok());
            assert!(stays_inside(&folder, "link/out.bin").is_err());
            assert!(stays_inside(&folder, "linked.bin").is_err());
        }
    }
}
