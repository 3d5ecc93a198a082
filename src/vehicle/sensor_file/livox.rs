//! Livox: scan patterns that do not repeat from frame to frame, as CSV of time, azimuth and zenith.
//!
//! Seconds and degrees; azimuths count counter-clockwise, zenith angles down from +z
//! (livox_laser_simulation, livox_points_plugin.cpp).

use super::csv;
use super::pattern::{Beams, MAX_BEAMS, SensorFormat, SensorPattern, azimuth, direction, quoted};
use crate::Note;
use crate::json::check::bad;
use crate::json::{DescriptionError, Place};

/// Seconds of a frame, unless a window is given.
const FRAME: f64 = 0.1;
/// Columns of a pattern without titles.
const COLUMNS: [usize; 3] = [0, 1, 2];

pub(super) fn parse(
    at: &Place,
    text: &str,
    window: Option<[f64; 2]>,
) -> Result<SensorPattern, DescriptionError> {
    let mut rows = csv::rows(text).peekable();
    let columns = match rows.peek() {
        Some((line, cells)) if csv::column(cells, "zenith").is_some() => {
            let found = columns_of(&csv::line(at, *line), cells)?;
            rows.next();
            found
        }
        _ => COLUMNS,
    };
    let (mut directions, mut window, mut samples) = (Vec::new(), window, 0_u64);
    for (line, cells) in rows {
        let at = csv::line(at, line);
        let [time, across, zenith] = columns.map(|column| csv::number(&at, &cells, column));
        let (time, across, zenith) = (time?, azimuth(&at, across?)?, zenith?);
        if !(0.0..=180.0).contains(&zenith) {
            return Err(bad(&at, zenith, "a zenith angle from 0 to 180 degrees"));
        }
        samples += 1;
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
    let notes = vec![Note::fact(format!(
        "The frame is the window from {from} to {to} s: {} of {samples} samples. The sensor goes on with \
         others; here every frame has these.",
        directions.len()
    ))];
    let beams = Beams::Directions(directions);
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Livox, beams) })
}

/// Columns of time, azimuth and zenith by their titles.
fn columns_of(at: &Place, titles: &[&str]) -> Result<[usize; 3], DescriptionError> {
    let find = |title| {
        csv::column(titles, title).ok_or_else(|| {
            let wanted = format!("a row of titles with `{title}`");
            bad(at, quoted(&titles.join(",")), wanted)
        })
    };
    Ok([find("time")?, find("azimuth")?, find("zenith")?])
}
