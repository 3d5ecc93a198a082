//! One function a study: its cases, its columns and what they say.

mod compare;
mod sensors;
mod world;

pub(super) use compare::{loss, random, regions, tasks};
pub(super) use sensors::{channels, height, lidars};
pub(super) use world::{published, transfer, voxels};

use std::collections::HashSet;

use sightline::report::{Axis, Plot, Series};
use sightline::score::Scores;
use sightline::study::{Row, Table};
use sightline::vehicle::Placement;

use super::bench::Bench;
use crate::cli::error::Error;

/// Columns that most studies show of a placement.
const SCORE_COLUMNS: [&str; 5] =
    ["gain %", "M-SOG/N ×1e-6", "detection ×1e-6", "covered", "guards violated"];

/// A row of [`SCORE_COLUMNS`].
fn score_values(scores: &Scores) -> Vec<Option<f64>> {
    vec![
        scores.segmentation.information_gain_share.map(|v| 100.0 * v),
        scores.segmentation.m_sog_scaled.map(|v| 1e6 * v),
        scores.detection.and_then(|d| d.m_sog_scaled).map(|v| 1e6 * v),
        Some(scores.covered),
        Some(scores.guards.len() as f64),
    ]
}

fn score_row(name: &str, scores: &Scores, placement: Option<Placement>) -> Row {
    Row { name: name.to_owned(), values: score_values(scores), placement }
}

fn columns(first: &str, more: &[&str]) -> Vec<String> {
    std::iter::once(first).chain(more.iter().copied()).map(str::to_owned).collect()
}

/// Refuses names used twice: cases are told apart by them, and would share their numbers.
fn check_distinct<'a>(
    names: impl IntoIterator<Item = &'a str>,
    what: &str,
    mend: &str,
) -> Result<(), Error> {
    let mut seen = HashSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(Error::Usage(format!("two {what} are called `{name}`; {mend}"))),
        None => Ok(()),
    }
}

/// Title of a study of one scene.
fn title(bench: &Bench, what: &str) -> String {
    format!("{}: {what}", bench.scene.name())
}

/// One column of a table over its cases.
fn plot_of(table: &Table, column: &str, x_title: &str) -> Plot {
    let values = table.column(column);
    let points = values.iter().enumerate().map(|(k, v)| (k as f64, v.unwrap_or(f64::NAN)));
    Plot {
        title: table.title.clone(),
        x_title: x_title.to_owned(),
        y_title: column.to_owned(),
        x: Axis::Names(table.rows.iter().map(|row| row.name.clone()).collect()),
        series: vec![Series {
            name: column.to_owned(),
            points: points.collect(),
            line: true,
            labels: Vec::new(),
        }],
    }
}

/// One series a case, over its columns.
fn series_by_row(table: &Table) -> Vec<Series> {
    let values = |row: &Row| {
        row.values.iter().enumerate().map(|(k, v)| (k as f64, v.unwrap_or(f64::NAN))).collect()
    };
    let series = table.rows.iter().map(|row| Series {
        name: row.name.clone(),
        points: values(row),
        line: false,
        labels: Vec::new(),
    });
    series.collect()
}
