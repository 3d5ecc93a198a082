//! CARLA: the list that `sensors()` of an agent returns, and `objects.json` of the ROS bridge.
//!
//! The list is left-handed, y to the right, in degrees. With y mirrored, CARLA's own signs of pitch and roll leave
//! roll as it is; y, pitch, yaw and phase change sign. The bridge has the axes of ROS, and angles in degrees.

use serde_json::{Map, Value, json};
use sightline_files::json::{Location, UniqueKeys, counted, written};
use sightline_files::{Note, json};
use sightline_scene::vehicle::{SensorPose, of_degrees};

use super::frames::{FrameContent, FrameTree, RigFrame};
use super::yaml::{Fields, PHASE, wrong};
use super::{
    BASE_LINK, Checked, Fan, FormatError, Models, Mounting, Rig, RigFormat, RigLidar, RigSource,
    beams, yaml,
};
use crate::error::listed;

/// Type of the LiDAR that CARLA casts.
const LIDAR: &str = "sensor.lidar.ray_cast";
/// Begin of the types of all LiDARs.
const ANY_LIDAR: &str = "sensor.lidar";
/// Attribute of a LiDAR that looks over a part of the turn, in degrees.
const HORIZONTAL: &str = "horizontal_fov";

/// Our pose in CARLA's six numbers, or the reverse: y, pitch and yaw change sign, `angle` converts the unit.
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
        rides_on: pose.rides_on,
    }
}

/// Key of the things that hang on an object or a sensor.
const ATTACHED: &str = "attached_objects";
/// Keys of a pose; in `objects.json` they stand in the [`SPAWN_POINT`] of a LiDAR.
const POSE: [&str; 7] = ["x", "y", "z", "roll", "pitch", "yaw", PHASE];
const SPAWN_POINT: &str = "spawn_point";
/// Keys of a LiDAR that are read beside its pose.
const READ: [&str; 6] = ["type", "id", "channels", "lower_fov", "upper_fov", SPAWN_POINT];
/// Keys passed over: they say how CARLA casts, not where the LiDAR stands.
#[rustfmt::skip]
const PASSED_OVER: [&str; 12] = [
    "range", "points_per_second", "rotation_frequency", "sensor_tick", "atmosphere_attenuation_rate",
    "dropoff_general_rate", "dropoff_intensity_limit", "dropoff_zero_intensity", "noise_stddev", "noise_seed",
    "role_name", ATTACHED,
];

/// The format of a text with CARLA's words: a document with `objects` is the bridge's, a list of sensors an agent's. Others
/// are told by the bridge's `spawn_point`.
pub(super) fn format_of(source: &RigSource) -> RigFormat {
    let has = |key: &str| source.text.contains(&format!("\"{key}\""));
    let is_objects = match json::parse(&source.text, &source.file) {
        Ok(UniqueKeys(document)) if document.get("objects").is_some() => true,
        Ok(UniqueKeys(Value::Array(_))) => false,
        Ok(UniqueKeys(document)) if document.get("sensors").is_some() => false,
        Ok(_) => has(SPAWN_POINT),
        // A text that is no JSON is told by its reader.
        Err(_) => has("objects") || has(SPAWN_POINT),
    };
    if is_objects { RigFormat::CarlaObjects } else { RigFormat::Carla }
}

pub(super) fn read(source: &RigSource, frames: &mut FrameTree) -> Checked<()> {
    let UniqueKeys(document) = json::parse(&source.text, &source.file)?;
    read_list(&document, &Location::top(&source.file), frames)
}

/// Reads a list of objects, or the object whose `sensors` it is.
pub(super) fn read_list(document: &Value, top: &Location, frames: &mut FrameTree) -> Checked<()> {
    let (list, at) = match document.get("sensors") {
        Some(list) => (list, top.key("sensors")),
        None => (document, top.clone()),
    };
    let list = list.as_array().ok_or_else(|| wrong(&at, list, "a list of sensors"))?;
    for (index, sensor) in list.iter().enumerate() {
        let fields = Fields::of_carla(sensor, at.item(index))?;
        doubt_attached(&fields, &INNER, frames);
        let holds = holds(&fields, frames)?;
        if holds == FrameContent::Other {
            leave_out(frames, &fields)?;
            continue;
        }
        if fields.has(SPAWN_POINT) {
            let mend = "write x, y, z, roll, pitch and yaw beside `type` and `id`";
            return Err(unread(&fields, SPAWN_POINT, "stands in a list of `sensors()`", mend));
        }
        let pose = mirrored(&degrees(&fields, frames)?, f64::to_radians);
        add(frames, &fields, pose, holds)?;
    }
    Ok(())
}

/// The pose in a list or in a [`SPAWN_POINT`], its angles in degrees; a missing angle is 0, as in CARLA.
fn degrees(fields: &Fields, frames: &mut FrameTree) -> Checked<SensorPose> {
    let degrees = fields.pose(3)?;
    let doubt = of_degrees("an angle", &degrees.values()[3..]);
    frames.notes.extend(doubt.map(|doubt| Note::doubt(format!("{}: {doubt}", fields.at))));
    Ok(degrees)
}

/// Error of a key of the pose that stands where none is read.
fn unread(fields: &Fields, key: &str, what: &'static str, mend: &'static str) -> FormatError {
    refused!("{}: {what}, which is not read; {mend}", fields.at.key(key))
}

/// Content of an entry by its type. Notes name the LiDAR keys that a placement does not keep.
pub(super) fn holds(fields: &Fields, frames: &mut FrameTree) -> Checked<FrameContent> {
    if !fields.text("type")?.starts_with(ANY_LIDAR) {
        return Ok(FrameContent::Other);
    }
    let angle = if fields.has(HORIZONTAL) { fields.number(HORIZONTAL)? } else { 360.0 };
    let is_whole = angle >= 360.0;
    if !is_whole {
        frames.notes.push(Note::fact(format!(
            "{}: `{HORIZONTAL}` {angle} is not kept in a placement; name a model of that field of view \
             with --sensor",
            fields.at
        )));
    }
    let known = |key: &str| {
        key == HORIZONTAL
            || [&POSE[..], &READ[..], &PASSED_OVER[..]].iter().any(|keys| keys.contains(&key))
    };
    // A key of the pose in other letters would be passed over, and the pose be another.
    let posed = |key: &&String| SensorPose::FIELDS.contains(&key.to_lowercase().as_str());
    if let Some(key) = fields.each().map(|(key, ..)| key).filter(|key| !known(key)).find(posed) {
        return Err(wrong(&fields.at.key(key), key, "its name in small letters"));
    }
    let unknown: Vec<String> =
        fields.each().filter(|(key, ..)| !known(key)).map(|(key, ..)| format!("`{key}`")).collect();
    if !unknown.is_empty() {
        let text = format!("{}: passed over, not being known: {}", fields.at, unknown.join(", "));
        frames.notes.push(Note::fact(text));
    }
    let has_fan = ["channels", "lower_fov", "upper_fov"].iter().all(|key| fields.has(key));
    let sensor = if has_fan && is_whole {
        let number = |key| fields.number(key);
        beams::of_fan(number("channels")?, number("lower_fov")?, number("upper_fov")?)
    } else {
        None
    };
    Ok(FrameContent::Lidar { sensor, optical: None })
}

/// Leaves out an entry that is no LiDAR. Cameras and the like may lack a pose, and an `id`.
fn leave_out(frames: &mut FrameTree, fields: &Fields) -> Checked<()> {
    let name = fields.text("id").or_else(|_| fields.text("type"))?;
    frames.left_out.push(name.to_owned());
    Ok(())
}

/// Keys of lists whose objects hang on a sensor.
const INNER: [&str; 2] = ["sensors", ATTACHED];

/// A doubt about LiDARs that hang on an entry under one of `keys`, at any depth: their poses count from it, and are not read.
fn doubt_attached(fields: &Fields, keys: &[&str], frames: &mut FrameTree) {
    for key in keys.iter().filter(|key| fields.has(key)) {
        let mut names = Vec::new();
        fields.value(key).iter().for_each(|list| lidars_in(list, &mut names));
        if names.is_empty() {
            continue;
        }
        let (count, at) = (counted(names.len(), "LiDAR"), fields.at.key(key));
        frames.notes.push(Note::doubt(format!(
            "{at}: {count} left out, as nothing there is read: {}; write each beside the other sensors, with its pose on \
             the vehicle",
            listed(&names)
        )));
        frames.left_out.extend(names);
    }
}

/// Names of the LiDARs in a list of objects, and in objects attached to them.
fn lidars_in(list: &Value, names: &mut Vec<String>) {
    for object in list.as_array().into_iter().flatten() {
        let text = |key: &str| object.get(key).and_then(Value::as_str);
        if let Some(kind) = text("type").filter(|kind| kind.starts_with(ANY_LIDAR)) {
            names.push(text("id").unwrap_or(kind).to_owned());
        }
        let inner = INNER.into_iter().filter_map(|key| object.get(key));
        inner.for_each(|inner| lidars_in(inner, names));
    }
}

/// Adds an entry to `base_link`, under its `id`.
fn add(
    frames: &mut FrameTree,
    fields: &Fields,
    pose: SensorPose,
    holds: FrameContent,
) -> Checked<()> {
    let (name, at) = (fields.text("id")?.to_owned(), fields.at.clone());
    frames.add(RigFrame { name, parent: BASE_LINK.to_owned(), pose, holds, at })
}

pub(super) fn write(rig: &Rig, mounting: &Mounting, models: &Models) -> Value {
    let entry = |lidar: &RigLidar| {
        let mut entry = Map::new();
        entry.insert("type".to_owned(), LIDAR.into());
        let pose = mirrored(&mounting.to_base(&lidar.pose), f64::to_degrees);
        entry.extend(yaml::pose_entries(&pose));
        entry.insert("id".to_owned(), lidar.frame.as_str().into());
        entry.extend(attributes(models.fan(lidar)));
        Value::Object(entry)
    };
    rig.lidars.iter().map(entry).collect()
}

/// Attributes of a LiDAR: its fan where it is known, and no beams lost by chance or intensity.
fn attributes(fan: Option<Fan>) -> Map<String, Value> {
    let mut attributes = Map::new();
    if let Some(fan) = fan {
        let points = fan.points_a_second();
        attributes.insert("range".to_owned(), written(fan.range).into());
        attributes.insert("channels".to_owned(), fan.channels.into());
        attributes.insert("points_per_second".to_owned(), points.into());
        attributes.insert("upper_fov".to_owned(), written(fan.upper).into());
        attributes.insert("lower_fov".to_owned(), written(fan.lower).into());
        attributes.insert(HORIZONTAL.to_owned(), written(fan.horizontal()).into());
        attributes.insert("rotation_frequency".to_owned(), written(fan.rate).into());
    }
    // CARLA's defaults lose 45 % of the points by chance, and more by intensity.
    let lossy =
        PASSED_OVER.iter().filter(|key| key.starts_with("dropoff") || **key == "noise_stddev");
    for &key in lossy {
        attributes.insert(key.to_owned(), 0.0.into());
    }
    attributes
}

/// Vehicle of the bridge's own example.
const VEHICLE: &str = "vehicle.tesla.model3";

pub(super) fn turned(pose: SensorPose, angle: impl Fn(f64) -> f64) -> SensorPose {
    let [roll, pitch, yaw] = [pose.roll, pose.pitch, pose.yaw].map(&angle);
    SensorPose { roll, pitch, yaw, phase: pose.phase.map(angle), ..pose }
}

/// Reads the sensors of the only vehicle that has LiDARs.
pub(super) fn read_objects(source: &RigSource, frames: &mut FrameTree) -> Checked<()> {
    let UniqueKeys(document) = json::parse(&source.text, &source.file)?;
    let top = Fields::of_carla(&document, Location::top(&source.file))?;
    let mut vehicle = None;
    for object in items(&top, "objects")? {
        doubt_attached(&object, &[ATTACHED], frames);
        if !object.has("sensors") {
            if object.text("type").is_ok_and(|kind| kind.starts_with(ANY_LIDAR)) {
                frames.notes.push(Note::doubt(format!(
                    "{}: a LiDAR beside the vehicles stands in the world and is left out; write it into the \
                     `sensors` of its vehicle",
                    object.at
                )));
                leave_out(frames, &object)?;
            }
            continue;
        }
        let kind = object.text("type").unwrap_or_default();
        let is_walker = kind.starts_with("walker.");
        for sensor in items(&object, "sensors")? {
            doubt_attached(&sensor, &INNER, frames);
            let holds = holds(&sensor, frames)?;
            if holds == FrameContent::Other {
                leave_out(frames, &sensor)?;
                continue;
            }
            if is_walker && vehicle.is_none() {
                let told =
                    format!("{}: the LiDARs hang on a `{kind}`, which is no vehicle", object.at);
                frames.notes.push(Note::doubt(told));
            }
            if *vehicle.get_or_insert_with(|| object.at.clone()) != object.at {
                let other = "a LiDAR of another vehicle";
                return Err(wrong(&sensor.at, other, "one of the first one"));
            }
            if let Some(key) = POSE.into_iter().find(|key| sensor.has(key)) {
                let what = "stands beside a `spawn_point`";
                return Err(unread(&sensor, key, what, "move it into the `spawn_point`"));
            }
            let spawn_point = sensor.inner(SPAWN_POINT)?;
            spawn_point.refuse_others(&POSE, &[])?;
            let pose = turned(degrees(&spawn_point, frames)?, f64::to_radians);
            add(frames, &sensor, pose, holds)?;
        }
    }
    Ok(())
}

/// The objects of the list under a key.
fn items<'a>(fields: &Fields<'a>, key: &str) -> Checked<Vec<Fields<'a>>> {
    let (value, at) = (fields.value(key)?, fields.at.key(key));
    let list = value.as_array().ok_or_else(|| wrong(&at, value, "a list"))?;
    list.iter().enumerate().map(|(index, item)| Fields::of_carla(item, at.item(index))).collect()
}

pub(super) fn write_objects(rig: &Rig, mounting: &Mounting, models: &Models) -> Value {
    let sensor = |lidar: &RigLidar| {
        let pose = turned(mounting.to_base(&lidar.pose), f64::to_degrees);
        // The bridge passes every other key of a sensor to CARLA, which refuses unknown keys.
        let spawn_point: Map<String, Value> = yaml::pose_entries(&pose).collect();
        let mut sensor = Map::new();
        sensor.insert("type".to_owned(), LIDAR.into());
        sensor.insert("id".to_owned(), lidar.frame.as_str().into());
        sensor.insert(SPAWN_POINT.to_owned(), spawn_point.into());
        sensor.extend(attributes(models.fan(lidar)));
        Value::Object(sensor)
    };
    let sensors: Vec<Value> = rig.lidars.iter().map(sensor).collect();
    json!({ "objects": [{ "type": VEHICLE, "id": "ego_vehicle", "sensors": sensors }] })
}
