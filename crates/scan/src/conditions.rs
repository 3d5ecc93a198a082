//! Weather and faults in scans, computed for each beam.

mod condition;
mod fog;
mod snow;

use crate::fires::Purpose;
use crate::{ScanError, Status};

pub use condition::{Condition, ConditionKind};
pub(crate) use condition::{IncompleteEcho, WetGround, false_range, holds_water};
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
            return Err(ScanError::Repeated { condition: kind.name() });
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

#[cfg(test)]
mod tests;
