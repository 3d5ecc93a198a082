//! `cast`: every beam's hit in one frame of a scene.

use std::path::PathBuf;

use crate::runs::RunError;
use crate::runs::cast::{CastRequest, cast};
use serde_json::json;

use super::args::{Compute, Format, UnnamedModelArgs};
use super::exit::Exit;
use super::glb::Gltf;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline cast scenes/highway.json scenes/placements.json --frame 3 --out hits.npz
  sightline cast scenes/highway.json scenes/placements.json --gltf highway.glb")]
pub struct CastArgs {
    /// Scene file; it must have geometry
    scene: PathBuf,
    /// Placements
    placements: PathBuf,
    /// Write the hits to this .npz file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Frame of the scene, from 0
    #[arg(long, default_value_t = 0, value_name = "T")]
    frame: u32,
    /// How to print the summary
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    gltf: Gltf,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &CastArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = CastRequest {
        scene: args.scene.clone(),
        placements: args.placements.clone(),
        out: args.out.clone(),
        gltf: args.gltf.gltf.clone(),
        frame: args.frame,
    };
    let found = cast(&request, &args.named.computing(&args.compute, &terminal))?;
    match args.format {
        Format::Json => outln!("{}", json!(found))?,
        Format::Text => outln!(
            "{}: {} beams, {} hits on {} triangles",
            found.scene,
            found.beams,
            found.hits,
            found.triangles
        )?,
    }
    Ok(Exit::Done)
}
