//! Voxels, ground and targets of a scene by the technologies that see them: LiDARs, and the cones of other sensors.

use std::sync::OnceLock;

use glam::DVec3;
use serde::Serialize;

use super::counts::{SeenByTechnologies, Sets, Sums, TargetSeenBy, bits};
use super::field_of_view::{Box3, Cones, blocked_share};
use crate::near_field::NearSite;
use crate::problem::{Frame, Problem};
use crate::targets::PlacedTarget;
use crate::vehicle::{LIDAR, OtherSensor};

/// Share of a cone's directions that the own body may block without a note.
const MOST_BLOCKED: f64 = 0.5;

/// Things of a scene by the technologies that see them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Technologies {
    /// Sensors of each technology, LiDARs first.
    pub sensors: Vec<SensorsOf>,
    /// Voxels that are occupied in some frame of the P-SOG.
    pub occupied: SeenByTechnologies,
    /// Ground cells within 3 m of the own body; `None` without ground or body.
    pub ground_3m: Option<SeenByTechnologies>,
    /// Ground cells within 10 m of the own body; `None` without ground or body.
    pub ground_10m: Option<SeenByTechnologies>,
    /// Places of each target on level ground; none with coverage `through`.
    pub targets: Vec<TargetSeenBy<SeenByTechnologies>>,
}

/// Number of sensors of a technology.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SensorsOf {
    /// Word for the technology.
    pub technology: String,
    /// Sensors on the vehicle, or LiDARs of the placement.
    pub count: usize,
}

impl Technologies {
    /// Mean over several scenes, of one placement.
    pub(super) fn mean(all: &[&Self]) -> Option<Self> {
        let first = *all.first()?;
        let mean = |part: &dyn Fn(&Self) -> Option<&SeenByTechnologies>| {
            SeenByTechnologies::mean(&all.iter().filter_map(|one| part(one)).collect::<Vec<_>>())
        };
        let target = |(k, of): (usize, &TargetSeenBy<SeenByTechnologies>)| {
            let seen = mean(&|one| one.targets.get(k).map(|of| &of.seen))?;
            Some(TargetSeenBy { target: of.target.clone(), seen })
        };
        Some(Self {
            sensors: first.sensors.clone(),
            occupied: mean(&|one| Some(&one.occupied))?,
            ground_3m: mean(&|one| one.ground_3m.as_ref()),
            ground_10m: mean(&|one| one.ground_10m.as_ref()),
            targets: first.targets.iter().enumerate().filter_map(target).collect(),
        })
    }
}

/// A set of bits for each technology other than LiDAR.
type SetsOfCones = Vec<Vec<u64>>;

/// Cones of a vehicle, and the voxels and ground of a scene that they see: the same for every placement.
pub(super) struct ConeSite {
    cones: Cones,
    /// Names of all technologies, LiDARs first.
    names: Vec<String>,
    /// Occupied voxels, in each distinct frame.
    occupied: OnceLock<Vec<SetsOfCones>>,
    /// Cells of the ground, in each distinct frame.
    ground: OnceLock<Vec<SetsOfCones>>,
}

impl ConeSite {
    /// `None` for a vehicle without sensors of other technologies.
    pub(super) fn new(sensors: &[OtherSensor]) -> Option<Self> {
        let cones = Cones::new(sensors);
        let others = cones.technologies.iter().map(|(word, _)| word.clone());
        let names = std::iter::once(LIDAR.to_owned()).chain(others).collect();
        let site = Self { cones, names, occupied: OnceLock::new(), ground: OnceLock::new() };
        (!sensors.is_empty()).then_some(site)
    }

    pub(super) fn sensors(&self, lidars: usize) -> Vec<SensorsOf> {
        let others = self.cones.technologies.iter().map(|(_, sensors)| sensors.len());
        let counts = std::iter::once(lidars).chain(others).zip(&self.names);
        counts.map(|(count, word)| SensorsOf { technology: word.clone(), count }).collect()
    }

    /// Sentences about sensors whose view the own body blocks for the most part.
    pub(super) fn notes(&self, body: &Frame) -> Vec<String> {
        let sensors = self.cones.technologies.iter().flat_map(|(_, sensors)| sensors);
        let note = |sensor: &OtherSensor| {
            let blocked = blocked_share(sensor, body);
            (blocked > MOST_BLOCKED).then(|| {
                format!(
                    "the own body blocks {:.0} % of the view of `{}`; other_sensors stand outside the body's shapes, or see \
                     nothing through them",
                    100.0 * blocked,
                    sensor.name
                )
            })
        };
        sensors.filter_map(note).collect()
    }

    /// Occupied voxels that each technology sees, in each distinct frame.
    pub(super) fn occupied(&self, problem: &Problem) -> &[SetsOfCones] {
        let look = || {
            let (roi, edge) = (problem.roi(), DVec3::from(problem.roi().voxel()));
            let voxel = |index: u32| -> Box3 {
                let at = roi.coords(u64::from(index)).map(f64::from);
                let low = DVec3::from(roi.min()) + DVec3::from(at) * edge;
                [low, low + edge]
            };
            let boxes: Vec<Box3> =
                problem.content().occupied().iter().map(|of| voxel(of.index)).collect();
            let frames = problem.distinct_frames().into_iter();
            frames.map(|(frame, _)| self.see(problem.ends(frame), &boxes)).collect()
        };
        self.occupied.get_or_init(look)
    }

    /// Cells of the ground that each technology sees, in each distinct frame.
    pub(super) fn ground(&self, near: &NearSite, problem: &Problem) -> &[SetsOfCones] {
        let look = || {
            let of_frame = |(frame, points): (usize, Vec<DVec3>)| {
                let boxes: Vec<Box3> = points.into_iter().map(|point| [point; 2]).collect();
                self.see(problem.ends(frame), &boxes)
            };
            near.ground_points().into_iter().map(of_frame).collect()
        };
        self.ground.get_or_init(look)
    }

    /// Targets that each technology sees, each alone on level ground, with the own body in the way.
    pub(super) fn targets(&self, body: &Frame, standing: &[PlacedTarget<'_>]) -> SetsOfCones {
        let around = |standing: &PlacedTarget<'_>| -> Box3 {
            standing.target.corners.map(|corner| DVec3::from(corner) + DVec3::from(standing.at))
        };
        self.see(Some(body), &standing.iter().map(around).collect::<Vec<_>>())
    }

    /// Sets of one frame: things that any LiDAR sees, and those of the cones.
    pub(super) fn sets(&self, lidars: Vec<u64>, cones: &SetsOfCones) -> Sets {
        Sets::of_technologies(std::iter::once(lidars).chain(cones.iter().cloned()).collect())
    }

    /// Means over frames of sums of such sets.
    pub(super) fn mean(&self, sums: &Sums) -> SeenByTechnologies {
        sums.mean_of_technologies(&self.names)
    }

    fn see(&self, frame: Option<&Frame>, boxes: &[Box3]) -> SetsOfCones {
        let seen = self.cones.see(frame, boxes);
        seen.into_iter().map(bits).collect()
    }
}

pub(super) fn union<'a>(sets: impl IntoIterator<Item = &'a [u64]>) -> Vec<u64> {
    let or = |mut all: Vec<u64>, set: &[u64]| {
        all.resize(all.len().max(set.len()), 0);
        all.iter_mut().zip(set).for_each(|(word, bits)| *word |= bits);
        all
    };
    sets.into_iter().fold(Vec::new(), or)
}
