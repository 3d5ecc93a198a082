//! Scores as columns: one array a score, `NaN` where there is none.

use std::borrow::Borrow;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PySlice};
use sightline::near_field::FEW_PLACEMENTS;
use sightline::score::{Seen, TaskScores};
use sightline::vehicle::{Region, Vehicle};
use sightline::{Constraints, Placement, Scores};

use crate::arrays::{column, shaped, to_python};
use crate::wait::{Progress, WorkMessages, watched};

/// Gets a score of a task.
type OfTask = fn(&TaskScores) -> Option<f64>;

const TASK: [(&str, OfTask); 6] = [
    ("m_sog", |task| task.m_sog),
    ("m_sog_scaled", |task| task.m_sog_scaled),
    ("m_sog_nonzero", |task| task.m_sog_nonzero),
    ("m_sog_scaled_nonzero", |task| task.m_sog_scaled_nonzero),
    ("information_gain", |task| task.information_gain),
    ("information_gain_share", |task| task.information_gain_share),
];

/// A score of each placement, `NaN` where it has none.
fn values_of<S: Borrow<Scores>>(scores: &[S], of: &dyn Fn(&Scores) -> Option<f64>) -> Vec<f64> {
    scores.iter().map(|scores| of(scores.borrow()).unwrap_or(f64::NAN)).collect()
}

/// Columns that depend on sums over covered voxels alone, by name.
pub(crate) fn summed<S: Borrow<Scores>>(scores: &[S]) -> Vec<(String, Vec<f64>)> {
    let mut columns = Vec::new();
    let mut add = |name: &str, of: &dyn Fn(&Scores) -> Option<f64>| {
        columns.push((name.to_owned(), values_of(scores, of)));
    };
    TASK.iter().for_each(|(name, of)| add(name, &|s| of(&s.segmentation)));
    add("near_gain", &|s| s.near_gain);
    add("near_gain_2", &|s| s.near_gain_2);
    add("near_gain_3", &|s| s.near_gain_3);
    add("s_mig", &|s| s.s_mig);
    add("entropy_sum", &|s| s.entropy_sum);
    add("covered", &|s| Some(s.covered));
    add("covered_nonzero", &|s| Some(s.covered_nonzero));
    if scores.iter().any(|scores| scores.borrow().detection.is_some()) {
        for (name, of) in TASK {
            let of = |s: &Scores| s.detection.as_ref().and_then(of);
            add(&format!("detection.{name}"), &of);
        }
    }
    columns
}

/// The `Scores` object of the package, with a column for everything that is known about placements of a vehicle.
pub(crate) fn scores_object<'a, 'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    scored: impl IntoIterator<Item = (&'a Placement, &'a Scores)>,
) -> PyResult<Bound<'py, PyAny>> {
    let (placements, scores): (Vec<&Placement>, Vec<&Scores>) = scored.into_iter().unzip();
    let columns = PyDict::new(py);
    for (name, values) in summed(&scores) {
        columns.set_item(name, column(py, values))?;
    }
    let maybe = |of: &dyn Fn(&Scores) -> Option<f64>| column(py, values_of(&scores, of));
    if scores.iter().any(|s| s.near_field.is_some()) {
        columns.set_item("near_field", maybe(&|s| s.near_field))?;
        columns.set_item("near_ring", maybe(&|s| s.near_ring))?;
    }
    columns.set_item("beams", column(py, scores.iter().map(|s| s.beams).collect()))?;
    columns.set_item("hit_share", maybe(&|s| s.hit_share))?;
    let classes: Vec<&str> = scores
        .first()
        .map(|s| s.covered_by_class.iter().map(|(name, _)| name.as_str()).collect())
        .unwrap_or_default();
    let counts: Vec<f64> =
        scores.iter().flat_map(|s| s.covered_by_class.iter().map(|(_, count)| *count)).collect();
    columns.set_item("covered_by_class", shaped(py, counts, &[scores.len(), classes.len()])?)?;
    let lidars = scores.iter().map(|s| s.unique_share.len()).max().unwrap_or(0);
    let unique = |s: &Scores| {
        let mut row = s.unique_share.clone();
        row.resize(lidars, f64::NAN);
        row
    };
    let unique: Vec<f64> = scores.iter().flat_map(|s| unique(s)).collect();
    columns.set_item("unique_share", shaped(py, unique, &[scores.len(), lidars])?)?;
    for (k, area) in scores.first().map(|s| &s.required[..]).unwrap_or_default().iter().enumerate()
    {
        let share = maybe(&|s| s.required.get(k).map(|seen| seen.share));
        columns.set_item(format!("seen.{}", area.name), share)?;
    }
    if scores.first().is_some_and(|s| !s.required.is_empty()) {
        columns.set_item("requirements_hold_in", maybe(&|s| s.requirements_hold_in))?;
    }
    if let Some(prices) = prices_of(vehicle, &placements) {
        columns.set_item("price", column(py, prices))?;
    }
    let rules = vehicle.rules();
    let broken: Vec<_> = placements.iter().map(|one| vehicle.broken_rules(&rules, one)).collect();
    let scored = placements.iter().copied().zip(scores.iter().copied());
    let feasible = scored.map(|one| is_feasible(vehicle, &rules, one));
    columns.set_item("feasible", column(py, feasible.collect()))?;
    let required = scores.first().map(|s| &s.required[..]).unwrap_or_default();
    let least = PyDict::new(py);
    required.iter().try_for_each(|seen| least.set_item(&seen.name, seen.least))?;
    let names: Vec<&str> = scores.iter().map(|s| s.name.as_str()).collect();
    let guards: Vec<Vec<String>> =
        scores.iter().map(|s| s.guards.iter().map(|guard| guard.keyed()).collect()).collect();
    // A dict a requirement is much for millions of placements.
    let few = if scores.len() <= FEW_PLACEMENTS { &scores[..] } else { &[] };
    let rules: Vec<&[Seen]> = few.iter().map(|s| &s.required[..]).collect();
    let class = py.import("sightline._scores")?.getattr("Scores")?;
    class.call1((names, columns, guards, classes, least, to_python(py, &rules)?, broken))
}

/// Price of each placement; `None` where no sensor of the vehicle has one.
fn prices_of(vehicle: &Vehicle, placements: &[&Placement]) -> Option<Vec<f64>> {
    let prices = placements.iter().map(|placement| vehicle.price_of_rig(placement));
    prices.collect::<Option<Vec<f64>>>().filter(|all| !all.is_empty())
}

/// The `Scores` object of placements that `work` scores beside the interpreter. No placements have the columns of one.
pub(crate) fn scored_object<'py>(
    py: Python<'py>,
    vehicle: &Vehicle,
    mut placements: Vec<Placement>,
    progress: Progress,
    work: impl FnOnce(&[Placement], &WorkMessages) -> PyResult<Vec<Scores>> + Send + 'static,
) -> PyResult<Bound<'py, PyAny>> {
    let are_none = placements.is_empty();
    if are_none {
        let rules = vehicle.constraints(&vehicle.fullest());
        let lowest: Vec<f64> = rules.variable_bounds().iter().map(|(low, _)| *low).collect();
        placements.push(Placement { name: "none".to_owned(), lidars: rules.poses_of(&lowest) });
    }
    let (placements, scores) = watched(py, progress, move |watch| {
        work(&placements, watch).map(|scores| (placements, scores))
    })??;
    let all = scores_object(py, vehicle, placements.iter().zip(&scores))?;
    if are_none { all.getattr("rows")?.get_item(PySlice::new(py, 0, 0, 1)) } else { Ok(all) }
}

/// True if a placement keeps every rule of the mounts, with as many LiDARs on each as it holds, meets all requirements,
/// and no guard doubts its scores.
fn is_feasible(
    vehicle: &Vehicle,
    rules: &Constraints,
    (placement, scores): (&Placement, &Scores),
) -> bool {
    let mounts = rules.mounts_of(&placement.lidars);
    let are_counted = vehicle.mounts.iter().all(|mount| {
        let on = |region: &&Region| **region == *mount.region;
        let count = mounts.iter().flatten().filter(|region| on(region)).count();
        (mount.count[0]..=mount.count[1]).contains(&count)
    });
    let is_sound = scores.doubts() == 0 && scores.missing() == 0.0;
    is_sound
        && are_counted
        && mounts.iter().all(Option::is_some)
        && rules.violations(placement).is_empty()
}
