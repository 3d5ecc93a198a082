//! Roll, pitch and yaw of rotations.

use glam::DMat3;

use super::SensorPose;
use crate::geom::Pose;
use crate::maths;

/// Cosine of the pitch below which roll and yaw turn about the same axis.
const GIMBAL_LOCK: f64 = 1e-12;

impl From<&Pose> for SensorPose {
    /// Six numbers of a transform, of the vehicle's first model.
    fn from(pose: &Pose) -> Self {
        let [x, y, z] = pose.translation.to_array();
        let [roll, pitch, yaw] = angles(&pose.rotation);
        Self::from_values([x, y, z, roll, pitch, yaw])
    }
}

/// Roll, pitch and yaw of `Rz(yaw)·Ry(pitch)·Rx(roll)`; at a pitch of ±π/2 roll is 0 and yaw takes all.
fn angles(rotation: &DMat3) -> [f64; 3] {
    let at = |row: usize, column: usize| rotation.col(column)[row];
    let level = maths::hypot(at(0, 0), at(1, 0));
    // The arc sine would lose half of the digits near ±π/2.
    let pitch = maths::atan2(0.0 - at(2, 0), level);
    if level < GIMBAL_LOCK {
        return [0.0, pitch, maths::atan2(0.0 - at(0, 1), at(1, 1))];
    }
    let yaw = maths::atan2(at(1, 0), at(0, 0));
    // Taken from what the yaw leaves: near ±π/2 both are uncertain, and so they make good for each other.
    let (sin, cos) = maths::sin_cos(yaw);
    let roll = maths::atan2(sin * at(0, 2) - cos * at(1, 2), cos * at(1, 1) - sin * at(0, 1));
    [roll, pitch, yaw]
}
