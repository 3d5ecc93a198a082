//! `psog`: builds P-SOG files from scenes or labelled frames, prints and merges them.

use std::path::{Path, PathBuf};

use crate::datasets::{KITTI_LIDAR_HEIGHT, KittiSequence, PsogOptions, build_psog, read_nuscenes};
use crate::internals::{align_columns, writable_file, write_whole};
use crate::psog::{BuildReport, Psog, PsogInfo, Roi, read_psog, write_psog};
use crate::scan::scan_scene;
use crate::scene::{PsogSource, ScanSettings};
use serde_json::json;

use super::args::{Format, Talk};
use super::datasets::DatasetArgs;
use super::error::Error;
use super::exit::Exit;
use super::{load, progress};

/// Region around the ego vehicle, as in the own scenes: lower and upper corner in metres.
const REGION: [[f64; 3]; 2] = [[-40.0, -40.0, -0.5], [40.0, 40.0, 5.5]];
/// Voxel of the paper's segmentation task, in metres.
const VOXEL: [f64; 3] = [0.1; 3];

#[derive(clap::Subcommand)]
pub enum Command {
    /// Build a P-SOG from a scene's geometry, or from real labelled frames
    Build(Box<BuildArgs>),
    /// Print what a P-SOG holds
    Info(InfoArgs),
    /// Add up P-SOGs of the same grid and classes
    Merge(MergeArgs),
}

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline psog build scenes/highway.json --out highway.psog.npz
  sightline psog build --kitti sequences/00 --out kitti.psog.npz
  sightline psog build --kitti sequences/00 --window 5 --voxel 0.2 0.2 0.2 --out kitti.psog.npz
  sightline psog build --nuscenes nuscenes --scenes scene-0061,scene-0103 --out nuscenes.psog.npz
  sightline psog build --carla scans --poses poses.csv --carla-tags 0.9.14 --out carla.psog.npz")]
pub struct BuildArgs {
    /// Scene file whose geometry is scanned
    #[arg(required_unless_present_any = ["kitti", "nuscenes", "carla"],
          conflicts_with_all = ["kitti", "nuscenes", "carla", "lidar_height"])]
    scene: Option<PathBuf>,
    /// Folder of labelled frames in the SemanticKITTI layout: velodyne/, labels/, poses.txt, calib.txt
    #[arg(long, value_name = "DIR", conflicts_with_all = ["nuscenes", "carla"])]
    kitti: Option<PathBuf>,
    /// Folder of a set in the layout of nuScenes with lidarseg: v1.0-…/, samples/, lidarseg/
    #[arg(long, value_name = "DIR", conflicts_with = "carla")]
    nuscenes: Option<PathBuf>,
    /// Scenes of the set [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',', requires = "nuscenes")]
    scenes: Vec<String>,
    /// Folder of scans of CARLA's semantic LiDAR, named by their frames: 000123.ply, .bin or .npy
    #[arg(long, value_name = "DIR", requires = "poses")]
    carla: Option<PathBuf>,
    #[command(flatten)]
    datasets: DatasetArgs,
    /// Merge only the frames this many numbers before and after into each frame [default: all]
    #[arg(long, value_name = "N", conflicts_with = "scene")]
    window: Option<u32>,
    /// Lower corner of the region of interest, in metres
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true,
          conflicts_with = "scene", default_values_t = REGION[0])]
    roi_min: Vec<f64>,
    /// Upper corner of the region of interest, in metres
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true,
          conflicts_with = "scene", default_values_t = REGION[1])]
    roi_max: Vec<f64>,
    /// Voxel size, in metres [the paper's for segmentation]
    #[arg(long, num_args = 3, value_names = ["X", "Y", "Z"], conflicts_with = "scene",
          default_values_t = VOXEL)]
    voxel: Vec<f64>,
    /// File to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    talk: Talk,
}

#[derive(clap::Args)]
#[command(after_help = "Example:\n  sightline psog info highway.psog.npz")]
pub struct InfoArgs {
    /// P-SOG file
    psog: PathBuf,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
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

pub fn run(command: &Command) -> Result<Exit, Error> {
    match command {
        Command::Build(args) => build(args)?,
        Command::Info(args) => print(&read_psog(&args.psog)?, None, args.format)?,
        Command::Merge(args) => merge(args)?,
    }
    Ok(Exit::Done)
}

/// The three values of an option that clap takes three of.
fn triple(values: &[f64]) -> [f64; 3] {
    [values[0], values[1], values[2]]
}

fn build(args: &BuildArgs) -> Result<(), Error> {
    writable_file(&args.out, args.scene.as_deref())?;
    let (psog, report) = match &args.scene {
        Some(path) => {
            let scene = load::read(path, None, args.talk)?;
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
        None => of_scans(args)?,
    };
    write(&args.out, &psog)?;
    print(&psog, Some(&report), args.format)
}

/// The P-SOG of a data set's labelled scans.
fn of_scans(args: &BuildArgs) -> Result<(Psog, BuildReport), Error> {
    let [min, max] = [&args.roi_min, &args.roi_max].map(|corner| triple(corner));
    let roi = Roi::from_bounds(min, max, triple(&args.voxel))?;
    let options = PsogOptions { window: args.window, ..PsogOptions::new(roi) };
    let sets = &args.datasets;
    if let Some(folder) = &args.kitti {
        let height = sets.lidar_height.unwrap_or(KITTI_LIDAR_HEIGHT);
        let sequence = KittiSequence::open(folder)?.with_lidar_height(height)?;
        return Ok(build_psog(&[sequence], &options)?);
    }
    if let Some(folder) = &args.nuscenes {
        let scenes = read_nuscenes(folder, sets.version.as_deref(), &args.scenes)?;
        return Ok(build_psog(&scenes, &options)?);
    }
    let Some(folder) = &args.carla else { unreachable!("clap requires one of them") };
    Ok(build_psog(&[sets.carla(folder, args.talk)?], &options)?)
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
    write_whole(path, |file| write_psog(file, psog).map_err(Error::io(path)))
}

fn print(psog: &Psog, report: Option<&BuildReport>, format: Format) -> Result<(), Error> {
    let info = PsogInfo::new(psog, report);
    match format {
        Format::Json => outln!("{}", json!(info)),
        Format::Text => out!("{}\n{}", facts(&info), classes(&info)),
    }
}

/// One fact a line: its name, its value and its meaning.
fn facts(info: &PsogInfo) -> String {
    let [x, y, z] = [0, 1, 2].map(|k| format!("{} to {}", info.min[k], info.max[k]));
    let [nx, ny, nz] = info.shape;
    let [dx, dy, dz] = info.voxel;
    let share = |count: u64| 100.0 * count as f64 / info.voxels as f64;
    let nats = |value: f64| format!("{value:.2} nats");
    let mut facts = vec![
        ("region", format!("x {x}, y {y}, z {z} m")),
        ("voxels", format!("{} = {nx} × {ny} × {nz} of {dx} × {dy} × {dz} m", info.voxels)),
        ("frames", info.frames.to_string()),
        (
            "occupied",
            format!(
                "{} voxels ({:.2} %) in at least one frame",
                info.occupied,
                share(info.occupied)
            ),
        ),
        (
            "informative",
            format!(
                "{} voxels ({:.2} %) not the same in all frames",
                info.informative,
                share(info.informative)
            ),
        ),
        ("entropy", format!("{}, every class for itself", nats(info.entropy_segmentation))),
    ];
    if let (Some(entropy), Some(target)) = (info.entropy_detection, &info.detection_target) {
        facts.push(("", format!("{}, {target} or not", nats(entropy))));
    }
    facts.push(("", format!("{}, occupied or not", nats(info.entropy_bernoulli))));
    facts.push(("memory", format!("{:.1} MiB", info.memory_bytes as f64 / f64::from(1 << 20))));
    if let Some(ties) = info.tie_share {
        facts.push((
            "ties",
            format!("{:.2} % of the votes, which went to the lowest class", 100.0 * ties),
        ));
    }
    facts.iter().map(|(name, value)| format!("{name:<12}{value}\n")).collect()
}

/// The part of each class in the entropy.
fn classes(info: &PsogInfo) -> String {
    let mut rows = vec![["class", "voxels", "nats"].map(str::to_owned).to_vec()];
    rows.extend(info.classes.iter().map(|class| {
        vec![class.name.clone(), class.voxels.to_string(), format!("{:.2}", class.entropy)]
    }));
    rows.push(vec!["(empty)".into(), "–".into(), format!("{:.2}", info.entropy_empty)]);
    align_columns(&rows)
}
