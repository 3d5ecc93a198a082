//! A condition as the user writes it: `fog:mor=50`, `snow:level=heavy`.

use std::fmt;
use std::str::FromStr;

use serde::{Serialize, Serializer};

use super::error::ConditionError;
use super::specs::{Key, Kind, LEVELS, keys};

/// Most keys of a condition.
const MOST_KEYS: usize = 2;

/// One condition: `NAME[:KEY=VALUE[,KEY=VALUE…]]`.
///
/// `level` is `light`, `moderate` or `heavy` and sets all keys. Other keys are numbers and overrule the level,
/// wherever they stand. A condition is written out with all its numbers and no level.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Condition {
    kind: Kind,
    /// Values in the order of the kind's keys.
    values: [f64; MOST_KEYS],
}

impl Condition {
    /// Fault, in words.
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Value of a key; none of a key that it does not have.
    pub fn value(&self, key: &str) -> Option<f64> {
        let place = keys(self.kind).iter().position(|known| known.name == key)?;
        Some(self.values[place])
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
fn level_of(word: &str, kind: Kind) -> Result<usize, ConditionError> {
    let level = LEVELS.iter().position(|level| *level == word);
    level.ok_or_else(|| ConditionError::UnknownLevel {
        value: word.to_owned(),
        condition: kind.name(),
        known: LEVELS.join(", "),
    })
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
                known: in_words(kind),
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

fn unknown_key(key: &str, kind: Kind) -> ConditionError {
    let hint = match key {
        "mode" => {
            "; for the corruptions of Robo3D run its own program on a set of `--layout semantickitti` \
             (docs/scans.md)"
        }
        _ => "",
    };
    let (key, condition, known) = (key.to_owned(), kind.name(), in_words(kind));
    ConditionError::UnknownKey { key, condition, known, hint }
}

/// Keys in words: `level, mor, gain`.
fn in_words(kind: Kind) -> String {
    let own = keys(kind).iter().map(|key| key.name);
    std::iter::once("level").chain(own).collect::<Vec<_>>().join(", ")
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let numbers = keys(self.kind).iter().zip(self.values);
        let pairs: Vec<String> =
            numbers.map(|(key, value)| format!("{}={value}", key.name)).collect();
        write!(f, "{}:{}", self.kind.name(), pairs.join(","))
    }
}

impl Serialize for Condition {
    /// A string as on the command line, such as `fog:mor=50`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
