//! `rig`: rigs in the formats of other programs, read, written and compared.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use crate::internals::{align_columns, shared_folder, writable_file, write_whole};
use crate::rig::{
    Asymmetry, Comparison, Exported, Fan, ImportSettings, Imported, Mounting, Rig, RigError,
    RigFormat, compare, export, import, read_rig, rig_json,
};
use crate::scene::Scene;
use serde_json::json;

use super::args::{Format, Talk};
use super::error::Error;
use super::exit::Exit;

/// Frames left out that a note lists.
const MOST_LISTED: usize = 12;

#[derive(clap::Subcommand)]
pub enum Command {
    /// Write a placement in the format of another program
    Export(ExportArgs),
    /// Read a rig of another program as a placement
    Import(ImportArgs),
    /// Compare two rigs LiDAR by LiDAR, and each with its mirror image
    Compare(CompareArgs),
}

/// What lies between the frames of a file and optical centres in the ego frame.
#[derive(clap::Args)]
struct Mounted {
    /// Position of base_link in the ego frame, in metres [default: 0,0,0]
    #[arg(long, value_name = "X[,Y,Z]", value_parser = base_link, allow_hyphen_values = true)]
    base_link: Option<[f64; 3]>,
    /// Optical centre above the foot of a sensor or frame [known: VLP-16, VLS-128]
    #[arg(long, value_name = "NAME=METRES", value_parser = height)]
    optical_height: Vec<(String, f64)>,
    /// Sensor in a frame, as lidar_0=VLP-16
    #[arg(long, value_name = "FRAME=NAME", value_parser = sensor)]
    sensor: Vec<(String, String)>,
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline rig export scenes/placements.json:Center --format urdf --out center.urdf
  sightline rig export runs/mine/placements.json --format autoware --base-link=-1.4 --out calibration
  sightline rig export placements.json --format carla-objects --scene scenes/highway.json")]
pub struct ExportArgs {
    /// Placements, and the name of one of them where there are several
    #[arg(value_name = "PLACEMENT_FILE[:NAME]")]
    placement: String,
    /// Format: autoware, urdf, sdf, ros2-launch, carla, carla-objects, json
    #[arg(long, value_name = "FORMAT")]
    format: RigFormat,
    /// File to write, for autoware a folder [default: standard output]
    #[arg(long, value_name = "FILE_OR_DIR")]
    out: Option<PathBuf>,
    /// Name of a LiDAR's frame, one for each LiDAR [default: lidar_0, lidar_1, …]
    #[arg(long, value_name = "NAME")]
    frame: Vec<String>,
    /// Scene whose sensor CARLA is to cast where a LiDAR names none
    #[arg(long, value_name = "SCENE")]
    scene: Option<PathBuf>,
    #[command(flatten)]
    mounted: Mounted,
    #[command(flatten)]
    talk: Talk,
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
  sightline rig import sensors_calibration.yaml sensor_kit_calibration.yaml --out placements.json
  sightline rig import robot.urdf --sensor velodyne=VLP-16 --base-link=-1.4")]
pub struct ImportArgs {
    /// Files, or a folder of YAML files
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
pub struct CompareArgs {
    /// Rig: a file or folder of any format, or placements with :NAME
    before: String,
    /// Rig to compare with it
    after: String,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    reading: Reading,
    #[command(flatten)]
    talk: Talk,
}

pub fn run(command: &Command) -> Result<Exit, Error> {
    match command {
        Command::Export(args) => run_export(args)?,
        Command::Import(args) => run_import(args)?,
        Command::Compare(args) => run_compare(args)?,
    }
    Ok(Exit::Done)
}

fn base_link(text: &str) -> Result<[f64; 3], String> {
    let fault = || "give X or X,Y,Z in metres, as in -1.4,0,0".to_owned();
    let numbers =
        text.split(',').map(|word| word.trim().parse().ok().filter(|v: &f64| v.is_finite()));
    match numbers.collect::<Option<Vec<f64>>>().ok_or_else(fault)?[..] {
        [x] => Ok([x, 0.0, 0.0]),
        [x, y, z] => Ok([x, y, z]),
        _ => Err(fault()),
    }
}

/// Two sides of an equals sign.
fn sides(text: &str) -> Option<(&str, &str)> {
    text.rsplit_once('=').filter(|(name, value)| !name.is_empty() && !value.is_empty())
}

fn height(text: &str) -> Result<(String, f64), String> {
    let parsed = sides(text).and_then(|(name, value)| Some((name.to_owned(), value.parse().ok()?)));
    let small = parsed.filter(|(_, height): &(String, f64)| height.abs() <= 10.0);
    small.ok_or_else(|| "give NAME=METRES, as in VLP-16=0.0377".to_owned())
}

fn sensor(text: &str) -> Result<(String, String), String> {
    let parsed = sides(text).map(|(frame, name)| (frame.to_owned(), name.to_owned()));
    parsed.ok_or_else(|| "give FRAME=NAME, as in lidar_0=VLP-16".to_owned())
}

impl Mounted {
    fn mounting(&self) -> Mounting {
        Mounting {
            base_link: self.base_link.unwrap_or_default(),
            optical_heights: self.optical_height.iter().cloned().collect(),
        }
    }

    fn sensors(&self) -> BTreeMap<String, String> {
        self.sensor.iter().cloned().collect()
    }
}

/// A file, and a name behind a colon where the whole is no file.
fn file_and_name(text: &str) -> (PathBuf, Option<&str>) {
    match text.rsplit_once(':') {
        Some((file, name)) if !Path::new(text).exists() => (file.into(), Some(name)),
        _ => (text.into(), None),
    }
}

fn run_export(args: &ExportArgs) -> Result<(), Error> {
    let (file, name) = file_and_name(&args.placement);
    let mut rig = read_rig(&file, name)?;
    if !args.frame.is_empty() {
        let (given, lidars) = (args.frame.len(), rig.lidars.len());
        if given != lidars {
            return Err(RigError::FrameCount { given, lidars }.into());
        }
        for (lidar, frame) in rig.lidars.iter_mut().zip(&args.frame) {
            lidar.frame.clone_from(frame);
        }
    }
    for (frame, sensor) in args.mounted.sensors() {
        let known = rig.lidars.iter().map(|lidar| lidar.frame.clone()).collect();
        match rig.lidars.iter_mut().find(|lidar| lidar.frame == frame) {
            Some(lidar) => lidar.sensor = Some(sensor),
            None => {
                let file = file.display().to_string();
                return Err(RigError::UnknownFrame { file, frame, known }.into());
            }
        }
    }
    let scene = args.scene.as_deref().map(Scene::read).transpose()?;
    let fan = scene.map(|scene| Fan::of(scene.lidar()));
    let exported = export(&rig, args.format, &args.mounted.mounting(), fan)?;
    exported.warnings.iter().for_each(|warning| args.talk.note(warning));
    match &args.out {
        Some(out) => write_files(&exported, out, &file),
        None => exported.files.iter().try_for_each(|file| out!("{}", file.text)),
    }
}

/// Writes one file to `out`, several into the folder `out`.
fn write_files(exported: &Exported, out: &Path, input: &Path) -> Result<(), Error> {
    let write = |path: &Path, text: &str| {
        writable_file(path, [input])?;
        write_whole(path, |file| file.write_all(text.as_bytes()).map_err(Error::io(path)))
    };
    match &exported.files[..] {
        [file] if !out.is_dir() => write(out, &file.text),
        files => {
            shared_folder(out)?;
            files.iter().try_for_each(|file| write(&out.join(&file.name), &file.text))
        }
    }
}

fn settings(reading: &Reading, format: Option<RigFormat>, name: Option<&str>) -> ImportSettings {
    ImportSettings {
        format,
        name: name.map(str::to_owned),
        base_frame: reading.base_frame.clone(),
        frames: reading.frame.clone(),
        sensors: reading.mounted.sensors(),
        mounting: reading.mounted.mounting(),
    }
}

/// Says what was left out and what should be known.
fn say(imported: &Imported, talk: Talk) {
    let left_out = &imported.left_out;
    if !left_out.is_empty() {
        let shown = left_out[..left_out.len().min(MOST_LISTED)].join(", ");
        let more = left_out.len().saturating_sub(MOST_LISTED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        talk.note(format!("left out, not being LiDARs: {shown}{more}"));
    }
    imported.notes.iter().for_each(|note| talk.note(note));
}

fn run_import(args: &ImportArgs) -> Result<(), Error> {
    let settings = settings(&args.reading, args.format, args.name.as_deref());
    let imported = import(&args.files, &settings)?;
    let rig = &imported.rig;
    say(&imported, args.talk);
    for (index, lidar) in rig.lidars.iter().enumerate() {
        let sensor = lidar.sensor.as_deref().unwrap_or("sensor not known");
        args.talk.note(format!("LiDAR {index} is `{}`, {sensor}", lidar.frame));
    }
    let text = format!("{:#}\n", rig_json(&[rig]));
    match &args.out {
        None => out!("{text}"),
        Some(out) => {
            writable_file(out, args.files.iter().map(PathBuf::as_path))?;
            write_whole(out, |file| file.write_all(text.as_bytes()).map_err(Error::io(out)))
        }
    }
}

fn run_compare(args: &CompareArgs) -> Result<(), Error> {
    let read = |text: &str| -> Result<Rig, Error> {
        let (file, name) = file_and_name(text);
        let imported = import(&[file], &settings(&args.reading, None, name))?;
        imported.notes.iter().for_each(|note| args.talk.detail(note));
        Ok(imported.rig)
    };
    let (before, after) = (read(&args.before)?, read(&args.after)?);
    let found = compare(&before, &after)?;
    match args.format {
        Format::Json => outln!("{}", json!(found)),
        Format::Text => print(&found),
    }
}

fn print(found: &Comparison) -> Result<(), Error> {
    let numbers = |values: [f64; 3]| values.map(|value| format!("{value:.5}"));
    let table = |titles: [&str; 4], rows: &mut dyn Iterator<Item = (String, [f64; 3])>| {
        let mut all = vec![titles.map(str::to_owned).to_vec()];
        all.extend(rows.map(|(name, values)| [vec![name], numbers(values).to_vec()].concat()));
        align_columns(&all)
    };
    let moved = found.lidars.iter().map(|l| (l.frame.clone(), [l.moved, l.turned, l.tilted]));
    out!("{}", table(["LiDAR", "moved m", "turned rad", "axis rad"], &mut moved.into_iter()))?;
    for (title, all) in [("before: pair", &found.before), ("after: pair", &found.after)] {
        let mut rows = all.iter().map(|pair| (named(pair), [pair.moved, pair.turned, pair.tilted]));
        out!("\n{}", table([title, "off mirror m", "turned rad", "axis rad"], &mut rows))?;
        for pair in all.iter().filter(|pair| pair.same_roll) {
            outln!(
                "  ! {}: both have the same roll; in a mirror image roll changes its sign",
                named(pair)
            )?;
        }
    }
    Ok(())
}

fn named(pair: &Asymmetry) -> String {
    if pair.left == pair.right {
        return format!("{} with itself", pair.left);
    }
    format!("{} with {}", pair.left, pair.right)
}
