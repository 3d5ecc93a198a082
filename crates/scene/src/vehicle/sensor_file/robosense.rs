//! RoboSense: the angle CSV of the ROS driver, without titles.
//!
//! Degrees: elevations alone, or with azimuth offsets that count clockwise (the driver adds them to the
//! encoder and takes y = -sin; ros_rslidar, rawdata.cc).

use super::csv;
use super::pattern::{Beams, SensorFormat, SensorPattern, channel, check_count, quoted};
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let mut channels = Vec::new();
    let mut columns = None;
    for (line, cells) in csv::rows(text) {
        let at = csv::line(at, line);
        let wanted = *columns.get_or_insert(cells.len());
        if cells.len() != wanted {
            let wanted = format!("a row of {wanted} columns, as the first one");
            return Err(bad(&at, quoted(&cells.join(",")), wanted));
        }
        let elevation = csv::number(&at, &cells, 0)?;
        // Subtracting turns the sign without making -0 of 0.
        let offset = if wanted == 2 { 0.0 - csv::number(&at, &cells, 1)? } else { 0.0 };
        channels.push(channel((&at, elevation), (&at, offset))?);
    }
    check_count(at, channels.len())?;
    Ok(SensorPattern::new(SensorFormat::RoboSense, Beams::Channels(channels)))
}
