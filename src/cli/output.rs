//! Lines on stdout and stderr.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::path::Path;

use crate::internals::FileError;

use crate::runs::Error;

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
        Err(Error::File(FileError::Io { source, .. }))
            if source.kind() == ErrorKind::BrokenPipe =>
        {
            Ok(())
        }
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
