//! Scores as a table to read.

use sightline::score::Scores;
use sightline::search::Finding;
use sightline::study::Table;

/// Columns: title, and the cell of one placement.
type Column = (&'static str, fn(&Scores) -> String);

const COLUMNS: [Column; 9] = [
    ("placement", |s| s.name.clone()),
    ("M-SOG", |s| optional(s.segmentation.m_sog, 4)),
    ("M-SOG/N ×1e-6", |s| optional(s.segmentation.m_sog_scaled.map(|v| v * 1e6), 3)),
    ("det ×1e-6", |s| optional(s.detection.and_then(|d| d.m_sog_scaled).map(|v| v * 1e6), 3)),
    ("gain nats", |s| optional(s.segmentation.information_gain, 0)),
    ("gain %", |s| optional(s.segmentation.information_gain_share.map(|v| v * 100.0), 2)),
    ("S-MIG", |s| optional(s.s_mig, 0)),
    ("covered", |s| format!("{:.0}", s.covered)),
    ("hits %", |s| optional(s.hit_share.map(|v| v * 100.0), 1)),
];

fn optional(value: Option<f64>, decimals: usize) -> String {
    value.map_or("–".into(), |v| format!("{v:.decimals$}"))
}

/// Titles of the columns.
pub fn titles() -> Vec<String> {
    COLUMNS.iter().map(|(title, _)| (*title).to_owned()).collect()
}

/// Cells of one placement.
pub fn cells(scores: &Scores) -> Vec<String> {
    COLUMNS.iter().map(|(_, cell)| cell(scores)).collect()
}

/// Lines of equal columns, the first column to the left and numbers to the right.
pub fn align(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |column: usize| {
        rows.iter().filter_map(|row| row.get(column)).map(|c| c.chars().count()).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        let cells = row.iter().zip(&widths).enumerate().map(|(column, (cell, &width))| {
            if column == 0 { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
        });
        text += cells.collect::<Vec<_>>().join("  ").trim_end();
        text.push('\n');
    }
    text
}

/// A table of placements, the guards of each below its row.
pub fn scores(all: &[Scores]) -> String {
    let mut rows = vec![titles()];
    rows.extend(all.iter().map(cells));
    let table = align(&rows);
    let mut lines = table.lines();
    let mut text = format!("{}\n", lines.next().unwrap_or_default());
    for (line, scores) in lines.zip(all) {
        text += &format!("{line}\n");
        for guard in &scores.guards {
            text += &format!("  ! {guard}\n");
        }
    }
    text
}

/// What goes with the objective over random placements, one property a line.
pub fn findings(all: &[Finding]) -> String {
    let title = ["over random placements", "correlation", "beside mean height"];
    let mut rows = vec![title.map(str::to_owned).to_vec()];
    rows.extend(all.iter().map(|finding| {
        let name = finding.property.to_owned();
        vec![name, optional(finding.correlation, 2), optional(finding.beside_height, 2)]
    }));
    align(&rows)
}

/// A study's cases and notes.
pub fn study(table: &Table) -> String {
    let number = |value: Option<f64>| match value {
        None => "–".to_owned(),
        Some(0.0) => "0".to_owned(),
        Some(v) if (1e-3..1e6).contains(&v.abs()) => {
            format!("{v:.4}").trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        Some(v) => format!("{v:.4e}"),
    };
    let mut rows = vec![table.columns.clone()];
    rows.extend(table.rows.iter().map(|row| {
        let values = row.values.iter().map(|value| number(*value));
        std::iter::once(row.name.clone()).chain(values).collect()
    }));
    let notes: String = table.notes.iter().map(|note| format!("\n{note}\n")).collect();
    align(&rows) + &notes
}
