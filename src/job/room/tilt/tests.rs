//! Tests of `tilt`.

use std::f64::consts::FRAC_PI_2;

use super::*;

#[test]
fn a_tilt_lowers_the_part_that_its_direction_names() {
    let down = |bearing: f64| tilt(bearing.to_radians(), 0.1);
    for (name, bearing) in DIRECTIONS {
        let (sin, cos) = bearing.to_radians().sin_cos();
        let lowered = down(bearing) * DVec3::new(cos, sin, 0.0);
        assert!((lowered.z + 0.1_f64.sin()).abs() < 1e-12, "{name}: {lowered}");
        let beside = DVec3::new(-sin, cos, 0.0);
        assert!((down(bearing) * beside - beside).length() < 1e-12, "{name}: level");
        let words = [
            ("front", cos > 0.1),
            ("rear", cos < -0.1),
            ("left", sin > 0.1),
            ("right", sin < -0.1),
        ];
        assert!(words.iter().all(|(word, is)| name.contains(word) == *is), "{name}");
    }
}

#[test]
fn lidars_turn_together_about_a_point_of_the_ground() {
    let lidar =
        |values: [f64; 6]| SensorPose { phase: Some(0.5), ..SensorPose::from_values(values) };
    let lidars =
        vec![lidar([3.0, 0.5, 2.0, 0.0, 0.1, 0.0]), lidar([1.0, -1.0, 1.5, 0.0, 0.0, FRAC_PI_2])];
    let placement = Placement { name: "p".into(), lidars };
    let angle = 0.2_f64;
    let moved = tilted(&placement, &about([1.0, 0.0], tilt(0.0, angle)));
    // By hand, front down about y through (1, 0, 0): x' = 1 + (x − 1) cos + z sin, z' = z cos − (x − 1) sin.
    let (sin, cos) = angle.sin_cos();
    let [first, second] = [&moved.lidars[0], &moved.lidars[1]];
    let wanted = [1.0 + 2.0 * cos + 2.0 * sin, 0.5, 2.0 * cos - 2.0 * sin, 0.0, 0.3, 0.0];
    for (a, b) in first.values().into_iter().zip(wanted) {
        assert!((a - b).abs() < 1e-12, "{first:?} {wanted:?}");
    }
    // One that looks to the left rolls: its right side, which is ahead, goes down.
    let wanted = [1.0 + 1.5 * sin, -1.0, 1.5 * cos, angle, 0.0, FRAC_PI_2];
    for (a, b) in second.values().into_iter().zip(wanted) {
        assert!((a - b).abs() < 1e-12, "{second:?} {wanted:?}");
    }
    assert_eq!(second.phase, Some(0.5));
}
