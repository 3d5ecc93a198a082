//! The rig: LiDARs by name on one vehicle.

use std::collections::HashSet;

use super::RigError;
use sightline_scene::vehicle::{Placement, SensorName, SensorPose, Vehicle};

/// Name that ROS gives the frame of a vehicle.
pub const BASE_LINK: &str = "base_link";
/// Longest name of a frame or sensor, in bytes.
const MAX_FRAME: usize = 128;

/// The LiDARs of one vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Name of the placement: 1 to 64 letters, digits, `.`, `_`, `-`.
    pub name: String,
    /// 1 to 16 LiDARs, in the order of the file.
    pub lidars: Vec<RigLidar>,
}

/// One LiDAR of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct RigLidar {
    /// Name of its frame, once in a rig; no spaces or control characters.
    pub frame: String,
    /// Sensor model, as `VLP-16`, where it is known.
    pub sensor: Option<String>,
    /// Optical centre in the ego frame.
    pub pose: SensorPose,
}

impl Rig {
    /// The rig as a placement, without the names of frames.
    pub fn placement(&self) -> Placement {
        let lidar = |lidar: &RigLidar| {
            let sensor = lidar.sensor.as_deref().and_then(|name| SensorName::new(name).ok());
            SensorPose { sensor: sensor.unwrap_or_default(), ..lidar.pose }
        };
        Placement { name: self.name.clone(), lidars: self.lidars.iter().map(lidar).collect() }
    }

    /// Names frames after the mounts of a vehicle that hold them: `roof_lidar`, with a number behind where a mount holds
    /// several. Readers know a LiDAR by that word. A LiDAR on no mount keeps its frame.
    pub fn name_by_mounts(&mut self, vehicle: &Vehicle) {
        let poses: Vec<SensorPose> = self.lidars.iter().map(|lidar| lidar.pose).collect();
        let plain = |c: char| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '_' };
        let plain = |name: &str| name.chars().map(plain).collect::<String>();
        let mounts: Vec<Option<String>> =
            vehicle.mount_names(&poses).into_iter().map(|name| name.map(plain)).collect();
        for (index, mount) in mounts.iter().enumerate() {
            let Some(name) = mount else { continue };
            let alike = |lidars: &[Option<String>]| lidars.iter().filter(|m| *m == mount).count();
            self.lidars[index].frame = match alike(&mounts) {
                1 => format!("{name}_lidar"),
                _ => format!("{name}_lidar_{}", alike(&mounts[..index])),
            };
        }
    }

    /// Checks the name, the number of LiDARs, their frames and every number.
    ///
    /// # Errors
    /// The first fault found.
    pub fn validate(&self) -> Result<(), RigError> {
        self.placement().validate()?;
        let mut names = HashSet::from([BASE_LINK]);
        // Characters that XML cannot hold, escaped or not.
        let unwritable = |c: char| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}');
        for RigLidar { frame, sensor, .. } in &self.lidars {
            if let Some(name) = sensor
                && (name.trim().is_empty() || name.len() > MAX_FRAME || name.contains(unwritable))
            {
                return Err(RigError::BadSensor { sensor: name.clone(), most: MAX_FRAME });
            }
            let odd = |c: char| c.is_whitespace() || unwritable(c);
            if frame.is_empty() || frame.len() > MAX_FRAME || frame.contains(odd) {
                return Err(RigError::BadFrame { frame: frame.clone(), most: MAX_FRAME });
            }
            if !names.insert(frame) {
                return Err(RigError::SharedFrame { frame: frame.clone() });
            }
        }
        Ok(())
    }
}

/// Frame of a LiDAR without a name.
pub fn default_frame(index: usize) -> String {
    format!("lidar_{index}")
}
