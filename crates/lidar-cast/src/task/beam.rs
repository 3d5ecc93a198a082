//! Direction and origin of a beam in the ego frame.

use glam::Vec3;

use super::{DevicePose, TINY_COMPONENT};

/// Direction of a beam in the ego frame: the table's direction turned by the pose.
///
/// Products are added from left to right, as the shader does; components that move a beam by less
/// than a micrometre in a kilometre become zero, so that a level beam stays level.
pub fn beam_direction(pose: &DevicePose, direction: [f32; 3]) -> Vec3 {
    let [x, y, z] = direction;
    Vec3::from(pose.rows.map(|row| {
        let d = row[0] * x + row[1] * y + row[2] * z;
        if d.abs() < TINY_COMPONENT { 0.0 } else { d }
    }))
}

/// Position of the sensor in metres.
pub fn beam_origin(pose: &DevicePose) -> Vec3 {
    Vec3::from(pose.rows.map(|row| row[3]))
}
