//! Scenes of maps in other formats and of labelled scans, written as scene files.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::target::SceneOutput;
use crate::datasets::{ImportOptions, ImportedScene, LabelledSequence, read_nuscenes, to_scene};
use crate::files::{FileError, Session, writable_file, write_whole};
use crate::runs::psog::{CarlaScans, tell_notes};
use crate::runs::{RunError, Watcher};
use crate::scene::Scene;
use crate::worlds::{import_opendrive, read_opendrive};

/// Source of a scene: a map, or labelled scans.
#[derive(Debug, Clone)]
pub enum Origin {
    /// Roads and lanes of an OpenDRIVE file; all that it does not say comes from the seed.
    OpenDrive {
        /// `.xodr`; a compressed file is refused with the command that unpacks it.
        file: PathBuf,
        /// Seed of everything that the map does not say.
        seed: u64,
        /// Frames, a tenth of a second apart.
        frames: usize,
    },
    /// Scans of nuScenes with lidarseg.
    Nuscenes {
        /// Folder of the set.
        folder: PathBuf,
        /// Version of its tables, if there are several.
        version: Option<String>,
        /// Names of scenes.
        scenes: Vec<String>,
        /// Edge of the cells of plates and boxes, metres.
        cell: f64,
    },
    /// Scans of CARLA's semantic LiDAR, and the edge of the cells of plates and boxes in metres.
    Carla(CarlaScans, f64),
}

/// Makes a scene and writes it to `out`.
///
/// # Errors
/// Files that cannot be read or written, a map or a set of another format.
pub fn import(origin: &Origin, out: &Path, watcher: &dyn Watcher) -> Result<(), RunError> {
    let _session = Session::begin();
    match origin {
        Origin::OpenDrive { file, seed, frames } => opendrive(file, *seed, *frames, out, watcher),
        Origin::Nuscenes { folder, version, scenes, cell } => {
            let scenes = read_nuscenes(folder, version.as_deref(), scenes)?;
            scenes.iter().try_for_each(|scene| {
                tell_notes(scene, watcher)?;
                of_scans(scene, *cell, out, watcher)
            })
        }
        Origin::Carla(scans, cell) => of_scans(&scans.open(watcher)?, *cell, out, watcher),
    }
}

fn opendrive(
    file: &Path,
    seed: u64,
    frames: usize,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    let name = file.to_string_lossy();
    if file.is_dir() {
        return Err(RunError::Usage(format!(
            "{name}: is a folder; say which set it holds, by --nuscenes --scene NAME or by --carla --poses FILE, or give \
             the .xodr file in it"
        )));
    }
    if !matches!(name.rsplit('.').next(), Some("xodr" | "gz")) {
        return Err(RunError::Usage(format!(
            "{name}: is of no format that is imported; give an OpenDRIVE file with the ending .xodr"
        )));
    }
    let target = SceneOutput::new(out, Some(file))?;
    let text = read_opendrive(file)?;
    let world = import_opendrive(&text, &file.display().to_string(), seed, frames)?;
    world.notes().iter().try_for_each(|note| watcher.tell(note))?;
    target.write(world.mesh(), &world.scene(&target.name(), &target.mesh_name()), watcher)
}

/// Plates, boxes and actors of labelled scans.
fn of_scans(
    sequence: &dyn LabelledSequence,
    cell: f64,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    writable_file(out)?;
    let imported = to_scene(sequence, &ImportOptions { cell })?;
    let ImportedScene { scene, plates, boxes, actors } = imported;
    let text = serde_json::to_string(&scene)
        .map_err(|source| FileError::Json { path: out.to_owned(), source })?;
    // A scene that this program would refuse is not written.
    let read = Scene::from_json(&text, out.parent().unwrap_or(out), &out.display().to_string())?;
    write_whole(out, |file| writeln!(file, "{text}").map_err(RunError::io(out)))?;
    watcher.note(&format!(
        "{} frames, {plates} plates of ground, {boxes} boxes, {actors} actors in {}",
        read.frame_count(),
        out.display()
    ));
    Ok(())
}
