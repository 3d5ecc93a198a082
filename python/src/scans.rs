//! Scans as an iterator, the next frame scanned while Python works on the last, and as recordings of viewers.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, sync_channel};

use numpy::PyArrayMethods;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use sightline::Error;
use sightline::scan::{Return, Scan, Scanner, Scanning, TrackedBox};

use crate::arguments::{self, which_frames};
use crate::arrays::{column, homogeneous, matrix, shaped};
use crate::errors::raised;
use crate::scenes::PyScene;
use crate::wait::{start, wait};

/// Scans of a scene, frame after frame.
#[pyclass(name = "ScanIterator", module = "sightline", frozen)]
pub(crate) struct ScanIterator {
    scans: Mutex<Receiver<Result<Scan, Error>>>,
    misses: bool,
}

#[pymethods]
impl ScanIterator {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        match wait(py, &self.scans, None)? {
            Some(scan) => Ok(Some(scan_object(py, &scan.map_err(raised)?, self.misses)?)),
            None => Ok(None),
        }
    }
}

fn scan_object<'py>(py: Python<'py>, scan: &Scan, misses: bool) -> PyResult<Bound<'py, PyAny>> {
    let kept: Vec<&Return> =
        scan.returns.iter().filter(|beam| misses || beam.status.is_point()).collect();
    let fields = PyDict::new(py);
    fields.set_item("scene", &*scan.scene)?;
    fields.set_item("frame", scan.frame)?;
    fields.set_item("time", scan.time)?;
    fields.set_item("classes", scan.classes.to_vec())?;
    fields.set_item("world_from_ego", homogeneous(py, &scan.world_from_ego)?)?;
    let lidars = PyList::empty(py);
    for lidar in &scan.lidars {
        let facts = PyDict::new(py);
        facts.set_item("model", &lidar.model)?;
        facts.set_item("ego_from_sensor", homogeneous(py, &lidar.ego_from_sensor)?)?;
        facts.set_item("channels", lidar.channels)?;
        facts.set_item("columns", lidar.columns)?;
        facts.set_item("range", lidar.range)?;
        lidars.append(facts)?;
    }
    fields.set_item("lidars", lidars)?;
    let triples = |of: fn(&Return) -> [f32; 3]| {
        matrix(py, kept.iter().flat_map(|beam| of(beam)).collect(), 3)
    };
    fields.set_item("xyz", triples(|beam| beam.position)?)?;
    fields.set_item("raw", triples(|beam| beam.raw)?)?;
    macro_rules! columns {
        ($($name:literal: $of:expr),* $(,)?) => {$(
            let of = $of;
            fields.set_item($name, column(py, kept.iter().map(|beam| of(beam)).collect()))?;
        )*};
    }
    columns!(
        "range": |beam: &Return| beam.range,
        "intensity": |beam: &Return| beam.intensity,
        "time_offset": |beam: &Return| beam.time,
        "incidence": |beam: &Return| beam.incidence,
        "lidar": |beam: &Return| beam.lidar,
        "ring": |beam: &Return| beam.channel,
        "column": |beam: &Return| beam.column,
        "class_id": |beam: &Return| beam.class,
        "clean_class_id": |beam: &Return| beam.clean_class,
        "instance": |beam: &Return| beam.instance,
        "status": |beam: &Return| beam.status as u8,
    );
    fields.set_item("boxes", boxes_object(py, &scan.boxes)?)?;
    py.import("sightline._records")?.getattr("Scan")?.call((), Some(&fields))
}

fn boxes_object<'py>(py: Python<'py>, boxes: &[TrackedBox]) -> PyResult<Bound<'py, PyAny>> {
    let fields = PyDict::new(py);
    let poses = boxes.iter().map(|tracked| homogeneous(py, &tracked.ego_from_box));
    let poses: Vec<f64> =
        poses.map(|pose| Ok(pose?.to_vec()?)).collect::<PyResult<Vec<_>>>()?.concat();
    fields.set_item("ego_from_box", shaped(py, poses, &[boxes.len(), 4, 4])?)?;
    let triples =
        |of: fn(&TrackedBox) -> [f64; 3]| matrix(py, boxes.iter().flat_map(of).collect(), 3);
    fields.set_item("size", triples(|tracked| tracked.size.to_array())?)?;
    fields.set_item("velocity", triples(|tracked| tracked.velocity.to_array())?)?;
    fields.set_item("instance", column(py, boxes.iter().map(|b| b.instance).collect()))?;
    fields.set_item("class_id", column(py, boxes.iter().map(|b| b.class).collect()))?;
    fields.set_item("points", column(py, boxes.iter().map(|b| b.points).collect()))?;
    fields.set_item("names", boxes.iter().map(|b| b.name.clone()).collect::<Vec<_>>())?;
    fields.set_item("kinds", boxes.iter().map(|b| b.kind.name()).collect::<Vec<_>>())?;
    py.import("sightline._records")?.getattr("Boxes")?.call((), Some(&fields))
}

#[pymethods]
impl PyScene {
    /// Labelled scans of one placement, frame after frame, as an iterator of `Scan`; the next frame is scanned meanwhile.
    ///
    /// `conditions` are weather and faults of the scan, as `"snow:rate=1"`. `ideal` leaves the sensor's own limits out.
    /// `frames` is a number of frames, spread evenly, or a list of their numbers from 0; all unless given. With
    /// `misses` every beam is there, not only the points. Chance depends on `seed` alone. The scene's `backend` casts;
    /// the numbers are the same on all. Raises `ValueError` as `score`, for unknown conditions, and for scenes without
    /// geometry.
    #[pyo3(signature = (poses, *, sensors = None, phases = None, conditions = None, ideal = false, seed = 1,
        frames = None, misses = false))]
    fn scan(
        &self,
        poses: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = arguments::conditions)] conditions: Option<Vec<String>>,
        ideal: bool,
        #[pyo3(from_py_with = arguments::seed)] seed: u64,
        frames: Option<&Bound<'_, PyAny>>,
        misses: bool,
    ) -> PyResult<ScanIterator> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        let conditions = conditions.iter().flatten().map(|text| text.parse().map_err(raised));
        let conditions = conditions.collect::<PyResult<_>>()?;
        let scanning = Scanning { ideal, seed, conditions };
        Scanner::check(&built.scene, &placement, &scanning).map_err(raised)?;
        let count = built.scene.frame_count();
        let frames = which_frames(frames, count)?;
        // One frame waits while another is scanned.
        let (sender, scans) = sync_channel(1);
        start(move || {
            let opened = || -> Result<Scanner<'_>, Error> {
                let mut scanner = Scanner::on(built.stage()?, &built.scene, &placement, &scanning)?;
                scanner.cast_on(&built.options.engine)?;
                Ok(scanner)
            };
            let scanner = match opened() {
                Ok(scanner) => scanner,
                Err(error) => return drop(sender.send(Err(error))),
            };
            for frame in frames {
                // Nobody listens any more.
                if sender.send(Ok(scanner.scan(frame))).is_err() {
                    break;
                }
            }
        })?;
        Ok(ScanIterator { scans: Mutex::new(scans), misses })
    }

    /// Writes a recording of Rerun (`.rrd`): points, LiDARs and boxes of one or several placements over time.
    ///
    /// Entities are `world/ego/NAME/points`, `world/ego/NAME/lidar_K` with the outline of its `field_of_view`, 3 m away, and
    /// `world/ego/boxes`, by the timelines `frame` and `time`. `options` are those of `scan`, and `progress` as for `optimize`. Raises as `scan`, `ValueError` for equal names, `ImportError` without
    /// rerun-sdk.
    #[pyo3(signature = (placements, path, **options))]
    fn to_rerun(
        slf: &Bound<'_, Self>,
        placements: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        record(slf, "to_rerun", placements, path, options)
    }

    /// Writes a recording of ROS 2 (`.mcap`), whole at any time, of one or several placements.
    ///
    /// Topics are `/NAME/points`, `sensor_msgs/PointCloud2` in `base_link` with a scan's columns as fields, `/tf` (`map` to
    /// `base_link`), `/tf_static` (`base_link` to `NAME/lidar_K`) and `/NAME/fields_of_view`, `visualization_msgs/MarkerArray` with the
    /// outline of each LiDAR's field of view at 3 m. Time stamps count from frame 0. `options` are those of
    /// `scan`, and `progress` as for `optimize`. Raises as `scan`, `ValueError` for equal names, `ImportError` without
    /// mcap-ros2-support.
    #[pyo3(signature = (placements, path, **options))]
    fn to_mcap(
        slf: &Bound<'_, Self>,
        placements: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        record(slf, "to_mcap", placements, path, options)
    }
}

/// Calls the writer of that name.
fn record(
    scene: &Bound<'_, PyScene>,
    writer: &str,
    placements: &Bound<'_, PyAny>,
    path: PathBuf,
    options: Option<&Bound<'_, PyDict>>,
) -> PyResult<()> {
    let py = scene.py();
    let options = options.cloned().unwrap_or_else(|| PyDict::new(py));
    let module = py.import("sightline._recordings")?;
    module.call_method1(writer, (scene, placements, path, options)).map(drop)
}
