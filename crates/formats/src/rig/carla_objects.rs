//! `objects.json` of the CARLA ROS bridge: axes of ROS, angles in degrees.

use serde_json::{Map, Value, json};

use super::fields::{self, Fields, wrong};
use super::frames::{Frames, Holds};
use super::{Fan, Mounting, Rig, RigError, RigLidar, Source, carla};
use sightline_files::json::{self, Place};
use sightline_scene::vehicle::SensorPose;

/// Vehicle of the bridge's own example.
const VEHICLE: &str = "vehicle.tesla.model3";

fn turned(pose: SensorPose, angle: impl Fn(f64) -> f64) -> SensorPose {
    let [roll, pitch, yaw] = [pose.roll, pose.pitch, pose.yaw].map(&angle);
    SensorPose { roll, pitch, yaw, phase: pose.phase.map(angle), ..pose }
}

/// Reads the sensors of the only vehicle that has LiDARs.
pub(super) fn read(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    let document: Value = json::parse(&source.text, &source.file)?;
    let top = Fields::of(&document, Place::top(&source.file))?;
    let mut vehicle = None;
    for object in items(&top, "objects")? {
        if !object.has("sensors") {
            continue;
        }
        for sensor in items(&object, "sensors")? {
            let holds = carla::holds(&sensor, frames)?;
            if holds == Holds::Other {
                carla::leave_out(frames, &sensor)?;
                continue;
            }
            if *vehicle.get_or_insert_with(|| object.at.clone()) != object.at {
                return Err(wrong(
                    &sensor.at,
                    "a LiDAR of another vehicle",
                    "one of the first one",
                ));
            }
            let pose = turned(sensor.inner("spawn_point")?.six_or_level()?, f64::to_radians);
            carla::add(frames, &sensor, pose, holds)?;
        }
    }
    Ok(())
}

/// The objects of the list under a key.
fn items<'a>(fields: &Fields<'a>, key: &str) -> Result<Vec<Fields<'a>>, RigError> {
    let (value, at) = (fields.value(key)?, fields.at.key(key));
    let list = value.as_array().ok_or_else(|| wrong(&at, value, "a list"))?;
    list.iter().enumerate().map(|(index, item)| Fields::of(item, at.item(index))).collect()
}

/// One vehicle with its LiDARs.
pub(super) fn write(
    rig: &Rig,
    mounting: &Mounting,
    fan: impl Fn(&RigLidar) -> Option<Fan>,
) -> Value {
    let sensor = |lidar: &RigLidar| {
        let pose = turned(mounting.to_base(&lidar.pose), f64::to_degrees);
        // The bridge passes every other key of a sensor to CARLA, which refuses unknown keys.
        let spawn_point: Map<String, Value> = fields::numbers(&pose).collect();
        let mut sensor = Map::new();
        sensor.insert("type".to_owned(), carla::LIDAR.into());
        sensor.insert("id".to_owned(), lidar.frame.as_str().into());
        sensor.insert("spawn_point".to_owned(), spawn_point.into());
        sensor.extend(carla::attributes(fan(lidar)));
        Value::Object(sensor)
    };
    let sensors: Vec<Value> = rig.lidars.iter().map(sensor).collect();
    json!({ "objects": [{ "type": VEHICLE, "id": "ego_vehicle", "sensors": sensors }] })
}
