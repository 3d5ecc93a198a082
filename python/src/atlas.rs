//! An atlas: sensor poses that are cast once, and placements of them that are scored without a cast.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use sightline::internals::{Atlas, PoseGrid, Spacing, Union};
use sightline::problem::{Content, Tally};
use sightline::score::{Needed, Scores};
use sightline::vehicle::{Constraints, Region, SensorPose, Slot};

use crate::arguments::{self, room_for};
use crate::arrays::{column, matrix, misshapen, wholes};
use crate::columns::summed;
use crate::engine::Built;
use crate::errors::{bad, raised};
use crate::placements::placements_in;
use crate::scenes::PyScene;
use crate::wait::{WorkMessages, interruptible};

/// Bytes of coverage that an atlas may hold where the scene does not say.
const MEMORY: u64 = 4 << 30;
const MOST_POSES: usize = 20_000;

/// Coverage of M sensor poses in the frames that a scene is scored over; made by `Scene.atlas`.
#[pyclass(name = "Atlas", module = "sightline", frozen)]
pub(crate) struct PyAtlas {
    atlas: Arc<Atlas>,
    /// Number in the atlas of each pose that was given.
    numbers: Vec<u32>,
    poses: Vec<SensorPose>,
}

/// Rules of a mount that consists of some poses alone, and the number of each among different ones.
fn points(poses: &[SensorPose]) -> (Constraints, Vec<u32>) {
    let mut slots: Vec<Slot> = Vec::new();
    let mut known = std::collections::HashMap::new();
    let number = |pose: &SensorPose| {
        let key = (pose.values().map(|value| (value + 0.0).to_bits()), pose.sensor);
        *known.entry(key).or_insert_with(|| {
            let (lower, upper) = (pose.values(), pose.values());
            let region = Arc::new(Region { lower, upper, ..Region::default() });
            slots.push(Slot { region, sensor: pose.sensor, phase: None, others: Vec::new() });
            slots.len() as u32 - 1
        })
    };
    let numbers = poses.iter().map(number).collect();
    (Constraints { slots, ..Constraints::default() }, numbers)
}

/// Poses that are cast between two looks at the watch.
const CAST_TOGETHER: usize = 32;
/// Placements that are scored between two looks at the watch.
const SCORED_TOGETHER: usize = 256;

/// An atlas that holds every pose of such rules, unless the watch is stopped.
fn held(built: &Built, rules: &Constraints, watch: &WorkMessages) -> PyResult<Atlas> {
    let spacing = Spacing { metres: 1.0, radians: 1.0 };
    let grid = PoseGrid::new(rules, spacing).map_err(raised)?;
    let all: Vec<u32> = (0..grid.len()).collect();
    let memory = built.options.engine.memory.unwrap_or(MEMORY);
    built.evaluate(watch, |evaluator| {
        let problem = evaluator.shared_problem();
        let mut atlas = Atlas::new(problem, grid, Needed::all(true), memory);
        room_for("the atlas", all.len(), atlas.page_bytes())?;
        // One call is refused that holds too many; several would drop the first.
        let together = if all.len() > atlas.capacity() { all.len() } else { CAST_TOGETHER };
        for (k, some) in all.chunks(together).enumerate() {
            if !watch.reach("poses", k * together, all.len()) {
                break;
            }
            atlas.hold(evaluator.backend_mut(), some).map_err(raised)?;
        }
        watch.reach("poses", all.len(), all.len());
        Ok(atlas)
    })
}

#[pymethods]
impl PyAtlas {
    /// f64 `[M, 6]`: the poses, rounded to 10⁻¹² m and rad as they were cast.
    #[getter]
    fn poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, self.poses.iter().flat_map(SensorPose::values).collect(), 6)
    }

    /// Bytes of coverage held, at most.
    #[getter]
    fn size_bytes(&self) -> usize {
        self.atlas.held() * self.atlas.page_bytes()
    }

    /// A dict of arrays f64 `[N]`: scores of N placements whose LiDARs stand at poses `index` `[N, L]` of the atlas. Columns are
    /// those of `Scene.score` that need no cast and no guard, with its bits for `poses[index]`: gains, near gains, M-SOG,
    /// covered voxels. Raises `ValueError` for another shape and for poses that are not there.
    fn score<'py>(&self, index: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyDict>> {
        let py = index.py();
        let wanted = "[N, L]: numbers of poses";
        let most = self.numbers.len() as i128 - 1;
        let (places, shape) = wholes::<u32>("index", index, wanted, 0..=most)?;
        let [_, lidars] = shape[..] else {
            return Err(misshapen("index", &shape, wanted));
        };
        if !(1..=sightline::vehicle::MAX_LIDARS).contains(&lidars) {
            return Err(bad(format!(
                "index: has the shape {shape:?}, {lidars} LiDARs a placement"
            )));
        }
        let numbers: Vec<u32> = places.iter().map(|&at| self.numbers[at as usize]).collect();
        let atlas = self.atlas.clone();
        let scores = interruptible(py, move |watch| {
            let (content, frames) = (atlas.problem().content(), atlas.problem().frame_count());
            let one = |row: &[u32]| {
                let tally = together(&atlas, row, content);
                Scores::new("", &tally, content, frames, false, None)
            };
            let all = numbers.len() / lidars;
            let mut scores: Vec<Scores> = Vec::with_capacity(all);
            for some in numbers.chunks(SCORED_TOGETHER * lidars) {
                if !watch.reach("placements", scores.len(), all) {
                    break;
                }
                scores.par_extend(some.par_chunks_exact(lidars).map(one));
            }
            watch.reach("placements", all, all);
            scores
        })?;
        let columns = PyDict::new(py);
        for (name, values) in summed(&scores) {
            columns.set_item(name, column(py, values))?;
        }
        Ok(columns)
    }

    fn __len__(&self) -> usize {
        self.numbers.len()
    }

    fn __repr__(&self) -> String {
        format!("Atlas({} poses, {} MiB)", self.numbers.len(), self.size_bytes() >> 20)
    }
}

/// Sums of a placement of held poses.
fn together(atlas: &Atlas, row: &[u32], content: &Content) -> Tally {
    let mut union = Union::default();
    let (last, others) = row.split_last().expect("a row has at least one pose");
    atlas.union(others, &mut union);
    let sums = atlas.tally_with(&union, *last);
    let zero = Tally::zero(content.set_count(), row.len());
    Tally { by_class: zero.by_class, unique: zero.unique, beams: 1, ..sums }
}

#[pymethods]
impl PyScene {
    /// Casts M sensor poses `[M, 6]` once, over the frames of the scene's scores, so that placements of them are scored without
    /// a cast. `sensors` names their model, or that of each. Raises `MemoryError` where their coverage does not fit into
    /// `memory` of the scene, 4 GiB unless given.
    #[pyo3(signature = (poses, *, sensors = None))]
    fn atlas(
        &self,
        py: Python<'_>,
        poses: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
    ) -> PyResult<PyAtlas> {
        let built = self.built.clone();
        let single = poses.call_method1("__len__", ()).and_then(|count| count.extract::<usize>());
        let array = py.import("numpy")?.call_method1("asanyarray", (poses,))?;
        let count = single.map_err(|_| bad("poses: give an array [M, 6] of sensor poses"))?;
        if count == 0 || count > MOST_POSES || array.getattr("ndim")?.extract::<usize>()? != 2 {
            return Err(bad(format!(
                "poses: give an array [M, 6] of 1 to {MOST_POSES} sensor poses"
            )));
        }
        // Each pose is checked as a placement of one LiDAR.
        let each = array.call_method1("reshape", (count, 1, 6))?;
        let mut given = Vec::with_capacity(count);
        match sensors {
            Some(names) if names.len() != 1 => {
                if names.len() != count {
                    let found = names.len();
                    return Err(bad(format!(
                        "sensors: has the length {found}; give one name, or one for each pose, {count} in all"
                    )));
                }
                for (k, name) in names.into_iter().enumerate() {
                    let one = each.get_item(k)?;
                    given.extend(placements_in(&built.scene, &one, Some(vec![name]), None)?);
                }
            }
            other => given = placements_in(&built.scene, &each, other, None)?,
        }
        let poses: Vec<SensorPose> = given.iter().map(|one| one.lidars[0]).collect();
        let (rules, numbers) = points(&poses);
        let atlas = interruptible(py, move |watch| held(&built, &rules, watch))??;
        let poses = numbers.iter().map(|number| atlas.grid().pose(*number)).collect();
        Ok(PyAtlas { atlas: Arc::new(atlas), numbers, poses })
    }
}
