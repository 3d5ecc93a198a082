//! The table of a study below its own: near gain and margins of requirements without each LiDAR.

use super::columns::align_columns;
use super::optional;
use super::text::visible;
use crate::json::fixed;
use crate::score::{percent_down, percent_up};
use crate::study::{AfterLoss, Margin, Table};

/// Requirements beside each other in a table of 80 columns.
const BESIDE: usize = 5;

/// A share found less the share required in percentage points with their sign, rounded down: a requirement that is not
/// met never reads as one that is.
pub(super) fn margin_points(found: f64, required: f64) -> String {
    let points = percent_down(found - required);
    format!("{}{}", if points > 0.0 { "+" } else { "" }, fixed(points, 1))
}

fn points(of: &Margin) -> String {
    let mark = if of.met { "" } else { "!" };
    format!("{mark}{}", margin_points(of.found, of.required))
}

/// Near gain without each LiDAR of each placement, with the margins of all requirements; empty where no LiDAR is lost.
pub(super) fn losses_text(table: &Table) -> String {
    let losses = || table.rows.iter().flat_map(|row| &row.after_loss);
    let Some(first) = losses().next() else { return String::new() };
    let required = &first.requirements;
    let numbers: Vec<usize> = (0..required.len()).collect();
    let none: &[usize] = &[];
    let parts: Vec<&[usize]> =
        if numbers.is_empty() { vec![none] } else { numbers.chunks(BESIDE).collect() };
    let tables = parts.into_iter().map(|part| {
        let mut rows = vec![vec!["LiDAR lost".to_owned(), "near gain %".to_owned()]];
        rows[0].extend(part.iter().map(|k| format!("req {}", k + 1)));
        for row in table.rows.iter().filter(|row| !row.after_loss.is_empty()) {
            rows.push(vec![row.name.clone()]);
            rows.extend(row.after_loss.iter().map(|of| line(of, part)));
        }
        align_columns(&rows)
    });
    let mut text = tables.collect::<Vec<_>>().join("\n");
    for (k, of) in required.iter().enumerate() {
        let (name, least) = (visible(&of.name), percent_up(of.required));
        text += &format!("req {}: {name}, {least:.1} % required\n", k + 1);
    }
    if !required.is_empty() {
        text += "margins in percentage points: found less required; ! = not met\n";
    }
    format!("\n{text}")
}

fn line(of: &AfterLoss, part: &[usize]) -> Vec<String> {
    let mut line = vec![format!("  {}", of.name)];
    line.push(optional(of.near_gain.map(|gain| 100.0 * gain), 2));
    line.extend(part.iter().map(|&k| of.requirements.get(k).map_or_else(String::new, points)));
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{Row, TablePlot};

    fn table(requirements: usize) -> Table {
        let margin = |k: usize| {
            let (required, found) = (0.9, if k == 1 { 0.8999 } else { 0.95 });
            let met = found >= required;
            Margin { name: format!("r{}", k + 1), required, found, met, ..Margin::default() }
        };
        let lost = |lidar: usize| AfterLoss {
            lidar,
            name: format!("LiDAR {lidar} (roof)"),
            near_gain: Some(0.25 + lidar as f64 / 8.0),
            requirements: (0..requirements).map(margin).collect(),
            ..AfterLoss::default()
        };
        let after_loss = vec![lost(0), lost(1)];
        let row = Row { name: "mine".to_owned(), after_loss, ..Row::default() };
        let (columns, y_title) = (vec![], String::new());
        let drawing = TablePlot::ByCase { columns, y_title, line: false };
        let columns = vec!["placement".to_owned()];
        Table { title: "t".to_owned(), columns, rows: vec![row], notes: vec![], drawing }
    }

    #[test]
    fn each_loss_has_its_near_gain_and_margins() {
        let want = "
LiDAR lost        near gain %  req 1  req 2
mine
  LiDAR 0 (roof)        25.00   +5.0  !-0.1
  LiDAR 1 (roof)        37.50   +5.0  !-0.1
req 1: r1, 90.0 % required
req 2: r2, 90.0 % required
margins in percentage points: found less required; ! = not met
";
        assert_eq!(losses_text(&table(2)), want);
    }

    #[test]
    fn many_requirements_take_several_tables_of_80_columns() {
        let text = losses_text(&table(11));
        assert_eq!(text.matches("LiDAR lost").count(), 3, "{text}");
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        let none = losses_text(&table(0));
        assert!(none.contains("25.00") && !none.contains("margins"), "{none}");
        assert_eq!(losses_text(&Table { rows: vec![], ..table(1) }), "");
    }
}
