//! `sightline study targets`: beams on targets at range, and the range of first detection.

use std::path::PathBuf;

use crate::internals::{targets_csv, targets_text};
use crate::runs::targets::{TargetsRequest, targets};
use crate::runs::{RunError, TableFormat};
use crate::scan::conditions::under;
use crate::targets::{is_bearing, is_distance};

use super::answer::answer;
use super::args::{Compute, Conditions, FiguresOut, UnnamedModelArgs};
use super::exit::Exit;

/// Targets of a study that names none.
const TARGETS: [&str; 5] = ["child", "adult", "cyclist", "car", "tyre"];

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study targets scenes/placements.json --vehicle scenes/vehicles/car.json --target child --target car
  sightline study targets scenes/highway.json scenes/placements.json --frames 4 --in 3 --out polar.svg

A beam counts if its closest hit is the target. Without a scene the target stands alone on level ground, with the own
body in the way; in a scene on the ground there, with all that is there in the way. A bearing's range of first
detection is the farthest distance in its list. Presets: child, adult, cyclist, motorcycle, car, tyre, pole, kerb,
pallet, iso3691-4-lying, iso3691-4-standing, iso18497; their dimensions and sources stand in the JSON.")]
pub struct TargetsArgs {
    /// Scene files, none for level ground, and a file of placements
    #[arg(value_name = "[SCENE…] PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// Target: a preset, or a file { "sightline": 1, "name", "shapes", "reflectance" }; may be given several
    /// times [default: child, adult, cyclist, car, tyre]
    #[arg(long = "target", value_name = "NAME|FILE")]
    targets: Vec<String>,
    /// Metres from the vehicle's origin to the middle of the target, separated by commas [default: 5 to 100]
    #[arg(long, value_name = "M,…", value_delimiter = ',', value_parser = distance)]
    distances: Vec<f64>,
    /// Degrees counter-clockwise from straight ahead, separated by commas [default: sixteen all round]
    #[arg(long, value_name = "DEG,…", value_delimiter = ',', value_parser = bearing)]
    bearings: Vec<f64>,
    /// Beams from which on a target is detected in a frame
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    beams: u32,
    /// Frames to look at in each scene, spread evenly
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Frames in which the target must be detected [default: all]
    #[arg(long = "in", value_name = "M", value_parser = clap::value_parser!(u32).range(1..))]
    of_frames: Option<u32>,
    /// Count only beams of which the sensor sees enough light: by the target's reflectance and the sensor's response
    #[arg(long)]
    response: bool,
    /// Draw the distances of detection by bearing into this SVG file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
    #[command(flatten)]
    figures: FiguresOut,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

/// Distances of a study that names none: every 5 m to 60 m, then every 10 m.
fn usual_distances() -> Vec<f64> {
    (1..=12).map(|k| 5.0 * f64::from(k)).chain((7..=10).map(|k| 10.0 * f64::from(k))).collect()
}

fn distance(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|metres| is_distance(*metres));
    found.ok_or("give metres above 0 and up to 1000, as 10,20,30".to_owned())
}

fn bearing(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|degrees| is_bearing(*degrees));
    found.ok_or("give degrees from -360 to 360, as 0,90,180".to_owned())
}

pub fn run(args: &TargetsArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let or = |given: &[f64], usual: Vec<f64>| if given.is_empty() { usual } else { given.to_vec() };
    let targets_of = match &args.targets[..] {
        [] => TARGETS.map(str::to_owned).to_vec(),
        given => given.to_vec(),
    };
    let request = TargetsRequest {
        files: args.files.clone(),
        targets: targets_of,
        distances: or(&args.distances, usual_distances()),
        bearings: or(&args.bearings, (0..16).map(|k| 22.5 * f64::from(k)).collect()),
        beams: args.beams,
        frames: args.frames,
        of_frames: args.of_frames,
        response: args.response,
        conditions: args.conditions.condition.clone(),
        out: args.out.clone(),
        figures: args.figures.figures.clone(),
    };
    let found = targets(&request, &args.named.computing(&args.compute, &terminal))?;
    answer(
        args.format,
        &found,
        || targets_csv(&found.table),
        || {
            let (beams, under) = (found.beams, under(&found.conditions));
            outln!("Metres at which {beams} beams or more meet a target{under}")?;
            out!("\n{}", targets_text(&found.table))
        },
    )?;
    Ok(terminal.exit())
}
