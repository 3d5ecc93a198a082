//! A scene with what is built from it once: P-SOG, problem, engine.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use pyo3::PyResult;
use sightline::engine::{EngineChoice, EngineKind, open};
use sightline::problem::spread;
use sightline::scan::conditions::Condition;
use sightline::scan::in_conditions;
use sightline::search::Suite;
use sightline::{Evaluator, Placement, Problem, Psog, Scene, Scores};

use crate::errors::{bad, raised};

/// How a scene is to be scored.
#[derive(Clone, Default)]
pub struct Options {
    /// In place of the scene's own.
    pub psog: Option<Arc<Psog>>,
    /// So many frames, spread evenly; all if `None`.
    pub frames: Option<u32>,
    /// Weather and faults.
    pub conditions: Vec<Condition>,
    /// What computes.
    pub engine: EngineChoice,
}

impl Options {
    /// From the words of Python.
    pub fn new(
        psog: Option<Arc<Psog>>,
        frames: Option<u32>,
        conditions: &[String],
        backend: &str,
        adapter: Option<String>,
        memory: Option<u64>,
    ) -> PyResult<Self> {
        let kind = match backend {
            "auto" => EngineKind::Auto,
            "cpu" => EngineKind::Cpu,
            "gpu" => EngineKind::Gpu,
            other => return Err(bad(format!("backend: `{other}` is none; give auto, cpu or gpu"))),
        };
        if frames == Some(0) {
            return Err(bad("frames: are 0; give 1 or more, or None for all"));
        }
        let conditions = conditions.iter().map(|text| text.parse().map_err(raised));
        let conditions = conditions.collect::<PyResult<_>>()?;
        Ok(Self { psog, frames, conditions, engine: EngineChoice { kind, adapter, memory } })
    }
}

/// A scene, and what is built from it when it is first needed.
pub struct Built {
    pub scene: Arc<Scene>,
    pub options: Options,
    psog: OnceLock<Arc<Psog>>,
    problem: OnceLock<Arc<Problem>>,
    evaluator: Mutex<Option<Evaluator>>,
    /// The last frame that was cast into, and its problem.
    frame: Mutex<Option<(usize, Arc<Problem>)>>,
}

impl Built {
    pub fn new(scene: Scene, options: Options) -> Self {
        let psog = options.psog.clone().map_or_else(OnceLock::new, OnceLock::from);
        Self {
            scene: Arc::new(scene),
            options,
            psog,
            problem: OnceLock::new(),
            evaluator: Mutex::new(None),
            frame: Mutex::new(None),
        }
    }

    /// The P-SOG: given, read, or built from virtual scans.
    pub fn psog(&self) -> PyResult<Arc<Psog>> {
        if let Some(psog) = self.psog.get() {
            return Ok(psog.clone());
        }
        let psog = Arc::new(Psog::of(&self.scene, || {}).map_err(raised)?);
        Ok(self.psog.get_or_init(|| psog).clone())
    }

    /// The problem over the frames of the options.
    pub fn problem(&self) -> PyResult<Arc<Problem>> {
        if let Some(problem) = self.problem.get() {
            return Ok(problem.clone());
        }
        let psog = self.psog()?;
        self.scene.check_detection(psog.classes()).map_err(raised)?;
        let frames = spread(self.scene.frame_count(), self.options.frames);
        let problem = Problem::with_psog(&self.scene, &psog, &frames).map_err(raised)?;
        let problem = in_conditions(&self.scene, problem, &self.options.conditions);
        let problem = Arc::new(problem.map_err(raised)?);
        Ok(self.problem.get_or_init(|| problem).clone())
    }

    /// Works with the engine, which is opened first if it was not.
    pub fn evaluate<T>(&self, work: impl FnOnce(&mut Evaluator) -> PyResult<T>) -> PyResult<T> {
        let mut evaluator = self.evaluator.lock().unwrap_or_else(PoisonError::into_inner);
        if evaluator.is_none() {
            let problem = self.problem()?;
            let opened = open(&problem, &self.options.engine, |_| {}).map_err(raised)?;
            *evaluator = Some(Evaluator::new(problem, opened.engine));
        }
        match &mut *evaluator {
            Some(evaluator) => work(evaluator),
            None => Err(bad("the engine is not there")),
        }
    }

    /// One frame to cast into.
    pub fn frame(&self, frame: usize) -> PyResult<Arc<Problem>> {
        if !self.scene.has_geometry() {
            return Err(bad(
                "the scene has no geometry to cast into; add static shapes, actors or an ego body",
            ));
        }
        let frames = self.scene.frame_count();
        if frame >= frames {
            return Err(bad(format!("frame: is {frame}; give 0 to {}", frames - 1)));
        }
        let mut last = self.frame.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((number, problem)) = &*last
            && *number == frame
        {
            return Ok(problem.clone());
        }
        let problem = Arc::new(Problem::of_frame(&self.scene, frame).map_err(raised)?);
        *last = Some((frame, problem.clone()));
        Ok(problem)
    }
}

/// The suite of some scenes, by their names.
pub fn suite_of(scenes: &[Arc<Built>]) -> PyResult<Suite> {
    let named = |built: &Arc<Built>| Ok((built.scene.name().to_owned(), built.problem()?));
    let named = scenes.iter().map(named).collect::<PyResult<Vec<_>>>()?;
    Suite::new(named).map_err(raised)
}

/// Seconds that a chunk of placements is to take.
const CHUNK_SECONDS: f64 = 0.25;

/// Scores placements chunk by chunk until `stopped`; chunks change no bit.
pub fn score(
    evaluator: &mut Evaluator,
    placements: &[Placement],
    stopped: impl Fn() -> bool,
) -> PyResult<Vec<Scores>> {
    let mut scores = Vec::with_capacity(placements.len());
    let mut size = 16;
    while scores.len() < placements.len() && !stopped() {
        let rest = &placements[scores.len()..];
        let start = std::time::Instant::now();
        scores.extend(evaluator.scores(&rest[..rest.len().min(size)]).map_err(raised)?);
        let seconds = start.elapsed().as_secs_f64().max(1e-4);
        size = ((size as f64 * CHUNK_SECONDS / seconds) as usize).clamp(1, 4096);
    }
    Ok(scores)
}
