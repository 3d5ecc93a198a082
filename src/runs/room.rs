//! How far the pose fields of placements may be off, and how far the body may tilt, until a requirement breaks, in scene
//! files.

use serde::Serialize;

use super::inputs::Files;
use super::shared::{OpenJob, SharedRequest};
use super::{Computing, RunError};
use crate::files::Session;
use crate::job::{Room, RoomSteps, SweptField, TILTS};
use crate::scan::conditions::in_words;
use crate::vehicle::Placement;

/// Room of each placement; an interrupted answer holds the first ones.
#[derive(Debug, Serialize)]
pub struct RoomFound {
    /// Weather and faults, as they are written.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// Deviations that were looked at.
    #[serde(flatten)]
    pub steps: RoomSteps,
    /// A row a placement.
    pub rows: Vec<Room>,
}

impl RoomFound {
    /// True if every placement meets its requirements as it is.
    pub fn all_meet(&self) -> bool {
        self.rows.iter().all(|row| row.missed.is_empty())
    }
}

/// Looks how far each field of each placement may be off, and how far the body may tilt.
///
/// # Errors
/// Files that cannot be read, a vehicle that requires nothing.
pub fn room(
    request: &SharedRequest,
    steps: RoomSteps,
    computing: &Computing<'_>,
) -> Result<RoomFound, RunError> {
    let _session = Session::begin();
    let (scenes, file) = Files::or_level_ground(&request.files, computing)?;
    let mut opened = OpenJob::new(request, &scenes, &file, computing)?;
    let moves = |placement: &Placement| SweptField::all(placement).count() as u64 + TILTS;
    let bar = computing.watcher.bar(opened.placements.iter().map(moves).sum(), Some("moves"));
    let mut go_on = |moves: u64| {
        bar.advance(moves);
        computing.watcher.goes_on()
    };
    let mut rows = Vec::new();
    for placement in &opened.placements {
        if !go_on(0) {
            break;
        }
        rows.push(opened.job.room_while(&mut opened.evaluator, placement, &steps, &mut go_on)?);
    }
    drop(bar);
    opened.finish(computing);
    Ok(RoomFound { conditions: in_words(&request.conditions), steps, rows })
}
