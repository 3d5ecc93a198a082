//! A scene and all that is built from it once: P-SOG, problem, engine; and an engine that tells a waiting call how many
//! casts into frames are done.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};

use lidar_cast::cover::BitOrder;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use sightline::engine::{Backend, BackendError, EngineChoice, EngineKind, Hit, TakeBitmap};
use sightline::near_field::{FEW_PLACEMENTS, NearSite};
use sightline::problem::{StageTimes, Tally, spread};
use sightline::runs::notes_on;
use sightline::scan::conditions::Condition;
use sightline::scan::{ScanError, Stage};
use sightline::{Evaluator, Job, Note, Placement, Problem, Psog, Scene, Scores, SensorPose};

use crate::arguments::room_for;
use crate::errors::{bad, raised, raised_of_run, warn_of};
use crate::psogs::PyPsog;
use crate::rays::RayTarget;
use crate::wait::{WorkMessages, interruptible, is_forked, log, pooled};

/// Engines by their names in Python.
const BACKENDS: [(&str, EngineKind); 3] =
    [("auto", EngineKind::Auto), ("cpu", EngineKind::Cpu), ("gpu", EngineKind::Gpu)];

/// Frames to cast into that are kept at most.
const FRAMES_KEPT: usize = 4;

/// Settings for scoring a scene.
#[derive(Clone, Default)]
pub(crate) struct Options {
    /// P-SOG in place of the scene's own.
    pub psog: Option<Arc<Psog>>,
    /// Number of frames, spread evenly; all if `None`.
    pub frames: Option<u32>,
    /// Weather and faults.
    pub conditions: Vec<Condition>,
    /// Engine that computes.
    pub engine: EngineChoice,
}

impl Options {
    pub(crate) fn new(
        psog: Option<&Bound<'_, PyPsog>>,
        frames: Option<u32>,
        conditions: Option<Vec<String>>,
        backend: &str,
        adapter: Option<String>,
        memory: Option<u64>,
    ) -> PyResult<Self> {
        let kind = BACKENDS.iter().find(|(name, _)| *name == backend).map(|(_, kind)| *kind);
        let kind = kind
            .ok_or_else(|| bad(format!("backend: `{backend}` is none; give auto, cpu or gpu")))?;
        if kind == EngineKind::Cpu
            && let Some(adapter) = &adapter
        {
            return Err(bad(format!(
                "adapter: is {adapter:?}, a Vulkan device, which backend=\"cpu\" does not use; leave one of them out"
            )));
        }
        let conditions = conditions.iter().flatten().map(|text| text.parse().map_err(raised));
        let conditions = conditions.collect::<PyResult<_>>()?;
        let psog = psog.map(|psog| psog.get().0.clone());
        let engine = EngineChoice { kind, adapter, memory, inexact: false };
        Ok(Self { psog, frames, conditions, engine })
    }

    /// Puts the Python arguments that these come from into `words`.
    pub(crate) fn put(&self, words: &Bound<'_, PyDict>) -> PyResult<()> {
        let conditions: Vec<String> = self.conditions.iter().map(Condition::to_string).collect();
        let backend = BACKENDS.iter().find(|(_, kind)| *kind == self.engine.kind);
        words.set_item("psog", self.psog.clone().map(PyPsog))?;
        words.set_item("frames", self.frames)?;
        words.set_item("conditions", conditions)?;
        words.set_item("backend", backend.map(|(name, _)| *name))?;
        words.set_item("adapter", &self.engine.adapter)?;
        words.set_item("memory", self.engine.memory)
    }
}

/// Name of engines that use no device.
const CPU: &str = "cpu";
/// Sentence for an engine that a fork has cut off.
const FORKED: &str = "; start processes before, or with multiprocessing's start method `spawn`";

/// Value that one thread uses at a time, in the process that made it or in a fork of that process.
#[derive(Default)]
pub(crate) struct Alone<T> {
    held: Mutex<T>,
    /// Process that worked with it last; 0 for none.
    process: AtomicU32,
}

impl<T> Alone<T> {
    /// True in a forked process that has not worked with it yet, where its parent has.
    fn is_of_parent(&self) -> bool {
        let before = self.process.load(Ordering::SeqCst);
        is_forked() && before != 0 && before != std::process::id()
    }

    /// It, once no other thread works with it.
    ///
    /// # Errors
    /// `RuntimeError` in a process that was forked while its parent worked with it: in the fork no thread ever ends that work.
    pub(crate) fn lock(&self) -> PyResult<MutexGuard<'_, T>> {
        let is_of_parent = self.is_of_parent();
        if !is_of_parent {
            // A fork may come as soon as the lock is taken.
            self.process.store(std::process::id(), Ordering::SeqCst);
        }
        let held = match self.held.try_lock() {
            Ok(held) => held,
            Err(TryLockError::WouldBlock) if is_of_parent => {
                let when = "the process was forked while the scene was at work in it";
                return Err(PyRuntimeError::new_err(format!("{when}{FORKED}")));
            }
            Err(_) => self.held.lock().unwrap_or_else(PoisonError::into_inner),
        };
        self.process.store(std::process::id(), Ordering::SeqCst);
        Ok(held)
    }
}

/// An evaluator that is opened when it is first needed.
#[derive(Default)]
pub(crate) struct Kept(Alone<Option<Evaluator>>);

impl Kept {
    /// The evaluator, once nobody else works with it. A device does not survive a fork, which is an error.
    fn alone(&self) -> PyResult<MutexGuard<'_, Option<Evaluator>>> {
        let is_of_parent = self.0.is_of_parent();
        let kept = self.0.lock()?;
        let on_device = kept.as_ref().is_some_and(|kept| kept.backend().name() != CPU);
        if is_of_parent && on_device {
            let when = "the process was forked after the scene had opened a GPU";
            return Err(PyRuntimeError::new_err(format!("{when}{FORKED}")));
        }
        Ok(kept)
    }

    pub(crate) fn with<T>(
        &self,
        open: impl FnOnce() -> PyResult<Evaluator>,
        work: impl FnOnce(&mut Evaluator) -> PyResult<T>,
    ) -> PyResult<T> {
        match &mut *self.alone()? {
            Some(evaluator) => work(evaluator),
            none => work(none.insert(open()?)),
        }
    }
}

/// One frame to cast into, for sensors and for single rays.
#[derive(Clone)]
pub(crate) struct Posed {
    frame: usize,
    pub problem: Arc<Problem>,
    pub rays: Arc<RayTarget>,
}

/// Job over one scene, with the problem and engine that it builds on first use.
pub(crate) struct Built {
    pub scene: Arc<Scene>,
    pub options: Options,
    pub job: Job,
    /// Notes on the job, which scores and searches warn of.
    pub told: NotesOnce,
    stage: OnceLock<Arc<Stage>>,
    evaluator: Kept,
    /// The frames that were cast into last.
    frames: Alone<VecDeque<Posed>>,
}

impl Built {
    pub(crate) fn new(scene: Scene, options: Options) -> Self {
        let scene = Arc::new(scene);
        let job = Job::new(scene.clone());
        let job = match options.psog.clone() {
            Some(psog) => job.psog(psog),
            None => job,
        };
        let job = job.frames(options.frames).conditions(&options.conditions);
        let job = job.engine(options.engine.clone());
        let (stage, evaluator, frames) = (OnceLock::new(), Kept::default(), Alone::default());
        Self { scene, options, job, told: NotesOnce::default(), stage, evaluator, frames }
    }

    /// Numbers of the frames that scores are means over.
    pub(crate) fn scored_frames(&self) -> Vec<usize> {
        spread(self.scene.frame_count(), self.options.frames)
    }

    /// The trees that scans share.
    pub(crate) fn stage(&self) -> Result<Arc<Stage>, ScanError> {
        if let Some(stage) = self.stage.get() {
            return Ok(stage.clone());
        }
        let stage = Arc::new(Stage::new(&self.scene)?);
        Ok(self.stage.get_or_init(|| stage).clone())
    }

    /// The P-SOG: given, read, or built from virtual scans, until the watch is stopped.
    pub(crate) fn psog(&self, watch: &WorkMessages) -> PyResult<Arc<Psog>> {
        let frames = self.scene.frame_count();
        let reach = |done| watch.reach(SCANNED, done, frames);
        self.job.scenes()[0].psog(reach).map_err(raised)
    }

    /// Works with the engine, which is opened first if it was not.
    pub(crate) fn evaluate<T>(
        &self,
        watch: &WorkMessages,
        work: impl FnOnce(&mut Evaluator) -> PyResult<T>,
    ) -> PyResult<T> {
        let open = || {
            self.psog(watch)?;
            opened(&self.job)
        };
        self.evaluator.with(open, work)
    }

    /// The number of a frame, which the scene must have.
    pub(crate) fn check_frame(&self, frame: i128) -> PyResult<usize> {
        let frames = self.scene.frame_count();
        let number = usize::try_from(frame).ok().filter(|number| *number < frames);
        number.ok_or_else(|| bad(format!("frame: is {frame}; give 0 to {}", frames - 1)))
    }

    pub(crate) fn frame(&self, frame: usize) -> PyResult<Posed> {
        if !self.scene.has_geometry() {
            return Err(bad(
                "the scene has no geometry to cast into; add static shapes, actors or an ego body",
            ));
        }
        let mut last = self.frames.lock()?;
        if let Some(posed) = last.iter().find(|posed| posed.frame == frame) {
            return Ok(posed.clone());
        }
        let job = Job::new(self.scene.clone()).geometry_alone().one_frame(frame);
        let problem = job.problem().map_err(raised)?;
        let rays = Arc::new(RayTarget::of_frame(&self.scene, frame, &problem)?);
        let posed = Posed { frame, problem, rays };
        last.truncate(FRAMES_KEPT - 1);
        last.push_front(posed.clone());
        Ok(posed)
    }
}

/// An evaluator of a job, whose sentences on the engine go to the log.
pub(crate) fn opened(job: &Job) -> PyResult<Evaluator> {
    let (evaluator, notes) = job.evaluator(|sentence| log("warning", sentence)).map_err(raised)?;
    notes.iter().for_each(|sentence| log("info", sentence));
    Ok(evaluator)
}

/// Job over several scenes, each with its own frames and weather, on the engine of the first.
pub(crate) fn job_of(scenes: &[Arc<Built>]) -> PyResult<Job> {
    // Copies share the problems that are posed already.
    pooled(|| scenes.iter().try_for_each(|built| built.job.problem().map(drop))).map_err(raised)?;
    Job::join(scenes.iter().map(|built| built.job.clone())).map_err(raised)
}

/// Bytes of the scores of a placement, in records and then in columns: all but its classes.
const SCORES_BYTES: usize = size_of::<Scores>() + 512;
/// Bytes that each class adds to them.
const CLASS_BYTES: usize = 64;

/// Steps of the work that a call waits for, in words.
const SCANNED: &str = "frames scanned for the P-SOG";
const SCORED: &str = "placements";

/// Seconds that a chunk of placements is to take.
const CHUNK_SECONDS: f64 = 0.25;

/// Scores placements chunk by chunk until the watch is stopped; chunks change no bit.
pub(crate) fn score(
    evaluator: &mut Evaluator,
    placements: &[Placement],
    watch: &WorkMessages,
) -> PyResult<Vec<Scores>> {
    let classes = evaluator.shared_problem().content().classes().len();
    room_for("scores", placements.len(), SCORES_BYTES + CLASS_BYTES * classes)?;
    let mut scores = Vec::with_capacity(placements.len());
    let mut size = 16;
    while scores.len() < placements.len() && watch.reach(SCORED, scores.len(), placements.len()) {
        let rest = &placements[scores.len()..];
        let start = std::time::Instant::now();
        scores.extend(evaluator.scores(&rest[..rest.len().min(size)]).map_err(raised)?);
        let seconds = start.elapsed().as_secs_f64().max(1e-4);
        size = ((size as f64 * CHUNK_SECONDS / seconds) as usize).clamp(1, 4096);
    }
    watch.reach(SCORED, scores.len(), placements.len());
    Ok(scores)
}

/// Adds a close look at placements to their scores. `asked` true looks at any number, false at none; without it up to
/// [`FEW_PLACEMENTS`] are looked at. Copies within the job's mounting tolerance are left out for more than these.
pub(crate) fn guard(
    job: &Job,
    evaluator: &mut Evaluator,
    placements: &[Placement],
    scores: &mut [Scores],
    asked: Option<bool>,
    watch: &WorkMessages,
) -> PyResult<()> {
    let are_few = placements.len() <= FEW_PLACEMENTS;
    if !asked.unwrap_or(are_few) {
        return Ok(());
    }
    let without = (!are_few).then(|| job.clone().tolerance(None));
    let all = placements.iter().zip(scores);
    let go_on = &mut || watch.goes_on();
    let looked =
        without.as_ref().unwrap_or(job).look_closely_while(evaluator.backend_mut(), all, go_on);
    looked.map(drop).map_err(raised)
}

/// True once the notes on a job were told.
#[derive(Default)]
pub(crate) struct NotesOnce(AtomicBool);

impl NotesOnce {
    /// Warns, the first time, of each sentence that the program tells of a job before it scores or searches. The job's
    /// problems are made if they were not.
    pub(crate) fn warn_once(&self, py: Python<'_>, job: &Job) -> PyResult<()> {
        if self.0.swap(true, Ordering::SeqCst) {
            return Ok(());
        }
        let job = job.clone();
        let notes = interruptible(py, move |_| notes_on(&job))?;
        let notes = notes.map_err(raised_of_run)?;
        warn_of(py, &notes.into_iter().map(Note::fact).collect::<Vec<_>>())
    }
}

/// Adds the near field to the scores of placements in a scene.
pub(crate) fn add_near_fields(
    scene: &Scene,
    evaluator: &mut Evaluator,
    placements: &[Placement],
    scores: &mut [Scores],
) -> PyResult<()> {
    let site = NearSite::new(scene, &evaluator.shared_problem()).map_err(raised)?;
    site.score(evaluator.backend_mut(), placements.iter().zip(scores)).map_err(raised)
}

/// Steps in words: a cast of all LiDARs of a placement into a frame.
const CAST: &str = "frames cast";

/// An engine whose casts are steps of a call.
struct CountedEngine<'a> {
    engine: &'a mut dyn Backend,
    watch: &'a WorkMessages,
    done: usize,
    total: usize,
}

/// Runs `work` with an engine; each of its `total` casts is told to the watch, which may stop it.
pub(crate) fn counted<T, E>(
    engine: &mut dyn Backend,
    watch: &WorkMessages,
    total: usize,
    work: impl FnOnce(&mut dyn Backend) -> Result<T, E>,
) -> Result<T, E> {
    let found = work(&mut CountedEngine { engine, watch, done: 0, total })?;
    watch.reach(CAST, total, total);
    Ok(found)
}

impl CountedEngine<'_> {
    /// Tells of the casts so far; an error where nobody waits for more.
    fn step(&mut self) -> Result<(), BackendError> {
        let goes_on = self.watch.reach(CAST, self.done.min(self.total), self.total);
        self.done += 1;
        if goes_on {
            return Ok(());
        }
        // Nobody reads it: the caller has left.
        Err(BackendError::Device {
            adapter: self.adapter().to_owned(),
            stage: "casting",
            message: "the call was stopped".to_owned(),
        })
    }
}

impl Backend for CountedEngine<'_> {
    fn name(&self) -> &'static str {
        self.engine.name()
    }

    fn adapter(&self) -> &str {
        self.engine.adapter()
    }

    fn tally(
        &mut self,
        placements: &[Placement],
        range: Option<f32>,
    ) -> Result<Vec<Tally>, BackendError> {
        self.engine.tally(placements, range)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>, BackendError> {
        self.step()?;
        self.engine.hits(poses, frame)
    }

    fn order(&self) -> BitOrder {
        self.engine.order()
    }

    fn each_bitmap(
        &mut self,
        poses: &[SensorPose],
        frame: usize,
        take: &TakeBitmap<'_>,
    ) -> Result<(), BackendError> {
        self.step()?;
        self.engine.each_bitmap(poses, frame, take)
    }

    fn times(&self) -> StageTimes {
        self.engine.times()
    }

    fn changes(&self) -> &[String] {
        self.engine.changes()
    }
}
