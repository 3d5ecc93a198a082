//! Request of a run, its checkpoint, and the command that repeats it.

use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::files::{check_new_folder, holds_run};
use crate::job::{Job, JobError, JobFiles, JobState};
use crate::json::spoken;
use crate::problem::Problem;
use crate::report::words::{from_here, word};
use crate::runs::inputs::{Given, RESULT, can_be_read, note_unpriced, rig_path};
use crate::runs::{Computing, RunError, Watcher};
use crate::scene::Scene;
use crate::search::{FrameChoice, SearchError, Settings};
use crate::vehicle::placement_file::holds_placements;
use crate::vehicle::{MountRules, Vehicle, read_placements};

/// A search to begin or to go on with.
#[derive(Debug, Clone)]
pub struct OptimizeRequest {
    /// A new run, or one to go on with.
    pub start: Start,
    /// Seconds from the start after which the search ends.
    pub max_seconds: Option<f64>,
    /// Frames given; more than a scene has are worth a note.
    pub frames: Option<u32>,
    /// File for the first scene with the result, as binary glTF.
    pub gltf: Option<PathBuf>,
    /// Folder for each figure of the page.
    pub figures: Option<PathBuf>,
}

/// Start of a search.
#[derive(Debug, Clone)]
pub enum Start {
    /// A new run.
    New(Box<NewRun>),
    /// Folder of a stopped run, which goes on to the same bytes that it would have given.
    Resume(PathBuf),
}

/// A search that is to begin.
#[derive(Debug, Clone, Default)]
pub struct NewRun {
    /// Scenes, vehicle, rules, weather and budget.
    pub files: JobFiles,
    /// Folder of the run; `runs/SCENE`, numbered, if none.
    pub out: Option<PathBuf>,
    /// Score to maximize, in place of the settings' objective.
    pub objective: Option<String>,
    /// Settings of the search.
    pub settings: Settings,
    /// Placements to compare with, in place of Table 7 of the paper.
    pub baselines: Option<PathBuf>,
    /// More placements to start from.
    pub inject: Option<PathBuf>,
}

/// Files and options that a run was begun with.
#[derive(Clone, Serialize, Deserialize)]
pub(super) struct Begun {
    /// Files and options of the job; paths are absolute.
    #[serde(flatten)]
    pub files: JobFiles,
    /// File of the placements to compare with.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub baselines: Option<PathBuf>,
    /// File of the placements to start from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inject: Option<PathBuf>,
}

/// Content of a checkpoint.
#[derive(Serialize, Deserialize)]
pub(super) struct RunCheckpoint {
    pub begun: Begun,
    #[serde(flatten)]
    pub state: JobState,
}

impl Begun {
    /// Default name of the run's folder.
    pub(crate) fn folder(&self) -> String {
        let stem = self.files.scene.file_stem().unwrap_or_default().to_string_lossy();
        match self.files.more_scenes.len() {
            0 => stem.into_owned(),
            more => format!("{stem}-and-{more}-more"),
        }
    }

    /// Files and options in the keys of `result.json`. Its rules are the ones in force, be they of the vehicle or of an option.
    pub(crate) fn settings(&self, vehicle: &Vehicle) -> Value {
        let (mut all, ties) = (json!(self.files), vehicle.ties);
        all["rules"]["equal_height"] = json!(ties.equal_height);
        all["rules"]["symmetric"] = json!(ties.symmetric);
        all
    }
}

/// Refuses the folder of a run, and a file of placements, in the place of a scene; and a scene after the first that cannot
/// be read.
fn check_scenes(files: &JobFiles) -> Result<(), RunError> {
    for path in files.scenes() {
        let file = path.display();
        let fault = if path.join(RESULT).exists() || holds_run(path) {
            format!("is the folder of a run; go on with --resume {file}, or give a scene file")
        } else if path.is_file() && holds_placements(path) {
            "is a file of placements, where a scene belongs; give it by --baselines or --inject"
                .into()
        } else {
            continue;
        };
        return Err(RunError::Usage(format!("{file}: {fault}")));
    }
    for path in files.more_scenes.iter().filter(|path| can_be_read(path).is_err()) {
        files.read_scene(path)?;
    }
    Ok(())
}

/// Refuses a budget below the cheapest rig of a vehicle file. Other faults of that file are told where its scene is read.
fn check_budget(files: &JobFiles) -> Result<(), RunError> {
    // A pipe is read once.
    let file = files.vehicle.as_deref().filter(|file| files.budget.is_some() && file.is_file());
    let Some(Ok(ground)) = file.map(Scene::level_ground) else { return Ok(()) };
    match Job::new(ground).budget(files.budget).check_room() {
        Err(error @ JobError::Search(SearchError::Budget { .. })) => Err(error.into()),
        _ => Ok(()),
    }
}

impl NewRun {
    /// Files and options that the checkpoint keeps, and the settings, once all is checked that takes no scene.
    pub(super) fn checked(&self) -> Result<(Begun, Settings), RunError> {
        let checked = (self.begun()?, self.settings()?);
        self.out.as_deref().map_or(Ok(()), check_new_folder)?;
        Ok(checked)
    }

    /// Files and options that the checkpoint keeps.
    fn begun(&self) -> Result<Begun, RunError> {
        let absolute = |path: &PathBuf| whole_path(path).map_err(RunError::io(path));
        let files = &self.files;
        if files.scene.as_os_str().is_empty() {
            return Err(RunError::Usage("give a scene to search in".into()));
        }
        check_scenes(files)?;
        check_budget(files)?;
        let files = JobFiles {
            scene: absolute(&files.scene)?,
            more_scenes: files.more_scenes.iter().map(absolute).collect::<Result<_, _>>()?,
            vehicle: files.vehicle.as_ref().map(absolute).transpose()?,
            ..files.clone()
        };
        let rigs = |file: &Option<PathBuf>| -> Result<Option<PathBuf>, RunError> {
            file.as_ref().map(|file| absolute(&rig_path(file)?)).transpose()
        };
        Ok(Begun { files, baselines: rigs(&self.baselines)?, inject: rigs(&self.inject)? })
    }

    /// An error of reading the scenes, which names files as they were given where reading them again tells it.
    pub(super) fn as_given(&self, error: RunError) -> RunError {
        // A pipe is read once, and an engine that fails is no fault of a file.
        let is_plain = |path: &PathBuf| path.is_file() || !path.exists();
        let files = &self.files;
        let is_of_files = match &error {
            RunError::Interrupted(_) => false,
            RunError::Library(crate::Error::Job(error)) => error.of_engine().is_none(),
            _ => true,
        };
        if !is_of_files || !files.scenes().chain(&files.vehicle).all(is_plain) {
            return error;
        }
        let again = files.scenes().find_map(|path| files.read_scene(path).err());
        again.map_or(error, RunError::from)
    }

    /// The settings with the objective and the placements of the request.
    fn settings(&self) -> Result<Settings, RunError> {
        let mut settings = self.settings.clone();
        if let Some(text) = &self.objective {
            settings.objective = text.parse()?;
        }
        if let Some(file) = &self.baselines {
            settings.baselines = read_placements(rig_path(file)?)?;
        }
        if let Some(file) = &self.inject {
            settings.starts = read_placements(rig_path(file)?)?;
        }
        Ok(settings)
    }

    /// Looks at the placements of the request's files; rules of the mount that they break stand in the result. Notes a score
    /// to end at that no placement reaches.
    pub(super) fn look(
        &self,
        settings: &mut Settings,
        problem: &Problem,
        computing: &Computing<'_>,
    ) -> Result<(), RunError> {
        if let ([choice, ..], None, None) = (&computing.sensors[..], &self.baselines, &self.inject)
        {
            return Err(RunError::Usage(format!(
                "--sensor {choice}: names LiDARs of a file of placements; give one with --baselines or \
                 --inject, or leave it out"
            )));
        }
        note_target(settings, computing.watcher);
        let files =
            [(&self.baselines, &mut settings.baselines), (&self.inject, &mut settings.starts)];
        for (file, placements) in files {
            if let Some(file) = file {
                Given::in_problem(file, problem, computing).ruled().all(placements)?;
            }
        }
        Ok(())
    }
}

/// Notes a score to end at above the largest share, such as one in per cent; a search on to its end may be meant.
fn note_target(settings: &Settings, watcher: &dyn Watcher) {
    let (Some(target), Some(most)) = (settings.target, settings.objective.most()) else { return };
    if target > most {
        let share = target / 100.0;
        let hint = match share <= most {
            true => format!("; {target} % is --enough {}", spoken(share)),
            false => String::new(),
        };
        watcher.note(&format!(
            "--enough {target}: no placement has more than {} by {}, so the search goes on to its end{hint}",
            spoken(most),
            settings.objective
        ));
    }
}

/// An absolute path that is the same from every folder: without `..`, unless a link makes that another file.
fn whole_path(path: &Path) -> std::io::Result<PathBuf> {
    let (given, mut plain) = (std::path::absolute(path)?, PathBuf::new());
    for part in given.components() {
        match part {
            Component::ParentDir => _ = plain.pop(),
            part => plain.push(part),
        }
    }
    let leads_to = |path: &Path| path.canonicalize().ok();
    Ok(if leads_to(&plain) == leads_to(&given) { plain } else { given })
}

/// The command that asks how far each LiDAR of a run's result may be off, for a shell in the same folder.
pub(super) fn tolerance_command(begun: &Begun, folder: &Path) -> String {
    let files = &begun.files;
    let mut words = vec!["sightline study tolerance".to_owned()];
    let paths = files.scenes().map(PathBuf::as_path).chain([folder]);
    words.extend(paths.map(|path| word(&from_here(path))));
    let vehicle = files.vehicle.as_deref().map(from_here);
    words.extend(vehicle.map(|file| format!("--vehicle {}", word(&file))));
    words.extend(files.conditions.iter().map(|one| format!("--condition {}", word(one))));
    words.join(" ")
}

/// A file as `result.json` names it in the command: the same from every folder.
pub(super) fn in_full(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// The command line of a run's files and settings, each file as `name` has it; with `max_seconds` where time ended the run.
pub(super) fn command(
    begun: &Begun,
    settings: &Settings,
    max_seconds: Option<f64>,
    name: fn(&Path) -> String,
) -> String {
    let mut words = vec!["sightline".to_owned(), "optimize".to_owned()];
    words.extend(begun.files.scenes().map(|scene| word(&name(scene))));
    let mut give = |option: &str, value: Option<String>| {
        words.extend(value.map(|value| format!("--{option} {}", word(&value))));
    };
    let number = |value: Option<f64>| value.map(|value| value.to_string());
    // Hundredths as they were written: 7 % are no 7.000000000000001.
    let percent = |share: Option<f64>| number(share.map(|share| (1e11 * share).round() / 1e9));
    give("vehicle", begun.files.vehicle.as_deref().map(name));
    give("budget", number(begun.files.budget));
    give("tolerance", begun.files.tolerance.map(|tolerance| tolerance.to_string()));
    give("objective", Some(settings.objective.to_string()));
    give("method", json!(settings.method).as_str().map(str::to_owned));
    give("seed", Some(settings.seed.to_string()));
    give("evaluations", Some(settings.evaluations.to_string()));
    give("population", settings.population.map(|count| count.to_string()));
    give("enough", number(settings.target));
    give("max-seconds", number(max_seconds));
    give("bound", percent(settings.gap));
    give("delta", settings.delta.map(|delta| format!("{},{}", delta.metres, delta.radians)));
    match settings.frames {
        FrameChoice::OnDemand => {}
        FrameChoice::All => give("fidelity", Some("full".to_owned())),
        FrameChoice::Count(frames) => give("frames", Some(frames.to_string())),
    }
    for condition in &begun.files.conditions {
        give("condition", Some(condition.clone()));
    }
    let MountRules { equal_height, symmetric, fixed } = &begun.files.rules;
    for (field, value) in fixed {
        give("fix", Some(format!("{field}={value}")));
    }
    give("baselines", begun.baselines.as_deref().map(name));
    give("inject", begun.inject.as_deref().map(name));
    let flags = [
        ("mirror", begun.files.mirror),
        ("fewest", begun.files.fewest),
        ("symmetric", *symmetric),
        ("equal-height", *equal_height),
    ];
    words
        .extend(flags.into_iter().filter(|(_, given)| *given).map(|(name, _)| format!("--{name}")));
    words.join(" ")
}

/// Notes before a choice of sensors: on sensors without a price, and on the number that `--fewest` begins with.
pub(super) fn note_choice(files: &JobFiles, vehicle: &Vehicle, watcher: &dyn Watcher) {
    note_unpriced(vehicle, files.budget.is_some(), watcher);
    if files.fewest && vehicle.needs_two() {
        watcher.note(
            "--fewest begins with 2 sensors: one LiDAR alone can never meet a requirement that must hold without any one",
        );
    }
}
