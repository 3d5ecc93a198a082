//! PandaSet's `static_extrinsic_calibration`: quaternions in the frame of the LiDAR on the roof.

use serde_json::Value;

use super::angles::of_quaternion;
use super::fields::Fields;
use super::frames::{Frame, Frames, Holds};
use super::{RigError, Source};
use sightline_files::Note;
use sightline_files::json::Place;

/// The sensor that all others are given in.
pub(super) const BASE: &str = "main_pandar64";

/// Keys of the file that are passed over: they say where it comes from.
const PASSED: [&str; 5] = ["comment", "description", "license", "source", "version"];
/// Keys of a sensor that are passed over: they say which sensor it is, and how a camera sees.
const PASSED_SENSOR: [&str; 6] =
    ["comment", "description", "device", "intrinsic", "intrinsics", "name"];

/// True if a document has this form.
pub(super) fn is_pandaset(document: &Value) -> bool {
    let sensors = document.get("sensors").and_then(Value::as_object);
    sensors.is_some_and(|map| map.values().any(|sensor| sensor.get("transform").is_some()))
}

/// Reads every sensor; all but cameras are LiDARs.
pub(super) fn read(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    let document = source.yaml()?;
    let top = Place::top(&source.file);
    read_sensors(&document.value, top, frames).map_err(|error| error.at_line(&document))
}

fn read_sensors(document: &Value, top: Place, frames: &mut Frames) -> Result<(), RigError> {
    let top = Fields::of(document, top)?;
    for (key, _, at) in top.each() {
        if key != "sensors" && !PASSED.contains(&key.as_str()) {
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
            Holds::Other
        } else {
            Holds::Lidar { sensor: None, optical: None }
        };
        // A base in itself would be a loop.
        let parent = if name == BASE { "vehicle".to_owned() } else { BASE.to_owned() };
        frames.add(Frame { name: name.clone(), parent, pose, holds, at })?;
    }
    Ok(())
}
