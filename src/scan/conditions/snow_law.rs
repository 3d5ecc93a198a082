//! How many flakes fall, and how large they are: Gunn and Marshall 1958, as the public snow takes it.

use std::f64::consts::PI;

/// Density of snow relative to water.
const DENSITY: f64 = 0.1;

/// Flakes in the air: balls whose diameters are exponentially distributed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Balls {
    /// Mean diameter in metres.
    pub mean: f64,
    /// Share of the air's volume that they fill.
    pub volume: f64,
}

impl Balls {
    /// Of snow that falls at a rate in millimetres of water an hour and a speed in metres a second; none at
    /// rate 0, or so little that it is not a number.
    pub fn new(rate: f64, speed: f64) -> Option<Self> {
        let rain = (rate / (487.0 * DENSITY * 0.003 * speed)).powf(1.5);
        let mean = 10e-3 / (25.5 * rain.powf(-0.48));
        let volume = rate / (3.6e6 * DENSITY * speed);
        (volume > 0.0 && mean > 0.0).then_some(Self { mean, volume })
    }

    /// Share of the light that a metre of air takes off a beam: n·π/4·E[D²] with n = volume / (π/6·E[D³]), and
    /// E[Dᵏ] = k!·mean of the exponential distribution.
    pub fn extinction(&self) -> f64 {
        0.5 * self.volume / self.mean
    }

    /// Flakes in a cubic metre.
    pub fn per_cubic_metre(&self) -> f64 {
        self.volume / (PI * self.mean.powi(3))
    }

    /// Discs in a square metre of a plane by the published rule: as many as fill the share, their diameters
    /// distributed as the balls', cut at an even height.
    pub fn discs_per_square_metre(&self) -> f64 {
        self.volume / (PI * (2.0 / 3.0) * 2.0 * self.mean * self.mean / 4.0)
    }

    /// Mean radius of these discs in metres.
    #[cfg(test)]
    pub fn mean_disc_radius(&self) -> f64 {
        self.mean / 2.0 * PI / 4.0
    }
}
