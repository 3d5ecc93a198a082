//! Rows of comma-separated numbers, as vendors and spreadsheets write them: any line ends, cells in quotes.

use super::pattern::quoted;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Most cells of a row that are looked at; tables of sensors have up to five.
const MOST_CELLS: usize = 32;

/// Rows with their lines, counted from 1; cells without blanks and quotes. Rows without a value are left out.
pub(super) fn rows(text: &str) -> impl Iterator<Item = (usize, Vec<&str>)> {
    // Old spreadsheets end lines by a carriage return alone.
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let rows = text.split(end).enumerate().map(move |(i, line)| (i + 1, cells_of(line)));
    rows.filter(|(_, cells)| cells.iter().any(|cell| !cell.is_empty()))
}

fn cells_of(line: &str) -> Vec<&str> {
    line.split(',').take(MOST_CELLS).map(|cell| cell.trim().trim_matches('"').trim()).collect()
}

/// True if a row is the version that Hesai writes above some tables: `EEFF,1,1`.
pub(super) fn is_version(cells: &[&str]) -> bool {
    cells[0].eq_ignore_ascii_case("eeff")
}

/// The column whose title begins with `title`, whatever its case.
pub(super) fn column(cells: &[&str], title: &str) -> Option<usize> {
    cells.iter().position(|cell| begins(cell, title))
}

/// True if a title begins with a word, whatever its case.
pub(super) fn begins(cell: &str, word: &str) -> bool {
    cell.get(..word.len()).is_some_and(|start| start.eq_ignore_ascii_case(word))
}

/// Titles that begin with none of the known words and name something.
pub(super) fn unknown<'a>(titles: &[&'a str], known: &[&str]) -> Vec<&'a str> {
    let is_known = |title: &str| title.is_empty() || known.iter().any(|word| begins(title, word));
    titles.iter().copied().filter(|title| !is_known(title)).collect()
}

/// Refuses a column whose title names radians; tables of vendors have degrees.
pub(super) fn in_degrees(at: &Place, title: &str) -> Result<(), DescriptionError> {
    if title.to_ascii_lowercase().contains("rad") {
        return Err(bad(at, quoted(title), "a column of degrees; convert it"));
    }
    Ok(())
}

/// The place of a row.
pub(super) fn line(at: &Place, number: usize) -> Place {
    at.key(&format!("line {number}"))
}

/// Refuses a row with more cells than there are columns: decimal commas split numbers.
pub(super) fn check_width(
    at: &Place,
    cells: &[&str],
    columns: usize,
) -> Result<(), DescriptionError> {
    match cells.iter().skip(columns).find(|cell| !cell.is_empty()) {
        None => Ok(()),
        Some(_) => {
            let wanted = format!("a row of {columns} columns; write decimals with a point, as 1.5");
            Err(bad(at, quoted(&cells.join(",")), wanted))
        }
    }
}

/// The number in a cell.
pub(super) fn number(at: &Place, cells: &[&str], column: usize) -> Result<f64, DescriptionError> {
    let cell = cells.get(column).copied().unwrap_or_default();
    match cell.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err(bad(at, quoted(cell), format!("a number in column {}, as 1.5", column + 1))),
    }
}
