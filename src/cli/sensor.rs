//! `sensor`: what a sensor file holds.

use std::io::Write;
use std::path::PathBuf;

use super::args::Format;
use super::output::Exit;
use super::terminal::{Talk, Terminal};
use crate::internals::{SensorFacts, sensor_svg, sensor_text, write_whole};
use crate::runs::{RunError, Watcher};
use crate::vehicle::sensor_file;

#[derive(clap::Subcommand)]
pub enum SensorCommand {
    /// Say what a sensor file of a vendor holds, and draw its pattern
    Info(SensorInfoArgs),
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline sensor info VLP16db.yaml --azimuth-steps 1800
  sightline sensor info os1-metadata.json --out pattern.svg
  sightline sensor info \"Pandar40P_Angle Correction File.csv\" --format json > pandar40p.json

JSON of a sensor with channels is itself a sensor file. docs/formats/sensors.md lists the formats that are read.")]
pub struct SensorInfoArgs {
    /// Sensor file of any format that is read; told apart by its content
    file: PathBuf,
    /// Azimuth steps a turn [default: as the file states]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    azimuth_steps: Option<u32>,
    /// Window in seconds of a pattern that lists times [default: the first 0.1 s]
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = super::args::finite)]
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

pub fn run(command: &SensorCommand) -> Result<Exit, RunError> {
    let SensorCommand::Info(args) = command;
    let window = match args.window.as_deref() {
        Some(&[from, to]) if from < to => Some([from, to]),
        None => None,
        _ => return Err(RunError::Usage("--window: give FROM below TO, as in 0 0.1".to_owned())),
    };
    let pattern = sensor_file::read(&args.file, window)?;
    // Facts stand in the answer alone.
    let terminal = Terminal::new(args.talk);
    pattern.notes.iter().filter(|note| note.is_doubt()).try_for_each(|note| terminal.tell(note))?;
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
