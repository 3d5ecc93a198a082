//! Sorts the files of a command into scenes and placements.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use super::opening::vehicle_alone;
use super::run_folder::{RESULT, rig_file, rig_path, vehicle_of_run};
use super::{Computing, RunError, Watcher};
use crate::json::{FileKind, ForeignJson, counted};
use crate::problem::Problem;
use crate::scene::Scene;
pub(super) use crate::vehicle::placement_file::file_and_name;
use crate::vehicle::placement_file::holds_placements;
use crate::vehicle::{
    Constraints, Doubts, ForeignLidar, Placement, PlacementFileError, SensorChoice, SensorPose,
    Sensors, Vehicle, name_lidars, read_placements, table_7_held_by,
};
use crate::{Note, files};

/// Message for a file of placements that stands without a scene.
const PLACEMENTS_ALONE: &str = "holds placements; give a scene to score them in before it, or look at requirements on level \
                                ground: `study targets`, `study tolerance` and `study sweep` take --vehicle FILE without a \
                                scene";
/// Largest file whose text is looked at to tell whether it is a scene, in bytes.
const MOST_LOOKED_AT: u64 = 1 << 28;

/// Scenes in the order given, and the file of placements where there is one.
pub(crate) struct Files {
    /// Scene files.
    pub scenes: Vec<PathBuf>,
    /// Placements.
    pub placements: Option<PathBuf>,
}

impl Files {
    /// Sorts files by their content: placements are a `.jsonl` file, standard input, or a document
    /// `{"placements": [ … ]}`; all others are scenes.
    pub(crate) fn sort(files: &[PathBuf], watcher: &dyn Watcher) -> Result<Self, RunError> {
        let sorted = Self::told_apart(files)?;
        if let ([], Some(only)) = (&sorted.scenes[..], &sorted.placements) {
            return Err(RunError::Usage(format!("{}: {PLACEMENTS_ALONE}", only.display())));
        }
        note_repeated(&sorted.scenes, watcher);
        Ok(sorted)
    }

    /// Like [`Self::sort`], for a command that may do without a scene.
    ///
    /// # Errors
    /// Two files of placements; a file that cannot be read; a last file that is neither a scene nor placements.
    pub(crate) fn told_apart(files: &[PathBuf]) -> Result<Self, RunError> {
        let (scenes, placements) = told_apart(files)?;
        if let [first, second, ..] = &placements[..] {
            return Err(both_hold(first, second));
        }
        Ok(Self { scenes, placements: placements.into_iter().next() })
    }

    /// Scenes, and one file of placements or several, for a command that needs both.
    pub(crate) fn with_rigs(
        files: &[PathBuf],
        watcher: &dyn Watcher,
    ) -> Result<(Vec<PathBuf>, Vec<PathBuf>), RunError> {
        let (scenes, placements) = told_apart(files)?;
        if scenes.is_empty() || placements.len() < 2 {
            let (scenes, placements) = Self::with_placements(files, watcher)?;
            return Ok((scenes, vec![placements]));
        }
        note_repeated(&scenes, watcher);
        Ok((scenes, placements))
    }

    /// Scenes, and the file of placements, for a command that takes the vehicle's level ground where there is no scene.
    pub(crate) fn or_level_ground(
        files: &[PathBuf],
        computing: &Computing<'_>,
    ) -> Result<(Vec<PathBuf>, PathBuf), RunError> {
        let Self { mut scenes, placements } = Self::told_apart(files)?;
        let placements = placements.or_else(|| scenes.pop());
        let placements = placements
            .ok_or_else(|| RunError::Usage("give a file of placements to look at".to_owned()))?;
        if scenes.is_empty() && computing.vehicle.is_none() {
            return Err(no_ground(placements.display()));
        }
        Ok((scenes, placements))
    }

    /// Like [`Self::sort`], for a command that needs placements. If no file looks like placements, the last one is
    /// taken for them, so that its own fault is reported.
    pub(crate) fn with_placements(
        files: &[PathBuf],
        watcher: &dyn Watcher,
    ) -> Result<(Vec<PathBuf>, PathBuf), RunError> {
        let Self { mut scenes, placements } = Self::told_apart(files)?;
        let alone = match placements {
            Some(_) => PLACEMENTS_ALONE,
            None => "is the only file; give a scene, and the placements to score in it",
        };
        let placements = placements.or_else(|| scenes.pop());
        note_repeated(&scenes, watcher);
        match (placements, scenes.is_empty()) {
            (Some(placements), false) => Ok((scenes, placements)),
            (only, _) => {
                let only = only.as_deref().unwrap_or(Path::new("")).display();
                Err(RunError::Usage(format!("{only}: {alone}")))
            }
        }
    }
}

/// Error of two files of placements for a command that takes one.
fn both_hold(first: &Path, second: &Path) -> RunError {
    let [first, second] = [first, second].map(Path::display);
    RunError::Usage(format!("{first} and {second}: both hold placements; give one such file"))
}

/// Refuses placements, or the folder of a run, in the place of a scene where placements stand behind it as well. A pipe may
/// be a scene: nothing is read of it here.
pub(super) fn no_second(scene: &Path, placements: &Path) -> Result<(), RunError> {
    let (Ok(first), Ok(second)) = (rig_path(scene), rig_path(placements)) else { return Ok(()) };
    let plain = first.to_str().map_or(&*first, |text| Path::new(file_and_name(text).0));
    match plain.is_file() && holds_placements(&first) && holds_placements(&second) {
        true => Err(both_hold(&first, &second)),
        false => Ok(()),
    }
}

/// Error of placements that stand on no ground: neither a scene nor a vehicle is given.
pub(super) fn no_ground(placements: impl Display) -> RunError {
    RunError::Usage(format!(
        "{placements}: there is neither a scene nor a vehicle; give --vehicle FILE for level ground, or a scene before \
         the placements"
    ))
}

/// Refuses the folder of a run in the place of a scene.
pub(super) fn no_run_folder(scene: &Path) -> Result<(), RunError> {
    if !scene.join(RESULT).is_file() {
        return Ok(());
    }
    Err(RunError::Usage(format!(
        "{}: is the folder of a run, where a scene belongs; give a scene first, and the folder behind it for its result",
        scene.display()
    )))
}

/// Scenes, and files of placements; folders of runs stand for their results.
fn told_apart(files: &[PathBuf]) -> Result<(Vec<PathBuf>, Vec<PathBuf>), RunError> {
    let files = &files.iter().map(|file| rig_path(file)).collect::<Result<Vec<_>, _>>()?[..];
    files.iter().try_for_each(|file| can_be_read(file))?;
    let (placements, scenes): (Vec<PathBuf>, Vec<PathBuf>) =
        files.iter().cloned().partition(|file| holds_placements(file));
    if let ([_, .., last], true) = (files, placements.is_empty())
        && !may_be_scene(last)
    {
        // Its own fault is told: placements are the last file where there are any.
        read_placements(last)?;
        return Ok((scenes[..scenes.len() - 1].to_vec(), vec![last.clone()]));
    }
    Ok((scenes, placements))
}

/// Checks, before any work begins, that a file is there and may be read. Pipes are not touched.
pub(crate) fn can_be_read(file: &Path) -> Result<(), RunError> {
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
    let has_version = || text.contains("\"sightline\"") && ForeignJson::of(text).is_none();
    FileKind::of(text).map_or_else(has_version, |kind| kind == FileKind::Scene)
}

/// The first scene whose file was given before, in words.
pub(crate) fn repeated(scenes: &[PathBuf]) -> Option<String> {
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

/// Notes that a scene is given twice: a mean may weigh it so, but an interval over scenes is then too narrow.
pub(crate) fn note_repeated(scenes: &[PathBuf], watcher: &dyn Watcher) {
    if let Some(what) = repeated(scenes) {
        watcher.note(&format!(
            "{what} and counts twice in means; intervals over scenes look narrower than they are, but for the interval \
             of a search, which counts it once"
        ));
    }
}

/// Notes sensors of a vehicle's mounts that have no price, which count as 0: where others have one, or where `is_priced`
/// says that prices matter.
pub(crate) fn note_unpriced(vehicle: &Vehicle, is_priced: bool, watcher: &dyn Watcher) {
    let is_mounted = |name| vehicle.mounts.iter().any(|mount| mount.sensors.contains(&name));
    let mounted = vehicle.sensors.iter().filter(|sensor| is_mounted(sensor.name));
    let (free, priced): (Vec<_>, Vec<_>) = mounted.partition(|sensor| !sensor.has_price);
    if vehicle.is_nameless() || free.is_empty() || (priced.is_empty() && !is_priced) {
        return;
    }
    let names: Vec<String> = free.iter().map(|sensor| format!("`{}`", sensor.name)).collect();
    let [have, count, each] = match free.len() {
        1 => ["has", "counts", "it"],
        _ => ["have", "count", "each"],
    };
    let names = names.join(", ");
    watcher.note(&format!(
        "{names} {have} no price and {count} as 0; give {each} a `price` in `sensors` of the vehicle"
    ));
}

/// All placements of a file, or one by its name behind a colon; see [`rig_file`] for folders of runs.
pub(crate) fn named_placements(text: &str) -> Result<Vec<Placement>, RunError> {
    Ok(read_placements(rig_file(text)?)?)
}

/// Most doubts that are noted: of a million placements in degrees the first few say enough.
const MOST_TOLD: u64 = 3;

pub(crate) struct Given<'a> {
    file: PathBuf,
    sensors: Sensors,
    doubts: Doubts,
    choices: Vec<SensorChoice>,
    watcher: &'a dyn Watcher,
    found: u64,
    /// LiDARs of the largest placement so far.
    most_lidars: usize,
    /// True once a LiDAR was without a model before [`Self::choices`] gave it one.
    named_any: bool,
}

impl<'a> Given<'a> {
    /// Checks placements against the sensors and mounts of a vehicle.
    pub(crate) fn new(
        file: &Path,
        sensors: &Sensors,
        constraints: &Constraints,
        computing: &Computing<'a>,
    ) -> Self {
        let (file, sensors, doubts) = (file.to_owned(), sensors.clone(), Doubts::of(constraints));
        let (choices, watcher) = (computing.sensors.clone(), computing.watcher);
        let (found, most_lidars, named_any) = (0, 0, false);
        Self { file, sensors, doubts, choices, watcher, found, most_lidars, named_any }
    }

    /// Checks placements against the sensors and mounts of a problem.
    pub(crate) fn in_problem(file: &Path, problem: &Problem, computing: &Computing<'a>) -> Self {
        Self::new(file, problem.sensors(), problem.rules(), computing)
    }

    /// Leaves out doubts about the mount's rules, which the search reports; units are still checked.
    #[must_use]
    pub(crate) fn ruled(self) -> Self {
        Self { doubts: Doubts::of_units(), ..self }
    }

    /// Names LiDARs by `--sensor`, and checks some placements.
    pub(crate) fn look<'p>(
        &mut self,
        placements: impl IntoIterator<Item = &'p mut Placement>,
    ) -> Result<(), RunError> {
        self.check_models()?;
        for placement in placements {
            self.most_lidars = self.most_lidars.max(placement.lidars.len());
            self.named_any |= placement.lidars.iter().any(|pose| pose.sensor.is_none());
            self.name(placement)?;
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

    /// Names LiDARs by `--sensor`, and checks that the vehicle has the models.
    fn name(&self, placement: &mut Placement) -> Result<(), RunError> {
        let unknown = |source| self.unknown(source);
        name_lidars(&self.choices, placement).map_err(unknown)?;
        self.sensors.check(placement).map_err(unknown)
    }

    /// Error about the model of a LiDAR; names the vehicle of the run that wrote the file, where the scene has no names.
    fn unknown(&self, source: ForeignLidar) -> RunError {
        let error = PlacementFileError::of(&self.file, source);
        let is_nameless = self.sensors.models().iter().all(|model| model.name.is_none());
        match vehicle_of_run(&self.file).filter(|_| is_nameless) {
            Some(vehicle) => RunError::Usage(format!(
                "{error}; give --vehicle {vehicle}, with which this run was made"
            )),
            None => error.into(),
        }
    }

    /// Refuses models of `--sensor` that the vehicle does not have, whether a LiDAR would get them or not, and two for one.
    fn check_models(&self) -> Result<(), RunError> {
        for (k, choice) in self.choices.iter().enumerate() {
            if self.choices[..k].iter().any(|before| before.lidar == choice.lidar) {
                let told = "names the model of a LiDAR a second time; give it once";
                return Err(RunError::Usage(format!("--sensor {choice}: {told}")));
            }
            let pose = SensorPose { sensor: choice.sensor, ..SensorPose::at(0.0, 0.0, 0.0) };
            let found = self.sensors.number(&pose);
            found.map_err(|why| RunError::Usage(format!("--sensor {choice}: {why}")))?;
        }
        Ok(())
    }

    /// Checks that each choice of `--sensor` meets a LiDAR of the placements looked at; notes choices that change nothing.
    pub(crate) fn check_choices(&self) -> Result<(), RunError> {
        let most = self.most_lidars;
        let beyond = |choice: &&SensorChoice| choice.lidar.is_some_and(|lidar| lidar >= most);
        if let Some(choice) = self.choices.iter().find(beyond).filter(|_| most > 0) {
            let (file, last) = (self.file.display(), most - 1);
            return Err(RunError::Usage(format!(
                "--sensor {choice}: no placement of {file} has such a LiDAR; indices go from 0 to {last}"
            )));
        }
        if let Some(choice) = self.choices.first().filter(|_| most > 0 && !self.named_any) {
            let file = self.file.display();
            self.watcher.note(&format!(
                "--sensor {choice} changes nothing: every LiDAR of {file} names its model"
            ));
        }
        Ok(())
    }

    /// Checks all placements of the command, and the choices of `--sensor`.
    pub(crate) fn whole<'p>(
        self,
        placements: impl IntoIterator<Item = &'p mut Placement>,
    ) -> Result<(), RunError> {
        self.all(placements)?.check_choices()
    }

    /// Notes how many more doubts there are than were noted.
    pub(crate) fn finish(&self) {
        if self.found > MOST_TOLD {
            let (more, file) = (self.found - MOST_TOLD, self.file.display());
            let more = counted(more as usize, "more LiDAR");
            self.watcher.note(&format!("{file}: such a problem with {more}"));
        }
    }

    pub(crate) fn all<'p>(
        mut self,
        placements: impl IntoIterator<Item = &'p mut Placement>,
    ) -> Result<Self, RunError> {
        self.look(placements)?;
        self.finish();
        Ok(self)
    }
}

/// Checks, before a large scene is read, that the vehicle of a file beside it has the models of placements. Returns that
/// vehicle on level ground, and the placements with the models of `--sensor`; `None` where no vehicle file tells them.
pub(crate) fn fit_alone(
    file: &Path,
    placements: &[Placement],
    computing: &Computing<'_>,
) -> Result<Option<(Scene, Vec<Placement>)>, RunError> {
    let Some(ground) = vehicle_alone(computing) else { return Ok(None) };
    let Ok(sensors) = ground.sensors() else { return Ok(None) };
    let given = Given::new(file, &sensors, &ground.rules(), computing);
    given.check_models()?;
    let mut named = placements.to_vec();
    named.iter_mut().try_for_each(|placement| given.name(placement))?;
    Ok(Some((ground, named)))
}

/// The layouts of Table 7 where a vehicle is the paper's car: one model, a mount that holds them; else none.
pub(crate) fn held(
    vehicle: &Vehicle,
    sensors: &Sensors,
    computing: &Computing<'_>,
) -> Result<Vec<Placement>, RunError> {
    name_published(table_7_held_by(vehicle), sensors, computing)
}

/// Names the models of layouts of the paper: by `--sensor`, else the first of several models, which is noted.
pub(crate) fn name_published(
    mut layouts: Vec<Placement>,
    sensors: &Sensors,
    computing: &Computing<'_>,
) -> Result<Vec<Placement>, RunError> {
    for layout in &mut layouts {
        name_lidars(&computing.sensors, layout).map_err(wrong_choice)?;
    }
    if sensors.name_first(&mut layouts) {
        let first = sensors.models()[0].name;
        computing.watcher.note(&format!(
            "LiDARs of the layouts of Table 7 are the vehicle's first model, `{first}`; --sensor all=MODEL \
             gives them another"
        ));
    }
    layouts.iter().try_for_each(|layout| sensors.check(layout)).map_err(wrong_choice)?;
    Ok(layouts)
}

fn wrong_choice(fault: ForeignLidar) -> RunError {
    RunError::Usage(format!("--sensor: {fault}"))
}
