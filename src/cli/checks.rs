//! `audit`, `verify`, `bench` and `devices`: checks of scores, of engines and of devices.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::args::{Compute, Conditions, Format, UnnamedModelArgs, whole};
use super::output::Exit;
use crate::audit::Audit;
use crate::chart::{Chart, ChartSettings};
use crate::engine::gpu::{TestedAdapter, test_adapters};
use crate::internals::{
    align_columns, audit_text, audits_text, chart_text, charts_text, verification_text,
};
use crate::runs::RunError;
use crate::runs::chart::{ChartRequest, Charted, chart_scenes};
use crate::runs::coverage::{AuditRequest, audit_scenes};
use crate::runs::devices::{
    DeviceBenchRequest, Verified, VerifyRequest, bench_device, verify_scenes,
};
use crate::score::Objective;

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline audit scenes/highway.json
  sightline audit scenes/highway.json scenes/residential.json scenes/placements.json")]
pub struct AuditArgs {
    /// Scene files, and placements to start from, which should be sound ones: the best of them is changed so
    /// that it sees less, and no score may rise unnoticed [default: Table 7 of the paper]
    #[arg(value_name = "SCENE… [PLACEMENTS]", required = true)]
    files: Vec<PathBuf>,
    /// Score by which the best placement is chosen, and that is watched while the model changes
    #[arg(long, default_value_t = Objective::default().to_string())]
    objective: String,
    /// Frames to average over, spread evenly over the scene [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run_audit(args: &AuditArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = AuditRequest {
        files: args.files.clone(),
        objective: Some(args.objective.clone()),
        frames: args.frames,
    };
    let mut gap = "";
    let print = |found: &Audit| match args.format {
        Format::Json => Ok(()),
        Format::Text => out!("{}{}", std::mem::replace(&mut gap, "\n"), audit_text(found)),
    };
    let all = audit_scenes(&request, &args.named.computing(&args.compute, &terminal), print)?;
    let passed = all.iter().all(|found| found.passed);
    match (args.format, &all[..]) {
        (Format::Json, [found]) => outln!("{}", json!(found))?,
        (Format::Json, all) => outln!("{}", json!({ "scenes": all, "passed": passed }))?,
        (Format::Text, [_]) => {}
        (Format::Text, all) => out!("{}", audits_text(all))?,
    }
    Ok(if passed { Exit::Done } else { Exit::CheckFailed })
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline verify scenes/highway.json
  sightline verify scenes/highway.json scenes/placements.json --frames 20 --format json
  sightline verify scenes/highway.json --condition snow:rate=2.5 --condition wet:water=1.2")]
pub struct VerifyArgs {
    /// Scene files, and placements [default: Table 7 of the paper, random ones from the mount, and hostile
    /// ones]
    #[arg(value_name = "SCENE… [PLACEMENTS]", required = true)]
    files: Vec<PathBuf>,
    /// Frames to compare, spread evenly over the scene
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Random placements [default: 200]
    #[arg(long, value_name = "N", value_parser = whole::<usize>)]
    random: Option<usize>,
    /// Hostile placements: on voxel faces, along axes, in solids, underground, far away [default: 50]
    #[arg(long, value_name = "N", value_parser = whole::<usize>)]
    hostile: Option<usize>,
    /// Beams of the CPU reference that are compared with brute force in f64
    #[arg(long, value_name = "N", default_value_t = 20_000, value_parser = whole::<u64>)]
    sample: u64,
    /// Seed of the random placements and of the sample
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = whole::<u64>)]
    seed: u64,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// The same as --format json
    #[arg(long, conflicts_with = "format")]
    json: bool,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run_verify(args: &VerifyArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let request = VerifyRequest {
        files: args.files.clone(),
        frames: args.frames,
        random: args.random,
        hostile: args.hostile,
        sample: args.sample,
        seed: args.seed,
        conditions: args.conditions.condition.clone(),
    };
    let format = if args.json { Format::Json } else { args.format };
    let print = |one: &Verified| match format {
        Format::Json => Ok(()),
        Format::Text => out!("{}", verification_text(&one.scene, &one.conditions, &one.found)),
    };
    let all = verify_scenes(&request, &args.named.computing(&args.compute, &terminal), print)?;
    let passed = all.iter().all(|one| one.found.passed);
    match (format, &all[..]) {
        (Format::Json, [one]) => outln!("{}", json!(one))?,
        (Format::Json, all) => outln!("{}", json!({ "scenes": all, "passed": passed }))?,
        (Format::Text, _) => {}
    }
    Ok(if passed { Exit::Done } else { Exit::CheckFailed })
}

#[derive(clap::Subcommand)]
pub enum BenchCommand {
    /// Measure a Vulkan device: self-test, bits beside the CPU's, placements a second
    #[command(after_help = "Example:
  sightline bench device scenes/highway.json scenes/residential.json > device.md")]
    Device(DeviceArgs),
}

#[derive(clap::Args)]
pub struct DeviceArgs {
    /// Scene files
    #[arg(value_name = "SCENE", required = true)]
    scenes: Vec<PathBuf>,
    /// Numbers of placements that are scored at once
    #[arg(long, value_name = "N,…", value_delimiter = ',', default_value = "12,256,4096",
        value_parser = clap::value_parser!(u32).range(1..=100_000))]
    placements: Vec<u32>,
    /// Frames of each scene, spread evenly over it
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    frames: u32,
    /// Rounds in which device and CPU take turns; the median counts
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// How to print: text is a block of Markdown
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run_bench(command: &BenchCommand) -> Result<Exit, RunError> {
    let BenchCommand::Device(args) = command;
    let terminal = args.compute.start()?;
    let request = DeviceBenchRequest {
        scenes: args.scenes.clone(),
        placements: args.placements.iter().map(|&count| count as usize).collect(),
        frames: args.frames,
        rounds: args.rounds as usize,
    };
    let found = bench_device(&request, &args.named.computing(&args.compute, &terminal))?;
    match args.format {
        Format::Json => outln!("{}", serde_json::json!(found))?,
        Format::Text => out!("{found}")?,
    }
    Ok(if found.passed() { Exit::Done } else { Exit::CheckFailed })
}

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline devices")]
pub struct DevicesArgs {
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

pub fn run_devices(args: &DevicesArgs) -> Result<Exit, RunError> {
    let adapters = test_adapters();
    match args.format {
        Format::Json => outln!("{}", serde_json::json!({ "devices": adapters }))?,
        Format::Text if adapters.is_empty() => {
            outln!("no Vulkan device: --backend auto computes on the CPU")?;
        }
        Format::Text => {
            let titles = [
                "device",
                "kind",
                "driver",
                "max binding",
                "max workgroup",
                "self-test",
                "product + sum",
                "division",
                "denormals",
                "auto",
            ];
            let mut rows = vec![titles.map(str::to_owned).to_vec()];
            rows.extend(adapters.iter().map(device_row));
            out!("{}", align_columns(&rows))?;
            for TestedAdapter { summary, refused, .. } in &adapters {
                if let Some(why) = refused {
                    let name = &summary.name;
                    outln!("{name} is not used: {why}; --inexact takes it all the same")?;
                }
            }
            if !adapters.iter().any(|a| a.summary.auto) {
                outln!("no hardware that passed: --backend auto computes on the CPU")?;
            }
        }
    }
    Ok(Exit::Done)
}

fn device_row(TestedAdapter { summary, self_test, .. }: &TestedAdapter) -> Vec<String> {
    let arithmetic = match self_test {
        None => ["not run", "", "", ""],
        Some(test) => test.words(),
    };
    let auto = if summary.auto { "yes" } else { "" };
    let mut row = vec![
        summary.name.clone(),
        summary.kind.to_owned(),
        format!("{} {}", summary.driver, summary.driver_info),
        format!("{} MiB", summary.max_binding >> 20),
        summary.max_workgroup.to_string(),
    ];
    row.extend(arithmetic.into_iter().chain([auto]).map(str::to_owned));
    row
}

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

pub fn run_chart(args: &ChartArgs) -> Result<Exit, RunError> {
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
