//! `view`: the page of `optimize` about a placement that was not searched for.

use std::path::PathBuf;

use crate::internals::word;
use crate::runs::RunError;
use crate::runs::view::{ViewRequest, view};

use super::args::{Compute, Conditions, FiguresOut, UnnamedModelArgs};
use super::exit::Exit;

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

pub fn run(args: &ViewArgs) -> Result<Exit, RunError> {
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
