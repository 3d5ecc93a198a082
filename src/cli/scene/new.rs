//! `scene new`: a world by rule, or a plain street of as many triangles as asked for.

use std::path::PathBuf;

use crate::internals::{FEWEST_STREET_TRIANGLES as FEWEST, MOST_STREET_TRIANGLES as MOST};
use crate::runs::RunError;
use crate::runs::scene::{new_street, new_world};
use crate::worlds;
use clap::ValueEnum;

use crate::cli::args::whole;
use crate::cli::terminal::{Talk, Terminal};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scene new --kind town --seed 7 --out town.json
  sightline scene new --triangles 2000000 --frames 2 --out big.json")]
pub struct SceneNewArgs {
    /// What the world is
    #[arg(long, value_enum, default_value_t = KindArg::Street, conflicts_with = "triangles")]
    kind: KindArg,
    /// A plain crossing of exactly this many triangles instead, for timings
    #[arg(long, value_name = "N",
          value_parser = clap::value_parser!(u32).range(FEWEST as i64..=MOST as i64))]
    triangles: Option<u32>,
    /// Seed of where things stand and how large they are
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Frames, a tenth of a second apart [default: 40; with --triangles 4, three metres apart]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: Option<u32>,
    /// Scene file to write; the mesh stands beside it, with the ending .ply
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    talk: Talk,
}

/// Value of `--kind`.
#[derive(Debug, Clone, Copy, ValueEnum)]
enum KindArg {
    /// A street through a town, with side streets
    Street,
    /// A motorway between barriers, under a bridge
    Highway,
    /// Narrow streets between houses with gardens
    Residential,
    /// Halls, containers and lorries
    Yard,
    /// Blocks of houses on a grid of streets
    Town,
}

impl From<KindArg> for worlds::WorldKind {
    fn from(kind: KindArg) -> Self {
        match kind {
            KindArg::Street => Self::Street,
            KindArg::Highway => Self::Highway,
            KindArg::Residential => Self::Residential,
            KindArg::Yard => Self::Yard,
            KindArg::Town => Self::Town,
        }
    }
}

pub fn run(args: &SceneNewArgs) -> Result<(), RunError> {
    let (seed, out, terminal) = (args.seed, &args.out, Terminal::new(args.talk));
    match args.triangles {
        Some(count) => new_street(count as usize, seed, args.frames.unwrap_or(4), out, &terminal),
        None => {
            let frames = args.frames.unwrap_or(40) as usize;
            new_world(args.kind.into(), seed, frames, out, &terminal)
        }
    }
}
