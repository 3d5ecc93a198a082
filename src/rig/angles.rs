//! Roll, pitch and yaw of rotations, and six-number poses put one behind the other, in `f64`.

use glam::{DMat3, DQuat, DVec3};

use crate::geom::Pose;
use crate::vehicle::SensorPose;

/// Cosine of the pitch below which roll and yaw turn about the same axis.
const GIMBAL_LOCK: f64 = 1e-12;

/// The pose that changes nothing.
pub(super) const IDENTITY: SensorPose = SensorPose::from_values([0.0; 6]);

/// Roll, pitch and yaw of `Rz(yaw)·Ry(pitch)·Rx(roll)`; at a pitch of ±π/2 roll is 0 and yaw takes all.
pub(super) fn angles(rotation: &DMat3) -> [f64; 3] {
    let at = |row: usize, column: usize| rotation.col(column)[row];
    let level = at(0, 0).hypot(at(1, 0));
    // The arc sine would lose half of the digits near ±π/2.
    let pitch = (0.0 - at(2, 0)).atan2(level);
    if level < GIMBAL_LOCK {
        return [0.0, pitch, (0.0 - at(0, 1)).atan2(at(1, 1))];
    }
    let yaw = at(1, 0).atan2(at(0, 0));
    // Taken from what the yaw leaves: near ±π/2 both are uncertain, and so they make good for each other.
    let (sin, cos) = yaw.sin_cos();
    let roll = (sin * at(0, 2) - cos * at(1, 2)).atan2(cos * at(1, 1) - sin * at(0, 1));
    [roll, pitch, yaw]
}

/// Six numbers of a transform.
pub(super) fn six_numbers(pose: &Pose) -> SensorPose {
    let [x, y, z] = pose.translation.to_array();
    let [roll, pitch, yaw] = angles(&pose.rotation);
    SensorPose::from_values([x, y, z, roll, pitch, yaw])
}

/// Pose of a position and a quaternion of any length above 0; `None` without a rotation.
pub(super) fn of_quaternion(position: [f64; 3], xyzw: [f64; 4]) -> Option<SensorPose> {
    let largest = xyzw.into_iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    // A maximum passes over what is no number.
    if largest == 0.0 || xyzw.iter().any(|v| !v.is_finite()) {
        return None;
    }
    // Scaled first, so that no square overflows or vanishes.
    let unit = DQuat::from_array(xyzw.map(|v| v / largest)).normalize();
    let rotation = DMat3::from_quat(unit);
    Some(six_numbers(&Pose { rotation, translation: DVec3::from(position) }))
}

/// `a_from_c` of `a_from_b` and `b_from_c`. Angles that need no computing stay as written.
pub(super) fn compose(outer: &SensorPose, inner: &SensorPose) -> SensorPose {
    let turns = |pose: &SensorPose| [pose.roll, pose.pitch, pose.yaw] != [0.0; 3];
    let product = outer.ego_from_sensor().compose(&inner.ego_from_sensor());
    let [x, y, z] = product.translation.to_array();
    let [roll, pitch, yaw] = match (turns(outer), turns(inner)) {
        (false, _) => [inner.roll, inner.pitch, inner.yaw],
        (true, false) => [outer.roll, outer.pitch, outer.yaw],
        (true, true) => angles(&product.rotation),
    };
    SensorPose::from_values([x, y, z, roll, pitch, yaw])
}

/// `b_from_a` of `a_from_b`.
pub(super) fn inverse(pose: &SensorPose) -> SensorPose {
    six_numbers(&pose.ego_from_sensor().inverse())
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
    2.0 * half_sine.min(1.0).asin()
}

/// Angle between two directions of unit length, in radians.
pub(super) fn tilt(a: DVec3, b: DVec3) -> f64 {
    2.0 * (a.distance(b) / 2.0).min(1.0).asin()
}
