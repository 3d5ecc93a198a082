//! The `sightline` program: maps the result of [`cli::run`] to an exit code.

use std::process::ExitCode;

use sightline::cli;
use sightline::internals::Sentence;

#[global_allocator]
static ALLOCATOR: Sentence = Sentence;

fn main() -> ExitCode {
    // Mesa's device selection layer looks for a display and complains on stderr when there is none;
    // devices are ranked here, so it is not needed.
    // SAFETY: no other thread runs yet that could read the environment.
    #[allow(unsafe_code)]
    unsafe {
        std::env::set_var("NODEVICE_SELECT", "1");
    }
    ExitCode::from(cli::run(std::env::args_os()).code())
}
