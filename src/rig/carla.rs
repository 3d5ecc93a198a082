//! The list that `sensors()` of a CARLA agent returns: left-handed, y to the right, in degrees.
//!
//! With y mirrored, CARLA's own signs of pitch and roll leave roll as it is; y, pitch, yaw and phase change sign.

use serde_json::{Map, Value, json};

use super::fields::{self, Fields};
use super::frames::{Frame, Frames, Holds};
use super::literal::{literal, skip_blank};
use super::{BASE_LINK, Fan, Mounting, Rig, RigError, RigLidar, Source, known};
use crate::json::Place;
use crate::vehicle::SensorPose;

/// Type of the LiDAR that CARLA casts.
pub(super) const LIDAR: &str = "sensor.lidar.ray_cast";

/// CARLA's six numbers of a pose of ours, angles in degrees; and ours of CARLA's.
pub(crate) fn mirrored(pose: &SensorPose, angle: impl Fn(f64) -> f64) -> SensorPose {
    SensorPose {
        x: pose.x,
        y: 0.0 - pose.y,
        z: pose.z,
        roll: angle(pose.roll),
        pitch: 0.0 - angle(pose.pitch),
        yaw: 0.0 - angle(pose.yaw),
        sensor: pose.sensor,
        phase: pose.phase.map(|phase| 0.0 - angle(phase)),
    }
}

/// Reads the first list of dictionaries, of JSON or Python.
pub(super) fn read(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    let top = Place::top(&source.file);
    let syntax =
        |problem| RigError::Syntax { at: Box::new(top.clone()), what: "list of sensors", problem };
    let is_list = |(at, _): &(usize, _)| skip_blank(&source.text[at + 1..]).starts_with('{');
    let start = source.text.match_indices('[').find(is_list);
    let (at, _) = start.ok_or_else(|| syntax("it has no `[ { … } ]`".to_owned()))?;
    let (list, _) = literal(&source.text[at..]).map_err(syntax)?;
    for (index, sensor) in list.as_array().into_iter().flatten().enumerate() {
        let fields = Fields::of(sensor, top.item(index))?;
        let holds = holds(&fields)?;
        // Cameras and the like may lack a pose.
        if holds != Holds::Other {
            let pose = mirrored(&fields.six_or_level()?, f64::to_radians);
            add(frames, &fields, pose, holds)?;
        }
    }
    Ok(())
}

/// What an entry says that it is.
pub(super) fn holds(fields: &Fields) -> Result<Holds, RigError> {
    if !fields.text("type")?.starts_with("sensor.lidar") {
        return Ok(Holds::Other);
    }
    let has_fan = ["channels", "lower_fov", "upper_fov"].iter().all(|key| fields.has(key));
    let sensor = if has_fan {
        let number = |key| fields.number(key);
        known::of_fan(number("channels")?, number("lower_fov")?, number("upper_fov")?)
    } else {
        None
    };
    Ok(Holds::Lidar { sensor, optical: None })
}

/// Adds an entry to `base_link`, under its `id`.
pub(super) fn add(
    frames: &mut Frames,
    fields: &Fields,
    pose: SensorPose,
    holds: Holds,
) -> Result<(), RigError> {
    let (name, at) = (fields.text("id")?.to_owned(), fields.at.clone());
    frames.add(Frame { name, parent: BASE_LINK.to_owned(), pose, holds, at })
}

/// The list as JSON, which is Python as well.
pub(super) fn write(
    rig: &Rig,
    mounting: &Mounting,
    fan: impl Fn(&RigLidar) -> Option<Fan>,
) -> Value {
    let entry = |lidar: &RigLidar| {
        let mut entry = Map::new();
        entry.insert("type".to_owned(), LIDAR.into());
        let pose = mirrored(&mounting.to_base(&lidar.pose), f64::to_degrees);
        entry.extend(fields::numbers(&pose));
        entry.insert("id".to_owned(), lidar.frame.as_str().into());
        entry.extend(fan(lidar).into_iter().flat_map(attributes));
        Value::Object(entry)
    };
    rig.lidars.iter().map(entry).collect()
}

/// What CARLA is told of a fan.
pub(super) fn attributes(fan: Fan) -> Map<String, Value> {
    let Fan { channels, lower, upper, range, points_a_second } = fan;
    let attributes = json!({
        "range": range, "channels": channels, "points_per_second": points_a_second,
        "upper_fov": upper, "lower_fov": lower, "rotation_frequency": Fan::RATE,
    });
    attributes.as_object().cloned().unwrap_or_default()
}
