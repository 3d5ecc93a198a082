//! Measurement model of a sensor: echo power and threshold, range error, beam width.

use serde::Serialize;

/// Reflectance of the target that ranges are rated for.
const RATED_REFLECTANCE: f64 = 0.1;

/// Echoes of one pulse that a sensor reports.
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

/// Response of a sensor to the surfaces that its beams meet.
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
    /// Echoes that are reported.
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
}
