//! `sightline chart`: cost against accuracy, and the cheapest setting that keeps the ranking.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::args::{Compute, Format, UnnamedModelArgs, whole};
use super::output::Exit;
use crate::chart::{Chart, ChartSettings};
use crate::internals::{chart_text, charts_text};
use crate::runs::RunError;
use crate::runs::chart::{ChartRequest, Charted, chart_scenes};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline chart scenes/urban-crossing.json --out runs/chart
  sightline chart scenes/highway.json --full --objective information_gain
  sightline chart scenes/highway.json scenes/residential.json --quick
  sightline chart --resume runs/chart")]
pub struct ChartArgs {
    /// Scene files, and placements to rank together with random ones [default: Table 7 of the paper]
    #[arg(
        value_name = "SCENE… [PLACEMENTS]",
        required_unless_present = "resume",
        conflicts_with = "resume"
    )]
    files: Vec<PathBuf>,
    /// Folder for chart.svg, chart.csv and chart.json, of several scenes one in it for each
    /// [default: runs/SCENE-chart, numbered if it is taken]
    #[arg(long, value_name = "DIR", conflicts_with = "resume")]
    out: Option<PathBuf>,
    /// Go on with an interrupted run; settings that were measured are kept
    #[arg(long, value_name = "DIR")]
    resume: Option<PathBuf>,
    /// Score that ranks the placements, or a weighted sum of several
    #[arg(long, default_value_t = ChartSettings::default().objective.to_string(),
          conflicts_with = "resume")]
    objective: String,
    /// Random placements within the mount, ranked together with the given ones
    #[arg(long = "placements", value_name = "N", default_value_t = 100, conflicts_with = "resume",
          value_parser = clap::value_parser!(u32).range(0..=2_000))]
    random: u32,
    /// How much worse than the best placement that of a coarser setting may be, as a share of the score;
    /// pairs of placements farther apart than that must keep their order, 19 of 20 of them
    #[arg(long, value_name = "SHARE", default_value_t = 0.01, value_parser = share)]
    tolerance: f64,
    /// Edge of the finest voxels in metres, which all other settings are compared with
    /// [default: half of the scene's, where that is 0.1 or more]
    #[arg(long, value_name = "METRES", conflicts_with = "resume", value_parser = metres)]
    finest: Option<f64>,
    /// No voxels finer than those of each scene
    #[arg(long, conflicts_with_all = ["resume", "finest"])]
    quick: bool,
    /// Measure every setting with all placements, also those that cannot be the advice, and print them all
    #[arg(long, conflicts_with = "resume")]
    full: bool,
    /// Seed of the random placements and of the bootstrap
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>, conflicts_with = "resume")]
    seed: u64,
    /// How to print the result
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

fn share(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number, as in 0.01".to_owned())?;
    if (0.0..=1.0).contains(&value) { Ok(value) } else { Err("give 0 to 1, as in 0.01".into()) }
}

fn metres(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "write a number, as in 0.1".to_owned())?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err("give metres above 0".into()) }
}

pub fn run(args: &ChartArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = ChartRequest {
        files: args.files.clone(),
        out: args.out.clone(),
        resume: args.resume.clone(),
        objective: args.objective.clone(),
        random: args.random,
        tolerance: args.tolerance,
        finest: args.finest,
        quick: args.quick,
        full: args.full,
        seed: args.seed,
    };
    let mut gap = "";
    let print = |found: &Charted| match args.format {
        Format::Json => Ok(()),
        Format::Text => {
            let svg = found.folder.join("chart.svg");
            let gap = std::mem::replace(&mut gap, "\n");
            outln!("{gap}{}chart: {}", chart_text(&found.chart), svg.display())
        }
    };
    let (count, found) =
        chart_scenes(&request, &args.named.computing(&args.compute, &terminal), print)?;
    let (charts, answers): (Vec<Chart>, Vec<Value>) =
        found.into_iter().map(|found| (found.chart, found.answer)).unzip();
    match (args.format, &answers[..]) {
        (Format::Json, [answer]) if count == 1 => outln!("{answer}")?,
        (Format::Json, answers) => outln!("{}", json!({ "scenes": answers }))?,
        (Format::Text, [_]) => {}
        (Format::Text, _) => out!("{}", charts_text(&charts))?,
    }
    let is_finished = charts.len() == count && charts.iter().all(|chart| chart.missing == 0);
    Ok(if is_finished { Exit::Done } else { Exit::Interrupted })
}
