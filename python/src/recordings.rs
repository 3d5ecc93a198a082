//! Scans over time as recordings of viewers, which the package writes in Python.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::scenes::PyScene;

#[pymethods]
impl PyScene {
    /// Writes a recording of Rerun (`.rrd`): points, LiDARs and boxes of one or several placements over time.
    ///
    /// Entities are `world/ego/NAME/points`, `world/ego/NAME/lidar_K` and `world/ego/boxes`, by the timelines `frame` and
    /// `time`. `options` are those of `scan`, and `progress` as for `optimize`. Raises as `scan`, `ValueError` for equal names, `ImportError` without
    /// rerun-sdk.
    #[pyo3(signature = (placements, path, **options))]
    fn to_rerun(
        slf: &Bound<'_, Self>,
        placements: &Bound<'_, PyAny>,
        path: PathBuf,
        options: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<()> {
        record(slf, "to_rerun", placements, path, options)
    }

    /// Writes a recording of ROS 2 (`.mcap`), whole at any time, of one or several placements.
    ///
    /// Topics are `/NAME/points`, `sensor_msgs/PointCloud2` in `base_link` with a scan's columns as fields, `/tf` (`map` to
    /// `base_link`) and `/tf_static` (`base_link` to `NAME/lidar_K`). Stamps count from frame 0. `options` are those of
    /// `scan`, and `progress` as for `optimize`. Raises as `scan`, `ValueError` for equal names, `ImportError` without
    /// mcap-ros2-support.
    #[pyo3(signature = (placements, path, **options))]
    fn to_mcap(
        slf: &Bound<'_, Self>,
        placements: &Bound<'_, PyAny>,
        path: PathBuf,
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
