//! Corruptions of a finished scan, the way of Robo3D: by the public rules and constants, so that results compare.

mod cloud;
mod echo;
mod fit;
mod fog;
mod points;
mod snow;
#[cfg(test)]
mod tests;
mod wedge;
mod wet;

use super::condition::Condition;
use super::specs::Kind;
use crate::scan::Scan;
use cloud::Draws;

/// One corruption with its numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Corruption {
    /// β in 1/m, and α unless it is drawn for each frame.
    Fog { beta: f64, alpha: Option<f64> },
    /// Depth in millimetres, noise floor.
    Wet { water: f64, floor: f64 },
    /// Millimetres an hour, metres a second.
    Snow { rate: f64, speed: f64 },
    /// Standard deviation in metres.
    Blur { sigma: f64 },
    /// Share of the points.
    Crosstalk { share: f64 },
    /// Share of a class's points.
    Echo { ratio: f64 },
}

/// Corruptions in the order in which they are applied.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Corruptions(Vec<Corruption>);

impl Corruptions {
    /// Adds one behind the others.
    pub(super) fn push(&mut self, condition: &Condition) {
        let value = |key: &str| condition.value(key).unwrap_or(0.0);
        self.0.push(match condition.kind() {
            Kind::Fog => Corruption::Fog { beta: value("beta"), alpha: condition.value("alpha") },
            Kind::Wet => Corruption::Wet { water: value("water"), floor: value("floor") },
            Kind::Snow => Corruption::Snow { rate: value("rate"), speed: value("speed") },
            Kind::Blur => Corruption::Blur { sigma: value("sigma") },
            Kind::Crosstalk => Corruption::Crosstalk { share: value("share") },
            Kind::Echo => Corruption::Echo { ratio: value("ratio") },
        });
    }

    /// Applies them to the points of a scan, one after the other.
    ///
    /// What is left to chance depends on seed, frame, LiDAR, beam and corruption alone. Points of fog, snow and
    /// crosstalk lose class and instance, as the public labels have them ignored; `clean_class` stays. Fog moves
    /// points towards their LiDAR as it stood at the scan's time. Intensities are not cut at 1, nor kept above 0,
    /// where the public code does not.
    pub fn apply(&self, scan: &mut Scan, seed: u64) {
        for corruption in &self.0 {
            let draws = |kind: Kind| Draws::new(seed, scan.frame, kind);
            match *corruption {
                Corruption::Fog { beta, alpha } => fog::apply(scan, &draws(Kind::Fog), beta, alpha),
                Corruption::Wet { water, floor } => wet::apply(scan, water, floor),
                Corruption::Snow { rate, speed } => {
                    snow::apply(scan, &draws(Kind::Snow), rate, speed);
                }
                Corruption::Blur { sigma } => points::blur(scan, &draws(Kind::Blur), sigma),
                Corruption::Crosstalk { share } => {
                    points::crosstalk(scan, &draws(Kind::Crosstalk), share);
                }
                Corruption::Echo { ratio } => echo::apply(scan, &draws(Kind::Echo), ratio),
            }
        }
    }
}
