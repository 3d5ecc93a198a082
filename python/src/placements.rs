//! Placements: sensor poses by name, from objects, files and arrays.

use std::collections::HashSet;
use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::json;
use sightline::vehicle::{Doubts, MAX_LIDARS, SensorName, Violation, table_7};
use sightline::{Placement, Scene, SensorPose, read_placements};

use crate::arguments::{self, listed, room_for};
use crate::arrays::{column, matrix, numbers, to_python};
use crate::errors::{bad, raised, warn_of_placements, write_text};

const NAME_BYTES: usize = 32;

/// Required shape of an array of poses, in words.
const WANTED: &str =
    "[N, L, 6], or [L, 6] for one placement: x, y, z in metres, roll, pitch, yaw in radians";

/// A placement: a name and a pose for each of L LiDARs.
///
/// `poses` is `[L, 6]`: x, y, z in metres, roll, pitch, yaw in radians, in the ego frame. `sensors` names the model of
/// each LiDAR on a vehicle that has several. `phases` `[L]` locks LiDARs that turn at angles about their own axes, radians;
/// `NaN` for one that is as its model says. `rides_on` names the own body that carries each LiDAR, `""` for none. Raises `ValueError` for another shape and for numbers that are not finite.
#[pyclass(name = "Placement", module = "sightline", frozen, eq)]
#[derive(Clone, PartialEq)]
pub(crate) struct PyPlacement(pub Placement);

#[pymethods]
impl PyPlacement {
    #[new]
    #[pyo3(signature = (poses, *, name = "placement", sensors = None, phases = None, rides_on = None))]
    fn new(
        poses: &Bound<'_, PyAny>,
        name: &str,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'_, PyAny>>,
        rides_on: Option<Vec<String>>,
    ) -> PyResult<Self> {
        let mut all = from_array(poses, &sensors_of(sensors)?, phases)?;
        let [placement] = &mut all[..] else {
            return Err(bad(format!(
                "poses: are those of {} placements; give one of them, [L, 6]",
                all.len()
            )));
        };
        name.clone_into(&mut placement.name);
        let mut placement = all.remove(0);
        let (bodies, lidars) = (sensors_of(rides_on)?, placement.lidars.len());
        if !bodies.is_empty() && bodies.len() != lidars {
            let count = bodies.len();
            return Err(bad(format!(
                "rides_on: has the length {count}; give a body or \"\" for each LiDAR, {lidars} in all"
            )));
        }
        let pairs = placement.lidars.iter_mut().zip(bodies);
        pairs.for_each(|(pose, body)| pose.rides_on = body);
        placement.validate().map_err(raised)?;
        Ok(Self(placement))
    }

    /// Name, 1 to 64 of letters, digits, `.`, `_`, `-`.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// `[L, 6]` f64: x, y, z in metres, roll, pitch, yaw in radians.
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let values = self.0.lidars.iter().flat_map(SensorPose::values).collect();
        matrix(py, values, 6)
    }

    /// Model of each LiDAR; empty text where none is named.
    #[getter]
    fn sensors(&self) -> Vec<&'static str> {
        self.0.lidars.iter().map(|pose| pose.sensor.as_str()).collect()
    }

    /// `[L]` f64: where in its turn each LiDAR is locked, radians about its own axis; `NaN` where its model says so.
    #[getter]
    fn phases<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let phases = self.0.lidars.iter().map(|pose| pose.phase.unwrap_or(f64::NAN));
        column(py, phases.collect())
    }

    /// Own body that carries each LiDAR; empty text where none does.
    #[getter]
    fn rides_on(&self) -> Vec<&'static str> {
        self.0.lidars.iter().map(|pose| pose.rides_on.as_str()).collect()
    }

    /// The placement as a dict, with the keys of a placement file.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &self.0)
    }

    fn __len__(&self) -> usize {
        self.0.lidars.len()
    }

    fn __repr__(&self) -> String {
        format!("Placement({:?}, {} LiDARs)", self.0.name, self.0.lidars.len())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let this = slf.get();
        let named = this.0.lidars.iter().any(|pose| !pose.sensor.is_none());
        let options = PyDict::new(py);
        options.set_item("name", &this.0.name)?;
        options.set_item("sensors", named.then(|| this.sensors()))?;
        let phased = this.0.lidars.iter().any(|pose| pose.phase.is_some());
        options.set_item("phases", phased.then(|| this.phases(py)))?;
        let carried = this.0.lidars.iter().any(|pose| !pose.rides_on.is_none());
        options.set_item("rides_on", carried.then(|| this.rides_on()))?;
        let rebuild = py.import("sightline._pickle")?.getattr("call")?;
        let arguments = (slf.get_type(), (this.poses(py)?,), options);
        PyTuple::new(py, [rebuild, arguments.into_pyobject(py)?.into_any()])
    }
}

/// Sensor names of each LiDAR; empty where none is named.
pub(crate) fn sensors_of(names: Option<Vec<String>>) -> PyResult<Vec<SensorName>> {
    let name = |name: &String| match name.as_str() {
        "" => Ok(SensorName::NONE),
        name => SensorName::new(name).map_err(bad),
    };
    names.unwrap_or_default().iter().map(name).collect()
}

/// Placements from a `Placement`, a list of them, or an array `[N, L, 6]` or `[L, 6]`, of models that the scene's vehicle
/// has; warns of units that are most likely not meant.
pub(crate) fn placements_in(
    scene: &Scene,
    given: &Bound<'_, PyAny>,
    sensors: Option<Vec<String>>,
    phases: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Placement>> {
    let placements = parsed(given, sensors, phases)?;
    let models = scene.sensors().map_err(raised)?;
    let named = |placement| models.check(placement).map_err(|fault| bad(fault.to_string()));
    placements.iter().try_for_each(named)?;
    let doubts = Doubts::of_units();
    warn_of_placements(given.py(), placements.iter().flat_map(|one| doubts.about(one)))?;
    if scene.vehicle().mounts.iter().any(|mount| !mount.region.rides_on.is_none()) {
        let rules = scene.rules();
        let carried = |one: &Placement| -> Vec<String> {
            let broken = rules.violations(one).into_iter();
            let told = broken.filter(|one| matches!(one, Violation::CarriedOtherwise { .. }));
            told.map(|broken| format!("placement `{}`, {broken}", one.name)).collect()
        };
        warn_of_placements(given.py(), placements.iter().flat_map(carried))?;
    }
    Ok(placements)
}

/// Placements as they were given, whatever models there are.
pub(crate) fn parsed(
    given: &Bound<'_, PyAny>,
    sensors: Option<Vec<String>>,
    phases: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Placement>> {
    let names = sensors_of(sensors)?;
    let taken = |placement: &PyPlacement| match (names.is_empty(), phases) {
        (true, None) => Ok(placement.0.clone()),
        (false, _) => {
            Err(bad("sensors: a Placement names its own; give `sensors` with arrays of poses only"))
        }
        (true, Some(_)) => {
            Err(bad("phases: a Placement has its own; give `phases` with arrays of poses only"))
        }
    };
    if let Ok(one) = given.cast::<PyPlacement>() {
        return Ok(vec![taken(one.get())?]);
    }
    if let Some(list) = listed::<PyPlacement>("poses", given, "a Placement")? {
        return list.iter().map(|one| taken(one.get())).collect();
    }
    let all = from_array(given, &names, phases)?;
    all.iter().try_for_each(|placement| placement.validate().map_err(raised))?;
    Ok(all)
}

pub(crate) fn placement_bytes(lidars: usize) -> usize {
    size_of::<Placement>() + NAME_BYTES + lidars * size_of::<SensorPose>()
}

/// Phases of some placements, `[L]` for all of them or `[N, L]`, one after the other; none where `NaN`.
fn phases_of(given: &Bound<'_, PyAny>, count: usize, lidars: usize) -> PyResult<Vec<Option<f64>>> {
    let wanted = "[L] or [N, L]: radians, NaN for a LiDAR that is as its model says";
    let array = numbers::<f64>("phases", given, wanted)?;
    let own = |phase: &f64| Some(*phase).filter(|phase| !phase.is_nan());
    let values: Vec<Option<f64>> = array.as_array().iter().map(own).collect();
    match *array.shape() {
        [own] if own == lidars => Ok(values.repeat(count)),
        [own, each] if (own, each) == (count, lidars) => Ok(values),
        ref shape => Err(bad(format!(
            "phases: have the shape {shape:?}, where N is {count} and L is {lidars}; give {wanted}"
        ))),
    }
}

fn from_array(
    given: &Bound<'_, PyAny>,
    sensors: &[SensorName],
    phases: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<Placement>> {
    let array = numbers::<f64>("poses", given, WANTED)?;
    let shape = array.shape().to_vec();
    let (count, lidars) = match shape[..] {
        [lidars, 6] => (1, lidars),
        [count, lidars, 6] => (count, lidars),
        _ => return Err(bad(format!("poses: have the shape {shape:?}; give {WANTED}"))),
    };
    if !(1..=MAX_LIDARS).contains(&lidars) {
        return Err(bad(format!(
            "poses: have the shape {shape:?}, {lidars} LiDARs a placement; 1 to {MAX_LIDARS} are possible"
        )));
    }
    if !sensors.is_empty() && sensors.len() != lidars {
        return Err(bad(format!(
            "sensors: has the length {}; give a name for each LiDAR, {lidars} in all",
            sensors.len()
        )));
    }
    room_for("placements", count, placement_bytes(lidars))?;
    let values: Vec<f64> = array.as_array().iter().copied().collect();
    let phases = phases.map(|phases| phases_of(phases, count, lidars)).transpose()?;
    let pose = |n: usize, k: usize| SensorPose {
        sensor: sensors.get(k).copied().unwrap_or_default(),
        phase: phases.as_ref().and_then(|phases| phases[n * lidars + k]),
        ..SensorPose::from_values(std::array::from_fn(|i| values[6 * (n * lidars + k) + i]))
    };
    let placement = |n: usize| Placement {
        name: n.to_string(),
        lidars: (0..lidars).map(|k| pose(n, k)).collect(),
    };
    Ok((0..count).map(placement).collect())
}

/// All placements of a `.json` or `.jsonl` file.
///
/// Raises `OSError` for a file that cannot be read, `ValueError` that names a wrong placement.
#[pyfunction(name = "read_placements")]
pub(crate) fn read(
    #[pyo3(from_py_with = arguments::path)] path: PathBuf,
) -> PyResult<Vec<PyPlacement>> {
    Ok(read_placements(&path).map_err(raised)?.into_iter().map(PyPlacement).collect())
}

/// Writes placements to a `.json` file, whole at any time; `read_placements` and the commands of the program read it.
///
/// `placements` is a `Placement` or a list of them. Raises `ValueError` for equal names, `OSError` for a file that cannot be
/// written.
#[pyfunction(name = "write_placements")]
pub(crate) fn write(
    placements: &Bound<'_, PyAny>,
    #[pyo3(from_py_with = arguments::path)] path: PathBuf,
) -> PyResult<()> {
    let all = parsed(placements, None, None)?;
    let mut names = HashSet::new();
    if let Some(twice) = all.iter().find(|one| !names.insert(&one.name)) {
        let name = &twice.name;
        return Err(bad(format!(
            "placements: `{name}` is there twice; give each a name of its own"
        )));
    }
    let text = format!("{:#}\n", json!({ "placements": all }));
    write_text(&path, &text)
}

/// The eleven placements of Table 7 of Place3D, four LiDARs each.
#[pyfunction]
pub(crate) fn published() -> Vec<PyPlacement> {
    table_7().into_iter().map(PyPlacement).collect()
}
