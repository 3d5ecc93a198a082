//! Poses as people write them: to the nanometre and nanoradian, and in millimetres and degrees.

use super::{Placement, SensorPose};
use sightline_files::json::written;

/// A pose to the nanometre and nanoradian, without −0.
pub fn to_nanometres(pose: &SensorPose) -> SensorPose {
    let numbers = SensorPose::from_values(pose.values().map(written));
    SensorPose { sensor: pose.sensor, phase: pose.phase.map(written), ..numbers }
}

/// A placement to the nanometre and nanoradian.
pub fn placement_to_nanometres(placement: &Placement) -> Placement {
    let lidars = placement.lidars.iter().map(to_nanometres).collect();
    Placement { name: placement.name.clone(), lidars }
}

/// x, y, z in millimetres, roll, pitch and yaw in degrees, with two decimals.
pub fn millimetres(pose: &SensorPose) -> [(&'static str, f64); 6] {
    let mut fields = pose.fields();
    for (k, (_, value)) in fields.iter_mut().enumerate() {
        let value_in_unit = if k < 3 { *value * 1e3 } else { value.to_degrees() };
        *value = (value_in_unit * 100.0).round() / 100.0 + 0.0;
    }
    fields
}

/// A pose in millimetres and degrees, in words.
pub fn in_millimetres(pose: &SensorPose) -> String {
    let unit = |k: usize| if k < 3 { " mm" } else { "°" };
    let words = millimetres(pose).into_iter().enumerate();
    let words = words.map(|(k, (field, value))| format!("{field} {value}{}", unit(k)));
    words.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_is_told_in_millimetres_and_degrees() {
        let pose = SensorPose::from_values([0.6, -0.4, 2.8, -0.001, 0.1, -0.000_01]);
        assert_eq!(
            in_millimetres(&pose),
            "x 600 mm, y -400 mm, z 2800 mm, roll -0.06°, pitch 5.73°, yaw 0°"
        );
    }

    #[test]
    fn a_placement_is_written_to_the_nanometre() {
        let pose = SensorPose {
            phase: Some(1.0 / 3.0),
            ..SensorPose::from_values([0.1 + 0.2, -0.0, 6.9e-18, 1.0, 2.0, 1e-9])
        };
        let placement = Placement { name: "a".into(), lidars: vec![pose] };
        let placement = placement_to_nanometres(&placement);
        let text = serde_json::to_string(&placement.lidars[0]).unwrap();
        assert_eq!(
            text,
            r#"{"x":0.3,"y":0.0,"z":0.0,"roll":1.0,"pitch":2.0,"yaw":1e-9,"phase":0.333333333}"#
        );
    }
}
