//! `study near-field`, `targets`, `redundancy` and `overlap`: ground, targets and things that placements see.

use std::path::PathBuf;

use super::args::{Compute, UnnamedModelArgs};
use super::output::{Exit, answer};
use crate::internals::{
    near_field_csv, near_field_text, overlap_csv, overlap_text, redundancy_csv, redundancy_text,
    targets_csv, targets_text,
};
use crate::runs::Conditions;
use crate::runs::coverage::{NearFieldRequest, TargetsRequest, near_fields, targets};
use crate::runs::parse::at_least_one;
use crate::runs::sensitivity::{SharedRequest, overlap, redundancy};
use crate::runs::{RunError, TableFormat, Watcher};
use crate::scan::conditions::under;
use crate::shared::{LEAST_SHARED, REDUNDANCY_TARGETS};

#[derive(clap::Args)]
#[command(after_help = "Example:
  sightline study nearfield scenes/highway.json mine.json --out near.svg

near %: ground cells within 10 m of the body with a hit within 0.5 m; poles: seen of all, by standard, at
five beams or more; own body %: beams that end at the own vehicle. docs/nearfield.md has the definitions.")]
pub struct NearFieldArgs {
    #[command(flatten)]
    request: NearFieldRequest,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run_near_field(args: &NearFieldArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let found = near_fields(&args.request, &args.named.computing(&args.compute, &terminal))?;
    answer(
        args.format,
        &found,
        || near_field_csv(&found.near_fields),
        || {
            let (scene, area, frames) = (&found.scene, found.ground_area, found.frames);
            let under = under(&found.conditions);
            outln!("{scene}: {area:.0} m² of ground within 10 m, {frames} frame(s){under}")?;
            out!("{}", near_field_text(&found.near_fields))
        },
    )?;
    found.wrote.iter().for_each(|wrote| terminal.note(wrote));
    Ok(terminal.exit())
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study targets mine.json --vehicle van.json --target child
  sightline study targets scenes/highway.json scenes/placements.json --frames 4 --in 3 --out polar.svg

A beam counts if its closest hit is the target. Without a scene the target stands alone on level ground, with the own
body in the way; in a scene on the ground there, with all that is there in the way. A bearing's range of first
detection is the farthest distance in its list. Presets: child, adult, cyclist, motorcycle, car, tyre, pole, kerb,
pallet, iso3691-4-lying, iso3691-4-standing, iso18497; their dimensions and sources stand in the JSON.")]
pub struct TargetsArgs {
    #[command(flatten)]
    request: TargetsRequest,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
    #[command(flatten)]
    named: UnnamedModelArgs,
    #[command(flatten)]
    compute: Compute,
}

pub fn run_targets(args: &TargetsArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let found = targets(&args.request, &args.named.computing(&args.compute, &terminal))?;
    answer(
        args.format,
        &found,
        || targets_csv(&found.table),
        || {
            let (beams, under) = (found.beams, under(&found.conditions));
            let over = &found.over;
            outln!("Metres at which {beams} beams or more meet a target, {over}{under}")?;
            out!("\n{}", targets_text(&found.table, beams))
        },
    )?;
    found.wrote.iter().for_each(|wrote| terminal.note(wrote));
    Ok(terminal.exit())
}

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
  sightline study redundancy scenes/highway.json mine.json --frames 4
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
  sightline study overlap scenes/highway.json mine.json --frames 4
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
            let (beams, over, under) = (found.beams, &found.over, under(&found.conditions));
            outln!(
                "Seen by how many LiDARs, targets with {beams} beams or more each, {over}{under}"
            )?;
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
            let (over, under) = (&found.over, under(&found.conditions));
            outln!("Surfaces and directions that pairs of LiDARs share, {over}{under}")?;
            out!("\n{}", overlap_text(&found.rows))
        },
    )?;
    Ok(terminal.exit())
}
