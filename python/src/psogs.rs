//! P-SOGs as arrays, and from labelled points.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DMat3, DVec3};
use numpy::{PyArray1, PyArray2, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sightline::Psog;
use sightline::datasets::{
    BoxTrack, FormatError, LabelledScan, LabelledSequence, PointLabel, PsogOptions, build_psog,
};
use sightline::geom::Pose;
use sightline::internals::{EntropyKind, FileError, to_nats, write_whole};
use sightline::psog::{PsogError, PsogInfo, Roi, read_psog, write_psog};
use sightline::scan::NO_CLASS;

use crate::arguments::{self, entries, room_for};
use crate::arrays::{column, few_numbers, matrix, misshapen, numbers, rows, to_python, wholes};
use crate::errors::{bad, raised};
use crate::wait::{WorkMessages, interruptible, pooled};

/// Required shape of a region, in words.
const CORNERS: &str = "[2, 3]: the lower and the upper corner, metres";
/// Bytes of a labelled point, read and then merged.
const POINT_BYTES: usize = 64;

/// A probabilistic semantic occupancy grid: in how many of T frames a voxel has each of M classes.
///
/// Voxel (i, j, k) is `roi_min` + [i, i+1) · `voxel` × …, its linear index (i · ny + j) · nz + k. `index` `[K]` lists, rising,
/// the voxels that have a class in some frame, `counts` `[K, M]` in how many; T − Σ is empty. Raises `ValueError` for arrays that
/// are none of a P-SOG.
#[pyclass(name = "Psog", module = "sightline", frozen)]
#[derive(Clone)]
pub(crate) struct PyPsog(pub Arc<Psog>);

#[pymethods]
impl PyPsog {
    #[new]
    #[pyo3(signature = (*, index, counts, frames, classes, roi_min, voxel, shape))]
    fn new(
        index: &Bound<'_, PyAny>,
        counts: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::counted_frames)] frames: u32,
        #[pyo3(from_py_with = arguments::classes)] classes: Vec<String>,
        roi_min: &Bound<'_, PyAny>,
        voxel: &Bound<'_, PyAny>,
        shape: &Bound<'_, PyAny>,
    ) -> PyResult<Self> {
        let wanted = "[K] linear indices of voxels, rising";
        let (index, voxels) = wholes("index", index, wanted, 0..=u64::MAX.into())?;
        let wanted = "[K, classes] frames of each class";
        let (counts, cells) = wholes("counts", counts, wanted, 0..=u16::MAX.into())?;
        let [voxels] = voxels[..] else {
            return Err(misshapen("index", &voxels, "[K]"));
        };
        let rows = match cells[..] {
            [rows, width] if width == classes.len() => rows,
            _ => return Err(misshapen("counts", &cells, format!("[N, {}]", classes.len()))),
        };
        if rows != voxels {
            return Err(bad(format!(
                "counts: have {rows} rows for {voxels} voxels; give one for each"
            )));
        }
        let (along, _) = wholes("shape", shape, "voxels along x, y, z", 1..=u32::MAX.into())?;
        let along = <[u32; 3]>::try_from(along);
        let along = along.map_err(|_| bad("shape: give 3 numbers, voxels along x, y, z"))?;
        let (min, voxel) = (few_numbers("roi_min", roi_min)?, few_numbers("voxel", voxel)?);
        let roi = Roi::new(min, voxel, along).map_err(PsogError::from).map_err(raised)?;
        let psog = Psog::new(roi, frames, classes, index, counts).map_err(raised)?;
        Ok(Self(Arc::new(psog)))
    }

    /// Reads a `.npz` file. Raises `OSError`, such as `FileNotFoundError`, for a file that cannot be read, `ValueError` that
    /// names the fault.
    #[staticmethod]
    fn load(
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
    ) -> PyResult<Self> {
        py.detach(|| Ok(Self(Arc::new(read_psog(&path).map_err(raised)?))))
    }

    /// Writes a `.npz` file, whole at any time. Raises `OSError`, such as `FileNotFoundError`, for a file that cannot be written.
    fn save(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::path)] path: PathBuf,
    ) -> PyResult<()> {
        let write =
            || write_whole(&path, |file| write_psog(file, &self.0).map_err(FileError::io(&path)));
        py.detach(write).map_err(raised)
    }

    /// From labelled points: lists with an entry a frame. Raises `ValueError` for lists and arrays that do not fit together.
    ///
    /// `points[t]` `[N, 3]` in the vehicle's frame of frame t, metres; `labels[t]` `[N]`, positions in `classes`, 65535 and
    /// negative ones vote for nothing; `poses[t]` `[4, 4]`, world from vehicle. `roi` is the lower and the upper corner in the
    /// vehicle's frame, `voxel` the edges. Frame t merges the frames t − `window` ..= t + `window`, all of them for `None`;
    /// points of classes in `moving` count in their own frame only.
    #[staticmethod]
    #[pyo3(signature = (points, labels, poses, *, classes, roi, voxel, window = None, moving = None))]
    fn from_scans(
        py: Python<'_>,
        points: &Bound<'_, PyAny>,
        labels: &Bound<'_, PyAny>,
        poses: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::classes)] classes: Vec<String>,
        roi: &Bound<'_, PyAny>,
        voxel: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::window)] window: Option<u32>,
        #[pyo3(from_py_with = arguments::moving)] moving: Option<Vec<String>>,
    ) -> PyResult<Self> {
        // Lengths first: an entry of a long list takes memory.
        let [count, labelled_frames, posed] = [points, labels, poses].map(|list| list.len().ok());
        if let (Some(count), Some(labelled_frames), Some(posed)) = (count, labelled_frames, posed)
            && (count != labelled_frames || count != posed)
        {
            return Err(bad(format!(
                "points, labels and poses: are lists of {count}, {labelled_frames} and {posed} frames; give one entry a frame in each",
            )));
        }
        let wanted = "a list with an entry a frame";
        let points = entries("points", points, wanted)?;
        let labels = entries("labels", labels, wanted)?;
        let poses = entries("poses", poses, wanted)?;
        if classes.len() >= usize::from(NO_CLASS) {
            return Err(bad(format!("classes: are {}; give fewer than {NO_CLASS}", classes.len())));
        }
        let moves = moving.unwrap_or_default();
        if let Some(unknown) = moves.iter().find(|name| !classes.contains(name)) {
            return Err(bad(format!("moving: `{unknown}` is none of the classes {classes:?}")));
        }
        let moves: Vec<bool> = classes.iter().map(|name| moves.contains(name)).collect();
        let (corners, edges) = (numbers::<f64>("roi", roi, CORNERS)?, few_numbers("voxel", voxel)?);
        let [lower, upper] = corners_of(&corners)?;
        let grid =
            Roi::from_bounds(lower, upper, edges).map_err(PsogError::from).map_err(raised)?;
        let mut frames = Vec::new();
        for t in 0..points.len() {
            let scan = labelled(t, &points[t], &labels[t], &moves)?;
            frames.push((scan, pose(t, &poses[t])?));
        }
        let options = PsogOptions { window, ..PsogOptions::new(grid) };
        let built = interruptible(py, move |watch| {
            let all = frames.len();
            let built = build_psog(&[Recording { classes, frames, watch }], &options);
            watch.reach("frames", all, all);
            built
        });
        Ok(Self(Arc::new(built?.map_err(raised)?.0)))
    }

    /// `[K]` u64, linear indices, rising.
    #[getter]
    fn index<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u64>> {
        column(py, self.0.index().to_vec())
    }

    /// `[K, M]` u16, frames in which the voxel has the class.
    #[getter]
    fn counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u16>>> {
        matrix(py, self.0.counts().to_vec(), self.0.classes().len())
    }

    /// T.
    #[getter]
    fn frames(&self) -> u32 {
        self.0.frames()
    }

    /// Names of the M classes.
    #[getter]
    fn classes(&self) -> Vec<String> {
        self.0.classes().to_vec()
    }

    /// `[3]` f64, lower corner in metres.
    #[getter]
    fn roi_min<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        column(py, self.0.roi().min().to_vec())
    }

    /// `[3]` f64, edges in metres.
    #[getter]
    fn voxel<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        column(py, self.0.roi().voxel().to_vec())
    }

    /// Voxels along x, y, z.
    #[getter]
    fn shape(&self) -> (u32, u32, u32) {
        let [x, y, z] = self.0.roi().shape();
        (x, y, z)
    }

    /// `[K]` f64, entropy of each listed voxel in nats; every other voxel has none.
    fn entropy<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        let psog = &self.0;
        let entropies = py.detach(|| pooled(|| psog.entropies(EntropyKind::Segmentation)));
        column(py, entropies.into_iter().map(|fixed| to_nats(fixed.into())).collect())
    }

    /// The P-SOG over the frames of both. Raises `ValueError` where their voxels or classes differ.
    fn merge(&self, other: &Self) -> PyResult<Self> {
        let merged = pooled(|| self.0.merge(&other.0));
        Ok(Self(Arc::new(merged.map_err(raised)?)))
    }

    /// The facts that `sightline psog info` prints.
    fn info<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        to_python(py, &pooled(|| PsogInfo::new(&self.0, None)))
    }

    fn __len__(&self) -> usize {
        self.0.index().len()
    }

    fn __repr__(&self) -> String {
        let [x, y, z] = self.0.roi().shape();
        let (voxels, frames) = (self.__len__(), self.0.frames());
        format!("Psog({voxels} of {x} × {y} × {z} voxels, {frames} frames)")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let py = slf.py();
        let options = pyo3::types::PyDict::new(py);
        for name in ["index", "counts", "frames", "classes", "roi_min", "voxel", "shape"] {
            options.set_item(name, slf.getattr(name)?)?;
        }
        let rebuild = py.import("sightline._pickle")?.getattr("call")?;
        let arguments = (slf.get_type(), PyTuple::empty(py), options).into_pyobject(py)?;
        PyTuple::new(py, [rebuild, arguments.into_any()])
    }
}

/// Points of a frame with their classes; a negative class votes for nothing.
fn labelled(
    t: usize,
    points: &Bound<'_, PyAny>,
    labels: &Bound<'_, PyAny>,
    moves: &[bool],
) -> PyResult<LabelledScan> {
    let what = format!("points[{t}]");
    let points = numbers::<f32>(&what, points, "[N, 3] coordinates in the sensor frame, metres")?;
    let points = rows(&what, &points, 3)?;
    room_for("points of a frame", points.nrows(), POINT_BYTES)?;
    let points: Vec<[f32; 3]> = points.rows().into_iter().map(|p| [p[0], p[1], p[2]]).collect();
    if let Some(at) = points.iter().flatten().position(|value| !value.is_finite()) {
        return Err(bad(format!("{what}[{}]: is not finite; leave the point out", at / 3)));
    }
    let what = format!("labels[{t}]");
    let wanted = "[N] positions in `classes`, −1 for no vote";
    let (labels, shape) = wholes::<i64>(&what, labels, wanted, i64::MIN.into()..=i64::MAX.into())?;
    if shape.len() != 1 {
        return Err(misshapen(&what, &shape, wanted));
    }
    if labels.len() != points.len() {
        let (labels, points) = (labels.len(), points.len());
        return Err(bad(format!("{what}: has {labels} labels for {points} points; give one each")));
    }
    let label = |(n, &id): (usize, &i64)| {
        let class = (id >= 0 && id != i64::from(NO_CLASS))
            .then(|| usize::try_from(id).unwrap_or(usize::MAX));
        match class {
            Some(class) if class >= moves.len() => Err(bad(format!(
                "{what}[{n}]: is {id}; give a position in `classes`, below {}, or −1 for no vote",
                moves.len()
            ))),
            class => Ok(PointLabel {
                class: class.map(|class| class as u16),
                moving: class.is_some_and(|class| moves[class]),
                on_track: false,
            }),
        }
    };
    let labels = labels.iter().enumerate().map(label).collect::<PyResult<_>>()?;
    Ok(LabelledScan { points, labels })
}

fn corners_of(corners: &PyReadonlyArrayDyn<'_, f64>) -> PyResult<[[f64; 3]; 2]> {
    let view = rows("roi", corners, 3)?;
    if view.nrows() != 2 {
        return Err(misshapen("roi", corners.shape(), CORNERS));
    }
    Ok([0, 1].map(|k| [0, 1, 2].map(|axis| view[(k, axis)])))
}

/// A rigid 4 × 4 matrix that takes the frame of the vehicle to the world.
fn pose(t: usize, given: &Bound<'_, PyAny>) -> PyResult<Pose> {
    let what = format!("poses[{t}]");
    let array = numbers::<f64>(&what, given, "a rigid 4 × 4 matrix, world from vehicle")?;
    let m = rows(&what, &array, 4)?;
    let wrong =
        || bad(format!("{what}: is no rigid transform; give a 4 × 4 matrix, world from vehicle"));
    let is_last = |k: usize| m[(3, k)] == f64::from(u8::from(k == 3));
    if m.nrows() != 4 || !m.iter().all(|value| value.is_finite()) || !(0..4).all(is_last) {
        return Err(wrong());
    }
    let column = |k: usize| DVec3::new(m[(0, k)], m[(1, k)], m[(2, k)]);
    let found = Pose {
        rotation: DMat3::from_cols(column(0), column(1), column(2)),
        translation: column(3),
    };
    let product = found.rotation.transpose() * found.rotation;
    let off = (product - DMat3::IDENTITY)
        .to_cols_array()
        .into_iter()
        .fold(0.0, |m: f64, v| m.max(v.abs()));
    if off > 1e-6 || found.rotation.determinant() < 0.0 { Err(wrong()) } else { Ok(found) }
}

/// Labelled frames from arrays, the sensor's frame being that of the ego.
struct Recording<'a> {
    classes: Vec<String>,
    frames: Vec<(LabelledScan, Pose)>,
    watch: &'a WorkMessages,
}

impl LabelledSequence for Recording<'_> {
    fn name(&self) -> String {
        "arrays".to_owned()
    }

    fn classes(&self) -> Vec<String> {
        self.classes.clone()
    }

    fn frames(&self) -> Vec<u32> {
        (0..self.frames.len() as u32).collect()
    }

    fn rate(&self) -> Option<f64> {
        None
    }

    fn ego_from_sensor(&self, frame: u32) -> Result<Pose, FormatError> {
        // Builders look here once for each frame that votes, in order.
        self.watch.reach("frames", frame as usize, self.frames.len());
        Ok(Pose::IDENTITY)
    }

    fn world_from_sensor(&self, frame: u32) -> Result<Pose, FormatError> {
        Ok(self.frames[frame as usize].1)
    }

    fn tracks(&self) -> Result<Vec<BoxTrack>, FormatError> {
        Ok(Vec::new())
    }

    fn read(&self, frame: u32) -> Result<LabelledScan, FormatError> {
        Ok(self.frames[frame as usize].0.clone())
    }
}
