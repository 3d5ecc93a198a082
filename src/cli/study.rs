//! `sightline study`: questions that take many runs.

use std::path::Path;

use serde_json::json;

use super::args::Compute;
use super::output::Exit;
use super::{coverage, sensitivity};
use crate::internals::{studies_csv, study_text};
use crate::runs::study::{StudyRequest, study_scenes};
use crate::runs::{RunError, TableFormat, Watcher};
use crate::study::{Table, mean_over_scenes};

/// A study of one table is a command of its own; all others name their kind.
pub enum StudyCommand {
    Make(Box<StudyArgs>),
    NearField(Box<coverage::NearFieldArgs>),
    Targets(Box<coverage::TargetsArgs>),
    Redundancy(Box<coverage::RedundancyArgs>),
    Overlap(Box<coverage::OverlapArgs>),
    Sweep(Box<sensitivity::SweepArgs>),
    Room(Box<sensitivity::RoomArgs>),
}

/// Names of the studies that are commands.
const NEAR_FIELD: &str = "nearfield";
const TARGETS: &str = "targets";
const REDUNDANCY: &str = "redundancy";
const OVERLAP: &str = "overlap";
const SWEEP: &str = "sweep";
const TOLERANCE: &str = "tolerance";

impl clap::FromArgMatches for StudyCommand {
    fn from_arg_matches(matches: &clap::ArgMatches) -> Result<Self, clap::Error> {
        Ok(match matches.subcommand() {
            Some((NEAR_FIELD, matches)) => {
                Self::NearField(Box::new(coverage::NearFieldArgs::from_arg_matches(matches)?))
            }
            Some((TARGETS, matches)) => {
                Self::Targets(Box::new(coverage::TargetsArgs::from_arg_matches(matches)?))
            }
            Some((REDUNDANCY, matches)) => {
                Self::Redundancy(Box::new(coverage::RedundancyArgs::from_arg_matches(matches)?))
            }
            Some((OVERLAP, matches)) => {
                Self::Overlap(Box::new(coverage::OverlapArgs::from_arg_matches(matches)?))
            }
            Some((SWEEP, matches)) => {
                Self::Sweep(Box::new(sensitivity::SweepArgs::from_arg_matches(matches)?))
            }
            Some((TOLERANCE, matches)) => {
                Self::Room(Box::new(sensitivity::RoomArgs::from_arg_matches(matches)?))
            }
            _ => Self::Make(Box::new(StudyArgs::from_arg_matches(matches)?)),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &clap::ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl clap::Args for StudyCommand {
    fn augment_args(command: clap::Command) -> clap::Command {
        let near = coverage::NearFieldArgs::augment_args(clap::Command::new(NEAR_FIELD))
            .about("Ground and poles near the vehicle: seen, blind, own body");
        let targets = coverage::TargetsArgs::augment_args(clap::Command::new(TARGETS))
            .about("Targets at range: beams on a car, a child, a tyre");
        let redundancy = coverage::RedundancyArgs::augment_args(clap::Command::new(REDUNDANCY))
            .about("Ground, targets and voxels by the number of LiDARs that see them");
        let overlap = coverage::OverlapArgs::augment_args(clap::Command::new(OVERLAP))
            .about("Overlap of each pair of LiDARs, for calibration");
        let sweep = sensitivity::SweepArgs::augment_args(clap::Command::new(SWEEP))
            .about("One pose field of one LiDAR moved through a range");
        let tolerance = sensitivity::RoomArgs::augment_args(clap::Command::new(TOLERANCE))
            .about("How far each LiDAR may be off until a requirement breaks");
        StudyArgs::augment_args(command)
            .subcommand(near)
            .subcommand(targets)
            .subcommand(redundancy)
            .subcommand(overlap)
            .subcommand(sweep)
            .subcommand(tolerance)
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
pub struct StudyArgs {
    #[command(flatten)]
    request: StudyRequest,
    /// How to print the result
    #[arg(long, value_enum, default_value_t)]
    format: TableFormat,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(command: &StudyCommand) -> Result<Exit, RunError> {
    match command {
        StudyCommand::Make(args) => make(args),
        StudyCommand::NearField(args) => coverage::run_near_field(args),
        StudyCommand::Targets(args) => coverage::run_targets(args),
        StudyCommand::Redundancy(args) => coverage::run_redundancy(args),
        StudyCommand::Overlap(args) => coverage::run_overlap(args),
        StudyCommand::Sweep(args) => sensitivity::run_sweep(args),
        StudyCommand::Room(args) => sensitivity::run_room(args),
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
