//! Objectives of a front by name: price, number of sensors, requirements, scores.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::json::counted;
use crate::score::{Objective, ObjectiveError, Scores};

/// Fewest and most objectives of a front.
const COUNT: [usize; 2] = [2, 3];
/// Names beside the scores.
const PRICE: &str = "price";
const SENSORS: &str = "sensors";
const REQUIREMENTS: &str = "requirements";
/// A second name of [`REQUIREMENTS`].
const TARGETS: &str = "targets";

/// One objective of a front.
#[derive(Debug, Clone, PartialEq)]
pub enum FrontObjective {
    /// Price of all sensors, in the currency of the vehicle's prices; less is better.
    Price,
    /// Number of sensors; less is better.
    Sensors,
    /// Missing share of the requirements, summed over areas and targets; less is better.
    Requirements,
    /// A score, or a weighted sum of several; more is better.
    Score(Objective),
}

/// Why a text names no objectives of a front.
#[derive(Debug, thiserror::Error, PartialEq)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum FrontError {
    /// A number of objectives that no front has.
    #[error(
        "--front: has {}; name two or three of {PRICE}, {SENSORS}, {REQUIREMENTS} and the scores of \
         --objective, as in `price,near_gain`",
        counted(*.count, "objective")
    )]
    Count { count: usize },
    /// An objective that is named twice.
    #[error("--front: `{name}` is named twice; take one of them out")]
    Repeated { name: String },
    /// No objective of that name.
    #[error(
        "--front: `{name}` is no objective; there are {PRICE}, {SENSORS}, {REQUIREMENTS} (or {TARGETS}), and the scores \
         {scores}"
    )]
    Unknown { name: String, scores: String },
    /// A weighted sum that cannot be read.
    #[error("--front: {0}")]
    Score(ObjectiveError),
    /// Nothing to choose from.
    #[error(
        "--front: the LiDARs of the scene are of one model, with nothing to choose from; give a vehicle with sensors and \
         mounts with --vehicle (in Python load the scene with one)"
    )]
    NoVehicle,
    /// A price where no sensor has one.
    #[error(
        "--front: no sensor of `{vehicle}` has a {PRICE}; write `price` beside each in the vehicle file, or name \
         {SENSORS}, {REQUIREMENTS} or a score instead"
    )]
    NoPrices { vehicle: String },
    /// Requirements where there are none.
    #[error(
        "--front: `{vehicle}` requires nothing; write what it must see under `require` in the vehicle file, or name \
         {PRICE}, {SENSORS} or a score instead of {REQUIREMENTS}"
    )]
    NothingRequired { vehicle: String },
}

impl FrontObjective {
    /// True where less is better.
    pub(crate) fn is_cost(&self) -> bool {
        !matches!(self, Self::Score(_))
    }

    /// Value for a placement whose sensors have this price; `None` where its score does not exist.
    pub fn value(&self, scores: &Scores, sensors: usize, price: f64) -> Option<f64> {
        match self {
            Self::Price => Some(price),
            Self::Sensors => Some(sensors as f64),
            Self::Requirements => Some(scores.missing()),
            Self::Score(objective) => objective.value(scores),
        }
    }

    /// A value turned so that less is better.
    pub(super) fn turned(&self, value: f64) -> f64 {
        if self.is_cost() { value } else { -value }
    }
}

impl fmt::Display for FrontObjective {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Price => f.write_str(PRICE),
            Self::Sensors => f.write_str(SENSORS),
            Self::Requirements => f.write_str(REQUIREMENTS),
            Self::Score(objective) => objective.fmt(f),
        }
    }
}

impl FromStr for FrontObjective {
    type Err = FrontError;

    fn from_str(text: &str) -> Result<Self, FrontError> {
        match text.trim() {
            PRICE => Ok(Self::Price),
            SENSORS => Ok(Self::Sensors),
            REQUIREMENTS | TARGETS => Ok(Self::Requirements),
            score => score.parse().map(Self::Score).map_err(|error| match error {
                ObjectiveError::UnknownMetric { name, known, .. } => {
                    FrontError::Unknown { name, scores: known }
                }
                other => FrontError::Score(other),
            }),
        }
    }
}

/// Two or three objectives of a front, no one twice; written as `price,near_gain`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct FrontObjectives(Vec<FrontObjective>);

impl FrontObjectives {
    /// Objectives from their names.
    ///
    /// # Errors
    /// See [`FrontError`].
    pub fn named(names: impl IntoIterator<Item = impl AsRef<str>>) -> Result<Self, FrontError> {
        let all = names.into_iter().map(|name| name.as_ref().parse());
        let all = all.collect::<Result<Vec<FrontObjective>, _>>()?;
        if !(COUNT[0]..=COUNT[1]).contains(&all.len()) {
            return Err(FrontError::Count { count: all.len() });
        }
        match (1..all.len()).find(|&k| all[..k].contains(&all[k])) {
            Some(k) => Err(FrontError::Repeated { name: all[k].to_string() }),
            None => Ok(Self(all)),
        }
    }

    /// The objectives, in the order given.
    pub fn all(&self) -> &[FrontObjective] {
        &self.0
    }

    /// Names of the objectives, in the order given.
    pub fn names(&self) -> Vec<String> {
        self.0.iter().map(ToString::to_string).collect()
    }

    /// The scores among them.
    pub(super) fn scores(&self) -> impl Iterator<Item = &Objective> {
        self.0.iter().filter_map(|objective| match objective {
            FrontObjective::Score(score) => Some(score),
            _ => None,
        })
    }

    /// True if an objective is among them.
    pub(super) fn has(&self, objective: &FrontObjective) -> bool {
        self.0.contains(objective)
    }
}

impl FromStr for FrontObjectives {
    type Err = FrontError;

    fn from_str(text: &str) -> Result<Self, FrontError> {
        let names = text.split(',').map(str::trim);
        Self::named(names.filter(|name| !name.is_empty()))
    }
}

impl TryFrom<Vec<String>> for FrontObjectives {
    type Error = FrontError;

    fn try_from(names: Vec<String>) -> Result<Self, FrontError> {
        Self::named(names)
    }
}

impl From<FrontObjectives> for Vec<String> {
    fn from(objectives: FrontObjectives) -> Self {
        objectives.names()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(text: &str) -> String {
        text.parse::<FrontObjectives>().unwrap_err().to_string()
    }

    #[test]
    fn objectives_are_read_by_name_and_written_again() {
        let read: FrontObjectives = "price, 0.5*m_sog + near_gain,targets".parse().unwrap();
        assert_eq!(read.names(), ["price", "0.5*m_sog + near_gain", "requirements"]);
        assert_eq!(FrontObjectives::named(read.names()), Ok(read.clone()));
        let costs: Vec<bool> = read.all().iter().map(FrontObjective::is_cost).collect();
        assert_eq!(costs, [true, false, true]);
    }

    #[test]
    fn a_wrong_list_is_answered_with_the_mend() {
        for (text, words) in [
            ("", "has 0 objectives; name two or three of price, sensors, requirements"),
            ("price", "has 1 objective;"),
            ("price,sensors,requirements,near_gain", "has 4 objectives"),
            ("price,near_gain,price", "`price` is named twice"),
            ("targets,requirements", "`requirements` is named twice"),
            (
                "price,neargain",
                "`neargain` is no objective; there are price, sensors, requirements (or targets)",
            ),
            ("price,neargain", "near_gain, near_gain_2, near_gain_3, information_gain"),
            ("price,x*m_sog", "`x` is no weight"),
        ] {
            assert!(refusal(text).contains(words), "{text}: {}", refusal(text));
        }
    }
}
