//! `psog`: builds P-SOG files from scenes or labelled frames, prints and merges them.

use std::io::Write;
use std::path::PathBuf;

use serde_json::json;

use super::args::Format;
use super::output::{Exit, Talk, Terminal};
use crate::Note;
use crate::files::write_whole;
use crate::psog::{BuildReport, Psog, PsogInfo, read_psog};
use crate::report::sensor::{SensorFacts, sensor_svg, sensor_text};
use crate::report::text::psog_text;
use crate::runs::psog::{BuildRequest, build, merge};
use crate::runs::{RunError, Watcher};
use crate::vehicle::sensor_file;

#[derive(clap::Subcommand)]
pub(super) enum PsogCommand {
    /// Build a P-SOG from a scene's geometry, or from real labelled frames
    Build(Box<BuildArgs>),
    /// Print what a P-SOG holds
    #[command(after_help = "Example:\n  sightline psog info highway.psog.npz")]
    Info {
        /// P-SOG file
        psog: PathBuf,
        /// How to print
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Add up P-SOGs of the same grid and classes
    #[command(
        after_help = "Example:\n  sightline psog merge a.psog.npz b.psog.npz --out both.psog.npz"
    )]
    Merge {
        /// P-SOG files
        #[arg(required = true, num_args = 2..)]
        psogs: Vec<PathBuf>,
        /// File to write
        #[arg(long, value_name = "FILE")]
        out: PathBuf,
    },
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline psog build scenes/highway.json --out highway.psog.npz
  sightline psog build --kitti sequences/00 --out kitti.psog.npz
  sightline psog build --kitti sequences/00 --window 5 --voxel 0.2 0.2 0.2 --out kitti.psog.npz
  sightline psog build --nuscenes nuscenes --scenes scene-0061,scene-0103 --out nuscenes.psog.npz
  sightline psog build --carla scans --poses poses.csv --carla-tags 0.9.14 --out carla.psog.npz")]
pub(super) struct BuildArgs {
    #[command(flatten)]
    request: BuildRequest,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    talk: Talk,
}

pub(super) fn run(command: &PsogCommand) -> Result<Exit, RunError> {
    match command {
        PsogCommand::Build(args) => {
            let (psog, report) = build(&args.request, &Terminal::new(args.talk))?;
            print(&psog, Some(&report), args.format)?;
        }
        PsogCommand::Info { psog, format } => print(&read_psog(psog)?, None, *format)?,
        PsogCommand::Merge { psogs, out } => merge(psogs, out)?,
    }
    Ok(Exit::Done)
}

fn print(psog: &Psog, report: Option<&BuildReport>, format: Format) -> Result<(), RunError> {
    let info = PsogInfo::new(psog, report);
    match format {
        Format::Json => outln!("{}", json!(info)),
        Format::Text => out!("{}", psog_text(&info)),
    }
}

#[derive(clap::Subcommand)]
pub(super) enum SensorCommand {
    /// Say what a sensor file of a vendor holds, and draw its pattern
    Info(SensorInfoArgs),
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline sensor info VLP16db.yaml --azimuth-steps 1800
  sightline sensor info os1-metadata.json --out pattern.svg
  sightline sensor info \"Pandar40P_Angle Correction File.csv\" --format json > pandar40p.json

JSON of a sensor with channels is itself a sensor file. docs/formats/sensors.md lists the formats that are read.")]
pub(super) struct SensorInfoArgs {
    /// Sensor file of any format that is read; told apart by its content
    file: PathBuf,
    /// Azimuth steps a turn [default: as the file states]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    azimuth_steps: Option<u32>,
    /// Window in seconds of a pattern that lists times [default: the first 0.1 s]
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = crate::runs::parse::number_as("0.1"))]
    window: Option<Vec<f64>>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Draw the pattern into this SVG file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    talk: Talk,
}

pub(super) fn run_sensor(command: &SensorCommand) -> Result<Exit, RunError> {
    let SensorCommand::Info(args) = command;
    let window = match args.window.as_deref() {
        Some(&[from, to]) if from < to => Some([from, to]),
        None => None,
        _ => return Err(RunError::Usage("--window: give FROM below TO, as in 0 0.1".to_owned())),
    };
    let mut pattern = sensor_file::read(&args.file, window)?;
    // Facts stand in the answer alone.
    let terminal = Terminal::new(args.talk);
    pattern.notes.iter().filter(|note| note.is_doubt()).try_for_each(|note| terminal.tell(note))?;
    if let (Some(given), Some(stated)) = (args.azimuth_steps, pattern.azimuth_steps)
        && given != stated
    {
        let file = args.file.display();
        let text = format!(
            "{file}: azimuth_steps: {stated}; --azimuth-steps gives {given}, which counts."
        );
        pattern.notes.push(Note::fact(text));
    }
    let facts = SensorFacts::of(&pattern, args.azimuth_steps);
    if let Some(out) = &args.out {
        let svg = sensor_svg(&pattern, &facts);
        write_whole(out, |file| file.write_all(svg.as_bytes()).map_err(RunError::io(out)))?;
        args.talk.note(format!("pattern in {}", out.display()));
    }
    match args.format {
        Format::Json => outln!("{}", serde_json::json!(facts))?,
        Format::Text => out!("{}", sensor_text(&pattern, &facts))?,
    }
    Ok(Exit::Done)
}
