//! `score` and `view`: scores of placements, and a page about one of them.

use std::path::PathBuf;

use super::args::{Compute, Conditions, FiguresOut, MountingArgs, UnnamedModelArgs, whole};
use super::output::{Exit, stdout, unless_closed};
use crate::internals::word;
use crate::runs::cast::{ViewRequest, view};
use crate::runs::score::{ScoreRequest, score};
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

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline view scenes/urban-crossing.json scenes/placements.json:Pyramid --out view.html
  sightline view scenes/highway.json scenes/residential.json mine.json:roof \
    --baseline mine.json:bumper --out view.html")]
pub struct ViewArgs {
    /// Scene files, and last a file of placements with the name of the one to show behind a colon [default:
    /// its first]
    #[arg(value_name = "SCENE… PLACEMENTS[:NAME]", required = true, num_args = 2..)]
    files: Vec<String>,
    /// Placement to compare with, or a file of them; may be given several times [default: Table 7 of the
    /// paper, where the vehicle is its car: one model, a mount that holds them; else none]
    #[arg(long, value_name = "FILE[:NAME]")]
    baseline: Vec<String>,
    /// Page to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    figures: FiguresOut,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run_view(args: &ViewArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = ViewRequest {
        files: args.files.clone(),
        baselines: args.baseline.clone(),
        out: args.out.clone(),
        figures: args.figures.figures.clone(),
        conditions: args.conditions.condition.clone(),
        command: command(args),
    };
    view(&request, &args.named.computing(&args.compute, &terminal))?;
    Ok(Exit::Done)
}

/// The command that was given, to be copied into a shell in any folder; the page is written anew.
fn command(args: &ViewArgs) -> String {
    let mut words = vec!["sightline".to_owned(), "view".to_owned()];
    // A name behind a colon stays where it is.
    let absolute = |file: &str| match std::path::absolute(file) {
        Ok(path) if file != "-" => path.to_string_lossy().into_owned(),
        _ => file.to_owned(),
    };
    words.extend(args.files.iter().map(|file| word(&absolute(file))));
    let mut give = |option: &str, value: &str| words.extend([format!("--{option}"), word(value)]);
    args.baseline.iter().for_each(|baseline| give("baseline", &absolute(baseline)));
    args.conditions.condition.iter().for_each(|one| give("condition", &one.to_string()));
    args.named.sensor.iter().for_each(|choice| give("sensor", &choice.to_string()));
    args.compute
        .vehicle
        .iter()
        .for_each(|file| give("vehicle", &absolute(&file.to_string_lossy())));
    give("out", &absolute(&args.out.to_string_lossy()));
    words.push("--force".to_owned());
    words.join(" ")
}
