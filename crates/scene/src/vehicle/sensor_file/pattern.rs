//! Content of a sensor file of any vendor: beams and facts, in the frame and signs of this library.
//!
//! Keys that no reader knows are kept by name; answers that are an error's text are told apart.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::fmt;
use std::marker::PhantomData;

use serde::Serialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, Visitor};

use lidar_cast::maths;
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{Checked, Location, nearest};

pub(crate) const MAX_CHANNELS: usize = 1024;
pub(crate) const MAX_BEAMS: u64 = 10_000_000;
pub(super) const MAX_COLUMNS: u64 = 100_000;
/// Least vertical field of view in degrees that is no doubt: the narrowest LiDARs of several channels have three, and the
/// widest half a turn and more are as many radians.
pub(in super::super) const NARROWEST: f64 = 2.0;
/// Finest mean step of elevations in degrees that is no doubt, where all could be radians.
const FINEST: f64 = 0.06;
/// Longest piece of a file that an error repeats, in characters.
const LONGEST_QUOTE: usize = 24;

/// A sensor as its file describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorPattern {
    /// Who wrote the file.
    pub format: SensorFormat,
    /// Name of the model, if the file states one.
    pub model: Option<String>,
    /// The beams.
    pub beams: Beams,
    /// Columns a turn, if the file states them.
    pub azimuth_steps: Option<u32>,
    /// Azimuths of the first and the last column that the sensor is set to look at, in degrees, counter-clockwise;
    /// `None` for a whole turn.
    pub azimuth: Option<[f64; 2]>,
    /// Ranges and errors, if the file states them.
    pub measures: Measures,
    /// Sentences about parts of the file: dropped, unknown, or most likely wrong.
    pub notes: Vec<Note>,
}

/// How a sensor measures, as far as its file says.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Measures {
    /// Largest range, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<f64>,
    /// Smallest range, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub min_range: Option<f64>,
    /// Range of a target that reflects 10 %, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rated_range: Option<f64>,
    /// Standard deviation of the range, metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub noise: Option<f64>,
    /// Turns or whole patterns a second.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
}

/// Formats that are told apart by content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorFormat {
    /// JSON with `elevation_deg` and `azimuth_offset_deg`.
    Table,
    /// Calibration YAML of the ROS drivers for Velodyne.
    Velodyne,
    /// Angle correction CSV.
    Hesai,
    /// Metadata JSON.
    Ouster,
    /// Scan pattern CSV: time, azimuth, zenith.
    Livox,
    /// Angle CSV without a header.
    RoboSense,
    /// Lidar profile JSON of Isaac Sim.
    Isaac,
    /// 3×4 matrices of `f32`, one a ray, as RGL reads them.
    Rgl,
    /// Array `[N, 2]` of azimuth and elevation in radians, `.npy`.
    Numpy,
}

/// One channel of a spinning sensor, in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Up from the xy plane.
    pub elevation: f64,
    /// Counter-clockwise, added to the azimuth of each step.
    pub azimuth_offset: f64,
}

/// Beams of a sensor file.
#[derive(Debug, Clone, PartialEq)]
pub enum Beams {
    /// Channels that turn about z, in the order of the file.
    Channels(Vec<Channel>),
    /// Unit vectors in the sensor frame (x forward, y left, z up), in the order of the file.
    Directions(Vec<[f64; 3]>),
}

/// Names of all formats, in the order of [`SensorFormat`].
pub(super) const FORMATS: [&str; 9] = [
    "JSON with `elevation_deg`",
    "Velodyne calibration YAML",
    "Hesai angle correction CSV",
    "Ouster metadata JSON",
    "Livox pattern CSV",
    "RoboSense angle CSV",
    "Isaac lidar profile JSON",
    "RGL pattern of 3×4 matrices",
    "NumPy array of azimuth and elevation",
];

impl fmt::Display for SensorFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(FORMATS[*self as usize])
    }
}

impl SensorPattern {
    /// A pattern with beams and no other facts.
    pub fn new(format: SensorFormat, beams: Beams) -> Self {
        Self {
            format,
            model: None,
            beams,
            azimuth_steps: None,
            azimuth: None,
            measures: Measures::default(),
            notes: Vec::new(),
        }
    }

    /// Columns in a frame and the azimuths of the first and the last one, where a turn has `steps` columns.
    /// A whole turn has no such azimuths.
    pub fn columns(&self, steps: u32) -> (u32, Option<[f64; 2]>) {
        let Some([from, to]) = self.azimuth else { return (steps, None) };
        let step = 360.0 / f64::from(steps.max(1));
        // A millionth of a column keeps the last one in the window whatever its rounding.
        let count = ((to - from) / step + 1e-6).floor().max(0.0) as u32 + 1;
        if count >= steps {
            (steps, None)
        } else {
            (count, Some([from, from + f64::from(count - 1) * step]))
        }
    }
}

/// A checked channel; `elevation` and `offset` are places and values.
pub(super) fn channel(elevation: (&Location, f64), offset: (&Location, f64)) -> Checked<Channel> {
    Ok(Channel {
        elevation: check::elevation(elevation.0, elevation.1)?,
        azimuth_offset: azimuth(offset.0, offset.1)?,
    })
}

/// An azimuth in degrees.
pub(super) fn azimuth(at: &Location, value: f64) -> Checked<f64> {
    if value.abs() <= 360.0 {
        return Ok(value);
    }
    Err(bad(at, value, "an azimuth from -360 to 360 degrees"))
}

/// Degrees of an angle in radians, without the part that rounding adds beyond `most`: π/2 as `f32`, and as 1.5708, is
/// more than a right angle.
pub(super) fn degrees(radians: f64, most: f64) -> f64 {
    let degrees = radians.to_degrees();
    if degrees.abs() <= most + check::ROUNDED.to_degrees() {
        degrees.clamp(-most, most)
    } else {
        degrees
    }
}

/// Channels of two lists of the same length: elevations, and offsets counted by `sign`.
pub(super) fn channels_of(
    [elevation_at, offset_at]: [&Location; 2],
    elevations: &[f64],
    offsets: &[f64],
    sign: f64,
) -> Checked<Beams> {
    check_count(elevation_at, elevations.len())?;
    if offsets.len() != elevations.len() {
        let wanted = format!("one offset for each of the {} elevations", elevations.len());
        return Err(bad(offset_at, format!("a list of {}", offsets.len()), wanted));
    }
    let both = elevations.iter().zip(offsets).enumerate();
    let channels = both.map(|(i, (&elevation, &offset))| {
        // Adding 0 makes 0 of -0.
        let offset = sign * offset + 0.0;
        channel((&elevation_at.item(i), elevation), (&offset_at.item(i), offset))
    });
    Ok(Beams::Channels(channels.collect::<Result<_, _>>()?))
}

/// Refuses a sensor without channels or with too many.
pub(super) fn check_count(at: &Location, count: usize) -> Checked<()> {
    if (1..=MAX_CHANNELS).contains(&count) {
        return Ok(());
    }
    Err(bad(at, format!("a list of {count}"), format!("1 to {MAX_CHANNELS} elevations")))
}

/// Doubts about the angles of a pattern, whatever its format: radians, and channels that are listed twice.
pub(super) fn doubts(at: &Location, beams: &Beams) -> Vec<Note> {
    let Beams::Channels(channels) = beams else { return Vec::new() };
    let mut notes: Vec<Note> = narrow(at, channels).into_iter().collect();
    let mut seen = BTreeMap::new();
    for (k, channel) in channels.iter().enumerate() {
        let key = [channel.elevation, channel.azimuth_offset].map(|angle| (angle + 0.0).to_bits());
        seen.entry(key).or_insert_with(Vec::new).push(k);
    }
    let twice = seen.values().filter(|same| same.len() > 1).max_by_key(|same| same.len());
    notes.extend(twice.map(|same| {
        let Channel { elevation, azimuth_offset } = channels[same[0]];
        Note::doubt(format!(
            "{at}: {} channels, {} and {} among them, stand at elevation {elevation} and offset {azimuth_offset}: \
             places without a beam? Leave out what is not there.",
            same.len(),
            same[0],
            same[1]
        ))
    }));
    notes
}

/// A doubt about a range at 10 % reflectance beyond the largest range, which stands under `key`.
pub(super) fn rated_too_far(at: &Location, measures: &Measures, key: &str) -> Option<Note> {
    let both = measures.rated_range.zip(measures.range);
    both.filter(|(rated, range)| rated > range).map(|(rated, range)| {
        Note::doubt(format!(
            "{at}: a range of {} m at 10 % reflectance lies beyond `{key}`, {range} m: a value of a template? \
             Give `response.rated_range`.",
            (rated * 1e3).round() / 1e3
        ))
    })
}

/// A doubt about elevations that look like radians: spread over less than a degree, or within ±π/2 in steps
/// finer than sensors have.
fn narrow(at: &Location, channels: &[Channel]) -> Option<Note> {
    let all = || channels.iter().map(|channel| channel.elevation);
    let [low, high] =
        [all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max)];
    let steps = channels.len().saturating_sub(1) as f64;
    let is_fine = low.abs().max(high.abs()) <= FRAC_PI_2 && high - low < FINEST * steps;
    let text = format!(
        "{at}: {} channels from {low:.3} to {high:.3} degrees, {:.3} degrees in all: radians? Write degrees.",
        channels.len(),
        high - low
    );
    (steps > 0.0 && high > low && (high - low < NARROWEST || is_fine)).then(|| Note::doubt(text))
}

/// Unit vector of an azimuth and an elevation in degrees.
pub(super) fn direction(azimuth: f64, elevation: f64) -> [f64; 3] {
    let (sin_a, cos_a) = maths::sin_cos(azimuth.to_radians());
    let (sin_e, cos_e) = maths::sin_cos(elevation.to_radians());
    [cos_e * cos_a, cos_e * sin_a, sin_e]
}

/// The start of a text, in quotes, for an error.
pub(super) fn quoted(text: &str) -> String {
    match text.char_indices().nth(LONGEST_QUOTE) {
        Some((end, _)) => format!("{:?}…", &text[..end]),
        None => format!("{text:?}"),
    }
}

/// Unknown keys of a struct (`#[serde(flatten)]`); their values are not kept.
pub(super) type Rest = BTreeMap<Key, IgnoredAny>;

/// The start of a key: YAML repeats a long one by an alias of two letters.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, serde::Deserialize)]
#[serde(from = "String")]
pub(super) struct Key(String);

impl From<String> for Key {
    fn from(text: String) -> Self {
        Self(text.chars().take(LONGEST + 1).collect())
    }
}

impl AsRef<str> for Key {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

/// Keys that are passed over, with blanks between them, and why.
pub(super) type Passed = &'static [(&'static str, &'static str)];

/// Most unknown keys that a note names.
const MOST_NAMED: usize = 8;
/// Longest name of a key in a note, in characters.
const LONGEST: usize = 40;

/// The keys of `rest` that `passed` does not list.
pub(super) fn unknown(at: &Location, rest: &Rest, passed: Passed) -> Option<Note> {
    unread(at, &unknown_keys(rest, passed))
}

fn unknown_keys(rest: &Rest, passed: Passed) -> Vec<&Key> {
    let is_passed = |Key(key): &Key| {
        let comment = key.trim_start_matches('_').to_ascii_lowercase().starts_with("comment");
        comment || passed.iter().any(|(keys, _)| keys.split(' ').any(|known| known == key))
    };
    rest.keys().filter(|key| !is_passed(key)).collect()
}

/// Like [`unknown`] for a file that is written by hand: a key near one of `read`, keys with blanks between them, is most
/// likely a slip.
pub(super) fn unknown_or_slip(
    at: &Location,
    rest: &Rest,
    passed: Passed,
    read: &str,
) -> Option<Note> {
    let unknown = unknown_keys(rest, passed);
    let note = unread(at, &unknown)?;
    let near = unknown.iter().find_map(|Key(key)| Some((key, near_key(key, read)?)));
    Some(match near {
        Some((key, near)) => {
            let text = note.text().trim_end_matches('.');
            let key =
                if unknown.len() > 1 { format!(" instead of `{key}`") } else { String::new() };
            Note::doubt(format!("{text}; did you mean `{near}`{key}?"))
        }
        None => note,
    })
}

/// The key of `read` that another one is a slip of: a letter or two beside it, or its beginning.
fn near_key(key: &str, read: &str) -> Option<String> {
    let begun = |known: &&str| key.len() > 4 && known.starts_with(key);
    let begun = read.split(' ').find(begun).map(str::to_owned);
    begun.or_else(|| nearest(key, read.split(' ')))
}

/// A note on names that are not known here, keys or titles of columns.
pub(super) fn unread<S: AsRef<str>>(at: &Location, names: &[S]) -> Option<Note> {
    let short =
        |name: &S| format!("`{}`", name.as_ref().escape_debug().take(LONGEST).collect::<String>());
    let named: Vec<String> = names.iter().take(MOST_NAMED).map(short).collect();
    let more = match names.len().saturating_sub(MOST_NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let text = format!("{at}: {}{more}: not known here, and not read.", named.join(", "));
    (!names.is_empty()).then(|| Note::fact(text))
}

/// A part of metadata: an object, or the text that a sensor answers to a question it does not know.
#[derive(Debug)]
pub(super) enum Answer<T> {
    Read(T),
    Text(String),
}

impl<T> Answer<T> {
    /// The part; a text in its place becomes a note.
    pub(super) fn or_note(self, at: &Location, notes: &mut Vec<Note>) -> Option<T> {
        match self {
            Self::Read(part) => Some(part),
            Self::Text(text) => {
                let text = quoted(&text);
                notes.push(Note::fact(format!(
                    "{at}: the text {text} stands in its place; not read."
                )));
                None
            }
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Answer<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AnswerVisitor<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for AnswerVisitor<T> {
            type Value = Answer<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a map")
            }

            fn visit_str<E>(self, text: &str) -> Result<Answer<T>, E> {
                Ok(Answer::Text(text.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Answer<T>, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Answer::Read)
            }
        }
        deserializer.deserialize_any(AnswerVisitor(PhantomData))
    }
}
