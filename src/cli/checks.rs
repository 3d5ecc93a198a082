//! `audit`, `verify`, `bench` and `devices`: checks of scores, of engines and of devices.

use std::path::PathBuf;

use serde_json::json;

use super::args::{Compute, Conditions, Format, UnnamedModelArgs, whole};
use super::output::Exit;
use crate::audit::Audit;
use crate::engine::gpu::{TestedAdapter, test_adapters};
use crate::internals::{align_columns, audit_text, audits_text, verification_text};
use crate::runs::RunError;
use crate::runs::audit::{AuditRequest, audit_scenes};
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
