//! How far each pose field of a placement may be off until a requirement breaks.

use serde::Serialize;

use self::copies::{COPIES_WITHIN, alone};
use super::sweep::SweptField;
use super::{Job, JobError};
use crate::engine::BackendError;
use crate::near_field::self_hits;
use crate::problem::Problem;
use crate::scene::Scene;
use crate::score::{Guard, Scores, Seen};
use crate::search::{Evaluator, Moved};
use crate::vehicle::Placement;

pub use self::copies::{RoomOfCopies, RoomOfLidar};

mod copies;

/// Placements that are looked at together; the caller is asked in between.
const AT_ONCE: usize = 16;

/// Deviations that are looked at: at equal steps to either side.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RoomSteps {
    /// Farthest deviation of a coordinate, millimetres.
    pub most_mm: f64,
    /// Farthest deviation of an angle, degrees.
    pub most_deg: f64,
    /// Farthest tilt of the body, degrees.
    pub most_tilt_deg: f64,
    /// Point of the ground about which it tilts, ego frame, metres.
    pub tilt_about: [f64; 2],
    /// Deviations up to the farthest one, on each side and towards each direction of tilt.
    pub steps: u32,
}

/// Deviations within which a placement keeps its requirements.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Room {
    /// Name of the placement.
    pub placement: String,
    /// Requirements that it misses as it is, in words. They are left out: deviations are looked at for all others, if there
    /// are any.
    pub missed: Vec<String>,
    /// Guards `self_hit` of the placement as it is.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub guards: Vec<Guard>,
    /// Each field of each LiDAR alone; if interrupted, the first ones.
    pub fields: Vec<RoomOfField>,
    /// The vehicle tilted, own bodies and LiDARs; `None` where it was not looked at.
    pub tilt: Option<RoomOfTilt>,
    /// Copies in which all LiDARs are off at once, by tolerance; looked at after the tilt.
    pub copies: Vec<RoomOfCopies>,
    /// Each LiDAR alone with all its fields off at once, looked at last; none for a placement of one LiDAR, whose copies tell it.
    pub alone: Vec<RoomOfLidar>,
}

/// How far one field of one LiDAR may be off, all else as it is.
#[derive(Debug, Clone, Serialize)]
pub struct RoomOfField {
    /// Number of the LiDAR.
    pub lidar: usize,
    /// Pose field.
    pub field: &'static str,
    /// `mm` or `deg`.
    pub unit: &'static str,
    /// Towards smaller values.
    pub down: RoomOfSide,
    /// Towards larger values.
    pub up: RoomOfSide,
}

/// How far a field may be off to one side.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoomOfSide {
    /// Largest deviation before the first at which a requirement breaks; 0 where the first step breaks one.
    pub holds_to: f64,
    /// Deviation at which one breaks; `None` where all hold as far as was looked.
    pub breaks_at: Option<f64>,
    /// Requirement that breaks there, of several the one that lacks most.
    pub breaks: Option<String>,
    /// First deviation, up to the one that breaks a requirement, at which the moved LiDAR has the guard `self_hit`: 0 if it has
    /// it as it is. `None` where there is none; not looked at in tilts, where the own body turns along.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub self_hit_at: Option<f64>,
}

/// Requirements that are missed as the placement is, by position: no deviation breaks them.
fn set_aside(scores: &mut Scores, missed: &[usize]) {
    missed.iter().for_each(|&k| scores.required[k].least = f64::NEG_INFINITY);
}

/// The requirement that lacks most; `None` where all are met.
fn broken(scores: &Scores) -> Option<&Seen> {
    let unmet = scores.required.iter().filter(|seen| !seen.is_met());
    unmet.max_by(|a, b| (a.least - a.share).total_cmp(&(b.least - b.share)))
}

/// Steps up to the first at which a requirement breaks, which counts; all where none breaks.
fn looked_at(scores: &[Scores]) -> usize {
    let first = scores.iter().position(|scores| broken(scores).is_some());
    first.map_or(scores.len(), |first| first + 1)
}

/// One side from the scores at each step, `step` apart.
pub(super) fn side(step: f64, scores: &[Scores]) -> RoomOfSide {
    let first = scores.iter().position(|scores| broken(scores).is_some());
    RoomOfSide {
        holds_to: step * first.unwrap_or(scores.len()) as f64,
        breaks_at: first.map(|k| step * (k + 1) as f64),
        breaks: first.and_then(|k| broken(&scores[k])).map(|seen| seen.name.clone()),
        self_hit_at: None,
    }
}

impl RoomSteps {
    /// Metres or degrees between deviations of a field.
    fn step(&self, field: SweptField) -> f64 {
        let most = if field.unit() == "m" { self.most_mm / 1e3 } else { self.most_deg };
        most / f64::from(self.steps)
    }
}

impl Job {
    /// How far each field of a placement may be off until a requirement breaks, how far the body may tilt, and how many copies
    /// meet all where every LiDAR is off.
    ///
    /// # Errors
    /// A vehicle that requires nothing; see [`Self::evaluator`]; an engine that fails, a sensor that the vehicle does not
    /// have.
    pub fn room(&self, placement: &Placement, steps: &RoomSteps) -> Result<Room, JobError> {
        let (mut evaluator, _) = self.evaluator(|_| {})?;
        self.room_while(&mut evaluator, placement, steps, &mut |_| true)
    }

    /// Like [`Self::room`], with the first fields only once `go_on` says no. It is asked often, with the fields and
    /// directions of tilt finished since the last time.
    ///
    /// # Errors
    /// See [`Self::room`].
    pub fn room_while(
        &self,
        evaluator: &mut Evaluator,
        placement: &Placement,
        steps: &RoomSteps,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Room, JobError> {
        if !self.scene().vehicle().requires() {
            return Err(JobError::NothingRequired { asked: "tolerance" });
        }
        let mut room = Room { placement: placement.name.clone(), ..Room::default() };
        let as_given = evaluator.scores_while(std::slice::from_ref(placement), &mut || go_on(0))?;
        let Some(mut scores) = as_given.and_then(|mut scores| scores.pop()) else {
            return Ok(room);
        };
        let problem = self.problem()?;
        room.guards = self_hits(self.scene(), &problem, evaluator.backend_mut(), placement)?;
        let all = scores.required.iter().enumerate();
        let missed: Vec<usize> = all.filter(|(_, seen)| !seen.is_met()).map(|(k, _)| k).collect();
        room.missed = missed.iter().map(|&k| scores.required[k].to_string()).collect();
        if missed.len() == scores.required.len() {
            return Ok(room);
        }
        set_aside(&mut scores, &missed);
        let (scene, guards, required) =
            (self.scene(), room.guards.clone(), scores.required.clone());
        let still = Moved::still((placement, required.len()), evaluator, &mut || go_on(0))?;
        let Some(still) = still else { return Ok(room) };
        let (problem, guards, required) = (&*problem, &guards[..], &required[..]);
        let still = still.leaving_out(&missed);
        let mut look = Look { evaluator, scene, problem, placement, still, required, guards };
        for field in SweptField::all(placement) {
            let Some(of_field) = room_of_field(&mut look, placement, field, steps, go_on)? else {
                return Ok(room);
            };
            room.fields.push(of_field);
            go_on(1);
        }
        let still = (placement, required, &missed[..]);
        let Some(tilt) = self.room_of_tilt(still, steps, go_on)? else { return Ok(room) };
        room.tilt = Some(tilt);
        self.add_copies((placement, &mut scores), &mut room, go_on)?;
        Ok(room)
    }
}

/// Steps of [`Job::room_while`] for a placement: each pose field, each direction of the tilt, copies within each tolerance, and
/// copies with each LiDAR off alone.
pub fn moves_of(placement: &Placement) -> u64 {
    let copies = COPIES_WITHIN.len() + alone(placement).len();
    SweptField::all(placement).count() as u64 + TILTS + copies as u64
}

/// A placement that is looked at with LiDARs moved.
struct Look<'a> {
    evaluator: &'a mut Evaluator,
    scene: &'a Scene,
    problem: &'a Problem,
    /// The placement as it is, and its LiDARs, cast once.
    placement: &'a Placement,
    still: Moved,
    /// Its requirements, those set aside that it misses.
    required: &'a [Seen],
    /// Guards `self_hit` of the placement as it is.
    guards: &'a [Guard],
}

impl Look<'_> {
    /// Scores of some placements that hold their requirements alone; `None` once `go_on` says no. Voxels are not counted, and
    /// only moved LiDARs are cast.
    fn scores(
        &mut self,
        moved: &[Placement],
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<Vec<Scores>>, BackendError> {
        let mut all = Vec::with_capacity(moved.len());
        for some in moved.chunks(AT_ONCE) {
            let (still, evaluator) = (&self.still, &mut *self.evaluator);
            let shares = still.shares_beside(self.placement, some, evaluator, &mut || go_on(0))?;
            let Some(shares) = shares else { return Ok(None) };
            all.extend(shares.into_iter().map(|shares| {
                let seen = self.required.iter().cloned().zip(shares);
                let required = seen.map(|(seen, share)| Seen { share, ..seen }).collect();
                Scores { required, ..Scores::default() }
            }));
        }
        Ok(Some(all))
    }

    /// True if a LiDAR has the guard `self_hit` as it is.
    fn hits_itself(&self, lidar: usize) -> bool {
        let mut guards = self.guards.iter();
        guards.any(|of| matches!(of, Guard::SelfHit { lidar: own, .. } if *own == lidar))
    }

    /// Number of steps, 1 at the first of some placements, after which a LiDAR has the guard `self_hit`; 0 if it has it as it is.
    /// `None` where it never has, or once `go_on` says no.
    fn self_hit(
        &mut self,
        lidar: usize,
        moved: &[Placement],
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<Option<usize>, BackendError> {
        if self.hits_itself(lidar) {
            return Ok(Some(0));
        }
        for (k, placement) in moved.iter().enumerate() {
            let (name, lidars) = (placement.name.clone(), vec![placement.lidars[lidar]]);
            let (alone, backend) = (Placement { name, lidars }, self.evaluator.backend_mut());
            if !go_on(0) {
                break;
            }
            if !self_hits(self.scene, self.problem, backend, &alone)?.is_empty() {
                return Ok(Some(k + 1));
            }
        }
        Ok(None)
    }
}

/// How far one field may be off to either side; `None` once `go_on` says no.
fn room_of_field(
    look: &mut Look<'_>,
    placement: &Placement,
    field: SweptField,
    steps: &RoomSteps,
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Option<RoomOfField>, BackendError> {
    let (step, value) = (steps.step(field), field.value_in(placement));
    let off = |sign: f64| {
        (1..=steps.steps).map(move |k| field.moved(placement, value + sign * step * f64::from(k)))
    };
    let moved: Vec<Placement> = off(-1.0).chain(off(1.0)).collect();
    let Some(scores) = look.scores(&moved, go_on)? else { return Ok(None) };
    let (unit, scale) = if field.unit() == "m" { ("mm", 1e3) } else { ("deg", 1.0) };
    let each = moved.chunks(steps.steps as usize).zip(scores.chunks(steps.steps as usize));
    let sides = each.map(|(moved, scores)| {
        let self_hit = look.self_hit(field.lidar, &moved[..looked_at(scores)], go_on)?;
        let self_hit_at = self_hit.map(|steps| scale * step * steps as f64);
        Ok(RoomOfSide { self_hit_at, ..side(scale * step, scores) })
    });
    let sides = sides.collect::<Result<Vec<_>, BackendError>>()?;
    let (true, Ok([down, up])) = (go_on(0), <[_; 2]>::try_from(sides)) else { return Ok(None) };
    Ok(Some(RoomOfField { lidar: field.lidar, field: field.name(), unit, down, up }))
}

mod tilt;

use tilt::TILTS;
pub use tilt::{MOST_ABOUT, MOST_TILT, RoomOfTilt, TiltedTo};

#[cfg(test)]
mod tests;
