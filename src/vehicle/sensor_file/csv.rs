//! Rows of comma-separated numbers, as vendors write them: no quotes, any line ends.

use super::pattern::quoted;
use crate::json::check::bad;
use crate::json::{DescriptionError, Place};

/// Rows with their lines, counted from 1; cells without the blanks around them. Blank lines are left out.
pub(super) fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(i, line)| (i + 1, line.split(',').map(str::trim).collect()))
}

/// Whether a row is the version that Hesai writes above some tables: `EEFF,1,1`.
pub(super) fn is_version(cells: &[&str]) -> bool {
    cells[0].eq_ignore_ascii_case("eeff")
}

/// The column whose title begins with `title`, whatever its case.
pub(super) fn column(cells: &[&str], title: &str) -> Option<usize> {
    let begins = |cell: &&str| {
        cell.get(..title.len()).is_some_and(|start| start.eq_ignore_ascii_case(title))
    };
    cells.iter().position(begins)
}

/// The place of a row.
pub(super) fn line(at: &Place, number: usize) -> Place {
    at.key(&format!("line {number}"))
}

/// The number in a cell.
pub(super) fn number(at: &Place, cells: &[&str], column: usize) -> Result<f64, DescriptionError> {
    let cell = cells.get(column).copied().unwrap_or_default();
    match cell.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(bad(at, quoted(cell), format!("a number in column {}, as 1.5", column + 1))),
    }
}
