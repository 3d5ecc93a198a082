//! Sorts the files of a command into scenes and placements.

use std::path::{Path, PathBuf};

use super::{Computing, RunError, Watcher};
use crate::json::FileKind;
use crate::problem::Problem;
pub use crate::vehicle::placement_file::file_and_name;
use crate::vehicle::placement_file::holds_placements;
use crate::vehicle::{
    Constraints, Doubts, ForeignLidar, Placement, PlacementFileError, SensorChoice, Sensors,
    Vehicle, name_lidars, read_placements, table_7, table_7_held_by,
};
use crate::{Note, files};

/// Largest file whose text is looked at to tell whether it is a scene, in bytes.
const MOST_LOOKED_AT: u64 = 1 << 28;

/// Scenes in the order given, and the file of placements where there is one.
pub struct Files {
    /// Scene files.
    pub scenes: Vec<PathBuf>,
    /// Placements.
    pub placements: Option<PathBuf>,
}

impl Files {
    /// Sorts files by their content: placements are a `.jsonl` file, standard input, or a document
    /// `{"placements": [ … ]}`; all others are scenes.
    ///
    /// # Errors
    /// Two files of placements, or placements without a scene.
    pub fn sort(files: &[PathBuf], watcher: &dyn Watcher) -> Result<Self, RunError> {
        let sorted = Self::told_apart(files)?;
        if let ([], Some(only)) = (&sorted.scenes[..], &sorted.placements) {
            return Err(RunError::Usage(format!(
                "{}: holds placements; give a scene to score them in before it",
                only.display()
            )));
        }
        note_repeated(&sorted.scenes, watcher);
        Ok(sorted)
    }

    /// Like [`Self::sort`], for a command that may do without a scene.
    ///
    /// # Errors
    /// Two files of placements; a file that cannot be read; a last file that is neither a scene nor placements.
    fn told_apart(files: &[PathBuf]) -> Result<Self, RunError> {
        files.iter().try_for_each(|file| can_be_read(file))?;
        let (placements, scenes): (Vec<PathBuf>, Vec<PathBuf>) =
            files.iter().cloned().partition(|file| holds_placements(file));
        if let ([_, .., last], true) = (files, placements.is_empty())
            && !may_be_scene(last)
        {
            // Its own fault is told: placements are the last file where there are any.
            read_placements(last)?;
            return Ok(Self {
                scenes: scenes[..scenes.len() - 1].to_vec(),
                placements: Some(last.clone()),
            });
        }
        if let [first, second, ..] = &placements[..] {
            return Err(RunError::Usage(format!(
                "{} and {}: both hold placements; give one such file",
                first.display(),
                second.display()
            )));
        }
        Ok(Self { scenes, placements: placements.into_iter().next() })
    }

    /// Scenes, and the file of placements, for a command that takes the vehicle's level ground where there is no scene.
    ///
    /// # Errors
    /// See [`Self::told_apart`]; neither a scene nor a vehicle.
    pub fn or_level_ground(
        files: &[PathBuf],
        computing: &Computing<'_>,
    ) -> Result<(Vec<PathBuf>, PathBuf), RunError> {
        let Self { mut scenes, placements } = Self::told_apart(files)?;
        let placements = placements.or_else(|| scenes.pop());
        let placements = placements
            .ok_or_else(|| RunError::Usage("give a file of placements to look at".to_owned()))?;
        if scenes.is_empty() && computing.vehicle.is_none() {
            return Err(RunError::Usage(format!(
                "{}: there is neither a scene nor a vehicle; give --vehicle FILE for level ground, or a scene before \
                 the placements",
                placements.display()
            )));
        }
        Ok((scenes, placements))
    }

    /// Like [`Self::sort`], for a command that needs placements. If no file looks like placements, the last one is
    /// taken for them, so that its own fault is reported.
    ///
    /// # Errors
    /// See [`Self::sort`]; a single file is an error, too.
    pub fn with_placements(
        files: &[PathBuf],
        watcher: &dyn Watcher,
    ) -> Result<(Vec<PathBuf>, PathBuf), RunError> {
        let Self { mut scenes, placements } = Self::sort(files, watcher)?;
        let placements = placements.or_else(|| scenes.pop());
        match (placements, scenes.is_empty()) {
            (Some(placements), false) => Ok((scenes, placements)),
            (only, _) => Err(RunError::Usage(format!(
                "{}: is the only file; give a scene, and the placements to score in it",
                only.as_deref().unwrap_or(Path::new("")).display()
            ))),
        }
    }
}

/// Checks, before any work begins, that a file is there and may be read. Pipes are not touched.
///
/// # Errors
/// The reason of the operating system.
pub fn can_be_read(file: &Path) -> Result<(), RunError> {
    let file = file.to_str().map_or(file, |text| Path::new(file_and_name(text).0));
    let is_stream = file == Path::new("-") || (file.exists() && !file.is_file() && !file.is_dir());
    let opened = if is_stream { Ok(()) } else { files::open(file).map(drop) };
    opened.map_err(|source| {
        let file = file.display();
        RunError::Usage(format!("{file}: cannot be read: {source}; give a scene, or placements"))
    })
}

/// False if a file is text that is no scene: no such object, and nowhere the key that scenes begin with.
fn may_be_scene(file: &Path) -> bool {
    let Ok(bytes) = files::read(file, MOST_LOOKED_AT) else { return true };
    let Ok(text) = std::str::from_utf8(&bytes) else { return true };
    FileKind::of(text).map_or(text.contains("\"sightline\""), |kind| kind == FileKind::Scene)
}

/// The first scene whose file was given before, in words.
pub fn repeated(scenes: &[PathBuf]) -> Option<String> {
    let file = |path: &PathBuf| std::fs::canonicalize(path).unwrap_or_else(|_| path.clone());
    scenes.iter().enumerate().find_map(|(k, scene)| {
        let first = scenes[..k].iter().find(|other| file(other) == file(scene))?;
        let what = match first == scene {
            true => "is given twice".to_owned(),
            false => format!("is the same file as {}", first.display()),
        };
        Some(format!("{}: {what}", scene.display()))
    })
}

/// Notes that a scene is given twice: a mean may weigh it so, but a spread over scenes is then too narrow.
pub fn note_repeated(scenes: &[PathBuf], watcher: &dyn Watcher) {
    if let Some(what) = repeated(scenes) {
        watcher.note(&format!(
            "{what} and counts twice in means; spreads over scenes then look narrower than they are"
        ));
    }
}

/// All placements of a file, or one by its name behind a colon.
///
/// # Errors
/// A file that cannot be read, or has no placement of the name.
pub fn named_placements(text: &str) -> Result<Vec<Placement>, RunError> {
    Ok(read_placements(text)?)
}

/// Most doubts that are noted: of a million placements in degrees the first few say enough.
const MOST_TOLD: u64 = 3;

/// Checks the placements of a file.
pub struct Given<'a> {
    file: PathBuf,
    sensors: Sensors,
    doubts: Doubts,
    choices: Vec<SensorChoice>,
    watcher: &'a dyn Watcher,
    found: u64,
}

impl<'a> Given<'a> {
    /// Checks placements against the sensors and mounts of a vehicle.
    pub fn new(
        file: &Path,
        sensors: &Sensors,
        constraints: &Constraints,
        computing: &Computing<'a>,
    ) -> Self {
        let (file, sensors, doubts) = (file.to_owned(), sensors.clone(), Doubts::of(constraints));
        let (choices, watcher) = (computing.sensors.clone(), computing.watcher);
        Self { file, sensors, doubts, choices, watcher, found: 0 }
    }

    /// Checks placements against the sensors and mounts of a problem.
    pub fn in_problem(file: &Path, problem: &Problem, computing: &Computing<'a>) -> Self {
        Self::new(file, problem.sensors(), problem.rules(), computing)
    }

    /// Leaves out doubts about the mount's rules, which the search reports; units are still checked.
    #[must_use]
    pub fn ruled(self) -> Self {
        Self { doubts: Doubts::of_units(), ..self }
    }

    /// Names LiDARs by `--sensor`, and checks some placements.
    ///
    /// # Errors
    /// A sensor that the vehicle does not have, or none where it has several.
    pub fn look<'p>(
        &mut self,
        placements: impl IntoIterator<Item = &'p mut Placement>,
    ) -> Result<(), RunError> {
        for placement in placements {
            let unknown = |source| PlacementFileError::Sensor { path: self.file.clone(), source };
            name_lidars(&self.choices, placement).map_err(unknown)?;
            self.sensors.check(placement).map_err(unknown)?;
            for doubt in self.doubts.about(placement) {
                self.found += 1;
                if self.found <= MOST_TOLD {
                    let doubt = Note::doubt(format!("{}: {doubt}", self.file.display()));
                    self.watcher.tell(&doubt)?;
                }
            }
        }
        Ok(())
    }

    /// Notes how many more doubts there are than were noted.
    pub fn finish(&self) {
        if self.found > MOST_TOLD {
            let (more, file) = (self.found - MOST_TOLD, self.file.display());
            self.watcher.note(&format!("{file}: {more} more LiDAR(s) have such a problem"));
        }
    }

    /// Checks all placements.
    ///
    /// # Errors
    /// See [`Self::look`].
    pub fn all<'p>(
        mut self,
        placements: impl IntoIterator<Item = &'p mut Placement>,
    ) -> Result<(), RunError> {
        self.look(placements)?;
        self.finish();
        Ok(())
    }
}

/// The layouts of Table 7 where a vehicle is the paper's car: one model, a mount that holds them; else none. See
/// [`name_published`] for their models.
///
/// # Errors
/// See [`name_published`].
pub fn held(
    vehicle: &Vehicle,
    sensors: &Sensors,
    computing: &Computing<'_>,
) -> Result<Vec<Placement>, RunError> {
    let mut layouts = table_7_held_by(vehicle);
    name_published(&mut layouts, sensors, computing)?;
    Ok(layouts)
}

/// The layouts of Table 7 of the paper. See [`name_published`] for their models.
///
/// # Errors
/// See [`name_published`].
pub fn published(sensors: &Sensors, computing: &Computing<'_>) -> Result<Vec<Placement>, RunError> {
    let mut layouts = table_7();
    name_published(&mut layouts, sensors, computing)?;
    Ok(layouts)
}

/// Names the models of layouts of the paper: by `--sensor`, else the first of several models, which is noted.
///
/// # Errors
/// A model of `--sensor` that the vehicle does not have.
pub fn name_published(
    layouts: &mut [Placement],
    sensors: &Sensors,
    computing: &Computing<'_>,
) -> Result<(), RunError> {
    for layout in layouts.iter_mut() {
        name_lidars(&computing.sensors, layout).map_err(wrong_choice)?;
    }
    if sensors.name_first(layouts) {
        let first = sensors.models()[0].name;
        computing.watcher.note(&format!(
            "LiDARs of the layouts of Table 7 are the vehicle's first model, `{first}`; --sensor all=MODEL \
             gives them another"
        ));
    }
    layouts.iter().try_for_each(|layout| sensors.check(layout)).map_err(wrong_choice)
}

fn wrong_choice(fault: ForeignLidar) -> RunError {
    RunError::Usage(format!("--sensor: {fault}"))
}
