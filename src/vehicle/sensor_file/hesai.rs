//! Hesai: the angle correction CSV.
//!
//! Degrees; offsets count clockwise with the encoder. A version may stand above the titles, and a SHA-256
//! below the last channel.

use super::csv;
use super::pattern::{Beams, SensorFormat, SensorPattern, channel, check_count, quoted};
use crate::json::check::bad;
use crate::json::{DescriptionError, Place};

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let mut rows = csv::rows(text).filter(|(_, cells)| !csv::is_version(cells));
    let (line, titles) = rows.next().unwrap_or_default();
    let find = |title| {
        csv::column(&titles, title).ok_or_else(|| {
            let titles = quoted(&titles.join(","));
            bad(&csv::line(at, line), titles, format!("a row of titles with `{title}`"))
        })
    };
    let (elevation, azimuth) = (find("elevation")?, find("azimuth")?);
    let mut channels = Vec::new();
    for (line, cells) in rows.filter(|(_, cells)| !is_checksum(cells)) {
        let at = csv::line(at, line);
        let up = csv::number(&at, &cells, elevation)?;
        // Subtracting turns the sign without making -0 of 0.
        let offset = 0.0 - csv::number(&at, &cells, azimuth)?;
        channels.push(channel((&at, up), (&at, offset))?);
    }
    check_count(at, channels.len())?;
    Ok(SensorPattern::new(SensorFormat::Hesai, Beams::Channels(channels)))
}

/// Whether a row is the SHA-256 of those above it.
fn is_checksum(cells: &[&str]) -> bool {
    let is_hash = |cell: &str| cell.len() == 64 && cell.bytes().all(|b| b.is_ascii_hexdigit());
    is_hash(cells[0]) && cells[1..].iter().all(|cell| cell.is_empty())
}
