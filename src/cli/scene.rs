//! `scene`: makes scenes, takes them over from other formats, and says what they hold.

use std::path::PathBuf;

use clap::ValueEnum;
use serde_json::json;

use super::args::Format;
use super::output::{Exit, Talk, Terminal};
use crate::runs::RunError;
use crate::runs::parse::whole;
use crate::runs::scene::{
    ImportRequest, SceneCounts, count, counts_text, import, new_street, new_world,
};
use crate::scene::street::{FEWEST_STREET_TRIANGLES as FEWEST, MOST_STREET_TRIANGLES as MOST};
use crate::worlds;

#[derive(clap::Subcommand)]
pub(super) enum SceneCommand {
    /// Make a world by rule from a seed
    New(SceneNewArgs),
    /// Make a scene of a map of another format
    #[command(after_help = "Examples:
  sightline scene import Town01.xodr --seed 1 --out town01.json
  sightline scene import nuscenes --nuscenes --scene scene-0061 --out scene-0061.json
  sightline scene import scans --carla --poses poses.csv --out drive.json")]
    Import {
        #[command(flatten)]
        request: Box<ImportRequest>,
        #[command(flatten)]
        talk: Talk,
    },
    /// Count what scenes hold: triangles, actors, voxels by class, hits by range
    #[command(after_help = "Example:\n  sightline scene info scenes/highway.json town.json")]
    Info {
        /// Scene files with geometry
        #[arg(required = true)]
        scenes: Vec<PathBuf>,
        /// Vehicle file: sensors, mounts, body; a scene without `lidar` or `vehicle` needs one
        #[arg(long, value_name = "FILE")]
        vehicle: Option<PathBuf>,
        /// How to print
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
        #[command(flatten)]
        talk: Talk,
    },
}

pub(super) fn run(command: &SceneCommand) -> Result<Exit, RunError> {
    match command {
        SceneCommand::New(args) => run_new(args)?,
        SceneCommand::Import { request, talk } => import(request, &Terminal::new(*talk))?,
        SceneCommand::Info { scenes, vehicle, format, talk } => {
            let terminal = Terminal::new(*talk);
            let counts = scenes.iter().map(|path| count(path, vehicle.as_deref(), &terminal));
            let counts = counts.collect::<Result<Vec<SceneCounts>, RunError>>()?;
            match format {
                Format::Json => outln!("{}", json!(counts))?,
                Format::Text => out!("{}", counts_text(&counts))?,
            }
        }
    }
    Ok(Exit::Done)
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scene new --kind town --seed 7 --out town.json
  sightline scene new --triangles 2000000 --frames 2 --out big.json")]
pub(super) struct SceneNewArgs {
    /// Kind of the world
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

/// Value of `--kind`, in the order of [`worlds::WorldKind::ALL`].
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

fn run_new(args: &SceneNewArgs) -> Result<(), RunError> {
    let (seed, out, terminal) = (args.seed, &args.out, Terminal::new(args.talk));
    match args.triangles {
        Some(count) => new_street(count as usize, seed, args.frames.unwrap_or(4), out, &terminal),
        None => {
            let frames = args.frames.unwrap_or(40) as usize;
            new_world(worlds::WorldKind::ALL[args.kind as usize], seed, frames, out, &terminal)
        }
    }
}
