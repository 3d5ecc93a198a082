//! A search in a run folder: begun or resumed, saved on the way, recorded at its end.

mod front;
mod record;
mod request;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::inputs::note_repeated;
use super::{Computing, GRACE, RunError, opening, outputs};
use crate::export::GltfView;
use crate::files::{Input, RunDir, Session, holds_run};
use crate::job::{Job, JobError, JobRun, JobState, JobStep};
use crate::problem::Content;
use crate::report::RunRecord;
use crate::search::{Event, Outcome, Settings, TimeLimit};
use record::{BETWEEN_CHECKPOINTS, Bars, RunSession, finish, read_spent, save};
use request::{Begun, RunCheckpoint};

pub use front::{FrontStart, Fronted, front, holds_front};
pub use request::{NewRun, OptimizeRequest, Start};

/// Record and folder of a finished search.
#[derive(Debug)]
pub struct Optimized {
    /// All of `result.json`.
    pub record: RunRecord,
    /// The run folder.
    pub folder: PathBuf,
}

/// Searches in a run folder until the end or until the watcher stops it; `None` if it stopped while a vehicle's sensors
/// were chosen.
///
/// # Errors
/// Files that cannot be read or written, settings that do not fit the scenes, no candidate that keeps the rules.
pub fn optimize(
    request: &OptimizeRequest,
    computing: &Computing<'_>,
) -> Result<Option<Optimized>, RunError> {
    let _session = Session::begin();
    let start = Instant::now();
    let (folder, begun, mut going_on, mut settings) = match &request.start {
        Start::Resume(path) => {
            check_no_front(path)?;
            let (folder, RunCheckpoint { begun, state }) =
                RunDir::<RunCheckpoint>::resume("optimize", path)?;
            (Some(folder), begun, Some(state), Settings::default())
        }
        Start::New(new) => {
            let scenes: Vec<PathBuf> = new.files.scenes().cloned().collect();
            note_repeated(&scenes, computing.watcher);
            (None, new.begun()?, None, new.settings()?)
        }
    };
    let length = request.max_seconds.map(Duration::from_secs_f64);
    let time = length.map(|length| TimeLimit { start, length });
    let mut loaded = opening::job_within(&begun.files, time, computing)?;
    loaded.suite(computing)?;
    let mut inputs = Vec::new();
    for scene in loaded.job.scenes() {
        opening::note_frames(scene.scene(), request.frames, computing.watcher);
        inputs.extend(Input::of(scene.scene().files())?);
    }
    outputs::check_gltf(request.gltf.as_deref())?;
    outputs::check_figures(request.figures.as_deref())?;
    if let Start::New(new) = &request.start {
        new.look(&mut settings, &*loaded.job.problem()?, computing)?;
    }
    let (is_given, baselines) = (begun.baselines.is_some(), settings.baselines.clone());
    let job = loaded.job.search(settings).engine(computing.engine.clone()).within(time);
    let job = if is_given { job.baselines(baselines) } else { job };
    if going_on.is_none() {
        check_value(&begun, &job)?;
    }
    computing.watcher.listen(GRACE);
    let folder = match (folder, &request.start) {
        (None, Start::New(new)) => {
            // Before the search, so that a folder that cannot be written is found out now.
            RunDir::create("optimize", new.out.as_deref(), &begun.folder(), inputs.clone())?
        }
        (folder, _) => folder.expect("a run that goes on has a folder"),
    };
    folder.check(&inputs)?;
    outputs::check_figures_apart(request.figures.as_deref(), folder.path())?;
    let run = begin(&job, going_on.take(), &folder)?;
    let (earlier, times) = (read_spent(&folder), loaded.times);
    let mut sitting =
        RunSession { request, computing, begun, job: &job, folder, run, times, earlier, start };
    let Some(outcome) = sitting.search()? else { return Ok(None) };
    let record = finish(&sitting, &outcome)?;
    sitting.check(&record)?;
    sitting.write_gltf(&record)?;
    Ok(Some(Optimized { record, folder: sitting.folder.path().to_owned() }))
}

/// Refuses the folder of a front that an earlier program wrote, without a checkpoint.
fn check_no_front(folder: &Path) -> Result<(), RunError> {
    if holds_run(folder) || !folder.join("front.svg").exists() {
        return Ok(());
    }
    Err(RunError::Usage(format!(
        "{}: holds a front without a checkpoint, which does not go on; run `sightline optimize … --front …` again, into \
         another folder or with --force",
        folder.display()
    )))
}

/// The search at its beginning, or where a checkpoint left it.
fn begin<'a>(
    job: &'a Job,
    state: Option<JobState>,
    folder: &RunDir<RunCheckpoint>,
) -> Result<JobRun<'a>, RunError> {
    let run = match state {
        Some(state) => job.resume(state),
        None => job.begin(),
    };
    run.map_err(|error| match error {
        JobError::OtherState { why } => folder.refusal(&why).into(),
        other => other.into(),
    })
}

/// Checks that some placement can have a value.
fn check_value(begun: &Begun, job: &Job) -> Result<(), RunError> {
    let (objective, suite) = (&job.settings().objective, job.suite()?);
    // A missing detection target is reported by the search.
    let exists = |content: &Content| {
        objective.exists_in(content) || objective.needs_detection() && !content.has_detection()
    };
    if suite.members().iter().any(|member| exists(member.problem().content())) {
        return Ok(());
    }
    Err(RunError::Usage(format!(
        "{}: nothing is uncertain in its P-SOG, so that no placement has a value of `{objective}`; give it frames in \
         which something moves",
        begun.files.scene.display()
    )))
}

impl RunSession<'_> {
    /// Runs to the outcome; the state is saved on the way. `None` after Ctrl-C in the choice of sensors.
    fn search(&mut self) -> Result<Option<Outcome>, RunError> {
        let watcher = self.computing.watcher;
        let folder = self.folder.path().display().to_string();
        let mut bars = Bars::new(watcher);
        let mut saved: Option<Instant> = None;
        let outcome = loop {
            let mut observe = |event: &Event| {
                bars.show(event);
                watcher.goes_on()
            };
            let step = self.run.step(&mut observe)?;
            let is_due = saved.is_none_or(|saved| saved.elapsed() > BETWEEN_CHECKPOINTS);
            if is_due || !matches!(step, JobStep::On) {
                save(self)?;
                saved = Some(Instant::now());
            }
            match step {
                JobStep::On => {}
                JobStep::Stopped => {
                    bars.clear();
                    watcher.note(&format!(
                        "stopped while the sensors were chosen; go on with --resume {folder}"
                    ));
                    return Ok(None);
                }
                JobStep::Done(outcome) => break outcome,
            }
        };
        bars.clear();
        let generation = outcome.history.len();
        let mut line = format!("stopped after generation {generation}: {}", outcome.stopped);
        if outcome.stopped.is_unfinished() {
            line += &format!("; go on with --resume {folder}");
        }
        watcher.note(&line);
        Ok(Some(*outcome))
    }

    /// A search without a result is an error, unless it was stopped before its end.
    fn check(&self, record: &RunRecord) -> Result<(), RunError> {
        if record.best.is_some() || !self.computing.watcher.goes_on() {
            return Ok(());
        }
        let scene = self.begun.files.scene.display();
        let history = self.run.run().map_or(&[][..], |run| run.state().history());
        let broken: u64 = history.iter().map(|record| record.infeasible as u64).sum();
        let kept = history.last().map_or(0, |record| record.evaluations).saturating_sub(broken);
        Err(RunError::Usage(match kept {
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

    /// Writes the result in the first scene where the request names a file.
    fn write_gltf(&self, record: &RunRecord) -> Result<(), RunError> {
        let Some(best) = &record.best else { return Ok(()) };
        let (scene, placements) = (&**self.job.scene(), std::slice::from_ref(&best.placement));
        let view = GltfView { scene, frame: 0, placements, points: &[] };
        outputs::write_gltf(self.request.gltf.as_deref(), self.computing.watcher, &view)
    }
}
