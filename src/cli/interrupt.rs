//! Ctrl-C, or the end of the time given, as a flag that long work looks at between its steps.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use super::args::Talk;

/// Exit code after Ctrl-C, as shells expect of it.
pub const INTERRUPTED: u8 = 130;

/// Whether the user has asked to stop, or the time is over.
#[derive(Clone)]
pub struct Interrupt {
    pressed: Arc<AtomicBool>,
    deadline: Option<Instant>,
}

impl Interrupt {
    /// Listens from now on; a second Ctrl-C ends the program at once. To be called once.
    pub fn listen(talk: Talk) -> Self {
        let flag = Arc::new(AtomicBool::new(false));
        let set = flag.clone();
        let handler = ctrlc::set_handler(move || {
            if set.swap(true, Ordering::SeqCst) {
                std::process::exit(i32::from(INTERRUPTED));
            }
        });
        if let Err(error) = handler {
            talk.detail(format!("Ctrl-C ends at once: {error}"));
        }
        Self { pressed: flag, deadline: None }
    }

    /// The same, set from a time on as well.
    pub fn until(&self, deadline: Option<Instant>) -> Self {
        Self { pressed: self.pressed.clone(), deadline }
    }

    /// True from the first Ctrl-C on, and after the deadline.
    pub fn is_set(&self) -> bool {
        self.is_pressed() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }

    /// True from the first Ctrl-C on.
    pub fn is_pressed(&self) -> bool {
        self.pressed.load(Ordering::SeqCst)
    }
}
