//! `scene`: makes scenes, takes them over from other formats, and says what they hold.

mod import;
mod info;
mod new;

use super::exit::Exit;
use crate::runs::RunError;

#[derive(clap::Subcommand)]
pub enum SceneCommand {
    /// Make a world by rule from a seed
    New(new::SceneNewArgs),
    /// Make a scene of a map of another format
    Import(import::SceneImportArgs),
    /// Count what scenes hold: triangles, actors, voxels by class, hits by range
    Info(info::SceneInfoArgs),
}

pub fn run(command: &SceneCommand) -> Result<Exit, RunError> {
    match command {
        SceneCommand::New(args) => new::run(args)?,
        SceneCommand::Import(args) => import::run(args)?,
        SceneCommand::Info(args) => info::run(args)?,
    }
    Ok(Exit::Done)
}
