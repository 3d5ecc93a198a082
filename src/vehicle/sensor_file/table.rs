//! Our own tables: JSON with one elevation and, if need be, one azimuth offset a channel.

use serde::Deserialize;

use super::pattern::{SensorFormat, SensorPattern, channels_of};
use crate::json::{self, DescriptionError, Place, check};

/// The file; keys beside these are notes.
#[derive(Deserialize)]
struct Table {
    name: Option<String>,
    elevation_deg: Vec<f64>,
    azimuth_offset_deg: Option<Vec<f64>>,
}

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let table: Table = json::parse(text, &at.file)?;
    let elevations = table.elevation_deg;
    let offsets = table.azimuth_offset_deg.unwrap_or_else(|| vec![0.0; elevations.len()]);
    let places = [&at.key("elevation_deg"), &at.key("azimuth_offset_deg")];
    let beams = channels_of(places, &elevations, &offsets, 1.0)?;
    let model = table.name.map(|name| check::text(&at.key("name"), name)).transpose()?;
    Ok(SensorPattern { model, ..SensorPattern::new(SensorFormat::Table, beams) })
}
