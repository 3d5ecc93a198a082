//! P-SOG files from scenes, from labelled scans, and from other P-SOG files.

use std::path::{Path, PathBuf};

use super::inputs::repeated;
use super::{RunError, Watcher, opening, outputs};
use crate::datasets::{
    CarlaSequence, CarlaTags, KittiSequence, LabelledSequence, PsogOptions, build_psog,
    read_nuscenes,
};
use crate::files::{Session, will_read, write_whole};
use crate::psog::{BuildReport, Psog, PsogError, Roi, read_psog, write_psog};
use crate::scan::scan_scene;
use crate::scene::{Ground, PsogSource, ScanSettings};

/// Region around the ego vehicle, as in the own scenes: lower and upper corner in metres.
pub const PAPER_REGION: [[f64; 3]; 2] = [[-40.0, -40.0, -0.5], [40.0, 40.0, 5.5]];
/// Voxel of the paper's segmentation task, in metres.
pub const PAPER_VOXEL: [f64; 3] = [0.1; 3];

/// A P-SOG to be built from a scene's geometry, or from labelled frames.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct BuildRequest {
    /// Scene file whose geometry is scanned
    #[cfg_attr(feature = "cli", arg(required_unless_present_any = ["kitti", "nuscenes", "carla"], conflicts_with_all = ["kitti", "nuscenes", "carla", "lidar_height"]))]
    pub scene: Option<PathBuf>,
    /// Vehicle file, in place of the scene's; a scene without `lidar` or `vehicle` needs one
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE", requires = "scene"))]
    pub vehicle: Option<PathBuf>,
    /// Folder of labelled frames in the SemanticKITTI layout: velodyne/, labels/, poses.txt, calib.txt
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR", conflicts_with_all = ["nuscenes", "carla"]))]
    pub kitti: Option<PathBuf>,
    /// Folder of a set in the layout of nuScenes with lidarseg: v1.0-…/, samples/, lidarseg/
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR", conflicts_with = "carla"))]
    pub nuscenes: Option<PathBuf>,
    /// Scenes of the set [default: all]
    #[cfg_attr(
        feature = "cli",
        arg(long, value_name = "NAME", value_delimiter = ',', requires = "nuscenes")
    )]
    pub scenes: Vec<String>,
    /// Folder of scans of CARLA's semantic LiDAR, named by their frames: 000123.ply, .bin or .npy
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR", requires = "poses"))]
    pub carla: Option<PathBuf>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub datasets: DatasetArgs,
    /// Merge only the frames this many numbers before and after into each frame [default: all]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", conflicts_with = "scene"))]
    pub window: Option<u32>,
    /// Lower corner of the region of interest, in metres
    #[cfg_attr(feature = "cli", arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true, conflicts_with = "scene", default_values_t = PAPER_REGION[0]))]
    pub roi_min: Vec<f64>,
    /// Upper corner of the region of interest, in metres
    #[cfg_attr(feature = "cli", arg(long, num_args = 3, value_names = ["X", "Y", "Z"], allow_hyphen_values = true, conflicts_with = "scene", default_values_t = PAPER_REGION[1]))]
    pub roi_max: Vec<f64>,
    /// Voxel size, in metres [the paper's for segmentation]
    #[cfg_attr(feature = "cli", arg(long, num_args = 3, value_names = ["X", "Y", "Z"], conflicts_with = "scene", default_values_t = PAPER_VOXEL))]
    pub voxel: Vec<f64>,
    /// File to write
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE"))]
    pub out: PathBuf,
}

/// Where labelled scans lie, beside the folder of a command's own option.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct DatasetArgs {
    /// Version of the tables of nuScenes, as v1.0-mini [default: the only one there]
    #[cfg_attr(feature = "cli", arg(long, value_name = "VERSION", requires = "nuscenes"))]
    pub version: Option<String>,
    /// CSV of the LiDAR's carla.Transform: frame or file, x, y, z, roll, pitch, yaw, and perhaps time
    #[cfg_attr(feature = "cli", arg(long, value_name = "FILE", requires = "carla"))]
    pub poses: Option<PathBuf>,
    /// Version of CARLA whose tags the points have: 0.9.10 to 0.9.13, or 0.9.14 and later [default: the one in
    /// which the road lies flat below the LiDAR]
    #[cfg_attr(feature = "cli", arg(long, value_name = "VERSION", requires = "carla", value_parser = super::parse::carla_tags()))]
    pub carla_tags: Option<CarlaTags>,
    /// Height of the recording LiDAR above the ground in metres, for KITTI and CARLA [default: what an export
    /// of this program says, else above the labelled road within 10 m; 1.73 for KITTI where the road lies so]
    #[cfg_attr(feature = "cli", arg(long, value_name = "M", conflicts_with = "nuscenes", value_parser = super::parse::number_as("1.73")))]
    pub lidar_height: Option<f64>,
}

impl DatasetArgs {
    /// Opens the scans of CARLA in a folder, and notes the height of their LiDAR.
    pub(super) fn carla(
        &self,
        folder: &Path,
        watcher: &dyn Watcher,
    ) -> Result<CarlaSequence, RunError> {
        let poses = self.poses.as_deref();
        let poses = poses.ok_or_else(|| RunError::Usage("--carla: give --poses, too".into()))?;
        let sequence = CarlaSequence::open(folder, poses, self.carla_tags, self.lidar_height)?;
        tell_notes(&sequence, watcher)?;
        watcher.detail(&format!(
            "{}: the LiDAR stands {:.2} m above the ground",
            folder.display(),
            sequence.lidar_height()
        ));
        Ok(sequence)
    }
}

/// Builds a P-SOG and writes it.
///
/// # Errors
/// Files that cannot be read or written, a scene without geometry, a region that makes no grid.
pub fn build(
    request: &BuildRequest,
    watcher: &dyn Watcher,
) -> Result<(Psog, BuildReport), RunError> {
    let _session = Session::begin();
    let BuildRequest { scene, vehicle, out, .. } = request;
    scene.iter().chain(vehicle).chain(&request.datasets.poses).for_each(|file| will_read(file));
    if let Some(folder) = &request.kitti {
        ["poses.txt", "calib.txt"].iter().for_each(|name| will_read(&folder.join(name)));
    }
    outputs::check_file(out, "npz")?;
    let (psog, report) = match scene {
        Some(scene) => of_scene(scene, vehicle.as_deref(), watcher)?,
        None => of_scans(request, watcher)?,
    };
    write(out, &psog)?;
    Ok((psog, report))
}

fn of_scene(
    path: &Path,
    vehicle: Option<&Path>,
    watcher: &dyn Watcher,
) -> Result<(Psog, BuildReport), RunError> {
    let scene = opening::read(path, vehicle, watcher)?;
    if !scene.has_geometry() {
        return Err(RunError::Usage(format!(
            "{}: has no geometry to scan; a P-SOG is built from static shapes and actors",
            path.display()
        )));
    }
    let settings = match scene.psog_source() {
        PsogSource::Scan(settings) => *settings,
        PsogSource::File(_) => ScanSettings::default_of(&scene),
    };
    let frames = scene.frame_count() as u64;
    let bar = watcher.bar(frames, Some("frames scanned for the P-SOG"));
    let go_on = |done: usize| {
        bar.set(done as u64, frames);
        watcher.goes_on()
    };
    let place = path.display().to_string();
    scan_scene(&scene, &scene.roi().grid()?, &settings, go_on)
        .map_err(|error| opening::stopped(error, &place, None, watcher))
}

/// The three numbers of an option.
fn triple(values: &[f64]) -> Result<[f64; 3], RunError> {
    values.try_into().map_err(|_| RunError::Usage(format!("{values:?}: give three numbers")))
}

fn of_scans(
    request: &BuildRequest,
    watcher: &dyn Watcher,
) -> Result<(Psog, BuildReport), RunError> {
    let (min, max) = (triple(&request.roi_min)?, triple(&request.roi_max)?);
    let roi = Roi::from_bounds(min, max, triple(&request.voxel)?).map_err(PsogError::from)?;
    let options = PsogOptions { window: request.window, ..PsogOptions::new(roi) };
    let sets = &request.datasets;
    let built = match (&request.kitti, &request.nuscenes, &request.carla) {
        (Some(folder), ..) => {
            let sequence = KittiSequence::open_at(folder, sets.lidar_height)?;
            tell_notes(&sequence, watcher)?;
            build_psog(&[sequence], &options)?
        }
        (_, Some(folder), _) => {
            let scenes = read_nuscenes(folder, sets.version.as_deref(), &request.scenes)?;
            scenes.iter().try_for_each(|scene| tell_notes(scene, watcher))?;
            build_psog(&scenes, &options)?
        }
        (.., Some(folder)) => build_psog(&[sets.carla(folder, watcher)?], &options)?,
        _ => return Err(RunError::Usage("give a scene, or labelled frames".to_owned())),
    };
    note_ground(&built.0, request.nuscenes.is_some(), watcher);
    Ok(built)
}

/// Passes the notes of a sequence's reader on.
pub(super) fn tell_notes(
    sequence: &dyn LabelledSequence,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    sequence.notes().iter().try_for_each(|note| watcher.tell(note))
}

/// Notes that no voxel holds ground: the scans were most likely placed at a wrong height.
fn note_ground(psog: &Psog, is_nuscenes: bool, watcher: &dyn Watcher) {
    let is_ground = Ground::among(psog.classes());
    let holds = |row: &[u16]| row.iter().zip(&is_ground).any(|(&count, &is)| is && count > 0);
    if is_ground.contains(&true) && !psog.rows().any(holds) {
        // The tables of nuScenes state the height of the LiDAR.
        let height = match is_nuscenes {
            true => "correct the translation of LIDAR_TOP in calibrated_sensor.json",
            false => "give the height of their LiDAR with --lidar-height",
        };
        watcher.note(&format!(
            "no voxel of the region holds ground (road, sidewalk, terrain and the like): where the scans have \
             some, {height}, or a region that reaches it"
        ));
    }
}

/// Adds up P-SOG files and writes the sum to `out`.
///
/// # Errors
/// Files that cannot be read or written, grids or classes that differ, no file.
pub fn merge(psogs: &[PathBuf], out: &Path) -> Result<(), RunError> {
    let _session = Session::begin();
    psogs.iter().for_each(|psog| will_read(psog));
    outputs::check_file(out, "npz")?;
    let Some((first, rest)) = psogs.split_first() else {
        return Err(RunError::Usage("give P-SOG files to merge".into()));
    };
    let mut sum = read_psog(first)?;
    if let Some(what) = repeated(psogs) {
        return Err(RunError::Usage(format!("{what}, and its frames count once; leave it out")));
    }
    for path in rest {
        sum = sum.merge(&read_psog(path)?).map_err(|error| {
            RunError::Usage(format!("{} and {}: {error}", first.display(), path.display()))
        })?;
    }
    write(out, &sum)
}

fn write(path: &Path, psog: &Psog) -> Result<(), RunError> {
    write_whole(path, |file| write_psog(file, psog).map_err(RunError::io(path)))
}
