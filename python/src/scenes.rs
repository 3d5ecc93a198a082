//! Scenes: reading, scoring, casting, verifying.

use std::cell::Cell;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use sightline::engine::NO_HIT;
use sightline::internals::{Input, usual_placements};
use sightline::job::Tolerance;
use sightline::scan::BeamHits;
use sightline::scene::EgoBody;
use sightline::vehicle::SensorPose;
use sightline::verify::{compared_frames, verify};
use sightline::{Placement, Scene, engine};

use crate::arguments::{self, room_for};
use crate::arrays::{column, homogeneous, matrix, to_python, to_text};
use crate::columns::scored_object;
use crate::engine::{Built, Options, add_near_fields, guard, score};
use crate::errors::{bad, raised, raised_of_dict, warn_of, warn_of_frames};
use crate::placements::{placement_bytes, placements_in};
use crate::psogs::PyPsog;
use crate::rays::signed;
use crate::sensors::sensors_object;
use crate::wait::{Progress, answer, interruptible, pooled};

/// Bytes of a beam that `verify` draws.
const SAMPLE_BYTES: usize = 256;

/// File or text that a scene is read from.
#[derive(Clone)]
enum Source {
    File { path: PathBuf, vehicle: Option<PathBuf> },
    Text { text: String, folder: PathBuf },
}

/// Frames of scenes in words, and how many of them scores are means over where these are fewer.
pub(crate) fn frames_in_words(scenes: &[Arc<Built>]) -> String {
    let all: usize = scenes.iter().map(|built| built.scene.frame_count()).sum();
    let scored: usize = scenes.iter().map(|built| built.scored_frames().len()).sum();
    let of = if scored < all { format!(", scores over {scored}") } else { String::new() };
    format!("{all} frames{of}")
}

/// A scene, ready to be scored; P-SOG, problem and engine are built when they are first needed, and kept.
///
/// `poses` of the methods is an array `[N, L, 6]` (or `[L, 6]` for one placement), a `Placement`, or a list of them.
/// `sensors` names the model of each LiDAR of an array. `phases` `[L]` or `[N, L]` locks them at angles in radians
/// (`NaN`: as the model says).
#[pyclass(name = "Scene", module = "sightline", frozen)]
pub(crate) struct PyScene {
    pub built: Arc<Built>,
    source: Source,
    /// Current folder when it was read: that of relative paths.
    root: PathBuf,
}

impl PyScene {
    /// Warns of every note on the scene's files.
    fn new(py: Python<'_>, scene: Scene, source: Source, options: Options) -> PyResult<Self> {
        warn_of(py, scene.notes())?;
        let wanted = options.frames.unwrap_or_default() as usize;
        warn_of_frames(py, wanted, scene.frame_count())?;
        let root = std::env::current_dir().unwrap_or_default();
        Ok(Self { built: Arc::new(Built::new(scene, options)), source, root })
    }

    /// Scene and vehicle file that it was read from, wherever the process has gone since; `None` of a dict.
    pub(crate) fn files_read(&self) -> Option<(PathBuf, Option<PathBuf>)> {
        let Source::File { path, vehicle } = &self.source else { return None };
        Some((self.root.join(path), vehicle.as_ref().map(|file| self.root.join(file))))
    }

    /// The one placement that was given, and the scene that it is looked at in.
    pub(crate) fn one(
        &self,
        poses: &Bound<'_, PyAny>,
        sensors: Option<Vec<String>>,
        phases: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<(Arc<Built>, Placement)> {
        let mut placements = placements_in(&self.built.scene, poses, sensors, phases)?;
        match placements.len() {
            1 => Ok((self.built.clone(), placements.remove(0))),
            count => Err(bad(format!(
                "poses: are those of {count} placements; give one of them, [L, 6]"
            ))),
        }
    }
}

#[pymethods]
impl PyScene {
    /// Reads a scene file.
    ///
    /// `vehicle` is a vehicle file, or a `Vehicle`, in place of the scene's LiDAR and mount, `psog` a P-SOG in place of its own. Scores are
    /// means over all frames, or over `frames` of them, spread evenly. `conditions` are weather and faults, as `"fog:mor=50"`.
    /// `backend` is `auto` (the best hardware Vulkan device, else the CPU), `gpu` (any device, `adapter` a part of its name)
    /// or `cpu`; all give the same bits. `memory` bounds work buffers, in bytes. Raises `FileNotFoundError` and other kinds of
    /// `OSError` for files that cannot be read, `ValueError` that names the fault of a file or an argument.
    #[staticmethod]
    #[pyo3(signature = (path, *, vehicle = None, psog = None, frames = None, conditions = None,
        backend = "auto", adapter = None, memory = None))]
    fn load(
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
        #[pyo3(from_py_with = arguments::vehicle)] vehicle: Option<PathBuf>,
        psog: Option<&Bound<'_, PyPsog>>,
        #[pyo3(from_py_with = arguments::frames)] frames: Option<u32>,
        #[pyo3(from_py_with = arguments::conditions)] conditions: Option<Vec<String>>,
        backend: &str,
        adapter: Option<String>,
        #[pyo3(from_py_with = arguments::memory)] memory: Option<u64>,
    ) -> PyResult<Self> {
        let options = Options::new(psog, frames, conditions, backend, adapter, memory)?;
        let scene =
            py.detach(|| pooled(|| Scene::read_with(&path, vehicle.as_deref()))).map_err(raised)?;
        Self::new(py, scene, Source::File { path, vehicle }, options)
    }

    /// A scene from the dict of a scene file; files that it names are relative to `folder`, the current one unless
    /// given. Options as for `load`. Raises `ValueError` and `OSError` as `load`.
    #[staticmethod]
    #[pyo3(signature = (scene, *, folder = None, psog = None, frames = None,
        conditions = None, backend = "auto", adapter = None, memory = None))]
    fn from_dict(
        scene: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::folder)] folder: Option<PathBuf>,
        psog: Option<&Bound<'_, PyPsog>>,
        #[pyo3(from_py_with = arguments::frames)] frames: Option<u32>,
        #[pyo3(from_py_with = arguments::conditions)] conditions: Option<Vec<String>>,
        backend: &str,
        adapter: Option<String>,
        #[pyo3(from_py_with = arguments::memory)] memory: Option<u64>,
    ) -> PyResult<Self> {
        let options = Options::new(psog, frames, conditions, backend, adapter, memory)?;
        let text = to_text("scene", scene)?;
        let folder = folder.unwrap_or_else(|| PathBuf::from("."));
        let read = pooled(|| Scene::from_json(&text, &folder, "scene"));
        let read = read.map_err(|error| raised_of_dict(scene.py(), "scene", error))?;
        Self::new(scene.py(), read, Source::Text { text, folder }, options)
    }

    /// Name of the scene.
    #[getter]
    fn name(&self) -> &str {
        self.built.scene.name()
    }

    /// Class names; a class is a position in this list.
    #[getter]
    fn classes(&self) -> Vec<String> {
        self.built.scene.classes().to_vec()
    }

    /// Number of frames of the scene.
    #[getter]
    fn frames(&self) -> usize {
        self.built.scene.frame_count()
    }

    /// Numbers of the frames that scores are means over, from 0, rising: all, or as many as `load` was told.
    #[getter]
    fn scored_frames(&self) -> Vec<usize> {
        self.built.scored_frames()
    }

    /// Frames a second.
    #[getter]
    fn rate(&self) -> f64 {
        self.built.scene.rate()
    }

    /// True if there is anything to cast into.
    #[getter]
    fn has_geometry(&self) -> bool {
        self.built.scene.has_geometry()
    }

    /// Every file that the scene is made of.
    #[getter]
    fn files(&self) -> &[PathBuf] {
        self.built.scene.files()
    }

    /// Facts about the scene's files, such as parts that were passed over, and doubts; a sentence each. Loading the scene warns
    /// of each: a `UserWarning`, for doubts a `DoubtWarning`.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.built.scene.notes().iter().map(ToString::to_string).collect()
    }

    /// Models by name, which is empty for the `lidar` of a scene.
    #[getter]
    fn sensors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        sensors_object(py, self.built.scene.vehicle())
    }

    /// The P-SOG: read, or built from virtual scans.
    #[getter]
    fn psog(&self, py: Python<'_>) -> PyResult<PyPsog> {
        let built = self.built.clone();
        Ok(PyPsog(interruptible(py, move |watch| built.psog(watch))??))
    }

    /// `[4, 4]` f64, takes the ego frame of a frame to the world. Raises `ValueError` for a frame that is not there.
    fn world_from_ego<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = arguments::frame)] frame: i128,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let frame = self.built.check_frame(frame)?;
        homogeneous(py, &self.built.scene.ego_pose(frame))
    }

    /// Triangles of a frame in the ego frame: `vertices` `[V, 3]` f32 in metres, `faces` `[F, 3]` u32, `class_ids` `[F]` u16;
    /// without those of the own vehicle where `body` is false. Raises `ValueError` for a frame that is not there.
    #[pyo3(signature = (frame = 0, *, body = true))]
    fn mesh<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = arguments::frame)] frame: i128,
        body: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let frame = self.built.check_frame(frame)?;
        let body = if body { EgoBody::Include } else { EgoBody::Exclude };
        let soup = py.detach(|| pooled(|| self.built.scene.frame(frame, body)));
        let mesh = PyDict::new(py);
        mesh.set_item("vertices", matrix(py, soup.vertices.into_flattened(), 3)?)?;
        mesh.set_item("faces", matrix(py, soup.faces.into_flattened(), 3)?)?;
        mesh.set_item("class_ids", column(py, soup.face_class))?;
        Ok(mesh)
    }

    /// Scores of N placements, as `Scores`: a mapping of columns `[N]`, `print(scores.describe())` says unit and meaning of each.
    /// The bits are those of `sightline score`. Raises `ValueError` for poses of another shape, that are not finite, or of models
    /// that the vehicle does not have, `MemoryError` where memory does not suffice, `OSError` where a device fails.
    ///
    /// Up to 64 placements are looked at closely, as in the program, which takes casts of its own. They are looked at for the
    /// guards `self_hit` and `blind_sector`, and each requirement in 200 copies mounted within `tolerance` (a length and an
    /// angle as text; `None`: no copies). Any number is looked at, without copies, if `self_hits` is true, and none if it is false. With
    /// `near_field`, which casts likewise, there are the columns `near_field` and `near_ring`: shares of the ground within
    /// 10 m and 3 m of the own body with a hit close by.
    ///
    /// The first call gives the program's notes on the scene as warnings, such as one on uneven ground. `progress` as for
    /// `optimize`.
    #[pyo3(signature = (poses, *, sensors = None, phases = None, self_hits = None, near_field = false,
        tolerance = Some(Tolerance::default()), progress = None),
        text_signature = "($self, poses, *, sensors=None, phases=None, self_hits=None, near_field=False, \
        tolerance='5mm,0.5deg', progress=None)")]
    fn score<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
        self_hits: Option<bool>,
        near_field: bool,
        #[pyo3(from_py_with = arguments::tolerance)] tolerance: Option<Tolerance>,
        progress: Option<Progress>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let placements = placements_in(&self.built.scene, poses, sensors, phases)?;
        let vehicle = self.built.scene.vehicle();
        let built = self.built.clone();
        let job = built.job.clone().tolerance(tolerance);
        let progress = progress.unwrap_or_default();
        let scores = scored_object(py, vehicle, placements, progress, move |placements, watch| {
            built.evaluate(watch, |evaluator| {
                let mut scores = score(evaluator, placements, watch)?;
                guard(&job, evaluator, placements, &mut scores, self_hits, watch)?;
                if near_field {
                    add_near_fields(&built.scene, evaluator, placements, &mut scores)?;
                }
                Ok(scores)
            })
        })?;
        self.built.told.warn_once(py, &self.built.job)?;
        Ok(scores)
    }

    /// `[K]` u64, rising linear indices of the voxels that one placement covers in any frame. Raises `ValueError` as `score`, and for
    /// several placements.
    #[pyo3(signature = (poses, *, sensors = None, phases = None))]
    fn covered<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<u64>>> {
        let (built, placement) = self.one(poses, sensors, phases)?;
        let covered = interruptible(py, move |watch| {
            built.evaluate(watch, |evaluator| {
                let go_on = &mut |done, frames| watch.reach("frames", done, frames);
                evaluator.covered_in(0, &placement, go_on).map_err(raised)
            })
        })??;
        Ok(column(py, covered.unwrap_or_default()))
    }

    /// Closest hits of all B beams of placements in one frame, ordered by placement, LiDAR, channel, azimuth step.
    ///
    /// - `origin`, `direction` `[B, 3]` f32: in the ego frame, unit directions
    /// - `t_hit` `[B]` f32: metres, `inf` for no hit within range
    /// - `primitive_ids` `[B]` int64: faces of `mesh(frame)`, −1 for none
    /// - `class_ids` `[B]` int64: −1 for none
    /// - `placement`, `lidar` `[B]` int64: from 0
    ///
    /// Raises `ValueError` as `score`, for a frame that is not there, and for scenes without geometry.
    #[pyo3(signature = (poses, *, frame = 0, sensors = None, phases = None))]
    fn cast<'py>(
        &self,
        py: Python<'py>,
        poses: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::frame)] frame: i128,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let frame = self.built.check_frame(frame)?;
        let placements = placements_in(&self.built.scene, poses, sensors, phases)?;
        let built = self.built.clone();
        let hits = interruptible(py, move |watch| {
            let problem = built.frame(frame)?.problem;
            let class = built.scene.face_classes(EgoBody::Include);
            let opened = engine::open(problem.task(), &built.options.engine, |_| {});
            let mut engine = opened.map_err(raised)?.engine;
            let lidars = placements.iter().map(|placement| placement.lidars.len()).sum();
            let mut done = 0;
            let cast = |poses: &[SensorPose]| {
                watch.reach("LiDARs", done, lidars);
                done += poses.len();
                engine.hits(poses, 0)
            };
            BeamHits::of(&placements, &problem, &class, cast).map_err(raised)
        })??;
        let columns = PyDict::new(py);
        columns.set_item("origin", matrix(py, hits.origin, 3)?)?;
        columns.set_item("direction", matrix(py, hits.direction, 3)?)?;
        columns.set_item("t_hit", column(py, hits.distance))?;
        let number = |id: &u32| signed(Some(*id).filter(|id| *id != NO_HIT));
        let class = |id: &u16| signed(Some(*id).filter(|id| *id != u16::MAX));
        let wide = |ids: Vec<i64>| column(py, ids);
        columns.set_item("primitive_ids", wide(hits.triangle.iter().map(number).collect()))?;
        columns.set_item("class_ids", wide(hits.class.iter().map(class).collect()))?;
        columns.set_item("placement", wide(hits.placement.into_iter().map(i64::from).collect()))?;
        columns.set_item("lidar", wide(hits.lidar.into_iter().map(i64::from).collect()))?;
        Ok(columns)
    }

    /// Compares hits, voxels and sums of the scene's engine with the CPU reference, bit by bit, and `sample` beams of
    /// the reference with brute force in f64, over `frames` frames. Returns the output of `sightline verify --format
    /// json`. Placements are Table 7, `random` and `hostile` ones unless given. Raises `ValueError` as `score`.
    /// `progress` as for `optimize`.
    #[pyo3(signature = (poses = None, *, sensors = None, phases = None, frames = 1, random = 200, hostile = 50,
        sample = 20_000, seed = 1, progress = None))]
    fn verify<'py>(
        &self,
        py: Python<'py>,
        poses: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = arguments::sensors)] sensors: Option<Vec<String>>,
        phases: Option<&Bound<'py, PyAny>>,
        #[pyo3(from_py_with = arguments::verified_frames)] frames: u32,
        #[pyo3(from_py_with = arguments::random)] random: usize,
        #[pyo3(from_py_with = arguments::hostile)] hostile: usize,
        #[pyo3(from_py_with = arguments::sample)] sample: u64,
        #[pyo3(from_py_with = arguments::seed)] seed: u64,
        progress: Option<Progress>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let given = poses
            .map(|poses| placements_in(&self.built.scene, poses, sensors, phases))
            .transpose()?;
        let lidars = self.built.scene.constraints().lidars().max(2);
        room_for("placements", random.saturating_add(hostile), placement_bytes(lidars))?;
        warn_of_frames(py, frames as usize, self.built.scene.frame_count())?;
        room_for("beams of the sample", sample as usize, SAMPLE_BYTES)?;
        let built = self.built.clone();
        answer(py, progress, move |watch| {
            built.psog(watch)?;
            let job = built.job.clone().frames(Some(frames)).conditions(&[]);
            let problem = job.problem().map_err(raised)?;
            let usual = || usual_placements(&problem, random, hostile, seed);
            let placements = given.unwrap_or_else(usual);
            let opened = engine::open(problem.task(), &built.options.engine, |_| {});
            let mut engine = opened.map_err(raised)?.engine;
            let (done, steps) = (Cell::new(0), placements.len() * compared_frames(&problem));
            let tell = || {
                done.set(done.get() + 1);
                watch.reach("placements compared", done.get(), steps);
            };
            verify(&problem, &mut *engine, &placements, sample, seed, &tell).map_err(raised)
        })
    }

    /// SHA-256 of every file that the scene is made of.
    fn _inputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &Input::of(self.built.scene.files()).map_err(raised)?)
    }

    fn __repr__(&self) -> String {
        format!("Scene({:?}, {})", self.name(), frames_in_words(std::slice::from_ref(&self.built)))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, this) = (slf.py(), slf.get());
        let options = PyDict::new(py);
        let (make, first) = match &this.source {
            Source::File { path, vehicle } => {
                options.set_item("vehicle", vehicle)?;
                (slf.getattr("load")?, path.into_pyobject(py)?.into_any())
            }
            Source::Text { text, folder } => {
                options.set_item("folder", folder)?;
                (slf.getattr("from_dict")?, py.import("json")?.call_method1("loads", (text,))?)
            }
        };
        this.built.options.put(&options)?;
        let rebuild = py.import("sightline._pickle")?.getattr("scene")?;
        let arguments = (make, first, options, this._inputs(py)?, &this.root).into_pyobject(py)?;
        PyTuple::new(py, [rebuild, arguments.into_any()])
    }
}
