//! The body tilted under load, all LiDARs with it, until a requirement breaks.

use glam::{DMat3, DVec3};
use serde::Serialize;

use super::room::{RoomOfSide, RoomSteps, side};
use crate::engine::BackendError;
use crate::geom::Pose;
use crate::maths;
use crate::search::Evaluator;
use crate::vehicle::{Placement, SensorPose};

/// Largest tilt that may be looked at, degrees.
pub const MOST_TILT: f64 = 45.0;
/// Farthest point of the ground from the ego origin about which a body may tilt, metres along x and y.
pub const MOST_ABOUT: f64 = 100.0;

/// Directions towards which the body goes down, with their bearings in degrees counter-clockwise from straight ahead.
const DIRECTIONS: [(&str, f64); 8] = [
    ("front down", 0.0),
    ("front left down", 45.0),
    ("left down", 90.0),
    ("rear left down", 135.0),
    ("rear down", 180.0),
    ("rear right down", 225.0),
    ("right down", 270.0),
    ("front right down", 315.0),
];

/// How far the body may tilt, all LiDARs with it, until a requirement breaks. Scene and own body stay as they are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoomOfTilt {
    /// Point of the ground that stays where it is, ego frame, metres.
    pub about: [f64; 2],
    /// The direction that holds least, and how far, degrees; of equal ones the first.
    #[serde(flatten)]
    pub least: TiltedTo,
    /// Every direction.
    pub directions: Vec<TiltedTo>,
}

/// How far the body may tilt towards one direction, degrees.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TiltedTo {
    /// Part of the body that goes down, in words.
    pub direction: &'static str,
    /// Largest tilt before the first at which a requirement breaks, and that requirement.
    #[serde(flatten)]
    pub side: RoomOfSide,
}

/// Rotation by `angle` radians that lowers everything at a bearing, radians counter-clockwise from straight ahead.
fn tilt(bearing: f64, angle: f64) -> DMat3 {
    let (sin, cos) = maths::sin_cos(bearing);
    // About the level axis to the left of the bearing: positive pitch looks down.
    DMat3::from_axis_angle(DVec3::new(-sin, cos, 0.0), angle)
}

/// A placement whose LiDARs are all turned together about a point of the ground, given in plan.
fn tilted(placement: &Placement, [x, y]: [f64; 2], turn: DMat3) -> Placement {
    let about = DVec3::new(x, y, 0.0);
    let turned = |lidar: &SensorPose| {
        let pose = Pose::new(lidar.position(), lidar.roll, lidar.pitch, lidar.yaw);
        let translation = about + turn * (pose.translation - about);
        let moved = SensorPose::from(&Pose { rotation: turn * pose.rotation, translation });
        SensorPose { sensor: lidar.sensor, phase: lidar.phase, ..moved }
    };
    let lidars = placement.lidars.iter().map(turned).collect();
    Placement { name: placement.name.clone(), lidars }
}

/// How far a placement that meets all requirements may tilt towards each direction; `None` once `go_on` says no.
pub(super) fn room_of_tilt(
    evaluator: &mut Evaluator,
    placement: &Placement,
    steps: &RoomSteps,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Option<RoomOfTilt>, BackendError> {
    let step = steps.most_tilt_deg / f64::from(steps.steps);
    let mut directions = Vec::new();
    for (direction, bearing) in DIRECTIONS {
        let at = |k: u32| {
            let turn = tilt(bearing.to_radians(), (step * f64::from(k)).to_radians());
            tilted(placement, steps.tilt_about, turn)
        };
        let moved: Vec<Placement> = (1..=steps.steps).map(at).collect();
        let scores = evaluator.scores_while(&moved, &mut || go_on(0))?;
        let Some(scores) = scores else { return Ok(None) };
        directions.push(TiltedTo { direction, side: side(step, &scores) });
        go_on(1);
    }
    // Of equal ones the first, and one at which a requirement breaks before one that holds as far as was looked.
    let worse = |a: &TiltedTo, b: &TiltedTo| {
        let rank = |of: &TiltedTo| (of.side.holds_to, of.side.breaks_at.is_none());
        rank(b) < rank(a)
    };
    let least = directions.iter().reduce(|a, b| if worse(a, b) { b } else { a }).cloned();
    let about = steps.tilt_about;
    Ok(least.map(|least| RoomOfTilt { about, least, directions }))
}

/// Directions that are looked at.
pub(crate) const TILTS: u64 = DIRECTIONS.len() as u64;

#[cfg(test)]
mod tests {
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
        let lidars = vec![
            lidar([3.0, 0.5, 2.0, 0.0, 0.1, 0.0]),
            lidar([1.0, -1.0, 1.5, 0.0, 0.0, FRAC_PI_2]),
        ];
        let placement = Placement { name: "p".into(), lidars };
        let angle = 0.2_f64;
        let moved = tilted(&placement, [1.0, 0.0], tilt(0.0, angle));
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
}
