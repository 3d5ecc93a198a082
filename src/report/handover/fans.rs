//! Fields of view of LiDARs as areas of a drawing: level from above, upright from the side.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use super::DrawnLidar;
use crate::maths;

/// Metres that fields of view are drawn to.
pub(super) const REACH: f64 = 2.0;
/// Most radians between two corners of a field of view.
const STEP: f64 = PI / 36.0;

/// A direction in the sensor's frame by azimuth and elevation.
fn direction(azimuth: f64, elevation: f64) -> DVec3 {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (maths::sin_cos(azimuth), maths::sin_cos(elevation));
    DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e)
}

/// Angles from one to another in steps of at most [`STEP`], both among them.
fn steps(from: f64, width: f64) -> impl Iterator<Item = f64> {
    let count = (width / STEP).ceil().max(1.0);
    (0..=count as u32).map(move |k| from + width * f64::from(k) / count)
}

pub(super) fn numbered(lidar: usize, fans: Vec<Vec<DVec3>>) -> Vec<(usize, Vec<DVec3>)> {
    fans.into_iter().map(|fan| (lidar, fan)).collect()
}

/// True if the axis of a sensor is more than 60° off the vertical: its own plane then says nothing of a level one.
pub(super) fn is_on_its_side(lidar: &DrawnLidar) -> bool {
    (lidar.ego_from_sensor.rotation * DVec3::Z).z.abs() < 0.5
}

/// Steps of a turn in a cut.
const CUT: usize = 720;
/// Radians by which a direction lies within a field of view: a cut along its edge is none.
const WITHIN: f64 = 1e-3;

/// Cuts of the field of view with the plane of two axes of the ego frame, each around the LiDAR.
pub(super) fn cut(lidar: &DrawnLidar, [u, v]: [DVec3; 2]) -> Vec<Vec<DVec3>> {
    let pose = &lidar.ego_from_sensor;
    let towards = |step: usize| {
        let (sin, cos) = maths::sin_cos(TAU * step as f64 / CUT as f64);
        cos * u + sin * v
    };
    let is_seen = |step: usize| {
        let d = pose.rotation.transpose() * towards(step);
        let elevation = maths::asin(d.z.clamp(-1.0, 1.0));
        let Some([low, high]) = lidar.view.elevations(maths::atan2(d.y, d.x)) else { return false };
        // A field of view that holds a pole has no edge there.
        let is_below = elevation <= high - WITHIN || high >= FRAC_PI_2 - WITHIN;
        is_below && (elevation >= low + WITHIN || low <= WITHIN - FRAC_PI_2)
    };
    let seen: Vec<bool> = (0..CUT).map(is_seen).collect();
    let end = |step: usize| pose.translation + REACH * towards(step);
    let Some(gap) = seen.iter().position(|seen| !seen) else {
        return vec![(0..CUT).map(end).collect()];
    };
    // Runs of neighbouring directions, from a gap on.
    let turn: Vec<usize> = (gap..gap + CUT).collect();
    let runs = turn.chunk_by(|a, b| seen[a % CUT] == seen[b % CUT]);
    let runs = runs.filter(|run| seen[run[0] % CUT]);
    runs.map(|run| std::iter::once(pose.translation).chain(run.iter().map(|&k| end(k))).collect())
        .collect()
}

/// The field of view in the sensor's own plane, around the LiDAR where it is a sector.
pub(super) fn horizontal(lidar: &DrawnLidar) -> Vec<DVec3> {
    let sector = lidar.view.sector();
    let [from, width] = sector.unwrap_or([0.0, TAU]);
    let end = |azimuth| lidar.ego_from_sensor.apply(REACH * direction(azimuth, 0.0));
    let middle = sector.map(|_| lidar.ego_from_sensor.apply(DVec3::ZERO));
    middle.into_iter().chain(steps(from, width).map(end)).collect()
}

/// The field of view in the upright plane that holds a direction of the ego frame, on its side; `None` where the
/// sensor does not look there.
pub(super) fn vertical(lidar: &DrawnLidar, towards: DVec3) -> Option<Vec<DVec3>> {
    let pose = &lidar.ego_from_sensor;
    let towards = pose.rotation.transpose() * towards;
    let azimuth = maths::atan2(towards.y, towards.x);
    let [low, high] = lidar.view.elevations(azimuth)?;
    let end = |elevation| pose.apply(REACH * direction(azimuth, elevation));
    let corners = std::iter::once(pose.apply(DVec3::ZERO));
    Some(corners.chain(steps(low, high - low).map(end)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
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
    fn a_hemisphere_on_its_side_is_half_a_disc_from_above_and_from_the_front() {
        // Rolled by −90° its axis points to the left.
        let pose = SensorPose { roll: -90_f64.to_radians(), ..SensorPose::at(2.0, 1.0, 0.5) };
        let table = BeamTable::spinning(&[(0.0, 0.0), (90.0, 0.0)], 360, 50.0).unwrap();
        let lidar = lidar(pose, &table);
        assert!(is_on_its_side(&lidar));
        let area = |fan: &[DVec3]| {
            let turns = fan.windows(2).map(|pair| (pair[0] - fan[0]).cross(pair[1] - fan[0]));
            0.5 * turns.sum::<DVec3>().length()
        };
        for other in [DVec3::X, DVec3::Z] {
            let fans = cut(&lidar, [DVec3::Y, other]);
            assert_eq!(fans.len(), 1);
            assert!((area(&fans[0]) - 0.5 * PI * REACH * REACH).abs() < 0.1);
            assert!(fans[0].iter().all(|corner| corner.y >= 1.0 - 1e-9));
        }
        assert!(cut(&lidar, [DVec3::X, DVec3::Z]).is_empty(), "it looks away from the side view");
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
        assert!(
            (from.to_degrees() + 31.0).abs() <= 1.0 && (width.to_degrees() - 62.0).abs() <= 2.0
        );
        let [low, high] = view.elevations(0.0).unwrap();
        assert!((low.to_degrees() + 5.0).abs() < 1e-4 && (high.to_degrees() - 5.0).abs() < 1e-4);
        assert_eq!(view.elevations(2.0), None);
    }
}
