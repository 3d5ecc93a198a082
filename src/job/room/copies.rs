//! Copies of a placement within tolerances: all LiDARs off together, and each alone.

use serde::Serialize;

use super::Room;
use crate::job::holds::add_holds_in;
use crate::job::{Job, JobError, Tolerance};
use crate::score::{HOLDS, Scores, Seen};
use crate::search::{Evaluator, drawn, error_of_share};
use crate::vehicle::Placement;

/// Tolerances in which copies are mounted, as multiples of the usual one.
pub(super) const COPIES_WITHIN: [f64; 6] = [0.25, 0.5, 1.0, 2.0, 4.0, 8.0];

/// Copies whose LiDARs are all off, at random within a tolerance.
#[derive(Debug, Clone, Serialize)]
pub struct RoomOfCopies {
    /// Tolerance of every LiDAR.
    pub tolerance: Tolerance,
    /// Share of 200 copies that meet all requirements.
    pub holds_in: f64,
    /// Two standard errors of the share: the copies are a draw.
    pub error: f64,
    /// Requirement that the fewest copies meet; `None` where `HOLDS` of the copies or more meet all.
    pub breaks: Option<String>,
}

/// How far all fields of one LiDAR may be off at once, the other LiDARs as they are.
#[derive(Debug, Clone, Serialize)]
pub struct RoomOfLidar {
    /// Number of the LiDAR.
    pub lidar: usize,
    /// Largest tolerance of [`Room::copies`] within which `HOLDS` of the copies meet all requirements; `None` where fewer do
    /// within the smallest.
    pub holds_within: Option<Tolerance>,
    /// The next tolerance, within which fewer do; `None` where enough do within the largest.
    pub breaks_within: Option<Tolerance>,
    /// Requirement that the fewest copies meet there.
    pub breaks: Option<String>,
}

/// Copies that were looked at.
pub(super) struct Held {
    /// Share of them that meet all requirements.
    pub(super) share: f64,
    /// Requirement that the fewest of them meet, where the share is less than `HOLDS`.
    pub(super) breaks: Option<String>,
}

impl Job {
    /// Adds the copies of a placement, whose `scores` are over all frames, all LiDARs off and then each alone.
    pub(super) fn add_copies(
        &self,
        (placement, scores): (&Placement, &mut Scores),
        room: &mut Room,
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<(), JobError> {
        let (usual, mut few) = (Tolerance::default(), self.over_few_frames()?);
        for times in COPIES_WITHIN {
            let tolerance =
                Tolerance { metres: times * usual.metres, radians: times * usual.radians };
            let held = held(&mut few, (placement, scores), (tolerance, None), go_on)?;
            let Some(Held { share: holds_in, breaks }) = held else { return Ok(()) };
            let error = error_of_share(holds_in, drawn(&scores.required, placement.lidars.len()));
            room.copies.push(RoomOfCopies { tolerance, holds_in, error, breaks });
            go_on(1);
        }
        for lidar in alone(placement) {
            let mut within =
                |tolerance| held(&mut few, (placement, scores), (tolerance, Some(lidar)), go_on);
            let Some(of_lidar) = room_of_lidar(&mut within, lidar, &room.copies)? else { break };
            room.alone.push(of_lidar);
            go_on(1);
        }
        Ok(())
    }
}

/// Copies with all LiDARs off by a tolerance, or one of them; `None` once `go_on` says no.
fn held(
    few: &mut Evaluator,
    (placement, scores): (&Placement, &mut Scores),
    off: (Tolerance, Option<usize>),
    go_on: &mut dyn FnMut(u64) -> bool,
) -> Result<Option<Held>, JobError> {
    let is_whole = add_holds_in(few, (placement, &mut *scores), off, &mut || go_on(0))?;
    let share = scores.requirements_hold_in.filter(|_| is_whole);
    Ok(share.map(|share| Held { share, breaks: breaks(share, &scores.required) }))
}

/// Requirement that the fewest copies meet, of equal ones the first; `None` where enough copies meet all.
pub(super) fn breaks(share: f64, required: &[Seen]) -> Option<String> {
    let each = required.iter().filter_map(|seen| Some((seen.holds_in?, seen)));
    let least = each.min_by(|(a, _), (b, _)| a.total_cmp(b)).filter(|_| share < HOLDS);
    least.map(|(_, seen)| seen.name.clone())
}

/// LiDARs that are also looked at alone: each of several.
pub(super) fn alone(placement: &Placement) -> std::ops::Range<usize> {
    let lidars = placement.lidars.len();
    if lidars > 1 { 0..lidars } else { 0..0 }
}

/// How far one LiDAR may be off in all fields at once, by halving the tolerances beyond those within which all LiDARs may be off
/// together. `within` looks at copies; `None` once it has none.
pub(super) fn room_of_lidar(
    within: &mut dyn FnMut(Tolerance) -> Result<Option<Held>, JobError>,
    lidar: usize,
    copies: &[RoomOfCopies],
) -> Result<Option<RoomOfLidar>, JobError> {
    let mut holds = copies.iter().take_while(|all| all.holds_in >= HOLDS).count();
    // The smallest tolerance that was found to break one: at the end the next after the largest that holds.
    let (mut breaks, mut broken) = (copies.len(), None);
    while holds < breaks {
        let middle = usize::midpoint(holds, breaks);
        let Some(held) = within(copies[middle].tolerance)? else { return Ok(None) };
        if held.share >= HOLDS {
            holds = middle + 1;
        } else {
            (breaks, broken) = (middle, held.breaks);
        }
    }
    Ok(Some(RoomOfLidar {
        lidar,
        holds_within: holds.checked_sub(1).map(|last| copies[last].tolerance),
        breaks_within: copies.get(breaks).map(|next| next.tolerance),
        breaks: broken,
    }))
}
