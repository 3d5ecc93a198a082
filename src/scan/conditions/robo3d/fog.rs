//! Fog as published (Hahner et al. 2021 with the constants of Robo3D).

use super::super::pulse::Peaks;
use super::cloud::{Draws, origins, points};
use crate::scan::chance::Purpose;
use crate::scan::{Scan, Status};

/// Extinctions in 1/m, one of which is drawn for each frame.
pub(super) const ALPHAS: [f64; 6] = [0.0, 0.005, 0.01, 0.02, 0.03, 0.06];
/// Backscatter of the target that the published soft return is relative to.
const TARGET: f64 = 1e-6 / std::f64::consts::PI;
/// Half width in metres of the noise that a fog point's range is divided by.
const NOISE: f64 = 10.0;

/// The published rule for one α and β.
pub(super) struct Rule {
    alpha: f64,
    beta: f64,
    peaks: Peaks,
}

impl Rule {
    pub fn new(alpha: f64, beta: f64) -> Self {
        Self { alpha, beta, peaks: Peaks::new(alpha) }
    }

    /// Intensities of the target and of the fog before it, in units of the target's in clear air.
    pub fn hard_and_soft(&self, range: f64) -> [f64; 2] {
        let hard = (-2.0 * self.alpha * range).exp();
        [hard, range * range * self.beta / TARGET * self.peaks.before(range).integral]
    }

    /// Range of the fog's peak on the grid of 0.1 m of the published tables.
    pub fn peak_range(&self, range: f64) -> f64 {
        (self.peaks.before(range).range * 10.0).round() / 10.0
    }
}

/// A point whose fog is brighter than itself moves to R*·r/U(r − 10, r + 10). The intensity cancels, so that the range
/// alone decides: every point beyond r_c becomes fog, whatever it is of, also at α = 0; both as published.
pub(super) fn apply(scan: &mut Scan, draws: &Draws, beta: f64, alpha: Option<f64>) {
    let drawn = draws.frame().draw(Purpose::Corruption, 0) * ALPHAS.len() as f64;
    let rule = Rule::new(alpha.unwrap_or(ALPHAS[drawn as usize]), beta);
    let (chances, origins) = (draws.returns(scan), origins(scan));
    for k in points(scan) {
        let beam = &mut scan.returns[k];
        let range = f64::from(beam.range);
        let [hard, soft] = rule.hard_and_soft(range);
        beam.intensity *= hard.max(soft) as f32;
        if soft > hard {
            let u = chances[k].draw(Purpose::Corruption, 0);
            let divisor = range - NOISE + 2.0 * NOISE * u;
            let fog = rule.peak_range(range) * range / divisor;
            beam.move_to(fog, origins[usize::from(beam.lidar)]);
            beam.detach(Status::Fog);
        }
    }
}
