//! Lines on stdout and stderr.

use std::fmt::Arguments;
use std::io::{ErrorKind, Write};
use std::path::Path;

use crate::internals::FileError;

use crate::runs::Error;

/// Like `print!`, with an [`Error`] instead of a panic where stdout cannot be written.
macro_rules! out {
    ($($text:tt)*) => { $crate::cli::output::print(format_args!($($text)*)) };
}

/// Like `println!`, with an [`Error`] instead of a panic where stdout cannot be written.
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
        Err(Error::Library(crate::Error::File(FileError::Io { source, .. })))
            if source.kind() == ErrorKind::BrokenPipe =>
        {
            Ok(())
        }
        written => written,
    }
}

/// Digits of a number that are printed whole; `f64` has 17 that count.
const DIGITS: usize = 40;

/// A text whose longer runs of digits are cut: 1e300 prints 301 of them.
fn with_short_numbers(text: &str) -> String {
    let (mut short, mut rest) = (String::with_capacity(text.len()), text);
    while let Some(start) = rest.find(|c: char| c.is_ascii_digit()) {
        let digits = &rest[start..];
        let length = digits.find(|c: char| !c.is_ascii_digit()).unwrap_or(digits.len());
        let shown = if length > DIGITS { 12 } else { length };
        short += &rest[..start + shown];
        if length > DIGITS {
            short += &format!("… ({length} digits)");
        }
        rest = &digits[length..];
    }
    short + rest
}

/// Writes a line to stderr; where that cannot be written, the work goes on. Control characters are spelled
/// out: names in files may hold some, and a terminal would obey them.
pub fn say(line: &str) {
    let spell = |c: char| if c.is_control() { c.escape_default().to_string() } else { c.into() };
    let line: String = with_short_numbers(line).chars().map(spell).collect();
    let _ = writeln!(std::io::stderr(), "sightline: {line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_hundreds_of_digits_are_cut() {
        let told = with_short_numbers(&format!("x = {}; give less than 100.25", 1e300));
        assert_eq!(told, "x = 100000000000… (301 digits); give less than 100.25");
        assert_eq!(with_short_numbers("é 12"), "é 12");
    }
}
