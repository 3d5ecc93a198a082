//! Our own tables: JSON with one elevation and, if need be, one azimuth offset a channel.

use serde::Deserialize;
use serde_json::Value;

use super::keys::{self, Passed, Rest};
use super::pattern::{Measures, SensorFormat, SensorPattern, azimuth, channels_of};
use sightline_files::Note;
use sightline_files::json::{self, DescriptionError, Place, check};

/// Most columns of a turn.
const MAX_COLUMNS: u64 = 100_000;
/// Keys that are passed over.
const PASSED: Passed = &[
    ("vendor source licence license prod_line lidar_mode", "words for people"),
    ("format elevation spacing half azimuth beams notes fov_deg", "follow from the lists"),
    (
        "lidar_origin_to_beam_origin_mm beam_to_lidar_transform lidar_to_sensor_transform \
         vert_offset_m horiz_offset_m distance_resolution_m",
        "all beams start at one origin, and ranges have no steps",
    ),
];

/// The file; keys beside these are notes.
#[derive(Deserialize)]
struct Table {
    name: Option<String>,
    elevation_deg: Vec<f64>,
    azimuth_offset_deg: Option<Vec<f64>>,
    azimuth_sign: Option<Value>,
    channels: Option<Value>,
    azimuth_steps: Option<u64>,
    columns_per_frame: Option<u64>,
    azimuth_window: Option<[f64; 2]>,
    range: Option<f64>,
    min_range: Option<f64>,
    rated_range: Option<f64>,
    noise: Option<f64>,
    rate: Option<f64>,
    #[serde(flatten)]
    rest: Rest,
}

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let table: Table = json::parse(text, &at.file)?;
    let elevations = table.elevation_deg;
    let offsets = table.azimuth_offset_deg.unwrap_or_else(|| vec![0.0; elevations.len()]);
    let places = [&at.key("elevation_deg"), &at.key("azimuth_offset_deg")];
    let beams = channels_of(places, &elevations, &offsets, 1.0)?;
    if let Some(count) = table.channels.as_ref().and_then(Value::as_u64)
        && count != elevations.len() as u64
    {
        let wanted =
            format!("the {} elevations that are listed; correct one of the two", elevations.len());
        return Err(check::bad(&at.key("channels"), count, wanted));
    }
    let model = table.name.map(|name| check::name(&at.key("name"), name)).transpose()?;
    let steps =
        [("azimuth_steps", table.azimuth_steps), ("columns_per_frame", table.columns_per_frame)];
    let steps = steps.into_iter().find_map(|(key, steps)| Some((at.key(key), steps?)));
    let steps = steps.map(|(at, steps)| check::count(&at, steps, 1, MAX_COLUMNS));
    let window =
        table.azimuth_window.map(|ends| window(&at.key("azimuth_window"), ends)).transpose()?;
    let range = table.range.map(|range| check::range(&at.key("range"), range)).transpose()?;
    let rate = table.rate.map(|rate| check::rate(&at.key("rate"), rate)).transpose()?;
    let within = |key: &str, value: Option<f64>, low: f64, high: f64| match value {
        Some(value) if !(low..=high).contains(&value) => {
            Err(check::bad(&at.key(key), value, format!("a number from {low} to {high}")))
        }
        other => Ok(other),
    };
    let measures = Measures {
        range,
        min_range: within("min_range", table.min_range, 0.0, range.unwrap_or(1e5))?,
        rated_range: within("rated_range", table.rated_range, 0.1, 1e5)?,
        noise: within("noise", table.noise, 0.0, 10.0)?,
        rate,
    };
    let mut notes: Vec<Note> = keys::unknown(at, &table.rest, PASSED).into_iter().collect();
    // A sentence for people; no program can be sure of its meaning.
    notes.extend(table.azimuth_sign.filter(|_| offsets.iter().any(|offset| *offset != 0.0)).map(|sentence| {
        let sentence: String = sentence.to_string().chars().take(120).collect();
        Note::fact(format!(
            "{}: {sentence}; offsets count counter-clockwise here, unless the scene says `\"azimuth_offsets\": \
             \"clockwise\"`.",
            at.key("azimuth_sign")
        ))
    }));
    Ok(SensorPattern {
        model,
        azimuth_steps: steps.transpose()?,
        azimuth: window,
        measures,
        notes,
        ..SensorPattern::new(SensorFormat::Table, beams)
    })
}

/// Azimuths of the first and the last column, at most a turn apart.
fn window(at: &Place, [from, to]: [f64; 2]) -> Result<[f64; 2], DescriptionError> {
    let (from, to) = (azimuth(&at.item(0), from)?, azimuth(&at.item(1), to)?);
    if from <= to && to - from < 360.0 {
        return Ok([from, to]);
    }
    Err(check::bad(
        at,
        format!("{:?}", [from, to]),
        "a range [from, to] of less than a turn, from <= to",
    ))
}
