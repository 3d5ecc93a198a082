//! Limits of a choice of equipment: money and number of sensors.

use serde::{Deserialize, Serialize};

use crate::vehicle::MAX_LIDARS;

/// Most that the sensors of a vehicle may cost, and how many there may be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Limits {
    /// In the currency of the prices; infinite for no limit.
    #[serde(with = "finite_or_null")]
    pub budget: f64,
    /// At most this many sensors.
    pub sensors: usize,
}

impl Limits {
    /// A budget, and as many sensors as a placement may have.
    pub fn budget(budget: f64) -> Self {
        Self { budget, sensors: MAX_LIDARS }
    }
}

/// An infinite number as null, which JSON has no word for.
mod finite_or_null {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(value: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        Some(*value).filter(|value| value.is_finite()).serialize(serializer)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
    }
}
