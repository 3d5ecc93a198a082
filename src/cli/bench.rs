//! `sightline bench`: measurements for the tables of the documentation.

use std::path::PathBuf;

use super::args::{Compute, Format, UnnamedModelArgs};
use super::exit::Exit;
use crate::runs::RunError;
use crate::runs::bench::{DeviceBenchRequest, bench_device};

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

pub fn run(command: &BenchCommand) -> Result<Exit, RunError> {
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
