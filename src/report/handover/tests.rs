//! Fields of view in the views against closed forms.

use glam::DVec3;

use super::draw::broken;
use super::{DrawnLidar, REACH, horizontal, vertical};
use crate::shared::FieldOfView;
use crate::vehicle::{BeamTable, SensorPose};

fn lidar(pose: SensorPose, table: &BeamTable) -> DrawnLidar {
    DrawnLidar {
        pose,
        ego_from_sensor: pose.ego_from_sensor(),
        view: FieldOfView::of(table),
        model: String::new(),
        mount: String::new(),
    }
}

fn assert_near(found: DVec3, wanted: [f64; 3]) {
    assert!((found - DVec3::from(wanted)).length() < 1e-6, "{found}, not {wanted:?}");
}

/// Channels at −20° and 10° over 120°, a step every degree.
fn sector() -> BeamTable {
    BeamTable::sector(&[(-20.0, 0.0), (10.0, 0.0)], [-60.0, 1.0], 121, 50.0).unwrap()
}

#[test]
fn a_sensor_on_the_left_side_looks_left_and_is_drawn_from_the_front_alone() {
    let pose = SensorPose { yaw: 90_f64.to_radians(), ..SensorPose::at(2.0, 1.0, 0.5) };
    let lidar = lidar(pose, &sector());
    let fan = horizontal(&lidar);
    assert_near(fan[0], [2.0, 1.0, 0.5]);
    // From −60° to 60° around the left: 30° to 150°.
    let (cos, sin) = (REACH * 0.75_f64.sqrt(), REACH * 0.5);
    assert_near(fan[1], [2.0 + cos, 1.0 + sin, 0.5]);
    assert_near(fan[fan.len() - 1], [2.0 - cos, 1.0 + sin, 0.5]);
    assert!(vertical(&lidar, DVec3::X).is_none() && vertical(&lidar, -DVec3::X).is_none());
    assert!(vertical(&lidar, -DVec3::Y).is_none());
    let fan = vertical(&lidar, DVec3::Y).unwrap();
    let at = |degrees: f64| {
        let (up, out) = (degrees.to_radians().sin(), degrees.to_radians().cos());
        [2.0, 1.0 + REACH * out, 0.5 + REACH * up]
    };
    assert_near(fan[1], at(-20.0));
    assert_near(fan[fan.len() - 1], at(10.0));
}

#[test]
fn a_sector_to_the_left_is_drawn_on_the_left_alone() {
    let table = BeamTable::sector(&[(-20.0, 0.0), (10.0, 0.0)], [30.0, 1.0], 71, 50.0).unwrap();
    let lidar = lidar(SensorPose::at(0.0, 0.0, 1.0), &table);
    assert!(vertical(&lidar, DVec3::Y).is_some() && vertical(&lidar, -DVec3::Y).is_none());
    assert!(vertical(&lidar, DVec3::X).is_none());
}

#[test]
fn a_positive_pitch_turns_the_field_of_view_down_ahead() {
    let pose = SensorPose { pitch: 10_f64.to_radians(), ..SensorPose::at(0.0, 0.0, 2.0) };
    let turning = BeamTable::spinning(&[(-20.0, 0.0), (10.0, 0.0)], 360, 50.0).unwrap();
    let lidar = lidar(pose, &turning);
    let ahead = vertical(&lidar, DVec3::X).unwrap();
    let [low, high] = [-30_f64, 0.0].map(f64::to_radians);
    assert_near(ahead[1], [REACH * low.cos(), 0.0, 2.0 + REACH * low.sin()]);
    assert_near(ahead[ahead.len() - 1], [REACH * high.cos(), 0.0, 2.0 + REACH * high.sin()]);
    // Behind it looks up by as much.
    let behind = vertical(&lidar, -DVec3::X).unwrap();
    let high = 20_f64.to_radians();
    assert_near(behind[behind.len() - 1], [-REACH * high.cos(), 0.0, 2.0 + REACH * high.sin()]);
    // All round: no corner at the sensor.
    let is_around = |corner: &DVec3| (corner.z - 2.0).abs() <= REACH && corner.length() > 1.0;
    assert!(horizontal(&lidar).iter().all(is_around));
}

#[test]
fn long_warnings_are_broken_between_words_and_told_to_their_end() {
    let words = "NOT MET: car from 10 to 80 m, any one LiDAR lost: 1.6 % seen, 95.0 % required";
    assert_eq!(broken(words, 200), [words]);
    let lines = broken(words, 40);
    assert!(lines.len() == 3 && lines.iter().all(|line| line.chars().count() <= 40), "{lines:?}");
    let told: Vec<&str> = lines.iter().flat_map(|line| line.split_whitespace()).collect();
    assert_eq!(told.join(" "), words);
}

#[test]
fn listed_directions_leave_a_sector() {
    let degrees =
        (-30..=30).flat_map(|across| [-5, 0, 5].map(|up| (f64::from(across), f64::from(up))));
    let directions = degrees.map(|(across, up): (f64, f64)| {
        let (across, up) = (across.to_radians(), up.to_radians());
        DVec3::new(up.cos() * across.cos(), up.cos() * across.sin(), up.sin())
    });
    let view = FieldOfView::of(&BeamTable::from_directions(directions, 50.0).unwrap());
    let [from, width] = view.sector().unwrap();
    // Sectors of 2° that hold a beam.
    assert!((from.to_degrees() + 31.0).abs() <= 1.0 && (width.to_degrees() - 62.0).abs() <= 2.0);
    let [low, high] = view.elevations(0.0).unwrap();
    assert!((low.to_degrees() + 5.0).abs() < 1e-4 && (high.to_degrees() - 5.0).abs() < 1e-4);
    assert_eq!(view.elevations(2.0), None);
}
