//! One scan: the return of every beam of a rig in a frame, and the boxes of actors around it with the share of their hulls
//! that is seen.

use std::sync::Arc;

use glam::DVec3;
use rayon::prelude::*;

use crate::stage::Stage;
use lidar_cast::cast::Firing;
use lidar_cast::geom::Pose;
use sightline_scene::scene::ActorKind;

/// Class of a beam that met no surface.
pub const NO_CLASS: u16 = u16::MAX;
/// Instance of static surfaces.
pub const NO_INSTANCE: u16 = 0;
/// Instance of the ego vehicle's own body.
pub const EGO_INSTANCE: u16 = u16::MAX;

/// Metres beyond an actor's box within which a point counts as one of the box. Points on a surface lie on the faces
/// of a tight box, where rounding would decide.
pub const BOX_MARGIN: f64 = 0.005;

/// Outcome of a beam: the source of its point, or why there is none.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Status {
    /// Point on the surface that the beam met.
    Hit = 0,
    /// No point: the beam met nothing within range.
    Miss = 1,
    /// No point: the echo was too weak.
    Lost = 2,
    /// No point: the echo was thrown away, although it was strong enough.
    Dropped = 3,
    /// Point in the fog.
    Fog = 4,
    /// Point on a snowflake.
    Snow = 5,
    /// Point at a wrong distance, from another sensor's pulse.
    Crosstalk = 6,
    /// Second point of the beam, on another surface than the strongest echo's: the last, or the second strongest.
    Second = 7,
    /// Point on a drop of rain.
    Rain = 8,
}

impl Status {
    /// True if there is a point.
    pub fn is_point(self) -> bool {
        !matches!(self, Self::Miss | Self::Lost | Self::Dropped)
    }
}

/// One return of a beam; ordered by LiDAR, channel, column, a second return after its first.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Return {
    /// Where it came from, in the ego frame at the scan's time, metres: the sensor's motion since is made up
    /// for. Not a number where there is no point.
    pub position: [f32; 3],
    /// Position without motion compensation: `range` metres along the beam of a sensor that still stands where
    /// it stood at the scan's time.
    pub raw: [f32; 3],
    /// Metres along the beam; not a number where there is no point.
    pub range: f32,
    /// Calibrated reflectivity, from 0 to 1.
    pub intensity: f32,
    /// Seconds since the scan's time.
    pub time: f32,
    /// Number of the LiDAR in the placement.
    pub lidar: u16,
    /// Channel of the LiDAR.
    pub channel: u16,
    /// Azimuth step of the channel.
    pub column: u32,
    /// Class of the surface that the point is counted as; [`NO_CLASS`] for fog, snow, rain, crosstalk and none.
    pub class: u16,
    /// Class of the surface that the beam meets in clear air; [`NO_CLASS`] if none.
    pub clean_class: u16,
    /// 1 + the number of the actor, [`NO_INSTANCE`] or [`EGO_INSTANCE`].
    pub instance: u16,
    /// Cosine of the angle of incidence on the surface, 0 to 1; 0 if none.
    pub incidence: f32,
    /// Source of the point, or why there is none.
    pub status: Status,
}

/// An actor's box in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackedBox {
    /// 1 + the number of the actor: the same in all frames.
    pub instance: u16,
    /// Name of the actor in the scene; may be empty.
    pub name: String,
    /// Kind of file.
    pub kind: ActorKind,
    /// Class of its first part.
    pub class: u16,
    /// Takes the box's frame (x forward, origin in its middle) to the ego frame.
    pub ego_from_box: Pose,
    /// Extents along its x, y and z in metres.
    pub size: DVec3,
    /// Velocity in the world frame, metres a second.
    pub velocity: DVec3,
    /// Points of the scan in the box, on any surface; points within [`BOX_MARGIN`] of it count.
    pub points: u32,
    /// Share of its hull that the rig sees, 0 to 1; none before [`Scanner::look_at_boxes`](super::Scanner::look_at_boxes).
    pub visible: Option<f32>,
}

/// A LiDAR as it stood at the time of a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanLidar {
    /// Name of its model; may be empty.
    pub model: String,
    /// Sensor pose: takes its frame to the ego frame.
    pub ego_from_sensor: Pose,
    /// Mount pose without the sensor's phase: constant over all frames.
    pub ego_from_mount: Pose,
    /// Channels; 1 of a list of directions.
    pub channels: u32,
    /// Azimuth steps of a channel.
    pub columns: u32,
    /// Range in metres.
    pub range: f32,
}

/// All that a rig saw in a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Name of the scene.
    pub scene: Arc<str>,
    /// Number of the frame in the scene.
    pub frame: usize,
    /// Seconds since frame 0: when the turn begins.
    pub time: f64,
    /// Class names; the index is the class.
    pub classes: Arc<[String]>,
    /// LiDARs in the order of the placement.
    pub lidars: Vec<ScanLidar>,
    /// Ego pose: takes the ego frame to the world frame.
    pub world_from_ego: Pose,
    /// Every beam.
    pub returns: Vec<Return>,
    /// Actors, as the scene lists them.
    pub boxes: Vec<TrackedBox>,
}

impl Scan {
    /// Beams that came back as points.
    pub fn points(&self) -> impl Iterator<Item = &Return> {
        self.returns.iter().filter(|beam| beam.status.is_point())
    }

    /// Counts the points in every box anew.
    pub(crate) fn count_points(&mut self) {
        let mut points = Vec::with_capacity(self.returns.len());
        points.extend(self.points().map(|beam| beam.position));
        let clusters: Vec<Cluster<'_>> = points.chunks(TOGETHER).map(Cluster::new).collect();
        self.boxes.par_iter_mut().for_each(|tracked| {
            let box_from_ego = tracked.ego_from_box.inverse();
            let half = tracked.size / 2.0 + BOX_MARGIN;
            let inside = |&point: &[f32; 3]| {
                let point = DVec3::from(point.map(f64::from));
                box_from_ego.apply(point).abs().cmple(half).all()
            };
            // Points outside the box's bounding sphere are dropped before the costlier turn into its frame.
            let reach = (half.length() + 1e-3) as f32;
            let middle = tracked.ego_from_box.translation.as_vec3().to_array();
            let clusters = clusters.iter().filter(|cluster| cluster.is_within(reach, middle));
            let near = clusters.flat_map(|cluster| cluster.points).filter(|&&[x, y, z]| {
                let (x, y, z) = (x - middle[0], y - middle[1], z - middle[2]);
                x * x + y * y + z * z <= reach * reach
            });
            tracked.points = near.filter(|point| inside(point)).count() as u32;
        });
    }
}

/// Points of a cluster.
const TOGETHER: usize = 32;

/// Points that follow one another: most lie side by side.
struct Cluster<'a> {
    points: &'a [[f32; 3]],
    low: [f32; 3],
    high: [f32; 3],
}

impl<'a> Cluster<'a> {
    fn new(points: &'a [[f32; 3]]) -> Self {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for point in points {
            for axis in 0..3 {
                (low[axis], high[axis]) = (low[axis].min(point[axis]), high[axis].max(point[axis]));
            }
        }
        Self { points, low, high }
    }

    /// True if its box comes as near to a place as `reach`.
    fn is_within(&self, reach: f32, place: [f32; 3]) -> bool {
        let beside = |axis: usize| {
            let place = place[axis];
            (self.low[axis] - place).max(place - self.high[axis]).max(0.0)
        };
        let [x, y, z] = [0, 1, 2].map(beside);
        x * x + y * y + z * z <= reach * reach
    }
}

/// Sample points along each edge of a face.
const SAMPLES: usize = 6;
/// Metres before a sample point within which nothing stands in its way.
const FREE: f64 = 0.01;

/// A LiDAR and the things around it.
pub(super) struct Viewpoint<'a> {
    pub ego_from_sensor: Pose,
    /// Metres.
    pub range: f32,
    /// Trees as it sees them; no rays.
    pub around: Firing<'a>,
}

impl Viewpoint<'_> {
    /// True if nothing but the actor of a number stands on the straight line to a point of the ego frame.
    fn sees(&self, stage: &Stage, point: DVec3, own: u16) -> bool {
        let at = self.ego_from_sensor.inverse().apply(point);
        let distance = at.length();
        if distance > f64::from(self.range) {
            return false;
        }
        let reach = (distance - FREE).max(0.0) as f32;
        let hit = self.around.closest_hit((at / distance).as_vec3().to_array(), reach);
        !hit.is_hit() || stage.things[stage.thing_of(hit.prim)].instance == own
    }
}

/// Share of a box's hull that a rig sees, 0 to 1, by area. Counted are points on faces that face some LiDAR: a point
/// is seen if one of these LiDARs sees it.
pub(super) fn seen_share(stage: &Stage, eyes: &[Viewpoint<'_>], tracked: &TrackedBox) -> f32 {
    let (half, own) = (tracked.size / 2.0, tracked.instance);
    let box_from_ego = tracked.ego_from_box.inverse();
    let places: Vec<DVec3> =
        eyes.iter().map(|eye| box_from_ego.apply(eye.ego_from_sensor.translation)).collect();
    let (mut all, mut seen) = (0.0, 0.0);
    for (axis, side) in (0..6).map(|face| (face / 2, [-1.0, 1.0][face % 2])) {
        let faces_it = |place: &DVec3| side * place[axis] > half[axis];
        let facing = || eyes.iter().zip(&places).filter(|(_, place)| faces_it(place));
        if facing().next().is_none() {
            continue;
        }
        let (across, up) = ((axis + 1) % 3, (axis + 2) % 3);
        let area = half[across] * half[up];
        let along = |k: usize| (2 * k + 1) as f64 / SAMPLES as f64 - 1.0;
        for k in 0..SAMPLES * SAMPLES {
            let mut point = DVec3::ZERO;
            point[axis] = side * half[axis];
            point[across] = along(k % SAMPLES) * half[across];
            point[up] = along(k / SAMPLES) * half[up];
            let point = tracked.ego_from_box.apply(point);
            all += area;
            if facing().any(|(eye, _)| eye.sees(stage, point, own)) {
                seen += area;
            }
        }
    }
    if all > 0.0 { (seen / all) as f32 } else { 0.0 }
}
