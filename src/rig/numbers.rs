//! Numbers as people write them.

use crate::vehicle::SensorPose;

/// Decimals: nanometres, and nanoradians.
const DECIMALS: usize = 9;
/// Smallest number that is written: half a nanometre, or half a nanoradian.
const SMALLEST: f64 = 5e-10;

/// A number of at most nine decimals; no −0, and 0 for what rounding errors leave.
pub(super) fn written(value: f64) -> f64 {
    if value.abs() < SMALLEST {
        return 0.0;
    }
    format!("{value:.DECIMALS$}").parse().unwrap_or(value)
}

/// A pose of such numbers.
pub(super) fn written_pose(pose: &SensorPose) -> SensorPose {
    let numbers = SensorPose::from_values(pose.values().map(written));
    SensorPose { sensor: pose.sensor, phase: pose.phase.map(written), ..numbers }
}

/// A pose in millimetres and degrees, in words.
pub fn in_millimetres(pose: &SensorPose) -> String {
    let words = pose.fields().into_iter().enumerate().map(|(k, (field, value))| match k {
        0..3 => format!("{field} {} mm", hundredths(value * 1e3)),
        _ => format!("{field} {}°", hundredths(value.to_degrees())),
    });
    words.collect::<Vec<_>>().join(", ")
}

/// A number of at most two decimals, without −0.
fn hundredths(value: f64) -> f64 {
    (value * 100.0).round() / 100.0 + 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_nine_decimals_and_no_dust() {
        for (value, text) in [
            (-0.0, "0"),
            (6.9e-18, "0"),
            (-4.9e-10, "0"),
            (0.1 + 0.2, "0.3"),
            (-1.000_000_000_04, "-1"),
            (std::f64::consts::FRAC_PI_2, "1.570796327"),
            (123_456.789_012_3, "123456.7890123"),
            (1e-9, "0.000000001"),
        ] {
            assert_eq!(written(value).to_string(), text);
        }
        assert_eq!(written(-0.0).to_bits(), 0);
    }

    #[test]
    fn a_pose_is_told_in_millimetres_and_degrees() {
        let pose = SensorPose::from_values([0.6, -0.4, 2.8, -0.001, 0.1, -0.000_01]);
        assert_eq!(
            in_millimetres(&pose),
            "x 600 mm, y -400 mm, z 2800 mm, roll -0.06°, pitch 5.73°, yaw 0°"
        );
    }
}
