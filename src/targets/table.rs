//! The study of targets: beams on each target at each distance and bearing, and the range of first detection.

use serde::Serialize;

use super::beams::{PlacedTarget, TargetSite};
use super::card::{position, runs};
use super::ground::GroundBelow;
use super::plan::BodyPlan;
use crate::engine::{Backend, BackendError};
use crate::maths;
use crate::problem::{Frame, Problem, SensorBatch};
use crate::scene::Target;
use crate::vehicle::{Placement, SensorPose, Sensors, UnknownSensor};

/// Targets, their places, and the rule for a detection.
#[derive(Debug, Clone)]
pub struct TargetQuestion {
    /// At least one.
    pub targets: Vec<Target>,
    /// Metres from the ego origin to the middle of a target, rising.
    pub distances: Vec<f64>,
    /// Degrees counter-clockwise from straight ahead.
    pub bearings: Vec<f64>,
    /// Least beams on the target for a frame to count.
    pub beams: u32,
    /// Frames that must count for a detection; all frames in which the target can stand, where these are fewer.
    pub of_frames: usize,
}

/// True for a distance that a question may have, metres.
pub fn is_distance(metres: f64) -> bool {
    metres > 0.0 && metres <= 1000.0
}

/// True for a bearing that a question may have, degrees.
pub fn is_bearing(degrees: f64) -> bool {
    degrees.abs() <= 360.0
}

/// Beams of a placement on a target at one place.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetRow {
    /// Name of the scene; `None` on level ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Name of the placement.
    pub placement: String,
    /// Name of the target.
    pub target: String,
    /// Metres.
    pub distance: f64,
    /// Degrees counter-clockwise from straight ahead.
    pub bearing: f64,
    /// Frame of the scene, from 0; `None` on level ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub frame: Option<usize>,
    /// Beams that meet the target first; `None` where there is no free ground for it in the scene.
    pub beams: Option<u32>,
    /// Beams of each LiDAR that meet the target first; empty where there is no free ground.
    pub by_lidar: Vec<u32>,
    /// True where the target overlaps the own body, so that it counts for no detection.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub overlaps: bool,
}

/// Distances at which a placement detects a target at a bearing.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Detection {
    /// Name of the scene; `None` on level ground.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scene: Option<String>,
    /// Name of the placement.
    pub placement: String,
    /// Name of the target.
    pub target: String,
    /// Degrees counter-clockwise from straight ahead.
    pub bearing: f64,
    /// Range of first detection: the farthest distance at which it is detected, metres; `None` where it is at none.
    pub first: Option<f64>,
    /// First and last of neighbouring distances at which it is detected, metres.
    pub detected: Vec<[f64; 2]>,
}

/// Rows of one scene, or of level ground, by placement, target, bearing, distance and frame.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct TargetTable {
    /// Beams on each target.
    pub rows: Vec<TargetRow>,
    /// Distances of detection, by placement, target and bearing.
    pub detections: Vec<Detection>,
}

/// Targets in one frame, and the beams on each that stands, `[standing][lidars]`.
struct InFrame<'a> {
    /// Number of the frame in the scene; `None` on level ground.
    number: Option<usize>,
    /// By place; `None` where there is no free ground.
    standing: Vec<Option<PlacedTarget<'a>>>,
    /// By place: true where the target overlaps the own bodies as they stand in the frame.
    overlaps: Vec<bool>,
    beams: Vec<Vec<u32>>,
}

impl TargetTable {
    /// A copy whose rows name a scene.
    #[must_use]
    pub fn of_scene(mut self, scene: &str) -> Self {
        self.rows.iter_mut().for_each(|row| row.scene = Some(scene.to_owned()));
        self.detections.iter_mut().for_each(|row| row.scene = Some(scene.to_owned()));
        self
    }

    /// Adds the rows of another table.
    pub fn append(&mut self, other: Self) {
        self.rows.extend(other.rows);
        self.detections.extend(other.detections);
    }
}

impl TargetQuestion {
    /// Every target at every bearing and distance, in the order of the rows.
    fn places(&self) -> impl Iterator<Item = (&Target, f64, f64)> {
        self.targets.iter().flat_map(move |target| {
            self.bearings.iter().flat_map(move |&bearing| {
                self.distances.iter().map(move |&distance| (target, bearing, distance))
            })
        })
    }

    /// Longest range of the sensors of some LiDARs, and the distances at which every target lies beyond the range of each LiDAR,
    /// metres; `None` where there is no such distance.
    pub fn beyond(&self, sensors: &Sensors, lidars: &[SensorPose]) -> Option<(f32, Vec<f64>)> {
        let diagonal = |target: &Target| maths::hypot(target.size[0], target.size[1]);
        let widest = self.targets.iter().map(diagonal).fold(0.0, f64::max);
        let (mut longest, mut reach) = (0.0_f32, 0.0_f64);
        for pose in lidars {
            let range = sensors.table(sensors.number(pose).ok()?).range();
            longest = longest.max(range);
            reach = reach.max(f64::from(range) + maths::hypot(pose.x, pose.y) + widest);
        }
        let beyond = self.distances.iter().copied().filter(|distance| *distance > reach);
        Some((longest, beyond.collect::<Vec<_>>())).filter(|(_, beyond)| !beyond.is_empty())
    }

    /// Every target at its places on level ground, in the order of the rows.
    pub(crate) fn on_level(&self) -> Vec<PlacedTarget<'_>> {
        let at =
            |(target, bearing, distance)| PlacedTarget { target, at: position(distance, bearing) };
        self.places().map(at).collect()
    }

    /// The table of a placement on level ground, each target alone, the own body in the way. Start angles that differ
    /// from frame to frame stand at 0.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn on_level_ground(
        &self,
        site: &TargetSite,
        placement: &Placement,
    ) -> Result<TargetTable, UnknownSensor> {
        let there = self.on_level();
        let standing = there.iter().copied().map(Some).collect();
        let overlaps = there.iter().map(|PlacedTarget { target, at }| !site.has_room(target, *at));
        let overlaps = overlaps.collect();
        let beams = site.beams_by_lidar(&placement.lidars, &there)?;
        Ok(self.table(placement, &[InFrame { number: None, standing, overlaps, beams }]))
    }

    /// The table of a placement in a scene: in each of some frames each target stands alone on the ground below its
    /// place, with all that is there in the way.
    ///
    /// # Errors
    /// A model that the vehicle does not have, an engine that fails.
    pub fn in_scene(
        &self,
        site: &TargetSite,
        (problem, ground): (&Problem, &GroundBelow),
        engine: &mut dyn Backend,
        placement: &Placement,
    ) -> Result<TargetTable, BackendError> {
        let batch = SensorBatch::new(problem, &placement.lidars, None)?;
        let mut frames = Vec::new();
        let own = problem.overlap_required().own;
        let mut plan: Option<(Frame, BodyPlan)> = None;
        for frame in 0..problem.frame_count() {
            let hits = engine.hits(&placement.lidars, frame)?;
            let hits: Vec<_> = (0..batch.len()).map(|k| &hits[batch.beams_of(k)]).collect();
            let geometry = problem.geometry(frame);
            let geometry = geometry.map(|geometry| (geometry, ground.wheels(geometry)));
            let bodies = geometry.as_ref().map(|(geometry, _)| BodyPlan::in_frame(geometry, own));
            let bodies = bodies.unwrap_or_default();
            // Bodies that stand as in the frame before have its plan.
            let known = plan.take().filter(|(known, _)| *known == bodies);
            let (_, plan) = &*plan.insert(known.unwrap_or_else(|| {
                let plan = BodyPlan::of(&bodies);
                (bodies, plan)
            }));
            let stand = |(target, bearing, distance)| {
                let level = position(distance, bearing);
                let height = geometry.as_ref().and_then(|(geometry, wheels)| {
                    ground.height(geometry, wheels, target, [level[0], level[1]])
                });
                let at = height.map(|height| [level[0], level[1], height]);
                let overlaps = plan.holds(target, at.unwrap_or(level));
                (at.map(|at| PlacedTarget { target, at }), overlaps)
            };
            let (standing, overlaps): (Vec<_>, Vec<_>) = self.places().map(stand).unzip();
            let there: Vec<PlacedTarget<'_>> = standing.iter().flatten().copied().collect();
            let poses = batch.ego_from_sensors(frame);
            let beams = site.beams_in_scene(&placement.lidars, &poses, &hits, &there)?;
            let number = Some(problem.number_of(frame));
            frames.push(InFrame { number, standing, overlaps, beams });
        }
        Ok(self.table(placement, &frames))
    }

    fn table(&self, placement: &Placement, frames: &[InFrame<'_>]) -> TargetTable {
        let mut table = TargetTable::default();
        let mut by_frame: Vec<_> = frames.iter().map(|of| of.beams.iter()).collect();
        let mut detected = Vec::new();
        for (place, (target, bearing, distance)) in self.places().enumerate() {
            // Frames in which the target can stand, and in which enough beams meet it.
            let [mut stands, mut met] = [0, 0];
            for (InFrame { number, standing, overlaps, .. }, beams) in
                frames.iter().zip(&mut by_frame)
            {
                let overlaps = overlaps[place];
                let by_lidar = standing[place].and_then(|_| beams.next());
                let beams = by_lidar.map(|by_lidar| by_lidar.iter().sum::<u32>());
                let counts = beams.filter(|_| !overlaps);
                stands += usize::from(counts.is_some());
                met += usize::from(counts.is_some_and(|beams| beams >= self.beams));
                table.rows.push(TargetRow {
                    scene: None,
                    placement: placement.name.clone(),
                    target: target.name.clone(),
                    distance,
                    bearing,
                    frame: *number,
                    beams,
                    by_lidar: by_lidar.cloned().unwrap_or_default(),
                    overlaps,
                });
            }
            detected.push((stands > 0).then_some(met >= self.of_frames.min(stands.max(1))));
            if detected.len() == self.distances.len() {
                let detected = runs(&std::mem::take(&mut detected), &self.distances);
                table.detections.push(Detection {
                    scene: None,
                    placement: placement.name.clone(),
                    target: target.name.clone(),
                    bearing,
                    first: detected.last().map(|run| run[1]),
                    detected,
                });
            }
        }
        table
    }
}
