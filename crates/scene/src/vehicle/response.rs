//! The `response` of a sensor model, from a description and from a sensor file.

use super::description::ResponseDescription;
use super::lidar_reading::other;
use super::sensor_file::Measures;
use super::{Echoes, Response};
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Place};

/// The usual response, with the numbers that a sensor file states in place of the usual ones.
pub fn stated(range: f64, measures: &Measures) -> Response {
    let usual = Response::usual(range);
    Response {
        rate: measures.rate.unwrap_or(usual.rate),
        rated_range: measures.rated_range.unwrap_or(usual.rated_range),
        noise: measures.noise.unwrap_or(usual.noise),
        // A range cut short by a scene leaves the sensor nothing nearer.
        min_range: measures.min_range.unwrap_or(usual.min_range).min(range),
        ..usual
    }
}

/// Reads the `response` of a sensor model whose beams go `range` metres. Its numbers count, then the sensor
/// file's; differences between the two are notes.
pub(super) fn read(
    at: &Place,
    written: Option<&ResponseDescription>,
    range: f64,
    measures: &Measures,
    notes: &mut Vec<Note>,
) -> Result<Response, DescriptionError> {
    let usual = stated(range, measures);
    let Some(written) = written else { return Ok(usual) };
    let both = [
        ("rate", written.rate, measures.rate),
        ("rated_range", written.rated_range, measures.rated_range),
        ("noise", written.noise, measures.noise),
        ("min_range", written.min_range, measures.min_range),
    ];
    notes
        .extend(both.into_iter().filter_map(|(key, given, stated)| other(at, key, given?, stated)));
    let between = |key: &str, value: Option<f64>, usual: f64, low: f64, high: f64| {
        let value = value.unwrap_or(usual);
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(bad(&at.key(key), value, format!("a number from {low} to {high}")))
    };
    let widths = written.divergence.unwrap_or(usual.divergence);
    let width = |k: usize| {
        let at = at.key("divergence").item(k);
        if (0.0..=0.1).contains(&widths[k]) {
            return Ok(widths[k]);
        }
        Err(bad(&at, widths[k], "a width in radians from 0 to 0.1; 3 mrad is 0.003"))
    };
    let echoes = match written.echoes.as_deref() {
        None => usual.echoes,
        Some("strongest") => Echoes::Strongest,
        Some("last") => Echoes::Last,
        Some("dual") => Echoes::Dual,
        Some(other) => {
            let wanted = "\"strongest\", \"last\" or \"dual\"";
            return Err(bad(&at.key("echoes"), format!("{other:?}"), wanted));
        }
    };
    Ok(Response {
        rate: check::rate(&at.key("rate"), written.rate.unwrap_or(usual.rate))?,
        rated_range: between("rated_range", written.rated_range, usual.rated_range, 0.1, 1e5)?,
        softness: between("softness", written.softness, usual.softness, 0.0, 1.0)?,
        noise: between("noise", written.noise, usual.noise, 0.0, 10.0)?,
        divergence: [width(0)?, width(1)?],
        pulse: between("pulse", written.pulse, usual.pulse, 0.0, 100.0)?,
        echoes,
        min_range: between("min_range", written.min_range, usual.min_range, 0.0, range)?,
    })
}
