//! `sightline verify`: the GPU against the CPU reference bit by bit, and the reference against f64.

use std::path::PathBuf;

use crate::internals::verification_text;
use crate::runs::RunError;
use crate::runs::verify::{Verified, VerifyRequest, verify_scenes};
use serde_json::json;

use super::args::{Compute, Conditions, Format, UnnamedModelArgs, whole};
use super::exit::Exit;

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

pub fn run(args: &VerifyArgs) -> Result<Exit, RunError> {
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
