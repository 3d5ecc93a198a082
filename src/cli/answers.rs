//! `study near-field`, `targets`, `redundancy`, `overlap`, `sweep` and `tolerance`: ground, targets and things that
//! placements see, and scores along one field of a placement and under errors of mounting.

use super::args::Asked;
use super::output::Exit;
use crate::job::RoomSteps;
use crate::json::counted;
use crate::report::coverage::{near_field_text, overlap_text, redundancy_text};
use crate::report::study::{room_text, sweep_text};
use crate::report::tables::{
    near_field_csv, overlap_csv, redundancy_csv, room_csv, sweep_csv, targets_csv,
};
use crate::report::targets::{in_frames, targets_text};
use crate::runs::coverage::{NearFieldRequest, TargetsRequest, near_fields, targets};
use crate::runs::sensitivity::{RoomRequest, SweepRequest, room, sweep};
use crate::runs::sharing::{OverlapRequest, RedundancyRequest, overlap, redundancy};
use crate::runs::{RunError, TableFormat};
use crate::scan::conditions::under;

pub(super) type NearFieldArgs = Asked<NearFieldRequest, TableFormat>;

pub(super) fn run_near_field(args: &NearFieldArgs) -> Result<Exit, RunError> {
    let (exit, _) = args.answer(
        near_fields,
        |found| near_field_csv(&found.near_fields),
        |found| {
            let (scene, area) = (&found.scene, found.ground_area);
            let (frames, under) = (counted(found.frames, "frame"), under(&found.conditions));
            let table = near_field_text(&found.near_fields);
            format!(
                "{scene}: {area:.0} m² of ground within 10 m of the body, {frames}{under}\n{table}"
            )
        },
    )?;
    Ok(exit)
}

pub(super) type TargetsArgs = Asked<TargetsRequest, TableFormat>;

pub(super) fn run_targets(args: &TargetsArgs) -> Result<Exit, RunError> {
    let (exit, _) = args.answer(
        targets,
        |found| targets_csv(&found.table),
        |found| {
            let (beams, over, under) = (found.beams, &found.over, under(&found.conditions));
            let within = in_frames(&found.table, found.of_frames);
            let table = targets_text(&found.table, (beams, found.of_frames), found.reach);
            format!(
                "Distances from the origin. {beams} beams or more meet a target{within}, {over}{under}\n\n{table}"
            )
        },
    )?;
    Ok(exit)
}

pub(super) type RedundancyArgs = Asked<RedundancyRequest, TableFormat>;

pub(super) fn run_redundancy(args: &RedundancyArgs) -> Result<Exit, RunError> {
    let (exit, _) = args.answer(
        redundancy,
        |found| redundancy_csv(&found.all()),
        |found| {
            let (beams, over, under) = (found.beams, &found.over, under(&found.conditions));
            let (tables, at) = (redundancy_text(&found.all()), targets_at(&found.distances));
            format!(
                "Seen by how many LiDARs, {over}{under}\nTargets{at}, {beams} beams or more each\n\n{tables}"
            )
        },
    )?;
    Ok(exit)
}

/// Distances of targets in words: ` 5 to 50 m from the origin`; empty without any.
fn targets_at(distances: &[f64]) -> String {
    let ends = distances.first().zip(distances.last());
    ends.map_or(String::new(), |(from, to)| format!(" {from} to {to} m from the origin"))
}

pub(super) type OverlapArgs = Asked<OverlapRequest, TableFormat>;

pub(super) fn run_overlap(args: &OverlapArgs) -> Result<Exit, RunError> {
    let (exit, _) = args.answer(
        overlap,
        |found| overlap_csv(&found.rows),
        |found| {
            let (over, under) = (&found.over, under(&found.conditions));
            let tables = overlap_text(&found.rows);
            format!("Surfaces and directions that pairs of LiDARs share, {over}{under}\n\n{tables}")
        },
    )?;
    Ok(exit)
}

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
