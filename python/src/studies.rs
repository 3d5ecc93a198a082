//! Work of many runs: studies as tables, and the front of two or three objectives.

use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;

use crate::arguments;
use crate::arrays::{few_numbers, to_python};
use crate::columns::scores_object;
use crate::engine::{Built, NotesOnce, job_of};
use crate::errors::{bad, raised, warn_of};
use crate::pages::{Page, PyPage};
use crate::placements::{PyPlacement, placements_in};
use crate::search::{beside, scenes_of, signalled};
use crate::wait::{Progress, WorkMessages, answer};
use sightline::Note;
use sightline::job::{Front, FrontObjectives, Tolerance};
use sightline::report::{FrontRecord, front_html};
use sightline::scan::conditions::Condition;
use sightline::search::{Event, Settings, TimeLimit};
use sightline::study::{Kind, StudyError, StudyObserver, StudySettings, Subregion, Table, study};
use sightline::vehicle::Vehicle;

/// Observer of a study that reports to the watch of a call.
struct Told<'a> {
    watch: &'a WorkMessages,
    cases: Cell<usize>,
    done: Cell<usize>,
}

impl StudyObserver for Told<'_> {
    fn begins(&self, cases: usize) {
        self.cases.set(cases);
    }

    fn done(&self) {
        self.done.set(self.done.get() + 1);
    }

    fn goes_on(&self) -> bool {
        self.watch.reach("cases", self.done.get(), self.cases.get())
    }
}

/// Studies of the program that are methods of `Scene`.
const OF_SCENE: [(&str, &str); 6] = [
    ("nearfield", "near_field(poses)"),
    ("targets", "detections(poses, targets, distances, bearings)"),
    ("redundancy", "redundancy(poses)"),
    ("overlap", "overlap(poses)"),
    ("sweep", "sweep(poses, \"0.pitch\", values)"),
    ("tolerance", "tolerance(poses)"),
];

/// Makes the study `kind` of one scene (`transfer`: of several), as `sightline study` does, and returns its table as a `dict`:
/// `title`, `columns`, `rows` with `name`, `values`, `placement`, `requirements_met`, `not_met`, `warning`, and `notes`; rows of
/// `loss` have `after_loss`.
///
/// `kind` is `lidars`, `cost`, `channels`, `voxels`, `random`, `tasks`, `height`, `regions`, `loss`, `weather`, `transfer` or
/// `published`. Own rigs, `poses` with `sensors` and `phases` as for `Scene.score`, are taken by `loss`, `random`, `regions`,
/// `voxels` and `weather`; other kinds search rigs, for at most `budget`, by `evaluations` and swaps. Scores are means over the
/// frames that the scene was loaded with, else over two (`loss` of own rigs: all). The scene's weather and P-SOG count;
/// `weather` takes `conditions`, a row each (some fog, snow and rain for `None`). `regions` are further boxes, name to `[x0, y0, z0, x1, y1, z1]` in metres,
/// `sensor_files` further sensors of `channels`, `voxel` the edge in metres of `published`. `progress` as for
/// `optimize`; Ctrl-C ends the study. Raises `ValueError` for arguments that a kind does not take, and where a study has no answer.
#[pyfunction(name = "study")]
#[pyo3(signature = (kind, scenes, poses = None, *, sensors = None, phases = None, objective = "near_gain",
    evaluations = 120, random = 200, seed = 1, budget = None, conditions = None, regions = None, sensor_files = None,
    voxel = 0.1, progress = None))]
pub(crate) fn study_table<'py>(
    py: Python<'py>,
    kind: &str,
    scenes: &Bound<'py, PyAny>,
    poses: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
    phases: Option<&Bound<'py, PyAny>>,
    #[pyo3(from_py_with = arguments::objective_in_words)] objective: &str,
    #[pyo3(from_py_with = arguments::evaluations)] evaluations: u64,
    #[pyo3(from_py_with = arguments::study_random)] random: u32,
    #[pyo3(from_py_with = arguments::seed)] seed: u64,
    #[pyo3(from_py_with = arguments::budget)] budget: Option<f64>,
    #[pyo3(from_py_with = arguments::conditions)] conditions: Option<Vec<String>>,
    regions: Option<&Bound<'py, PyDict>>,
    #[pyo3(from_py_with = arguments::sensor_files)] sensor_files: Option<Vec<PathBuf>>,
    voxel: f64,
    progress: Option<Progress>,
) -> PyResult<Bound<'py, PyAny>> {
    if let Some((_, method)) = OF_SCENE.iter().find(|(name, _)| *name == kind) {
        return Err(bad(format!("kind: `{kind}` is a method of Scene: scene.{method}")));
    }
    let kind: Kind = kind.parse().map_err(|error: StudyError| bad(format!("kind: {error}")))?;
    let scenes = scenes_of(scenes)?;
    kind.check_scenes(scenes.len()).map_err(raised)?;
    check_alike(&scenes)?;
    if !(voxel > 0.0 && voxel.is_finite()) {
        return Err(bad(format!("voxel: is {voxel}; give the edge of a voxel, metres above 0")));
    }
    let placements = match poses {
        None => Vec::new(),
        Some(_) if !kind.takes_placements() => {
            return Err(bad(format!(
                "poses: `{}` takes none, as it searches its own",
                kind.name()
            )));
        }
        Some(poses) => placements_in(&scenes[0].scene, poses, sensors, phases)?,
    };
    let standard = StudySettings::default();
    let settings = StudySettings {
        objective: objective.parse().map_err(raised)?,
        evaluations,
        frames: frames_of(kind, !placements.is_empty(), &scenes).unwrap_or(standard.frames),
        random,
        voxel,
        seed,
        sensors: sensor_files.unwrap_or_default(),
        regions: boxes(regions)?,
        placements,
        budget,
        conditions: conditions_of(kind, &scenes, conditions)?,
        engine: scenes[0].options.engine.clone(),
    };
    answer(py, progress, move |watch| made(kind, &scenes, &settings, watch))
}

/// The table of a study, until the watch is stopped.
fn made(
    kind: Kind,
    scenes: &[Arc<Built>],
    settings: &StudySettings,
    watch: &WorkMessages,
) -> PyResult<Table> {
    scenes.iter().try_for_each(|built| built.psog(watch).map(drop))?;
    let job = job_of(scenes)?;
    if kind.searches(!settings.placements.is_empty()) {
        job.check_room().map_err(raised)?;
    }
    let told = Told { watch, cases: Cell::default(), done: Cell::default() };
    let table = study(kind, job.scenes(), settings, &mut Vec::new(), &told).map_err(raised)?;
    told.goes_on();
    match table.unanswered() {
        Some(why) => Err(bad(why)),
        None => Ok(table),
    }
}

/// Refuses scenes of different frames or weather: a study takes those of the first for all.
fn check_alike(scenes: &[Arc<Built>]) -> PyResult<()> {
    let first = &scenes[0];
    let is_other = |built: &&Arc<Built>| {
        let (one, other) = (&first.options, &built.options);
        one.frames != other.frames || one.conditions != other.conditions
    };
    scenes.iter().find(is_other).map_or(Ok(()), |other| {
        Err(bad(format!(
            "scenes: {} and {} were loaded with different frames or conditions; load all with the same",
            first.scene.name(),
            other.scene.name()
        )))
    })
}

/// Frames of a study: those that the first scene was loaded with, all for the loss of own rigs; `None` for the usual number.
fn frames_of(kind: Kind, has_rigs: bool, scenes: &[Arc<Built>]) -> Option<u32> {
    let all = scenes.iter().map(|built| built.scene.frame_count() as u32).max();
    scenes[0].options.frames.or(all.filter(|_| kind == Kind::Loss && has_rigs))
}

fn boxes(given: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<Subregion>> {
    let region = |(name, corners): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let name: String = name.extract()?;
        let [x0, y0, z0, x1, y1, z1] = few_numbers(&format!("regions[{name:?}]"), &corners)?;
        if !(x0 < x1 && y0 < y1 && z0 < z1) {
            return Err(bad(format!(
                "regions[{name:?}]: each upper corner must be above the lower one; give [x0, y0, z0, x1, y1, z1] in metres"
            )));
        }
        Ok(Subregion::of_box(&name, [x0, y0, z0], [x1, y1, z1]))
    };
    given.into_iter().flatten().map(region).collect()
}

/// Weather of a study: that of the scenes, or the rows of `weather`.
fn conditions_of(
    kind: Kind,
    scenes: &[Arc<Built>],
    given: Option<Vec<String>>,
) -> PyResult<Vec<Condition>> {
    match (kind == Kind::Weather, given) {
        (true, _) if !scenes[0].options.conditions.is_empty() => Err(bad(
            "scenes: `weather` compares conditions; load the scene without, and give them as conditions=[…]",
        )),
        (true, given) => given.iter().flatten().map(|text| text.parse().map_err(raised)).collect(),
        (false, None) => Ok(scenes[0].options.conditions.clone()),
        (false, Some(_)) => Err(bad(format!(
            "conditions: `{}` takes none here; load the scene with conditions=[…]",
            kind.name()
        ))),
    }
}

/// Searches the front of two or three objectives over a vehicle's sensors and poses, as `sightline optimize --front` does.
///
/// `objectives` are names: `price`, `sensors` and `requirements` are better when less, scores such as `near_gain` when more.
/// `requirements`, also called `targets`, is the missing share of all requirements, summed. Sensors are chosen on a coarse grid of poses
/// under a row of limits, for at most `budget`; all placements are scored over all frames. `evaluations` search around each
/// point, 0 leave them on the grid. `seconds`, `mirror`, `tolerance`, `callback` and `progress` mean the same
/// as in `optimize`; `StopIteration` and Ctrl-C keep the points found so far. Raises `ValueError` for objectives and settings that are not usable.
#[pyfunction(name = "front")]
#[pyo3(signature = (scenes, objectives, *, evaluations = 40, seed = 1, seconds = None, mirror = false, budget = None,
    tolerance = Some(Tolerance::default()), callback = None, progress = None),
    text_signature = "(scenes, objectives, *, evaluations=40, seed=1, seconds=None, mirror=False, budget=None, \
    tolerance='5mm,0.5deg', callback=None, progress=None)")]
pub(crate) fn front<'py>(
    py: Python<'py>,
    scenes: &Bound<'py, PyAny>,
    #[pyo3(from_py_with = arguments::objectives)] objectives: Vec<String>,
    #[pyo3(from_py_with = arguments::evaluations_around)] evaluations: u64,
    #[pyo3(from_py_with = arguments::seed)] seed: u64,
    #[pyo3(from_py_with = arguments::seconds)] seconds: Option<f64>,
    mirror: bool,
    #[pyo3(from_py_with = arguments::budget)] budget: Option<f64>,
    #[pyo3(from_py_with = arguments::tolerance)] tolerance: Option<Tolerance>,
    #[pyo3(from_py_with = arguments::callback)] callback: Option<Py<PyAny>>,
    progress: Option<Progress>,
) -> PyResult<Bound<'py, PyAny>> {
    let scenes = scenes_of(scenes)?;
    let objectives = FrontObjectives::named(&objectives).map_err(raised)?;
    let engine = scenes[0].options.engine.clone();
    let settings = Settings { evaluations, seed, engine, ..Settings::default() };
    let job =
        job_of(&scenes)?.mirrored(mirror).budget(budget).tolerance(tolerance).search(settings);
    let settings = json!({ "front": objectives, "evaluations": evaluations, "seed": seed, "mirror": mirror,
        "budget": budget, "tolerance": tolerance, "seconds": seconds });
    let asked = job.clone();
    let search = move |observe: &mut dyn FnMut(&Event) -> bool| {
        let length = seconds.map(Duration::from_secs_f64);
        let job = job.within(length.map(TimeLimit::from_now));
        job.front(&objectives, &mut |event: &Event| observe(event)).map_err(raised)
    };
    NotesOnce::default().warn_once(py, &asked)?;
    let start = std::time::Instant::now();
    let (found, signal) = beside(py, search, callback, progress)?;
    let record = FrontRecord {
        scene: scenes[0].scene.name().to_owned(),
        settings,
        conditions: asked.conditions_in_words(),
        seconds: start.elapsed().as_secs_f64(),
        ..FrontRecord::new(&found)
    };
    let result = front_object(py, scenes[0].scene.vehicle(), &found, &record)?;
    let is_missed = !found.points.is_empty() && !found.points.iter().any(|point| point.meets);
    let missed = is_missed.then(|| Note::doubt("NOT MET: no point meets all requirements."));
    let signal = signal.or(warn_of(py, missed.as_slice()).err());
    signalled(py, signal, result)
}

fn front_object<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    front: &Front,
    record: &FrontRecord,
) -> PyResult<Bound<'py, PyAny>> {
    let points = &front.points;
    let placements: Vec<_> =
        points.iter().map(|point| PyPlacement(point.placement.clone())).collect();
    let values: Vec<Vec<f64>> = points.iter().map(|point| point.values.clone()).collect();
    let scored = points.iter().map(|point| (&point.placement, &point.scores));
    let picks = PyDict::new(py);
    for (pick, point) in &front.picks {
        picks.set_item(pick.to_string(), point)?;
    }
    let fields = PyDict::new(py);
    fields.set_item("objectives", front.objectives.names())?;
    fields.set_item("placements", placements)?;
    fields.set_item("values", values)?;
    fields.set_item("prices", points.iter().map(|point| point.price).collect::<Vec<_>>())?;
    fields.set_item("meets", points.iter().map(|point| point.meets).collect::<Vec<_>>())?;
    fields.set_item("picks", picks)?;
    fields.set_item("scores", scores_object(py, vehicle, scored)?)?;
    fields.set_item("record", to_python(py, record)?)?;
    fields.set_item("_page", PyPage(Page::Front(front_html(front, record))).into_pyobject(py)?)?;
    py.import("sightline._records")?.getattr("Front")?.call((), Some(&fields))
}
