//! PandaSet's `static_extrinsic_calibration`: quaternions in the frame of the LiDAR on the roof.

use serde_json::Value;

use super::angles::of_quaternion;
use super::fields::{Fields, wrong};
use super::frames::{Frame, Frames, Holds};
use super::{RigError, Source};
use crate::json::Place;

/// The sensor that all others are given in.
pub(super) const BASE: &str = "main_pandar64";

/// Whether a document has this form.
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
    for (name, sensor, at) in top.inner("sensors")?.each() {
        let transform = Fields::of(sensor, at.clone())?.inner("transform")?;
        let (position, rotation) = (transform.inner("translation")?, transform.inner("rotation")?);
        let [x, y, z] = ["x", "y", "z"].map(|key| position.number(key));
        let [qx, qy, qz, qw] = ["x", "y", "z", "w"].map(|key| rotation.number(key));
        let pose = of_quaternion([x?, y?, z?], [qx?, qy?, qz?, qw?]);
        let pose =
            pose.ok_or_else(|| wrong(&rotation.at, "a quaternion of length 0", "a rotation"))?;
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
