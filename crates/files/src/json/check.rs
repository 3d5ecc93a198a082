//! Checks of single values; each error names the place, the value and the allowed ones.

use std::fmt;
use std::path::PathBuf;

use super::{FileKind, ForeignJson, nearest};

/// Largest coordinate or length in metres: finite in `f32` with room for sums and squares.
pub const MAX_METRES: f64 = 1.0e9;

/// Largest angle in radians; larger ones are most likely degrees.
const MAX_RADIANS: f64 = std::f64::consts::TAU;

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

/// Result of a reader: a checked value, or the first fault of the description.
pub type Checked<T> = Result<T, DescriptionError>;

/// Error of a key that the object at `at` lacks; `mend` says what to write.
pub fn missing(at: &Location, key: &'static str, mend: impl Into<String>) -> DescriptionError {
    DescriptionError::Missing { at: Box::new(at.clone()), key, mend: mend.into() }
}

/// Error of a key that has no meaning in the object at `at`.
pub fn misplaced(at: &Location, key: &'static str, mend: impl Into<String>) -> DescriptionError {
    DescriptionError::Misplaced { at: Box::new(at.clone()), key, mend: mend.into() }
}

/// Error of none or several of the keys `of` in the object at `at`, of which it has `found`.
pub fn choice(
    at: &Location,
    found: Vec<&'static str>,
    of: &'static [&'static str],
) -> DescriptionError {
    DescriptionError::Choice { at: Box::new(at.clone()), found, of }
}

/// Error of a name that is none of the `known` ones, each of which is a `kind`.
pub fn unknown_name<'a>(
    at: &Location,
    kind: &'static str,
    name: &str,
    known: impl Iterator<Item = &'a str> + Clone,
) -> DescriptionError {
    DescriptionError::UnknownName {
        at: Box::new(at.clone()),
        kind,
        name: name.to_owned(),
        nearest: nearest(name, known.clone()),
        known: known.map(str::to_owned).collect(),
    }
}

/// Error of more things of a kind than a place holds.
pub fn too_many(
    at: &Location,
    what: &'static str,
    count: u64,
    limit: u64,
    mend: &'static str,
) -> DescriptionError {
    DescriptionError::TooMany { at: Box::new(at.clone()), what, count, limit, mend }
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

/// A value where it `fits`; else the error that it is not `wanted`.
fn fitting(at: &Location, value: f64, fits: bool, wanted: &str) -> Result<f64, DescriptionError> {
    if fits { Ok(value) } else { Err(bad(at, value, wanted)) }
}

/// A coordinate in metres.
pub fn metres(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    fitting(at, value, value.abs() <= MAX_METRES, "a coordinate within 1e9 m of the origin")
}

/// A length in metres above 0.
pub fn length(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    fitting(at, value, value > 0.0 && value <= MAX_METRES, "a positive length")
}

/// So many a second, above 0.
pub fn rate(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    fitting(at, value, (1e-3..=1e4).contains(&value), "a number a second from 0.001 to 10000")
}

/// A heading in radians; logs add up turns.
pub fn heading(at: &Location, value: f64) -> Result<f64, DescriptionError> {
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
pub fn radians(at: &Location, value: f64) -> Result<f64, DescriptionError> {
    let radians = value.to_radians();
    let wanted = format!(
        "an angle in radians within one turn (-6.2832 to 6.2832); {value}° are {radians:.4} rad"
    );
    fitting(at, value, value.abs() <= MAX_RADIANS, &wanted)
}

/// A point `[x, y, z]` in metres.
pub fn point(at: &Location, value: [f64; 3]) -> Result<[f64; 3], DescriptionError> {
    for (i, v) in value.into_iter().enumerate() {
        metres(&at.item(i), v)?;
    }
    Ok(value)
}

/// Lower and upper corner of a box, in metres; `empty` ends the error of one without an extent.
pub fn corners(at: &Location, min: [f64; 3], max: [f64; 3], empty: &str) -> Checked<[[f64; 3]; 2]> {
    let (min, max) = (point(&at.key("min"), min)?, point(&at.key("max"), max)?);
    match (0..3).find(|&i| min[i] >= max[i]) {
        Some(i) => {
            Err(bad(&at.key("max").item(i), max[i], format!("above min ({}){empty}", min[i])))
        }
        None => Ok([min, max]),
    }
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
            let numbers = format!("a list of {} numbers", value.len());
            return Err(bad(at, numbers, "[x, y] or [x, y, z]"));
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

/// A number from `lo` to `hi`, if one is given under `key` of the object at `at`.
pub fn within(
    at: &Location,
    key: &str,
    value: Option<f64>,
    lo: f64,
    hi: f64,
) -> Checked<Option<f64>> {
    match value {
        Some(value) if !(lo..=hi).contains(&value) => {
            Err(bad(&at.key(key), value, format!("a number from {lo} to {hi}")))
        }
        other => Ok(other),
    }
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
    fitting(at, value, value.abs() <= 90.0, "an elevation from -90 to 90 degrees")
}

fn ordered(at: &Location, value: [f64; 2]) -> Result<[f64; 2], DescriptionError> {
    if value[0] <= value[1] {
        return Ok(value);
    }
    Err(bad(at, format!("{value:?}"), "a range [lower, upper] with lower <= upper"))
}

/// Range of a LiDAR in metres.
pub fn range(at: &Location, value: f64) -> Result<f64, DescriptionError> {
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
    #[error("{file}: is larger than the limit of {limit} bytes; split or simplify it")]
    TooLarge { file: PathBuf, limit: u64 },
    #[error("{file}: is UTF-16 text; save it as UTF-8")]
    Utf16 { file: PathBuf },
    #[error("{at}: {problem} (line {line}, column {column})")]
    Json { at: Box<Location>, problem: String, line: usize, column: usize },
    #[error("{file}: line {line} is a comment, and JSON has no comments; remove it")]
    Comment { file: String, line: usize },
    #[error("{file}: {told}; a {} file begins with {{", .wanted.words()[0])]
    NotJson { file: String, told: String, wanted: FileKind },
    #[error(
        "{at}: unknown key `{key}`{} (line {line}, column {column})",
        did_you_mean(.nearest, .known)
    )]
    UnknownKey {
        at: Box<Location>,
        key: String,
        nearest: Option<String>,
        known: Vec<String>,
        line: usize,
        column: usize,
    },
    #[error("{at}: {found}; this program reads version 1, write `\"sightline\": 1`")]
    Version { at: Box<Location>, found: String },
    #[error("{file}: is {found}, where {wanted} belongs; give it {}", .found.place())]
    OtherKind { file: String, found: FileKind, wanted: String },
    #[error("{file}: is {found}, where {wanted} belongs; {}", .found.mend())]
    Foreign { file: String, found: ForeignJson, wanted: String },
    #[error("{at}: {value} is not {wanted}")]
    Value { at: Box<Location>, value: String, wanted: String },
    #[error("{at}: `{key}` is missing: {mend}")]
    Missing { at: Box<Location>, key: &'static str, mend: String },
    #[error("{at}: `{key}` cannot stand here: {mend}")]
    Misplaced { at: Box<Location>, key: &'static str, mend: String },
    #[error("{at}: has {}; give exactly one of {}", listed(.found, "none of the keys"), listed(.of, ""))]
    Choice { at: Box<Location>, found: Vec<&'static str>, of: &'static [&'static str] },
    #[error("{at}: no {kind} is called `{name}`{}", did_you_mean(.nearest, .known))]
    UnknownName {
        at: Box<Location>,
        kind: &'static str,
        name: String,
        nearest: Option<String>,
        known: Vec<String>,
    },
    #[error("{at}: {count} {what} are more than the limit of {limit}; {mend}")]
    TooMany { at: Box<Location>, what: &'static str, count: u64, limit: u64, mend: &'static str },
    /// The mount leaves the ROI of `scene` sideways, or lies below it or more than 10 m above; corners in metres.
    #[error(
        "{at}: the mount runs from {min:?} to {max:?}, outside of the region of {scene} ({roi_min:?} to \
         {roi_max:?}) in {axis}; {}",
        in_metres(min, max)
    )]
    MountOutside {
        at: Box<Location>,
        scene: String,
        axis: char,
        min: [f64; 3],
        max: [f64; 3],
        roi_min: [f64; 3],
        roi_max: [f64; 3],
    },
    #[error("{at}: mesh {mesh}: {element}: {problem}")]
    Mesh { at: Box<Location>, mesh: PathBuf, element: String, problem: String },
    #[error(
        "{at}: mesh {mesh}: material `{material}` has no class; name it in `classes` or give the \
         shape a `class` for the rest"
    )]
    Unclassed { at: Box<Location>, mesh: PathBuf, material: String },
}

/// Metres from the origin from which on a place of a vehicle was written in millimetres.
const MILLIMETRES: f64 = 100.0;

/// Mend of a mount outside the ROI.
fn in_metres(min: &[f64; 3], max: &[f64; 3]) -> String {
    let far = min
        .iter()
        .chain(max)
        .copied()
        .fold(0.0, |far: f64, v| if v.abs() > far.abs() { v } else { far });
    match far.abs() >= MILLIMETRES {
        true => millimetres(far),
        false => "move the mount or enlarge the `roi`".to_owned(),
    }
}

impl DescriptionError {
    /// Wraps the fault of a file with the place that names the file.
    pub fn of_file(self, at: Location) -> Self {
        Self::InFile { at: Box::new(at), source: Box::new(self) }
    }
}

fn listed(keys: &[&str], none: &str) -> String {
    if keys.is_empty() { none.to_owned() } else { super::quoted(keys) }
}

/// End of an error about an unknown name: the nearest known name, or the list of known ones.
pub fn did_you_mean(nearest: &Option<String>, known: &[String]) -> String {
    match nearest {
        Some(name) => format!("; did you mean `{name}`?"),
        None if known.is_empty() => "; nothing is known here".to_owned(),
        None => format!("; known are {}", super::quoted(known)),
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
