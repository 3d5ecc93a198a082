//! A condition as the user writes it: `fog:mor=50`, `snow:mode=robo3d,level=heavy`.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use super::error::ConditionError;
use super::specs::{Key, Kind, LEVELS, Mode, keys};

/// Most keys of a condition.
const MOST_KEYS: usize = 2;

/// One condition: `NAME[:KEY=VALUE[,KEY=VALUE…]]`.
///
/// `mode` is `physical` (taken if none is given) or `robo3d`, `level` is `light`, `moderate` or `heavy`; other
/// keys are numbers and count more than the level, wherever they stand. Written out, a condition gives all its
/// numbers and no level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    kind: Kind,
    mode: Mode,
    /// In the order of its keys; none is left to chance.
    values: [Option<f64>; MOST_KEYS],
}

impl Condition {
    /// What is wrong.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// How it is computed.
    pub fn mode(&self) -> Mode {
        self.mode
    }

    /// Value of a key; none of a key that it does not have or that is left to chance.
    pub fn value(&self, key: &str) -> Option<f64> {
        let place = keys(self.kind, self.mode).iter().position(|known| known.name == key)?;
        self.values[place]
    }
}

impl FromStr for Condition {
    type Err = ConditionError;

    fn from_str(text: &str) -> Result<Self, ConditionError> {
        let (name, rest) = text.split_once(':').unwrap_or((text, ""));
        let kind = Kind::ALL.into_iter().find(|kind| kind.name() == name);
        let kind =
            kind.ok_or_else(|| ConditionError::UnknownCondition { name: name.to_owned() })?;
        let pairs = pairs(text, rest, kind)?;
        let word = |key: &'static str, known: &[&str]| {
            let Some((_, value)) = pairs.iter().find(|(k, _)| *k == key) else { return Ok(None) };
            let found = known.iter().position(|word| word == value);
            found.map(Some).ok_or_else(|| ConditionError::UnknownWord {
                key,
                value: (*value).to_owned(),
                condition: kind.name(),
                known: known.join(", "),
            })
        };
        let mode =
            word("mode", &Mode::ALL.map(Mode::name))?.map_or(Mode::Physical, |k| Mode::ALL[k]);
        let level = word("level", &LEVELS)?;
        let mut values = [None; MOST_KEYS];
        for (value, key) in values.iter_mut().zip(keys(kind, mode)) {
            *value = match (level, key.levels) {
                (Some(level), Some(levels)) => Some(levels[level]),
                _ => key.usual,
            };
        }
        for (name, text) in pairs.iter().filter(|(key, _)| !["mode", "level"].contains(key)) {
            let place = keys(kind, mode).iter().position(|key| key.name == *name);
            let place = place.ok_or_else(|| unknown_key(name, kind, mode))?;
            values[place] = Some(number(&keys(kind, mode)[place], kind, text)?);
        }
        Ok(Self { kind, mode, values })
    }
}

/// Pairs of keys and values, each key once.
fn pairs<'t>(
    text: &str,
    rest: &'t str,
    kind: Kind,
) -> Result<Vec<(&'t str, &'t str)>, ConditionError> {
    let mut pairs: Vec<(&str, &str)> = Vec::new();
    for part in rest.split(',').filter(|_| text.contains(':')) {
        let Some(pair) = part.split_once('=') else {
            return Err(ConditionError::NoPair {
                part: part.to_owned(),
                text: text.to_owned(),
                condition: kind.name(),
                known: in_words(kind, Mode::Physical),
            });
        };
        if pairs.iter().any(|(key, _)| *key == pair.0) {
            let (key, text) = (pair.0.to_owned(), text.to_owned());
            return Err(ConditionError::RepeatedKey { key, text });
        }
        pairs.push(pair);
    }
    Ok(pairs)
}

fn number(key: &Key, kind: Kind, text: &str) -> Result<f64, ConditionError> {
    let [least, most] = key.limits;
    let value = text.parse().ok().filter(|value| (least..=most).contains(value));
    value.ok_or_else(|| ConditionError::BadNumber {
        key: key.name,
        value: text.to_owned(),
        condition: kind.name(),
        least: least.to_string(),
        most: most.to_string(),
        unit: key.unit,
    })
}

fn unknown_key(key: &str, kind: Kind, mode: Mode) -> ConditionError {
    let other = mode.other();
    let there = keys(kind, other).iter().any(|known| known.name == key);
    ConditionError::UnknownKey {
        key: key.to_owned(),
        condition: kind.name(),
        mode: mode.name(),
        known: in_words(kind, mode),
        hint: match there {
            true => format!("; `mode={}` has `{key}`", other.name()),
            false => String::new(),
        },
    }
}

/// Keys in words: `mode, level, mor, gain`.
fn in_words(kind: Kind, mode: Mode) -> String {
    let own = keys(kind, mode).iter().map(|key| key.name);
    ["mode", "level"].into_iter().chain(own).collect::<Vec<_>>().join(", ")
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mode = (self.mode != Mode::Physical).then(|| format!("mode={}", self.mode.name()));
        let keys = keys(self.kind, self.mode).iter().zip(self.values);
        let numbers = keys.filter_map(|(key, value)| Some(format!("{}={}", key.name, value?)));
        let pairs: Vec<String> = mode.into_iter().chain(numbers).collect();
        write!(f, "{}:{}", self.kind.name(), pairs.join(","))
    }
}

impl Serialize for Condition {
    /// As it is written.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
