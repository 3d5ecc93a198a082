//! Rigs of other programs: LiDARs by the names of their frames.

use std::collections::BTreeMap;
use std::path::PathBuf;

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use serde_json::{Map, Value};
use sightline::Note;
use sightline::rig::{
    ImportSettings, ImportedRig, Mounting, Rig, RigFormat, RigLidar, from_carla_sensors, import,
    rig_json,
};
use sightline::vehicle::SensorName;

use crate::arguments::{self, shown};
use crate::arrays::{matrix, to_text};
use crate::errors::{bad, raised, warn_of, write_text};
use crate::placements::PyPlacement;

/// A list of CARLA's sensors, in words.
const SENSORS: &str = "a list of dicts, as `sensors()` of a CARLA agent returns";
/// A table of models, in words.
const MODELS: &str = "a dict of texts: the frame of a LiDAR and its model";

/// The LiDARs of one vehicle, by the names of their frames.
///
/// `frames` names them, `poses` is `[L, 6]`: x, y, z in metres, roll, pitch, yaw in radians, in the ego frame. `sensors` is
/// the model of each where it is known. `left_out` names sensors that are no LiDAR, `notes` says which values were read
/// otherwise than written.
#[pyclass(name = "Rig", module = "sightline", frozen)]
pub(crate) struct PyRig {
    rig: Rig,
    left_out: Vec<String>,
    notes: Vec<String>,
}

#[pymethods]
impl PyRig {
    /// From the list of dicts that `sensors()` of a CARLA agent returns: `type`, `id`, `x`, `y`, `z`, and `roll`, `pitch`,
    /// `yaw` in degrees, left-handed with y to the right.
    ///
    /// Numbers may be texts, as attributes of CARLA are. `models` gives LiDARs their models by `id`; `base_link` `[3]` is
    /// CARLA's origin of the vehicle in the ego frame, metres. Raises `ValueError` with index and key of a wrong value.
    #[staticmethod]
    #[pyo3(signature = (sensors, *, name = None, models = None, base_link = None))]
    fn from_carla(
        sensors: &Bound<'_, PyAny>,
        name: Option<String>,
        models: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = arguments::base_link)] base_link: Option<[f64; 3]>,
    ) -> PyResult<Self> {
        let settings = ImportSettings {
            name,
            sensors: models_of(models)?,
            mounting: mounting(base_link),
            ..ImportSettings::default()
        };
        let list = carla_list(sensors)?;
        Self::of(sensors.py(), from_carla_sensors(&list, &settings).map_err(raised)?)
    }

    /// From a file of another program, or a folder of its files; `docs/formats/rigs.md` lists the formats.
    ///
    /// `format` names one; otherwise the file's content tells it. `frames` picks LiDARs by name, `base_frame` names the frame that
    /// positions count from. Raises `OSError` for
    /// files that cannot be read, `ValueError` with the place of a wrong value.
    #[staticmethod]
    #[pyo3(signature = (path, *, format = None, name = None, frames = None, models = None, base_link = None,
        base_frame = None))]
    fn load(
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        format: Option<&str>,
        name: Option<String>,
        #[pyo3(from_py_with = arguments::frame_names)] frames: Option<Vec<String>>,
        models: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = arguments::base_link)] base_link: Option<[f64; 3]>,
        base_frame: Option<String>,
    ) -> PyResult<Self> {
        let settings = ImportSettings {
            base_frame,
            format: format.map(format_of).transpose()?,
            name,
            frames: frames.unwrap_or_default(),
            sensors: models_of(models)?,
            mounting: mounting(base_link),
            ..ImportSettings::default()
        };
        let imported = py.detach(|| import(&[path], &settings)).map_err(raised)?;
        Self::of(py, imported)
    }

    /// Name, 1 to 64 of letters, digits, `.`, `_`, `-`.
    #[getter]
    fn name(&self) -> &str {
        &self.rig.name
    }

    /// Frame of each LiDAR.
    #[getter]
    fn frames(&self) -> Vec<&str> {
        self.rig.lidars.iter().map(|lidar| lidar.frame.as_str()).collect()
    }

    /// `[L, 6]` f64: x, y, z in metres, roll, pitch, yaw in radians, in the ego frame.
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let values = self.rig.lidars.iter().flat_map(|lidar| lidar.pose.values());
        matrix(py, values.collect(), 6)
    }

    /// Model of each LiDAR, `None` where it is not known.
    #[getter]
    fn sensors(&self) -> Vec<Option<&str>> {
        self.rig.lidars.iter().map(|lidar| lidar.sensor.as_deref()).collect()
    }

    /// Names of sensors that are no LiDAR.
    #[getter]
    fn left_out(&self) -> Vec<&str> {
        self.left_out.iter().map(String::as_str).collect()
    }

    /// Sentences on the file that was read: facts and doubts.
    #[getter]
    fn notes(&self) -> Vec<&str> {
        self.notes.iter().map(String::as_str).collect()
    }

    /// The rig as a placement, under another name if one is given. Raises `ValueError` for a name that no placement may have.
    #[pyo3(signature = (name = None))]
    fn placement(&self, name: Option<String>) -> PyResult<PyPlacement> {
        Ok(PyPlacement(self.named(name)?.placement()))
    }

    /// Writes a file of placements with this one, whole at any time; `read_placements` and `Rig.load` read it. Raises
    /// `OSError` for a file that cannot be written.
    fn save(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
    ) -> PyResult<()> {
        let text = format!("{:#}\n", rig_json(&[&self.named(None)?]));
        py.detach(|| write_text(&path, &text))
    }

    fn __len__(&self) -> usize {
        self.rig.lidars.len()
    }

    fn __repr__(&self) -> String {
        format!("Rig({:?}, {})", self.rig.name, self.frames().join(", "))
    }

    /// A rig from its parts, for pickles.
    #[staticmethod]
    fn _of(
        placement: &PyPlacement,
        frames: Vec<String>,
        sensors: Vec<Option<String>>,
        left_out: Vec<String>,
        notes: Vec<String>,
    ) -> PyResult<Self> {
        let poses = &placement.0.lidars;
        if frames.len() != poses.len() || sensors.len() != poses.len() {
            return Err(bad("rig: its frames, sensors and poses differ in number"));
        }
        let lidar = |((frame, sensor), &pose)| RigLidar { frame, sensor, pose };
        let lidars = frames.into_iter().zip(sensors).zip(poses).map(lidar).collect();
        let rig = Rig { name: placement.0.name.clone(), lidars };
        rig.validate().map_err(raised)?;
        Ok(Self { rig, left_out, notes })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, this) = (slf.py(), slf.get());
        let mut bare = this.rig.clone();
        bare.lidars.iter_mut().for_each(|lidar| lidar.sensor = None);
        let placement = PyPlacement(bare.placement());
        let parts = (placement, this.frames(), this.sensors(), this.left_out(), this.notes());
        PyTuple::new(py, [slf.getattr("_of")?, parts.into_pyobject(py)?.into_any()])
    }
}

impl PyRig {
    /// Result of reading; warns of every note.
    fn of(py: Python<'_>, imported: ImportedRig) -> PyResult<Self> {
        let ImportedRig { rig, left_out, notes, .. } = imported;
        warn_of(py, &notes)?;
        Ok(Self { rig, left_out, notes: notes.iter().map(Note::to_string).collect() })
    }

    /// The rig under another name, if every model is one that a placement may name.
    fn named(&self, name: Option<String>) -> PyResult<Rig> {
        for RigLidar { frame, sensor, .. } in &self.rig.lidars {
            if let Some(Err(fault)) = sensor.as_deref().map(SensorName::new) {
                return Err(bad(format!("{frame}: {fault}, or another one with `models`")));
            }
        }
        let mut rig = self.rig.clone();
        rig.name = name.unwrap_or(rig.name);
        rig.validate().map_err(raised)?;
        Ok(rig)
    }
}

fn format_of(name: &str) -> PyResult<RigFormat> {
    let found = RigFormat::ALL.into_iter().find(|format| format.name() == name);
    found.ok_or_else(|| {
        let names = RigFormat::ALL.map(RigFormat::name).join(", ");
        bad(format!("format: `{name}` is none; give one of {names}"))
    })
}

fn mounting(base_link: Option<[f64; 3]>) -> Mounting {
    Mounting { base_link: base_link.unwrap_or_default(), ..Mounting::default() }
}

fn models_of(given: Option<&Bound<'_, PyAny>>) -> PyResult<BTreeMap<String, String>> {
    let Some(given) = given else { return Ok(BTreeMap::new()) };
    let wrong = |what: &Bound<'_, PyAny>| bad(format!("models: is {}; give {MODELS}", shown(what)));
    let table = given.cast::<PyDict>().map_err(|_| wrong(given))?;
    let text = |part: &Bound<'_, PyAny>| part.extract::<String>().map_err(|_| wrong(part));
    let model = |(frame, model): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let (frame, model) = (text(&frame)?, text(&model)?);
        SensorName::new(&model).map_err(|fault| bad(format!("models: {frame}: {fault}")))?;
        Ok((frame, model))
    };
    table.iter().map(model).collect()
}

/// Python's list of dicts as JSON; errors name index and key.
fn carla_list(given: &Bound<'_, PyAny>) -> PyResult<Value> {
    let wrong =
        |given: &Bound<'_, PyAny>| bad(format!("sensors: is {}; give {SENSORS}", shown(given)));
    let items: Vec<Bound<'_, PyAny>> = match (given.cast::<PyList>(), given.cast::<PyTuple>()) {
        (Ok(list), _) => list.iter().collect(),
        (_, Ok(list)) => list.iter().collect(),
        _ => return Err(wrong(given)),
    };
    let entry = |(k, item): (usize, &Bound<'_, PyAny>)| {
        let wrong = |given| bad(format!("sensors[{k}]: is {}; give a dict", shown(given)));
        let mut entry = Map::new();
        for (key, value) in item.cast::<PyDict>().map_err(|_| wrong(item))? {
            let no_text =
                |_| bad(format!("sensors[{k}]: has the key {}; give texts as keys", shown(&key)));
            let key = key.extract::<String>().map_err(no_text)?;
            let at = format!("sensors[{k}].{key}");
            let value = serde_json::from_str(&to_text(&at, &value)?);
            entry.insert(key, value.map_err(|error| bad(format!("{at}: {error}")))?);
        }
        Ok(Value::Object(entry))
    };
    items.iter().enumerate().map(entry).collect()
}
