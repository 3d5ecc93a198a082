//! The space that an optimizer searches: variables from 0 to 1, poses that the mounts allow, rules that poses break.

use numpy::{PyArray2, PyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyTuple;
use sightline::internals::draws;
use sightline::vehicle::{Equipment, SensorName, Vehicle, Violation};
use sightline::{Constraints, Placement, SensorPose};

use crate::arguments::{self, entries, or_raised, room_for, shown, whole};
use crate::arrays::{matrix, misshapen, numbers, shaped};
use crate::errors::bad;
use crate::placements::{PyPlacement, parsed, placement_bytes};
use crate::scenes::PyScene;
use crate::wait::interruptible;

/// Draws for each placement that is to keep the rules.
const DRAWS: usize = 1000;
/// Placements that are drawn between two looks whether to stop.
const DRAWN_TOGETHER: usize = 4096;

/// Columns of `violations`.
const RULES: [&str; 6] =
    ["mount", "min_distance", "keep_out", "equal_height", "symmetric", "sensors"];

/// Placements that the mounts of a scene's vehicle allow to some LiDARs, as a box of `dim` variables from 0 to 1.
///
/// LiDARs come mount after mount, each mount's models in the order of the vehicle file. Ties (`equal_height`, `symmetric`) are
/// kept by having fewer variables; `min_distance` and `keep_out` are not, see `violations`.
#[pyclass(name = "Space", module = "sightline", frozen)]
pub(crate) struct PySpace {
    scene: Py<PyScene>,
    equipment: Equipment,
    rules: Constraints,
    /// Rules of given placements: of the space's models, or of all where no equipment was given.
    given: Constraints,
    bounds: Vec<(f64, f64)>,
}

impl PySpace {
    /// Rules of the mounts for its LiDARs.
    pub(crate) fn constraints(&self) -> &Constraints {
        &self.rules
    }

    fn bounds_of<'py>(&self, py: Python<'py>, of: usize) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let regions = self.rules.slots.iter().map(|slot| &slot.region);
        matrix(py, regions.flat_map(|at| [at.lower, at.upper][of]).collect(), 6)
    }

    /// Placements of variables `[dim]` or `[N, dim]`, and whether there was no axis for them.
    fn placed(&self, z: &Bound<'_, PyAny>) -> PyResult<(Vec<Placement>, bool)> {
        let dim = self.bounds.len();
        let wanted = format!("[N, {dim}] or [{dim}], from 0 to 1");
        let array = numbers::<f64>("z", z, &wanted)?;
        let count = match *array.shape() {
            [own] if own == dim => 1,
            [count, own] if own == dim => count,
            ref shape => return Err(misshapen("z", shape, wanted)),
        };
        room_for("placements", count, placement_bytes(self.rules.lidars()))?;
        let values: Vec<f64> = array.as_array().iter().copied().collect();
        if let Some(at) = values.iter().position(|z| !(0.0..=1.0).contains(z)) {
            let (n, k, found) = (at / dim, at % dim, values[at]);
            return Err(bad(format!("z[{n}, {k}]: is {found}; give 0 to 1")));
        }
        let placement = |n: usize| {
            let own = values[n * dim..(n + 1) * dim].iter().zip(&self.bounds);
            let own: Vec<f64> =
                own.map(|(z, &(low, high))| (low + z * (high - low)).min(high)).collect();
            Placement { name: n.to_string(), lidars: self.rules.poses_of(&own) }
        };
        Ok(((0..count).map(placement).collect(), array.ndim() == 1))
    }

    /// Placements with the models of the space.
    fn given(
        &self,
        poses: &Bound<'_, PyAny>,
        phases: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Vec<Placement>> {
        let mut given = parsed(poses, None, phases)?;
        for placement in &mut given {
            let (found, wanted) = (placement.lidars.len(), self.rules.lidars());
            if found != wanted {
                return Err(bad(format!(
                    "poses: have {found} LiDARs; give {wanted}, one for each of the space"
                )));
            }
            for (pose, slot) in placement.lidars.iter_mut().zip(&self.rules.slots) {
                if pose.sensor.is_none() {
                    pose.sensor = slot.sensor;
                }
            }
        }
        Ok(given)
    }

    /// Metres or radians by which each of [`RULES`] is broken, summed over LiDARs and pairs.
    fn broken(&self, placement: &Placement) -> [f64; RULES.len()] {
        let mut sums = [0.0; RULES.len()];
        for violation in self.given.violations(placement) {
            let rule = match violation {
                Violation::OutsideMount { .. } | Violation::NotTaken { .. } => 0,
                Violation::TooClose { .. } => 1,
                Violation::KeptOut { .. } => 2,
                Violation::UnequalHeight { .. } => 3,
                Violation::NotMirrored { .. } => 4,
                _ => 5,
            };
            sums[rule] += if rule == 5 { 1.0 } else { violation.amount() };
        }
        sums
    }
}

#[pymethods]
impl PySpace {
    /// Number of variables: free pose fields that are not tied to others, and phases that a search may choose.
    #[getter]
    fn dim(&self) -> usize {
        self.bounds.len()
    }

    /// `[L, 6]` f64: least x, y, z (m), roll, pitch, yaw (rad) of each LiDAR in the frame of its mount, which is the ego
    /// frame for a box.
    #[getter]
    fn lower<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.bounds_of(py, 0)
    }

    /// `[L, 6]` f64: greatest x, y, z, roll, pitch, yaw, as `lower`; equal to it where nothing may vary.
    #[getter]
    fn upper<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.bounds_of(py, 1)
    }

    /// Model of each of the L LiDARs, for `sensors=`; `None` where the scene has one LiDAR without a name.
    #[getter]
    fn sensors(&self) -> Option<Vec<&'static str>> {
        let is_named = self.rules.slots.iter().any(|slot| !slot.sensor.is_none());
        is_named.then(|| self.rules.slots.iter().map(|slot| slot.sensor.as_str()).collect())
    }

    /// Name of the mount of each of the L LiDARs.
    #[getter]
    fn mounts(&self) -> Vec<&str> {
        self.rules.slots.iter().map(|slot| &*slot.region.name).collect()
    }

    /// Names of the rules that `violations` has columns for.
    #[getter]
    fn rules(&self) -> Vec<&'static str> {
        RULES.to_vec()
    }

    /// f64 `[N, L, 6]`, or `[L, 6]` of one: poses of variables `z` `[N, dim]` or `[dim]`, from 0 to 1. Raises `ValueError` for
    /// other shapes and values.
    fn poses<'py>(&self, z: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let (placements, is_one) = self.placed(z)?;
        let shape = [placements.len(), self.rules.lidars(), 6];
        poses_of(z.py(), &placements, &shape[usize::from(is_one)..])
    }

    /// A `Placement` for each row of `z` `[N, dim]`, with its models and phases: `scene.score(space.placements(z))`. Raises
    /// `ValueError` as `poses`.
    fn placements(&self, z: &Bound<'_, PyAny>) -> PyResult<Vec<PyPlacement>> {
        Ok(self.placed(z)?.0.into_iter().map(PyPlacement).collect())
    }

    /// f64 `[N, dim]`: variables of `poses` `[N, L, 6]` or Placements, poses outside the mounts moved to their bounds. Raises
    /// `ValueError` where poses break a tie, which no variables do.
    #[pyo3(signature = (poses, *, phases = None))]
    fn vector<'py>(
        &self,
        poses: &Bound<'py, PyAny>,
        phases: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let mut values = Vec::new();
        for (n, placement) in self.given(poses, phases)?.iter().enumerate() {
            let own = self.rules.variables_of(placement).ok_or_else(|| {
                let why = "heights or mirrored pairs are not as the mount ties them";
                bad(format!("poses[{n}]: {why}, or a LiDAR has no mount; see `violations`"))
            })?;
            let share = |(value, &(low, high)): (f64, &(f64, f64))| {
                if high > low { ((value - low) / (high - low)).clamp(0.0, 1.0) } else { 0.0 }
            };
            values.extend(own.into_iter().zip(&self.bounds).map(share));
        }
        matrix(poses.py(), values, self.bounds.len())
    }

    /// f64 `[N, 6]`: by how much `poses` `[N, L, 6]` break each of `rules`, 0 where one is kept.
    ///
    /// Columns are sums over LiDARs and pairs: metres or radians outside the mounts, metres that are missing between
    /// LiDARs, metres inside keep-out boxes, metres between heights, metres and radians from mirror images, LiDARs
    /// without a mount. Raises `ValueError` for another number of LiDARs.
    #[pyo3(signature = (poses, *, phases = None))]
    fn violations<'py>(
        &self,
        poses: &Bound<'py, PyAny>,
        phases: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let given = self.given(poses, phases)?;
        let values = given.iter().flat_map(|placement| self.broken(placement)).collect();
        matrix(poses.py(), values, RULES.len())
    }

    /// f64 `[n, L, 6]`: placements drawn evenly from the mounts, by all rules unless `feasible` is false. `rng` is a seed or a
    /// `numpy.random.Generator`. Raises `ValueError` where hardly any draw keeps the rules.
    #[pyo3(signature = (n, rng = None, *, feasible = true))]
    fn random<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = arguments::drawn)] n: usize,
        rng: Option<&Bound<'py, PyAny>>,
        feasible: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        self.drawn(py, n, seed_of(rng)?, feasible)
    }

    fn __repr__(&self) -> String {
        format!("Space({} LiDARs, {} variables)", self.rules.lidars(), self.dim())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, this) = (slf.py(), slf.get());
        let mounts = &this.scene.get().built.scene.vehicle().mounts;
        let name = |(mount, sensor): &(usize, SensorName)| {
            (mounts[*mount].region.name.clone(), sensor.as_str())
        };
        let equipment: Vec<_> = this.equipment.iter().map(name).collect();
        let arguments = (equipment,).into_pyobject(py)?;
        PyTuple::new(py, [this.scene.bind(py).getattr("space")?, arguments.into_any()])
    }
}

impl PySpace {
    /// Poses of `count` draws, `[count, L, 6]`.
    pub(crate) fn drawn<'py>(
        &self,
        py: Python<'py>,
        count: usize,
        seed: u64,
        by_the_rules: bool,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        let lidars = self.rules.lidars();
        room_for("poses", count, placement_bytes(lidars))?;
        let rules = self.rules.clone();
        let placements = interruptible(py, move |watch| {
            let goes_on = |n: usize| !n.is_multiple_of(DRAWN_TOGETHER) || watch.goes_on();
            let most = if by_the_rules { count.saturating_mul(DRAWS) } else { count };
            let all = draws(&rules, seed).take(most).enumerate();
            let all = all.take_while(|(n, _)| goes_on(*n)).map(|(_, placement)| placement);
            let kept = all.filter(|one| !by_the_rules || rules.violations(one).is_empty());
            kept.take(count).collect::<Vec<_>>()
        })?;
        if placements.len() < count {
            let found = placements.len();
            return Err(bad(format!(
                "n: {found} of {count} placements were found that keep the rules of the mount, in {DRAWS} draws each; \
                 widen the mount, or lower min_distance"
            )));
        }
        poses_of(py, &placements, &[count, lidars, 6])
    }
}

/// Poses of placements, f64 in an array of a shape.
pub(crate) fn poses_of<'py>(
    py: Python<'py>,
    placements: &[Placement],
    shape: &[usize],
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let lidars = placements.iter().flat_map(|placement| &placement.lidars);
    shaped(py, lidars.flat_map(SensorPose::values).collect(), shape)
}

/// A seed from 1 for none, a whole number, or a draw of a generator of NumPy.
fn seed_of(rng: Option<&Bound<'_, PyAny>>) -> PyResult<u64> {
    let Some(rng) = rng else { return Ok(1) };
    match rng.call_method1("integers", (1_u64 << 63,)) {
        Ok(drawn) => drawn.extract(),
        Err(error) => {
            or_raised(rng.py(), error)?;
            whole("rng", rng, 0..=u64::MAX.into())
        }
    }
}

/// Equipment from pairs of names, of a mount and a model.
fn equipment_of(vehicle: &Vehicle, given: &Bound<'_, PyAny>) -> PyResult<Equipment> {
    let wanted = "a list of pairs, name of a mount and of a model";
    let pairs = entries("equipment", given, wanted)?.into_iter().enumerate();
    let pairs = pairs.map(|(k, pair)| {
        let Ok((mount, model)) = pair.extract::<(String, String)>() else {
            return Err(bad(format!("equipment[{k}]: is {}; give {wanted}", shown(&pair))));
        };
        let at = vehicle.mounts.iter().position(|known| known.region.name == mount);
        let at = at.ok_or_else(|| {
            let known: Vec<&str> = vehicle.mounts.iter().map(|m| &*m.region.name).collect();
            let known = known.join(", ");
            bad(format!("equipment[{k}]: `{mount}` is no mount; there are {known}"))
        })?;
        let sensors = &vehicle.mounts[at].sensors;
        let sensor = sensors.iter().find(|sensor| sensor.as_str() == model);
        let sensor = sensor.ok_or_else(|| {
            let known: Vec<&str> = sensors.iter().map(|sensor| sensor.as_str()).collect();
            let known = known.join(", ");
            bad(format!("equipment[{k}]: `{mount}` holds no `{model}`; it may hold {known}"))
        })?;
        Ok((at, *sensor))
    });
    let equipment: Equipment = pairs.collect::<PyResult<_>>()?;
    if equipment.is_empty() || equipment.len() > sightline::vehicle::MAX_LIDARS {
        let most = sightline::vehicle::MAX_LIDARS;
        return Err(bad(format!("equipment: has {} pairs; give 1 to {most}", equipment.len())));
    }
    Ok(equipment)
}

#[pymethods]
impl PyScene {
    /// The space of placements by the mounts, for optimizers: `equipment` is a list of pairs, name of a mount and of a
    /// model; the fullest unless given. Raises `ValueError` for names that the vehicle does not have.
    #[pyo3(signature = (equipment = None))]
    fn space(slf: &Bound<'_, Self>, equipment: Option<&Bound<'_, PyAny>>) -> PyResult<PySpace> {
        let vehicle = slf.get().built.scene.vehicle();
        let is_given = equipment.is_some();
        let equipment = match equipment {
            Some(given) => equipment_of(vehicle, given)?,
            None => vehicle.fullest(),
        };
        let rules = vehicle.constraints(&equipment);
        let given = if is_given { rules.clone() } else { vehicle.rules() };
        let bounds = rules.variable_bounds();
        Ok(PySpace { scene: slf.clone().unbind(), equipment, rules, given, bounds })
    }

    /// Random placements by all rules of the mount, f64 `[count, L, 6]`, as `space().random(count, seed)`; equal seeds give
    /// equal draws. Raises `ValueError` where hardly any draw keeps the rules.
    #[pyo3(signature = (count, *, seed = 1))]
    fn random_poses<'py>(
        slf: &Bound<'py, Self>,
        #[pyo3(from_py_with = arguments::count)] count: usize,
        #[pyo3(from_py_with = arguments::seed)] seed: u64,
    ) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        Self::space(slf, None)?.drawn(slf.py(), count, seed, true)
    }
}
