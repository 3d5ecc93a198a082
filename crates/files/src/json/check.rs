//! Checks of single values; each error names the place, the value and the allowed ones.

use std::fmt;
use std::path::PathBuf;

use super::{FileKind, nearest, quoted};

/// Largest coordinate or length in metres: finite in `f32` with room for sums and squares.
pub const MAX_METRES: f64 = 1.0e9;

/// Largest angle in radians; larger ones are most likely degrees.
const MAX_RADIANS: f64 = std::f64::consts::TAU;
/// Radians that rounding to four decimals adds at most: 3.1416 is half a turn.
pub const ROUNDED: f64 = 5e-5;

/// Longest name in characters.
pub const MOST_CHARACTERS: usize = 200;

/// Longest value printed as it is: longer numbers are printed with an exponent.
const MOST_DIGITS: usize = 20;

/// Result of a reader: a checked value, or the first fault of the description.
pub type Checked<T> = Result<T, DescriptionError>;

/// Error of the thing at `at`, in words.
pub fn refused(at: &Location, told: impl fmt::Display) -> DescriptionError {
    DescriptionError::Refused(format!("{at}: {told}"))
}

/// Error of a value that `at` does not allow.
pub fn bad(at: &Location, value: impl ToString, wanted: impl fmt::Display) -> DescriptionError {
    let mut value = value.to_string();
    // 1e300 prints with 301 digits, and was most likely written with an exponent.
    if value.len() > MOST_DIGITS
        && let Ok(number) = value.parse::<f64>()
    {
        value = format!("{number:e}");
    }
    refused(at, format_args!("{value} is not {wanted}"))
}

/// Question about a number that was most likely written in millimetres.
pub fn millimetres(number: f64) -> String {
    format!("is it in millimetres? lengths are in metres, {number} mm are {}", number / 1000.0)
}

/// Words on a value that is `wanted` in metres, with the question about millimetres where a thousandth of the number fits.
pub fn or_millimetres(
    wanted: impl Into<String>,
    number: f64,
    fits: impl Fn(f64) -> bool,
) -> String {
    let wanted = wanted.into();
    match fits(number / 1000.0) {
        true => format!("{wanted}; {}", millimetres(number)),
        false => wanted,
    }
}

/// Error of a key that the object at `at` lacks; `mend` says what to write.
pub fn missing(at: &Location, key: &str, mend: impl fmt::Display) -> DescriptionError {
    refused(at, format_args!("`{key}` is missing: {mend}"))
}

/// Error of a key that has no meaning in the object at `at`.
pub fn misplaced(at: &Location, key: &str, mend: impl fmt::Display) -> DescriptionError {
    refused(at, format_args!("`{key}` cannot stand here: {mend}"))
}

/// Error of none or several of the keys `of` in the object at `at`, of which it has `found`.
pub fn choice(at: &Location, found: &[&str], of: &[&str]) -> DescriptionError {
    let found = if found.is_empty() { "none of the keys".to_owned() } else { quoted(found) };
    refused(at, format_args!("has {found}; give exactly one of {}", quoted(of)))
}

/// Error of a name that is none of the `known` ones, each of which is a `kind`.
pub fn unknown_name<'a>(
    at: &Location,
    kind: &str,
    name: &str,
    known: impl Iterator<Item = &'a str> + Clone,
) -> DescriptionError {
    let mend = did_you_mean(&nearest(name, known.clone()), known);
    refused(at, format_args!("no {kind} is called `{name}`{mend}"))
}

/// Error of more things of a kind than a place holds.
pub fn too_many(at: &Location, what: &str, count: u64, limit: u64, mend: &str) -> DescriptionError {
    refused(at, format_args!("{count} {what} are more than the limit of {limit}; {mend}"))
}

/// A text for tables and drawings, without control characters.
pub fn text(at: &Location, value: String) -> Checked<String> {
    if !value.contains(char::is_control) {
        return Ok(value);
    }
    Err(bad(at, format!("{value:?}"), "a text without control characters; leave them out"))
}

/// A name for tables and drawings: a [`text`] of at most 200 characters.
pub fn name(at: &Location, value: String) -> Checked<String> {
    let length = value.chars().count();
    if length > MOST_CHARACTERS {
        let wanted = format!("a name of at most {MOST_CHARACTERS} characters");
        return Err(bad(at, format!("a text of {length} characters"), wanted));
    }
    text(at, value)
}

/// A value where it `fits`; else the error that it is not `wanted`.
fn fitting(at: &Location, value: f64, fits: bool, wanted: &str) -> Checked<f64> {
    if fits { Ok(value) } else { Err(bad(at, value, wanted)) }
}

/// A coordinate in metres.
pub fn metres(at: &Location, value: f64) -> Checked<f64> {
    fitting(at, value, value.abs() <= MAX_METRES, "a coordinate within 1e9 m of the origin")
}

/// A length in metres above 0.
pub fn length(at: &Location, value: f64) -> Checked<f64> {
    let wanted = "a positive length; give metres, 0.5 for example";
    fitting(at, value, value > 0.0 && value <= MAX_METRES, wanted)
}

/// So many a second, above 0.
pub fn rate(at: &Location, value: f64) -> Checked<f64> {
    fitting(at, value, (1e-3..=1e4).contains(&value), "a number a second from 0.001 to 10000")
}

/// A heading in radians; logs add up turns.
pub fn heading(at: &Location, value: f64) -> Checked<f64> {
    // Up to 1e9 an `f64` resolves 1e-6 rad.
    fitting(at, value, value.abs() <= MAX_METRES, "a heading in radians within ±1e9")
}

/// The sector counter-clockwise from a first angle in degrees to a smaller last one, as a range that rises; `None` where it
/// would leave ±360°.
pub fn rising_sector([first, last]: [f64; 2]) -> Option<[f64; 2]> {
    let is_rising = |[first, last]: &[f64; 2]| -360.0 <= *first && first <= last && *last <= 360.0;
    let wound = [[first, last + 360.0], [first - 360.0, last]];
    wound.into_iter().find(is_rising).filter(|_| last < first)
}

/// An angle in radians.
pub fn radians(at: &Location, value: f64) -> Checked<f64> {
    let radians = value.to_radians();
    let wanted = format!(
        "an angle in radians within one turn (-6.2832 to 6.2832); {value}° are {radians:.4} rad"
    );
    fitting(at, value, value.abs() <= MAX_RADIANS + ROUNDED, &wanted)
}

/// A list of numbers that each pass a check.
fn each<const N: usize>(
    at: &Location,
    values: [f64; N],
    check: fn(&Location, f64) -> Checked<f64>,
) -> Checked<[f64; N]> {
    for (i, value) in values.into_iter().enumerate() {
        check(&at.item(i), value)?;
    }
    Ok(values)
}

/// A point `[x, y, z]` in metres.
pub fn point(at: &Location, value: [f64; 3]) -> Checked<[f64; 3]> {
    each(at, value, metres)
}

/// Lower and upper corner of a box, in metres; `empty` ends the error of one without an extent.
pub fn corners(at: &Location, min: [f64; 3], max: [f64; 3], empty: &str) -> Checked<[[f64; 3]; 2]> {
    let (min, max) = (point(&at.key("min"), min)?, point(&at.key("max"), max)?);
    rising(at, min, max)?;
    let Some(i) = (0..3).find(|&i| min[i] >= max[i]) else { return Ok([min, max]) };
    Err(bad(&at.key("max").item(i), max[i], format!("above min ({}){empty}", min[i])))
}

/// Checks that no coordinate of the upper corner of a box is below the lower corner's.
pub fn rising<const N: usize>(at: &Location, min: [f64; N], max: [f64; N]) -> Checked<()> {
    let Some(i) = (0..N).find(|&i| max[i] < min[i]) else { return Ok(()) };
    let told = format!("{} is below min ({}); are `min` and `max` swapped?", max[i], min[i]);
    Err(refused(&at.key("max").item(i), told))
}

/// End of the error of a range whose first number is above its last: the range as it is most likely meant.
pub fn swapped([first, last]: [f64; 2]) -> String {
    if last < first { format!("; write [{last}, {first}]") } else { String::new() }
}

/// A size `[x, y, z]` in metres, each above 0.
pub fn size(at: &Location, value: [f64; 3]) -> Checked<[f64; 3]> {
    each(at, value, length)
}

/// A point written `[x, y]` or `[x, y, z]`, in metres; z is 0 when it is left out.
pub fn point_2_or_3(at: &Location, value: &[f64]) -> Checked<[f64; 3]> {
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
pub fn count(at: &Location, value: u64, lo: u64, hi: u64) -> Checked<u32> {
    if (lo..=hi).contains(&value) {
        return Ok(value as u32);
    }
    Err(bad(at, value, format!("a whole number from {lo} to {hi}")))
}

/// A number from `lo` to `hi`, if one is given under `key` of the object at `at`.
pub fn within(
    at: &Location,
    key: &str,
    value: Option<f64>,
    lo: f64,
    hi: f64,
) -> Checked<Option<f64>> {
    let wanted = format!("a number from {lo} to {hi}");
    let fit = |value| fitting(&at.key(key), value, (lo..=hi).contains(&value), &wanted);
    value.map(fit).transpose()
}

/// A range `[lo, hi]` of radians with lo ≤ hi.
pub fn radian_range(at: &Location, value: [f64; 2]) -> Checked<[f64; 2]> {
    ordered(at, each(at, value, radians)?)
}

/// A vertical field of view `[lower, upper]` in degrees.
pub fn fov(at: &Location, value: [f64; 2]) -> Checked<[f64; 2]> {
    ordered(at, each(at, value, elevation)?)
}

/// An elevation in degrees.
pub fn elevation(at: &Location, value: f64) -> Checked<f64> {
    fitting(at, value, value.abs() <= 90.0, "an elevation from -90 to 90 degrees")
}

fn ordered(at: &Location, value: [f64; 2]) -> Checked<[f64; 2]> {
    if value[0] <= value[1] {
        return Ok(value);
    }
    let wanted = format!("a range [lower, upper] with lower <= upper{}", swapped(value));
    Err(bad(at, format!("{value:?}"), wanted))
}

/// Range of a LiDAR in metres.
pub fn range(at: &Location, value: f64) -> Checked<f64> {
    let fits = |range: f64| range > 0.0 && range <= 1.0e5;
    let wanted = or_millimetres("a range above 0 and at most 100000 m", value, fits);
    fitting(at, value, fits(value), &wanted)
}

/// Why a scene file, or a sensor or mesh file that it names, could not be read.
///
/// Every message is one sentence with the file, the place in it, the value and the mend.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum DescriptionError {
    #[error("{file}: cannot be read: {source}")]
    Read { file: PathBuf, source: std::io::Error },
    #[error("{at}: {source}")]
    InFile { at: Box<Location>, source: Box<DescriptionError> },
    #[error("{at}: {problem} (line {line}, column {column})")]
    Json { at: Box<Location>, problem: String, line: usize, column: usize },
    #[error("{file}: {told}; a {} file begins with {{", .wanted.words()[0])]
    NotJson { file: String, told: String, wanted: FileKind },
    #[error("{file}: is {found}, where {wanted} belongs; give it {}", .found.place())]
    OtherKind { file: String, found: FileKind, wanted: String },
    #[error("{at}: mesh {mesh}: {element}: {problem}")]
    Mesh { at: Box<Location>, mesh: PathBuf, element: String, problem: String },
    /// Any other file, key, name or value; the sentence tells its place and the mend.
    #[error("{0}")]
    Refused(String),
}

impl DescriptionError {
    /// Wraps the fault of a file with the place that names the file.
    pub fn of_file(self, at: Location) -> Self {
        Self::InFile { at: Box::new(at), source: Box::new(self) }
    }
}

/// End of an error about an unknown name: the nearest known name, or the list of known ones.
pub fn did_you_mean<T: fmt::Display>(
    nearest: &Option<String>,
    known: impl IntoIterator<Item = T>,
) -> String {
    match (nearest, quoted(known)) {
        (Some(name), _) => format!("; did you mean `{name}`?"),
        (None, known) if known.is_empty() => "; nothing is known here".to_owned(),
        (None, known) => format!("; known are {known}"),
    }
}

/// Place of a value: the file and the JSON path inside it.
///
/// Prints as `scenes/x.json: static[3].box.size[1]`, and as the file alone at the top level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Location {
    /// The file as the user named it.
    pub file: String,
    /// JSON path from the top of the file; empty at the top level.
    pub path: String,
}

impl Location {
    /// The top level of `file`.
    pub fn top(file: &str) -> Self {
        Self { file: file.to_owned(), path: String::new() }
    }

    /// The value under `key` of the object here.
    pub fn key(&self, key: &str) -> Self {
        let dot = if self.path.is_empty() { "" } else { "." };
        Self { file: self.file.clone(), path: format!("{}{dot}{key}", self.path) }
    }

    /// Item `i` of the list here, counted from 0.
    pub fn item(&self, i: usize) -> Self {
        Self { file: self.file.clone(), path: format!("{}[{i}]", self.path) }
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if !self.path.is_empty() {
            write!(f, ": {}", self.path)?;
        }
        Ok(())
    }
}
