//! Files that are either whole or not there.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::Path;

use tempfile::{NamedTempFile, TempPath};

use super::FileError;
use super::guard::{self, Temporary};
use super::place::{folder_of, is_open_file, is_sink, target};

/// Which files a write may replace, and when the bytes must be on the disk.
#[derive(Clone, Copy, PartialEq)]
enum Output {
    /// Named by the user: replaces a file only with `--force`.
    Named,
    /// One of many files of a folder, whose disk is synchronized once by [`sync_disk`].
    OneOfMany,
    /// In a folder that the command holds: replaces what was there before.
    Own,
}

/// Writes an output beside its place and moves it there once `write` has succeeded and the disk has its bytes. Links are
/// followed, an existing file keeps its permissions, and a pipe or device gets the bytes once they are whole.
///
/// # Errors
/// Those of `write`; a place that cannot be written; an input of the command; a file that exists, without `--force`.
pub fn write_whole<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    write_as(Output::Named, path, write)
}

/// As [`write_whole`], for one of many files: [`sync_disk`] is to follow the last one.
///
/// # Errors
/// As of [`write_whole`].
pub fn write_many<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    write_as(Output::OneOfMany, path, write)
}

/// As [`write_whole`], for a file of a folder that the command holds: replaces the one from before.
///
/// # Errors
/// As of [`write_whole`], existing files left aside.
pub fn write_own<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    write_as(Output::Own, path, write)
}

fn write_as<E: From<FileError>>(
    output: Output,
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    let io = |error| FileError::io(path)(error);
    let target = target(path)?;
    let sink = is_sink(&target);
    let begun = if sink { tempfile::tempfile().map(Begun::Sink) } else { beside(&target) };
    let mut begun = begun.map_err(io)?;
    let mut writer = BufWriter::new(begun.file());
    write(&mut writer)?;
    writer.flush().map_err(io)?;
    drop(writer);
    match begun {
        Begun::Sink(whole) => Ok(pour(whole, &target).map_err(io)?),
        Begun::Beside(file, temporary) => {
            guard::is_no_input(path)?;
            if let Ok(before) = std::fs::metadata(&target) {
                file.as_file().set_permissions(before.permissions()).map_err(io)?;
            }
            if output != Output::OneOfMany {
                on_disk(file.as_file()).map_err(io)?;
            }
            let replaces = output == Output::Own || guard::overwrites();
            place(file.into_temp_path(), &target, replaces, path)?;
            drop(temporary);
            if output != Output::OneOfMany {
                sync_folder(folder_of(&target));
            }
            Ok(())
        }
    }
}

/// A file that is being written.
enum Begun {
    /// Its bytes go to a pipe or device.
    Sink(File),
    /// It takes its place in the folder that it is in.
    Beside(NamedTempFile, Temporary),
}

impl Begun {
    fn file(&mut self) -> &mut File {
        match self {
            Self::Sink(file) => file,
            Self::Beside(file, _) => file.as_file_mut(),
        }
    }
}

/// Begins a file beside its place. A folder that was taken away since the work began is made anew: the work is worth it.
fn beside(target: &Path) -> std::io::Result<Begun> {
    let folder = folder_of(target);
    let begun = begin_in(folder).or_else(|error| {
        if error.kind() == ErrorKind::NotFound {
            std::fs::create_dir_all(folder)?;
        }
        begin_in(folder)
    });
    begun.map(|(file, temporary)| Begun::Beside(file, temporary))
}

/// Begins a file in a folder, named after this process and as readable as any new file of the user.
///
/// # Errors
/// A folder that cannot be written into.
pub fn begin_in(folder: &Path) -> std::io::Result<(NamedTempFile, Temporary)> {
    let prefix = guard::temporary_prefix();
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".tmp");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    let file = builder.tempfile_in(folder)?;
    // For those who sweep and do not see this process.
    let _ = file.as_file().try_lock();
    let temporary = Temporary::new(file.path());
    Ok((file, temporary))
}

/// Hands whole bytes to a pipe or device.
fn pour(mut whole: File, target: &Path) -> std::io::Result<()> {
    use std::io::Seek;
    whole.rewind()?;
    let is_stdout = is_open_file(target) && target.file_name().is_some_and(|name| name == "1");
    // Opened a second time, a file that is stdout would be written from its start.
    let mut sink: Box<dyn Write> = if is_stdout {
        Box::new(std::io::stdout())
    } else {
        Box::new(File::options().append(true).open(target)?)
    };
    match std::io::copy(&mut whole, &mut sink).and_then(|_| sink.flush()) {
        // A closed pipe is the wish to read no more, as of `head`.
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        copied => copied,
    }
}

/// Moves a file to its place in one step. `path` is how the user calls the place.
fn place(file: TempPath, target: &Path, replaces: bool, path: &Path) -> Result<(), FileError> {
    if replaces {
        return file.persist(target).map_err(|error| FileError::io(path)(error.error));
    }
    file.persist_noclobber(target).or_else(|error| match error.error.kind() {
        ErrorKind::AlreadyExists => Err(guard::exists(path)),
        // A file system without hard links.
        _ if !target.exists() => {
            error.path.persist(target).map_err(|error| FileError::io(path)(error.error))
        }
        _ => Err(FileError::io(path)(error.error)),
    })
}

/// Waits until the disk has the bytes of a file, where the file system can say so.
fn on_disk(file: &File) -> std::io::Result<()> {
    match file.sync_all() {
        Err(error) if matches!(error.kind(), ErrorKind::InvalidInput | ErrorKind::Unsupported) => {
            Ok(())
        }
        synced => synced,
    }
}

/// Waits until the disk knows the names in a folder, where that can be asked for.
fn sync_folder(folder: &Path) {
    if cfg!(unix) {
        let _ = File::open(folder).and_then(|folder| folder.sync_all());
    }
}

/// Waits until the disk of a folder has everything: once after many files, which one by one take longer.
pub fn sync_disk(folder: &Path) {
    #[cfg(any(target_os = "linux", target_os = "android"))]
    if let Ok(folder) = File::open(folder) {
        let _ = rustix::fs::syncfs(folder);
    }
    sync_folder(folder);
}

/// Checks that an output could be written at `path` before long work begins: it is no input that was read by now, and no
/// file that exists, unless `--force` was given. Removes what killed processes had begun beside it.
///
/// # Errors
/// Such a file; a folder that is missing or cannot be written into.
pub fn writable_file(path: &Path) -> Result<(), FileError> {
    let target = target(path)?;
    if is_sink(&target) {
        return Ok(());
    }
    if target.is_dir() {
        let message = "is a directory; name a file in it";
        return Err(FileError::io(path)(std::io::Error::other(message)));
    }
    let folder = folder_of(&target);
    if !folder.is_dir() {
        return Err(FileError::Refused(format!(
            "{}: there is no folder {}; make it, or name another file",
            path.display(),
            folder.display()
        )));
    }
    guard::claim(path)?;
    guard::sweep(folder);
    tempfile::tempfile_in(folder).map_err(FileError::io(path))?;
    Ok(())
}
