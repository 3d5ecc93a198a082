//! Jobs and evaluators from files, with notes on the way.

use std::fmt::Display;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use serde_json::{Value, json};

use crate::Note;
use crate::engine::BackendError;
use crate::files::Input;
use crate::job::{Job, JobError, JobFiles, JobScene};
use crate::near_field::{mounts_into_body, under_raised_in_words};
use crate::problem::StageTimes;
use crate::psog::{Psog, PsogError};
use crate::scan::conditions::{Condition, ConditionKind};
use crate::scene::{Coverage, PsogSource, Scene};
use crate::search::{Evaluator, FRAMES_AT_ONCE, Member, Suite, TimeLimit};
use crate::targets::places_of;
use crate::vehicle::TargetRule;

use super::inputs::{no_run_folder, note_unpriced};
use super::{Computing, RunError, Watcher};
use crate::json::counted;

/// Seconds until scoring could begin.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct LoadTimes {
    /// Reading files.
    pub load: f64,
    /// P-SOG, trees, device.
    pub build: f64,
}

/// A job whose scenes are read and posed.
pub(crate) struct Loaded {
    pub job: Job,
    pub times: LoadTimes,
}

/// Reads a scene file for a job, and notes likely mistakes in it.
pub(crate) fn read(
    path: &Path,
    vehicle: Option<&Path>,
    watcher: &dyn Watcher,
) -> Result<Scene, RunError> {
    no_run_folder(path)?;
    told(Scene::read_with(path, vehicle)?, watcher)
}

/// Refuses a body far larger than a vehicle that covers every place of a target which must be met: its size is the fault.
pub(super) fn no_hidden_places(scene: &Scene) -> Result<(), RunError> {
    let Some(large) = scene.large_body() else { return Ok(()) };
    let is_hidden = |rule: &&TargetRule| {
        !rule.on_scene && places_of(rule).iter().all(|[x, y, _]| scene.body_covers([*x, *y]))
    };
    match scene.vehicle().targets.iter().find(is_hidden) {
        Some(rule) => {
            let name = &rule.name;
            Err(RunError::Usage(format!("{large}; every place of `{name}` lies in the body now")))
        }
        None => Ok(()),
    }
}

fn told(scene: Scene, watcher: &dyn Watcher) -> Result<Scene, RunError> {
    scene.notes().iter().try_for_each(|note| watcher.tell(note))?;
    Ok(scene)
}

/// The vehicle of a file that is given beside scenes, on level ground, for checks before a large scene is read. `None`
/// without a file, of a pipe, which is read once, and of a file with faults, which are told later.
pub(super) fn vehicle_alone(computing: &Computing<'_>) -> Option<Scene> {
    let file = computing.vehicle.as_deref().filter(|file| file.is_file())?;
    Scene::level_ground(file).ok()
}

/// Files and options of a command: scenes, weather and frames, and the vehicle of all commands.
pub(super) fn files(
    scenes: &[PathBuf],
    conditions: &[Condition],
    frames: Option<u32>,
    computing: &Computing<'_>,
) -> JobFiles {
    let conditions = conditions.iter().map(Condition::to_string).collect();
    JobFiles { conditions, frames, ..JobFiles::new(scenes, computing.vehicle.as_deref()) }
}

/// Reads the scenes of a job and reads or builds their P-SOGs; problems are made when they are first needed.
pub(super) fn job(files: &JobFiles, computing: &Computing<'_>) -> Result<Loaded, RunError> {
    opened(files, None, |_| Ok(()), computing)
}

/// [`job`] of a search with a limit of time: an error where it ends before the P-SOGs are built, or where all mounts lie
/// inside the own body.
pub(crate) fn job_within(
    files: &JobFiles,
    time: Option<TimeLimit>,
    computing: &Computing<'_>,
) -> Result<Loaded, RunError> {
    let is_open = |scene: &Scene| match scene.buried_mounts() {
        Some(told) => Err(RunError::Usage(told.to_owned())),
        None => Ok(()),
    };
    opened(files, time, is_open, computing)
}

/// [`job`] with a limit of time, of scenes that a check lets pass before anything is told about them.
fn opened(
    files: &JobFiles,
    time: Option<TimeLimit>,
    check: impl Fn(&Scene) -> Result<(), RunError>,
    computing: &Computing<'_>,
) -> Result<Loaded, RunError> {
    let watcher = computing.watcher;
    if let Some(doubt) = files.tolerance.and_then(|tolerance| tolerance.doubt()) {
        watcher.tell(&Note::doubt(doubt))?;
    }
    let (mut times, mut scenes) = (LoadTimes::default(), Vec::new());
    for path in files.scenes() {
        let start = Instant::now();
        let scene = files.read_scene(path)?;
        no_hidden_places(&scene)?;
        check(&scene)?;
        let scene = told(scene, watcher)?;
        note_frames(&scene, files.frames, watcher);
        // Before the P-SOG is scanned, which takes longest.
        files.check_vehicle(scene.vehicle())?;
        let is_file = matches!(scene.psog_source(), PsogSource::File(_));
        let scene = JobScene::from(scene);
        times.load += start.elapsed().as_secs_f64();
        let start = Instant::now();
        note_psog(&*psog(&scene, time, watcher)?, scene.scene(), watcher);
        let took = start.elapsed().as_secs_f64();
        *(if is_file { &mut times.load } else { &mut times.build }) += took;
        scenes.push(scene);
    }
    let job = files.job_over(scenes)?.engine(computing.engine.clone());
    note_conditions(&files.conditions, watcher);
    Ok(Loaded { job, times })
}

/// Notes that the ground of a scene is not level where targets of requirements and range cards stand, and, where the vehicle
/// requires ground, that none is judged under raised parts of its body.
pub(super) fn note_relief(job: &Job, watcher: &dyn Watcher) -> Result<(), RunError> {
    let requires = !job.scene().vehicle().ground.is_empty();
    let raised = requires.then(|| under_raised_in_words(job.scene())).flatten();
    job.relief_in_words()?.iter().chain(&raised).for_each(|words| watcher.note(words));
    Ok(())
}

/// Reads or builds the P-SOG of a scene, until the watcher or a limit of time stops it. A scene of few frames is scanned
/// whatever the time.
pub(super) fn psog(
    scene: &JobScene,
    time: Option<TimeLimit>,
    watcher: &dyn Watcher,
) -> Result<Arc<Psog>, RunError> {
    let frames = scene.scene().frame_count() as u64;
    let bar = watcher.bar(frames, Some("frames scanned for the P-SOG"));
    let is_late = || time.is_some_and(|time| Instant::now() >= time.deadline());
    let scanned = scene.psog(|done| {
        bar.set(done as u64, frames);
        // A search, too, scores this few frames whatever the time.
        watcher.goes_on() && (frames <= FRAMES_AT_ONCE as u64 || !is_late())
    });
    scanned.map_err(|error| match error {
        JobError::Grid(error) => stopped(error, &scene.place(), time, watcher),
        error => error.into(),
    })
}

/// The error of a scan for a P-SOG, with the reason for a stop.
pub(crate) fn stopped(
    error: PsogError,
    place: &str,
    time: Option<TimeLimit>,
    watcher: &dyn Watcher,
) -> RunError {
    match (error, time) {
        (PsogError::Stopped { done, frames }, _) if !watcher.goes_on() => {
            RunError::Interrupted(format!(
                "{place}: interrupted after {done} of {frames} frames were scanned for its P-SOG; nothing is left"
            ))
        }
        (PsogError::Stopped { done, frames }, Some(time)) => RunError::Usage(format!(
            "{place}: --max-seconds {} was over before the search could begin, while the scene was looked at to learn \
             what is uncertain in it ({done} of {frames} frames); give more seconds, or do this once with `sightline \
             psog build` and name its file under `psog.file` of the scene",
            time.length.as_secs_f64()
        )),
        (error, _) => error.into(),
    }
}

/// Metres of a scan that may end before it meets anything that moves.
const SHORT: f64 = 10.0;

/// Notes a P-SOG in which no voxel changes from frame to frame.
fn note_psog(psog: &Psog, scene: &Scene, watcher: &dyn Watcher) {
    let same = |&count: &u16| count == 0 || u32::from(count) == psog.frames();
    if psog.counts().iter().all(same) {
        let short = match scene.psog_source() {
            PsogSource::Scan(scan) if scan.range < SHORT => {
                format!(", or sensors of a longer `range`: its scans reach {} m", scan.range)
            }
            _ => String::new(),
        };
        watcher.note(&format!(
            "the P-SOG holds no information: each voxel is the same in all of its {}, so that every \
             entropy is 0; give it frames in which something moves{short}",
            counted(psog.frames() as usize, "frame")
        ));
    }
}

impl Loaded {
    /// Files of all scenes with their digests.
    pub(crate) fn inputs(&self) -> Result<Vec<Input>, RunError> {
        let each = self.job.scenes().iter().map(|scene| Input::of(scene.scene().files()));
        Ok(each.collect::<Result<Vec<_>, _>>()?.concat())
    }

    /// Poses the job, and tells the size of its scenes as detail.
    pub(crate) fn suite(&mut self, computing: &Computing<'_>) -> Result<Suite, RunError> {
        let (start, watcher) = (Instant::now(), computing.watcher);
        let suite = self.job.suite()?;
        for member in suite.members().iter().filter(|member| !member.is_mirrored()) {
            let problem = member.problem();
            watcher.detail(&problem.modelled().to_string());
            watcher.detail(&format!(
                "scene and P-SOG take {} MiB, work buffers at most {} MiB",
                problem.bytes() >> 20,
                computing.engine.memory_budget() >> 20
            ));
        }
        note_classes(&suite, watcher);
        note_bodies(&self.job, watcher);
        self.times.build += start.elapsed().as_secs_f64();
        Ok(suite)
    }

    /// Poses the job and opens an engine for each scene; notes its device.
    pub(crate) fn evaluator(&mut self, computing: &Computing<'_>) -> Result<Evaluator, RunError> {
        self.suite(computing)?;
        let (start, watcher) = (Instant::now(), computing.watcher);
        let told = watcher.notes();
        let (evaluator, notes) = self.job.evaluator(move |change: &str| told(change))?;
        notes.iter().for_each(|note| watcher.device(note));
        self.times.build += start.elapsed().as_secs_f64();
        Ok(evaluator)
    }
}

/// Reads a scene for its geometry alone: its P-SOG is not needed and stays empty. `mend` names parts to add to a scene
/// without geometry.
pub(crate) fn geometry(
    path: &Path,
    mend: &str,
    computing: &Computing<'_>,
) -> Result<Scene, RunError> {
    let scene = read(path, computing.vehicle.as_deref(), computing.watcher)?;
    with_geometry(scene, path.display(), mend)
}

/// A scene, if it has geometry.
pub(super) fn with_geometry(
    scene: Scene,
    place: impl Display,
    mend: &str,
) -> Result<Scene, RunError> {
    if scene.has_geometry() {
        return Ok(scene);
    }
    Err(RunError::Usage(format!("{place}: has no geometry to cast into; add {mend}")))
}

/// Notes the meaning of scores under a condition that moves points alone.
pub(crate) fn note_conditions(conditions: &[String], watcher: &dyn Watcher) {
    let conditions = conditions.iter().filter_map(|text| text.parse::<Condition>().ok());
    let (blur, others): (Vec<ConditionKind>, Vec<ConditionKind>) =
        conditions.map(|condition| condition.kind()).partition(|kind| *kind == ConditionKind::Blur);
    if !blur.is_empty() {
        let scores = match others.is_empty() {
            // Any condition makes scores use the sensor's response, which matters in clear air, too.
            true => {
                "those of clear air under the sensor's own response, as with fog:mor=inf; without a condition \
                 every beam counts that meets something"
            }
            false => "those of the other conditions",
        };
        watcher.note(&format!(
            "--condition blur: takes no beam away, it only moves the points of a scan; scores are {scores}"
        ));
    }
}

/// Notes that `--frames` is larger than the number of frames.
pub(crate) fn note_frames(scene: &Scene, wanted: Option<u32>, watcher: &dyn Watcher) {
    let count = scene.frame_count();
    if let Some(wanted) = wanted.filter(|wanted| *wanted as usize > count) {
        watcher.note(&format!("--frames {wanted}: the scene has {count}; all of them are used"));
    }
}

/// Level ground around the vehicle of a file, with its notes.
pub(crate) fn level_ground(
    vehicle: &Path,
    frames: Option<u32>,
    watcher: &dyn Watcher,
) -> Result<Scene, RunError> {
    let scene = told(Scene::level_ground(vehicle)?, watcher)?;
    if let Some(wanted) = frames.filter(|wanted| *wanted > 1) {
        let words = "without a scene there is one frame, level ground";
        watcher.note(&format!("--frames {wanted}: {words}"));
    }
    Ok(scene)
}

/// Notes scenes with other classes than the first, which only the counts by class depend on.
fn note_classes(suite: &Suite, watcher: &dyn Watcher) {
    let Some((first, others)) = suite.members().split_first() else { return };
    let classes_of = |member: &Member| member.problem().content().classes().to_vec();
    let known = classes_of(first);
    for member in others {
        let own = classes_of(member);
        let less = known.iter().filter(|class| !own.contains(class)).cloned().collect();
        let more = own.iter().filter(|class| !known.contains(class)).cloned().collect();
        let lists: [(&str, Vec<String>); 2] = [("lacks", less), ("adds", more)];
        let lists = lists.iter().filter(|(_, list)| !list.is_empty());
        let lists: Vec<String> =
            lists.map(|(w, list)| format!("{w} {}", list.join(", "))).collect();
        if !lists.is_empty() {
            watcher.note(&format!(
                "{}: its classes are not those of {}: it {}; a count by class is the mean over the scenes that \
                 have the class, nothing else depends on it; give all the same `classes` to compare them",
                member.name(),
                first.name(),
                lists.join(" and ")
            ));
        }
    }
}

/// Notes mounts of a scene's vehicle that look into the own body, which ends beams in it.
pub(crate) fn note_mounts(scene: &JobScene, watcher: &dyn Watcher) -> Result<(), RunError> {
    if scene.scene().coverage() == Coverage::FirstHit {
        let told = mounts_into_body(scene.scene(), &scene.models()?).map_err(BackendError::from)?;
        told.iter().for_each(|words| watcher.note(words));
    }
    Ok(())
}

/// Notes on a job for a caller without a watcher: the sentences that the program tells of it before it scores or searches.
///
/// # Errors
/// A P-SOG, sensors or weather that do not fit a scene.
pub fn notes_on(job: &Job) -> Result<Vec<String>, RunError> {
    #[derive(Default)]
    struct Heard(Mutex<Vec<String>>);

    impl Watcher for Heard {
        fn note(&self, sentence: &str) {
            self.0.lock().unwrap_or_else(PoisonError::into_inner).push(sentence.to_owned());
        }
    }

    let heard = Heard::default();
    for scene in job.scenes() {
        note_psog(&*psog(scene, None, &heard)?, scene.scene(), &heard);
    }
    note_conditions(&job.conditions_in_words(), &heard);
    note_classes(&job.suite()?, &heard);
    note_bodies(job, &heard);
    note_unpriced(job.scene().vehicle(), false, &heard);
    note_before_search(job, &heard)?;
    Ok(heard.0.into_inner().unwrap_or_else(PoisonError::into_inner))
}

/// Notes on mounts, and on ground that is not level, of a job that is about to search.
pub(super) fn note_before_search(job: &Job, watcher: &dyn Watcher) -> Result<(), RunError> {
    note_mounts(&job.scenes()[0], watcher)?;
    note_relief(job, watcher)
}

/// Notes scenes whose own body is not that of the first, which decides about requirements on targets and warnings of the mean.
fn note_bodies(job: &Job, watcher: &dyn Watcher) {
    let Some((first, others)) = job.scenes().split_first() else { return };
    let known = first.scene().body();
    for other in others.iter().filter(|other| other.scene().body() != known) {
        watcher.note(&format!(
            "{}: its own body is not that of {first}; beams of each scene end at its own body, but requirements on \
             targets, and the range card and warnings of the mean, are those of the body of {first}; put one `body` \
             into the vehicle file and give it with --vehicle",
            other.place(),
            first = first.place()
        ));
    }
}

/// Seconds of loading, of each stage up to now, and of all since a start.
pub(super) fn timings(load: LoadTimes, stages: StageTimes, start: Instant) -> Value {
    json!({
        "load": load.load,
        "build": load.build,
        "cast": stages.cast.as_secs_f64(),
        "cover": stages.cover.as_secs_f64(),
        "reduce": stages.reduce.as_secs_f64(),
        "total": start.elapsed().as_secs_f64(),
    })
}
