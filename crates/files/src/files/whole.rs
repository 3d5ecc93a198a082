//! Files that are either whole or not there.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempPath};

use super::FileError;
use super::guard::{self, Temporary};
use super::paths::{folder_of, is_sink, is_stdout, target};

/// Which files a write may replace, and when the bytes must be on the disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Output {
    /// Named by the user: replaces a file only with `--force`.
    Named,
    /// One of many files of a folder, whose disk is synchronized once by [`sync_disk`].
    OneOfMany,
    /// A folder that the command holds: existing files are replaced.
    Own,
}

/// Writes an output beside its place and moves it there once `write` has succeeded and the disk has its bytes. Links are
/// followed, an existing file keeps its permissions, and a pipe or device gets the bytes once they are whole.
///
/// # Errors
/// Errors of `write`; a place that cannot be written; an input of the command; a file that exists, without `--force`.
pub fn write_whole<E: From<FileError>>(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    write_as(Output::Named, path, write)
}

/// Like [`write_whole`], for any output; [`sync_disk`] is to follow the last one of many.
///
/// # Errors
/// See [`write_whole`]; an own file may exist.
pub fn write_as<E: From<FileError>>(
    output: Output,
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    let target = target(path)?;
    match written(path, &target, write)? {
        PendingFile::Sink(whole) => {
            guard::is_no_input(path)?;
            Ok(pour(whole, &target).map_err(FileError::write(path))?)
        }
        PendingFile::Beside(file, temporary) => {
            ready(&file, &target, path)?;
            if output != Output::OneOfMany {
                on_disk(file.as_file()).map_err(FileError::write(path))?;
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

/// Writes two files of one folder; the second names the first. Both are on the disk before either takes its place, and
/// an old second file is never beside a new first one, whenever the process ends.
///
/// # Errors
/// See [`write_whole`]. Then both places are as they were before.
pub fn write_pair<E: From<FileError>>(
    (first, write_first): (&Path, impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>),
    (second, write_second): (&Path, impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>),
) -> Result<(), E> {
    let targets = [target(first)?, target(second)?];
    let begun =
        [written(first, &targets[0], write_first)?, written(second, &targets[1], write_second)?];
    let [PendingFile::Beside(one, _first), PendingFile::Beside(two, _second)] = begun else {
        let message = "is no regular file; name a file";
        return Err(FileError::write(second)(std::io::Error::other(message)).into());
    };
    for (file, target, path) in [(&one, &targets[0], first), (&two, &targets[1], second)] {
        ready(file, target, path)?;
        on_disk(file.as_file()).map_err(FileError::write(path))?;
    }
    let pair = [(one.into_temp_path(), first), (two.into_temp_path(), second)];
    Ok(place_pair(pair, &targets, guard::overwrites(), || Ok(()))?)
}

/// Moves two files to their places; `between` runs when the first one is there.
fn place_pair(
    [(one, first), (two, second)]: [(TempPath, &Path); 2],
    targets: &[PathBuf; 2],
    replaces: bool,
    between: impl FnOnce() -> Result<(), FileError>,
) -> Result<(), FileError> {
    let folder = folder_of(&targets[1]);
    let was_there = targets[0].exists();
    // A run that was killed between its two files left this very first one.
    let kept = !targets[1].exists() && is_copy(&one, &targets[0]);
    if !replaces && was_there && !kept {
        return Err(guard::exists(first));
    }
    if !replaces && targets[1].exists() {
        return Err(guard::exists(second));
    }
    let aside = |path: &Path| -> std::io::Result<Option<(TempPath, Temporary)>> {
        if !path.exists() {
            return Ok(None);
        }
        let (file, temporary) = begin_in(folder_of(path))?;
        let aside = file.into_temp_path();
        std::fs::rename(path, &aside)?;
        Ok(Some((aside, temporary)))
    };
    let old_second = aside(&targets[1]).map_err(FileError::write(second))?;
    let mut old_first = None;
    let moved = || {
        if !kept {
            old_first = aside(&targets[0]).map_err(FileError::write(first))?;
            place(one, &targets[0], replaces, first)?;
        }
        sync_folder(folder);
        between()?;
        place(two, &targets[1], replaces, second)
    };
    let moved = moved();
    if moved.is_err() {
        if !kept && (old_first.is_some() || !was_there) {
            let _ = std::fs::remove_file(&targets[0]);
        }
        for (old, target) in [(old_first, &targets[0]), (old_second, &targets[1])] {
            let _ = old.map(|(old, _temporary)| old.persist(target));
        }
    }
    sync_folder(folder);
    moved
}

fn is_copy(one: &Path, other: &Path) -> bool {
    let length = |path: &Path| std::fs::metadata(path).map(|data| data.len()).ok();
    length(one).is_some()
        && length(one) == length(other)
        && std::fs::read(one).is_ok_and(|one| std::fs::read(other).is_ok_and(|other| one == other))
}

/// The bytes of a file, beside its place or for a pipe.
fn written<E: From<FileError>>(
    path: &Path,
    target: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<PendingFile, E> {
    let io = |error| FileError::write(path)(error);
    let begun = match is_sink(target) {
        true => tempfile::tempfile().map(PendingFile::Sink),
        false => beside(target),
    };
    let mut begun = begun.map_err(io)?;
    let mut writer = BufWriter::new(begun.file());
    write(&mut writer)?;
    writer.flush().map_err(io)?;
    drop(writer);
    Ok(begun)
}

/// Checks that a file may take its place, and gives it the permissions of the one before.
fn ready(file: &NamedTempFile, target: &Path, path: &Path) -> Result<(), FileError> {
    guard::is_no_input(path)?;
    if let Ok(before) = std::fs::metadata(target) {
        file.as_file().set_permissions(before.permissions()).map_err(FileError::write(path))?;
    }
    Ok(())
}

enum PendingFile {
    /// Its bytes go to a pipe or device.
    Sink(File),
    /// It takes its place in the folder that it is in.
    Beside(NamedTempFile, Temporary),
}

impl PendingFile {
    fn file(&mut self) -> &mut File {
        match self {
            Self::Sink(file) => file,
            Self::Beside(file, _) => file.as_file_mut(),
        }
    }
}

/// Begins a file beside its place. A folder that was taken away since the work began is made anew: the work is worth it.
fn beside(target: &Path) -> std::io::Result<PendingFile> {
    let folder = folder_of(target);
    let begun = begin_in(folder).or_else(|error| {
        if error.kind() == ErrorKind::NotFound {
            std::fs::create_dir_all(folder)?;
        }
        begin_in(folder)
    });
    begun.map(|(file, temporary)| PendingFile::Beside(file, temporary))
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
    // Opened a second time, a file that is stdout would be written from its start.
    let mut sink: Box<dyn Write> = if is_stdout(target) {
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
        return file.persist(target).map_err(|error| FileError::write(path)(error.error));
    }
    file.persist_noclobber(target).or_else(|error| match error.error.kind() {
        ErrorKind::AlreadyExists => Err(guard::exists(path)),
        // A file system without hard links.
        _ if !target.exists() => {
            error.path.persist(target).map_err(|error| FileError::write(path)(error.error))
        }
        _ => Err(FileError::write(path)(error.error)),
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

/// Waits until the disk has the names in a folder, where the system can tell.
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

/// Checks, before long work, that an output could be written at `path`: it is no input read so far, and no existing
/// file unless `--force` was given. Removes temporary files of killed processes beside it.
///
/// # Errors
/// Such a file; a folder that is missing or cannot be written into.
pub fn writable_file(path: &Path) -> Result<(), FileError> {
    let target = target(path)?;
    if is_sink(&target) {
        return guard::is_no_input(path);
    }
    if target.is_dir() {
        let message = "is a directory; name a file in it";
        return Err(FileError::write(path)(std::io::Error::other(message)));
    }
    let folder = folder_of(&target);
    if !folder.is_dir() {
        let words =
            format!("there is no folder {}; make it, or name another file", folder.display());
        return Err(FileError::refused(path, words));
    }
    guard::claim(path)?;
    guard::sweep(folder);
    tempfile::tempfile_in(folder).map_err(FileError::write(path))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn begun(folder: &Path, text: &str) -> TempPath {
        let (mut file, _temporary) = begin_in(folder).unwrap();
        file.write_all(text.as_bytes()).unwrap();
        file.into_temp_path()
    }

    #[test]
    fn an_old_scene_never_meets_a_new_mesh() {
        for (before, replaces) in [(false, false), (true, true)] {
            let folder = tempfile::tempdir().unwrap();
            let at = |name: &str| folder.path().join(name);
            let (mesh, scene) = (at("a.ply"), at("a.json"));
            if before {
                std::fs::write(&mesh, "old mesh").unwrap();
                std::fs::write(&scene, "old scene").unwrap();
            }
            let pair = |text: [&str; 2]| {
                [
                    (begun(folder.path(), text[0]), mesh.as_path()),
                    (begun(folder.path(), text[1]), scene.as_path()),
                ]
            };
            let targets = [mesh.clone(), scene.clone()];
            let failed = place_pair(pair(["new mesh", "new scene"]), &targets, replaces, || {
                // A process that is killed here leaves this.
                assert_eq!(std::fs::read_to_string(&mesh).unwrap(), "new mesh");
                assert!(!scene.exists());
                Err(FileError::Refused("stopped".to_owned()))
            });
            assert!(failed.is_err());
            let read = |path: &Path| std::fs::read_to_string(path).ok();
            let old = |text: &str| before.then(|| text.to_owned());
            assert_eq!((read(&mesh), read(&scene)), (old("old mesh"), old("old scene")));
            place_pair(pair(["new mesh", "new scene"]), &targets, replaces, || Ok(())).unwrap();
            assert_eq!(read(&scene).as_deref(), Some("new scene"));
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2);
        }
    }

    #[test]
    fn a_mesh_that_a_killed_run_left_is_taken_up_and_no_other() {
        let folder = tempfile::tempdir().unwrap();
        let targets = ["a.ply", "a.json"].map(|name| folder.path().join(name));
        std::fs::write(&targets[0], "mesh").unwrap();
        let placed = |mesh: &str| {
            let [one, two] = [mesh, "scene"].map(|text| begun(folder.path(), text));
            place_pair([(one, &targets[0]), (two, &targets[1])], &targets, false, || Ok(()))
        };
        assert!(placed("other").unwrap_err().to_string().contains("already exists"));
        assert!(!targets[1].exists());
        placed("mesh").unwrap();
        assert_eq!(std::fs::read_to_string(&targets[1]).unwrap(), "scene");
    }
}
