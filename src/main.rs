//! The `sightline` program: maps what [`cli::run`] returns to an exit code.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    match cli::run() {
        Ok(code) => code,
        Err(error) => {
            eprintln!("sightline: {error}");
            ExitCode::from(2)
        }
    }
}
