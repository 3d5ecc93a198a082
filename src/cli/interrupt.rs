//! Ctrl-C as a flag that long work looks at between its steps.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::args::Talk;
use super::exit::Exit;

/// Whether the user has asked to stop.
#[derive(Clone)]
pub struct Interrupt(Arc<AtomicBool>);

impl Interrupt {
    /// Listens from now on; a second Ctrl-C ends the program at once. To be called once.
    pub fn listen(talk: Talk) -> Self {
        let flag = Arc::new(AtomicBool::new(false));
        let set = flag.clone();
        let handler = ctrlc::set_handler(move || {
            if set.swap(true, Ordering::SeqCst) {
                std::process::exit(i32::from(Exit::Interrupted.code()));
            }
        });
        if let Err(error) = handler {
            talk.detail(format!("Ctrl-C ends at once: {error}"));
        }
        Self(flag)
    }

    /// True from the first Ctrl-C on.
    pub fn is_set(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
