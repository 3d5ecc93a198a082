//! Weather and faults in scans, computed for each beam.
//!
//! The user writes a condition as `fog:mor=50` or `snow:level=heavy`: the kinds have keys, levels and limits.

mod fog;
mod snow;

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};
use sightline_scene::scene::Ground;

use crate::fires::Purpose;
use crate::{ScanError, Status};

pub(crate) use fog::Fog;
pub(crate) use snow::{FallEffect, Falling, Flake, JoinedEcho};

/// Weather and sensor faults of a scan; clear air by default.
#[derive(Debug, Clone, Default)]
pub struct Weather {
    pub(crate) fog: Option<Fog>,
    pub(crate) wet: Option<WetGround>,
    pub(crate) snow: Option<Falling>,
    pub(crate) rain: Option<Falling>,
    /// Share of the true motion in a turn that is left: 0 the points where they were, 1 the raw points.
    pub(crate) blur: f64,
    /// Share of the returns that other sensors' pulses come before.
    pub(crate) crosstalk: f64,
    pub(crate) echo: Option<IncompleteEcho>,
}

/// Conditions as they are written, one after the other.
pub fn in_words(conditions: &[Condition]) -> Vec<String> {
    conditions.iter().map(Condition::to_string).collect()
}

/// Words to append to a result: `, under fog:…`; empty in clear air.
pub fn under(conditions: &[String]) -> String {
    match conditions {
        [] => String::new(),
        all => format!(", under {}", all.join(" and ")),
    }
}

impl Weather {
    /// Snow and rain, each with the purpose of its draws and the status of its echoes.
    pub(crate) fn falls(&self) -> impl Iterator<Item = (&Falling, Purpose, Status)> {
        let snow = self.snow.iter().map(|snow| (snow, Purpose::Snow, Status::Snow));
        snow.chain(self.rain.iter().map(|rain| (rain, Purpose::Rain, Status::Rain)))
    }

    /// Mean share of the light that passes to a surface so many metres away and back: fog, snow and rain take some.
    pub fn passed(&self, metres: f64) -> f64 {
        let fog = self.fog.as_ref().map_or(1.0, |fog| fog.attenuation(metres));
        let falls = self.falls();
        fog * falls
            .map(|(fall, ..)| lidar_cast::maths::exp(-2.0 * fall.extinction() * metres))
            .product::<f64>()
    }
}

/// The weather that conditions make together.
///
/// # Errors
/// A condition given twice.
pub fn weather(conditions: &[Condition]) -> Result<Weather, ScanError> {
    let mut weather = Weather::default();
    for (place, condition) in conditions.iter().enumerate() {
        let kind = condition.kind();
        if conditions[..place].iter().any(|other| other.kind() == kind) {
            let told = format!("the condition {} is given twice; give it once", kind.name());
            return Err(ScanError::Refused(told));
        }
        let value = |key: &str| condition.value(key).unwrap_or(0.0);
        match kind {
            ConditionKind::Fog => weather.fog = Some(Fog::new(value("mor"), value("gain"))),
            ConditionKind::Wet => weather.wet = Some(WetGround::new(value("water"))),
            ConditionKind::Snow => {
                weather.snow = Some(Falling::snow(value("rate"), value("speed")))
            }
            ConditionKind::Rain => weather.rain = Some(Falling::rain(value("rate"))),
            ConditionKind::Blur => weather.blur = value("share"),
            ConditionKind::Crosstalk => weather.crosstalk = value("share"),
            ConditionKind::Echo => weather.echo = Some(IncompleteEcho::new(value("ratio"))),
        }
    }
    Ok(weather)
}

const MOST_KEYS: usize = 2;

/// One condition: `NAME[:KEY=VALUE[,KEY=VALUE…]]`.
///
/// `level` is `light`, `moderate` or `heavy` and sets all keys. Other keys are numbers and overrule the level,
/// wherever they stand. A condition is written out with all its numbers and no level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    kind: ConditionKind,
    /// Values in the order of the kind's keys.
    values: [f64; MOST_KEYS],
}

impl Condition {
    /// Kind of weather or fault.
    pub fn kind(&self) -> ConditionKind {
        self.kind
    }

    /// True for weather that takes light on the way to a target and back.
    pub fn dims_light(&self) -> bool {
        matches!(self.kind, ConditionKind::Fog | ConditionKind::Snow | ConditionKind::Rain)
    }

    /// Value of a key; none of a key that it does not have.
    pub fn value(&self, key: &str) -> Option<f64> {
        let place = keys(self.kind).iter().position(|known| known.name == key)?;
        Some(self.values[place])
    }
}

impl FromStr for Condition {
    type Err = ScanError;

    fn from_str(text: &str) -> Result<Self, ScanError> {
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        let kind = ConditionKind::ALL.into_iter().find(|kind| kind.name() == name);
        let kind = kind.ok_or_else(|| {
            ScanError::Refused(format!(
                "there is no condition `{name}`; known are fog, wet, snow, rain, blur, crosstalk and echo, with values behind \
                 a colon, as in fog:mor=200"
            ))
        })?;
        let pairs = pairs(text, rest, kind)?;
        let level = pairs.iter().find(|(key, _)| *key == "level");
        let level = level.map(|(_, word)| level_of(word, kind)).transpose()?;
        let mut values = [0.0; MOST_KEYS];
        for (value, key) in values.iter_mut().zip(keys(kind)) {
            *value = level.map_or(key.usual, |level| key.levels[level]);
        }
        for (name, text) in pairs.iter().filter(|(key, _)| *key != "level") {
            let place = keys(kind).iter().position(|key| key.name == *name);
            let place = place.ok_or_else(|| unknown_key(name, kind))?;
            values[place] = number(&keys(kind)[place], kind, text)?;
        }
        Ok(Self { kind, values })
    }
}

/// Number of a level, weakest first.
fn level_of(word: &str, kind: ConditionKind) -> Result<usize, ScanError> {
    let level = LEVELS.iter().position(|level| *level == word);
    level.ok_or_else(|| {
        let (kind, known) = (kind.name(), LEVELS.join(", "));
        ScanError::Refused(format!("`level={word}` of {kind}: `{word}` is not one of {known}"))
    })
}

/// Pairs of keys and values, each key once.
fn pairs<'t>(
    text: &str,
    rest: &'t str,
    kind: ConditionKind,
) -> Result<Vec<(&'t str, &'t str)>, ScanError> {
    let mut pairs: Vec<(&str, &str)> = Vec::new();
    for part in rest.split(',').filter(|_| text.contains(':')) {
        let Some(pair) = part.split_once('=') else {
            let (kind, known) = (kind.name(), keys_in_words(kind));
            return Err(ScanError::Refused(format!(
                "`{part}` in the condition `{text}` is no KEY=VALUE; {kind} takes {known}"
            )));
        };
        if pairs.iter().any(|(key, _)| *key == pair.0) {
            let told = format!("the condition `{text}` gives `{}` twice; give it once", pair.0);
            return Err(ScanError::Refused(told));
        }
        pairs.push(pair);
    }
    Ok(pairs)
}

fn number(key: &ConditionKey, kind: ConditionKind, text: &str) -> Result<f64, ScanError> {
    let [least, most] = key.limits;
    let value = text.parse().ok().filter(|value| (least..=most).contains(value));
    value.ok_or_else(|| {
        let limits = match most.is_finite() {
            true => format!("a number from {least} to {most}{}", key.unit),
            false => format!("a number from {least}{} on", key.unit),
        };
        let (key, kind) = (key.name, kind.name());
        ScanError::Refused(format!("`{key}={text}` of {kind}: wanted is {limits}"))
    })
}

fn unknown_key(key: &str, kind: ConditionKind) -> ScanError {
    let hint = match key {
        "mode" => {
            "; for the corruptions of Robo3D run its own program on a set of `--layout semantickitti` \
             (docs/scans.md)"
        }
        _ => "",
    };
    let (kind, known) = (kind.name(), keys_in_words(kind));
    ScanError::Refused(format!("{kind} has no key `{key}`; it takes {known}{hint}"))
}

/// Keys in words: `level, mor, gain`.
fn keys_in_words(kind: ConditionKind) -> String {
    let own = keys(kind).iter().map(|key| key.name);
    std::iter::once("level").chain(own).collect::<Vec<_>>().join(", ")
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Further keys at their usual values go without saying.
        let numbers = keys(self.kind).iter().zip(self.values).enumerate();
        let told = numbers.filter(|(at, (key, value))| *at == 0 || *value != key.usual);
        let pairs: Vec<String> =
            told.map(|(_, (key, value))| format!("{}={value}", key.name)).collect();
        write!(f, "{}:{}", self.kind.name(), pairs.join(","))
    }
}

impl Serialize for Condition {
    /// A string as on the command line, such as `fog:mor=50`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// Fault with the weather or the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConditionKind {
    /// Fog.
    Fog,
    /// Water on the ground.
    Wet,
    /// Falling snow.
    Snow,
    /// Falling rain.
    Rain,
    /// Motion blur.
    Blur,
    /// Crosstalk of sensors.
    Crosstalk,
    /// Incomplete echoes of vehicles.
    Echo,
}

impl ConditionKind {
    pub(crate) const ALL: [Self; 7] =
        [Self::Fog, Self::Wet, Self::Snow, Self::Rain, Self::Blur, Self::Crosstalk, Self::Echo];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        KINDS[self as usize].0
    }
}

/// Names of the levels, weakest first.
const LEVELS: [&str; 3] = ["light", "moderate", "heavy"];

/// A number that a condition takes.
#[derive(Debug, PartialEq)]
struct ConditionKey {
    name: &'static str,
    unit: &'static str,
    /// Least and greatest value.
    limits: [f64; 2],
    /// Value at each level, the weakest first.
    levels: [f64; 3],
    /// Value without a level.
    usual: f64,
}

const fn key(
    name: &'static str,
    unit: &'static str,
    limits: [f64; 2],
    levels: [f64; 3],
    usual: f64,
) -> ConditionKey {
    ConditionKey { name, unit, limits, levels, usual }
}

/// Names and keys, in the order of [`ConditionKind`].
///
/// Levels of fog are the thinnest and the thickest of the fogs that SemanticKITTI-C draws, and one between; levels of
/// water, snow, crosstalk and echoes are that set's. Levels of rain lie within slight, moderate and heavy rain of
/// the WMO (below 2.5, 10 and 50 mm/h).
const KINDS: [(&str, &[ConditionKey]); 7] = [
    (
        "fog",
        &[
            key("mor", " m", [1.0, f64::INFINITY], [600.0, 200.0, 50.0], 200.0),
            key("gain", "", [0.0, 1e3], [1.0; 3], 1.0),
        ],
    ),
    ("wet", &[key("water", " mm", [0.0, 100.0], [0.2, 1.0, 1.2], 1.0)]),
    (
        "snow",
        &[
            key("rate", " mm/h", [0.0, 10.0], [0.5, 1.0, 2.5], 1.0),
            key("speed", " m/s", [0.3, 5.0], [2.0, 1.6, 1.6], 1.6),
        ],
    ),
    ("rain", &[key("rate", " mm/h", [0.0, 200.0], [2.0, 5.0, 25.0], 5.0)]),
    ("blur", &[key("share", "", [0.0, 1.0], [0.25, 0.5, 1.0], 1.0)]),
    ("crosstalk", &[key("share", "", [0.0, 1.0], [0.006, 0.008, 0.01], 0.008)]),
    ("echo", &[key("ratio", "", [0.0, 1.0], [0.75, 0.85, 0.95], 0.85)]),
];

fn keys(kind: ConditionKind) -> &'static [ConditionKey] {
    KINDS[kind as usize].1
}

/// Reflectance of a vehicle that mirrors the beam away.
const DARK: f64 = 0.05;

/// Apparent range of a return at `range` metres that another sensor's pulse comes before: uniform from the sensor's `least`
/// on, by `u` from 0 to below 1. Pulses later than the own echo are not waited for.
pub(crate) fn false_range(least: f64, range: f64, u: f64) -> f64 {
    least + u * (range - least).max(0.0)
}

/// Vehicles whose paint mirrors the beam away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct IncompleteEcho {
    ratio: f64,
}

impl IncompleteEcho {
    /// Makes this share of the vehicles dark.
    pub(crate) fn new(ratio: f64) -> Self {
        Self { ratio }
    }

    /// Reflectance of a vehicle that has `reflectance` otherwise; `u_object` from 0 to below 1 is the vehicle's
    /// own and the same in all frames, so that more vehicles are dark at a greater ratio, never others. Vehicles that
    /// cannot be told apart have none, and all of them the mean.
    pub(crate) fn reflectance(&self, reflectance: f64, u_object: Option<f64>) -> f64 {
        let dark = reflectance.min(DARK);
        match u_object {
            Some(u) if u < self.ratio => dark,
            Some(_) => reflectance,
            None => self.ratio * dark + (1.0 - self.ratio) * reflectance,
        }
    }
}

/// Depth in millimetres from which water closes to a film.
const FULL_FILM: f64 = 1.2;

/// True if water stands on surfaces of a class: the ground that Robo3D wets. Soil drains, and bridges carry a road.
pub(crate) fn holds_water(class: &str) -> bool {
    matches!(Ground::of(class), Some(Ground::Road | Ground::Hard))
}

/// Water on the ground, so and so deep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct WetGround {
    /// Share of the ground that the film covers.
    film: f64,
}

impl WetGround {
    /// Water of a depth in millimetres; from 1.2 on all ground is covered.
    pub(crate) fn new(water: f64) -> Self {
        Self { film: (water / FULL_FILM).min(1.0) }
    }

    /// Reflectance ρ′ of wet ground at an angle of incidence; the echo's power stays ρ′·cos θ / r².
    ///
    /// (1 − f)·ρ + f·½(t_s + t_p), the film's share f, with light that is not polarized.
    pub(crate) fn reflectance(&self, reflectance: f64, cos: f64) -> f64 {
        if self.film == 0.0 {
            return reflectance;
        }
        let [s, p] = through_film(reflectance, cos);
        (1.0 - self.film) * reflectance + self.film * 0.5 * (s + p)
    }
}

/// Refractive indices of air and water in the near infrared, as the public wet ground takes them.
const AIR: f64 = 1.0003;
const WATER: f64 = 1.33;

/// Shares of light that water mirrors, by Fresnel's equations: polarized across the plane of incidence (s) and in
/// it (p). `cos` is the cosine of the angle of incidence in air. The rest passes; light that leaves the water along the
/// refracted angle has equal shares.
fn mirrored(cos: f64) -> [f64; 2] {
    let cos = cos.clamp(0.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt() * AIR / WATER;
    let below = (1.0 - sin * sin).sqrt();
    let s = (AIR * cos - WATER * below) / (AIR * cos + WATER * below);
    let p = (WATER * cos - AIR * below) / (WATER * cos + AIR * below);
    [s * s, p * p]
}

/// Share of the power that comes back out of a full film on ground of `reflectance`, for s and p: in through the
/// surface, scattered, out again, with all that goes to and fro below it.
fn through_film(reflectance: f64, cos: f64) -> [f64; 2] {
    mirrored(cos).map(|r| (1.0 - r) * reflectance * (1.0 - r) / (1.0 - reflectance * r))
}

#[cfg(test)]
mod tests;
