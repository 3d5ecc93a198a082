//! Lines on stdout and stderr, answers that are tables, and exit codes.

use std::fmt::Arguments;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;

use serde::Serialize;
use serde_json::json;

use crate::internals::{FileError, visible};
use crate::runs::{RunError, TableFormat};

/// Like `print!`, with an [`RunError`] instead of a panic where stdout cannot be written.
macro_rules! out {
    ($($text:tt)*) => { $crate::cli::output::print(format_args!($($text)*)) };
}

/// Like `println!`, with an [`RunError`] instead of a panic where stdout cannot be written.
macro_rules! outln {
    () => { out!("\n") };
    ($($text:tt)*) => { out!("{}\n", format_args!($($text)*)) };
}

/// Writes to stdout; to be called by `out!` and `outln!`.
pub fn print(text: Arguments) -> Result<(), RunError> {
    let mut out = stdout();
    let written = out.write_fmt(text).and_then(|()| out.flush());
    unless_closed(written.map_err(RunError::io(Path::new("stdout"))))
}

/// Stdout. A terminal gets lines as it may show them, a file or another program every character.
pub fn stdout() -> Box<dyn Write> {
    let out = std::io::stdout().lock();
    if out.is_terminal() { Box::new(ForTerminal(out)) } else { Box::new(out) }
}

/// Writer of text whose hidden characters are spelled out.
struct ForTerminal<W>(W);

impl<W: Write> Write for ForTerminal<W> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match std::str::from_utf8(bytes) {
            Ok(text) => self.0.write_all(for_terminal(text).as_bytes())?,
            // Half a character, which the next call completes.
            Err(_) => self.0.write_all(bytes)?,
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.0.flush()
    }
}

/// Lines as a terminal may show them; see [`visible`].
fn for_terminal(text: &str) -> String {
    let line = |line: &str| line.split('\t').map(visible).collect::<Vec<_>>().join("\t");
    text.split('\n').map(line).collect::<Vec<_>>().join("\n")
}

/// Takes a closed pipe for the wish to read no more, as of `head`: no error.
pub fn unless_closed(written: Result<(), RunError>) -> Result<(), RunError> {
    match written {
        Err(RunError::Library(crate::Error::File(FileError::Io { source, .. })))
            if source.kind() == ErrorKind::BrokenPipe =>
        {
            Ok(())
        }
        written => written,
    }
}

/// Longest sentence in characters, above a path of the longest that systems take.
const LONGEST: usize = 5_000;
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

/// A sentence without its middle where it is long: names in files may have any length.
fn with_short_middle(text: &str) -> String {
    let count = text.chars().count();
    if count <= LONGEST {
        return text.to_owned();
    }
    let (head, tail) = (2 * LONGEST / 3, LONGEST / 4);
    let start: String = text.chars().take(head).collect();
    let end: String = text.chars().skip(count - tail).collect();
    format!("{start}… ({} characters) …{end}", count - head - tail)
}

/// Writes a line to stderr; where that cannot be written, the work goes on. Control characters are spelled
/// out: names in files may hold some, and a terminal would obey them.
pub fn say(line: &str) {
    let line = with_short_middle(&visible(&with_short_numbers(line)));
    let _ = writeln!(std::io::stderr(), "sightline: {line}");
}

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Exit {
    /// All that was asked.
    Done,
    /// With a check that failed.
    CheckFailed,
    /// At an input or an argument that is wrong; stderr holds one sentence about it.
    BadInput,
    /// By Ctrl-C, after what was done so far was written.
    Interrupted,
}

impl Exit {
    /// The exit code: 0, 1, 2 or 130, as shells expect of an interrupted program.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::CheckFailed => 1,
            Self::BadInput => 2,
            Self::Interrupted => 130,
        }
    }
}

/// Prints an answer: all of it as JSON, its table as CSV, or as `text` prints it.
pub fn answer(
    format: TableFormat,
    found: &impl Serialize,
    table: impl FnOnce() -> String,
    text: impl FnOnce() -> Result<(), RunError>,
) -> Result<(), RunError> {
    match format {
        TableFormat::Json => outln!("{}", json!(found)),
        TableFormat::Csv => out!("{}", table()),
        TableFormat::Text => text(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_is_cut_out_of_a_sentence_and_hidden_characters_are_spelled() {
        let told = with_short_middle(&format!(
            "a.json: `{}` is no name; give another",
            "é".repeat(90_000)
        ));
        assert!(told.starts_with("a.json: `éé") && told.ends_with("é` is no name; give another"));
        assert!(told.chars().count() < LONGEST && told.contains("é… (8"), "{}", told.len());
        assert_eq!(with_short_middle("short"), "short");
        let mut shown = ForTerminal(Vec::new());
        shown.write_all("a\u{202e}b\tc\nd\u{1b}[0m\n".as_bytes()).unwrap();
        assert_eq!(shown.0, b"a\\u{202e}b\tc\nd\\u{1b}[0m\n");
    }

    #[test]
    fn numbers_of_hundreds_of_digits_are_cut() {
        let told = with_short_numbers(&format!("x = {}; give less than 100.25", 1e300));
        assert_eq!(told, "x = 100000000000… (301 digits); give less than 100.25");
        assert_eq!(with_short_numbers("é 12"), "é 12");
    }
}
