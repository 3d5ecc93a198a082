//! Samples of each format, written by hand, and the tables of real sensors.

mod own_word;
mod samples;
mod units;

use super::{Beams, SensorPattern, parse};
use sightline_files::json::{Checked, Location};

fn read(bytes: impl AsRef<[u8]>) -> Checked<SensorPattern> {
    parse(&Location::top("f"), bytes.as_ref(), None)
}

fn message(bytes: impl AsRef<[u8]>) -> String {
    read(bytes).unwrap_err().to_string()
}

/// Elevation and offset of each channel.
fn channels(pattern: &SensorPattern) -> Vec<[f64; 2]> {
    let Beams::Channels(all) = &pattern.beams else { panic!("{:?}", pattern.beams) };
    all.iter().map(|c| [c.elevation, c.azimuth_offset]).collect()
}

fn directions(pattern: &SensorPattern) -> &[[f64; 3]] {
    let Beams::Directions(all) = &pattern.beams else { panic!("{:?}", pattern.beams) };
    all
}

/// All notes of a pattern.
fn notes(pattern: &SensorPattern) -> String {
    pattern.notes.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Texts of the doubts about a pattern.
fn doubts(pattern: &SensorPattern) -> Vec<&str> {
    pattern.notes.iter().filter(|note| note.is_doubt()).map(|note| note.text()).collect()
}
