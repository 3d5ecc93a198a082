//! How far the pose fields of placements may be off until a requirement breaks, in scene files.

use serde::Serialize;

use super::inputs::Files;
use super::shared::{Opened, SharedRequest};
use super::{Computing, Error};
use crate::files::Session;
use crate::job::{Room, RoomSteps};
use crate::scan::conditions::in_words;

/// Room of placements; an interrupted answer holds what was looked at.
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

/// Looks how far each field of each placement may be off.
///
/// # Errors
/// Files that cannot be read, a vehicle that requires nothing.
pub fn room(
    request: &SharedRequest,
    steps: RoomSteps,
    computing: &Computing<'_>,
) -> Result<RoomFound, Error> {
    let _session = Session::begin();
    let (scenes, file) = Files::or_level_ground(&request.files, computing)?;
    let mut opened = Opened::new(request, &scenes, &file, computing)?;
    let problem = opened.job.problem()?;
    if problem.content().areas().is_empty() && problem.target_rules().is_empty() {
        let words = "nothing is required, so that nothing can break; give its `require` an area or a target, as \
                     { \"target\": \"car\", \"within\": 30, \"share\": 0.95 }";
        let vehicle = opened.job.scene().vehicle();
        return Err(Error::Usage(format!("vehicle `{}`: {words}", vehicle.name)));
    }
    let fields = |placement| Room::fields_of(placement).count() as u64;
    let total: u64 = opened.placements.iter().map(fields).sum();
    let bar = computing.watcher.bar(total, Some("pose fields"));
    let mut rows = Vec::new();
    for placement in opened.placements.iter().take_while(|_| computing.watcher.goes_on()) {
        let (job, evaluator) = (&opened.job, &mut opened.evaluator);
        let mut room = job.room_as_given(evaluator, placement)?;
        let fields = Room::fields_of(placement).take_while(|_| computing.watcher.goes_on());
        for field in fields.filter(|_| room.missed.is_empty()).collect::<Vec<_>>() {
            if !computing.watcher.goes_on() {
                break;
            }
            room.fields.push(job.room_of_field(evaluator, placement, field, &steps)?);
            bar.advance(1);
        }
        rows.push(room);
    }
    drop(bar);
    opened.finish(computing);
    Ok(RoomFound { conditions: in_words(&request.conditions), steps, rows })
}
