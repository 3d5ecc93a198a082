//! A sweep of one pose field as a table and as a chart.

use super::plot::{Axis, Change, Plot, Series};
use super::table::ScoreColumn;
use super::text::align_columns;
use crate::job::Sweep;
use crate::json::fixed;
use crate::score::{Guard, Scores};

/// Columns of scores.
const COLUMNS: [ScoreColumn; 3] =
    [ScoreColumn::NearGain, ScoreColumn::GainShare, ScoreColumn::Hits];
/// Scores that are drawn, with their names; requirements are drawn beside them.
const DRAWN: [(ScoreColumn, &str); 2] =
    [(ScoreColumn::NearGain, "near gain"), (ScoreColumn::GainShare, "gain")];
/// Requirements that are drawn at most: a chart tells eight colours apart.
const MOST_DRAWN: usize = 6;

/// Degrees of bearings in which a car is lost somewhere between 5 and 50 m.
pub(super) fn lost(scores: &Scores) -> f64 {
    let of = |guard: &Guard| match guard {
        Guard::BlindSector(sector) => sector.degrees(),
        _ => 0.0,
    };
    scores.guards.iter().map(of).sum()
}

/// Value of a row with its unit.
fn head(sweep: &Sweep, k: usize) -> String {
    let row = &sweep.rows[k];
    let given = if row.as_given { " as given" } else { "" };
    format!("{} {}{given}", fixed(row.value, 3), sweep.unit)
}

fn table(sweep: &Sweep) -> String {
    let requirements = sweep.rows.first().map_or(0, |row| row.scores.required.len());
    let mut titles = vec![sweep.field.to_owned()];
    titles.extend(COLUMNS.iter().map(|column| column.title().to_owned()));
    titles.extend((1..=requirements).map(|k| format!("req {k} %")));
    titles.extend(["car lost °", "rules"].map(str::to_owned));
    let mut lines = vec![titles];
    for (k, row) in sweep.rows.iter().enumerate() {
        let mut line = vec![head(sweep, k)];
        line.extend(COLUMNS.iter().map(|column| column.cell(&row.scores)));
        line.extend(row.scores.required.iter().map(|seen| {
            // Rounded down, so that a requirement that is not met never reads as met.
            let share = (1e3 * seen.share + 1e-9).floor() / 10.0;
            format!("{}{}", if seen.is_met() { "" } else { "!" }, fixed(share, 1))
        }));
        line.push(match row.scores.range_card {
            Some(_) => fixed(lost(&row.scores), 0),
            None => "–".to_owned(),
        });
        line.push(if row.broken_rules.is_empty() { "kept" } else { "BROKEN" }.to_owned());
        lines.push(line);
    }
    align_columns(&lines)
}

/// A table a placement: scores, requirements, degrees in which a car is lost, and rules at each value.
pub fn sweep_text(all: &[Sweep]) -> String {
    let of = |sweep: &Sweep| {
        let Sweep { placement, lidar, field, .. } = sweep;
        let mut text = format!("{placement}: {field} of LiDAR {lidar}\n{}", table(sweep));
        let Some(first) = sweep.rows.first() else { return text };
        for (k, seen) in first.scores.required.iter().enumerate() {
            let least = 100.0 * seen.least;
            text += &format!("req {}: {}, {least:.1} % required; ! not met\n", k + 1, seen.name);
        }
        let broken: Vec<usize> =
            (0..sweep.rows.len()).filter(|&k| !sweep.rows[k].broken_rules.is_empty()).collect();
        if let Some(&k) = broken.first() {
            let (count, all) = (broken.len(), sweep.rows.len());
            text += &format!("rules broken in {count} of {all} rows; at {}:\n", head(sweep, k));
            for rule in &sweep.rows[k].broken_rules {
                text += &format!("  {rule}\n");
            }
        }
        text
    };
    all.iter().map(of).collect::<Vec<_>>().join("\n")
}

/// Scores and shares of requirements over the values, and the value as it is given.
pub fn sweep_plot(sweep: &Sweep) -> String {
    let swept = || sweep.rows.iter().filter(|row| !row.as_given);
    let series = |name: String, of: &dyn Fn(&Scores) -> Option<f64>| Series {
        name,
        points: swept().filter_map(|row| Some((row.value, 100.0 * of(&row.scores)?))).collect(),
        line: true,
        labels: Vec::new(),
    };
    let scores = DRAWN
        .iter()
        .map(|(column, name)| series((*name).to_owned(), &|scores| column.share(scores)));
    let required = sweep.rows.first().map_or(&[][..], |row| &row.scores.required[..]);
    let required = required.iter().take(MOST_DRAWN).enumerate().map(|(k, seen)| {
        series(seen.name.clone(), &|scores| scores.required.get(k).map(|seen| seen.share))
    });
    let plot = Plot {
        title: format!("{}: {} of LiDAR {}", sweep.placement, sweep.field, sweep.lidar),
        x_title: format!("{}, {}", sweep.field, sweep.unit),
        y_title: "%".to_owned(),
        x: Axis::Numbers,
        series: scores.chain(required).filter(|series| !series.points.is_empty()).collect(),
    };
    let values = || swept().map(|row| row.value);
    let [low, high] = [f64::min, f64::max].map(|of| values().reduce(of).unwrap_or_default());
    let given = sweep.rows.iter().find(|row| row.as_given).map(|row| row.value);
    let given = given.filter(|at| (low..=high).contains(at));
    let change = given.map(|at| Change { at, name: "as given".to_owned() });
    plot.svg_with(&[], change.as_slice())
}
