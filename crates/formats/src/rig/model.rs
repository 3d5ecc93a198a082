//! The rig: LiDARs by name on one vehicle, read from and written to placements of this program.

use std::collections::HashSet;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{RigError, RigSource};
use sightline_files::json::{self, Place};
use sightline_scene::vehicle::{
    Placement, SensorName, SensorPose, Vehicle, placement_to_nanometres,
};

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

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RigFile {
    placements: Vec<Placement>,
}

/// Reads one placement of a file; where the file holds several, `name` picks it.
///
/// # Errors
/// A file that cannot be read, or none or several placements to pick from.
pub fn read_rig(path: &Path, name: Option<&str>) -> Result<Rig, RigError> {
    rig_of(&RigSource::read(path)?, name)
}

/// Reads one placement of a text, a document or one placement a line.
pub(super) fn rig_of(source: &RigSource, name: Option<&str>) -> Result<Rig, RigError> {
    let RigSource { file, text } = source;
    let mut all = if file.ends_with(".jsonl") {
        let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
        let parse = |(number, line)| json::parse(line, &format!("{file}, line {}", number + 1));
        lines.map(parse).collect::<Result<Vec<Placement>, _>>()?
    } else {
        json::parse::<RigFile>(text, file)?.placements
    };
    let picked = match name {
        Some(name) => all.iter().position(|placement| placement.name == name),
        None => (all.len() == 1).then_some(0),
    };
    let Some(picked) = picked else {
        if all.is_empty() {
            let at = Box::new(Place::top(file));
            return Err(RigError::Missing { at, key: "a placement".to_owned() });
        }
        return Err(RigError::PickPlacement {
            file: file.clone(),
            name: name.map(str::to_owned),
            known: all.into_iter().map(|placement| placement.name).collect(),
        });
    };
    let Placement { name, lidars } = all.swap_remove(picked);
    let lidar = |(index, pose): (usize, SensorPose)| RigLidar {
        frame: default_frame(index),
        sensor: (!pose.sensor.is_none()).then(|| pose.sensor.to_string()),
        pose: SensorPose { sensor: SensorName::default(), ..pose },
    };
    let rig = Rig { name, lidars: lidars.into_iter().enumerate().map(lidar).collect() };
    rig.validate()?;
    Ok(rig)
}

/// The placements file of rigs, with numbers of at most nine digits.
pub fn rig_json(rigs: &[&Rig]) -> Value {
    let written = rigs.iter().map(|rig| placement_to_nanometres(&rig.placement()));
    serde_json::json!(RigFile { placements: written.collect() })
}
