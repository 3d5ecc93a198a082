//! Columns that several studies share.

use std::collections::HashSet;

use super::scene::StudyScene;
use super::{Row, StudyError};
use crate::score::{NEAR_GAIN, Objective, Scores};
use crate::search::Evaluator;

/// Columns that most studies show of a placement.
pub(super) const SCORES: [&str; 6] =
    ["gain %", "near gain %", "M-SOG/N ×1e-6", "detection ×1e-6", "covered", "guards violated"];

/// Column of [`SCORES`] that searches for an objective make large; the gain where it is none of them.
pub(super) fn made_large(objective: &Objective) -> usize {
    match objective.to_string().as_str() {
        NEAR_GAIN => 1,
        "m_sog_scaled" => 2,
        "detection.m_sog_scaled" => 3,
        _ => 0,
    }
}

/// Values of [`SCORES`].
pub(super) fn values(scores: &Scores) -> Vec<Option<f64>> {
    vec![
        scores.segmentation.information_gain_share.map(|v| 100.0 * v),
        scores.near_gain.map(|v| 100.0 * v),
        scores.segmentation.m_sog_scaled.map(|v| 1e6 * v),
        scores.detection.and_then(|d| d.m_sog_scaled).map(|v| 1e6 * v),
        Some(scores.covered),
        Some(scores.guards.len() as f64),
    ]
}

/// The best placement of a search and the values of [`SCORES`].
pub(super) fn of_best(scene: &StudyScene, evaluator: &mut Evaluator) -> Result<Row, StudyError> {
    let Some(best) = scene.optimize(evaluator)? else { return Ok(scene.none_found()) };
    let scores = scene.score(evaluator, &best)?;
    Ok(Row::scored(values(&scores), best, &scores))
}

/// Numbers of one column, counted from the first value on; NaN where there is none.
pub(super) fn numbers(rows: &[Row], column: usize) -> Vec<f64> {
    rows.iter().map(|row| row.values.get(column).copied().flatten().unwrap_or(f64::NAN)).collect()
}

/// Refuses names used twice: cases are known by name, and would share their numbers.
pub(super) fn check_distinct<'a>(
    names: impl IntoIterator<Item = &'a str>,
    cases: &'static str,
    mend: &'static str,
) -> Result<(), StudyError> {
    let mut seen = HashSet::new();
    match names.into_iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(StudyError::SameName { cases, name: name.to_owned(), mend }),
        None => Ok(()),
    }
}
