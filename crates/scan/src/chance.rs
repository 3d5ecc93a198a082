//! Random numbers that depend only on their purpose and beam, not on the order of the draws.

use lidar_cast::maths;
use lidar_cast::maths::mixed;

/// Use of a random number; draws for different purposes are independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Purpose {
    /// Detection of an echo near the threshold.
    Detection,
    /// Error of a range.
    RangeNoise,
    /// Where in the fog the light comes back.
    FogRange,
    /// Flakes in a beam.
    Snow,
    /// Another sensor's pulse that a beam takes for its own, and the time of that pulse.
    Crosstalk,
    /// Paint of an object: dark or bright.
    Object,
    /// Drops in a beam.
    Rain,
}

/// A source of numbers for one beam of a frame.
#[derive(Debug, Clone, Copy)]
pub struct Chance {
    state: u64,
}

impl Chance {
    /// Random numbers of one beam of a LiDAR in a frame.
    pub fn new(seed: u64, frame: u32, lidar: u32, beam: u32) -> Self {
        let state = mixed(seed ^ 0x5ca9_0000_0000_0000);
        let state = mixed(state ^ (u64::from(frame) << 32 | u64::from(lidar)));
        Self { state: mixed(state ^ u64::from(beam)) }
    }

    /// The `k`-th number of a purpose, evenly from 0 to below 1.
    pub fn draw(&self, purpose: Purpose, k: u32) -> f64 {
        let word = mixed(self.state ^ (u64::from(purpose as u32) << 32 | u64::from(k)));
        (word >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The numbers of a purpose, one after the other.
    pub fn draws(&self, purpose: Purpose) -> impl FnMut() -> f64 {
        let (chance, mut next) = (*self, 0);
        move || {
            next += 1;
            chance.draw(purpose, next - 1)
        }
    }

    /// The `k`-th number of a purpose from the standard normal distribution (Box and Muller 1958).
    pub fn normal(&self, purpose: Purpose, k: u32) -> f64 {
        // 1 − u is never 0.
        let radius = (-2.0 * maths::ln(1.0 - self.draw(purpose, 2 * k))).sqrt();
        radius * maths::cos(std::f64::consts::TAU * self.draw(purpose, 2 * k + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spread_and_differ_by_all_that_they_are_for() {
        let draws = |chance: Chance, purpose| -> Vec<f64> {
            (0..4000).map(|k| chance.draw(purpose, k)).collect()
        };
        let first = draws(Chance::new(1, 2, 3, 4), Purpose::Snow);
        // A uniform variable has mean 1/2 and variance 1/12: four standard errors of 4000 draws.
        let mean = first.iter().sum::<f64>() / 4000.0;
        let variance = first.iter().map(|u| (u - mean).powi(2)).sum::<f64>() / 4000.0;
        assert!((mean - 0.5).abs() < 0.019 && (variance - 1.0 / 12.0).abs() < 0.005);
        let others = [[2, 2, 3, 4], [1, 3, 3, 4], [1, 2, 4, 4], [1, 2, 3, 5]]
            .map(|[seed, frame, lidar, beam]| Chance::new(seed.into(), frame, lidar, beam))
            .map(|chance| draws(chance, Purpose::Snow));
        for other in others.iter().chain([&draws(Chance::new(1, 2, 3, 4), Purpose::Object)]) {
            let product = |(a, b): (&f64, &f64)| (a - 0.5) * (b - 0.5);
            let covariance = first.iter().zip(other).map(product).sum::<f64>() / 4000.0;
            // The product's deviation is 1/12.
            assert!(covariance.abs() < 4.0 / 12.0 / 4000_f64.sqrt(), "{covariance}");
        }
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let chance = Chance::new(7, 0, 0, 0);
        let draws: Vec<f64> = (0..4000).map(|k| chance.normal(Purpose::RangeNoise, k)).collect();
        let mean = draws.iter().sum::<f64>() / 4000.0;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / 4000.0;
        assert!(mean.abs() < 0.064 && (variance - 1.0).abs() < 0.09, "{mean} {variance}");
    }
}
