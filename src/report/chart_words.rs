//! The verdict of a chart in sentences.

use super::seconds;
use crate::chart::{Chart, Engine, MOST_SWAPPED};

/// Largest difference between scores in `f64` and `f32`, as a share, that rounding explains: docs/fidelity.md.
const ROUNDING: f64 = 1e-3;

/// The setting to take, and how much it saves, in two sentences; none where nothing was measured.
pub fn chart_words(chart: &Chart) -> Vec<String> {
    let Some(verdict) = chart.verdict else { return Vec::new() };
    let (taken, finest) = (&chart.rated[verdict.setting], &chart.rated[0]);
    let tau = match taken.error.tau {
        Some(tau) => format!("Kendall τ is {:.3} ({:.3} to {:.3})", tau.value, tau.low, tau.high),
        None => "there is no ranking to keep".to_owned(),
    };
    let kept = format!(
        "Cheapest setting that keeps the ranking within {0} %: {1}, {2} a placement; its best placement \
         loses {3:.2} % of the best score (at most {4:.2} % in 95 % of resamples, {0} % allowed), of the \
         pairs farther apart than {0} % it swaps {5:.1} % (at most {6:.1} %, {7} % allowed), {tau}.",
        100.0 * chart.tolerance,
        taken.measured.setting.words(chart.edge),
        seconds(taken.measured.seconds),
        100.0 * taken.error.regret.value,
        100.0 * taken.error.regret.high,
        100.0 * taken.error.swapped.value,
        100.0 * taken.error.swapped.high,
        100.0 * MOST_SWAPPED,
    );
    let times = [(verdict.saves_over_f32, "f32"), (verdict.saves_over_f64, "f64")];
    let times: Vec<String> = times
        .into_iter()
        .filter_map(|(times, number)| Some(format!("{:.1} times as fast in {number}", times?)))
        .collect();
    let saved = format!(
        "Against the finest setting ({}) it is {}; it takes {} instead of {}.",
        finest.measured.setting.fidelity.words(chart.edge),
        times.join(" and "),
        mebibytes(taken.measured.bytes),
        mebibytes(finest.measured.bytes),
    );
    [Some(kept), Some(saved), checked(chart)].into_iter().flatten().collect()
}

/// Sentence on the distance of the reference in `f32` from the f64 scorer.
fn checked(chart: &Chart) -> Option<String> {
    let exact = chart.rated.iter().skip(1).find(|r| r.measured.setting.engine == Engine::F64)?;
    let off = exact.error.score_largest;
    let more = if off <= ROUNDING {
        String::new()
    } else {
        format!(
            ", more than the {} % that rounding explains: --full compares with f64",
            100.0 * ROUNDING
        )
    };
    Some(format!(
        "In f64, by code that shares nothing with the engines, {} placements differ from the reference by at most \
         {:.4} % of a score{more}.",
        exact.measured.scores.len(),
        100.0 * off
    ))
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
