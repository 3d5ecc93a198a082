//! The verdict in words, and the rows of the table.

use serde::Serialize;
use serde_json::json;
use sightline::chart::{MOST_SWAPPED, Rated, Verdict};
use sightline::report::seconds;

use super::Chart;
use crate::cli::error::Error;
use crate::cli::table;

/// What is added to the state for the reader.
#[derive(Serialize)]
pub(super) struct Summary {
    scene: String,
    placements: Vec<String>,
    tolerance: f64,
    threads: usize,
    reference: Option<String>,
    rows: Vec<serde_json::Value>,
    left_out: Vec<String>,
    verdict: Option<Verdict>,
    words: Vec<String>,
    finished: bool,
}

impl Summary {
    pub(super) fn new(
        chart: &Chart,
        rated: &[Rated],
        verdict: Option<Verdict>,
        interrupted: bool,
    ) -> Self {
        let words = |r: &Rated| r.measured.rung.words(chart.edge);
        let rows = rated.iter().map(|r| {
            json!({
                "setting": words(r),
                "rung": r.measured.rung,
                "seconds": r.measured.seconds,
                "spread": r.measured.spread,
                "bytes": r.measured.bytes,
                "beams": r.measured.beams,
                "triangles": r.measured.triangles,
                "pose": r.measured.pose,
                "error": r.error,
                "same_quantity": is_comparable(rated, r),
                "on_front": r.on_front,
            })
        });
        Self {
            scene: chart.workshop.world().scene().name().to_owned(),
            placements: chart.workshop.placements().iter().map(|p| p.name.clone()).collect(),
            tolerance: chart.tolerance,
            threads: rayon::current_num_threads(),
            reference: rated.first().map(words),
            rows: rows.collect(),
            left_out: chart.ladder.left_out.clone(),
            verdict,
            words: verdict.map(|v| in_words(chart, rated, &v)).unwrap_or_default(),
            finished: !interrupted,
        }
    }
}

fn is_comparable(rated: &[Rated], row: &Rated) -> bool {
    let finest = &rated[0].measured.rung.fidelity;
    row.measured.rung.fidelity.same_quantity(finest)
}

/// The verdict in two sentences.
fn in_words(chart: &Chart, rated: &[Rated], verdict: &Verdict) -> Vec<String> {
    let (taken, finest) = (&rated[verdict.setting], &rated[0]);
    let tau = match taken.error.tau {
        Some(tau) => format!("Kendall τ is {:.3} ({:.3} to {:.3})", tau.value, tau.low, tau.high),
        None => "there is no ranking to keep".to_owned(),
    };
    let kept = format!(
        "Cheapest setting that keeps the ranking within {0} %: {1}, {2} a placement; its best placement \
         loses {3:.2} % of the best score (at most {4:.2} % in 95 % of resamples, {0} % allowed), of the \
         pairs farther apart than {0} % it swaps {5:.1} % (at most {6:.1} %, {7} % allowed), {tau}.",
        100.0 * chart.tolerance,
        taken.measured.rung.words(chart.edge),
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
        finest.measured.rung.words(chart.edge),
        mebibytes(taken.measured.bytes),
        mebibytes(finest.measured.bytes),
    );
    vec![kept, saved]
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

impl Chart<'_> {
    pub(super) fn print(&self, rated: &[Rated], summary: &Summary) -> Result<(), Error> {
        outln!(
            "{}: {} placements ranked by {}, against {}",
            summary.scene,
            summary.placements.len(),
            self.state.settings.objective,
            summary.reference.as_deref().unwrap_or("nothing")
        )?;
        let titles = [
            "setting",
            "s a placement",
            "MiB",
            "score error %: median",
            "largest",
            "Kendall τ",
            "95 %",
            "regret %",
            "95 %",
            "swapped %",
            "95 %",
            "front",
        ];
        let mut rows = vec![titles.map(str::to_owned).to_vec()];
        rows.extend(rated.iter().map(|r| {
            let mark = if is_comparable(rated, r) { " " } else { "*" };
            let error = &r.error;
            let (tau, range) = match error.tau {
                Some(t) => (format!("{:.3}", t.value), format!("{:.3}–{:.3}", t.low, t.high)),
                None => ("–".to_owned(), String::new()),
            };
            vec![
                r.measured.rung.words(self.edge),
                seconds(r.measured.seconds),
                format!("{:.1}", r.measured.bytes as f64 / f64::from(1 << 20)),
                format!("{:.3}{mark}", 100.0 * error.score_median),
                format!("{:.3}{mark}", 100.0 * error.score_largest),
                tau,
                range,
                format!("{:.2}", 100.0 * error.regret.value),
                format!("{:.2}–{:.2}", 100.0 * error.regret.low, 100.0 * error.regret.high),
                format!("{:.1}", 100.0 * error.swapped.value),
                format!("{:.1}–{:.1}", 100.0 * error.swapped.low, 100.0 * error.swapped.high),
                if r.on_front { "front" } else { "" }.to_owned(),
            ]
        }));
        out!("{}", table::align(&rows))?;
        outln!(
            "* other voxels, beams or coverage make the score another quantity; only the ranking compares"
        )?;
        outln!(
            "swapped: of the pairs farther apart than {} % of the best score, those in another order",
            100.0 * self.tolerance
        )?;
        for line in &summary.left_out {
            outln!("left out: {line}")?;
        }
        outln!()?;
        for line in &summary.words {
            outln!("{line}")?;
        }
        outln!("chart: {}", self.folder.join("chart.svg").display())
    }
}
