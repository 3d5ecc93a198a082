//! `sightline study redundancy` and `study overlap`: things that several LiDARs see, and surfaces that pairs share.

use std::path::PathBuf;

use crate::internals::{overlap_csv, overlap_text, redundancy_csv, redundancy_text};
use crate::runs::shared::{SharedRequest, overlap, redundancy};
use crate::runs::{RunError, TableFormat};
use crate::scan::conditions::under;
use crate::shared::{LEAST_SHARED, REDUNDANCY_TARGETS};

use super::answer::answer;
use super::args::{Compute, Conditions, UnnamedModelArgs, at_least_one};
use super::exit::Exit;

/// Frames, weather, engine and form of the answer.
#[derive(clap::Args)]
pub(super) struct CommonArgs {
    /// Average over this many frames, spread evenly over each scene [default: all]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    pub format: TableFormat,
    #[command(flatten)]
    conditions: Conditions,
    #[command(flatten)]
    pub named: UnnamedModelArgs,
    #[command(flatten)]
    pub compute: Compute,
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study redundancy scenes/highway.json scenes/placements.json --frames 4
  sightline study redundancy scenes/placements.json --vehicle scenes/vehicles/car.json --target car

A LiDAR sees a voxel that its beams cover, ground with a hit within 0.5 m, and a target that five of its beams meet, at
5 to 50 m in sixteen bearings on level ground. Where the LiDARs are of several models, MODEL alone: no other model sees
it. A vehicle with other_sensors (cameras, radars) adds a table of technologies, and of things blind to all.
docs/targets.md has the definitions.")]
pub struct RedundancyArgs {
    /// Scene files, none for level ground, and a file of placements
    #[arg(value_name = "[SCENE…] PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// Target: a preset, or a file { "sightline": 1, "name", "shapes", "reflectance" }; may be given several
    /// times [default: car, adult, child, tyre]
    #[arg(long = "target", value_name = "NAME|FILE")]
    targets: Vec<String>,
    #[command(flatten)]
    common: CommonArgs,
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study overlap scenes/urban-crossing.json scenes/placements.json --frames 4
  sightline study overlap scenes/highway.json mine.json --least-shared 200 --format json

Surface voxels in which both LiDARs have a hit, a mean over frames; on the diagonal the voxels of one LiDAR. Overlap:
shared voxels as a share of the voxels of the LiDAR with fewer; a vehicle may require it (`require`). % of the
sphere: directions in both fields of view. A rig is connected if pairs that share enough voxels lead from each LiDAR to
every other one. docs/targets.md has the definitions.")]
pub struct OverlapArgs {
    /// Scene files, and a file of placements with two LiDARs or more each
    #[arg(value_name = "SCENE… PLACEMENTS", required = true)]
    files: Vec<PathBuf>,
    /// Least surface voxels that a pair must share to count, a mean over frames
    #[arg(long, value_name = "N", default_value_t = LEAST_SHARED, value_parser = at_least_one)]
    least_shared: u64,
    #[command(flatten)]
    common: CommonArgs,
}

impl CommonArgs {
    pub fn request(&self, files: &[PathBuf]) -> SharedRequest {
        let conditions = self.conditions.condition.clone();
        SharedRequest { files: files.to_vec(), frames: self.frames, conditions }
    }
}

pub fn run_redundancy(args: &RedundancyArgs) -> Result<Exit, RunError> {
    let common = &args.common;
    let terminal = common.compute.start()?;
    let targets = match &args.targets[..] {
        [] => REDUNDANCY_TARGETS.map(str::to_owned).to_vec(),
        given => given.to_vec(),
    };
    let computing = common.named.computing(&common.compute, &terminal);
    let found = redundancy(&common.request(&args.files), &targets, &computing)?;
    let rows: Vec<_> = found.rows.iter().chain(&found.mean).collect();
    answer(
        common.format,
        &found,
        || redundancy_csv(&rows),
        || {
            let (beams, under) = (found.beams, under(&found.conditions));
            outln!("Seen by how many LiDARs, targets with {beams} beams or more each{under}")?;
            out!("\n{}", redundancy_text(&rows))
        },
    )?;
    Ok(terminal.exit())
}

pub fn run_overlap(args: &OverlapArgs) -> Result<Exit, RunError> {
    let common = &args.common;
    let terminal = common.compute.start()?;
    let computing = common.named.computing(&common.compute, &terminal);
    let found = overlap(&common.request(&args.files), args.least_shared, &computing)?;
    answer(
        common.format,
        &found,
        || overlap_csv(&found.rows),
        || {
            outln!(
                "Surfaces and directions that pairs of LiDARs share{}",
                under(&found.conditions)
            )?;
            out!("\n{}", overlap_text(&found.rows))
        },
    )?;
    Ok(terminal.exit())
}
