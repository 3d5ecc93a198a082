//! How a sensor model measures: what comes back of a pulse, how far off its distance is, how wide its beam.

use serde::Serialize;

use super::description::ResponseDescription;
use super::lidar_reading::other;
use super::sensor_file::Measures;
use crate::Note;
use crate::json::check::{self, bad};
use crate::json::{DescriptionError, Place};

/// Reflectance of the target that ranges are rated for.
const RATED_REFLECTANCE: f64 = 0.1;

/// Which of the echoes of one pulse a sensor reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Echoes {
    /// The one of most power.
    Strongest,
    /// The farthest that is strong enough.
    Last,
    /// Both. Where the strongest is also the farthest, the second strongest comes with it.
    Dual,
}

/// What a sensor makes of what its beams meet.
///
/// Power is P = ρ·cos θ / r², with reflectance ρ, angle of incidence θ and distance r; a pulse is seen from
/// `P_min` = 0.1 / `rated_range`² on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Response {
    /// Turns, or whole patterns, a second.
    pub rate: f64,
    /// Metres at which a target that reflects 10 % and faces the sensor is seen half of the time.
    pub rated_range: f64,
    /// Standard deviation of the threshold, as a share of it.
    pub softness: f64,
    /// Standard deviation of the range of strong returns, in metres; three times as much at the threshold.
    pub noise: f64,
    /// Full width of the beam across and along its channel's axis (horizontal, vertical), in radians.
    pub divergence: [f64; 2],
    /// Echoes closer together than this many metres merge.
    pub pulse: f64,
    /// Which echoes are reported.
    pub echoes: Echoes,
    /// Nothing is seen closer than this, in metres.
    pub min_range: f64,
}

impl Response {
    /// A response that is usual for spinning sensors, of one whose beams go `range` metres: rated for 0.6 of
    /// them, 2 cm of noise, 3 × 1.5 mrad, ten turns a second.
    pub fn usual(range: f64) -> Self {
        Self {
            rate: 10.0,
            rated_range: 0.6 * range,
            softness: 0.1,
            noise: 0.02,
            divergence: [3.0e-3, 1.5e-3],
            pulse: 0.4,
            echoes: Echoes::Strongest,
            min_range: 0.0,
        }
    }

    /// Least power that is seen, in the unit of ρ·cos θ / r².
    pub fn threshold(&self) -> f64 {
        RATED_REFLECTANCE / (self.rated_range * self.rated_range)
    }

    /// The usual response, with the numbers that a sensor file states in place of the usual ones.
    pub(crate) fn stated(range: f64, measures: &Measures) -> Self {
        let usual = Self::usual(range);
        Self {
            rate: measures.rate.unwrap_or(usual.rate),
            rated_range: measures.rated_range.unwrap_or(usual.rated_range),
            noise: measures.noise.unwrap_or(usual.noise),
            // A range cut short by a scene leaves the sensor nothing nearer.
            min_range: measures.min_range.unwrap_or(usual.min_range).min(range),
            ..usual
        }
    }

    /// Reads the `response` of a sensor model whose beams go `range` metres. Its numbers count, those of the sensor
    /// file where it has none; numbers of both that differ are notes.
    pub(super) fn new(
        at: &Place,
        written: Option<&ResponseDescription>,
        range: f64,
        measures: &Measures,
        notes: &mut Vec<Note>,
    ) -> Result<Self, DescriptionError> {
        let usual = Self::stated(range, measures);
        let Some(written) = written else { return Ok(usual) };
        let both = [
            ("rate", written.rate, measures.rate),
            ("rated_range", written.rated_range, measures.rated_range),
            ("noise", written.noise, measures.noise),
            ("min_range", written.min_range, measures.min_range),
        ];
        notes.extend(
            both.into_iter().filter_map(|(key, given, stated)| other(at, key, given?, stated)),
        );
        let between = |key: &str, value: Option<f64>, usual: f64, low: f64, high: f64| {
            let value = value.unwrap_or(usual);
            if (low..=high).contains(&value) {
                return Ok(value);
            }
            Err(bad(&at.key(key), value, format!("a number from {low} to {high}")))
        };
        let widths = written.divergence.unwrap_or(usual.divergence);
        let width = |k: usize| {
            let at = at.key("divergence").item(k);
            if (0.0..=0.1).contains(&widths[k]) {
                return Ok(widths[k]);
            }
            Err(bad(&at, widths[k], "a width in radians from 0 to 0.1; 3 mrad is 0.003"))
        };
        let echoes = match written.echoes.as_deref() {
            None => usual.echoes,
            Some("strongest") => Echoes::Strongest,
            Some("last") => Echoes::Last,
            Some("dual") => Echoes::Dual,
            Some(other) => {
                let wanted = "\"strongest\", \"last\" or \"dual\"";
                return Err(bad(&at.key("echoes"), format!("{other:?}"), wanted));
            }
        };
        Ok(Self {
            rate: check::rate(&at.key("rate"), written.rate.unwrap_or(usual.rate))?,
            rated_range: between("rated_range", written.rated_range, usual.rated_range, 0.1, 1e5)?,
            softness: between("softness", written.softness, usual.softness, 0.0, 1.0)?,
            noise: between("noise", written.noise, usual.noise, 0.0, 10.0)?,
            divergence: [width(0)?, width(1)?],
            pulse: between("pulse", written.pulse, usual.pulse, 0.0, 100.0)?,
            echoes,
            min_range: between("min_range", written.min_range, usual.min_range, 0.0, range)?,
        })
    }
}
