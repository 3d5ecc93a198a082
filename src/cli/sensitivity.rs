//! `study sweep` and `tolerance`: scores along one field of a placement, and under errors of mounting.

use std::path::PathBuf;

use super::coverage::CommonArgs;
use super::output::{Exit, answer};
use crate::internals::{room_csv, room_text, sweep_csv, sweep_text};
use crate::job::{MOST_ABOUT, MOST_TILT, RoomSteps};
use crate::runs::FiguresOut;
use crate::runs::sensitivity::{MOST_VALUES, SweepRequest, room, sweep};
use crate::runs::{RunError, Watcher};
use crate::scan::conditions::under;

#[derive(clap::Args)]
#[command(override_usage = "sightline study sweep [OPTIONS] --of <LIDAR.FIELD> --from <V> --to <V>
                             <[SCENE…] PLACEMENTS>...")]
#[command(after_help = "Examples:
  sightline study sweep mine.json --vehicle van.json --of 0.z --from 2 --to 3
  sightline study sweep scenes/highway.json mine.json --of roof.z --from 1.8 --to 2.4 --values 13 --out z.svg

LIDAR is the number of a LiDAR in the placement, from 0, or the name of a mount or model that one LiDAR has. Angles are
in degrees, positive pitch looks down. The first row is the placement as given. Car lost: degrees of bearings in which
fewer than five beams meet a car somewhere between 5 and 50 m.")]
pub struct SweepArgs {
    /// Scene files, none for level ground, and a file of placements
    #[arg(value_name = "[SCENE…] PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// Field to move: x, y, z in metres, roll, pitch, yaw in degrees
    #[arg(long = "of", value_name = "LIDAR.FIELD")]
    field: String,
    /// First value
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    from: f64,
    /// Last value
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    to: f64,
    /// Values from the first to the last
    #[arg(long, value_name = "N", default_value_t = 16,
          value_parser = clap::value_parser!(u32).range(2..=i64::from(MOST_VALUES)))]
    values: u32,
    /// Draw scores and requirements over the values into this SVG file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    figures: FiguresOut,
    #[command(flatten)]
    common: CommonArgs,
}

pub fn run_sweep(args: &SweepArgs) -> Result<Exit, RunError> {
    let common = &args.common;
    let terminal = common.compute.start()?;
    let request = SweepRequest {
        shared: common.request(&args.files),
        field: args.field.clone(),
        from: args.from,
        to: args.to,
        values: args.values,
        out: args.out.clone(),
        figures: args.figures.figures.clone(),
    };
    let found = sweep(&request, &common.named.computing(&common.compute, &terminal))?;
    answer(
        common.format,
        &found,
        || sweep_csv(&found.sweeps),
        || {
            let (over, under) = (&found.over, under(&found.conditions));
            outln!("Scores and requirements by one pose field, {over}{under}")?;
            out!("\n{}", sweep_text(&found.sweeps))
        },
    )?;
    found.wrote.iter().for_each(|wrote| terminal.note(wrote));
    Ok(terminal.exit())
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study tolerance scenes/highway.json mine.json --vehicle van.json
  sightline study tolerance mine.json --vehicle van.json --most-mm 50 --most-deg 2 --steps 20
  sightline study tolerance mine.json --vehicle van.json --most-tilt 2 --tilt-about 1.5,0

Each pose field of each LiDAR moves alone, step by step to either side, until a requirement of the vehicle breaks; what
lies between two steps is not looked at. Tilt: all LiDARs turn together, as under load or braking, towards eight
directions, about a point of the ground z = 0 of the ego frame: give the one below the middle of the wheelbase. The
scene and the own body stay as they are. Copies: every LiDAR off at random within a tolerance, 200 times. The exit
code is 1 if a placement misses a requirement as it is.")]
pub struct RoomArgs {
    /// Scene files, none for level ground, and a file of placements
    #[arg(value_name = "[SCENE…] PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// Farthest deviation of x, y and z, millimetres
    #[arg(long, value_name = "MM", default_value_t = 100.0, value_parser = millimetres)]
    most_mm: f64,
    /// Farthest deviation of roll, pitch and yaw, degrees
    #[arg(long, value_name = "DEG", default_value_t = 5.0, value_parser = degrees)]
    most_deg: f64,
    /// Farthest tilt of the body, degrees
    #[arg(long = "most-tilt", value_name = "DEG", default_value_t = 3.0, value_parser = tilt)]
    most_tilt_deg: f64,
    /// Point of the ground about which the body tilts, metres of the ego frame
    #[arg(long, value_name = "X,Y", default_value = "0,0", value_parser = about, allow_hyphen_values = true)]
    tilt_about: [f64; 2],
    /// Deviations up to the farthest one, on each side
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000))]
    steps: u32,
    #[command(flatten)]
    common: CommonArgs,
}

fn millimetres(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|mm| *mm > 0.0 && *mm <= 10_000.0);
    found.ok_or("give millimetres above 0 and up to 10000".to_owned())
}

fn degrees(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|degrees| *degrees > 0.0 && *degrees <= 180.0);
    found.ok_or("give degrees above 0 and up to 180".to_owned())
}

fn tilt(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|degrees| *degrees > 0.0 && *degrees <= MOST_TILT);
    found.ok_or(format!("give degrees above 0 and up to {MOST_TILT}"))
}

fn about(text: &str) -> Result<[f64; 2], String> {
    let metres = |text: &str| text.trim().parse::<f64>().ok().filter(|m| m.abs() <= MOST_ABOUT);
    let found = text.split_once(',').and_then(|(x, y)| Some([metres(x)?, metres(y)?]));
    found.ok_or(format!("give x,y in metres within ±{MOST_ABOUT}, as 1.5,0"))
}

pub fn run_room(args: &RoomArgs) -> Result<Exit, RunError> {
    let &RoomArgs { ref common, most_mm, most_deg, most_tilt_deg, tilt_about, steps, .. } = args;
    let terminal = common.compute.start()?;
    let computing = common.named.computing(&common.compute, &terminal);
    let steps = RoomSteps { most_mm, most_deg, most_tilt_deg, tilt_about, steps };
    let found = room(&common.request(&args.files), steps, &computing)?;
    answer(
        common.format,
        &found,
        || room_csv(&found.rows),
        || {
            // Thousandths are enough for people.
            let each = |most: f64| (1e3 * most / f64::from(args.steps)).round() / 1e3;
            let (mm, deg, tilt) = (each(most_mm), each(most_deg), each(most_tilt_deg));
            let (over, under) = (&found.over, under(&found.conditions));
            outln!(
                "Deviations within which all requirements hold, every {mm} mm and {deg}°, tilt every {tilt}°, {over}{under}"
            )?;
            out!("\n{}", room_text(&found.rows))
        },
    )?;
    Ok(match terminal.exit() {
        Exit::Done if !found.all_meet() => Exit::CheckFailed,
        exit => exit,
    })
}
