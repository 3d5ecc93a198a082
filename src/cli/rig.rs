//! `rig`: rigs in the formats of other programs, read, written and compared.

use std::path::PathBuf;

use serde_json::json;

use super::args::{Asked, Format};
use super::output::{Exit, Talk, Terminal};
use crate::json::{counted, shortened};
use crate::report::rigs::{comparison_csv, comparison_text};
use crate::rig::{ImportSettings, RigFormat};
use crate::runs::handover::{HandoverRequest, handover};
use crate::runs::rig::{ExportRequest, Mounted, compare_files, export_file, import_files};
use crate::runs::{RunError, TableFormat};
use crate::score::percent_up;

#[derive(clap::Subcommand)]
pub(super) enum RigCommand {
    /// Write a placement in the format of another program
    #[command(after_help = "Examples:
  sightline rig export mine.json:roof --format urdf --out roof.urdf
  sightline rig export runs/mine/placements.json:optimized --format autoware --base-link=-1.4 --out calibration
  sightline rig export placements.json --format carla-objects --scene scenes/highway.json
  sightline rig export placements.json:optimized --format urdf --vehicle scenes/vehicles/car.json")]
    Export {
        #[command(flatten)]
        request: Box<ExportRequest>,
        #[command(flatten)]
        talk: Talk,
    },
    /// Read a rig of another program as a placement
    Import(ImportArgs),
    /// Compare two rigs LiDAR by LiDAR, and each with its mirror image
    Compare(CompareArgs),
    /// Write a folder to hand over: poses, materials, masks, drawing
    #[command(after_help = "Examples:
  sightline rig handover mine.json:roof --vehicle van.json --out handover
  sightline rig handover scenes/highway.json scenes/placements.json:Center --frame 3 --out handover

The folder has poses in millimetres and degrees beside metres and radians, the bill of materials, for each LiDAR a mask
of its beams that end at the own body, crop boxes in Autoware's parameters, a drawing as SVG and PDF, and a profile of
each sensor model for Isaac Sim. README.txt in it says the conventions.")]
    Handover(Box<Asked<HandoverRequest>>),
}

/// How files of other programs are read.
#[derive(clap::Args)]
struct Reading {
    /// Frame that is a LiDAR [default: by type, or by name]
    #[arg(long, value_name = "NAME")]
    frame: Vec<String>,
    /// Frame of the vehicle [default: base_link]
    #[arg(long, value_name = "NAME")]
    base_frame: Option<String>,
    #[command(flatten)]
    mounted: Mounted,
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline rig import calibration --out mine.json
  sightline rig import robot.urdf --sensor velodyne=VLP-16 --base-link=-1.4")]
pub(super) struct ImportArgs {
    /// Files, or a folder of YAML files; FILE:NAME picks one of several placements
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// Format [default: by content]
    #[arg(long, value_name = "FORMAT")]
    format: Option<RigFormat>,
    /// Name of the placement
    #[arg(long, value_name = "NAME")]
    name: Option<String>,
    /// Placements to write [default: standard output]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    talk: Talk,
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline rig compare before after --base-frame sensor_kit_base_link
  sightline rig compare robot.urdf placements.json:found --format json")]
pub(super) struct CompareArgs {
    /// Rig: a file or folder of any format, or placements with :NAME
    before: String,
    /// Rig to compare with it
    after: String,
    /// How to print
    #[arg(long, value_enum, default_value_t = TableFormat::Text)]
    format: TableFormat,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    talk: Talk,
}

/// Advice behind the refusal of an option of other commands: how `import` gets models without a vehicle.
pub(super) fn instead_of(option: &str, command: &str) -> &'static str {
    match (option, command) {
        ("vehicle" | "scene", "rig import") => {
            "; --sensor FRAME=MODEL names the model of a LiDAR, and commands that take the placements check it"
        }
        _ => "",
    }
}

pub(super) fn run(command: &RigCommand) -> Result<Exit, RunError> {
    match command {
        RigCommand::Export { request, talk } => {
            let text = export_file(request, &Terminal::new(*talk))?;
            text.map_or(Ok(()), |text| out!("{text}"))?;
        }
        RigCommand::Import(args) => run_import(args)?,
        RigCommand::Compare(args) => run_compare(args)?,
        RigCommand::Handover(args) => return run_handover(args),
    }
    Ok(Exit::Done)
}

fn settings(
    reading: &Reading,
    format: Option<RigFormat>,
    name: Option<&str>,
) -> Result<ImportSettings, RunError> {
    Ok(ImportSettings {
        format,
        name: name.map(str::to_owned),
        base_frame: reading.base_frame.clone(),
        frames: reading.frame.clone(),
        sensors: reading.mounted.sensors()?,
        mounting: reading.mounted.mounting()?,
    })
}

fn run_import(args: &ImportArgs) -> Result<(), RunError> {
    let settings = settings(&args.reading, args.format, args.name.as_deref())?;
    let terminal = Terminal::new(args.talk);
    let text = import_files(&args.files, &settings, args.out.as_deref(), &terminal)?;
    text.map_or(Ok(()), |text| out!("{text}"))
}

fn run_compare(args: &CompareArgs) -> Result<(), RunError> {
    let settings = settings(&args.reading, None, None)?;
    let terminal = Terminal::new(args.talk);
    let found = compare_files(&args.before, &args.after, &settings, &terminal)?;
    match args.format {
        TableFormat::Json => outln!("{}", shortened(json!(found))),
        TableFormat::Csv => out!("{}", comparison_csv(&found)),
        TableFormat::Text => out!("{}", comparison_text(&found)),
    }
}

fn run_handover(args: &Asked<HandoverRequest>) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let made = handover(&args.request, &args.computing(&terminal))?;
    match args.format {
        Format::Json => outln!("{}", json!(made))?,
        Format::Text => {
            let (placement, price) = (&made.placement, made.price);
            let priced = if price > 0.0 { format!(", sensors for {price}") } else { String::new() };
            let files = counted(made.files.len(), "file");
            outln!("{}: {files} of {placement}{priced}", made.out.display())?;
            let frame = made.frame.map_or(String::new(), |frame| format!(" of frame {frame}"));
            for (k, [own, all]) in made.own_beams.iter().enumerate() {
                let share = percent_up(*own as f64 / *all as f64);
                outln!(
                    "  LiDAR {k}: {own} of {all} beams end at the own body in its mask{frame}, {share:.1} %"
                )?;
            }
        }
    }
    Ok(terminal.exit())
}
