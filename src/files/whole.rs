//! Files that are either whole or not there.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
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

fn is_open_file(path: &Path) -> bool {
    path.starts_with("/proc") || path.starts_with("/dev/fd")
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether a path names a pipe or a device, which must not be replaced by a file.
pub fn is_sink(path: &Path) -> bool {
    is_open_file(path)
        || std::fs::metadata(path).is_ok_and(|meta| !meta.is_file() && !meta.is_dir())
}

/// Writes a file beside its place and moves it there once `write` has succeeded. Links are followed, an
/// existing file keeps its permissions, and a pipe or device gets the bytes once they are whole.
///
/// # Errors
/// Those of `write`, and a place that cannot be written.
pub fn write_whole<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    let io = |error| FileError::io(path)(error);
    let target = target(path)?;
    let sink = is_sink(&target);
    let mut builder = tempfile::Builder::new();
    // As readable as any new file of the user, or as the one that is there.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let beside = || {
        let folder = folder_of(&target);
        builder.tempfile_in(folder).or_else(|error| {
            // A folder that was taken away since the work began is made anew: the work is worth it.
            if error.kind() == ErrorKind::NotFound {
                std::fs::create_dir_all(folder)?;
            }
            builder.tempfile_in(folder)
        })
    };
    let mut file = if sink { builder.tempfile() } else { beside() }.map_err(io)?;
    let mut writer = BufWriter::new(file.as_file_mut());
    write(&mut writer)?;
    writer.flush().map_err(io)?;
    drop(writer);
    if sink {
        let mut whole = file.reopen().map_err(io)?;
        let is_stdout = is_open_file(&target) && target.file_name().is_some_and(|name| name == "1");
        // Opened a second time, a file that is stdout would be written from its start.
        let mut sink: Box<dyn Write> = if is_stdout {
            Box::new(std::io::stdout())
        } else {
            Box::new(File::options().append(true).open(&target).map_err(io)?)
        };
        let copied = std::io::copy(&mut whole, &mut sink).and_then(|_| sink.flush());
        return match copied {
            // A closed pipe is the wish to read no more, as of `head`.
            Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
            copied => Ok(copied.map_err(io)?),
        };
    }
    if let Ok(before) = std::fs::metadata(&target) {
        file.as_file().set_permissions(before.permissions()).map_err(io)?;
    }
    file.persist(&target).map_err(|error| io(error.error))?;
    Ok(())
}

/// Checks that a file could be written at `path` and that it is none of `inputs`, before long work
/// begins.
pub fn writable_file<'a>(
    path: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), FileError> {
    let target = target(path)?;
    if is_sink(&target) {
        return Ok(());
    }
    if target.is_dir() {
        let message = "is a directory; name a file in it";
        return Err(FileError::io(path)(std::io::Error::other(message)));
    }
    let place = target.canonicalize().ok();
    if place.is_some() && inputs.into_iter().any(|input| input.canonicalize().ok() == place) {
        return Err(FileError::Refused(format!(
            "{}: is read by this command and would be overwritten; name another file",
            path.display()
        )));
    }
    let folder = folder_of(&target);
    if !folder.is_dir() {
        return Err(FileError::Refused(format!(
            "{}: there is no folder {}; make it, or name another file",
            path.display(),
            folder.display()
        )));
    }
    tempfile::tempfile_in(folder).map_err(FileError::io(path))?;
    Ok(())
}
