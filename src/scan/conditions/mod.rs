//! Weather and faults in scans: exact for each beam, or the way of the public benchmark Robo3D.

mod condition;
mod error;
mod faults;
mod fog;
mod fresnel;
mod overlap;
mod pulse;
mod robo3d;
mod snow;
mod snow_law;
mod snow_tables;
mod specs;
#[cfg(test)]
mod tests;
mod wet;

pub use condition::Condition;
pub use error::ConditionError;
pub(crate) use faults::{Crosstalk, IncompleteEcho, MotionBlur};
pub(crate) use fog::Fog;
pub(crate) use overlap::Joined;
pub use robo3d::Corruptions;
pub(crate) use snow::{Fallen, Flake, Snowfall};
pub use specs::{Kind, Mode};
pub(crate) use wet::{WetGround, is_ground};

/// What a beam meets on its way besides surfaces, and what the sensor makes of it; nothing by default.
#[derive(Debug, Clone, Default)]
pub struct Weather {
    /// Fog in the air.
    pub fog: Option<Fog>,
    /// Water on the ground.
    pub wet: Option<WetGround>,
    /// Snow in the air.
    pub snow: Option<Snowfall>,
    /// The sensor's motion left in the points.
    pub blur: Option<MotionBlur>,
    /// Pulses of other sensors.
    pub crosstalk: Option<Crosstalk>,
    /// Vehicles that mirror beams away.
    pub echo: Option<IncompleteEcho>,
}

/// Conditions as they are written, one after the other.
pub fn in_words(conditions: &[Condition]) -> Vec<String> {
    conditions.iter().map(Condition::to_string).collect()
}

/// Conditions in words, behind those for what was computed under them; nothing in clear air.
pub fn under(conditions: &[String]) -> String {
    match conditions {
        [] => String::new(),
        all => format!(", under {}", all.join(" and ")),
    }
}

/// Parts conditions into those that act on beams and those that change the finished scan, in the order given.
///
/// # Errors
/// The same condition twice in one mode.
pub fn sort(conditions: &[Condition]) -> Result<(Weather, Corruptions), ConditionError> {
    let mut weather = Weather::default();
    let mut corruptions = Corruptions::default();
    for (place, condition) in conditions.iter().enumerate() {
        let (kind, mode) = (condition.kind(), condition.mode());
        if conditions[..place].iter().any(|other| (other.kind(), other.mode()) == (kind, mode)) {
            return Err(ConditionError::Repeated { condition: kind.name(), mode: mode.name() });
        }
        let value = |key: &str| condition.value(key).unwrap_or(0.0);
        match (mode, kind) {
            (Mode::Robo3d, _) => corruptions.push(condition),
            (_, Kind::Fog) => weather.fog = Some(Fog::new(value("mor"), value("gain"))),
            (_, Kind::Wet) => weather.wet = Some(WetGround::new(value("water"))),
            (_, Kind::Snow) => weather.snow = Some(Snowfall::new(value("rate"), value("speed"))),
            (_, Kind::Blur) => weather.blur = Some(MotionBlur::new(value("share"))),
            (_, Kind::Crosstalk) => weather.crosstalk = Some(Crosstalk::new(value("share"))),
            (_, Kind::Echo) => weather.echo = Some(IncompleteEcho::new(value("ratio"))),
        }
    }
    Ok((weather, corruptions))
}
