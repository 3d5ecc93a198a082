//! Fog in the air, for each beam.

use super::pulse::{self, BLIND, LIGHT, Peaks, overlap};
use lidar_cast::maths;

/// −ln 0.05: contrast left at the meteorological optical range (Koschmieder).
const CONTRAST: f64 = 2.995_732_273_553_991;
/// Backscatter of fog whose optical range is 1 m, in 1/sr (Rasshofer et al. 2011).
const BACKSCATTER: f64 = 0.046;
/// Calibration of the gain, as in the fog simulation that Robo3D builds on: in fog of this extinction (1/m) a target
/// of this reflectance is as bright as the fog at this range (metres).
const GAIN_REFLECTANCE: f64 = 0.3;
const GAIN_EXTINCTION: f64 = 0.06;
const GAIN_RANGE: f64 = 36.0;
/// Steps of the table of where light comes back from.
const STEPS: usize = 1024;

/// Fog of one density.
///
/// A target keeps e^(−2αr) of its power. The fog itself sends back g·β·(c/2)·I(α, r), with I the peak of the
/// pulse over the air before the target, and β tied to α: both follow from the optical range.
#[derive(Debug, Clone, PartialEq)]
pub struct Fog {
    alpha: f64,
    /// g·β·c/2.
    scale: f64,
    peaks: Peaks,
    /// Light from 0.9 m up to 1/s, by s from 1/0.9 down to 0.
    envelope: Vec<f64>,
}

impl Fog {
    /// Fog of a meteorological optical range in metres, infinite in clear air. `gain` multiplies its calibrated
    /// backscatter.
    pub fn new(optical_range: f64, gain: f64) -> Self {
        let alpha = CONTRAST / optical_range;
        let backscatter = |alpha: f64| BACKSCATTER * alpha / CONTRAST;
        let hard = GAIN_REFLECTANCE / (GAIN_RANGE * GAIN_RANGE)
            * maths::exp(-2.0 * GAIN_EXTINCTION * GAIN_RANGE);
        let soft = backscatter(GAIN_EXTINCTION)
            * (LIGHT / 2.0)
            * pulse::peak(GAIN_EXTINCTION, GAIN_RANGE).integral;
        Self {
            alpha,
            scale: gain * hard / soft * backscatter(alpha) * (LIGHT / 2.0),
            peaks: Peaks::new(alpha),
            envelope: envelope(alpha),
        }
    }

    /// Share of a target's power that is left at a range in metres, there and back.
    pub fn attenuation(&self, range: f64) -> f64 {
        maths::exp(-2.0 * self.alpha * range)
    }

    /// Power that the fog before a target sends back, in the unit of ρ·cos θ / r²; the target's range in metres
    /// is infinite if there is none.
    pub fn soft_power(&self, target: f64) -> f64 {
        self.scale * self.peaks.before(target).integral
    }

    /// Where before a target the fog sends light back from, by `u` from 0 to below 1: distributed as
    /// e^(−2αx)·ξ(x)/x².
    pub fn soft_range(&self, target: f64, u: f64) -> f64 {
        if target <= BLIND {
            return target;
        }
        let light = u * interpolated(&self.envelope, place_of(target));
        let above = self.envelope.partition_point(|&sum| sum <= light).clamp(1, STEPS);
        let (a, b) = (self.envelope[above - 1], self.envelope[above]);
        let share = if b > a { (light - a) / (b - a) } else { 0.0 };
        let place = (above - 1) as f64 + share;
        (1.0 / ((1.0 - place / STEPS as f64) / BLIND)).min(target)
    }
}

/// Place in the table of a distance in metres.
fn place_of(range: f64) -> f64 {
    (1.0 - BLIND / range) * STEPS as f64
}

fn interpolated(table: &[f64], place: f64) -> f64 {
    let below = (place as usize).min(table.len() - 2);
    table[below] + (place - below as f64) * (table[below + 1] - table[below])
}

/// ∫ e^(−2αx)·ξ(x)/x² dx from 0.9 m on; with s = 1/x the integrand is all but even.
fn envelope(alpha: f64) -> Vec<f64> {
    let mut sums = vec![0.0];
    let mut sum = 0.0;
    for step in 0..STEPS {
        let x = BLIND / (1.0 - (step as f64 + 0.5) / STEPS as f64);
        sum += maths::exp(-2.0 * alpha * x) * overlap(x);
        sums.push(sum);
    }
    sums
}
