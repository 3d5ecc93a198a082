//! Suites of scenes, and the search for a better placement.

use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use pyo3::exceptions::{PyRuntimeError, PyStopIteration};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::{Value, json};
use sightline::job::{Found, Tolerance};
use sightline::report::{RunRecord, RunTimes, near_record};
use sightline::search::{Event, FrameChoice, LeftOut, Method, Scored, Settings, TimeLimit};
use sightline::vehicle::Vehicle;
use sightline::{Job, Note, Objective, Placement, Scene};

use crate::arguments::{self, Aim, listed};
use crate::arrays::to_python;
use crate::columns::{scored_object, scores_object};
use crate::engine::{Built, Kept, NotesOnce, guard, job_of, opened, score};
use crate::errors::{bad, in_python, raised, warn_of, warn_of_frames};
use crate::pages::{EndedSearch, Page, PyPage};
use crate::placements::{PyPlacement, placements_in};
use crate::scenes::{PyScene, frames_in_words};
use crate::wait::{Progress, Shown, WorkMessages, log, start, wait};

/// Several scenes that share LiDARs and mount; each counts the same. Raises `ValueError` for none, and where they differ.
#[pyclass(name = "Suite", module = "sightline", frozen)]
pub(crate) struct PySuite {
    given: Vec<Py<PyScene>>,
    scenes: Vec<Arc<Built>>,
    evaluator: Arc<Kept>,
    told: NotesOnce,
}

#[pymethods]
impl PySuite {
    #[new]
    fn new(scenes: &Bound<'_, PyAny>) -> PyResult<Self> {
        let given = given_scenes(scenes)?;
        let scenes = given.iter().map(|scene| scene.get().built.clone()).collect();
        let given = given.into_iter().map(Bound::unbind).collect();
        Ok(Self { given, scenes, evaluator: Arc::default(), told: NotesOnce::default() })
    }

    /// Names of the scenes.
    #[getter]
    fn names(&self) -> Vec<&str> {
        self.scenes.iter().map(|built| built.scene.name()).collect()
    }

    /// Scores over all scenes: the mean of the scenes' shares of information. `poses` and `tolerance` as for `Scene.score`:
    /// up to 64 placements are looked at closely, as in the program. Raises `ValueError` and warns as `Scene.score`.
    /// `progress` as for `optimize`.
    #[pyo3(signature = (poses, *, sensors = None, phases = None,
        tolerance = Some(Tolerance::default()), progress = None),
        text_signature = "($self, poses, *, sensors=None, phases=None, tolerance='5mm,0.5deg', progress=None)")]
    fn score<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = arguments::tolerance)] tolerance: Option<Tolerance>,
        progress: Option<Progress>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let scene = &self.scenes[0].scene;
        let placements = placements_in(scene, poses, sensors, phases)?;
        let all = job_of(&self.scenes)?;
        let (job, kept) = (all.clone().tolerance(tolerance), self.evaluator.clone());
        let progress = progress.unwrap_or_default();
        let work = move |placements: &[Placement], watch: &WorkMessages| {
            kept.with(
                || opened(&job),
                |evaluator| {
                    let mut scores = score(evaluator, placements, watch)?;
                    guard(&job, evaluator, placements, &mut scores, None, watch)?;
                    Ok(scores)
                },
            )
        };
        let scores = scored_object(py, scene.vehicle(), placements, progress, work)?;
        self.told.warn_once(py, &all)?;
        Ok(scores)
    }

    fn __len__(&self) -> usize {
        self.scenes.len()
    }

    fn __repr__(&self) -> String {
        let (names, frames) = (self.names(), frames_in_words(&self.scenes));
        let scenes = if names.len() == 1 { "scene" } else { "scenes" };
        format!("Suite({} {scenes}: {}; {frames})", names.len(), names.join(", "))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, given) = (slf.py(), &slf.get().given);
        let scenes: Vec<_> = given.iter().map(|scene| scene.bind(py)).collect();
        let arguments = (scenes,).into_pyobject(py)?.into_any();
        PyTuple::new(py, [slf.get_type().into_any(), arguments])
    }
}

/// Searches on a thread of its own and gives the result as Python has it; see [`beside`] and [`EndedSearch::asked`].
fn optimized<'py>(
    py: Python<'py>,
    (job, asked): (Job, Value),
    vehicle: &Vehicle,
    callback: Option<Py<PyAny>>,
    progress: Option<Progress>,
) -> PyResult<Bound<'py, PyAny>> {
    let (all, budget) = (job.clone(), asked["budget"].as_f64());
    let search = move |observe: &mut dyn FnMut(&Event) -> bool| -> PyResult<Option<EndedSearch>> {
        let length = asked["max_seconds"].as_f64().map(Duration::from_secs_f64);
        let job = job.within(length.map(TimeLimit::from_now));
        let found = job.optimize(&mut |event: &Event| observe(event)).map_err(raised)?;
        let Some(found) = found else { return Ok(None) };
        let best = found.outcome.best.as_ref();
        let near = best.map(|best| near_record(&job, &best.placement)).transpose();
        let near = near.map_err(raised)?.flatten();
        Ok(Some(EndedSearch { job, found, near, asked }))
    };
    NotesOnce::default().warn_once(py, &all)?;
    let (ended, signal) = beside(py, search, callback, progress)?;
    let Some(ended) = ended else {
        let early = || PyRuntimeError::new_err(ENDED_EARLY);
        return signalled(py, Some(signal.unwrap_or_else(early)), py.None().into_bound(py));
    };
    let notes = [left_out(&ended.found, vehicle, budget), doubts_about(&ended.found)].concat();
    let result = result_object(py, vehicle, ended)?;
    // A warning that is an exception has the result, too.
    let signal = signal.or(warn_of(py, &notes).err());
    signalled(py, signal, result)
}

/// Why a search that its callback ended has no result.
const ENDED_EARLY: &str = "callback: ended the search while its sensors were being chosen, so that there is no placement; \
    raise StopIteration at an event `generation` or later, or name the time with seconds=";

/// Notes on placements to start from that the search left out.
fn left_out(found: &Found, vehicle: &Vehicle, budget: Option<f64>) -> Vec<Note> {
    let told = |one: &LeftOut| {
        let start = found.settings.starts.iter().find(|start| start.name == one.name);
        let price = start.and_then(|start| vehicle.price_of_rig(start)).zip(budget);
        let dear = price.filter(|(price, budget)| price > budget);
        let dear =
            dear.map(|(price, budget)| format!("it costs {price}, and the budget is {budget}"));
        let why: Vec<String> = dear.into_iter().chain(one.why.iter().cloned()).collect();
        Note::fact(format!("starts: `{}` is not started from: {}.", one.name, why.join("; ")))
    };
    found.outcome.left_out.iter().map(told).collect()
}

/// Doubts about the end of a search: requirements that no equipment reaches, and requirements that the result misses.
fn doubts_about(found: &Found) -> Vec<Note> {
    let best = found.outcome.best.as_ref();
    let required = best.map_or(&[][..], |best| &best.scores.required);
    let beyond = found.equipped.iter().flat_map(|equipped| equipped.beyond_reach(required));
    let beyond = beyond.map(|words| format!("OUT OF REACH: {words}"));
    let missed = required.iter().filter(|seen| seen.share < seen.least).map(ToString::to_string);
    beyond.chain(missed).map(Note::doubt).collect()
}

/// Tells a callback of an event; `Ok(false)` where it asks for the end by `StopIteration`, as SciPy has it.
fn tell(py: Python<'_>, callback: &Py<PyAny>, event: &Event) -> PyResult<bool> {
    let told = match event {
        Event::Note(text) => json!({ "event": "note", "text": in_python(text) }),
        Event::Generation(record) => {
            let mut told = json!(record);
            told["event"] = "generation".into();
            told
        }
        Event::Progress { work, done, total } => {
            json!({ "event": "progress", "work": work.to_string(), "done": done, "total": total })
        }
        _ => return Ok(true),
    };
    match callback.call1(py, (to_python(py, &told)?,)) {
        Ok(_) => Ok(true),
        Err(error) if error.is_instance_of::<PyStopIteration>(py) => Ok(false),
        Err(error) => Err(error),
    }
}

/// Refuses the first option that is given and has no meaning where the objective is a function.
fn refuse_beside_function(options: &[(&str, bool)]) -> PyResult<()> {
    let why = "is not taken where objective is a function; leave it out";
    let given = options.iter().find(|(_, is_given)| *is_given);
    given.map_or(Ok(()), |(name, _)| Err(bad(format!("{name}: {why}"))))
}

/// Search methods by their names in Python.
const METHODS: [(&str, Method); 3] =
    [("both", Method::Both), ("cma", Method::Cma), ("swaps", Method::Swaps)];

/// Placements of a scene, none where none or an empty list is given.
fn layouts(scene: &Scene, given: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Placement>> {
    match given.filter(|list| !list.len().is_ok_and(|length| length == 0)) {
        Some(list) => placements_in(scene, list, None, None),
        None => Ok(Vec::new()),
    }
}

/// Placements of a scene as Python has them; none where none are given.
fn own_placements(
    scene: &Bound<'_, PyScene>,
    given: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<PyPlacement>> {
    let Some(given) = given else { return Ok(Vec::new()) };
    let placements = placements_in(&scene.get().built.scene, given, None, None)?;
    Ok(placements.into_iter().map(PyPlacement).collect())
}

/// Searches placements over a scene or several, as `sightline optimize` does with the same settings.
///
/// - `objective`: a score by name, as `near_gain_2` for what two LiDARs see, a weighted sum, or a function (see below)
/// - `evaluations`, `target`, `seconds`: the search ends after so many evaluations and their swaps, at this objective,
///   or after this time
/// - `method`: `both`, `cma` or `swaps`
/// - `frames`: a number of frames, spread evenly, `"all"`, or `"on-demand"` (the default): as many as the search asks
///   for
/// - `baselines`: placements to compare with (Table 7 unless given); `starts`: placements to start from
/// - `mirror`: adds the mirror image of each scene
/// - `budget`: most that the vehicle's sensors may cost; `fewest`: as few as meet all requirements, and as cheap
/// - `tolerance`: a length and an angle as text, or `None`: each requirement is looked at in 200 copies mounted within
///   it
/// - `bound`: the bound is worked on until no placement on its grid that meets the requirements is better than the best
///   one there by more than this percentage, whatever time that takes
///
/// A function takes `Scores` and gives f64 `[N]`, the larger the better. It is searched with CMA-ES alone, over the
/// frames that the scenes are scored over. Beside it only `evaluations`, `seed`, `population`, `baselines` (none unless
/// given), `target`, `seconds`, `callback` and `progress` are taken. Placements that are not `feasible` rank behind.
///
/// `callback` is called with a dict for each event: `{"event": "note", "text"}`, `{"event": "generation", "generation",
/// "evaluations", "best_so_far", …}`, `{"event": "progress", "work", "done", "total"}`. If it raises `StopIteration`,
/// the search ends, confirms what it has, over few frames where a scene has more than 32, and returns it. Ctrl-C and
/// any other exception end it likewise, but go on to the caller, with the `Result` as their `result`. While sensors are
/// still being chosen there is no placement: then `StopIteration` becomes a `RuntimeError`, and `result` is `None`.
///
/// A requirement that the result misses is a `DoubtWarning`, one that no equipment reaches, too; `Result.verdict` says it
/// in words, as the program does.
///
/// `progress` says how a call shows how far it is. `True` shows a bar, `False` nothing. `None` waits two seconds, then
/// shows a bar where tqdm is installed and stderr is a terminal or a notebook. Elsewhere it writes `INFO` records of
/// the logger `sightline`. A function is called with a `Progress`, at most ten times a second; its exceptions end the
/// call. Raises `ValueError` for settings that are not usable, `MemoryError` where memory does not suffice, `OSError`
/// where a device fails.
#[pyfunction(name = "optimize")]
#[pyo3(signature = (scenes, *, objective = Aim::Text("near_gain".into()), evaluations = 180, seed = 1,
    method = "both", frames = None, population = None, baselines = None, starts = None,
    target = None, seconds = None, mirror = false, budget = None, fewest = false,
    tolerance = Some(Tolerance::default()), bound = None, callback = None, progress = None),
    text_signature = "(scenes, *, objective='near_gain', evaluations=180, seed=1, method='both', frames=None, \
    population=None, baselines=None, starts=None, target=None, seconds=None, mirror=False, budget=None, fewest=False, \
    tolerance='5mm,0.5deg', bound=None, callback=None, progress=None)")]
pub(crate) fn search<'py>(
    py: Python<'py>,
    scenes: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = arguments::objective)] objective: Aim,
    #[pyo3(from_py_with = arguments::evaluations)] evaluations: u64,
    #[pyo3(from_py_with = arguments::seed)] seed: u64,
    method: &str,
    frames: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = arguments::population)] population: Option<usize>,
    baselines: Option<&Bound<'py, PyAny>>,
    starts: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = arguments::target)] target: Option<f64>,
    #[pyo3(from_py_with = arguments::seconds)] seconds: Option<f64>,
    mirror: bool,
    #[pyo3(from_py_with = arguments::budget)] budget: Option<f64>,
    fewest: bool,
    #[pyo3(from_py_with = arguments::tolerance)] tolerance: Option<Tolerance>,
    #[pyo3(from_py_with = arguments::bound)] bound: Option<f64>,
    #[pyo3(from_py_with = arguments::callback)] callback: Option<Py<PyAny>>,
    progress: Option<Progress>,
) -> PyResult<Bound<'py, PyAny>> {
    let given = given_scenes(scenes)?;
    let objective = match objective {
        Aim::Text(text) => text,
        Aim::Function(function) => {
            refuse_beside_function(&[
                ("method", !["both", "cma"].contains(&method)),
                ("frames", frames.is_some()),
                ("starts", starts.is_some()),
                ("mirror", mirror),
                ("budget", budget.is_some()),
                ("fewest", fewest),
                ("bound", bound.is_some()),
                ("tolerance", tolerance != Some(Tolerance::default())),
            ])?;
            let baselines = own_placements(&given[0], baselines)?;
            let settings = (evaluations, seed, population, baselines, target, seconds);
            let asked = (given, function, settings, callback, progress.and_then(|of| of.0));
            return py.import("sightline._by_function")?.getattr("search")?.call1(asked);
        }
    };
    let scenes: Vec<_> = given.iter().map(|scene| scene.get().built.clone()).collect();
    let settings = Settings {
        objective: objective.parse::<Objective>().map_err(raised)?,
        method: word("method", method, &METHODS)?,
        evaluations,
        population,
        seed,
        frames: frames_of(frames, &scenes)?,
        starts: layouts(&scenes[0].scene, starts)?,
        gap: bound.map(|percent| percent / 100.0),
        target,
        engine: scenes[0].options.engine.clone(),
        ..Settings::default()
    };
    let job = job_of(&scenes)?.mirrored(mirror).budget(budget).fewest(fewest);
    let mut job = job.tolerance(tolerance).search(settings);
    if baselines.is_some() {
        job = job.baselines(layouts(&scenes[0].scene, baselines)?);
    }
    let asked = json!({ "search": { "evaluations": evaluations }, "budget": budget, "fewest": fewest,
        "mirror": mirror, "tolerance": tolerance, "max_seconds": seconds });
    optimized(py, (job, asked), scenes[0].scene.vehicle(), callback, progress)
}

/// A result, or the signal that ended its search, with the result as its attribute.
pub(crate) fn signalled<'py>(
    py: Python<'py>,
    signal: Option<PyErr>,
    result: Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyAny>> {
    let Some(signal) = signal else { return Ok(result) };
    signal.value(py).setattr("result", result)?;
    Err(signal)
}

/// The built scenes of a `Scene`, or of a list of at least one.
pub(crate) fn scenes_of(given: &Bound<'_, PyAny>) -> PyResult<Vec<Arc<Built>>> {
    Ok(given_scenes(given)?.iter().map(|scene| scene.get().built.clone()).collect())
}

/// A scene, or a list of at least one.
fn given_scenes<'py>(given: &Bound<'py, PyAny>) -> PyResult<Vec<Bound<'py, PyScene>>> {
    if let Ok(one) = given.cast::<PyScene>() {
        return Ok(vec![one.clone()]);
    }
    let scenes = listed::<PyScene>("scenes", given, "a Scene")?;
    scenes.ok_or_else(|| match given.len() {
        Ok(0) => bad("scenes: are none; give at least one"),
        _ => bad("scenes: give a Scene or a list of them"),
    })
}

/// Result of a search, and the signal or the callback's exception that ended it.
type SearchEnd<T> = (T, Option<PyErr>);

/// Searches on a thread of its own. After Ctrl-C, or an exception of the callback, the search ends its generation and
/// confirms its best so far; after a second one it is left alone.
pub(crate) fn beside<T: Send + 'static>(
    py: Python<'_>,
    search: impl FnOnce(&mut dyn FnMut(&Event) -> bool) -> PyResult<T> + Send + 'static,
    callback: Option<Py<PyAny>>,
    progress: Option<Progress>,
) -> PyResult<SearchEnd<T>> {
    let watch = Arc::new(WorkMessages::default());
    let mut shown = Shown::new(progress.unwrap_or_default(), watch.clone());
    let failed: Arc<Mutex<Option<PyErr>>> = Arc::default();
    let (sender, receiver) = channel();
    let (told, failing) = (watch.clone(), failed.clone());
    start(move || {
        let mut observe = |event: &Event| {
            match event {
                Event::Note(sentence) => log("info", sentence),
                Event::Progress { work, done, total } => {
                    told.reach(&work.to_string(), *done as usize, *total as usize);
                }
                _ => {}
            }
            if let Some(callback) = callback.as_ref().filter(|_| told.goes_on()) {
                match Python::attach(|py| tell(py, callback, event)) {
                    Ok(true) => {}
                    Ok(false) => told.stop(),
                    Err(error) => {
                        *failing.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                        told.stop();
                    }
                }
            }
            told.goes_on()
        };
        drop(sender.send(search(&mut observe)));
    })?;
    let receiver = Mutex::new(receiver);
    let mut signal = None;
    let mut waited = wait(py, &receiver, Some(&mut shown));
    if let Err(first) = waited {
        watch.stop();
        signal = Some(first);
        waited = wait(py, &receiver, Some(&mut shown));
    }
    let told = shown.end(py, waited.is_ok() && signal.is_none());
    let Some(ended) = waited? else {
        return Err(PyRuntimeError::new_err("the search ended without a result; see stderr"));
    };
    let failed = failed.lock().unwrap_or_else(PoisonError::into_inner).take();
    Ok((ended?, signal.or(failed).or(told.err())))
}

fn result_object<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    ended: EndedSearch,
) -> PyResult<Bound<'py, PyAny>> {
    let EndedSearch { job, found, near, .. } = &ended;
    let Found { outcome, suite, settings, equipment, equipped, equipping } = found;
    let mut settled = json!(settings);
    if let Some(equipped) = equipped {
        settled["equipped"] = equipped.record(vehicle);
    }
    let scene = suite.members().first().map_or("", |member| member.name());
    let (times, equip) = (&outcome.times, equipping.as_secs_f64());
    let record = RunRecord {
        settings: settled,
        equipment: equipment.clone(),
        seed: settings.seed,
        objective: settings.objective.to_string(),
        conditions: job.conditions_in_words(),
        near_field: near.clone(),
        rate: times.scored as f64 / times.generations.max(1e-9),
        timings: RunTimes {
            equip,
            search: times.search,
            generations: times.generations,
            bookkeeping: times.bookkeeping,
            swaps: times.swaps,
            bounds: times.bounds,
            confirm: times.confirm,
            total: equip + times.frames + times.search + times.confirm,
            ..RunTimes::default()
        },
        ..RunRecord::new(outcome, suite, scene)
    };
    let placement = |scored: &Scored| PyPlacement(scored.placement.clone());
    let all = outcome.best.iter().chain(&outcome.baselines);
    let all = all.map(|scored| (&scored.placement, &scored.scores));
    let fields = PyDict::new(py);
    fields.set_item("best", outcome.best.as_ref().map(placement))?;
    fields.set_item("baselines", outcome.baselines.iter().map(placement).collect::<Vec<_>>())?;
    fields.set_item("scores", scores_object(py, vehicle, all)?)?;
    fields.set_item("history", to_python(py, &outcome.history)?)?;
    fields.set_item("record", to_python(py, &record)?)?;
    fields.set_item("verdict", record.json()["verdict"].as_str().map(in_python))?;
    let page = Page::Search(Arc::new(ended), Box::new(record));
    fields.set_item("_page", PyPage(page).into_pyobject(py)?)?;
    py.import("sightline._records")?.getattr("Result")?.call((), Some(&fields))
}

/// A value by its word.
fn word<T: Copy>(what: &str, given: &str, known: &[(&str, T)]) -> PyResult<T> {
    let found = known.iter().find(|(name, _)| *name == given);
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
        bad(format!("{what}: `{given}` is none; give {}", names.join(", ")))
    })
}

/// Frames of a search: a number, `all`, or on demand for `None`. Warns of a number that no scene has.
fn frames_of(given: Option<&Bound<'_, PyAny>>, scenes: &[Arc<Built>]) -> PyResult<FrameChoice> {
    let Some(given) = given else { return Ok(FrameChoice::OnDemand) };
    match given.extract::<String>().as_deref() {
        Ok("on-demand") => Ok(FrameChoice::OnDemand),
        Ok("all") => Ok(FrameChoice::All),
        Ok(_) => {
            let found = arguments::shown(given);
            Err(bad(format!("frames: is {found}; give a whole number, \"all\" or \"on-demand\"")))
        }
        Err(_) => {
            let wanted: u32 = arguments::whole("frames", given, 1..=u32::MAX as i128)?;
            let count = scenes.iter().map(|built| built.scored_frames().len()).max().unwrap_or(0);
            warn_of_frames(given.py(), wanted as usize, count)?;
            Ok(FrameChoice::Count(wanted))
        }
    }
}
