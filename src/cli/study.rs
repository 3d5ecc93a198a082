//! `sightline study`: questions that take many runs.

use std::path::Path;

use serde_json::json;

use super::answers;
use super::args::Compute;
use super::output::Exit;
use crate::report::tables::studies_csv;
use crate::report::text::study_text;
use crate::runs::study::{StudyRequest, study_scenes};
use crate::runs::{RunError, TableFormat, Watcher};
use crate::study::{Table, mean_over_scenes};

/// A study of one table is a command of its own; all others name their kind.
pub(super) enum StudyCommand {
    Make(Box<StudyArgs>),
    OneTable(Box<OneTable>),
}

#[derive(clap::Subcommand)]
pub(super) enum OneTable {
    /// Ground and poles near the vehicle: seen, blind, own body
    #[command(name = "nearfield")]
    #[command(after_help = "Example:
  sightline study nearfield scenes/highway.json mine.json --out near.svg

near %: ground cells within 10 m of the body with a hit within 0.5 m; poles: seen of all, by standard, at
five beams or more; own body %: beams that end at the own vehicle. docs/nearfield.md has the definitions.")]
    NearField(answers::NearFieldArgs),
    /// Targets at range: beams on a car, a child, a tyre
    #[command(after_help = "Examples:
  sightline study targets mine.json --vehicle van.json --target child
  sightline study targets scenes/highway.json scenes/placements.json --frames 4 --in 3 --out polar.svg

A beam counts if its closest hit is the target. Without a scene the target stands alone on level ground, with the own
body in the way; in a scene on the ground there, with all that is there in the way. A bearing's range of first
detection is the farthest distance in its list. Presets: child, adult, cyclist, motorcycle, car, tyre, pole, kerb,
pallet, iso3691-4-lying, iso3691-4-standing, iso18497; their dimensions and sources stand in the JSON.")]
    Targets(answers::TargetsArgs),
    /// Ground, targets and voxels by the number of LiDARs that see them
    #[command(after_help = "Examples:
  sightline study redundancy scenes/highway.json mine.json --frames 4
  sightline study redundancy scenes/placements.json --vehicle scenes/vehicles/car.json --target car

A LiDAR sees a voxel that its beams cover, ground with a hit within 0.5 m, and a target that five of its beams meet, at
5 to 50 m in sixteen bearings on level ground. Where the LiDARs are of several models, MODEL alone: no other model sees
it. A vehicle with other_sensors (cameras, radars) adds a table of technologies, and of things blind to all.
docs/redundancy.md has the definitions.")]
    Redundancy(answers::RedundancyArgs),
    /// Overlap of each pair of LiDARs, for calibration
    #[command(after_help = "Examples:
  sightline study overlap scenes/highway.json mine.json --frames 4
  sightline study overlap scenes/highway.json mine.json --least-shared 200 --format json

Surface voxels in which both LiDARs have a hit, a mean over frames; on the diagonal the voxels of one LiDAR. Overlap:
shared voxels as a share of the voxels of the LiDAR with fewer; a vehicle may require it (`require`). % of the
sphere: directions in both fields of view. A rig is connected if pairs that share enough voxels lead from each LiDAR to
every other one. docs/redundancy.md has the definitions.")]
    Overlap(answers::OverlapArgs),
    /// One pose field of one LiDAR moved through a range
    #[command(
        override_usage = "sightline study sweep [OPTIONS] --of <LIDAR.FIELD> --from <V> --to <V>
                             <[SCENE…] PLACEMENTS>..."
    )]
    #[command(after_help = "Examples:
  sightline study sweep mine.json --vehicle van.json --of 0.z --from 2 --to 3
  sightline study sweep scenes/highway.json mine.json --of roof.z --from 1.8 --to 2.4 --values 13 --out z.svg

LIDAR is the number of a LiDAR in the placement, from 0, or the name of a mount or model that one LiDAR has. Angles are
in degrees, positive pitch looks down. The first row is the placement as given. Car lost: degrees of bearings in which
fewer than five beams meet a car somewhere between 5 and 50 m, or up to the longest range of the sensors.")]
    Sweep(answers::SweepArgs),
    /// How far each LiDAR may be off until a requirement breaks
    #[command(name = "tolerance")]
    #[command(after_help = "Examples:
  sightline study tolerance scenes/highway.json mine.json --vehicle van.json
  sightline study tolerance mine.json --vehicle van.json --most-mm 50 --most-deg 2 --steps 20
  sightline study tolerance mine.json --vehicle van.json --most-tilt 2 --tilt-about 1.5,0

Each pose field of each LiDAR moves alone, step by step to either side, until a requirement of the vehicle breaks; what
lies between two steps is not looked at. Tilt: the whole vehicle turns, own bodies and LiDARs, as under load or
braking, towards eight directions, about a point of the ground z = 0 of the ego frame: give the one below the middle of
the wheelbase. The scene stays as it is. Copies: every LiDAR off at random within a tolerance, 200 times; then each
LiDAR alone, off in all fields. The exit code is 1 if a placement misses a requirement as it is.")]
    Room(answers::RoomArgs),
}

impl clap::FromArgMatches for StudyCommand {
    fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
        Ok(match matches.subcommand_name() {
            Some(_) => Self::OneTable(Box::new(OneTable::from_arg_matches(matches)?)),
            None => Self::Make(Box::new(StudyArgs::from_arg_matches(matches)?)),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl clap::Args for StudyCommand {
    fn augment_args(command: clap::Command) -> clap::Command {
        <OneTable as clap::Subcommand>::augment_subcommands(StudyArgs::augment_args(command))
            .args_conflicts_with_subcommands(true)
            .subcommand_negates_reqs(true)
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        Self::augment_args(command)
    }
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline study lidars scenes/highway.json
  sightline study channels scenes/highway.json --sensor-file vlp_32c.json --sensor-file os1_64.json
  sightline study loss scenes/highway.json scenes/residential.json
  sightline study loss scenes/highway.json scenes/placements.json --frames 2
  sightline study lidars scenes/highway.json --vehicle van.json --budget 12000
  sightline study regions scenes/residential.json mine.json --box crossing:10,-5,0,30,5,2
  sightline study weather scenes/highway.json mine.json --condition fog:mor=50 --condition rain:rate=25
  sightline study nearfield scenes/highway.json --out near.svg
  sightline study targets mine.json --vehicle van.json
  sightline study redundancy scenes/highway.json scenes/placements.json
  sightline study overlap scenes/highway.json scenes/placements.json
  sightline study sweep scenes/highway.json mine.json --of 0.pitch --from -10 --to 20
  sightline study tolerance scenes/highway.json mine.json --vehicle van.json
  sightline study transfer scenes/highway.json scenes/residential.json

A study writes study.json, table.csv and chart.svg into its folder. The same command goes on with an
interrupted one. `loss`, `random`, `regions`, `voxels` and `weather` look at own rigs, a file of placements behind
the scenes; without one at the layouts of Table 7, where the vehicle is the paper's car: one model, a mount that
holds them. Give scenes/placements.json to compare any other vehicle with them. Kinds that search choose the
sensors of a vehicle for --budget. A row that misses a requirement is marked with !. A study in which no row has an
answer ends with exit code 1.")]
pub(super) struct StudyArgs {
    #[command(flatten)]
    request: StudyRequest,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
    #[command(flatten)]
    compute: Compute,
}

pub(super) fn run(command: &StudyCommand) -> Result<Exit, RunError> {
    match command {
        StudyCommand::Make(args) => make(args),
        StudyCommand::OneTable(one) => match &**one {
            OneTable::NearField(args) => answers::run_near_field(args),
            OneTable::Targets(args) => answers::run_targets(args),
            OneTable::Redundancy(args) => answers::run_redundancy(args),
            OneTable::Overlap(args) => answers::run_overlap(args),
            OneTable::Sweep(args) => answers::run_sweep(args),
            OneTable::Room(args) => answers::run_room(args),
        },
    }
}

fn make(args: &StudyArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let mut gap = "";
    let print_one = |found: &Table, folder: &Path| {
        if args.format != TableFormat::Text {
            return Ok(());
        }
        let gap = std::mem::replace(&mut gap, "\n");
        outln!("{gap}{}\n{}", found.title, study_text(found))?;
        outln!("{}: study.json, table.csv, chart.svg", folder.display())
    };
    let tables = study_scenes(&args.request, &args.compute.computing(&terminal), print_one)?;
    print(args, &tables)?;
    if !terminal.goes_on() {
        terminal.note("interrupted; the same command goes on");
        return Ok(terminal.exit());
    }
    let unanswered: Vec<String> = tables.iter().filter_map(Table::unanswered).collect();
    unanswered.iter().for_each(|why| terminal.note(why));
    Ok(if unanswered.is_empty() { terminal.exit() } else { Exit::CheckFailed })
}

/// Prints the mean over the scenes below their tables, or all tables as JSON or CSV.
fn print(args: &StudyArgs, tables: &[Table]) -> Result<(), RunError> {
    let mean = if tables.len() > 1 { mean_over_scenes(tables) } else { None };
    match (args.format, tables) {
        (TableFormat::Json, [table]) => outln!("{}", json!(table)),
        (TableFormat::Json, tables) => outln!("{}", json!({ "scenes": tables, "mean": mean })),
        (TableFormat::Csv, tables) => {
            out!("{}", studies_csv(&tables.iter().chain(&mean).collect::<Vec<_>>()))
        }
        (TableFormat::Text, _) => match mean {
            Some(mean) => outln!("\n{}\n{}", mean.title, study_text(&mean).trim_end()),
            None => Ok(()),
        },
    }
}
