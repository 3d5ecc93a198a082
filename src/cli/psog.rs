use std::path::{Path, PathBuf};
use std::process::ExitCode;

use serde_json::json;
use sightline::psog::{
    BuildReport, KittiPsogOptions, KittiSequence, Psog, PsogInfo, build_kitti_psog, read_psog,
    write_psog_to,
};
use sightline::scan::scan_scene;
use sightline::scene::{PsogSource, ScanSettings};

use super::args::{Format, Talk, finite, format_or_default};
use super::error::Error;
use super::output::{writable_file, write_whole};
use super::{load, progress, table};

#[derive(clap::Subcommand)]
pub enum Command {
    /// Build a P-SOG from a scene's geometry, or from real labelled frames
    Build(BuildArgs),
    /// Print what a P-SOG holds
    Info(InfoArgs),
    /// Add up P-SOGs of the same grid and classes
    Merge(MergeArgs),
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline psog build scenes/highway.json --out highway.psog.npz
  sightline psog build --kitti sequences/00 --roi-min -40 -40 -0.5 --roi-max 40 40 5.5 \\
      --voxel 0.2 0.2 0.2 --out kitti.psog.npz")]
pub struct BuildArgs {
    /// Scene file whose geometry is scanned
    #[arg(required_unless_present = "kitti", conflicts_with = "kitti")]
    scene: Option<PathBuf>,
    /// Folder of labelled frames in the SemanticKITTI layout: velodyne/, labels/, poses.txt, calib.txt
    #[arg(long, value_name = "DIR", requires_all = ["roi_min", "roi_max", "voxel"])]
    kitti: Option<PathBuf>,
    /// Merge only the frames this many numbers before and after into each frame [default: all]
    #[arg(long, value_name = "N", requires = "kitti")]
    window: Option<u32>,
    /// Height of the recording LiDAR above the ground, in metres
    #[arg(long, value_name = "M", requires = "kitti", default_value_t = 1.73, value_parser = finite)]
    lidar_height: f64,
    /// Lower corner of the region of interest, in metres
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true)]
    roi_min: Option<Vec<f64>>,
    /// Upper corner of the region of interest, in metres
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true)]
    roi_max: Option<Vec<f64>>,
    /// Voxel size, in metres
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"])]
    voxel: Option<Vec<f64>>,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How to print [default: text on a terminal, else json]
    #[arg(long, value_enum)]
    format: Option<Format>,
    #[command(flatten)]
    talk: Talk,
}

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline psog info highway.psog.npz")]
pub struct InfoArgs {
    /// P-SOG file
    psog: PathBuf,
    /// How to print [default: text on a terminal, else json]
    #[arg(long, value_enum)]
    format: Option<Format>,
}

#[derive(clap::Args)]
#[command(
    after_help = "Example:\n  sightline psog merge a.psog.npz b.psog.npz --out both.psog.npz"
)]
pub struct MergeArgs {
    /// P-SOG files
    #[arg(required = true, num_args = 2..)]
    psogs: Vec<PathBuf>,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(command: &Command) -> Result<ExitCode, Error> {
    match command {
        Command::Build(args) => build(args)?,
        Command::Info(args) => print(&read_psog(&args.psog)?, None, args.format)?,
        Command::Merge(args) => merge(args)?,
    }
    Ok(ExitCode::SUCCESS)
}

fn corner(values: Option<&Vec<f64>>, option: &str) -> Result<[f64; 3], Error> {
    values
        .and_then(|v| <[f64; 3]>::try_from(v.as_slice()).ok())
        .ok_or_else(|| Error::Usage(format!("{option} needs three numbers")))
}

fn build(args: &BuildArgs) -> Result<(), Error> {
    writable_file(&args.out, args.scene.as_deref())?;
    let (psog, report) = match (&args.scene, &args.kitti) {
        (_, Some(folder)) => {
            let roi = sightline::psog::Roi::from_bounds(
                corner(args.roi_min.as_ref(), "--roi-min")?,
                corner(args.roi_max.as_ref(), "--roi-max")?,
                corner(args.voxel.as_ref(), "--voxel")?,
            )?;
            let options = KittiPsogOptions {
                lidar_height: args.lidar_height,
                window: args.window,
                ..KittiPsogOptions::new(roi)
            };
            build_kitti_psog(&KittiSequence::open(folder)?, &options)?
        }
        (Some(path), None) => {
            let scene = load::read(path, args.talk)?;
            if !scene.has_geometry() {
                return Err(Error::Usage(format!(
                    "{}: has no geometry to scan; a P-SOG is built from static shapes and actors",
                    path.display()
                )));
            }
            let settings = match scene.psog_source() {
                PsogSource::Scan(settings) => *settings,
                PsogSource::File(_) => ScanSettings::default_of(&scene),
            };
            let frames = scene.frame_count() as u64;
            let bar = progress::bar(frames, "frames scanned for the P-SOG", args.talk);
            let built = scan_scene(&scene, &scene.roi().grid()?, &settings, || bar.inc(1))?;
            bar.finish_and_clear();
            built
        }
        (None, None) => unreachable!("clap requires one of them"),
    };
    write(&args.out, &psog)?;
    print(&psog, Some(&report), args.format)
}

fn merge(args: &MergeArgs) -> Result<(), Error> {
    writable_file(&args.out, args.psogs.iter().map(PathBuf::as_path))?;
    let Some((first, rest)) = args.psogs.split_first() else { unreachable!("clap requires two") };
    let mut sum = read_psog(first)?;
    for path in rest {
        sum = sum.merge(&read_psog(path)?).map_err(|error| {
            Error::Usage(format!("{} and {}: {error}", first.display(), path.display()))
        })?;
    }
    write(&args.out, &sum)
}

fn write(path: &Path, psog: &Psog) -> Result<(), Error> {
    write_whole(path, |file| write_psog_to(file, psog).map_err(Error::io(path)))
}

fn print(psog: &Psog, report: Option<&BuildReport>, format: Option<Format>) -> Result<(), Error> {
    let info = PsogInfo::new(psog, report);
    match format_or_default(format) {
        Format::Json => outln!("{}", json!(info))?,
        Format::Text => {
            let value = json!(info);
            let mut rows = Vec::new();
            flatten("", &value, &mut rows);
            out!("{}", table::align(&rows))?;
        }
    }
    Ok(())
}

/// One row a number or text of a JSON value, named by its path.
fn flatten(path: &str, value: &serde_json::Value, rows: &mut Vec<Vec<String>>) {
    match value {
        serde_json::Value::Object(fields) => {
            for (key, value) in fields {
                let path = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                flatten(&path, value, rows);
            }
        }
        // Classes: one row each.
        serde_json::Value::Array(items) if items.iter().any(serde_json::Value::is_object) => {
            for item in items {
                let name = item["name"].as_str().unwrap_or_default();
                let mut fields = item.clone();
                if let Some(fields) = fields.as_object_mut() {
                    fields.remove("name");
                }
                flatten(&format!("{path}.{name}"), &fields, rows);
            }
        }
        value => {
            let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
            rows.push(vec![path.to_owned(), text]);
        }
    }
}
