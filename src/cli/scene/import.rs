//! `scene import`: scenes of maps in other formats, and of labelled scans.

use std::path::PathBuf;

use crate::datasets::ImportOptions;
use crate::runs::RunError;
use crate::runs::scene::{Origin, import};

use crate::cli::args::{finite, whole};
use crate::cli::datasets::DatasetArgs;
use crate::cli::terminal::{Talk, Terminal};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scene import Town01.xodr --seed 1 --out town01.json
  sightline scene import nuscenes --nuscenes --scene scene-0061 --out scene-0061.json
  sightline scene import scans --carla --poses poses.csv --out drive.json")]
pub struct SceneImportArgs {
    /// OpenDRIVE file (.xodr): its roads and lanes; houses, trees and traffic come from the seed; or the
    /// folder of a data set
    input: PathBuf,
    /// The folder is a set in the layout of nuScenes with lidarseg
    #[arg(long, requires = "scene_name", group = "scans")]
    nuscenes: bool,
    /// Scene of the set
    #[arg(long = "scene", value_name = "NAME", requires = "nuscenes")]
    scene_name: Option<String>,
    /// The folder holds scans of CARLA's semantic LiDAR, named by their frames: 000123.ply, .bin or .npy
    #[arg(long, requires = "poses", group = "scans")]
    carla: bool,
    #[command(flatten)]
    datasets: DatasetArgs,
    /// Edge of the cells that the plates and boxes of scans are made of, in metres [default: 0.4]
    #[arg(long, value_name = "M", value_parser = finite)]
    cell: Option<f64>,
    /// Seed of all that the map does not say
    #[arg(long, value_name = "N", conflicts_with = "scans", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// Frames that a map's scene has, a tenth of a second apart
    #[arg(long, value_name = "N", conflicts_with = "scans", default_value_t = 40,
          value_parser = clap::value_parser!(u32).range(1..=1000))]
    frames: u32,
    /// Scene file to write; the mesh stands beside it, with the ending .ply
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    talk: Talk,
}

pub fn run(args: &SceneImportArgs) -> Result<(), RunError> {
    if let (false, false, Some(cell)) = (args.nuscenes, args.carla, args.cell) {
        let words = format!("--cell {cell}: is for --nuscenes and --carla; leave it out");
        return Err(RunError::Usage(words));
    }
    if let (false, Some(height)) = (args.carla, args.datasets.lidar_height) {
        return Err(RunError::Usage(format!(
            "--lidar-height {height}: is for --carla; leave it out"
        )));
    }
    let (input, cell) = (args.input.clone(), args.cell.unwrap_or(ImportOptions::default().cell));
    let origin = match (args.nuscenes, args.carla) {
        (true, _) => Origin::Nuscenes {
            folder: input,
            version: args.datasets.version.clone(),
            scenes: args.scene_name.iter().cloned().collect(),
            cell,
        },
        (false, true) => Origin::Carla(args.datasets.carla(&input), cell),
        (false, false) => {
            Origin::OpenDrive { file: input, seed: args.seed, frames: args.frames as usize }
        }
    };
    import(&origin, &args.out, &Terminal::new(args.talk))
}
