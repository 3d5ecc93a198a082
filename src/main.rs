//! The `sightline` program: maps what [`cli::run`] returns to an exit code.

// Both panic where nothing can be written; `cli` has its own.
#![warn(clippy::print_stdout, clippy::print_stderr)]

mod allocator;
mod cli;

use std::process::ExitCode;

#[global_allocator]
static ALLOCATOR: allocator::Sentence = allocator::Sentence;

fn main() -> ExitCode {
    // Mesa's device selection layer looks for a display and complains on stderr when there is none;
    // devices are ranked here, so it is not needed.
    // SAFETY: no other thread runs yet that could read the environment.
    #[allow(unsafe_code)]
    unsafe {
        std::env::set_var("NODEVICE_SELECT", "1");
    }
    match cli::run() {
        Ok(code) => code,
        Err(error) => {
            cli::say(&error.to_string());
            ExitCode::from(2)
        }
    }
}
