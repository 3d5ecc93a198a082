//! Tables of charts: the settings of a scene, and the setting to take in each of several.

use super::chart_table::seconds;
use super::chart_words::chart_words;
use super::text::{align_columns, numbered};
use crate::chart::{Chart, Engine};

/// Titles of the printed table.
const TITLES: [&str; 12] = [
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

/// The table of one scene's settings, with sentences on it: the reference, the front and the setting to take, or all
/// of a full chart.
pub fn chart_text(found: &Chart) -> String {
    let rows = found.rows();
    let mut text = format!(
        "{}: {} placements ranked by {}, against {}\n",
        found.scene,
        found.placements.len(),
        found.objective,
        rows.first().map_or("nothing", |row| &row.setting)
    );
    let chosen = found.verdict.map(|verdict| verdict.setting);
    let is_exact = |i: usize| rows[i].rung.engine == Engine::F64;
    let is_printed =
        |i: usize| found.full || i == 0 || Some(i) == chosen || rows[i].on_front || is_exact(i);
    let cells = rows.iter().enumerate().filter(|(i, _)| is_printed(*i)).map(|(_, row)| {
        let mark = if row.same_quantity { " " } else { "*" };
        let error = &row.error;
        let (tau, range) = match error.tau {
            Some(t) => (format!("{:.3}", t.value), format!("{:.3}–{:.3}", t.low, t.high)),
            None => ("–".to_owned(), String::new()),
        };
        vec![
            row.setting.clone(),
            seconds(row.seconds),
            format!("{:.1}", row.bytes as f64 / f64::from(1 << 20)),
            format!("{:.3}{mark}", 100.0 * error.score_median),
            format!("{:.3}{mark}", 100.0 * error.score_largest),
            tau,
            range,
            format!("{:.2}", 100.0 * error.regret.value),
            format!("{:.2}–{:.2}", 100.0 * error.regret.low, 100.0 * error.regret.high),
            format!("{:.1}", 100.0 * error.swapped.value),
            format!("{:.1}–{:.1}", 100.0 * error.swapped.low, 100.0 * error.swapped.high),
            if row.on_front { "front" } else { "" }.to_owned(),
        ]
    });
    let titles = TITLES.map(str::to_owned).to_vec();
    text += &align_columns(&std::iter::once(titles).chain(cells).collect::<Vec<_>>());
    text += "* other voxels, beams or coverage make the score another quantity; only the ranking compares\n";
    text += &format!(
        "swapped: of the pairs farther apart than {} % of the best score, those in another order\n",
        100.0 * found.tolerance
    );
    if !found.full {
        let whole = rows.iter().filter(|row| row.left.is_none()).count();
        text += &format!(
            "front: among the {whole} settings measured to the end; {} were left early and {} not begun, since \
             they cannot be the advice (chart.csv says why; --full measures all)\n",
            rows.len() - whole,
            found.skipped.len()
        );
    }
    for line in &found.left_out {
        text += &format!("left out: {line}\n");
    }
    text += "\n";
    for line in chart_words(found) {
        text += &format!("{line}\n");
    }
    text
}

/// The setting to take in each scene, a row each.
pub fn charts_text(charts: &[Chart]) -> String {
    let titles = ["scene", "cheapest setting that keeps the ranking", "× faster", "τ", "regret %"];
    let mut rows = vec![titles.map(str::to_owned).to_vec()];
    let names = numbered(charts.iter().map(|chart| chart.scene.clone()));
    for (name, chart) in names.into_iter().zip(charts) {
        let all = chart.rows();
        let chosen = chart.verdict.and_then(|verdict| Some((verdict, all.get(verdict.setting)?)));
        rows.push(match chosen {
            None => vec![name, "none".to_owned()],
            Some((verdict, row)) => vec![
                name,
                row.setting.clone(),
                verdict.saves_over_f64.map_or("–".into(), |times| format!("{times:.1}")),
                row.error.tau.map_or("–".into(), |tau| format!("{:.3}", tau.value)),
                format!("{:.2}", 100.0 * row.error.regret.value),
            ],
        });
    }
    format!("\nall scenes\n{}", align_columns(&rows))
}
