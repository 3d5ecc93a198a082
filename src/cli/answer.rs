//! Answers that are tables: as text, as JSON, as CSV.

use serde::Serialize;
use serde_json::json;

use crate::runs::{RunError, TableFormat};

/// Prints an answer: all of it as JSON, its table as CSV, or as `text` prints it.
pub fn answer(
    format: TableFormat,
    found: &impl Serialize,
    table: impl FnOnce() -> String,
    text: impl FnOnce() -> Result<(), RunError>,
) -> Result<(), RunError> {
    match format {
        TableFormat::Json => outln!("{}", json!(found)),
        TableFormat::Csv => out!("{}", table()),
        TableFormat::Text => text(),
    }
}
