//! The guard of files: every file that a command reads, and every output that must not replace one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, Metadata};
use std::io::{Error, ErrorKind, Read, Result, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::FileError;
use super::paths::{folder_of, is_sink, target};
use crate::json::nearest;

/// Prefix of the files that are being written; the number of their process follows.
const TEMPORARY: &str = ".sightline-";

static GUARD: Mutex<FileGuard> = Mutex::new(FileGuard::new());

/// Everything that is known of the files of this process.
struct FileGuard {
    /// Commands that run now, each inside the other.
    sessions: usize,
    /// True if the program runs, and with `--force`.
    program: Option<bool>,
    /// Files that were read, each with its number, so that hard links count.
    read: BTreeMap<PathBuf, Option<(u64, u64)>>,
    outputs: BTreeSet<PathBuf>,
    temporaries: BTreeSet<PathBuf>,
}

impl FileGuard {
    const fn new() -> Self {
        Self {
            sessions: 0,
            program: None,
            read: BTreeMap::new(),
            outputs: BTreeSet::new(),
            temporaries: BTreeSet::new(),
        }
    }
}

fn guard() -> MutexGuard<'static, FileGuard> {
    GUARD.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A command under way. While one lives, each file that is read is remembered, and no output may replace it.
pub struct Session(());

impl Session {
    /// A command of the program: its outputs replace files that exist only with `--force`.
    pub fn of_program(force: bool) -> Self {
        let session = Self::begin();
        guard().program = Some(force);
        session
    }

    /// A nested command, or a library call; it may replace files.
    pub fn begin() -> Self {
        guard().sessions += 1;
        Self(())
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let mut guard = guard();
        guard.sessions -= 1;
        if guard.sessions == 0 {
            let temporaries = std::mem::take(&mut guard.temporaries);
            *guard = FileGuard { temporaries, ..FileGuard::new() };
        }
    }
}

/// Start of the text that Git has in place of a large file which was not fetched, and its most bytes.
const POINTER: &[u8] = b"version https://git-lfs.github.com/spec/";
const LARGEST_POINTER: u64 = 1024;

/// Opens an input: a plain file, which no output of the command may replace from now on.
///
/// # Errors
/// A file that cannot be opened; a folder, pipe, device or socket; a pointer of Git LFS.
pub fn open(path: &Path) -> Result<File> {
    let mut file = open_own(path)?;
    if file.metadata()?.len() < LARGEST_POINTER {
        let mut head = Vec::new();
        (&mut file).take(POINTER.len() as u64).read_to_end(&mut head)?;
        if head == POINTER {
            let told = "is a pointer of Git LFS and not the file itself; `git lfs pull` fetches it";
            return Err(Error::other(told));
        }
        file.rewind()?;
    }
    will_read(path);
    Ok(file)
}

/// Opens a plain file of the command's own folder, such as a checkpoint, which is replaced later.
fn open_own(path: &Path) -> Result<File> {
    plain(&std::fs::metadata(path).map_err(|error| with_hint(path, error))?)?;
    let mut options = File::options();
    options.read(true);
    // A pipe that takes the place of the file meanwhile is not waited for.
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.custom_flags(rustix::fs::OFlags::NONBLOCK.bits() as i32);
    }
    let file = options.open(path)?;
    plain(&file.metadata()?)?;
    Ok(file)
}

/// Most names of a folder that are compared with a missing file's.
const MOST_NAMES: usize = 10_000;

/// Adds to the error of a missing file the nearest name in its folder, or the folder that is missing.
fn with_hint(path: &Path, error: Error) -> Error {
    let (ErrorKind::NotFound, Some(name)) = (error.kind(), path.file_name()) else { return error };
    let folder = folder_of(path);
    let told = match std::fs::read_dir(folder) {
        Ok(entries) => {
            let names = entries.take(MOST_NAMES).filter_map(|entry| {
                entry.ok().and_then(|entry| entry.file_name().into_string().ok())
            });
            let names: Vec<String> = names.collect();
            match nearest(&name.to_string_lossy(), names.iter().map(String::as_str)) {
                Some(near) => format!("its folder has `{near}`"),
                None => return error,
            }
        }
        Err(_) if !folder.exists() => format!("there is no folder `{}`", folder.display()),
        Err(_) => return error,
    };
    Error::new(ErrorKind::NotFound, format!("No such file ({told})"))
}

fn plain(meta: &Metadata) -> Result<()> {
    match (meta.is_file(), meta.is_dir()) {
        (true, _) => Ok(()),
        (_, true) => Err(Error::new(ErrorKind::IsADirectory, "is a directory; name a file in it")),
        _ => Err(Error::other("is not a plain file")),
    }
}

/// A file that is not read for its size; the system has no such limit.
#[derive(Debug, thiserror::Error)]
#[error("is larger than {most} {unit}, the most that is read of such a file")]
pub(super) struct TooLargeToRead {
    most: u64,
    unit: &'static str,
}

/// Reads an input of at most `most` bytes.
///
/// # Errors
/// See [`open`]; a file that is larger, which is not read.
pub fn read(path: &Path, most: u64) -> Result<Vec<u8>> {
    read_all(open(path)?, most)
}

/// Like [`read`], for a file of the command's own folder.
pub fn read_own(path: &Path, most: u64) -> Result<Vec<u8>> {
    read_all(open_own(path)?, most)
}

fn read_all(file: File, most: u64) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let length = file.metadata()?.len();
    if length <= most {
        bytes.try_reserve(usize::try_from(length).unwrap_or(usize::MAX))?;
        file.take(most + 1).read_to_end(&mut bytes)?;
    }
    if length > most || bytes.len() as u64 > most {
        let (most, unit) = if most >> 20 > 0 { (most >> 20, "MiB") } else { (most, "bytes") };
        return Err(Error::new(ErrorKind::FileTooLarge, TooLargeToRead { most, unit }));
    }
    Ok(bytes)
}

/// Records a file as an input that another function opens.
pub fn will_read(path: &Path) {
    let mut guard = guard();
    if guard.sessions == 0 {
        return;
    }
    if let Ok(place) = path.canonicalize() {
        guard.read.insert(place, number(path));
    }
}

/// Number of the file behind a path, links followed.
#[cfg(unix)]
fn number(path: &Path) -> Option<(u64, u64)> {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata(path).ok().filter(Metadata::is_file).map(|meta| (meta.dev(), meta.ino()))
}

#[cfg(not(unix))]
fn number(_: &Path) -> Option<(u64, u64)> {
    None
}

/// Checks that a file is none that the command has read.
///
/// # Errors
/// An input of the command, also through links and other spellings.
pub fn is_no_input(path: &Path) -> std::result::Result<(), FileError> {
    let guard = guard();
    if guard.read.is_empty() {
        return Ok(());
    }
    let same = number(path);
    // A file that is gone leaves its number to a later one.
    let is_there =
        |(place, read): (&PathBuf, &Option<(u64, u64)>)| *read == same && number(place) == same;
    let by_number = same.is_some() && guard.read.iter().any(is_there);
    // Places are for systems without numbers.
    let by_place =
        cfg!(not(unix)) && path.canonicalize().is_ok_and(|p| guard.read.contains_key(&p));
    if by_number || by_place {
        let words = "is read by this command and would be overwritten; name another file";
        return Err(FileError::refused(path, words));
    }
    Ok(())
}

/// Checks that no input of the command lies in a folder that is to be written into.
pub(super) fn holds_no_input(folder: &Path) -> std::result::Result<(), FileError> {
    let Ok(place) = folder.canonicalize() else { return Ok(()) };
    let inside = guard().read.keys().find(|file| file.parent() == Some(&place)).cloned();
    inside.map_or(Ok(()), |file| {
        let name = file.file_name().unwrap_or_default().display();
        let words = format!("holds {name}, which this command reads; name another folder");
        Err(FileError::refused(folder, words))
    })
}

/// True if outputs of the command may replace files that exist.
pub(super) fn overwrites() -> bool {
    guard().program.unwrap_or(true)
}

/// True if the program was told `--force`.
pub fn is_forced() -> bool {
    guard().program.unwrap_or(false)
}

/// Checks that a file that the user names for an output is no input, exists only with `--force`, and is named once.
pub(super) fn claim(path: &Path) -> std::result::Result<(), FileError> {
    let target = target(path)?;
    is_no_input(path)?;
    if is_sink(&target) {
        return Ok(());
    }
    if !overwrites() && path.exists() {
        return Err(exists(path));
    }
    let folder = folder_of(&target).canonicalize().unwrap_or_default();
    let place = folder.join(target.file_name().unwrap_or_default());
    let mut guard = guard();
    if guard.sessions > 0 && !guard.outputs.insert(place) {
        let words = "is named for two outputs of this command; name another file for one of them";
        return Err(FileError::refused(path, words));
    }
    Ok(())
}

/// The refusal of a file that exists.
pub(super) fn exists(path: &Path) -> FileError {
    FileError::refused(path, "already exists; give --force to overwrite it, or name another file")
}

/// Start of the names of files that this process is writing.
pub(super) fn temporary_prefix() -> String {
    format!("{TEMPORARY}{}-", std::process::id())
}

/// Remembers a file that is being written, for [`remove_temporaries`]; forgets it when dropped.
pub struct Temporary(PathBuf);

impl Temporary {
    pub(super) fn new(path: &Path) -> Self {
        guard().temporaries.insert(path.to_owned());
        Self(path.to_owned())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        guard().temporaries.remove(&self.0);
    }
}

/// Removes all files that are being written: for a process that ends at once.
pub fn remove_temporaries() {
    for path in std::mem::take(&mut guard().temporaries) {
        let _ = std::fs::remove_file(path);
    }
}

/// Removes temporary files that ended processes left in a folder.
pub fn sweep(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name();
        let process =
            name.to_str().and_then(|name| name.strip_prefix(TEMPORARY)?.split('-').next());
        let is_dead = process.and_then(|id| id.parse().ok()).is_some_and(|id| !is_alive(id));
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        // A process of another container holds the lock of its file.
        let free = |path: &Path| File::open(path).is_ok_and(|file| file.try_lock().is_ok());
        if is_dead && is_file && free(&entry.path()) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// True if a process of this number runs; true where that is not known.
fn is_alive(id: u32) -> bool {
    #[cfg(unix)]
    if let Some(process) = rustix::process::Pid::from_raw(id.cast_signed()) {
        let asked = rustix::process::test_kill_process(process);
        return asked != Err(rustix::io::Errno::SRCH);
    }
    let _ = id;
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_file_with_the_number_of_one_that_is_gone_is_no_input() {
        let dir = tempfile::tempdir().expect("a folder");
        let (input, link, other) =
            (dir.path().join("in"), dir.path().join("link"), dir.path().join("other"));
        let _session = Session::begin();
        std::fs::write(&input, "x").expect("a file");
        std::fs::hard_link(&input, &link).expect("a link");
        will_read(&input);
        assert!(is_no_input(&link).is_err(), "one file under two names");
        // The link takes the number along, as a file system does that gives a free number away.
        std::fs::rename(&link, &other).expect("another name");
        std::fs::remove_file(&input).expect("the input's end");
        assert!(is_no_input(&other).is_ok());
    }

    #[test]
    fn a_missing_file_is_told_with_the_nearest_name_or_the_folder_that_is_missing() {
        let dir = tempfile::tempdir().expect("a folder");
        for name in ["xt32.json", "m1.json"] {
            std::fs::write(dir.path().join(name), "{}").expect("a file");
        }
        let told = |name: &str| open(&dir.path().join(name)).expect_err("missing").to_string();
        assert_eq!(told("xt33.json"), "No such file (its folder has `xt32.json`)");
        assert_eq!(told("q"), "No such file or directory (os error 2)");
        let folder = dir.path().join("none");
        let words = format!("No such file (there is no folder `{}`)", folder.display());
        assert_eq!(told("none/m1.json"), words);
    }

    #[test]
    fn a_pointer_of_git_lfs_is_no_input() {
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("mesh.obj");
        std::fs::write(&file, [POINTER, b"v1\noid sha256:0\nsize 9\n"].concat()).expect("a file");
        assert!(read(&file, 1 << 20).unwrap_err().to_string().contains("git lfs pull"));
        std::fs::write(&file, "v 0 0 0\n").expect("a file");
        assert_eq!(read(&file, 1 << 20).expect("the whole text"), b"v 0 0 0\n");
    }

    #[test]
    fn a_folder_loses_the_files_of_dead_processes_alone() {
        let dir = tempfile::tempdir().expect("a folder");
        let mut child = std::process::Command::new("true").spawn().expect("a process");
        child.wait().expect("its end");
        let (dead, own) = (child.id(), std::process::id());
        for name in [
            format!(".sightline-{dead}-a.tmp"),
            format!(".sightline-{own}-a.tmp"),
            ".sightline-x-a.tmp".into(),
            ".tmpabc".into(),
        ] {
            std::fs::write(dir.path().join(name), "x").expect("a file");
        }
        std::fs::create_dir(dir.path().join(format!(".sightline-{dead}-b"))).expect("a folder");
        sweep(dir.path());
        let left = std::fs::read_dir(dir.path()).expect("the folder").count();
        assert_eq!(left, 4);
        assert!(!dir.path().join(format!(".sightline-{dead}-a.tmp")).exists());
    }

    #[test]
    fn files_beyond_their_budget_are_not_read() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("sparse");
        let file = File::create(&path).expect("a file");
        file.set_len(1 << 40).expect("a length");
        assert_holds!(read(&path, 1 << 30).expect_err("too large"), "larger than 1024 MiB");
        file.set_len(10).expect("a length");
        assert_eq!(read(&path, 10).expect("ten bytes").len(), 10);
        assert!(read(dir.path(), 10).is_err());
    }
}
