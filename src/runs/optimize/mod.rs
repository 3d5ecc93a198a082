//! A search in a run folder: begun or gone on with, saved on the way, recorded at its end.

mod bars;
mod begun;
mod equipment;
mod near_field;
mod record;
mod request;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

pub use request::{NewRun, OptimizeRequest, Start};

use super::inputs::note_repeated;
use super::opening::{self, LoadTimes};
use super::{Computing, Error, GRACE, glb};
use crate::export::GltfView;
use crate::files::{Input, RunDir, Session};
use crate::problem::{Content, Problem};
use crate::report::RunRecord;
use crate::scan::conditions::{Condition, ConditionError};
use crate::scan::in_conditions;
use crate::scene::Scene;
use crate::score::Objective;
use crate::search::{Event, Outcome, Run, SearchError, Suite, TimeLimit};
use bars::Bars;
use begun::{Begun, Course, Saved, Wanted};
use record::{BETWEEN_CHECKPOINTS, Opened, Sitting, finish, read_spent, save};

/// What a run has found.
#[derive(Debug)]
pub struct Optimized {
    /// All of `result.json`.
    pub record: RunRecord,
    /// The run folder.
    pub folder: PathBuf,
}

/// Searches in a run folder until the end or until the watcher stops it; nothing if that was while a vehicle's sensors
/// were chosen.
///
/// # Errors
/// Files that cannot be read or written, settings that do not fit the scenes, no candidate that keeps the rules.
pub fn optimize(
    request: &OptimizeRequest,
    computing: &Computing<'_>,
) -> Result<Option<Optimized>, Error> {
    let _session = Session::begin();
    let start = Instant::now();
    let (folder, mut begun, mut course, out) = match &request.start {
        Start::Resume(path) => {
            let (folder, saved) = RunDir::<Saved>::resume("optimize", path)?;
            (Some(folder), saved.begun, saved.course, None)
        }
        Start::New(new) => {
            note_repeated(&new.scenes, computing.watcher);
            let begun = new.begun(computing.vehicle.as_ref())?;
            let course = Course::Equipping(Box::new(new.wanted()?));
            (None, begun, course, new.out.as_deref())
        }
    };
    let mut opened = open(&begun, request.frames, computing)?;
    glb::check(request.gltf.as_deref())?;
    if let (Start::New(new), Course::Equipping(wanted)) = (&request.start, &mut course) {
        new.look(&mut wanted.settings, &opened.suite, computing)?;
        check_value(&begun, &wanted.settings.objective, &opened.suite)?;
    }
    computing.watcher.listen(GRACE);
    let folder = match folder {
        Some(folder) => folder,
        // Before the search, so that a folder that cannot be written is found out now.
        None => RunDir::create("optimize", out, &begun.folder(), opened.inputs.clone())?,
    };
    folder.check(&opened.inputs)?;
    let time = request
        .max_seconds
        .map(|seconds| TimeLimit { start, length: Duration::from_secs_f64(seconds) });
    let deadline = time.as_ref().map(TimeLimit::deadline);
    let begins = begin(&mut begun, course, &mut opened, &folder, deadline, computing)?;
    let Some((run, is_late)) = begins else {
        return Ok(None);
    };
    let earlier = read_spent(&folder);
    let mut sitting =
        Sitting { request, computing, begun, opened, folder, is_late, run, earlier, start };
    let outcome = sitting.search(time)?;
    let record = finish(&sitting, &outcome)?;
    sitting.check(&record)?;
    sitting.write_gltf(&record)?;
    Ok(Some(Optimized { record, folder: sitting.folder.path().to_owned() }))
}

/// The search, with a slot for each sensor of the vehicle, and whether the time ended while these were chosen;
/// `None` after Ctrl-C.
fn begin(
    begun: &mut Begun,
    course: Course,
    opened: &mut Opened,
    folder: &RunDir<Saved>,
    deadline: Option<Instant>,
    computing: &Computing<'_>,
) -> Result<Option<(Run, bool)>, Error> {
    let wanted = match &course {
        Course::Equipping(wanted) => Some(&**wanted),
        Course::Run(_) => None,
    };
    let equipped = equipment::equipped(begun, wanted, opened, folder, deadline, computing)?;
    let Some((suite, is_late)) = equipped else { return Ok(None) };
    opened.suite = suite.clone();
    let Wanted { settings, plainly, .. } = match course {
        Course::Run(state) => {
            state.check(&suite).map_err(|why| folder.refusal(&why))?;
            return Ok(Some((Run::resume(suite, *state), false)));
        }
        Course::Equipping(wanted) => *wanted,
    };
    let settings = match &begun.equipped {
        Some(equipped) => equipped.begin(settings, suite.constraints(), plainly),
        None => settings,
    };
    let run = Run::new(suite, &settings).map_err(|error| in_scene(error, begun))?;
    Ok(Some((run, is_late)))
}

/// Scenes and problems of a run.
fn open(begun: &Begun, frames: Option<u32>, computing: &Computing<'_>) -> Result<Opened, Error> {
    let conditions = begun.conditions.iter().map(|text| text.parse());
    let conditions = conditions.collect::<Result<Vec<Condition>, ConditionError>>();
    let conditions = conditions.map_err(Error::from)?;
    opening::note_conditions(&conditions, computing.watcher);
    let mut times = LoadTimes::default();
    let (mut scenes, mut problems, mut inputs) = (Vec::new(), Vec::new(), Vec::new());
    for path in begun.scenes() {
        let (scene, problem) = open_scene(path, begun, &conditions, frames, computing, &mut times)?;
        inputs.extend(Input::of(scene.files())?);
        problems.push((scene.name().to_owned(), problem));
        scenes.push(scene);
    }
    let suite = Suite::new(problems).map_err(|error| in_scene(error, begun))?;
    opening::note_classes(&suite, computing.watcher);
    let suite = if begun.mirror { suite.with_mirror_images() } else { suite };
    Ok(Opened { scenes, suite, inputs, times })
}

/// A scene with the rules of the options, and its problem over all frames.
fn open_scene(
    path: &Path,
    begun: &Begun,
    conditions: &[Condition],
    frames: Option<u32>,
    computing: &Computing<'_>,
    times: &mut LoadTimes,
) -> Result<(Scene, Arc<Problem>), Error> {
    let watcher = computing.watcher;
    let computing = Computing { vehicle: begun.vehicle.clone(), ..computing.clone() };
    let (scene, psog, took) = opening::scene_and_psog(path, &computing)?;
    opening::note_frames(&scene, frames, watcher);
    let scene = scene
        .with_rules(&begun.rules, &path.display().to_string())
        .map_err(|error| Error::Usage(format!("options for the mount: {error}")))?;
    let building = Instant::now();
    let all: Vec<usize> = (0..scene.frame_count()).collect();
    let problem = Problem::with_psog(&scene, &psog, &all)?;
    let problem = in_conditions(&scene, problem, conditions)?;
    let problem = Arc::new(problem);
    watcher.detail(&problem.modelled().to_string());
    watcher.detail(&format!(
        "scene and P-SOG take {} MiB, work buffers at most {} MiB",
        problem.bytes() >> 20,
        computing.engine.memory_budget() >> 20
    ));
    times.load += took.load;
    times.build += took.build + building.elapsed().as_secs_f64();
    Ok((scene, problem))
}

/// Checks that some placement can have a value.
fn check_value(begun: &Begun, objective: &Objective, suite: &Suite) -> Result<(), Error> {
    // What lacks a detection target is said by the search.
    let exists = |content: &Content| {
        objective.exists_in(content) || objective.needs_detection() && !content.has_detection()
    };
    if suite.members().iter().any(|member| exists(member.problem().content())) {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "{}: nothing is uncertain in its P-SOG, so that no placement has a value of `{objective}`; give it frames in \
         which something moves",
        begun.scene.display()
    )))
}

/// An error of the settings, with the scene that they do not fit.
fn in_scene(error: SearchError, begun: &Begun) -> Error {
    let scenes: Vec<&PathBuf> = begun.scenes().collect();
    opening::in_scene(error, &scenes)
}

impl Sitting<'_> {
    /// Runs to the outcome; the state is saved on the way.
    fn search(&mut self, time: Option<TimeLimit>) -> Result<Outcome, Error> {
        let watcher = self.computing.watcher;
        self.run.open_with(self.computing.engine.clone(), time);
        let mut bars = Bars::new(watcher);
        let mut saved: Option<Instant> = None;
        let outcome = loop {
            let mut observe = |event: &Event| {
                bars.show(event);
                watcher.goes_on()
            };
            let outcome = self.run.step(&mut observe)?;
            let is_due = saved.is_none_or(|saved| saved.elapsed() > BETWEEN_CHECKPOINTS);
            if outcome.is_some() || is_due {
                save(self)?;
                saved = Some(Instant::now());
            }
            if let Some(outcome) = outcome {
                break outcome;
            }
        };
        bars.clear();
        let generation = outcome.history.len();
        let mut line = format!("stopped after generation {generation}: {}", outcome.stopped);
        if outcome.stopped.is_unfinished() {
            line += &format!("; go on with --resume {}", self.folder.path().display());
        }
        watcher.note(&line);
        Ok(outcome)
    }

    /// Nothing found is an error, unless the search was stopped before its end.
    fn check(&self, record: &RunRecord) -> Result<(), Error> {
        if record.best.is_some() || !self.computing.watcher.goes_on() {
            return Ok(());
        }
        let scene = self.begun.scene.display();
        let history = self.run.state().history();
        let broken: u64 = history.iter().map(|record| record.infeasible as u64).sum();
        let kept = history.last().map_or(0, |record| record.evaluations).saturating_sub(broken);
        Err(Error::Usage(match kept {
            0 => format!(
                "{scene}: mount: no candidate kept its rules ({}); widen the mount or relax them",
                record.constraints.join("; ")
            ),
            kept => format!(
                "{scene}: mount: {kept} candidates kept its rules, but none has a value of `{}`: their beams reach \
                 nothing in the region of interest that counts; move the mount, or allow other angles",
                record.objective
            ),
        }))
    }

    /// Writes the result in the first scene where that is asked for.
    fn write_gltf(&self, record: &RunRecord) -> Result<(), Error> {
        let Some(best) = &record.best else { return Ok(()) };
        let (scene, placements) = (&self.opened.scenes[0], std::slice::from_ref(&best.placement));
        let view = GltfView { scene, frame: 0, placements, points: &[] };
        glb::write(self.request.gltf.as_deref(), self.computing.watcher, &view)
    }
}
