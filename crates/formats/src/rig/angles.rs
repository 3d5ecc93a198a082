//! Six-number poses put one behind the other, and angles between them, in `f64`.

use glam::{DMat3, DQuat, DVec3};

use super::RigError;
use super::fields::wrong;
use lidar_cast::geom::Pose;
use lidar_cast::maths;
use sightline_files::json::Place;
use sightline_scene::vehicle::SensorPose;

/// The pose that changes nothing.
pub(super) const IDENTITY: SensorPose = SensorPose::from_values([0.0; 6]);

/// Largest distance of a quaternion's squared length from 1; tf2 leaves out transforms beyond it.
const LENGTH_TOLERANCE: f64 = 1e-2;

/// Pose of a position and a quaternion x, y, z, w. One of another length than 1 is most likely four other numbers, and an error
/// at `at`.
pub(super) fn of_quaternion(
    position: [f64; 3],
    xyzw: [f64; 4],
    at: &Place,
) -> Result<SensorPose, RigError> {
    let square: f64 = xyzw.iter().map(|v| v * v).sum();
    // NaN is within no tolerance.
    let is_unit = (square - 1.0).abs() <= LENGTH_TOLERANCE;
    if !is_unit {
        let length = format!("a quaternion of length {}", square.sqrt());
        return Err(wrong(at, length, "a quaternion of length 1"));
    }
    let rotation = DMat3::from_quat(DQuat::from_array(xyzw).normalize());
    Ok(SensorPose::from(&Pose { rotation, translation: DVec3::from(position) }))
}

/// `a_from_c` of `a_from_b` and `b_from_c`. Angles that need no computing stay as written.
pub(super) fn compose(outer: &SensorPose, inner: &SensorPose) -> SensorPose {
    let turns = |pose: &SensorPose| [pose.roll, pose.pitch, pose.yaw] != [0.0; 3];
    let product = outer.ego_from_sensor().compose(&inner.ego_from_sensor());
    let pose = SensorPose::from(&product);
    let [roll, pitch, yaw] = match (turns(outer), turns(inner)) {
        (false, _) => [inner.roll, inner.pitch, inner.yaw],
        (true, false) => [outer.roll, outer.pitch, outer.yaw],
        (true, true) => return pose,
    };
    SensorPose { roll, pitch, yaw, ..pose }
}

/// `b_from_a` of `a_from_b`.
pub(super) fn inverse(pose: &SensorPose) -> SensorPose {
    SensorPose::from(&pose.ego_from_sensor().inverse())
}

/// A point up a sensor's own z, in its frame.
pub(super) fn up(height: f64) -> SensorPose {
    SensorPose { z: height, ..IDENTITY }
}

/// Angle between two rotations, in radians.
pub(super) fn turn(a: &DMat3, b: &DMat3) -> f64 {
    // |A − B|² = 8 sin²(angle/2): exact for small angles, where the arc cosine is not.
    let columns = (0..3).map(|k| a.col(k).distance_squared(b.col(k)));
    let half_sine = (columns.sum::<f64>() / 8.0).sqrt();
    2.0 * maths::asin(half_sine.min(1.0))
}

/// Angle between two directions of unit length, in radians.
pub(super) fn tilt(a: DVec3, b: DVec3) -> f64 {
    2.0 * maths::asin((a.distance(b) / 2.0).min(1.0))
}
