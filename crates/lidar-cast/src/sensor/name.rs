//! Names of sensor models, as small as a number, and the name that was probably meant.

use std::fmt;
use std::sync::{PoisonError, RwLock};

use serde::{Deserialize, Deserializer, Serialize, Serializer, de};

/// Longest name, in bytes.
const MAX_NAME: usize = 64;
/// Most different names in a program: far more than any vehicle has sensors.
const MAX_NAMES: usize = 4096;

/// All names so far; a name's number is its position from 1 on.
static NAMES: RwLock<Vec<&'static str>> = RwLock::new(Vec::new());

/// Name of a sensor model of a vehicle; none means the vehicle's first.
///
/// Names are kept for as long as the program runs, each once, so that poses are plain numbers to copy.
#[derive(Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SensorName(u16);

impl SensorName {
    /// No name.
    pub const NONE: Self = Self(0);

    /// The name of a model.
    ///
    /// # Errors
    /// Fault with the name, in words: empty, longer than 64 bytes, or control characters in it; or
    /// there are more than 4096 different names.
    pub fn new(name: &str) -> Result<Self, String> {
        if name.is_empty() || name.len() > MAX_NAME || name.chars().any(char::is_control) {
            return Err(format!(
                "{name:?} is no name of a sensor; give 1 to {MAX_NAME} printable characters"
            ));
        }
        let mut names = NAMES.write().unwrap_or_else(PoisonError::into_inner);
        let at = match names.iter().position(|known| *known == name) {
            Some(at) => at,
            None if names.len() == MAX_NAMES => {
                return Err(format!("there are more than {MAX_NAMES} different names of sensors"));
            }
            None => {
                names.push(Box::leak(name.into()));
                names.len() - 1
            }
        };
        Ok(Self(at as u16 + 1))
    }

    /// True if no model is named.
    pub fn is_none(&self) -> bool {
        self.0 == 0
    }

    /// The name; empty where none is given.
    pub fn as_str(&self) -> &'static str {
        let names = NAMES.read().unwrap_or_else(PoisonError::into_inner);
        usize::from(self.0).checked_sub(1).and_then(|at| names.get(at)).copied().unwrap_or("")
    }
}

impl fmt::Display for SensorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl fmt::Debug for SensorName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

impl Serialize for SensorName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for SensorName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::new(&name).map_err(de::Error::custom)
    }
}

/// Names longer than this have no similar name: comparing takes time with both lengths.
const LONGEST_NAME: usize = 256;
/// Smallest Jaro–Winkler similarity of a slip and the name that was meant.
const LEAST_SIMILARITY: f64 = 0.7;

/// Most similar name of `known`, if `name` may be a slip for it.
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    if name.len() > LONGEST_NAME {
        return None;
    }
    let lower = name.to_lowercase();
    known
        .into_iter()
        .filter(|known| known.len() <= LONGEST_NAME)
        .map(|k| (strsim::jaro_winkler(&lower, &k.to_lowercase()), k))
        .filter(|(likeness, _)| *likeness > LEAST_SIMILARITY)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_are_the_same_number() {
        let name = SensorName::new("VLP-16 of a test").unwrap();
        assert_eq!(SensorName::new("VLP-16 of a test"), Ok(name));
        assert_ne!(SensorName::new("VLS-128 of a test"), Ok(name));
        let json = serde_json::to_string(&name).unwrap();
        assert_eq!(json, "\"VLP-16 of a test\"");
        assert_eq!(serde_json::from_str::<SensorName>(&json).unwrap(), name);
        assert!(SensorName::default().is_none() && SensorName::default().as_str().is_empty());
        for bad in ["", "two\nlines", &"x".repeat(65)] {
            assert!(SensorName::new(bad).is_err(), "{bad:?}");
        }
    }
}
