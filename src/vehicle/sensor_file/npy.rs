//! NumPy arrays of angles, `.npy`: azimuth and elevation of each beam in radians, counter-clockwise.
//!
//! The header is that of `numpy.save`; parsers of every header trust the sizes that it claims.

use super::pattern::{Beams, SensorFormat, SensorPattern, azimuth, direction, quoted};
use crate::json::check::{self, bad};
use crate::json::{DescriptionError, Place};

/// First bytes of an array.
const MAGIC: &[u8] = b"\x93NUMPY";
/// Bytes before the header of version 1: the magic, the version, the header's length.
const BEFORE: usize = 10;

/// Whether bytes begin as those of an array do.
pub(super) fn is_npy(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

pub(super) fn parse(at: &Place, bytes: &[u8]) -> Result<SensorPattern, DescriptionError> {
    let wanted = "an array [N, 2] of float32 or float64, little-endian and in C order, as np.save writes \
                  it: azimuth and elevation of each beam in radians";
    let split = split(bytes).ok_or_else(|| bad(at, "the content", wanted))?;
    let (header, data) = split;
    let header = header.replace(' ', "");
    let value = |key: &str| header.split_once(key).map_or("", |(_, value)| value);
    let size = match value("'descr':") {
        text if text.starts_with("'<f4'") => 4,
        text if text.starts_with("'<f8'") => 8,
        _ => 0,
    };
    let rows =
        value("'shape':(").split_once(",2)").and_then(|(rows, _)| rows.parse::<usize>().ok());
    let in_rows = value("'fortran_order':").starts_with("False");
    let Some(rows) = rows.filter(|_| size > 0 && in_rows) else {
        return Err(bad(at, quoted(header.trim()), wanted));
    };
    if rows == 0 || rows.checked_mul(2 * size) != Some(data.len()) {
        let found = format!("{} bytes of data", data.len());
        return Err(bad(at, found, format!("{rows} rows of {} bytes; write it again", 2 * size)));
    }
    let angle = |bytes: &[u8]| match bytes.as_chunks::<4>().0 {
        [four] => f64::from(f32::from_le_bytes(*four)),
        halves => f64::from_le_bytes(halves.as_flattened().try_into().unwrap_or_default()),
    };
    let directions = data.chunks_exact(2 * size).enumerate().map(|(i, row)| {
        let (at, [across, up]) = (at.item(i), [&row[..size], &row[size..]].map(angle));
        let across = azimuth(&at, across.to_degrees())?;
        Ok(direction(across, check::elevation(&at, up.to_degrees())?))
    });
    let beams = Beams::Directions(directions.collect::<Result<_, DescriptionError>>()?);
    Ok(SensorPattern::new(SensorFormat::Numpy, beams))
}

/// Header and data of an array of version 1.
fn split(bytes: &[u8]) -> Option<(&str, &[u8])> {
    let length = match bytes.get(MAGIC.len()..BEFORE)? {
        [1, 0, low, high] => usize::from(u16::from_le_bytes([*low, *high])),
        _ => return None,
    };
    let (header, data) = bytes[BEFORE..].split_at_checked(length)?;
    Some((std::str::from_utf8(header).ok()?, data))
}
