//! The verdict of a chart in sentences.

use super::seconds;
use crate::chart::{Chart, MOST_SWAPPED};

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
    let f32 = verdict.saves_over_f32.map_or(String::new(), |times| {
        format!(" and {times:.1} times as fast as the same in f32 on the CPU")
    });
    let saved = format!(
        "It is {:.1} times as fast as the finest setting ({}){f32}; it takes {} instead of {}.",
        verdict.saves_over_f64,
        finest.measured.setting.words(chart.edge),
        mebibytes(taken.measured.bytes),
        mebibytes(finest.measured.bytes),
    );
    vec![kept, saved]
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}
