//! Rigs in YAML: Autoware's pair of files, static transforms of ROS, and PandaSet's extrinsics.
//!
//! - Autoware: `base_link` holds the sensor kit, and the kit holds the sensors.
//! - Transforms of ROS 1 and ROS 2, as `ros2 topic echo /tf_static` prints them.
//! - PandaSet's `static_extrinsic_calibration`: quaternions in the frame of the LiDAR on the roof.

use serde_json::Value;

use super::fields::{self, Fields, wrong};
use super::frames::{FrameContent, FrameTree, RigFrame, of_quaternion};
use super::{BASE_LINK, Mounting, NamedText, Rig, RigError, RigSource};
use sightline_files::Note;
use sightline_files::json::Location;
use sightline_scene::vehicle::SensorPose;

/// Frame of Autoware's sensor kit.
const KIT: &str = "sensor_kit_base_link";

/// Keys of a frame that are passed over: they say which sensor it is, and where its data go.
const AUTOWARE_PASSED: [&str; 12] = [
    "comment",
    "description",
    "frame_id",
    "manufacturer",
    "model",
    "name",
    "sensor_model",
    "sensor_type",
    "serial_number",
    "topic",
    "type",
    "vendor",
];

/// True if a value is a frame: it has at least one of the six numbers.
fn is_frame(value: &Value) -> bool {
    SensorPose::FIELDS.iter().any(|field| value.get(field).is_some())
}

/// True if a document holds frames in frames.
pub(super) fn holds_frames(document: &Value) -> bool {
    let inside = |value: &Value| value.as_object().is_some_and(|map| map.values().any(is_frame));
    document.as_object().is_some_and(|map| map.values().any(inside))
}

/// Reads each frame in each frame of a file.
pub(super) fn read_autoware(source: &RigSource, frames: &mut FrameTree) -> Result<(), RigError> {
    let document = source.yaml()?;
    let top = Location::top(&source.file);
    read_frames(&document.value, top, frames).map_err(|error| error.at_line(&document))
}

fn read_frames(document: &Value, top: Location, frames: &mut FrameTree) -> Result<(), RigError> {
    let read: Vec<&str> = SensorPose::FIELDS.into_iter().chain([fields::PHASE]).collect();
    for (parent, children, at) in Fields::of(document, top)?.each() {
        let Some(map) = children.as_object().filter(|map| map.values().any(is_frame)) else {
            let text = format!("{at}: holds no frame with x, y, z, roll, pitch and yaw; not read");
            // Objects in an object may be frames of other keys.
            let inside = children.as_object().is_some_and(|map| map.values().any(Value::is_object));
            frames.notes.push(if inside { Note::doubt(text) } else { Note::fact(text) });
            continue;
        };
        for (name, value) in map {
            let at = at.key(name);
            let fields = Fields::of(value, at.clone())?;
            fields.refuse_others(&read, &AUTOWARE_PASSED)?;
            let (name, parent, pose) = (name.clone(), parent.clone(), fields.six()?);
            frames.add(RigFrame { name, parent, pose, holds: FrameContent::Unsaid, at })?;
        }
    }
    Ok(())
}

/// The pair: the kit stands at `base_link`, all LiDARs on the kit.
pub(super) fn write_autoware(rig: &Rig, mounting: &Mounting) -> Vec<NamedText> {
    let frame = |name: &str, pose: &SensorPose| {
        let number = |(key, value)| format!("    {key}: {}\n", decimal(value));
        let numbers: String = fields::named(pose).map(number).collect();
        format!("  {}:\n{numbers}", key(name))
    };
    let kit = format!("{BASE_LINK}:\n{}", frame(KIT, &super::frames::IDENTITY));
    let mut sensors = format!("{KIT}:\n");
    for lidar in &rig.lidars {
        let (foot, _) = mounting.foot(&lidar.frame, lidar.sensor.as_deref(), &lidar.pose);
        sensors += &frame(&lidar.frame, &foot);
    }
    vec![
        NamedText { name: "sensors_calibration.yaml".to_owned(), text: kit },
        NamedText { name: "sensor_kit_calibration.yaml".to_owned(), text: sensors },
    ]
}

/// A number that YAML 1.1 takes for one: with a point, also before an exponent.
fn decimal(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((digits, power)) => {
            let point = if digits.contains('.') { "" } else { ".0" };
            let sign = if power.starts_with('-') { "" } else { "+" };
            format!("{digits}{point}e{sign}{power}")
        }
        None => text,
    }
}

/// A key; in quotes where some YAML reader would take it for a number, a truth value or a sign.
fn key(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_/.-".contains(c);
    let is_plain = name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.contains('_')
        && name.chars().all(plain);
    if is_plain { name.to_owned() } else { Value::from(name).to_string() }
}

/// Key of a message's list of transforms.
const LIST: &str = "transforms";
/// Key that a transform has, and nothing else.
const CHILD: &str = "child_frame_id";
/// Keys of a header that are passed over: a static transform holds at all times.
const PASSED_HEADER: [&str; 2] = ["seq", "stamp"];

/// True if a document is a message of transforms, a list of them, or one.
pub(super) fn holds_transforms(document: &Value) -> bool {
    let is_one = |value: &Value| value.get(CHILD).is_some();
    let any = |list: &Value| list.as_array().is_some_and(|list| list.iter().any(is_one));
    is_one(document) || any(document) || document.get(LIST).is_some_and(any)
}

/// Reads the transforms of every document.
pub(super) fn read_transforms(source: &RigSource, frames: &mut FrameTree) -> Result<(), RigError> {
    for document in source.documents()? {
        let top = Location::top(&source.file);
        read_message(&document.value, top, frames).map_err(|error| error.at_line(&document))?;
    }
    Ok(())
}

fn read_message(message: &Value, at: Location, frames: &mut FrameTree) -> Result<(), RigError> {
    if message.get(CHILD).is_some() {
        return add(transform(message, at)?, frames);
    }
    let (list, at) = if message.is_array() {
        (message, at)
    } else {
        let fields = Fields::of(message, at.clone())?;
        fields.refuse_others(&[LIST], &[])?;
        (fields.value(LIST)?, at.key(LIST))
    };
    let Some(list) = list.as_array() else {
        return Err(wrong(&at, list, "a list of transforms"));
    };
    for (i, value) in list.iter().enumerate() {
        add(transform(value, at.item(i))?, frames)?;
    }
    Ok(())
}

/// Adds a frame; several publishers may send one transform, so the same twice is one.
fn add(frame: RigFrame, frames: &mut FrameTree) -> Result<(), RigError> {
    let is_same = |old: &RigFrame| old.parent == frame.parent && old.pose == frame.pose;
    if frames.get(&frame.name).is_some_and(is_same) { Ok(()) } else { frames.add(frame) }
}

/// A frame of one transform.
fn transform(value: &Value, at: Location) -> Result<RigFrame, RigError> {
    if value == "..." {
        let wanted = "a transform (`ros2 topic echo --full-length` prints all)";
        return Err(wrong(&at, "...", wanted));
    }
    let fields = Fields::of(value, at.clone())?;
    fields.refuse_others(&["header", CHILD, "transform"], &[])?;
    let (header, transform) = (fields.inner("header")?, fields.inner("transform")?);
    header.refuse_others(&["frame_id"], &PASSED_HEADER)?;
    transform.refuse_others(&["translation", "rotation"], &[])?;
    let pose = pose(&transform.inner("translation")?, &transform.inner("rotation")?)?;
    // Names of ROS 1 may begin with a slash.
    let name = |fields: &Fields, key: &str| {
        fields.text(key).map(|name| name.strip_prefix('/').unwrap_or(name).to_owned())
    };
    let (name, parent) = (name(&fields, CHILD)?, name(&header, "frame_id")?);
    Ok(RigFrame { name, parent, pose, holds: FrameContent::Unsaid, at })
}

fn pose(translation: &Fields, rotation: &Fields) -> Result<SensorPose, RigError> {
    translation.refuse_others(&["x", "y", "z"], &[])?;
    rotation.refuse_others(&["x", "y", "z", "w"], &[])?;
    let [x, y, z] = ["x", "y", "z"].map(|key| translation.number(key));
    let [qx, qy, qz, qw] = ["x", "y", "z", "w"].map(|key| rotation.number(key));
    of_quaternion([x?, y?, z?], [qx?, qy?, qz?, qw?], &rotation.at)
}

/// The sensor that all others are given in.
pub(super) const PANDASET_BASE: &str = "main_pandar64";

/// Keys of the file that are passed over: they say where it comes from.
const PANDASET_PASSED: [&str; 5] = ["comment", "description", "license", "source", "version"];
/// Keys of a sensor that are passed over: they say which sensor it is, and how a camera sees.
const PASSED_SENSOR: [&str; 6] =
    ["comment", "description", "device", "intrinsic", "intrinsics", "name"];

/// True if a document has this form.
pub(super) fn is_pandaset(document: &Value) -> bool {
    let sensors = document.get("sensors").and_then(Value::as_object);
    sensors.is_some_and(|map| map.values().any(|sensor| sensor.get("transform").is_some()))
}

/// Reads every sensor; all but cameras are LiDARs.
pub(super) fn read_pandaset(source: &RigSource, frames: &mut FrameTree) -> Result<(), RigError> {
    let document = source.yaml()?;
    let top = Location::top(&source.file);
    read_sensors(&document.value, top, frames).map_err(|error| error.at_line(&document))
}

fn read_sensors(document: &Value, top: Location, frames: &mut FrameTree) -> Result<(), RigError> {
    let top = Fields::of(document, top)?;
    for (key, _, at) in top.each() {
        if key != "sensors" && !PANDASET_PASSED.contains(&key.as_str()) {
            frames.notes.push(Note::fact(format!("{at}: not known here, and not read")));
        }
    }
    for (name, sensor, at) in top.inner("sensors")?.each() {
        let fields = Fields::of(sensor, at.clone())?;
        fields.refuse_others(&["transform"], &PASSED_SENSOR)?;
        let transform = fields.inner("transform")?;
        transform.refuse_others(&["translation", "rotation"], &[])?;
        let (position, rotation) = (transform.inner("translation")?, transform.inner("rotation")?);
        position.refuse_others(&["x", "y", "z"], &[])?;
        rotation.refuse_others(&["x", "y", "z", "w"], &[])?;
        let [x, y, z] = ["x", "y", "z"].map(|key| position.number(key));
        let [qx, qy, qz, qw] = ["x", "y", "z", "w"].map(|key| rotation.number(key));
        let pose = of_quaternion([x?, y?, z?], [qx?, qy?, qz?, qw?], &rotation.at)?;
        let holds = if name.contains("camera") {
            FrameContent::Other
        } else {
            FrameContent::Lidar { sensor: None, optical: None }
        };
        // A base in itself would be a loop.
        let parent =
            if name == PANDASET_BASE { "vehicle".to_owned() } else { PANDASET_BASE.to_owned() };
        frames.add(RigFrame { name: name.clone(), parent, pose, holds, at })?;
    }
    Ok(())
}
