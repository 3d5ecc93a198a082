//! A chart as a table, and its advice in words.

use maud::{Markup, html};

use super::columns::table_text;
use super::svg::{ACCENT, INK, SOFT, px, trimmed};
use super::tables::{Cells, header};
use super::text::numbered;
use crate::chart::ranking::BootstrapInterval;
use crate::chart::{
    Chart, ChartRow, Engine, Left, MOST_SWAPPED, Rated, SceneDetail, Setting, Skipped,
};
use crate::csv::{csv, number};
use crate::json::counted;

/// Titles of the printed tables: what a setting costs and how far it is off, then how it ranks.
const COST: [&str; 6] =
    ["setting", "s a placement", "MiB", "median error %", "largest error %", "front"];
const RANKING: [&str; 7] = [
    "setting", "Kendall τ", "τ at least", "regret %", "regret at most", "swapped %",
    "swapped at most",
];

/// The table of one scene's settings, with sentences on it: the reference, the front and the setting to take, or all
/// of a full chart.
pub(crate) fn chart_text(found: &Chart) -> String {
    let rows = found.rows();
    let mut text = format!(
        "{}: {} ranked by {}, against {}\n",
        found.scene,
        counted(found.placements.len(), "placement"),
        found.objective,
        rows.first().map_or("nothing", |row| &row.setting)
    );
    let chosen = found.verdict.map(|verdict| verdict.setting);
    let is_exact = |i: usize| rows[i].rung.engine == Engine::F64;
    let is_printed =
        |i: usize| found.full || i == 0 || Some(i) == chosen || rows[i].on_front || is_exact(i);
    let printed = rows.iter().enumerate().filter(|(i, _)| is_printed(*i));
    let (cost, ranking): (Vec<_>, Vec<_>) =
        printed.map(|(_, row)| (cost_cells(row), ranking_cells(row))).unzip();
    text += &format!("{}\n{}", table_text(&COST, cost), table_text(&RANKING, ranking));
    text += "error: of the scores; at least and at most: in 95 % of resamples\n";
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

fn cost_cells(row: &ChartRow) -> Vec<String> {
    let mark = if row.same_quantity { " " } else { "*" };
    vec![
        row.setting.clone(),
        seconds(row.seconds),
        format!("{:.1}", row.bytes as f64 / f64::from(1 << 20)),
        format!("{:.3}{mark}", 100.0 * row.error.score_median),
        format!("{:.3}{mark}", 100.0 * row.error.score_largest),
        if row.on_front { "front" } else { "" }.to_owned(),
    ]
}

fn ranking_cells(row: &ChartRow) -> Vec<String> {
    let error = &row.error;
    let [tau, least] = match error.tau {
        Some(tau) => [tau.value, tau.low].map(|tau| format!("{tau:.3}")),
        None => ["–".to_owned(), String::new()],
    };
    vec![
        row.setting.clone(),
        tau,
        least,
        format!("{:.2}", 100.0 * error.regret.value),
        format!("{:.2}", 100.0 * error.regret.high),
        format!("{:.1}", 100.0 * error.swapped.value),
        format!("{:.1}", 100.0 * error.swapped.high),
    ]
}

/// The setting to take in each scene, a row each.
pub(crate) fn charts_text(charts: &[Chart]) -> String {
    let titles = ["scene", "cheapest setting that keeps the ranking", "× faster", "τ", "regret %"];
    let names = numbered(charts.iter().map(|chart| chart.scene.clone()));
    let rows = names.into_iter().zip(charts).map(|(name, chart)| {
        let all = chart.rows();
        let chosen = chart.verdict.and_then(|verdict| Some((verdict, all.get(verdict.setting)?)));
        match chosen {
            None => vec![name, "none".to_owned()],
            Some((verdict, row)) => vec![
                name,
                row.setting.clone(),
                verdict.saves_over_f64.map_or("–".into(), |times| format!("{times:.1}")),
                row.error.tau.map_or("–".into(), |tau| format!("{:.3}", tau.value)),
                format!("{:.2}", 100.0 * row.error.regret.value),
            ],
        }
    });
    format!("\nall scenes\n{}", table_text(&titles, rows))
}

/// Titles of the table's columns with their x in pixels: the first begins there, the others end there.
const COLUMNS: [(&str, f64); 8] = [
    ("setting", 50.0),
    ("time", 430.0),
    ("MiB", 486.0),
    ("error % (most)", 606.0),
    ("τ (95 %)", 752.0),
    ("regret % (to)", 862.0),
    ("swapped % (to)", 976.0),
    ("", 34.0),
];

/// Cost and error of the numbered settings: `rows` holds the height of each and its place in the chart.
pub(super) fn table(chart: &Chart, top: f64, rows: &[(f64, usize)]) -> Markup {
    let chosen = chart.verdict.map(|verdict| verdict.setting);
    html! {
        (row(top, COLUMNS.map(|(title, _)| title.to_owned()), SOFT, false))
        @for (number, &(y, i)) in rows.iter().enumerate() {
            @let is_chosen = chosen == Some(i);
            (row(y, cells(&chart.rated, i, number + 1, chart.edge), if is_chosen { ACCENT } else { INK }, is_chosen))
        }
    }
}

fn row(y: f64, cells: [String; 8], ink: &str, bold: bool) -> Markup {
    let columns = cells.into_iter().zip(COLUMNS).enumerate();
    html! {
        @for (column, (cell, (_, x))) in columns {
            text x=(x) y=(px(y)) font-size="12" fill=(ink) font-weight=[bold.then_some("600")]
                text-anchor=(if column == 0 { "start" } else { "end" }) { (cell) }
        }
    }
}

fn cells(rated: &[Rated], i: usize, number: usize, edge: f64) -> [String; 8] {
    let finest = rated[0].measured.setting.fidelity;
    let (measured, error) = (&rated[i].measured, &rated[i].error);
    let percent = |value: f64| format!("{:.2}", 100.0 * value);
    let pose = measured.pose.map_or(String::new(), |pose| {
        let bytes = pose.bytes as f64 / f64::from(1 << 20);
        format!("; a pose {}, {bytes:.2} MiB", seconds(pose.seconds))
    });
    [
        measured.setting.words(edge) + &pose,
        seconds(measured.seconds),
        format!("{:.1}", measured.bytes as f64 / f64::from(1 << 20)),
        if measured.setting.fidelity.same_quantity(&finest) {
            format!("{} ({})", percent(error.score_median), percent(error.score_largest))
        } else {
            "another quantity".to_owned()
        },
        error.tau.map_or(String::new(), |tau| {
            format!("{:.3} ({:.3}–{:.3})", tau.value, tau.low, tau.high)
        }),
        format!("{} ({})", percent(error.regret.value), percent(error.regret.high)),
        format!("{:.1} ({:.1})", 100.0 * error.swapped.value, 100.0 * error.swapped.high),
        number.to_string(),
    ]
}

/// Titles of a line: the setting, its cost and errors, cost and errors of an atlas pose, and the extent of the measurement.
const IN_CSV: &str = "setting,engine,voxel_m,azimuth_divisor,frames,coverage,merged_m,seconds,seconds_low,seconds_high,bytes,\
                      beams,triangles,score_error_median,score_error_largest,tau,tau_low,tau_high,regret,regret_low,\
                      regret_high,swapped,swapped_low,swapped_high,pose_seconds,pose_bytes,on_front,placements,left_early";

/// One line a setting: its description, cost and error. A setting that was left early has the errors over its first
/// placements, and the reason. Settings that were not begun come last. Lines of `several` scenes begin with the scene.
pub(crate) fn charts_csv(charts: &[Chart], several: bool) -> String {
    let names = numbered(charts.iter().map(|chart| chart.scene.clone()));
    let mut rows = vec![header(IN_CSV)];
    rows[0].splice(..0, several.then(|| "scene".to_owned()));
    for (name, chart) in names.iter().zip(charts) {
        let begun = chart.rated.iter().map(|rated| measured_cells(rated, chart.edge));
        let all = begun.chain(chart.skipped.iter().map(|of| skipped_cells(of, chart.edge)));
        rows.extend(all.map(|mut row| {
            row.splice(..0, several.then(|| name.clone()));
            row
        }));
    }
    csv(rows)
}

fn measured_cells(Rated { measured, error, on_front }: &Rated, edge: f64) -> Cells {
    let mut row = setting_cells(&measured.setting, edge);
    let [low, high] = measured.spread;
    row.extend([measured.seconds, low, high].map(|seconds| format!("{seconds:.4e}")));
    row.extend([measured.bytes, measured.beams, measured.triangles].map(|of| of.to_string()));
    row.extend([error.score_median, error.score_largest].map(number));
    let ends = |of: BootstrapInterval| [of.value, of.low, of.high].map(number);
    row.extend(error.tau.map(ends).unwrap_or_default());
    row.extend([error.regret, error.swapped].into_iter().flat_map(ends));
    let pose = measured.pose.map(|of| [format!("{:.4e}", of.seconds), of.bytes.to_string()]);
    row.extend(pose.unwrap_or_default());
    let left = measured.left.map_or("", Left::words).to_owned();
    row.extend([on_front.to_string(), measured.scores.len().to_string(), left]);
    row
}

fn skipped_cells(Skipped { rung, left }: &Skipped, edge: f64) -> Cells {
    let last = ["false", "0", left.words()].map(str::to_owned);
    let mut row = setting_cells(rung, edge);
    row.resize(header(IN_CSV).len() - last.len(), String::new());
    row.extend(last);
    row
}

/// The first seven cells of a line.
fn setting_cells(setting: &Setting, edge: f64) -> Cells {
    let SceneDetail { voxel, azimuth, frames, through, detail } = setting.fidelity;
    vec![
        setting.words(edge),
        setting.engine.name().to_lowercase(),
        trimmed(voxel * edge, 6),
        azimuth.to_string(),
        frames.to_string(),
        if through { "through" } else { "first-hit" }.to_owned(),
        trimmed(detail * voxel * edge, 6),
    ]
}

/// A duration in two or three digits and its unit.
pub(crate) fn seconds(value: f64) -> String {
    let (value, unit) = match value {
        v if v < 1e-3 => (v * 1e6, "µs"),
        v if v < 1.0 => (v * 1e3, "ms"),
        v => (v, "s"),
    };
    let decimals = if value < 9.95 { 1 } else { 0 };
    let text = format!("{value:.decimals$}");
    format!("{} {unit}", text.strip_suffix(".0").unwrap_or(&text))
}

/// Largest difference between scores in `f64` and `f32`, as a share, that rounding explains: docs/fidelity.md.
const ROUNDING: f64 = 1e-3;

/// The setting to take, and how much it saves, in two sentences; none where nothing was measured.
pub(crate) fn chart_words(chart: &Chart) -> Vec<String> {
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
    let told = |(times, number): (Option<f64>, &str)| {
        Some(format!("{:.1} times as fast in {number}", times?))
    };
    let times: Vec<String> = times.into_iter().filter_map(told).collect();
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
