//! Checks of single values; each error names the place, the value and the allowed ones.

use super::{DescriptionError, Location};

/// Largest coordinate or length in metres: finite in `f32` with room for sums and squares.
pub const MAX_METRES: f64 = 1.0e9;

/// Largest angle in radians; larger ones are most likely degrees.
pub const MAX_RADIANS: f64 = std::f64::consts::TAU;

/// Longest name in characters.
pub const MOST_CHARACTERS: usize = 200;

/// Longest value printed as it is: longer numbers are printed with an exponent.
const MOST_DIGITS: usize = 20;

/// Error of a value that `at` does not allow.
pub fn bad(at: &Location, value: impl ToString, wanted: impl Into<String>) -> DescriptionError {
    let mut value = value.to_string();
    // 1e300 prints with 301 digits, and was most likely written with an exponent.
    if value.len() > MOST_DIGITS
        && let Ok(number) = value.parse::<f64>()
    {
        value = format!("{number:e}");
    }
    DescriptionError::Value { at: Box::new(at.clone()), value, wanted: wanted.into() }
}

/// A text for tables and drawings, without control characters.
pub fn text(at: &Location, value: String) -> Result<String, DescriptionError> {
    if !value.contains(char::is_control) {
        return Ok(value);
    }
    Err(bad(at, format!("{value:?}"), "a text without control characters; leave them out"))
}

/// A name for tables and drawings: a [`text`] of at most 200 characters.
pub fn name(at: &Location, value: String) -> Result<String, DescriptionError> {
    let length = value.chars().count();
    if length > MOST_CHARACTERS {
        let wanted = format!("a name of at most {MOST_CHARACTERS} characters");
        return Err(bad(at, format!("a text of {length} characters"), wanted));
    }
    text(at, value)
}

/// A coordinate in metres.
pub fn metres(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    if value.abs() <= MAX_METRES {
        return Ok(value);
    }
    Err(bad(at, value, "a coordinate within 1e9 m of the origin"))
}

/// A length in metres above 0.
pub fn length(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    if value > 0.0 && value <= MAX_METRES {
        return Ok(value);
    }
    Err(bad(at, value, "a positive length"))
}

/// So many a second, above 0.
pub fn rate(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    if (1e-3..=1e4).contains(&value) {
        return Ok(value);
    }
    Err(bad(at, value, "a number a second from 0.001 to 10000"))
}

/// A heading in radians; logs add up turns.
pub fn heading(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    // Up to 1e9 an `f64` resolves 1e-6 rad.
    if value.abs() <= MAX_METRES {
        return Ok(value);
    }
    Err(bad(at, value, "a heading in radians within ±1e9"))
}

/// An angle in radians.
pub fn radians(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    if value.abs() <= MAX_RADIANS {
        return Ok(value);
    }
    Err(bad(at, value, "an angle in radians within one turn (-6.2832 to 6.2832)"))
}

/// A point `[x, y, z]` in metres.
pub fn point(at: &Location, value: [f64; 3]) -> Result<[f64; 3], DescriptionError> {
    for (i, v) in value.into_iter().enumerate() {
        metres(&at.item(i), v)?;
    }
    Ok(value)
}

/// A size `[x, y, z]` in metres, each above 0.
pub fn size(at: &Location, value: [f64; 3]) -> Result<[f64; 3], DescriptionError> {
    for (i, v) in value.into_iter().enumerate() {
        length(&at.item(i), v)?;
    }
    Ok(value)
}

/// A point written `[x, y]` or `[x, y, z]`, in metres; z is 0 when it is left out.
pub fn point_2_or_3(at: &Location, value: &[f64]) -> Result<[f64; 3], DescriptionError> {
    let xyz = match *value {
        [x, y] => [x, y, 0.0],
        [x, y, z] => [x, y, z],
        _ => {
            return Err(bad(
                at,
                format!("a list of {} numbers", value.len()),
                "[x, y] or [x, y, z]",
            ));
        }
    };
    point(at, xyz)
}

/// A whole number in `lo..=hi`.
pub fn count(at: &Location, value: u64, lo: u64, hi: u64) -> Result<u32, DescriptionError> {
    if (lo..=hi).contains(&value) {
        return Ok(value as u32);
    }
    Err(bad(at, value, format!("a whole number from {lo} to {hi}")))
}

/// A range `[lo, hi]` of radians with lo ≤ hi.
pub fn radian_range(at: &Location, value: [f64; 2]) -> Result<[f64; 2], DescriptionError> {
    for (i, v) in value.into_iter().enumerate() {
        radians(&at.item(i), v)?;
    }
    ordered(at, value)
}

/// A vertical field of view `[lower, upper]` in degrees.
pub fn fov(at: &Location, value: [f64; 2]) -> Result<[f64; 2], DescriptionError> {
    for (i, v) in value.into_iter().enumerate() {
        elevation(&at.item(i), v)?;
    }
    ordered(at, value)
}

/// An elevation in degrees.
pub fn elevation(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    if value.abs() <= 90.0 {
        return Ok(value);
    }
    Err(bad(at, value, "an elevation from -90 to 90 degrees"))
}

fn ordered(at: &Location, value: [f64; 2]) -> Result<[f64; 2], DescriptionError> {
    if value[0] <= value[1] {
        return Ok(value);
    }
    Err(bad(at, format!("{value:?}"), "a range [lower, upper] with lower <= upper"))
}

/// Range of a LiDAR in metres.
pub fn range(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    if value > 0.0 && value <= 1.0e5 {
        return Ok(value);
    }
    Err(bad(at, value, "a range above 0 and at most 100000 m"))
}
