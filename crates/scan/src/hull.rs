//! How much of a box's hull the LiDARs of a rig see.

use glam::DVec3;

use super::TrackedBox;
use super::stage::Stage;
use lidar_cast::cast::Firing;
use lidar_cast::geom::Pose;

/// Sample points along each edge of a face.
const SAMPLES: usize = 6;
/// Metres before a sample point within which nothing stands in its way.
const FREE: f64 = 0.01;

/// A LiDAR and the things around it.
pub(super) struct Eye<'a> {
    pub ego_from_sensor: Pose,
    /// Metres.
    pub range: f32,
    /// Trees as it sees them; no rays.
    pub around: Firing<'a>,
}

impl Eye<'_> {
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
pub(super) fn seen_share(stage: &Stage, eyes: &[Eye<'_>], tracked: &TrackedBox) -> f32 {
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
