//! `study sweep` and `tolerance`: scores along one field of a placement, and under errors of mounting.

use super::args::Asked;
use super::output::Exit;
use crate::job::RoomSteps;
use crate::report::study::{room_text, sweep_text};
use crate::report::tables::{room_csv, sweep_csv};
use crate::runs::sensitivity::{RoomRequest, SweepRequest, room, sweep};
use crate::runs::{RunError, TableFormat};
use crate::scan::conditions::under;

pub(super) type SweepArgs = Asked<SweepRequest, TableFormat>;

pub(super) fn run_sweep(args: &SweepArgs) -> Result<Exit, RunError> {
    let (exit, _) = args.answer(
        sweep,
        |found| sweep_csv(&found.sweeps),
        |found| {
            let (over, under) = (&found.over, under(&found.conditions));
            let tables = sweep_text(&found.sweeps);
            format!("Scores and requirements by one pose field, {over}{under}\n\n{tables}")
        },
    )?;
    Ok(exit)
}

pub(super) type RoomArgs = Asked<RoomRequest, TableFormat>;

pub(super) fn run_room(args: &RoomArgs) -> Result<Exit, RunError> {
    let (exit, found) = args.answer(
        room,
        |found| room_csv(&found.rows),
        |found| {
            // Thousandths are enough for people.
            let RoomSteps { most_mm, most_deg, most_tilt_deg, steps, .. } = found.steps;
            let each = |most: f64| (1e3 * most / f64::from(steps)).round() / 1e3;
            let [mm, deg, tilt] = [most_mm, most_deg, most_tilt_deg].map(each);
            let (over, under) = (&found.over, under(&found.conditions));
            let tables = room_text(&found.rows);
            let which = if found.all_meet() { "all" } else { "the met" };
            format!(
                "Deviations within which {which} requirements hold, every {mm} mm and {deg}°, tilt every {tilt}°, {over}{under}\n\n{tables}"
            )
        },
    )?;
    Ok(if exit == Exit::Done && !found.all_meet() { Exit::CheckFailed } else { exit })
}
