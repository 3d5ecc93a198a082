//! Numbers as people write them.

use crate::vehicle::SensorPose;

/// Digits after the first one.
const MORE_DIGITS: usize = 8;
/// Smallest number that is written: half a nanometre, or half a nanoradian.
const SMALLEST: f64 = 5e-10;

/// A number of at most nine digits; no −0, and 0 for what rounding errors leave.
pub(super) fn written(value: f64) -> f64 {
    if value.abs() < SMALLEST {
        return 0.0;
    }
    format!("{value:.MORE_DIGITS$e}").parse().unwrap_or(value)
}

/// A pose of such numbers.
pub(super) fn written_pose(pose: &SensorPose) -> SensorPose {
    let numbers = SensorPose::from_values(pose.values().map(written));
    SensorPose { sensor: pose.sensor, phase: pose.phase.map(written), ..numbers }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_nine_digits_and_no_dust() {
        for (value, text) in [
            (-0.0, "0"),
            (6.9e-18, "0"),
            (-4.9e-10, "0"),
            (0.1 + 0.2, "0.3"),
            (-1.000_000_000_04, "-1"),
            (std::f64::consts::FRAC_PI_2, "1.57079633"),
            (123_456.789_012_3, "123456.789"),
            (1e-9, "0.000000001"),
        ] {
            assert_eq!(written(value).to_string(), text);
        }
        assert_eq!(written(-0.0).to_bits(), 0);
    }
}
