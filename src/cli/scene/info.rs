//! `scene info`: what scenes hold, counted.

use std::path::PathBuf;

use crate::runs::RunError;
use crate::runs::scene::{SceneCounts, count, counts_text};
use serde_json::json;

use crate::cli::args::Format;
use crate::cli::terminal::{Talk, Terminal};

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline scene info scenes/highway.json town.json")]
pub struct SceneInfoArgs {
    /// Scene files with geometry
    #[arg(required = true)]
    scenes: Vec<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    talk: Talk,
}

pub fn run(args: &SceneInfoArgs) -> Result<(), RunError> {
    let terminal = Terminal::new(args.talk);
    let counts = args.scenes.iter().map(|path| count(path, &terminal));
    let counts = counts.collect::<Result<Vec<SceneCounts>, RunError>>()?;
    match args.format {
        Format::Json => outln!("{}", json!(counts)),
        Format::Text => out!("{}", counts_text(&counts)),
    }
}
