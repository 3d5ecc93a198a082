//! `sightline study tolerance`: how far each LiDAR may be off until a requirement breaks.

use std::path::PathBuf;

use crate::internals::{room_csv, room_text};
use crate::job::RoomSteps;
use crate::runs::Error;
use crate::runs::room::room;
use crate::scan::conditions::under;

use super::answer::answer;
use super::exit::Exit;
use super::shared::Common;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study tolerance scenes/highway.json mine.json --vehicle van.json
  sightline study tolerance mine.json --vehicle van.json --most-mm 50 --most-deg 2 --steps 20

Each pose field of each LiDAR moves alone, step by step to either side, until a requirement of the vehicle breaks; what
lies between two steps is not looked at. Copies: every LiDAR off at random within a tolerance, 200 times. The exit
code is 1 if a placement misses a requirement as it is.")]
pub struct Args {
    /// Scene files, none for level ground, and a file of placements
    #[arg(value_name = "[SCENE…] PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// Farthest deviation of x, y and z, millimetres
    #[arg(long, value_name = "MM", default_value_t = 100.0, value_parser = millimetres)]
    most_mm: f64,
    /// Farthest deviation of roll, pitch and yaw, degrees
    #[arg(long, value_name = "DEG", default_value_t = 5.0, value_parser = degrees)]
    most_deg: f64,
    /// Deviations up to the farthest one, on each side
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(1..=1000))]
    steps: u32,
    #[command(flatten)]
    common: Common,
}

fn millimetres(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|mm| *mm > 0.0 && *mm <= 10_000.0);
    found.ok_or("give millimetres above 0 and up to 10000".to_owned())
}

fn degrees(text: &str) -> Result<f64, String> {
    let found = text.trim().parse().ok().filter(|degrees| *degrees > 0.0 && *degrees <= 180.0);
    found.ok_or("give degrees above 0 and up to 180".to_owned())
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    let &Args { ref common, most_mm, most_deg, steps, .. } = args;
    let terminal = common.compute.start()?;
    let computing = common.named.computing(&common.compute, &terminal);
    let steps = RoomSteps { most_mm, most_deg, steps };
    let found = room(&common.request(&args.files), steps, &computing)?;
    answer(
        common.format,
        &found,
        || room_csv(&found.rows),
        || {
            let (mm, deg) = (most_mm / f64::from(args.steps), most_deg / f64::from(args.steps));
            let under = under(&found.conditions);
            outln!(
                "Deviations within which all requirements hold, every {mm} mm and {deg}°{under}"
            )?;
            out!("\n{}", room_text(&found.rows))
        },
    )?;
    Ok(match terminal.exit() {
        Exit::Done if !found.all_meet() => Exit::CheckFailed,
        exit => exit,
    })
}
