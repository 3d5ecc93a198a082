//! A data set that grows scan by scan.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use sightline_files::files::FileError;
use sightline_scan::Scan;

use super::folder::{ABOUT, About, Folder, INCOMPLETE};
use super::plan::{Label, Planned, check_map, of_classes, plan};
use super::{Checked, DatasetSettings, FormatError, Layout, SceneFacts, kitti, nuscenes, record};

/// A data set folder that grows scan by scan, of one placement; several scenes are sequences of it.
///
/// Frames may be written in any order and at the same time. Each is there whole or not at all.
pub struct Dataset {
    folder: Folder,
    settings: DatasetSettings,
    scenes: Vec<SceneFacts>,
    plan: Vec<Planned>,
    labels: Vec<Vec<Label>>,
    /// Frames of other sets that are to lie on the same disk.
    others: u64,
    /// Tells whether the size of a frame was held against the room on the disk.
    measured: AtomicBool,
}

/// Facts known of a data set before anything is written.
struct PreparedDataset {
    about: About,
    plan: Vec<Planned>,
    labels: Vec<Vec<Label>>,
    folder: Folder,
}

/// Text that was written.
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

impl PreparedDataset {
    fn new(dir: &Path, settings: &DatasetSettings, scenes: &[SceneFacts]) -> Checked<Self> {
        let plan = plan(settings, scenes)?;
        check_map(scenes, &settings.map)?;
        let mut labels = Vec::new();
        if settings.layout == Layout::SemanticKitti {
            let path = std::path::absolute(dir).map_err(FileError::io(dir))?;
            if path.to_string_lossy().contains("velodyne") {
                return Err(refused!(
                    "{}: has `velodyne` in its path, which loaders of SemanticKITTI replace by `labels`; name another \
                     folder",
                    path.display()
                ));
            }
        }
        if settings.layout != Layout::Npz {
            for scene in scenes {
                labels.push(of_classes(scene, &settings.map)?);
            }
        }
        let about = About::new(settings, scenes, &plan);
        about.is_in(dir)?;
        let folder = Folder::at(dir)?;
        Ok(Self { about, plan, labels, folder })
    }
}

impl Dataset {
    /// Checks all that [`Self::create`] checks, writes nothing, and counts the frames that are not there.
    pub fn check(
        dir: &Path,
        settings: &DatasetSettings,
        scenes: &[SceneFacts],
    ) -> Result<usize, FormatError> {
        let folder = PreparedDataset::new(dir, settings, scenes)?.folder;
        Ok(missing(&folder, scenes))
    }

    /// Makes the folder, or goes on with one that the same settings and files have begun.
    ///
    /// # Errors
    /// Whatever the layout cannot hold (a class without a label, a scene without frames, more scenes than
    /// names), a folder of something else, a path that breaks loaders; nothing is written then.
    pub fn create(
        dir: &Path,
        settings: &DatasetSettings,
        scenes: &[SceneFacts],
    ) -> Result<Self, FormatError> {
        let PreparedDataset { about, plan, labels, .. } =
            PreparedDataset::new(dir, settings, scenes)?;
        let folder = Folder::open(dir)?;
        // The second of two programs that found the folder empty finds the set of the first.
        let _claim = folder.claim();
        let known = about.is_in(dir)?;
        let set = Self {
            folder,
            settings: settings.clone(),
            scenes: scenes.to_vec(),
            plan,
            labels,
            others: 0,
            measured: AtomicBool::new(false),
        };
        if !known {
            set.folder.put_json(ABOUT, &about)?;
        } else if set.missing() > 0 {
            // Frames of a complete set may be gone since; its first description stays as it was written.
            let mut begun = About::read(dir)?;
            begun.complete = false;
            set.folder.put_json(ABOUT, &begun)?;
        }
        set.say_missing()?;
        Ok(set)
    }

    /// Says how many frames of other sets are to follow on the same disk, which must have room for them, too.
    #[must_use]
    pub fn ahead_of(self, others: u64) -> Self {
        Self { others, ..self }
    }

    /// Writes into `INCOMPLETE.txt` which frames are missing; to be called where a run is ended early.
    ///
    /// # Errors
    /// A full disk.
    pub fn say_missing(&self) -> Result<(), FormatError> {
        let missing = self.missing();
        if missing == 0 {
            return Ok(());
        }
        let frames: usize = self.scenes.iter().map(|scene| scene.frames.len()).sum();
        let mut words = format!(
            "When this was written, {missing} of {frames} frames were missing; the same command again \
             writes them.\n"
        );
        for (k, (scene, planned)) in self.scenes.iter().zip(&self.plan).enumerate() {
            let lacks = |frame: &usize| !self.has(k, *frame);
            let ranges = ranges(&scene.frames, lacks);
            if !ranges.is_empty() {
                words +=
                    &format!("{} ({}): frames {}\n", scene.name, planned.name, ranges.join(", "));
            }
        }
        self.folder.put(INCOMPLETE, words.as_bytes()).map(drop)
    }

    /// True if a frame, by its number in the scene, is there whole.
    pub fn has(&self, scene: usize, frame: usize) -> bool {
        self.folder.has(scene, frame)
    }

    /// True if the frame's tables state how much of each box is seen: keyframes of nuScenes.
    pub(super) fn tells_visibility(&self, scene: usize, frame: usize) -> bool {
        let frames = self.scenes.get(scene).map_or(&[][..], |scene| &scene.frames);
        let keyframe = |at: usize| at.is_multiple_of(self.settings.keyframe_every);
        self.settings.layout == Layout::Nuscenes && frames.binary_search(&frame).is_ok_and(keyframe)
    }

    /// Writes a scan of a scene, by its number; replaces files of that frame.
    ///
    /// # Errors
    /// A scan that was not announced, a full disk.
    pub fn write(&self, scene: usize, scan: &Scan) -> Result<(), FormatError> {
        let frame = scan.frame;
        let planned =
            self.scenes.get(scene).zip(self.plan.get(scene)).and_then(|(facts, planned)| {
                Some((facts, planned, facts.frames.binary_search(&frame).ok()?))
            });
        let Some((facts, planned, at)) = planned else {
            return Err(refused!(
                "frame {frame} of scene {scene} is not among those that the data set was made for"
            ));
        };
        if scan.classes[..] != facts.classes[..] {
            let (name, what) = (&facts.name, "its classes are others than announced");
            return Err(refused!("frame {frame} of the scene `{name}`: {what}"));
        }
        let (folder, name) = (&self.folder, &planned.name);
        let record = match self.settings.layout {
            Layout::Npz => record::write(folder, name, at, scan)?,
            Layout::SemanticKitti => {
                kitti::write(folder, name, at, scan, &self.labels[scene], &self.settings)?
            }
            Layout::Nuscenes => {
                let counts = super::Split::ALL
                    .map(|split| self.plan.iter().filter(|at| at.split == split).count());
                let about = nuscenes::SceneExport { settings: &self.settings, planned, counts };
                nuscenes::write(folder, about, at, scan, &self.labels[scene])?
            }
        };
        folder.keep(scene, &record)?;
        if !self.measured.swap(true, Ordering::Relaxed) {
            let bytes: u64 = record.files.iter().map(|file| file.bytes).sum();
            let frames = self.others.saturating_add(self.missing() as u64);
            folder.check_space(bytes.saturating_mul(frames))?;
        }
        Ok(())
    }

    /// Frames of a scene that are not there, by their numbers in it; none of a scene that the set does not have.
    pub fn missing_of(&self, scene: usize) -> Vec<usize> {
        let frames = self.scenes.get(scene).map_or(&[][..], |scene| &scene.frames);
        frames.iter().copied().filter(|&frame| !self.has(scene, frame)).collect()
    }

    fn missing(&self) -> usize {
        missing(&self.folder, &self.scenes)
    }

    /// Writes tables, poses and lists, and marks the folder as whole.
    ///
    /// # Errors
    /// Frames that are missing, a full disk.
    pub fn finish(self) -> Result<Summary, FormatError> {
        let frames: usize = self.scenes.iter().map(|scene| scene.frames.len()).sum();
        let mut summary = Summary { scenes: self.scenes.len(), frames, points: 0, bytes: 0 };
        for (scene, frame) in all_frames(&self.scenes) {
            let Some(record) = self.folder.whole(scene, frame) else {
                self.say_missing()?;
                let (path, name) = (self.folder.root.display(), &self.scenes[scene].name);
                return Err(refused!(
                    "{path}: {} of {frames} frames are missing, the first is frame {frame} of `{name}`; run again to \
                     write them",
                    self.missing()
                ));
            };
            summary.points += record.points;
            summary.bytes += record.files.iter().map(|file| file.bytes).sum::<u64>();
        }
        let (folder, each) = (&self.folder, self.settings.each_lidar);
        match self.settings.layout {
            Layout::Npz => {}
            Layout::SemanticKitti => kitti::finish(folder, &self.scenes, &self.plan, each)?,
            Layout::Nuscenes => {
                nuscenes::finish(folder, &self.settings, &self.scenes, &self.plan)?;
            }
        }
        let mut about = About::read(&folder.root)?;
        about.complete = true;
        folder.sync();
        folder.put_json(ABOUT, &about)?;
        folder.remove(INCOMPLETE)?;
        folder.sync();
        Ok(summary)
    }
}

/// Frames of all scenes: the number of the scene, and that in it.
fn all_frames(scenes: &[SceneFacts]) -> impl Iterator<Item = (usize, usize)> {
    let all = scenes.iter().enumerate();
    all.flat_map(|(i, scene)| scene.frames.iter().map(move |&frame| (i, frame)))
}

fn missing(folder: &Folder, scenes: &[SceneFacts]) -> usize {
    all_frames(scenes).filter(|&(scene, frame)| !folder.has(scene, frame)).count()
}

/// Numbers of a rising list that are wanted, those that follow one another as one range.
fn ranges(numbers: &[usize], wanted: impl Fn(&usize) -> bool) -> Vec<String> {
    let runs = numbers.chunk_by(|a, b| wanted(a) == wanted(b) && a + 1 == *b);
    let runs = runs.filter(|run| wanted(&run[0]));
    let range = |run: &[usize]| match run {
        [only] => only.to_string(),
        _ => format!("{} to {}", run[0], run[run.len() - 1]),
    };
    runs.map(range).collect()
}
