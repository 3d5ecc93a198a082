//! `scene`: makes scenes, takes them over from other formats, and says what they hold.

mod import;
mod info;
mod new;

use super::exit::Exit;
use crate::runs::Error;

#[derive(clap::Subcommand)]
pub enum Command {
    /// Make a world by rule from a seed
    New(new::Args),
    /// Make a scene of a map of another format
    Import(import::Args),
    /// Count what scenes hold: triangles, actors, voxels by class, hits by range
    Info(info::Args),
}

pub fn run(command: &Command) -> Result<Exit, Error> {
    match command {
        Command::New(args) => new::run(args)?,
        Command::Import(args) => import::run(args)?,
        Command::Info(args) => info::run(args)?,
    }
    Ok(Exit::Done)
}
