//! Hesai: the angle correction CSV.
//!
//! Degrees; offsets count clockwise with the encoder. A version may stand above the titles, and a SHA-256
//! below the last channel.

use std::collections::BTreeSet;

use super::pattern::{Beams, SensorFormat, SensorPattern, channel, check_count, quoted};
use super::{csv, keys};
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Titles that are read, and of the channel's number.
const TITLES: [&str; 4] = ["elevation", "azimuth", "channel", "laser"];

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let mut rows = csv::rows(text).filter(|(_, cells)| !csv::is_version(cells));
    let (line, titles) = rows.next().unwrap_or_default();
    let title_at = csv::line(at, line);
    let find = |title| {
        let column = csv::column(&titles, title).ok_or_else(|| {
            bad(&title_at, quoted(&titles.join(",")), format!("a row of titles with `{title}`"))
        })?;
        csv::in_degrees(&title_at, titles[column]).map(|()| column)
    };
    let (elevation, azimuth) = (find("elevation")?, find("azimuth")?);
    let number = csv::column(&titles, "channel").or(csv::column(&titles, "laser"));
    let mut numbers = BTreeSet::new();
    let mut channels = Vec::new();
    for (line, cells) in rows.filter(|(_, cells)| !is_checksum(cells)) {
        let at = csv::line(at, line);
        csv::check_width(&at, &cells, titles.len())?;
        if let Some(column) = number {
            let number = csv::number(&at, &cells, column)?;
            // Adding 0 makes 0 of -0.
            if !numbers.insert((number + 0.0).to_bits()) {
                return Err(bad(&at, format!("channel {number}"), "listed once; it comes twice"));
            }
        }
        let up = csv::number(&at, &cells, elevation)?;
        // Subtracting turns the sign without making -0 of 0.
        let offset = 0.0 - csv::number(&at, &cells, azimuth)?;
        channels.push(channel((&at, up), (&at, offset))?);
    }
    check_count(at, channels.len())?;
    let mut notes = Vec::new();
    notes.extend(keys::unread(&title_at, &csv::unknown(&titles, &TITLES)));
    notes.extend(gap(at, &numbers));
    Ok(SensorPattern {
        notes,
        ..SensorPattern::new(SensorFormat::Hesai, Beams::Channels(channels))
    })
}

/// A doubt where channels are numbered from 0 or 1 on and one is left out.
fn gap(at: &Place, numbers: &BTreeSet<u64>) -> Option<Note> {
    let sorted = || numbers.iter().map(|bits| f64::from_bits(*bits));
    let (first, last) = (sorted().fold(f64::INFINITY, f64::min), sorted().fold(0.0, f64::max));
    let span = last - first + 1.0;
    let text = format!(
        "{at}: lists {} channels, numbered from {first} to {last}: are {} left out?",
        numbers.len(),
        span - numbers.len() as f64
    );
    (!numbers.is_empty() && span > numbers.len() as f64).then(|| Note::doubt(text))
}

/// True if a row is the SHA-256 of those above it.
fn is_checksum(cells: &[&str]) -> bool {
    let is_hash = |cell: &str| cell.len() == 64 && cell.bytes().all(|b| b.is_ascii_hexdigit());
    is_hash(cells[0]) && cells[1..].iter().all(|cell| cell.is_empty())
}
