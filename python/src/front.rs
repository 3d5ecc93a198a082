//! The front of two or three objectives of a vehicle's sensors and poses.

use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use sightline::job::{Front, FrontObjectives, Tolerance};
use sightline::report::{FrontContext, FrontRecord};
use sightline::search::{Event, Settings, TimeLimit};
use sightline::vehicle::Vehicle;

use crate::arguments;
use crate::arrays::to_python;
use crate::columns::scores_object;
use crate::engine::job_of;
use crate::errors::{bad, raised};
use crate::placements::PyPlacement;
use crate::progress::Progress;
use crate::search::{beside, scenes_of, signalled};

/// Searches the front of two or three objectives over a vehicle's sensors and poses, as `sightline optimize --front` does.
///
/// `objectives` are names: `price`, `sensors` and `requirements` (also `targets`: the missing share of what the vehicle
/// requires, summed) are better when less, scores such as `near_gain` when more. Sensors are chosen on a coarse grid of poses
/// under a row of limits, for at most `budget`; all placements are scored over all frames. `evaluations` search around each
/// point, 0 leave them on the grid. `seconds`, `mirror`, `tolerance`, `callback` and `progress` are those of `optimize`; `StopIteration` and Ctrl-C
/// keep the points found so far. Raises `ValueError` for objectives and settings that are not usable.
#[pyfunction(name = "front")]
#[pyo3(signature = (scenes, objectives, *, evaluations = 40, seed = 1, seconds = None, mirror = false, budget = None,
    tolerance = "5mm,0.5deg", callback = None, progress = None))]
pub(crate) fn front<'py>(
    py: Python<'py>,
    scenes: &Bound<'py, PyAny>,
    objectives: Vec<String>,
    #[pyo3(from_py_with = arguments::evaluations_around)] evaluations: u64,
    #[pyo3(from_py_with = arguments::seed)] seed: u64,
    #[pyo3(from_py_with = arguments::seconds)] seconds: Option<f64>,
    mirror: bool,
    #[pyo3(from_py_with = arguments::budget)] budget: Option<f64>,
    tolerance: Option<&str>,
    callback: Option<Py<PyAny>>,
    progress: Option<Progress>,
) -> PyResult<Bound<'py, PyAny>> {
    let scenes = scenes_of(scenes)?;
    let objectives = FrontObjectives::named(&objectives).map_err(raised)?;
    let tolerance = tolerance.map(|text| text.parse::<Tolerance>().map_err(bad)).transpose()?;
    let engine = scenes[0].options.engine.clone();
    let settings = Settings { evaluations, seed, engine, ..Settings::default() };
    let job =
        job_of(&scenes)?.mirrored(mirror).budget(budget).tolerance(tolerance).search(settings);
    let mut context = FrontContext {
        scene: scenes[0].scene.name().to_owned(),
        settings: json!({ "front": objectives, "evaluations": evaluations, "seed": seed, "mirror": mirror,
            "budget": budget, "tolerance": tolerance, "seconds": seconds }),
        conditions: job.conditions_in_words(),
        ..FrontContext::default()
    };
    let search = move |observe: &mut dyn FnMut(&Event) -> bool| {
        let length = seconds.map(Duration::from_secs_f64);
        let job = job.within(length.map(TimeLimit::from_now));
        job.front(&objectives, &mut |event: &Event| observe(event)).map_err(raised)
    };
    let start = std::time::Instant::now();
    let (found, signal) = beside(py, search, callback, progress)?;
    context.seconds = start.elapsed().as_secs_f64();
    let result = front_object(py, scenes[0].scene.vehicle(), &found, context)?;
    signalled(py, signal, result)
}

fn front_object<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    front: &Front,
    context: FrontContext,
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
    fields.set_item("record", to_python(py, &FrontRecord::new(front, context))?)?;
    py.import("sightline._records")?.getattr("Front")?.call((), Some(&fields))
}
