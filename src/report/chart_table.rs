//! Cost and error of each setting as a table: in the chart, and as CSV.

use std::fmt::Write;

use maud::{Markup, html};

use super::svg::{ACCENT, INK, SOFT, px, trimmed};
use crate::chart::{Engine, Rated, Setting, Skipped};

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

/// Title and emphasis of a chart.
#[derive(Debug, Clone, Copy)]
pub struct ChartFrame<'a> {
    /// Scene, placements, objective.
    pub title: &'a str,
    /// The scene's own voxel edge in metres.
    pub edge: f64,
    /// Position of the setting to take.
    pub chosen: Option<usize>,
}

/// Cost and error of the numbered settings: `rows` holds the height of each and its place in `rated`.
pub(super) fn table(
    rated: &[Rated],
    top: f64,
    rows: &[(f64, usize)],
    chart: &ChartFrame,
) -> Markup {
    html! {
        (row(top, COLUMNS.map(|(title, _)| title.to_owned()), SOFT, false))
        @for (number, &(y, i)) in rows.iter().enumerate() {
            @let is_chosen = chart.chosen == Some(i);
            (row(y, cells(rated, i, number + 1, chart.edge), if is_chosen { ACCENT } else { INK }, is_chosen))
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

/// One line a setting: its description, cost and error. A setting that was left early has the errors over its first
/// placements, and the reason. Settings that were not begun come last.
pub fn fidelity_csv(rated: &[Rated], skipped: &[Skipped], edge: f64) -> String {
    let mut csv = "setting,engine,voxel_m,azimuth_divisor,frames,coverage,merged_m,seconds,seconds_low,\
                   seconds_high,bytes,beams,triangles,score_error_median,score_error_largest,tau,tau_low,\
                   tau_high,regret,regret_low,regret_high,swapped,swapped_low,swapped_high,pose_seconds,pose_bytes,\
                   on_front,placements,left_early\n"
        .to_owned();
    for rated in rated {
        let (measured, error) = (&rated.measured, &rated.error);
        let tau = match error.tau {
            Some(tau) => format!("{},{},{}", tau.value, tau.low, tau.high),
            None => ",,".to_owned(),
        };
        let pose = measured
            .pose
            .map_or(",".to_owned(), |pose| format!("{:.4e},{}", pose.seconds, pose.bytes));
        let _ = writeln!(
            csv,
            "{},{:.4e},{:.4e},{:.4e},{},{},{},{},{},{tau},{},{},{},{},{},{},{pose},{},{},{}",
            setting_cells(&measured.setting, edge),
            measured.seconds,
            measured.spread[0],
            measured.spread[1],
            measured.bytes,
            measured.beams,
            measured.triangles,
            error.score_median,
            error.score_largest,
            error.regret.value,
            error.regret.low,
            error.regret.high,
            error.swapped.value,
            error.swapped.low,
            error.swapped.high,
            rated.on_front,
            measured.scores.len(),
            measured.left.map_or("", |left| left.words()),
        );
    }
    for Skipped { rung, left } in skipped {
        let empty = ",".repeat(19);
        let _ = writeln!(csv, "{}{empty},false,0,{}", setting_cells(rung, edge), left.words());
    }
    csv
}

/// The first seven cells of a line.
fn setting_cells(setting: &Setting, edge: f64) -> String {
    let fidelity = setting.fidelity;
    format!(
        "\"{}\",{},{},{},{},{},{}",
        setting.words(edge),
        match setting.engine {
            Engine::F64 => "f64",
            Engine::Cpu => "cpu",
            Engine::Gpu => "gpu",
            Engine::Atlas => "atlas",
        },
        trimmed(fidelity.voxel * edge, 6),
        fidelity.azimuth,
        fidelity.frames,
        if fidelity.through { "through" } else { "first-hit" },
        trimmed(fidelity.detail * fidelity.voxel * edge, 6),
    )
}

/// A duration in two or three digits and its unit.
pub fn seconds(value: f64) -> String {
    let (value, unit) = match value {
        v if v < 1e-3 => (v * 1e6, "µs"),
        v if v < 1.0 => (v * 1e3, "ms"),
        v => (v, "s"),
    };
    let decimals = if value < 9.95 { 1 } else { 0 };
    let text = format!("{value:.decimals$}");
    format!("{} {unit}", text.strip_suffix(".0").unwrap_or(&text))
}
