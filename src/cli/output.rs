//! Ways out of the program: lines on stdout and stderr, and files that are either whole or not there.

use std::fmt::Arguments;
use std::fs::{File, TryLockError};
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::error::Error;

/// As `print!`, with an [`Error`] instead of a panic where stdout cannot be written.
macro_rules! out {
    ($($text:tt)*) => { $crate::cli::output::print(format_args!($($text)*)) };
}

/// As `println!`, with an [`Error`] instead of a panic where stdout cannot be written.
macro_rules! outln {
    () => { out!("\n") };
    ($($text:tt)*) => { out!("{}\n", format_args!($($text)*)) };
}

/// Writes to stdout; to be called by `out!` and `outln!`.
pub fn print(text: Arguments) -> Result<(), Error> {
    let mut out = std::io::stdout().lock();
    let written = out.write_fmt(text).and_then(|()| out.flush());
    unless_closed(written.map_err(Error::io(Path::new("stdout"))))
}

/// Takes a closed pipe for the wish to read no more, as of `head`: no error.
pub fn unless_closed(written: Result<(), Error>) -> Result<(), Error> {
    match written {
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// Writes a line to stderr; where that cannot be written, the work goes on. Control characters are spelled
/// out: names in files may hold some, and a terminal would obey them.
pub fn say(line: &str) {
    let spell = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.into() };
    let line: String = line.chars().map(spell).collect();
    let _ = writeln!(std::io::stderr(), "sightline: {line}");
}

/// Pause between two looks at a folder that another program holds.
const BETWEEN_TRIES: Duration = Duration::from_millis(50);

/// Links that are followed before a path is taken for a loop.
const MOST_LINKS: usize = 40;

/// Where a path leads when links are followed. The links to open files in `/proc` name no place.
pub fn target(path: &Path) -> Result<PathBuf, Error> {
    let mut at = path.to_owned();
    for _ in 0..MOST_LINKS {
        match std::fs::read_link(&at) {
            Ok(link) if !is_open_file(&at) => at = folder_of(&at).join(link),
            _ => return Ok(at),
        }
    }
    let message = "a loop of symbolic links; name a file";
    Err(Error::io(path)(std::io::Error::other(message)))
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
pub fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), Error>,
) -> Result<(), Error> {
    let io = |error| Error::io(path)(error);
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
        return unless_closed(copied.map_err(io));
    }
    if let Ok(before) = std::fs::metadata(&target) {
        file.as_file().set_permissions(before.permissions()).map_err(io)?;
    }
    file.persist(&target).map_err(|error| io(error.error))?;
    Ok(())
}

/// Folders that are missing before a run makes them; those that are empty at its end go again.
pub struct Missing(Vec<PathBuf>);

impl Missing {
    /// Of a folder that is there.
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

/// As [`shared_folder`], for the files of one run: while the lock lives, a second program that names the
/// folder is refused, since the files of two would not belong together. A program that holds the folder
/// already may end within `patience`. `None` where folders cannot be opened, as on some network drives:
/// nobody is kept out.
pub fn lock_folder(path: &Path, patience: Duration) -> Result<Option<File>, Error> {
    shared_folder(path)?;
    let Ok(folder) = File::open(path) else { return Ok(None) };
    let until = Instant::now() + patience;
    while let Err(TryLockError::WouldBlock) = folder.try_lock() {
        if Instant::now() >= until {
            return Err(Error::Usage(format!(
                "{}: another run writes into it; wait for its end, or name another folder",
                path.display()
            )));
        }
        std::thread::sleep(BETWEEN_TRIES);
    }
    Ok(Some(folder))
}

/// Makes a folder and checks that files can be written into it, before long work begins.
pub fn shared_folder(path: &Path) -> Result<(), Error> {
    if path.exists() && !path.is_dir() {
        let message = "is a file where a folder is wanted; name another place";
        return Err(Error::io(path)(std::io::Error::other(message)));
    }
    std::fs::create_dir_all(path).map_err(Error::io(path))?;
    tempfile::tempfile_in(path).map_err(Error::io(path))?;
    Ok(())
}

/// Checks that a file could be written at `path` and that it is none of `inputs`, before long work
/// begins.
pub fn writable_file<'a>(
    path: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Error> {
    let target = target(path)?;
    if is_sink(&target) {
        return Ok(());
    }
    if target.is_dir() {
        let message = "is a directory; name a file in it";
        return Err(Error::io(path)(std::io::Error::other(message)));
    }
    let place = target.canonicalize().ok();
    if place.is_some() && inputs.into_iter().any(|input| input.canonicalize().ok() == place) {
        return Err(Error::Usage(format!(
            "{}: is read by this command and would be overwritten; name another file",
            path.display()
        )));
    }
    tempfile::tempfile_in(folder_of(&target)).map_err(Error::io(path))?;
    Ok(())
}
