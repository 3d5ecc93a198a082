//! P-SOG files from scenes, from labelled scans, and from other P-SOG files.

use std::path::{Path, PathBuf};

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

/// Data that a P-SOG is built from.
#[derive(Debug, Clone)]
pub enum PsogInput {
    /// The geometry of a scene file, and the vehicle file that takes the place of its vehicle.
    Scene(PathBuf, Option<PathBuf>),
    /// Labelled scans.
    Scans(Scans),
}

/// Labelled scans, and the grid that their P-SOG is to have.
#[derive(Debug, Clone)]
pub struct Scans {
    /// Data set that holds them.
    pub set: DataSet,
    /// Frames merged into each one, before and after it; all if none.
    pub window: Option<u32>,
    /// Lower and upper corner of the region, metres.
    pub region: [[f64; 3]; 2],
    /// Edges of a voxel, metres.
    pub voxel: [f64; 3],
}

/// Labelled scans of a public data set.
#[derive(Debug, Clone)]
pub enum DataSet {
    /// A sequence of SemanticKITTI, and its LiDAR's height above the ground in metres where the sequence does not
    /// say it and it is no car of KITTI.
    Kitti(PathBuf, Option<f64>),
    /// A set of nuScenes with lidarseg, the version of its tables, and its scenes; all if none.
    Nuscenes(PathBuf, Option<String>, Vec<String>),
    /// Scans of CARLA.
    Carla(CarlaScans),
}

impl DataSet {
    /// Announces the files whose names are known before they are read.
    fn will_read(&self) {
        match self {
            Self::Kitti(folder, _) => {
                ["poses.txt", "calib.txt"].iter().for_each(|name| will_read(&folder.join(name)));
            }
            Self::Nuscenes(..) => {}
            Self::Carla(scans) => will_read(&scans.poses),
        }
    }
}

/// Scans of CARLA's semantic LiDAR.
#[derive(Debug, Clone)]
pub struct CarlaScans {
    /// Folder.
    pub folder: PathBuf,
    /// CSV of the LiDAR's transforms.
    pub poses: PathBuf,
    /// Version whose tags the points have; the one that the road fits if none.
    pub tags: Option<CarlaTags>,
    /// Height of the LiDAR above the ground in metres; above the road of the first scan if none.
    pub lidar_height: Option<f64>,
}

impl CarlaScans {
    /// Opens the scans, and notes the height of their LiDAR.
    pub(super) fn open(&self, watcher: &dyn Watcher) -> Result<CarlaSequence, RunError> {
        let sequence =
            CarlaSequence::open(&self.folder, &self.poses, self.tags, self.lidar_height)?;
        tell_notes(&sequence, watcher)?;
        watcher.detail(&format!(
            "{}: the LiDAR stands {:.2} m above the ground",
            self.folder.display(),
            sequence.lidar_height()
        ));
        Ok(sequence)
    }
}

/// Builds a P-SOG and writes it to `out`.
///
/// # Errors
/// Files that cannot be read or written, a scene without geometry, a region that makes no grid.
pub fn build(
    source: &PsogInput,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(Psog, BuildReport), RunError> {
    let _session = Session::begin();
    match source {
        PsogInput::Scene(scene, vehicle) => {
            std::iter::once(scene).chain(vehicle).for_each(|file| will_read(file));
        }
        PsogInput::Scans(scans) => scans.set.will_read(),
    }
    outputs::check_file(out, "npz")?;
    let (psog, report) = match source {
        PsogInput::Scene(scene, vehicle) => of_scene(scene, vehicle.as_deref(), watcher)?,
        PsogInput::Scans(scans) => of_scans(scans, watcher)?,
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

fn of_scans(scans: &Scans, watcher: &dyn Watcher) -> Result<(Psog, BuildReport), RunError> {
    let [min, max] = scans.region;
    let roi = Roi::from_bounds(min, max, scans.voxel).map_err(PsogError::from)?;
    let options = PsogOptions { window: scans.window, ..PsogOptions::new(roi) };
    let built = match &scans.set {
        DataSet::Kitti(folder, height) => {
            let sequence = KittiSequence::open_at(folder, *height)?;
            tell_notes(&sequence, watcher)?;
            build_psog(&[sequence], &options)?
        }
        DataSet::Nuscenes(folder, version, names) => {
            let scenes = read_nuscenes(folder, version.as_deref(), names)?;
            scenes.iter().try_for_each(|scene| tell_notes(scene, watcher))?;
            build_psog(&scenes, &options)?
        }
        DataSet::Carla(scans) => build_psog(&[scans.open(watcher)?], &options)?,
    };
    note_ground(&built.0, watcher);
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
fn note_ground(psog: &Psog, watcher: &dyn Watcher) {
    let is_ground = Ground::among(psog.classes());
    let holds = |row: &[u16]| row.iter().zip(&is_ground).any(|(&count, &is)| is && count > 0);
    if is_ground.contains(&true) && !psog.rows().any(holds) {
        watcher.note(
            "no voxel of the region holds ground (road, sidewalk, terrain and the like): where the scans have \
             some, give the height of their LiDAR with --lidar-height, or a region that reaches it",
        );
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
