//! Livox: scan patterns that do not repeat from frame to frame, as CSV of time, azimuth and zenith.
//!
//! Seconds and degrees; azimuths count counter-clockwise, zenith angles down from +z
//! (livox_laser_simulation, livox_points_plugin.cpp).

use std::f64::consts::{PI, TAU};

use super::pattern::{Beams, MAX_BEAMS, SensorFormat, SensorPattern, azimuth, direction, quoted};
use super::{csv, keys};
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Seconds of a frame, unless a window is given.
const FRAME: f64 = 0.1;
/// Columns of a pattern without titles.
const COLUMNS: [usize; 3] = [0, 1, 2];
/// Titles that are read.
const TITLES: [&str; 3] = ["time", "azimuth", "zenith"];

pub(super) fn parse(
    at: &Place,
    text: &str,
    window: Option<[f64; 2]>,
) -> Result<SensorPattern, DescriptionError> {
    let mut rows = csv::rows(text).peekable();
    let (mut notes, mut width) = (Vec::new(), COLUMNS.len());
    let columns = match rows.peek() {
        Some((line, cells)) if csv::column(cells, "zenith").is_some() => {
            let title_at = csv::line(at, *line);
            let found = columns_of(&title_at, cells)?;
            notes.extend(keys::unread(&title_at, &csv::unknown(cells, &TITLES)));
            width = cells.len();
            rows.next();
            found
        }
        _ => COLUMNS,
    };
    let (mut directions, mut window, mut samples) = (Vec::new(), window, 0_u64);
    let mut largest = [0.0_f64; 2];
    for (line, cells) in rows {
        let at = csv::line(at, line);
        csv::check_width(&at, &cells, width)?;
        let [time, across, zenith] = columns.map(|column| csv::number(&at, &cells, column));
        let (time, across, zenith) = (time?, azimuth(&at, across?)?, zenith?);
        if !(0.0..=180.0).contains(&zenith) {
            return Err(bad(&at, zenith, "a zenith angle from 0 to 180 degrees"));
        }
        samples += 1;
        largest = [largest[0].max(across.abs()), largest[1].max(zenith)];
        let [from, to] = *window.get_or_insert([time, time + FRAME]);
        if (from..to).contains(&time) {
            directions.push(direction(across, 90.0 - zenith));
        }
    }
    let [from, to] = window.unwrap_or_default();
    if directions.is_empty() || directions.len() as u64 > MAX_BEAMS {
        let found = format!("{} of {samples} samples from {from} to {to} s", directions.len());
        return Err(bad(at, found, format!("a frame of 1 to {MAX_BEAMS} beams; give a `window`")));
    }
    notes.insert(
        0,
        Note::fact(format!(
            "The frame is the window from {from} to {to} s: {} of {samples} samples. The sensor goes on with \
             others; here every frame has these.",
            directions.len()
        )),
    );
    notes.extend(doubts(at, largest, directions.len(), samples));
    let beams = Beams::Directions(directions);
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Livox, beams) })
}

/// Units that most likely are not degrees and seconds: azimuths within 2π and zeniths within π, and frames of
/// next to no samples.
fn doubts(at: &Place, [across, zenith]: [f64; 2], taken: usize, samples: u64) -> Vec<Note> {
    let mut notes = Vec::new();
    if samples >= 10 && across <= TAU && zenith <= PI {
        notes.push(Note::doubt(format!(
            "{at}: azimuths reach {across:.3} and zenith angles {zenith:.3} degrees: radians? Write degrees."
        )));
    }
    if samples >= 1000 && taken < 10 {
        notes.push(Note::doubt(format!(
            "{at}: {taken} of {samples} samples lie in the frame: are times in seconds? Convert them, or give a `window`."
        )));
    }
    notes
}

/// Columns of time, azimuth and zenith by their titles.
fn columns_of(at: &Place, titles: &[&str]) -> Result<[usize; 3], DescriptionError> {
    let find = |title| {
        csv::column(titles, title).ok_or_else(|| {
            let wanted = format!("a row of titles with `{title}`");
            bad(at, quoted(&titles.join(",")), wanted)
        })
    };
    let columns = [find("time")?, find("azimuth")?, find("zenith")?];
    let title = titles[columns[0]].to_ascii_lowercase();
    let unit = title.trim_start_matches("time").trim_matches(|c: char| !c.is_alphabetic());
    if ["ms", "us", "µs", "ns", "msec", "usec", "nsec"].contains(&unit) {
        return Err(bad(at, quoted(titles[columns[0]]), "a column of seconds; convert it"));
    }
    columns[1..].iter().try_for_each(|&column| csv::in_degrees(at, titles[column]))?;
    Ok(columns)
}
