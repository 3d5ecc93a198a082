//! How far the whole vehicle may tilt, own bodies and LiDARs together, until a requirement breaks.

use glam::{DMat3, DVec3};
use serde::Serialize;

use super::{RoomOfSide, RoomSteps, broken, side};
use crate::geom::Pose;
use crate::job::{Job, JobError};
use crate::maths;
use crate::score::{Scores, Seen};
use crate::search::{Evaluator, Moved};
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

/// How far the vehicle may tilt, own bodies and LiDARs, until a requirement breaks. Ground, targets and scene stay.
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

/// Rotation about a point of the ground, given in plan, as a motion of the ego frame.
fn about([x, y]: [f64; 2], turn: DMat3) -> Pose {
    let fixed = DVec3::new(x, y, 0.0);
    Pose { rotation: turn, translation: fixed - turn * fixed }
}

/// A placement whose LiDARs are all moved together.
fn tilted(placement: &Placement, turn: &Pose) -> Placement {
    let turned = |lidar: &SensorPose| {
        let pose = Pose::new(lidar.position(), lidar.roll, lidar.pitch, lidar.yaw);
        let SensorPose { sensor, phase, rides_on, .. } = *lidar;
        SensorPose { sensor, phase, rides_on, ..SensorPose::from(&turn.compose(&pose)) }
    };
    let lidars = placement.lidars.iter().map(turned).collect();
    Placement { name: placement.name.clone(), lidars }
}

impl Job {
    /// Largest tilt towards each direction. Takes the placement, its requirements as it stands, and the numbers of requirements
    /// that it misses. `None` once `go_on` says no.
    pub(super) fn room_of_tilt(
        &self,
        (placement, required, missed): (&Placement, &[Seen], &[usize]),
        steps: &RoomSteps,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<RoomOfTilt>, JobError> {
        let step = steps.most_tilt_deg / f64::from(steps.steps);
        let mut directions = Vec::new();
        for (direction, bearing) in DIRECTIONS {
            let mut scores = Vec::new();
            for k in 1..=steps.steps {
                let turn = tilt(bearing.to_radians(), (step * f64::from(k)).to_radians());
                let turn = about(steps.tilt_about, turn);
                let shares = self.shares_tilted((placement, required, missed), &turn, go_on)?;
                let Some(shares) = shares else { return Ok(None) };
                let is_last = broken(&shares).is_some();
                scores.push(shares);
                if is_last {
                    break;
                }
            }
            directions.push(TiltedTo { direction, side: side(step, &scores) });
            go_on(1);
        }
        // Ties go to the first, and a requirement that breaks comes before one that holds over the whole range.
        let worse = |a: &TiltedTo, b: &TiltedTo| {
            let rank = |of: &TiltedTo| (of.side.holds_to, of.side.breaks_at.is_none());
            rank(b) < rank(a)
        };
        let least = directions.iter().reduce(|a, b| if worse(a, b) { b } else { a }).cloned();
        let about = steps.tilt_about;
        Ok(least.map(|least| RoomOfTilt { about, least, directions }))
    }

    /// Requirements of a placement whose vehicle is turned, own bodies and LiDARs; `None` once `go_on` says no.
    fn shares_tilted(
        &self,
        (placement, required, missed): (&Placement, &[Seen], &[usize]),
        turn: &Pose,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<Scores>, JobError> {
        if !go_on(0) {
            return Ok(None);
        }
        let suite = self.clone().with(|scene| scene.turn_bodies(turn)).suite()?;
        let memory = self.settings().engine.memory_budget() / 2;
        let (moved, mut evaluator) =
            (tilted(placement, turn), Evaluator::suite_on_cpu(&suite, memory));
        let still = Moved::still((&moved, required.len()), &mut evaluator, &mut || go_on(0))?;
        let Some(still) = still else { return Ok(None) };
        let seen = required.iter().cloned().zip(still.leaving_out(missed).shares());
        let required = seen.map(|(seen, share)| Seen { share, ..seen }).collect();
        Ok(Some(Scores { required, ..Scores::default() }))
    }
}

/// Directions that are looked at.
pub(super) const TILTS: u64 = DIRECTIONS.len() as u64;

#[cfg(test)]
mod tests;
