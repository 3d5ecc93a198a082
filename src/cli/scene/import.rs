//! `scene import`: scenes of maps in other formats, and of labelled scans.

use std::io::Write;
use std::path::PathBuf;

use crate::datasets::{ImportOptions, Imported, LabelledSequence, read_nuscenes, to_scene};
use crate::internals::{FileError, writable_file, write_whole};
use crate::scene::Scene;
use crate::worlds::{import_opendrive, read_opendrive};

use super::target::Target;
use crate::cli::args::{Talk, finite, whole};
use crate::cli::datasets::DatasetArgs;
use crate::cli::error::Error;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline scene import Town01.xodr --seed 1 --out town01.json
  sightline scene import nuscenes --nuscenes --scene scene-0061 --out scene-0061.json
  sightline scene import scans --carla --poses poses.csv --out drive.json")]
pub struct Args {
    /// OpenDRIVE file (.xodr): its roads and lanes; houses, trees and traffic come from the seed; or the
    /// folder of a data set
    input: PathBuf,
    /// The folder is a set in the layout of nuScenes with lidarseg
    #[arg(long, requires = "scene_name", conflicts_with = "carla")]
    nuscenes: bool,
    /// Scene of the set
    #[arg(long = "scene", value_name = "NAME", requires = "nuscenes")]
    scene_name: Option<String>,
    /// The folder holds scans of CARLA's semantic LiDAR, named by their frames: 000123.ply, .bin or .npy
    #[arg(long, requires = "poses")]
    carla: bool,
    #[command(flatten)]
    datasets: DatasetArgs,
    /// Edge of the cells that the plates and boxes of scans are made of, in metres
    #[arg(long, value_name = "M", default_value_t = ImportOptions::default().cell, value_parser = finite)]
    cell: f64,
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
    let (sets, input) = (&args.datasets, &args.input);
    if args.nuscenes {
        let names: Vec<String> = args.scene_name.iter().cloned().collect();
        let scenes = read_nuscenes(input, sets.version.as_deref(), &names)?;
        return scenes.iter().try_for_each(|scene| of_scans(args, scene));
    }
    if args.carla {
        return of_scans(args, &sets.carla(input, args.talk)?);
    }
    let name = input.to_string_lossy();
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

/// Plates, boxes and actors of labelled scans.
fn of_scans(args: &Args, sequence: &dyn LabelledSequence) -> Result<(), Error> {
    let out = &args.out;
    writable_file(out, args.datasets.poses.as_deref())?;
    let imported = to_scene(sequence, &ImportOptions { cell: args.cell })?;
    let Imported { scene, plates, boxes, actors } = imported;
    let text = serde_json::to_string(&scene)
        .map_err(|source| FileError::Json { path: out.clone(), source })?;
    // A scene that this program would refuse is not written.
    let read = Scene::from_json(&text, out.parent().unwrap_or(out), &out.display().to_string())?;
    write_whole(out, |file| writeln!(file, "{text}").map_err(Error::io(out)))?;
    args.talk.note(format!(
        "{} frames, {plates} plates of ground, {boxes} boxes, {actors} actors in {}",
        read.frame_count(),
        out.display()
    ));
    Ok(())
}
