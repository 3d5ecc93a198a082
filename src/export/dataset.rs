//! A data set that grows scan by scan.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use serde::{Deserialize, Serialize};

use super::folder::Folder;
use super::labels::{Label, of_classes};
use super::plan::{Planned, plan};
use super::{DatasetSettings, ExportError, Layout, SceneFacts, kitti, npz, nuscenes};
use crate::files::FileError;
use crate::scan::Scan;

/// Says what the folder holds, and whether it is whole.
const ABOUT: &str = "dataset.json";
/// Stands in the folder as long as it is not whole.
const INCOMPLETE: &str = "INCOMPLETE.txt";

/// All of `dataset.json`.
#[derive(Serialize, Deserialize)]
struct About {
    dataset: u32,
    complete: bool,
    settings: DatasetSettings,
    /// What each scene is called in the data set, and what it is for.
    called: Vec<Called>,
    scenes: Vec<SceneFacts>,
}

#[derive(Serialize, Deserialize, PartialEq)]
struct Called {
    scene: String,
    name: String,
    split: super::Split,
}

/// A data set folder that grows scan by scan, of one placement; several scenes are sequences of it.
///
/// Frames may be written in any order and at the same time. Each is there whole or not at all.
pub struct Dataset {
    folder: Folder,
    settings: DatasetSettings,
    scenes: Vec<SceneFacts>,
    plan: Vec<Planned>,
    labels: Vec<Vec<Label>>,
    /// Whether the size of a frame was held against the room on the disk.
    measured: AtomicBool,
}

/// What was written.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Summary {
    /// Scenes.
    pub scenes: usize,
    /// Frames of all scenes.
    pub frames: usize,
    /// Points of all frames.
    pub points: u64,
    /// Bytes of the frames' files.
    pub bytes: u64,
}

impl Dataset {
    /// Makes the folder, or goes on with one that the same settings have begun.
    ///
    /// # Errors
    /// Whatever the layout cannot hold (a class without a label, a scene without frames, more scenes than
    /// names), a folder of something else, a path that breaks loaders; nothing is written then.
    pub fn create(
        dir: &Path,
        settings: &DatasetSettings,
        scenes: &[SceneFacts],
    ) -> Result<Self, ExportError> {
        let plan = plan(settings, scenes)?;
        let mut labels = Vec::new();
        if settings.layout == Layout::SemanticKitti {
            let path = std::path::absolute(dir).map_err(ExportError::io(dir))?;
            if path.to_string_lossy().contains("velodyne") {
                return Err(ExportError::Velodyne { path });
            }
        }
        if settings.layout != Layout::Npz {
            for scene in scenes {
                labels.push(of_classes(scene, &settings.map)?);
            }
        }
        let called = scenes.iter().zip(&plan).map(|(scene, planned)| Called {
            scene: scene.name.clone(),
            name: planned.name.clone(),
            split: planned.split,
        });
        let about = About {
            dataset: 1,
            complete: false,
            settings: settings.clone(),
            called: called.collect(),
            scenes: scenes.to_vec(),
        };
        let known = check_folder(dir, &about)?;
        let folder = Folder::open(dir)?;
        let set = Self {
            folder,
            settings: settings.clone(),
            scenes: scenes.to_vec(),
            plan,
            labels,
            measured: AtomicBool::new(false),
        };
        if !known {
            set.folder.put_json(ABOUT, &about)?;
            set.say_incomplete()?;
        }
        Ok(set)
    }

    fn say_incomplete(&self) -> Result<(), ExportError> {
        let frames: usize = self.scenes.iter().map(|scene| scene.frames.len()).sum();
        let words = format!(
            "This data set is being written: {frames} frames in all. The same command again goes on.\n"
        );
        self.folder.put(INCOMPLETE, words.as_bytes()).map(drop)
    }

    /// Whether a frame, by its number in the scene, is there whole.
    pub fn has(&self, scene: usize, frame: usize) -> bool {
        self.folder.has(scene, frame)
    }

    /// Writes a scan of the scene of a number; what was there of that frame is replaced.
    ///
    /// # Errors
    /// A scan that was not announced, a full disk.
    pub fn write(&self, scene: usize, scan: &Scan) -> Result<(), ExportError> {
        let frame = scan.frame;
        let unplanned = ExportError::Unplanned { scene, frame };
        let Some((facts, planned)) = self.scenes.get(scene).zip(self.plan.get(scene)) else {
            return Err(unplanned);
        };
        let at = facts.frames.binary_search(&frame).map_err(|_| unplanned)?;
        if scan.classes[..] != facts.classes[..] {
            let (scene, what) =
                (facts.name.clone(), "its classes are others than announced".into());
            return Err(ExportError::Scan { scene, frame, what });
        }
        let (folder, name) = (&self.folder, &planned.name);
        let record = match self.settings.layout {
            Layout::Npz => npz::write(folder, name, at, scan)?,
            Layout::SemanticKitti => {
                kitti::write(folder, name, at, scan, &self.labels[scene], &self.settings)?
            }
            Layout::Nuscenes => {
                let counts = super::Split::ALL
                    .map(|split| self.plan.iter().filter(|at| at.split == split).count());
                let about = nuscenes::About { settings: &self.settings, planned, counts };
                nuscenes::write(folder, about, at, scan, &self.labels[scene])?
            }
        };
        folder.keep(scene, &record)?;
        if !self.measured.swap(true, Ordering::Relaxed) {
            let bytes: u64 = record.files.iter().map(|file| file.bytes).sum();
            let missing = self.missing().0 as u64;
            folder.check_space(bytes.saturating_mul(missing))?;
        }
        Ok(())
    }

    /// Frames of a scene that are not there, by their numbers in it; none of a scene that the set does not have.
    pub fn missing_of(&self, scene: usize) -> Vec<usize> {
        let frames = self.scenes.get(scene).map_or(&[][..], |scene| &scene.frames);
        frames.iter().copied().filter(|&frame| !self.has(scene, frame)).collect()
    }

    /// Frames that are not there, and the first of them.
    fn missing(&self) -> (usize, Option<(usize, usize)>) {
        let all = self.scenes.iter().enumerate();
        let all = all.flat_map(|(i, scene)| scene.frames.iter().map(move |&frame| (i, frame)));
        let mut missing = all.filter(|&(scene, frame)| !self.has(scene, frame));
        let first = missing.next();
        (usize::from(first.is_some()) + missing.count(), first)
    }

    /// Writes tables, poses and lists, and marks the folder as whole.
    ///
    /// # Errors
    /// Frames that are missing, a full disk.
    pub fn finish(self) -> Result<Summary, ExportError> {
        let frames: usize = self.scenes.iter().map(|scene| scene.frames.len()).sum();
        if let (missing, Some((scene, frame))) = self.missing() {
            let (path, scene) = (self.folder.root().to_owned(), self.scenes[scene].name.clone());
            return Err(ExportError::Incomplete { path, missing, frames, scene, frame });
        }
        let (folder, each) = (&self.folder, self.settings.each_lidar);
        match self.settings.layout {
            Layout::Npz => {}
            Layout::SemanticKitti => kitti::finish(folder, &self.scenes, &self.plan, each)?,
            Layout::Nuscenes => {
                nuscenes::finish(folder, &self.settings, &self.scenes, &self.plan)?;
            }
        }
        let mut summary = Summary { scenes: self.scenes.len(), frames, points: 0, bytes: 0 };
        for (i, scene) in self.scenes.iter().enumerate() {
            for &frame in &scene.frames {
                let record = folder.record(i, frame)?;
                summary.points += record.points;
                summary.bytes += record.files.iter().map(|file| file.bytes).sum::<u64>();
            }
        }
        let mut about = read_about(folder.root())?;
        about.complete = true;
        folder.put_json(ABOUT, &about)?;
        folder.remove(INCOMPLETE)?;
        Ok(summary)
    }
}

fn read_about(dir: &Path) -> Result<About, ExportError> {
    let path = dir.join(ABOUT);
    let text = std::fs::read_to_string(&path).map_err(FileError::io(&path))?;
    serde_json::from_str(&text).map_err(ExportError::json(&path))
}

/// Whether the folder holds this very data set; an empty one or none holds nothing.
fn check_folder(dir: &Path, wanted: &About) -> Result<bool, ExportError> {
    let mut entries = match std::fs::read_dir(dir) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(false),
        entries => entries.map_err(ExportError::io(dir))?,
    };
    if !dir.join(ABOUT).is_file() {
        // A run that ended before it could say what it makes leaves the hidden folder alone.
        let foreign =
            entries.any(|entry| entry.is_ok_and(|entry| entry.file_name() != ".sightline"));
        return if foreign {
            Err(ExportError::Foreign { path: dir.to_owned() })
        } else {
            Ok(false)
        };
    }
    let found = read_about(dir)?;
    let difference = if found.settings != wanted.settings {
        "settings, placement or conditions"
    } else if found.scenes != wanted.scenes {
        "scenes or frames"
    } else if found.called != wanted.called || found.dataset != wanted.dataset {
        "another version of the program"
    } else {
        return Ok(true);
    };
    let (path, difference) = (dir.to_owned(), difference.to_owned());
    Err(ExportError::OtherSettings { path, difference })
}
