//! Lines on stdout and stderr, and exit codes.

use std::fmt::Arguments;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use terminal_size::{Width, terminal_size_of};

use super::lines::{for_terminal, with_short_middle, with_short_numbers, wrapped};
use crate::Note;
use crate::files::{FileError, remove_temporaries};
use crate::report::text::visible;
use crate::runs::{Bar, RunError, Silent, Watcher};

/// Like `print!`, with an [`RunError`] instead of a panic where stdout cannot be written.
macro_rules! out {
    ($($text:tt)*) => { $crate::cli::output::print(format_args!($($text)*)) };
}

/// Like `println!`, with an [`RunError`] instead of a panic where stdout cannot be written.
macro_rules! outln {
    () => { out!("\n") };
    ($($text:tt)*) => { out!("{}\n", format_args!($($text)*)) };
}

/// Writes to stdout, on a terminal with long sentences broken between words; to be called by `out!` and `outln!`.
pub(super) fn print(text: Arguments) -> Result<(), RunError> {
    let mut out = stdout();
    let written = match terminal_size_of(std::io::stdout()) {
        Some((Width(columns), _)) => {
            out.write_all(wrapped(&text.to_string(), columns.into()).as_bytes())
        }
        None => out.write_fmt(text),
    };
    let written = written.and_then(|()| out.flush());
    unless_closed(written.map_err(RunError::io(Path::new("stdout"))))
}

/// Stdout. A terminal gets lines as it may show them, a file or another program every character.
pub(super) fn stdout() -> Box<dyn Write> {
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

/// Takes a closed pipe for the wish to read no more, as of `head`: no error.
pub(super) fn unless_closed(written: Result<(), RunError>) -> Result<(), RunError> {
    match written {
        Err(RunError::Library(crate::Error::File(FileError::Io { source, .. })))
            if source.kind() == ErrorKind::BrokenPipe =>
        {
            Ok(())
        }
        written => written,
    }
}

/// Writes a line to stderr; where that cannot be written, the work goes on. Control characters are spelled
/// out: names in files may hold some, and a terminal would obey them.
pub(super) fn say(line: &str) {
    say_as("sightline:", line);
}

/// Like [`say`], for the sentence that ends a command: in red on a terminal, so that it stands out from notes.
pub(super) fn fail(line: &str) {
    let is_plain = !std::io::stderr().is_terminal() || std::env::var_os("NO_COLOR").is_some();
    say_as(if is_plain { "sightline:" } else { "\x1b[1;31msightline:\x1b[0m" }, line);
}

fn say_as(who: &str, line: &str) {
    let line = with_short_middle(&visible(&with_short_numbers(line)));
    *SAID.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
    let _ = writeln!(std::io::stderr(), "{who} {line}");
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
    /// By Ctrl-C, after the results so far were written.
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

/// How much is said on stderr.
#[derive(clap::Args, Debug, Clone, Copy)]
pub(super) struct Talk {
    /// Say more on stderr
    #[arg(short, long)]
    pub verbose: bool,
    /// Say nothing on stderr but errors
    #[arg(long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Refuse an input that is likely not meant as it stands, such as millimetres in place of metres
    #[arg(long)]
    pub strict: bool,
    /// Let meshes and data sets refer to files outside of their folders
    #[arg(long)]
    pub trust_paths: bool,
}

impl Talk {
    /// A line for stderr that is of interest by default.
    pub(super) fn note(&self, line: impl AsRef<str>) {
        if !self.quiet {
            say(line.as_ref());
        }
    }

    /// A line for stderr that was asked for.
    pub(super) fn detail(&self, line: impl AsRef<str>) {
        if self.verbose {
            say(line.as_ref());
        }
    }
}

/// Told of work under way by a command.
pub(super) struct Terminal {
    talk: Talk,
}

/// Tells whether Ctrl-C, SIGTERM or SIGHUP came while a command listens for them.
static STOPS: AtomicBool = AtomicBool::new(false);
/// Milliseconds that the command has to end after a signal; 0 before it listens for them.
static GRACE: AtomicU64 = AtomicU64::new(0);
/// How to go on after the process is ended; empty where nothing is kept for that.
static RESUME: Mutex<String> = Mutex::new(String::new());
/// The handler is set once a process.
static HANDLER: Once = Once::new();

/// Ends the process unless the command listens and has not been told yet; no half-written file is left.
fn on_signal() {
    let end = || {
        let go_on = RESUME.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if !go_on.is_empty() {
            say(&go_on);
        }
        remove_temporaries();
        std::process::exit(i32::from(Exit::Interrupted.code()))
    };
    let grace = GRACE.load(Ordering::SeqCst);
    if STOPS.swap(true, Ordering::SeqCst) || grace == 0 {
        end();
    }
    say("stopping: what was found so far is written; another signal ends at once");
    // Work that takes longer than its grace is ended: files are whole at any time.
    std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(grace));
        say("interrupted before a place to stop; files that are there are whole");
        end();
    });
}

/// Lets a write beyond the limit of file sizes (`ulimit -f`) fail with an error, in place of a signal that ends the
/// program and leaves its temporary files.
#[allow(unsafe_code)]
pub(super) fn ignore_file_limit_signal() {
    #[cfg(unix)]
    {
        use nix::sys::signal::{SigHandler, Signal, signal};
        // SAFETY: no code of ours runs where a signal is ignored.
        let _ = unsafe { signal(Signal::SIGXFSZ, SigHandler::SigIgn) };
    }
}

/// Hears Ctrl-C, SIGTERM and SIGHUP. A SIGHUP that `nohup` lets the program ignore stays ignored.
fn hear_signals() -> Result<(), ctrlc::Error> {
    #[cfg(unix)]
    let is_ignored = ignore_hangup();
    ctrlc::set_handler(on_signal)?;
    #[cfg(unix)]
    if is_ignored {
        ignore_hangup();
    }
    Ok(())
}

/// Ignores SIGHUP, and returns whether it was ignored before.
#[cfg(unix)]
#[allow(unsafe_code)]
fn ignore_hangup() -> bool {
    use nix::sys::signal::{SigHandler, Signal, signal};
    // SAFETY: no code of ours runs where a signal is ignored.
    let before = unsafe { signal(Signal::SIGHUP, SigHandler::SigIgn) };
    matches!(before, Ok(SigHandler::SigIgn))
}

impl Terminal {
    pub(super) fn new(talk: Talk) -> Self {
        STOPS.store(false, Ordering::SeqCst);
        GRACE.store(0, Ordering::SeqCst);
        RESUME.lock().unwrap_or_else(PoisonError::into_inner).clear();
        *SAID.lock().unwrap_or_else(PoisonError::into_inner) = Some(Instant::now());
        HANDLER.call_once(|| {
            if let Err(error) = hear_signals() {
                talk.detail(format!("Ctrl-C ends at once: {error}"));
            }
        });
        Self { talk }
    }

    /// How the command ends: as one that is done, or was stopped.
    pub(super) fn exit(&self) -> Exit {
        if self.goes_on() { Exit::Done } else { Exit::Interrupted }
    }
}

impl Watcher for Terminal {
    fn note(&self, sentence: &str) {
        self.talk.note(sentence);
    }

    fn tell(&self, note: &Note) -> Result<(), RunError> {
        if self.talk.strict && note.is_doubt() {
            return Err(RunError::Doubt(note.to_string()));
        }
        self.talk.note(note.text());
        Ok(())
    }

    fn detail(&self, sentence: &str) {
        self.talk.detail(sentence);
    }

    fn notes(&self) -> Arc<dyn Fn(&str) + Send + Sync> {
        let talk = self.talk;
        Arc::new(move |sentence| talk.note(sentence))
    }

    /// A bar with rate and time left, or with share and time left; where stderr is no terminal a line every ten seconds.
    fn bar(&self, total: u64, unit: Option<&str>) -> Box<dyn Bar> {
        if self.talk.quiet {
            return Box::new(Silent);
        }
        if !std::io::stderr().is_terminal() {
            return Box::new(ProgressLines::new(total, unit));
        }
        let bar = ProgressBar::new(total);
        let rate = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
            let _ = write!(out, "{:.1}", state.per_sec());
        };
        // With the message of `optimize` in 80 columns.
        let template = match unit {
            Some(unit) => {
                format!("{{bar:16}} {{pos}}/{{len}} {unit}, {{rate}}/s, {{eta}} left {{wide_msg}}")
            }
            None => "{bar:16} {percent} %, {eta} left {wide_msg}".to_owned(),
        };
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style.with_key("rate", rate).progress_chars("=> "));
        }
        bar.enable_steady_tick(Duration::from_millis(200));
        Box::new(TerminalBar(bar))
    }

    fn listen(&self, grace: Duration) {
        // At least one: 0 is a command that does not listen.
        let grace = u64::try_from(grace.as_millis()).unwrap_or(u64::MAX).max(1);
        GRACE.store(grace, Ordering::SeqCst);
    }

    fn resumes(&self, go_on: &str) {
        *RESUME.lock().unwrap_or_else(PoisonError::into_inner) = go_on.to_owned();
    }

    fn goes_on(&self) -> bool {
        !STOPS.load(Ordering::SeqCst)
    }
}

/// Longest time without a line where stderr is no terminal and progress is told.
const SILENCE: Duration = Duration::from_secs(10);
/// When the last line was said.
static SAID: Mutex<Option<Instant>> = Mutex::new(None);

/// Progress as a line on stderr now and then.
struct ProgressLines {
    unit: Option<String>,
    begun: Instant,
    /// Done, and total.
    state: Mutex<(u64, u64)>,
}

impl ProgressLines {
    fn new(total: u64, unit: Option<&str>) -> Self {
        let state = Mutex::new((0, total));
        Self { unit: unit.map(str::to_owned), begun: Instant::now(), state }
    }

    fn change(&self, change: impl FnOnce(&mut (u64, u64))) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        change(&mut state);
        // Steps that are quick, one after the other, are no silence either.
        let said = *SAID.lock().unwrap_or_else(PoisonError::into_inner);
        if said.unwrap_or(self.begun).elapsed() >= SILENCE {
            say(&line(state.0, state.1, self.unit.as_deref(), self.begun.elapsed()));
        }
    }
}

/// Progress in words: `120/300 poses for swaps, 45 s left of this step`.
fn line(done: u64, total: u64, unit: Option<&str>, took: Duration) -> String {
    let progress = match unit {
        Some(unit) => format!("{done}/{total} {unit}"),
        None => format!("{} %", 100 * done.min(total) / total.max(1)),
    };
    let left = took.as_secs_f64() * (total.saturating_sub(done)) as f64 / done.max(1) as f64;
    match done {
        0 => format!("{progress}, {:.0} s so far", took.as_secs_f64()),
        _ => format!("{progress}, {left:.0} s left of this step"),
    }
}

impl Bar for ProgressLines {
    fn advance(&self, steps: u64) {
        self.change(|(done, _)| *done += steps);
    }

    fn set(&self, done: u64, total: u64) {
        self.change(|state| *state = (done, total));
    }
}

/// A bar on stderr until it is dropped.
struct TerminalBar(ProgressBar);

impl Bar for TerminalBar {
    fn advance(&self, steps: u64) {
        self.0.inc(steps);
    }

    fn set(&self, done: u64, total: u64) {
        self.0.set_length(total);
        self.0.set_position(done);
    }

    fn say(&self, words: String) {
        self.0.set_message(words);
    }
}

impl Drop for TerminalBar {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_of_progress_has_the_time_left() {
        let took = Duration::from_secs(30);
        // Thirty seconds for a quarter: ninety for the rest.
        assert_eq!(line(5, 20, Some("climbs"), took), "5/20 climbs, 90 s left of this step");
        assert_eq!(line(5, 20, None, took), "25 %, 90 s left of this step");
        assert_eq!(line(0, 20, Some("climbs"), took), "0/20 climbs, 30 s so far");
        assert_eq!(line(20, 20, Some("climbs"), took), "20/20 climbs, 0 s left of this step");
    }

    #[test]
    fn hidden_characters_are_spelled_out_on_a_terminal() {
        let mut shown = ForTerminal(Vec::new());
        shown.write_all("a\u{202e}b\tc\nd\u{1b}[0m\n".as_bytes()).unwrap();
        assert_eq!(shown.0, b"a\\u{202e}b\tc\nd\\u{1b}[0m\n");
    }
}
