//! Questions that take many runs, in folders of their own that can be resumed.

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::inputs::{
    Files, Given, can_be_read, file_and_name, fit_alone, note_repeated, note_unpriced,
};
use super::run_folder::{rig_path, with_run_scenes};
use super::{Bar, Computing, Conditions, GRACE, RunError, Watcher, opening};
use crate::files;
use crate::files::{Input, RunDir, holds_run, is_forced, safe_names};
use crate::report::study::study_plot;
use crate::scan::conditions::in_words;
use crate::scene::Scene;
use crate::study::{Kind, Row, StudyObserver, StudySettings, Subregion, Table, study};
use crate::vehicle::placement_file::holds_placements;
use crate::vehicle::read_placements;

/// A study of scene files.
#[derive(Debug, Clone)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct StudyRequest {
    /// Kind of the study
    #[cfg_attr(feature = "cli", arg(value_parser = super::parse::kinds()))]
    pub kind: Kind,
    /// Scene files, and for some kinds a file of own rigs behind them
    ///
    /// `transfer` looks at all scenes together, every other kind at one after the other; `loss`, `random`, `regions`, `voxels`
    /// and `weather` take own rigs.
    #[cfg_attr(feature = "cli", arg(required = true))]
    pub scenes: Vec<PathBuf>,
    /// Folder for the study [default: studies/SCENE-KIND]
    ///
    /// With several scenes, a folder in it for each.
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR"))]
    pub out: Option<PathBuf>,
    /// Score to maximize where placements are searched
    #[cfg_attr(feature = "cli", arg(long, default_value_t = StudySettings::default().objective.to_string()))]
    pub objective: String,
    /// Placements that each search evaluates before swaps
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = StudySettings::default().evaluations, value_parser = super::parse::at_least_one))]
    pub evaluations: u64,
    /// Frames to average over, spread evenly [default: 2, all for `loss` of own rigs]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: Option<u32>,
    /// Random placements, where the study draws some
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = StudySettings::default().random, value_parser = clap::value_parser!(u32).range(2..=100_000)))]
    pub random: u32,
    /// Most that the sensors may cost, in the vehicle's currency
    ///
    /// For kinds that search placements.
    #[cfg_attr(feature = "cli", arg(long, value_name = "PRICE", value_parser = super::parse::price))]
    pub budget: Option<f64>,
    /// Sensor file to compare, for `channels`; may be given several times
    #[cfg_attr(feature = "cli", arg(long = "sensor-file", alias = "sensor", value_name = "FILE"))]
    pub sensors: Vec<PathBuf>,
    /// Further region, for `regions`: NAME:x0,y0,z0,x1,y1,z1 in metres; may be given several times
    #[cfg_attr(feature = "cli", arg(long = "box", value_name = "BOX", value_parser = super::parse::parse_box))]
    pub regions: Vec<Subregion>,
    /// Edge of a voxel in metres, for `published` [default: 0.1, as in the paper]
    #[cfg_attr(feature = "cli", arg(long, value_name = "M", value_parser = super::parse::metres))]
    pub voxel: Option<f64>,
    /// Seed of all randomness
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", default_value_t = StudySettings::default().seed, value_parser = super::parse::whole::<u64>))]
    pub seed: u64,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
}

/// Makes the study, a folder for each scene or one for all together, until the watcher stops it. Calls `each` with
/// every table and its folder.
///
/// # Errors
/// Files that cannot be read or written, a folder with another study, errors of [`study`] and of `each`.
pub fn study_scenes(
    request: &StudyRequest,
    computing: &Computing<'_>,
    mut each: impl FnMut(&Table, &Path) -> Result<(), RunError>,
) -> Result<Vec<Table>, RunError> {
    let _session = files::Session::begin();
    let (given, computing) = &match request.kind.takes_placements() {
        true => with_run_scenes(&request.scenes, computing)?,
        false => (request.scenes.clone(), computing.clone()),
    };
    let Files { scenes: paths, placements } = match request.kind {
        kind if kind.takes_placements() => Files::sort(given, computing.watcher)?,
        kind => only_scenes(kind, given, computing.watcher)?,
    };
    let settings = settings(request, computing)?;
    computing.watcher.listen(GRACE);
    // A kind that needs several scenes takes them together; any other kind takes one after the other.
    let together = request.kind == Kind::Transfer || paths.len() == 1;
    if together {
        request.kind.check_scenes(paths.len())?;
    }
    let each_of: Vec<&[PathBuf]> = if together { vec![&paths] } else { paths.chunks(1).collect() };
    let stem = |scenes: &&[PathBuf]| {
        scenes[0].file_stem().unwrap_or_default().to_string_lossy().into_owned()
    };
    let stems: Vec<String> = each_of.iter().map(stem).collect();
    let (names, mut tables) = (safe_names(stems.iter().map(|stem| &**stem)), Vec::new());
    for (scenes, name) in each_of.iter().zip(&names) {
        let folder = match &request.out {
            Some(out) if together => out.clone(),
            Some(out) => out.join(name),
            None => PathBuf::from("studies").join(format!("{name}-{}", request.kind.name())),
        };
        let given = placements.as_deref();
        let found = of_scenes(request, (scenes, given), &settings, &folder, computing)?;
        each(&found, &folder)?;
        tables.push(found);
        if !computing.watcher.goes_on() {
            break;
        }
    }
    Ok(tables)
}

/// Scenes of a study that takes no placements.
fn only_scenes(kind: Kind, files: &[PathBuf], watcher: &dyn Watcher) -> Result<Files, RunError> {
    let files = &files.iter().map(|file| rig_path(file)).collect::<Result<Vec<_>, _>>()?[..];
    files.iter().try_for_each(|file| can_be_read(file))?;
    // A single pipe may be a scene: nothing is read of it here.
    let is_plain =
        |file: &Path| file.to_str().is_some_and(|text| Path::new(file_and_name(text).0).is_file());
    let may_be = |file: &Path| files.len() > 1 || is_plain(file);
    if let Some(file) = files.iter().find(|file| may_be(file) && holds_placements(file)) {
        let (file, kind) = (file.display(), kind.name());
        let takers = Kind::ALL.iter().filter(|(kind, ..)| kind.takes_placements());
        let takers: Vec<String> = takers.map(|(_, name, _)| format!("`{name}`")).collect();
        return Err(RunError::Usage(format!(
            "{file}: holds placements, which `study {kind}` does not take, as it searches its own; {}, `nearfield`, \
             `targets`, `redundancy`, `overlap`, `sweep` and `tolerance` do",
            takers.join(", ")
        )));
    }
    note_repeated(files, watcher);
    Ok(Files { scenes: files.to_vec(), placements: None })
}

fn settings(request: &StudyRequest, computing: &Computing<'_>) -> Result<StudySettings, RunError> {
    let standard = StudySettings::default();
    Ok(StudySettings {
        objective: request.objective.parse()?,
        evaluations: request.evaluations,
        frames: request.frames.unwrap_or(standard.frames),
        random: request.random,
        voxel: request.voxel.unwrap_or(standard.voxel),
        seed: request.seed,
        sensors: request.sensors.clone(),
        regions: request.regions.clone(),
        placements: Vec::new(),
        budget: request.budget,
        conditions: request.conditions.condition.clone(),
        engine: computing.engine.clone(),
    })
}

/// The study of one scene, or of several together, in its folder.
fn of_scenes(
    request: &StudyRequest,
    (paths, placements): (&[PathBuf], Option<&Path>),
    settings: &StudySettings,
    folder: &Path,
    computing: &Computing<'_>,
) -> Result<Table, RunError> {
    let watcher = computing.watcher;
    // The study of weather has a job for each condition.
    let together =
        if request.kind == Kind::Weather { &[][..] } else { &request.conditions.condition };
    let mut settings = settings.clone();
    if let Some(file) = placements {
        settings.placements = read_placements(file)?;
        fit_alone(file, &settings.placements, computing)?;
    }
    if !holds_run(folder) {
        files::check_new_folder(folder)?;
    }
    let files = opening::files(paths, together, request.frames, computing);
    let job = opening::job(&files, computing)?.job;
    let scenes = job.scenes();
    if let Some(file) = placements {
        Given::in_problem(file, &*job.problem()?, computing).whole(&mut settings.placements)?;
        if matches!(request.kind, Kind::Loss | Kind::Weather) {
            opening::note_relief(&job, watcher)?;
        }
        // Own rigs are compared with the result of a run, which is over all frames.
        if request.kind == Kind::Loss && request.frames.is_none() {
            let frames = scenes.iter().map(|scene| scene.scene().frame_count());
            settings.frames = frames.max().unwrap_or(1) as u32;
        }
    }
    if request.kind == Kind::Cost || request.budget.is_some() {
        note_unpriced(scenes[0].scene().vehicle(), true, watcher);
    }
    if request.kind.searches(placements.is_some()) {
        job.check_room()?;
    }
    let (settings, read) = (&settings, scenes.iter().map(|scene| &**scene.scene()));
    let mut recorded = recorded(request, paths, settings, read)?;
    placements.map_or(Ok(()), |file| recorded.add_rigs(file))?;
    let (dir, mut known) = open_folder(folder, &recorded)?;
    let session = StudySession::new(&dir, &recorded, watcher);
    let found = study(request.kind, scenes, settings, &mut known, &session);
    if let Some(error) = session.failed.take() {
        return Err(error);
    }
    let found = found.map_err(|error| RunError::from(error).discarding(&dir))?;
    session.finish(&known, &found)?;
    Ok(found)
}

/// Number of the layout of rows: an interrupted study of another layout does not go on. 2: gains in per cent. 3: scores
/// after each loss.
const ROWS: u32 = 3;

/// Files of a study, and the settings that decide about its numbers.
struct Recorded {
    settings: Value,
    inputs: Vec<Input>,
}

impl Recorded {
    /// Adds a file of rigs, and the name behind it where it has one.
    fn add_rigs(&mut self, file: &Path) -> Result<(), RunError> {
        let (path, name) = file.to_str().map_or((file, None), |text| {
            let (path, name) = file_and_name(text);
            (Path::new(path), name)
        });
        self.inputs.push(Input::read(path)?);
        if let Some(name) = name {
            self.settings["placement"] = json!(name);
        }
        Ok(())
    }
}

#[derive(Serialize, Deserialize)]
struct StudyCheckpoint {
    settings: Value,
    rows: Vec<Row>,
}

/// The folder of a study and the rows that it holds; one that holds another study is an error.
fn open_folder(
    folder: &Path,
    recorded: &Recorded,
) -> Result<(RunDir<StudyCheckpoint>, Vec<Row>), RunError> {
    if is_forced() || !holds_run(folder) {
        let dir = RunDir::create("study", Some(folder), "", recorded.inputs.clone())?;
        return Ok((dir, Vec::new()));
    }
    let (dir, saved): (RunDir<StudyCheckpoint>, StudyCheckpoint) = RunDir::resume("study", folder)?;
    if saved.settings != recorded.settings {
        return Err(RunError::Usage(format!(
            "{}: holds a study of other settings; name another folder with --out",
            folder.display()
        )));
    }
    dir.check(&recorded.inputs)?;
    Ok((dir, saved.rows))
}

/// A study under way, as its folder and the watcher see it.
struct StudySession<'a> {
    dir: &'a RunDir<StudyCheckpoint>,
    recorded: &'a Recorded,
    bar: Box<dyn Bar>,
    watcher: &'a dyn Watcher,
    done: Cell<u64>,
    cases: Cell<u64>,
    /// True once the engine was named: engines are opened again and again.
    is_named: Cell<bool>,
    /// Why the rows could not be written, which ends the study.
    failed: RefCell<Option<RunError>>,
}

impl StudyObserver for StudySession<'_> {
    fn begins(&self, cases: usize) {
        self.cases.set(cases as u64);
        self.bar.set(self.done.get(), self.cases.get());
    }

    fn opened(&self, notes: &[String]) {
        if !self.is_named.replace(true) {
            notes.iter().for_each(|note| self.watcher.note(note));
        }
    }

    fn measured(&self, rows: &[Row]) {
        let saved =
            StudyCheckpoint { settings: self.recorded.settings.clone(), rows: rows.to_vec() };
        if let Err(error) = self.dir.save(&saved) {
            self.failed.replace(Some(error.into()));
        }
    }

    fn done(&self) {
        self.done.set(self.done.get() + 1);
        self.bar.set(self.done.get(), self.cases.get());
    }

    fn goes_on(&self) -> bool {
        self.watcher.goes_on() && self.failed.borrow().is_none()
    }
}

impl<'a> StudySession<'a> {
    fn new(
        dir: &'a RunDir<StudyCheckpoint>,
        recorded: &'a Recorded,
        watcher: &'a dyn Watcher,
    ) -> Self {
        Self {
            dir,
            recorded,
            bar: watcher.bar(0, Some("cases")),
            watcher,
            done: Cell::default(),
            cases: Cell::default(),
            is_named: Cell::new(false),
            failed: RefCell::default(),
        }
    }

    /// Writes the table and its chart, with the cases there are.
    fn finish(&self, rows: &[Row], found: &Table) -> Result<(), RunError> {
        let Recorded { settings, inputs } = self.recorded;
        let notes = &found.notes;
        let study = json!({ "settings": settings, "inputs": inputs, "rows": rows, "notes": notes });
        self.dir.write_json("study.json", &study)?;
        self.dir.write_text("table.csv", &found.csv())?;
        Ok(self.dir.write_text("chart.svg", &study_plot(found).svg())?)
    }
}

/// Files of a study of some scenes, and the settings that decide about its numbers.
fn recorded<'s>(
    request: &StudyRequest,
    paths: &[PathBuf],
    settings: &StudySettings,
    scenes: impl Iterator<Item = &'s Scene>,
) -> Result<Recorded, RunError> {
    let absolute = |paths: &[PathBuf]| -> Result<Vec<PathBuf>, RunError> {
        paths.iter().map(|p| std::path::absolute(p).map_err(RunError::io(p))).collect()
    };
    let mut inputs = Vec::new();
    for scene in scenes {
        inputs.extend(Input::of(scene.files())?);
    }
    for sensor in &settings.sensors {
        inputs.push(Input::read(sensor)?);
    }
    let mut recorded = json!({
        "sightline": env!("CARGO_PKG_VERSION"),
        "study": request.kind.name(),
        "rows": ROWS,
        "scenes": absolute(paths)?,
        "objective": request.objective,
        "evaluations": settings.evaluations,
        "frames": settings.frames,
        "random": settings.random,
        "sensors": absolute(&settings.sensors)?,
        "boxes": settings.regions.iter().map(|region| format!("{region:?}")).collect::<Vec<_>>(),
        "voxel": request.voxel,
        "seed": settings.seed,
    });
    if settings.budget.is_some() {
        recorded["budget"] = json!(settings.budget);
    }
    if !settings.conditions.is_empty() {
        recorded["conditions"] = json!(in_words(&settings.conditions));
    }
    Ok(Recorded { settings: recorded, inputs })
}
