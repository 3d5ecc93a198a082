//! Sensors and vehicles.

use std::path::{Path, PathBuf};

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use serde_json::json;
use sightline::BeamTable;
use sightline::vehicle::{Lidar, Vehicle};

use crate::arguments;
use crate::arrays::{matrix, to_python, to_text};
use crate::errors::{bad, raised, raised_of_dict, warn_of};

/// A LiDAR model: its beams in its own frame.
#[pyclass(name = "Sensor", module = "sightline", frozen)]
pub(crate) struct PySensor {
    lidar: Lidar,
    table: BeamTable,
}

impl PySensor {
    pub(crate) fn of(lidar: &Lidar) -> PyResult<Self> {
        Ok(Self { table: lidar.table().map_err(raised)?, lidar: lidar.clone() })
    }

    /// Reads a sensor; warns of every note.
    fn from_text(py: Python<'_>, text: &str, folder: &Path, name: &str) -> PyResult<Self> {
        let read = Lidar::from_json(text, folder, name);
        let (lidar, notes) = read.map_err(|error| raised_of_dict(py, name, error))?;
        warn_of(py, &notes)?;
        Self::of(&lidar)
    }
}

#[pymethods]
impl PySensor {
    /// Sensor of a vendor's file, whose format is told from its contents; `docs/formats/sensors.md` lists the formats.
    ///
    /// `range` in metres and `azimuth_steps` a turn, where the file does not state them. Raises `OSError`, such as `FileNotFoundError`, for a file that cannot be
    /// read, `ValueError` that names the fault.
    #[staticmethod]
    #[pyo3(signature = (path, *, range = None, azimuth_steps = None))]
    fn load(
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        #[pyo3(from_py_with = arguments::range)] range: Option<f64>,
        #[pyo3(from_py_with = arguments::azimuth_steps)] azimuth_steps: Option<u32>,
    ) -> PyResult<Self> {
        if path.to_str().is_none() {
            let path = path.display();
            return Err(bad(format!(
                "{path}: the name is not UTF-8; rename the file or its folder"
            )));
        }
        let mut lidar = json!({ "file": path });
        if let Some(metres) = range {
            lidar["range"] = metres.into();
        }
        if let Some(steps) = azimuth_steps {
            lidar["azimuth_steps"] = steps.into();
        }
        Self::from_text(py, &lidar.to_string(), Path::new(""), &path.display().to_string())
    }

    /// From a dict as a scene has it under `lidar`, such as `{"channels": 16, "fov": [-24.8, 2], "azimuth_steps": 250,
    /// "range": 100}`; files that it names are relative to `folder`. Raises `ValueError` that names the fault.
    #[staticmethod]
    #[pyo3(signature = (lidar, *, folder = None))]
    fn from_dict(
        lidar: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::folder)] folder: Option<PathBuf>,
    ) -> PyResult<Self> {
        let text = to_text("lidar", lidar)?;
        Self::from_text(lidar.py(), &text, &folder.unwrap_or_default(), "lidar")
    }

    /// `[B, 3]` f32, unit vectors in the sensor frame, by channel and azimuth step.
    #[getter]
    fn directions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        matrix(py, self.table.directions().as_flattened().to_vec(), 3)
    }

    /// Metres.
    #[getter]
    fn range(&self) -> f64 {
        self.lidar.range()
    }

    fn __len__(&self) -> usize {
        self.table.directions().len()
    }

    fn __repr__(&self) -> String {
        format!("Sensor({} beams, {} m)", self.__len__(), self.range())
    }

    /// A sensor from its numbers, for pickles: those of a turning one, or its directions.
    #[staticmethod]
    fn _of(
        elevations: Vec<f64>,
        azimuth_offsets: Vec<f64>,
        azimuth_steps: u32,
        azimuth: Option<[f64; 2]>,
        directions: Vec<[f64; 3]>,
        range: f64,
    ) -> PyResult<Self> {
        if !directions.is_empty() {
            return Self::of(&Lidar::Directions { directions, range });
        }
        if elevations.len() != azimuth_offsets.len() {
            return Err(bad("sensor: its elevations and azimuth offsets differ in number"));
        }
        Self::of(&Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let parts = match &slf.get().lidar {
            Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range } => {
                let none = Vec::<[f64; 3]>::new();
                (elevations, azimuth_offsets, azimuth_steps, azimuth, none, range)
                    .into_pyobject(py)?
            }
            Lidar::Directions { directions, range } => {
                let none = Vec::<f64>::new();
                (&none, &none, 0, None::<[f64; 2]>, directions, range).into_pyobject(py)?
            }
        };
        PyTuple::new(py, [slf.getattr("_of")?, parts.into_any()])
    }
}

pub(crate) fn sensors_object<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
) -> PyResult<Bound<'py, PyDict>> {
    let all = PyDict::new(py);
    for model in &vehicle.sensors {
        all.set_item(model.name.as_str(), PySensor::of(&model.lidar)?)?;
    }
    Ok(all)
}

/// A vehicle file: the models that it may carry, its mounts and rules.
#[pyclass(name = "Vehicle", module = "sightline", frozen)]
pub(crate) struct PyVehicle {
    path: PathBuf,
    /// Current folder when it was read: that of a relative path.
    root: PathBuf,
    vehicle: Vehicle,
}

impl PyVehicle {
    /// The file, wherever the process has gone since.
    pub(crate) fn file(&self) -> PathBuf {
        self.root.join(&self.path)
    }
}

#[pymethods]
impl PyVehicle {
    /// Reads a vehicle file; warns of every note. Raises `OSError`, such as `FileNotFoundError`, for a file that cannot be read, `ValueError`
    /// that names the fault.
    #[staticmethod]
    fn load(
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
    ) -> PyResult<Self> {
        let vehicle = Vehicle::read(&path).map_err(raised)?;
        warn_of(py, &vehicle.notes)?;
        let root = std::env::current_dir().unwrap_or_default();
        Ok(Self { path, root, vehicle })
    }

    /// The file.
    #[getter]
    fn path(&self) -> &Path {
        &self.path
    }

    /// Name in reports.
    #[getter]
    fn name(&self) -> &str {
        &self.vehicle.name
    }

    /// Models by name. Where there are several, each LiDAR of a placement names its own.
    #[getter]
    fn sensors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        sensors_object(py, &self.vehicle)
    }

    /// Price of each model, in any currency.
    #[getter]
    fn prices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        for model in &self.vehicle.sensors {
            all.set_item(model.name.as_str(), model.price)?;
        }
        Ok(all)
    }

    /// A dict a mount: `name`, `lower` and `upper` bounds of x, y, z (m), roll, pitch, yaw (rad), `sensors` that it may hold, `count` `[fewest, most]`.
    #[getter]
    fn mounts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mounts = self.vehicle.mounts.iter().map(|mount| {
            json!({
                "name": mount.region.name,
                "lower": mount.region.lower,
                "upper": mount.region.upper,
                "sensors": mount.sensors,
                "count": mount.count,
            })
        });
        to_python(py, &mounts.collect::<Vec<_>>())
    }

    fn __repr__(&self) -> String {
        format!("Vehicle({:?})", self.vehicle.name)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, this) = (slf.py(), slf.get());
        let rebuild = py.import("sightline._pickle")?.getattr("file")?;
        let arguments = (slf.getattr("load")?, &this.path, &this.root).into_pyobject(py)?;
        PyTuple::new(py, [rebuild, arguments.into_any()])
    }
}
