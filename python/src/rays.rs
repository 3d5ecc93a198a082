//! Rays of callers: into a mesh of theirs, or a frame of a scene.

use std::sync::{Arc, OnceLock};

use glam::DVec3;
use lidar_cast::bvh::Bvh;
use numpy::{Element, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rayon::prelude::*;
use sightline::Scene;
use sightline::engine::{Hit, RayScene};
use sightline::geom::TriangleSoup;
use sightline::problem::{Frame, Problem};
use sightline::scene::EgoBody;

use crate::arguments::{self, room_for};
use crate::arrays::{misshapen, numbers, place, rows, shaped, wholes};
use crate::errors::bad;
use crate::scenes::PyScene;
use crate::wait::interruptible;

/// Metres within which rays of callers hit.
const RANGE: f32 = 1e6;
/// Bytes of a ray with its columns.
const RAY_BYTES: usize = 72;
/// Rays that are cast between two looks whether to stop: enough for an order that goes down trees alike.
const AT_ONCE: usize = 1 << 20;
/// Required shape of rays, in words.
const WANTED: &str = "[..., 6]: origin and direction in the ego frame, metres";

/// Trees and triangles that rays are cast into.
pub(crate) struct RayTarget {
    rays: RayScene,
    triangles: Triangles,
    /// Class of each triangle; none where nobody has said.
    classes: Vec<u16>,
}

/// Where the corners of triangles come from, for those who want normals.
enum Triangles {
    RayArray(TriangleSoup),
    Of { scene: Arc<Scene>, frame: usize, soup: OnceLock<TriangleSoup> },
}

impl RayTarget {
    /// A frame of a scene, from the problem of that frame alone.
    pub(crate) fn of_frame(scene: &Arc<Scene>, frame: usize, problem: &Problem) -> PyResult<Self> {
        let geometry = problem.geometry(0).ok_or_else(|| bad("the frame has no geometry"))?;
        let classes = scene.face_classes(EgoBody::Include);
        let (scene, soup) = (scene.clone(), OnceLock::new());
        let triangles = Triangles::Of { scene, frame, soup };
        Ok(Self { rays: RayScene::new(geometry), triangles, classes })
    }

    fn soup(&self) -> &TriangleSoup {
        match &self.triangles {
            Triangles::RayArray(soup) => soup,
            Triangles::Of { scene, frame, soup } => {
                soup.get_or_init(|| scene.frame(*frame, EgoBody::Include))
            }
        }
    }
}

/// Columns of closest hits; a column that nobody asked for is empty.
struct HitColumns {
    t: Vec<f32>,
    triangle: Vec<i64>,
    class: Vec<i64>,
    normal: Vec<[f32; 3]>,
    uv: Vec<[f32; 2]>,
}

/// Number as PyTorch takes it: −1 for none.
pub(crate) fn signed<T: Into<i64>>(number: Option<T>) -> i64 {
    number.map_or(-1, Into::into)
}

impl HitColumns {
    fn with_room(rays: usize, target: &RayTarget, asked: HitOptions) -> Self {
        let of = |is_asked: bool| if is_asked { rays } else { 0 };
        Self {
            t: Vec::with_capacity(rays),
            triangle: Vec::with_capacity(rays),
            class: Vec::with_capacity(of(!target.classes.is_empty())),
            normal: Vec::with_capacity(of(asked.normals)),
            uv: Vec::with_capacity(of(asked.uvs)),
        }
    }

    /// Adds the closest hits of more rays.
    fn add(&mut self, target: &RayTarget, rays: &[[f32; 6]], t_max: f32, asked: HitOptions) {
        let hits = target.rays.closest_hits(rays, RANGE, t_max);
        let met = |hit: &Hit| hit.is_hit().then_some(hit.prim);
        let t = |hit: &Hit| if hit.is_hit() { hit.t } else { f32::INFINITY };
        self.t.par_extend(hits.par_iter().map(t));
        self.triangle.par_extend(hits.par_iter().map(|hit| signed(met(hit))));
        if !target.classes.is_empty() {
            let class = |prim: u32| target.classes.get(prim as usize).copied();
            self.class.par_extend(hits.par_iter().map(|hit| signed(met(hit).and_then(class))));
        }
        if !(asked.normals || asked.uvs) {
            return;
        }
        let soup = target.soup();
        let shape = |(ray, hit): (&[f32; 6], &Hit)| {
            let none = ([f32::NAN; 3], [f32::NAN; 2]);
            met(hit).map_or(none, |prim| normal_and_uv(soup.corners(prim), ray))
        };
        let shapes = rays.par_iter().zip(&hits).map(shape);
        if asked.normals {
            self.normal.par_extend(shapes.clone().map(|shape| shape.0));
        }
        if asked.uvs {
            self.uv.par_extend(shapes.map(|shape| shape.1));
        }
    }
}

/// Unit normal of a triangle by the order of its corners, and the weights of its second and third corner where a ray meets
/// its plane (Möller and Trumbore, 1997, in f64).
fn normal_and_uv(corners: [[f32; 3]; 3], ray: &[f32; 6]) -> ([f32; 3], [f32; 2]) {
    let at = |of: &[f32]| DVec3::new(of[0].into(), of[1].into(), of[2].into());
    let [a, b, c] = [0, 1, 2].map(|k| at(&corners[k]));
    let (origin, direction) = (at(&ray[..3]), at(&ray[3..]));
    let (ab, ac) = (b - a, c - a);
    let across = direction.cross(ac);
    let determinant = ab.dot(across);
    let from = origin - a;
    let u = from.dot(across) / determinant;
    let v = direction.dot(from.cross(ab)) / determinant;
    (ab.cross(ac).normalize_or_zero().as_vec3().to_array(), [u as f32, v as f32])
}

/// Rays that were given, and the axes before their last one.
struct RayArray {
    numbers: Vec<f32>,
    shape: Vec<usize>,
}

impl RayArray {
    fn new(rays: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = numbers::<f32>("rays", rays, WANTED)?;
        let Some((6, shape)) = array.shape().split_last().map(|(last, rest)| (*last, rest)) else {
            return Err(misshapen("rays", array.shape(), WANTED));
        };
        let shape = shape.to_vec();
        room_for("hits of all rays", shape.iter().product(), RAY_BYTES)?;
        let view = array.as_array();
        // In C order: the slice of NumPy's own would be the memory of a column-major array, too.
        let values: Vec<f32> = match view.as_slice() {
            Some(values) => values.to_vec(),
            None => view.iter().copied().collect(),
        };
        // A ray at a time without a branch a number.
        let is_bad = |ray: &[f32]| ray.iter().fold(false, |bad, number| bad | !number.is_finite());
        if let Some(ray) = values.chunks_exact(6).position(is_bad) {
            let ray: Vec<String> = place(ray, &shape).iter().map(ToString::to_string).collect();
            return Err(bad(format!("rays[{}]: is not finite; leave the ray out", ray.join(", "))));
        }
        Ok(Self { numbers: values, shape })
    }

    fn rays(&self) -> &[[f32; 6]] {
        self.numbers.as_chunks().0
    }

    /// Answers to all rays behind those in `all`, a part at a time, without the GIL.
    fn answers<T: Send + 'static>(
        self,
        py: Python<'_>,
        mut all: T,
        add: impl Fn(&mut T, &[[f32; 6]]) + Send + 'static,
    ) -> PyResult<T> {
        interruptible(py, move |watch| {
            let mut done = 0;
            for some in self.rays().chunks(AT_ONCE) {
                if !watch.reach("rays", done, self.rays().len()) {
                    break;
                }
                add(&mut all, some);
                done += some.len();
            }
            watch.reach("rays", done, self.rays().len());
            all
        })
    }
}

/// Columns of hits that a caller may ask for.
#[derive(Clone, Copy)]
struct HitOptions {
    normals: bool,
    uvs: bool,
}

/// The largest distance in lengths of the direction.
fn most_lengths(t_max: Option<f64>) -> PyResult<f32> {
    match t_max {
        None => Ok(f32::INFINITY),
        Some(most) if most > 0.0 => Ok(most as f32),
        Some(most) => Err(bad(format!(
            "t_max: is {most}; give lengths of the direction, more than 0, or None"
        ))),
    }
}

/// The answer `of` the trees to each ray within `t_max` lengths of its direction, in the shape of the rays.
fn each_ray<'py, T: Element + 'static>(
    target: &Arc<RayTarget>,
    rays: &Bound<'py, PyAny>,
    t_max: Option<f64>,
    of: fn(&RayScene, &[[f32; 6]], f32) -> Vec<T>,
) -> PyResult<Bound<'py, PyArrayDyn<T>>> {
    let t_max = most_lengths(t_max)?;
    let (py, target, given) = (rays.py(), target.clone(), RayArray::new(rays)?);
    let shape = given.shape.clone();
    let add = move |all: &mut Vec<T>, some: &[[f32; 6]]| all.extend(of(&target.rays, some, t_max));
    shaped(py, given.answers(py, Vec::new(), add)?, &shape)
}

/// A mesh that rays are cast into: triangles `faces` `[F, 3]` of corners `vertices` `[V, 3]`, in metres.
///
/// `class_ids` `[F]` gives each triangle a class. `reach` is how far away rays begin, in metres: from farther, rounding
/// may let a ray slip through an edge; four times the largest coordinate unless given. `Scene.raycaster(frame)` is one over
/// a frame of a scene. Raises `ValueError` for a face of corners that are not there and for corners that are not finite.
#[pyclass(name = "Raycaster", module = "sightline", frozen)]
pub(crate) struct PyRaycaster(pub Arc<RayTarget>);

#[pymethods]
impl PyRaycaster {
    #[new]
    #[pyo3(signature = (vertices, faces, *, class_ids = None, reach = None))]
    fn new(
        py: Python<'_>,
        vertices: &Bound<'_, PyAny>,
        faces: &Bound<'_, PyAny>,
        class_ids: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = arguments::reach)] reach: Option<f64>,
    ) -> PyResult<Self> {
        let array = numbers::<f32>("vertices", vertices, "[V, 3]: x, y, z in metres")?;
        let view = rows("vertices", &array, 3)?;
        if let Some(at) = view.rows().into_iter().position(|v| !v.iter().all(|v| v.is_finite())) {
            return Err(bad(format!("vertices[{at}]: is not finite; leave out its faces")));
        }
        let vertices: Vec<[f32; 3]> = view.rows().into_iter().map(|v| [v[0], v[1], v[2]]).collect();
        let most = vertices.len() as i128 - 1;
        let (corners, shape) = wholes::<u32>("faces", faces, "[F, 3]: rows of vertices", 0..=most)?;
        if shape.len() != 2 || shape[1] != 3 {
            return Err(misshapen("faces", &shape, "[F, 3]: rows of vertices"));
        }
        let faces: Vec<[u32; 3]> = corners.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect();
        let classes = match class_ids {
            None => Vec::new(),
            Some(given) => wholes::<u16>("class_ids", given, "[F]: a class a face", 0..=65534)?.0,
        };
        if class_ids.is_some() && classes.len() != faces.len() {
            let (found, wanted) = (classes.len(), faces.len());
            return Err(bad(format!(
                "class_ids: has the length {found}; give one for each face, {wanted} in all"
            )));
        }
        let largest = vertices.iter().flatten().fold(0.0, |most: f32, v| most.max(v.abs()));
        let reach = reach.map_or(4.0 * largest, |metres| metres as f32);
        let soup = TriangleSoup { vertices, face_class: vec![0; faces.len()], faces };
        let build = move |soup: TriangleSoup| {
            let tree = Arc::new(Bvh::build(&soup, reach));
            let rays = RayScene::new(&Frame::from(tree));
            RayTarget { rays, triangles: Triangles::RayArray(soup), classes }
        };
        Ok(Self(Arc::new(interruptible(py, move |_| build(soup))?)))
    }

    /// Closest hits of `rays` `[..., 6]`, origin and direction in metres, as a dict.
    ///
    /// `t_hit` f32 `[...]` in lengths of the direction, at most `t_max`, `inf` for none; `primitive_ids` int64 `[...]`, −1 for
    /// none; `class_ids` int64 `[...]`, −1 for none, where triangles have classes. With `normals` also `normals` f32 `[..., 3]`,
    /// unit normals by the order of corners; with `uvs` `uvs` f32 `[..., 2]`, weights of the second and third corner; both `NaN`
    /// for none. Directions need not be of unit length; one of length 0 hits nothing. Raises `ValueError` for other shapes
    /// and for rays that are not finite.
    #[pyo3(signature = (rays, *, t_max = None, normals = false, uvs = false))]
    fn cast_rays<'py>(
        &self,
        rays: &Bound<'py, PyAny>,
        t_max: Option<f64>,
        normals: bool,
        uvs: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (py, target, asked) = (rays.py(), self.0.clone(), HitOptions { normals, uvs });
        let (t_max, given) = (most_lengths(t_max)?, RayArray::new(rays)?);
        let shape = given.shape.clone();
        let has_classes = !target.classes.is_empty();
        let found = HitColumns::with_room(given.rays().len(), &target, asked);
        let add =
            move |all: &mut HitColumns, some: &[[f32; 6]]| all.add(&target, some, t_max, asked);
        let found = given.answers(py, found, add)?;
        let columns = PyDict::new(py);
        columns.set_item("t_hit", shaped(py, found.t, &shape)?)?;
        columns.set_item("primitive_ids", shaped(py, found.triangle, &shape)?)?;
        if has_classes {
            columns.set_item("class_ids", shaped(py, found.class, &shape)?)?;
        }
        if normals {
            let shape = [&shape[..], &[3]].concat();
            columns.set_item("normals", shaped(py, found.normal.into_flattened(), &shape)?)?;
        }
        if uvs {
            let shape = [&shape[..], &[2]].concat();
            columns.set_item("uvs", shaped(py, found.uv.into_flattened(), &shape)?)?;
        }
        Ok(columns)
    }

    /// bool `[...]`: whether each of `rays` `[..., 6]` hits anything within `t_max` lengths of its direction. Raises
    /// `ValueError` as `cast_rays`.
    #[pyo3(signature = (rays, *, t_max = None))]
    fn occluded<'py>(
        &self,
        rays: &Bound<'py, PyAny>,
        t_max: Option<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<bool>>> {
        each_ray(&self.0, rays, t_max, |scene, some, t_max| scene.occluded(some, RANGE, t_max))
    }

    /// int64 `[...]`: triangles that each of `rays` `[..., 6]` hits within `t_max` lengths of its direction; a ray through an
    /// edge that triangles share counts each. Raises `ValueError` as `cast_rays`.
    #[pyo3(signature = (rays, *, t_max = None))]
    fn count<'py>(
        &self,
        rays: &Bound<'py, PyAny>,
        t_max: Option<f64>,
    ) -> PyResult<Bound<'py, PyArrayDyn<i64>>> {
        each_ray(&self.0, rays, t_max, |scene, some, t_max| {
            scene.counts(some, RANGE, t_max).into_iter().map(i64::from).collect()
        })
    }

    /// Number of triangles.
    fn __len__(&self) -> usize {
        self.0.rays.triangle_count()
    }

    fn __repr__(&self) -> String {
        format!("Raycaster({} triangles)", self.__len__())
    }
}

#[pymethods]
impl PyScene {
    /// Rays into one frame, as a `Raycaster` in the ego frame: closest hits, occlusion, counts. Raises `ValueError` for a
    /// frame that is not there, and for scenes without geometry.
    #[pyo3(signature = (frame = 0))]
    fn raycaster(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = arguments::frame)] frame: i128,
    ) -> PyResult<PyRaycaster> {
        let frame = self.built.check_frame(frame)?;
        let built = self.built.clone();
        Ok(PyRaycaster(interruptible(py, move |_| built.frame(frame))??.rays))
    }

    /// Closest hits of `rays` `[..., 6]`, origin and direction in the ego frame in metres, in one frame, as a dict.
    ///
    /// Columns as `Raycaster.cast_rays` has them: `t_hit` in lengths of the direction, `primitive_ids`, `class_ids`, with
    /// `normals` also `normals`, with `uvs` also `uvs`. Faces are numbered as in `mesh(frame)`. Raises `ValueError` as
    /// `raycaster(frame).cast_rays(rays)`.
    #[pyo3(signature = (rays, *, frame = 0, t_max = None, normals = false, uvs = false))]
    fn cast_rays<'py>(
        &self,
        py: Python<'py>,
        rays: &Bound<'py, PyAny>,
        #[pyo3(from_py_with = arguments::frame)] frame: i128,
        t_max: Option<f64>,
        normals: bool,
        uvs: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        self.raycaster(py, frame)?.cast_rays(rays, t_max, normals, uvs)
    }
}
