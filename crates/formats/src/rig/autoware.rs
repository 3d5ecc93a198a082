//! Autoware's pair of YAML files: `base_link` holds the sensor kit, the kit holds the sensors.

use serde_json::Value;

use super::fields::{self, Fields};
use super::frames::{Frame, Frames, Holds};
use super::{BASE_LINK, Mounting, NamedText, Rig, RigError, Source};
use sightline_files::Note;
use sightline_files::json::Place;
use sightline_scene::vehicle::SensorPose;

/// Frame of Autoware's sensor kit.
const KIT: &str = "sensor_kit_base_link";

/// Keys of a frame that are passed over: they say which sensor it is, and where its data go.
const PASSED: [&str; 12] = [
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
pub(super) fn read(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    let document = source.yaml()?;
    let top = Place::top(&source.file);
    read_frames(&document.value, top, frames).map_err(|error| error.at_line(&document))
}

fn read_frames(document: &Value, top: Place, frames: &mut Frames) -> Result<(), RigError> {
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
            fields.refuse_others(&read, &PASSED)?;
            let (name, parent, pose) = (name.clone(), parent.clone(), fields.six()?);
            frames.add(Frame { name, parent, pose, holds: Holds::Unsaid, at })?;
        }
    }
    Ok(())
}

/// The pair: the kit stands at `base_link`, all LiDARs on the kit.
pub(super) fn write(rig: &Rig, mounting: &Mounting) -> Vec<NamedText> {
    let frame = |name: &str, pose: &SensorPose| {
        let number = |(key, value)| format!("    {key}: {}\n", decimal(value));
        let numbers: String = fields::named(pose).map(number).collect();
        format!("  {}:\n{numbers}", key(name))
    };
    let kit = format!("{BASE_LINK}:\n{}", frame(KIT, &super::angles::IDENTITY));
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
