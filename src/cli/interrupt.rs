//! Ctrl-C: finish what is under way, write what is there, exit 130.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use super::args::Talk;

/// Exit code after Ctrl-C, as shells expect of it.
pub const INTERRUPTED: u8 = 130;

/// A flag that Ctrl-C sets; a second Ctrl-C ends the program at once.
pub fn on_interrupt(talk: Talk) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    let handler = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(INTERRUPTED));
        }
    });
    if let Err(error) = handler {
        talk.detail(format!("Ctrl-C ends at once: {error}"));
    }
    stop
}
