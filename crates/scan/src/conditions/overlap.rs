//! Echoes of two targets that come back within a pulse's length of each other, and so add up.

use lidar_cast::maths;
use std::f64::consts::TAU;

use super::Flake;
use super::pulse::LIGHT;

/// cτ of the snow, τ = 10 ns: the length of a pulse's echo in metres.
pub(super) const LENGTH: f64 = LIGHT * 10e-9;
/// Metres between peak and target from which on an echo belongs to the snow before it.
pub(super) const APART: f64 = 0.2;

/// The echo of a unit pulse by its phase, from 0 where it begins to 1 where it ends.
#[cfg(test)]
pub(super) fn swell(phase: f64) -> f64 {
    if phase > 0.0 && phase < 1.0 { (std::f64::consts::PI * phase).sin().powi(2) } else { 0.0 }
}

/// Sum of a flake's echo and a target's echo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Joined {
    /// Two echoes with peaks of their own.
    Apart,
    /// One from the target, of this power.
    Target(f64),
    /// One from the snow.
    Flake(Flake),
}

impl Flake {
    /// Adds the flake's echo and a target's echo.
    ///
    /// P₁·sin²(πx/L) + P₂·sin²(π(x − δ)/L) has one peak where |δ| < L/2, in the part where both are on: with φ = 2πδ/L
    /// that is ½(P₁ + P₂ + |P₁ + P₂·e^(−iφ)|), at L·ψ/2π behind the first's, tan ψ = P₂·sin φ/(P₁ + P₂·cos φ). Where
    /// they are farther apart, each peaks while the other is off. A peak that misses the target by less than 0.2 m is the
    /// target's, as in the published rule.
    pub fn join(&self, target: f64, power: f64) -> Joined {
        let apart = target - self.range;
        if apart.abs() >= LENGTH / 2.0 {
            return Joined::Apart;
        }
        let (sin, cos) = maths::sin_cos(TAU * apart / LENGTH);
        let (along, across) = (self.power + power * cos, power * sin);
        let peak = 0.5 * (self.power + power + maths::hypot(along, across));
        let range = self.range + LENGTH / TAU * maths::atan2(across, along);
        if (range - target).abs() < APART {
            Joined::Target(peak)
        } else {
            Joined::Flake(Flake { range, power: peak })
        }
    }
}
