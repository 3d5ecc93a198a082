//! The terminal as work on files sees it: lines and bars on stderr, Ctrl-C as a wish to stop.

use std::fmt::Write;
use std::io::IsTerminal;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Once};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use super::output::{Exit, say};
use crate::Note;
use crate::files::remove_temporaries;
use crate::runs::{Bar, RunError, Watcher};

/// How much is said on stderr.
#[derive(clap::Args, Debug, Clone, Copy)]
pub struct Talk {
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
    pub fn note(&self, line: impl AsRef<str>) {
        if !self.quiet {
            say(line.as_ref());
        }
    }

    /// A line for stderr that was asked for.
    pub fn detail(&self, line: impl AsRef<str>) {
        if self.verbose {
            say(line.as_ref());
        }
    }
}

/// Told of work under way by a command.
pub struct Terminal {
    talk: Talk,
}

/// Tells whether Ctrl-C, SIGTERM or SIGHUP came while a command listens for them.
static STOPS: AtomicBool = AtomicBool::new(false);
/// Milliseconds that the command has to end after a signal; 0 before it listens for them.
static GRACE: AtomicU64 = AtomicU64::new(0);
/// The handler is set once a process.
static HANDLER: Once = Once::new();

/// Ends the process unless the command listens and has not been told yet; no half-written file is left.
fn on_signal() {
    let end = || {
        remove_temporaries();
        std::process::exit(i32::from(Exit::Interrupted.code()))
    };
    let grace = GRACE.load(Ordering::SeqCst);
    if STOPS.swap(true, Ordering::SeqCst) || grace == 0 {
        end();
    }
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
pub fn ignore_file_limit_signal() {
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
    pub fn new(talk: Talk) -> Self {
        STOPS.store(false, Ordering::SeqCst);
        GRACE.store(0, Ordering::SeqCst);
        HANDLER.call_once(|| {
            if let Err(error) = hear_signals() {
                talk.detail(format!("Ctrl-C ends at once: {error}"));
            }
        });
        Self { talk }
    }

    /// How the command ends: as one that is done, or was stopped.
    pub fn exit(&self) -> Exit {
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

    /// A bar with rate and time left, or with share and time left; nothing where stderr is no terminal.
    fn bar(&self, total: u64, unit: Option<&str>) -> Box<dyn Bar> {
        let bar = ProgressBar::new(total);
        if self.talk.quiet || !std::io::stderr().is_terminal() {
            bar.set_draw_target(ProgressDrawTarget::hidden());
            return Box::new(Shown(bar));
        }
        let rate = |state: &ProgressState, out: &mut dyn Write| {
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
        Box::new(Shown(bar))
    }

    fn listen(&self, grace: Duration) {
        // At least one: 0 is a command that does not listen.
        let grace = u64::try_from(grace.as_millis()).unwrap_or(u64::MAX).max(1);
        GRACE.store(grace, Ordering::SeqCst);
    }

    fn goes_on(&self) -> bool {
        !STOPS.load(Ordering::SeqCst)
    }
}

/// A bar on stderr until it is dropped.
struct Shown(ProgressBar);

impl Bar for Shown {
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

impl Drop for Shown {
    fn drop(&mut self) {
        self.0.finish_and_clear();
    }
}
