//! `sightline study sweep`: one pose field of one LiDAR moved through a range.

use std::path::PathBuf;

use crate::internals::{sweep_csv, sweep_text};
use crate::runs::RunError;
use crate::runs::sweep::{MOST_VALUES, SweepRequest, sweep};
use crate::scan::conditions::under;

use super::answer::answer;
use super::args::FiguresOut;
use super::exit::Exit;
use super::shared::CommonArgs;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study sweep scenes/highway.json mine.json --of 0.pitch --from -10 --to 20
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

pub fn run(args: &SweepArgs) -> Result<Exit, RunError> {
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
            outln!("Scores and requirements over one pose field{}", under(&found.conditions))?;
            out!("\n{}", sweep_text(&found.sweeps))
        },
    )?;
    Ok(terminal.exit())
}
