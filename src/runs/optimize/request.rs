//! Request of a run, its checkpoint, and the command that repeats it.

use std::path::{Component, Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::early;
use crate::files::{Input, RunDir, check_new_folder};
use crate::job::{FRONT_EVALUATIONS, FrontObjectives, JobFiles, JobState};
use crate::json::spoken;
use crate::problem::Problem;
use crate::report::words::{from_here, word};
use crate::runs::inputs::{Given, fit_alone, note_repeated, note_unpriced};
use crate::runs::opening::Loaded;
#[cfg(feature = "cli")]
use crate::runs::parse;
use crate::runs::run_folder::rig_path;
use crate::runs::{
    Computing, Conditions, FiguresOut, Gltf, MountingArgs, RunError, TableFormat, Watcher, opening,
    outputs,
};
use crate::scan::conditions::in_words;
use crate::search::{FrameChoice, Method, Settings, TimeLimit};
use crate::vehicle::{MountRules, Spacing, Vehicle, read_placements};

/// A search to begin or to go on with: of one placement, or of a front where objectives of one are given.
#[derive(Debug, Clone, Default)]
#[cfg_attr(feature = "cli", derive(clap::Args))]
pub struct OptimizeRequest {
    /// Scene files; of several the mean is maximized
    ///
    /// They share LiDAR and mount; each is normalized by its own total.
    #[cfg_attr(
        feature = "cli",
        arg(value_name = "SCENE", required_unless_present = "resume", conflicts_with = "resume")
    )]
    pub scenes: Vec<PathBuf>,
    /// Add each scene mirrored left to right, so that a result is not lopsided because one street is
    #[cfg_attr(feature = "cli", arg(long, conflicts_with = "resume"))]
    pub mirror: bool,
    /// Folder for the run [default: runs/SCENE, numbered if it is taken]
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR", conflicts_with = "resume"))]
    pub out: Option<PathBuf>,
    /// Go on with an interrupted run, to the same bytes that it would have given; a finished one says where its result is
    ///
    /// Options that the run was begun with, the vehicle and the seed among them, belong to the run and are refused here.
    /// Where time ended the choice of sensors, its poses are cast anew: give more --max-seconds than before.
    #[cfg_attr(feature = "cli", arg(long, value_name = "DIR"))]
    pub resume: Option<PathBuf>,
    /// Score to maximize, or a weighted sum of several [default: near_gain]
    ///
    /// near_gain, near_gain_2, near_gain_3, information_gain, information_gain_share, m_sog, m_sog_nonzero, m_sog_scaled,
    /// m_sog_scaled_nonzero, s_mig; all but the near gains and s_mig also of detection, as detection.m_sog_scaled.
    /// m_sog_scaled is the paper's. The default is justified by the near ground that its optima see, not by what learners
    /// recognize (docs/evidence.md).
    /// A rig that may lose a LiDAR wants near_gain_2: a voxel counts half if one LiDAR sees it, and in full if two do.
    /// Likewise near_gain_3 counts thirds up to three.
    #[cfg_attr(feature = "cli", arg(long, allow_hyphen_values = true, conflicts_with = "resume"))]
    pub objective: Option<String>,
    /// Placements that the generations evaluate; casts of the swaps and their refinements grow with them
    /// [default: 180; with --front 40]
    ///
    /// The swaps cast up to twice as many sensor poses as the generations, with --method swaps every pose of the grid.
    /// With --front that many around each point of the front; 0 leaves the points on the coarse grid.
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", conflicts_with = "resume", value_parser = parse::whole::<u64>))]
    pub evaluations: Option<u64>,
    /// Seconds from the start after which the run ends, generations after two fifths of them; --resume goes on
    /// from there
    ///
    /// The last fifth of a run over more than 32 frames is kept to confirm the result over all of them; where that is
    /// not enough, result and baselines are scored over few frames, and `stopped` says so. A P-SOG that is not scanned
    /// in that time ends the run with an error. The scores over few frames and the page, seconds each, come on top.
    /// --resume casts the poses for a choice of sensors anew, where the time ended in that choice: give it more then.
    #[cfg_attr(feature = "cli", arg(long, value_name = "S", alias = "time", value_parser = parse::seconds))]
    pub max_seconds: Option<f64>,
    /// Score over all frames at which the search ends; a near gain of 25 % is 0.25
    #[cfg_attr(feature = "cli", arg(long = "enough", alias = "target", value_name = "SCORE", conflicts_with = "resume", allow_hyphen_values = true, value_parser = parse::number_as("0.25")))]
    pub target: Option<f64>,
    /// Placements of a generation [default: chosen from the number of variables]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", conflicts_with = "resume", value_parser = clap::value_parser!(u32).range(4..=10_000)))]
    pub population: Option<u32>,
    /// Frames of the scene that the search models: as few as keep the ranking, and more when they no
    /// longer tell the best apart (auto), or all (full); the result is confirmed over all
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t, conflicts_with = "resume"))]
    pub fidelity: Fidelity,
    /// Frames of each scene that the search averages over, spread evenly, whatever they lose
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", conflicts_with_all = ["resume", "fidelity"], value_parser = clap::value_parser!(u32).range(1..)))]
    pub frames: Option<u32>,
    /// How to search: CMA-ES, then swaps of single LiDARs among poses of a grid and their refinement (both), the first alone
    /// (cma), or swaps over every pose of the grid and their refinement (swaps)
    #[cfg_attr(feature = "cli", arg(long, value_parser = parse::method, default_value = "both", conflicts_with = "resume"))]
    pub method: Method,
    /// Search on a grid of sensor poses alone, as in the paper: metres and radians between
    /// neighbours, as 0.1 or 0.2,0.1. Swaps always use one [default for them: 0.1]
    #[cfg_attr(feature = "cli", arg(long, value_name = "M[,RAD]", conflicts_with = "resume", value_parser = parse::spacing))]
    pub delta: Option<Spacing>,
    /// Work on the bound until it shows that no placement on its grid that meets the requirements is better than the best
    /// one there by more than this percentage. It may take a minute or more [default: a bound that takes few seconds]
    #[cfg_attr(feature = "cli", arg(long, value_name = "PERCENT", conflicts_with = "resume", value_parser = parse::number_that(|percent| (0.0..=100.0).contains(&percent), "0 to 100 per cent, as 2")))]
    pub bound: Option<f64>,
    /// Seed of all randomness [default: 1]
    #[cfg_attr(feature = "cli", arg(long, value_name = "N", value_parser = parse::whole::<u64>, conflicts_with = "resume"))]
    pub seed: Option<u64>,
    /// Placements to compare with, and to start from where the mount allows them
    /// [default: Table 7 of the paper]
    #[cfg_attr(feature = "cli", arg(long, value_name = "PLACEMENTS", conflicts_with = "resume"))]
    pub baselines: Option<PathBuf>,
    /// More placements to start from where the mount allows them; not compared with
    #[cfg_attr(feature = "cli", arg(long, value_name = "PLACEMENTS", conflicts_with = "resume"))]
    pub inject: Option<PathBuf>,
    /// Most that the sensors may cost, in the vehicle's currency
    ///
    /// Models, mounts and numbers of sensors are chosen for the money.
    #[cfg_attr(feature = "cli", arg(long, value_name = "PRICE", conflicts_with = "resume", value_parser = parse::price))]
    pub budget: Option<f64>,
    /// Take the fewest sensors of a vehicle that meet all of its requirements: among equal numbers the cheapest, and
    /// their best placement
    #[cfg_attr(feature = "cli", arg(long, conflicts_with = "resume"))]
    pub fewest: bool,
    /// Search the front of two or three objectives over a vehicle's sensors and poses, as price,near_gain: every
    /// placement that no other one found beats in all of them
    ///
    /// price, sensors (their number) and requirements (also targets: the share that is missing of what the vehicle requires,
    /// summed) are better when less, the scores of --objective when more. Sensors are chosen on a coarse grid of poses, for each of
    /// a row of prices or numbers at most; scores that are no gain are not chosen by, but compared. All placements are scored over
    /// all frames. --evaluations searches around each point, and around cheap sensors that miss little of the requirements; with 0
    /// a front takes a quarter of the time. A point that misses a requirement takes the place of none that meets all. --baselines
    /// are marked beside the points; no search starts from them. The folder gets placements.json in the order of the first
    /// objective, front.svg, report.html and result.json with the front and its picks: the cheapest that meets all requirements,
    /// the knee, the best of each. Exit code 1 if none meets all requirements. --resume goes on with a stopped front.
    #[cfg_attr(feature = "cli", arg(long, value_name = "A,B[,C]", conflicts_with_all = ["resume", "fewest", "target", "inject", "gltf", "bound"]))]
    pub front: Option<FrontObjectives>,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub mounting: MountingArgs,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub figures: FiguresOut,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub conditions: Conditions,
    /// How to print the result
    #[cfg_attr(feature = "cli", arg(long, value_enum, default_value_t))]
    pub format: TableFormat,
    #[cfg_attr(feature = "cli", command(flatten))]
    pub gltf: Gltf,
    /// All LiDARs stand at one height
    #[cfg_attr(feature = "cli", arg(long, conflicts_with = "resume"))]
    pub equal_height: bool,
    /// LiDARs come in pairs mirrored at the plane y = 0 (y, roll and yaw change sign); an odd one lies
    /// in it
    #[cfg_attr(feature = "cli", arg(long, conflicts_with = "resume"))]
    pub symmetric: bool,
    /// Keep a pose field of all LiDARs at one value, in metres or radians, as z=2.5 or roll=0; may be
    /// given several times
    #[cfg_attr(feature = "cli", arg(long, value_name = "FIELD=VALUE", conflicts_with = "resume", value_parser = parse::fixed))]
    pub fix: Vec<(String, f64)>,
}

/// Frames that a search models.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Fidelity {
    /// The fewest frames that keep the ranking
    #[default]
    Auto,
    /// Every frame
    Full,
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

impl OptimizeRequest {
    /// Files and options of the job, with the paths that are given.
    fn files(&self, vehicle: Option<&Path>) -> JobFiles {
        let (equal_height, symmetric, fixed) =
            (self.equal_height, self.symmetric, self.fix.clone());
        JobFiles {
            mirror: self.mirror,
            rules: MountRules { equal_height, symmetric, fixed },
            budget: self.budget,
            fewest: self.fewest,
            tolerance: Some(self.mounting.tolerance),
            conditions: in_words(&self.conditions.condition),
            ..JobFiles::new(&self.scenes, vehicle)
        }
    }

    /// Files and options that the checkpoint of a new run keeps, and its settings, once all is checked that takes no scene.
    pub(super) fn checked(&self, computing: &Computing<'_>) -> Result<(Begun, Settings), RunError> {
        let checked = (self.begun(computing)?, self.settings()?);
        let (baselines, starts) = (&checked.1.baselines, &checked.1.starts);
        for (file, placements) in [(&self.baselines, baselines), (&self.inject, starts)] {
            file.as_ref().map_or(Ok(None), |file| fit_alone(file, placements, computing))?;
        }
        self.out.as_deref().map_or(Ok(()), check_new_folder)?;
        Ok(checked)
    }

    /// Files and options that the checkpoint of a new run keeps; notes a scene that is given twice.
    fn begun(&self, computing: &Computing<'_>) -> Result<Begun, RunError> {
        note_repeated(&self.scenes, computing.watcher);
        let absolute = |path: &PathBuf| whole_path(path).map_err(RunError::io(path));
        let files = self.files(computing.vehicle.as_deref());
        if self.scenes.is_empty() {
            return Err(RunError::Usage("give a scene to search in".into()));
        }
        early::check_scenes(&files)?;
        early::check_vehicle(&files, self.front.as_ref(), computing)?;
        let files = JobFiles {
            scene: absolute(&files.scene)?,
            more_scenes: files.more_scenes.iter().map(absolute).collect::<Result<_, _>>()?,
            vehicle: files.vehicle.as_ref().map(absolute).transpose()?,
            ..files
        };
        let rigs = |file: &Option<PathBuf>| -> Result<Option<PathBuf>, RunError> {
            file.as_ref().map(|file| absolute(&rig_path(file)?)).transpose()
        };
        Ok(Begun { files, baselines: rigs(&self.baselines)?, inject: rigs(&self.inject)? })
    }

    /// Reads and poses the job of a run until a limit of time; an error names files as a new run was given them where reading
    /// them again tells it.
    pub(super) fn open(
        &self,
        files: &JobFiles,
        time: Option<TimeLimit>,
        computing: &Computing<'_>,
    ) -> Result<Loaded, RunError> {
        let loaded = opening::job_within(files, time, computing);
        let mut loaded = loaded.map_err(|error| match self.resume {
            Some(_) => error,
            None => self.as_given(error, computing.vehicle.as_deref()),
        })?;
        loaded.suite(computing)?;
        Ok(loaded)
    }

    /// Folder of a run of these inputs, made before the search, so that one that cannot be written is found out; a run that
    /// goes on has one.
    pub(super) fn folder<S: Serialize + DeserializeOwned>(
        &self,
        (command, folder): (&'static str, Option<RunDir<S>>),
        begun: &Begun,
        inputs: Vec<Input>,
    ) -> Result<RunDir<S>, RunError> {
        let folder = match folder {
            Some(folder) => folder,
            None => RunDir::create(command, self.out.as_deref(), &begun.folder(), inputs.clone())?,
        };
        folder.check(&inputs)?;
        outputs::check_figures_apart(self.figures.figures.as_deref(), folder.path())?;
        Ok(folder)
    }

    fn as_given(&self, error: RunError, vehicle: Option<&Path>) -> RunError {
        // A pipe is read once, and an engine that fails is no fault of a file.
        let is_plain = |path: &PathBuf| path.is_file() || !path.exists();
        let files = self.files(vehicle);
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

    /// Settings of the search, with the placements of files.
    fn settings(&self) -> Result<Settings, RunError> {
        let usual = Settings::default();
        let evaluations = if self.front.is_some() { FRONT_EVALUATIONS } else { usual.evaluations };
        let mut settings = Settings {
            method: self.method,
            evaluations: self.evaluations.unwrap_or(evaluations),
            population: self.population.map(|count| count as usize),
            delta: self.delta,
            gap: self.bound.map(|percent| percent / 100.0),
            seed: self.seed.unwrap_or(usual.seed),
            frames: match (self.fidelity, self.frames) {
                (Fidelity::Full, _) => FrameChoice::All,
                (Fidelity::Auto, Some(frames)) => FrameChoice::Count(frames),
                (Fidelity::Auto, None) => FrameChoice::OnDemand,
            },
            target: self.target,
            ..usual
        };
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
