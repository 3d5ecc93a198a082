//! `study near-field`, `targets`, `redundancy` and `overlap`: ground, targets and things that placements see.

use super::args::Asked;
use super::output::{Exit, answer};
use crate::report::coverage::{near_field_text, overlap_text, redundancy_text};
use crate::report::tables::{near_field_csv, overlap_csv, redundancy_csv, targets_csv};
use crate::report::targets::targets_text;
use crate::runs::coverage::{NearFieldRequest, TargetsRequest, near_fields, targets};
use crate::runs::sensitivity::{OverlapRequest, RedundancyRequest, overlap, redundancy};
use crate::runs::{RunError, TableFormat, Watcher};
use crate::scan::conditions::under;
use sightline_files::json::counted;

pub(super) type NearFieldArgs = Asked<NearFieldRequest, TableFormat>;

pub(super) fn run_near_field(args: &NearFieldArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let found = near_fields(&args.request, &args.computing(&terminal))?;
    answer(
        args.format,
        &found,
        || near_field_csv(&found.near_fields),
        || {
            let (scene, area) = (&found.scene, found.ground_area);
            let frames = counted(found.frames, "frame");
            let under = under(&found.conditions);
            let table = near_field_text(&found.near_fields);
            format!(
                "{scene}: {area:.0} m² of ground within 10 m of the body, {frames}{under}\n{table}"
            )
        },
    )?;
    found.wrote.iter().for_each(|wrote| terminal.note(wrote));
    Ok(terminal.exit())
}

pub(super) type TargetsArgs = Asked<TargetsRequest, TableFormat>;

pub(super) fn run_targets(args: &TargetsArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let found = targets(&args.request, &args.computing(&terminal))?;
    answer(
        args.format,
        &found,
        || targets_csv(&found.table),
        || {
            let (beams, over, under) = (found.beams, &found.over, under(&found.conditions));
            let table = targets_text(&found.table, beams, found.reach);
            format!(
                "Distances from the origin. {beams} beams or more meet a target, {over}{under}\n\n{table}"
            )
        },
    )?;
    found.wrote.iter().for_each(|wrote| terminal.note(wrote));
    Ok(terminal.exit())
}

pub(super) type RedundancyArgs = Asked<RedundancyRequest, TableFormat>;

pub(super) fn run_redundancy(args: &RedundancyArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let found = redundancy(&args.request, &args.computing(&terminal))?;
    let rows: Vec<_> = found.rows.iter().chain(&found.mean).collect();
    answer(
        args.format,
        &found,
        || redundancy_csv(&rows),
        || {
            let (beams, over, under) = (found.beams, &found.over, under(&found.conditions));
            let tables = redundancy_text(&rows);
            let at = targets_at(&found.distances);
            format!(
                "Seen by how many LiDARs, {over}{under}\nTargets{at}, {beams} beams or more each\n\n{tables}"
            )
        },
    )?;
    Ok(terminal.exit())
}

/// Distances of targets in words: ` 5 to 50 m from the origin`; empty without any.
fn targets_at(distances: &[f64]) -> String {
    let ends = distances.first().zip(distances.last());
    ends.map_or(String::new(), |(from, to)| format!(" {from} to {to} m from the origin"))
}

pub(super) type OverlapArgs = Asked<OverlapRequest, TableFormat>;

pub(super) fn run_overlap(args: &OverlapArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let found = overlap(&args.request, &args.computing(&terminal))?;
    answer(
        args.format,
        &found,
        || overlap_csv(&found.rows),
        || {
            let (over, under) = (&found.over, under(&found.conditions));
            let tables = overlap_text(&found.rows);
            format!("Surfaces and directions that pairs of LiDARs share, {over}{under}\n\n{tables}")
        },
    )?;
    Ok(terminal.exit())
}
