//! `score`: scores of a batch of placements, written as they are computed.

use std::path::PathBuf;

use crate::runs::score::{ScoreRequest, score};

use super::args::{Compute, Conditions, MountingArgs, UnnamedModelArgs, whole};
use super::exit::Exit;
use super::output::{stdout, unless_closed};
use crate::runs::{RunError, TableFormat};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline score scenes/highway.json scenes/placements.json
  sightline score scenes/highway.json million.jsonl --format json --out scores.json
  sightline score scenes/highway.json scenes/residential.json scenes/placements.json")]
pub struct ScoreArgs {
    /// Scene files, and placements: a .json document, or a .jsonl file with one placement a line, read as a
    /// stream; - is stdin. Several scenes share one LiDAR and mount, and get the mean beside each
    #[arg(value_name = "SCENE… PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// How to print
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
    /// Write the scores to this file instead of stdout
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Go on with the scores of an interrupted run, which stand in FILE.partial beside the file of --out
    #[arg(long, requires = "out")]
    resume: bool,
    /// Write the covered voxels of each placement to DIR/NAME.npy: u64 linear indices, rising; with
    /// several frames, voxels covered in at least one; of several scenes DIR/SCENE/NAME.npy
    #[arg(long, value_name = "DIR")]
    coverage_out: Option<PathBuf>,
    /// Average over this many frames, spread evenly over each scene [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// Score the near field, too: the share of the ground within 10 m, and within 3 m, of the own body with a hit close
    /// by; takes casts of its own
    #[arg(long)]
    near_field: bool,
    /// Draw of what is left to chance, of free phases and of the beams that come back through weather; the mean
    /// over several is the expectation; one scene
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = whole::<u64>)]
    draw: u64,
    #[command(flatten)]
    mounting: MountingArgs,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &ScoreArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = ScoreRequest {
        files: args.files.clone(),
        format: args.format,
        out: args.out.clone(),
        coverage_out: args.coverage_out.clone(),
        resume: args.resume,
        frames: args.frames,
        near_field: args.near_field,
        draw: args.draw,
        tolerance: args.mounting.tolerance,
        conditions: args.conditions.condition.clone(),
    };
    let computing = args.named.computing(&args.compute, &terminal);
    unless_closed(score(&request, &computing, &mut stdout()))?;
    Ok(terminal.exit())
}
