//! `scene import`: scenes of maps in other formats.

use std::path::PathBuf;

use sightline::worlds::{import_opendrive, read_opendrive};

use super::Target;
use crate::cli::args::{Talk, whole};
use crate::cli::error::Error;

#[derive(clap::Args)]
#[command(after_help = "Example:
  sightline scene import Town01.xodr --seed 1 --out town01.json")]
pub struct Args {
    /// OpenDRIVE file (.xodr): its roads and lanes; houses, trees and traffic come from the seed
    input: PathBuf,
    /// Seed of all that the map does not say
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Frames, a tenth of a second apart
    #[arg(long, value_name = "N", default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: u32,
    /// Scene file to write; the mesh stands beside it, with the ending .ply
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    talk: Talk,
}

pub fn run(args: &Args) -> Result<(), Error> {
    let name = args.input.to_string_lossy();
    match name.rsplit('.').next() {
        Some("xodr" | "gz") => opendrive(args),
        _ => Err(Error::Usage(format!(
            "{name}: is of no format that is imported; give an OpenDRIVE file with the ending .xodr"
        ))),
    }
}

fn opendrive(args: &Args) -> Result<(), Error> {
    let target = Target::new(&args.out, Some(&args.input))?;
    let text = read_opendrive(&args.input)?;
    let file = args.input.display().to_string();
    let world = import_opendrive(&text, &file, args.seed, args.frames as usize)?;
    target.write(world.mesh(), &world.scene(&target.name(), &target.mesh_name()), args.talk)
}
