//! Sensor files of the vendors, told apart by content.

mod binary;
mod column_window;
mod csv;
mod isaac;
mod isaac_profile;
mod ouster;
mod pattern;
mod table;

use std::collections::BTreeMap;
use std::path::Path;

use serde::de::IgnoredAny;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, DescriptionError, Location, is_utf_16, read_limited};
use sightline_files::{Note, json};

use super::doubts::of_measures;
pub use isaac_profile::isaac_profile;
pub(super) use pattern::NARROWEST;
pub use pattern::{Beams, Channel, Measures, SensorFormat, SensorPattern};
pub(crate) use pattern::{MAX_BEAMS, MAX_CHANNELS};
pub(super) use table::is_on_sign;

/// Largest sensor file in bytes; Livox patterns of four seconds have 25 MB.
const MAX_SENSOR_FILE: u64 = 64 << 20;

/// Reads a sensor file of any of the formats of [`SensorFormat`]; its name says nothing.
///
/// `window` cuts a span `[from, to)` in seconds from a pattern that lists times, the first 0.1 s by default.
/// Signs are turned to counter-clockwise, angles to degrees, directions to the frame x forward, y left,
/// z up. `docs/formats/sensors.md` lists the content of each format and the parts that are dropped.
///
/// # Errors
/// A file that cannot be read, has no format that is read here, or breaks its rules; and a `window` for a
/// format without times.
pub fn read(path: &Path, window: Option<[f64; 2]>) -> Checked<SensorPattern> {
    let bytes = read_limited(path, MAX_SENSOR_FILE)?;
    let at = Location::top(&path.display().to_string());
    let pattern = parse(&at, &bytes, window)?;
    if window.is_some() && pattern.format != SensorFormat::Livox {
        let mend = format!("it cuts a {}, which lists times; leave it out", SensorFormat::Livox);
        return Err(check::misplaced(&at, "window", mend));
    }
    Ok(pattern)
}

fn parse(at: &Location, bytes: &[u8], window: Option<[f64; 2]>) -> Checked<SensorPattern> {
    let mut pattern = parse_any(at, bytes, window)?;
    pattern.notes.extend(pattern::doubts(at, &pattern.beams));
    let Measures { noise, rated_range, rate, .. } = pattern.measures;
    let doubts = of_measures(|key| format!("{at}: {key}"), [noise, rated_range, rate]);
    pattern.notes.extend(doubts.into_iter().map(Note::doubt));
    Ok(pattern)
}

fn parse_any(at: &Location, bytes: &[u8], window: Option<[f64; 2]>) -> Checked<SensorPattern> {
    if bytes.starts_with(binary::MAGIC) {
        return binary::parse_npy(at, bytes);
    }
    if is_utf_16(bytes) {
        return Err(bad(at, "UTF-16 text", "UTF-8 text; save the file as UTF-8"));
    }
    let bytes = bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes);
    let text = match std::str::from_utf8(bytes) {
        Ok(text) if !text.contains('\0') => text,
        _ if binary::is_rgl(bytes) => return binary::parse_rgl(at, bytes),
        Err(_) if !bytes.contains(&0) => {
            let found = "text that is not UTF-8, such as Latin-1,";
            return Err(bad(at, found, "UTF-8 text; save the file as UTF-8"));
        }
        _ => return Err(unknown(at)),
    };
    if table::is_velodyne(text) {
        return table::parse_velodyne(at, text);
    }
    json::refuse_comment(text, &at.file)?;
    if text.trim_ascii_start().starts_with(['{', '[']) || text.trim_ascii().is_empty() {
        return parse_json(at, text);
    }
    let Some((line, cells)) = csv::rows(text).find(|(_, cells)| !csv::is_version(cells)) else {
        return Err(unknown(at));
    };
    if csv::column(&cells, "elevation").is_some() {
        return csv::parse_hesai(at, text);
    }
    if csv::column(&cells, "zenith").is_some() {
        return csv::parse_livox(at, text, window);
    }
    let first = cells.join(",");
    let words = ["elevation", "zenith"].map(|word| first.to_ascii_lowercase().contains(word));
    if words.contains(&true) && first.contains([';', '\t']) {
        let wanted = "a row with commas between its columns; save the table as CSV with commas and decimal points";
        return Err(bad(&csv::at_line(at, line), pattern::quoted(&first), wanted));
    }
    let is_number = |cell: &&str| cell.parse::<f64>().is_ok();
    match (line, cells.len()) {
        _ if !cells.iter().all(is_number) => Err(unknown(at)),
        (_, 3) => csv::parse_livox(at, text, window),
        (_, 1 | 2) => csv::parse_robosense(at, text),
        _ => Err(unknown(at)),
    }
}

/// JSON of several owners: one key of each tells them apart.
fn parse_json(at: &Location, text: &str) -> Checked<SensorPattern> {
    let keys: BTreeMap<String, Option<IgnoredAny>> = json::parse(text, &at.file)?;
    let has = |key: &str| keys.get(key).is_some_and(Option::is_some);
    if has("elevation_deg") {
        table::parse(at, text)
    } else if has("beam_altitude_angles") || has("beam_intrinsics") {
        ouster::parse(at, text)
    } else if has("profile") {
        isaac::parse(at, text)
    } else {
        json::refuse_own_kinds(text, &at.file, "the table of a sensor")?;
        let keys: BTreeMap<String, serde_json::Value> = json::parse(text, &at.file)?;
        let near = keys.keys().find(|key| key.starts_with("elev"));
        let named = keys.get("file").and_then(serde_json::Value::as_str);
        let mend = match (named, near) {
            (Some(named), _) => format!("it names {named:?} as its `file`; give that one"),
            (None, Some(key)) => format!("call `{key}` so, if it lists elevations in degrees"),
            (None, None) => format!(
                "list the elevation of each channel in degrees, or give a file of a format that is \
                 read: {}",
                listed()
            ),
        };
        Err(check::missing(at, "elevation_deg", mend))
    }
}

fn listed() -> String {
    pattern::FORMATS.join(", ")
}

fn unknown(at: &Location) -> DescriptionError {
    let wanted = format!("that of a sensor file that is read here: {}", listed());
    bad(at, "the content", wanted)
}

#[cfg(test)]
mod tests;
