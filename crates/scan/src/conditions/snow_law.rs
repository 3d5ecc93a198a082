//! How many flakes or drops fall, and how large they are.

use std::f64::consts::PI;

use lidar_cast::maths;

/// Density of snow relative to water.
const DENSITY: f64 = 0.1;

/// Drops of Marshall and Palmer in a cubic metre and a metre of diameter, and the slope of their number at
/// 1 mm/h, in 1/m.
const DROPS: f64 = 8e6;
const SLOPE: f64 = 4100.0;

/// Flakes or drops in the air: balls whose diameters are exponentially distributed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Balls {
    /// Mean diameter in metres.
    pub mean: f64,
    /// Share of the air's volume that they fill.
    pub volume: f64,
}

impl Balls {
    /// Flakes of Gunn and Marshall 1958, at a rate in millimetres of water an hour and a speed in metres a second; none
    /// at rate 0, or so few that they are not a number.
    pub fn flakes(rate: f64, speed: f64) -> Option<Self> {
        let rain = maths::pow(rate / (487.0 * DENSITY * 0.003 * speed), 1.5);
        let mean = 10e-3 / (25.5 * maths::pow(rain, -0.48));
        let volume = rate / (3.6e6 * DENSITY * speed);
        Self::some(mean, volume)
    }

    /// Drops of Marshall and Palmer 1948 at a rate in millimetres an hour: N(D) = N₀·e^(−ΛD), N₀ = 8000 m⁻³ mm⁻¹,
    /// Λ = 4.1·R^(−0.21) mm⁻¹.
    ///
    /// A ball stands for the cross-section that its drop takes out of the light: twice the drop's (Q = 2, van de
    /// Hulst 1957), so that its diameter is √2 of the drop's.
    pub fn drops(rate: f64) -> Option<Self> {
        let slope = SLOPE * maths::pow(rate, -0.21);
        let mean = std::f64::consts::SQRT_2 / slope;
        Self::some(mean, DROPS / slope * PI * mean.powi(3))
    }

    fn some(mean: f64, volume: f64) -> Option<Self> {
        (volume > 0.0 && mean > 0.0).then_some(Self { mean, volume })
    }

    /// Share of the light that a metre of air takes off a beam: n·π/4·E[D²] with n = volume / (π/6·E[D³]), and
    /// E[Dᵏ] = k!·mean of the exponential distribution.
    pub fn extinction(&self) -> f64 {
        0.5 * self.volume / self.mean
    }

    /// Balls in a cubic metre.
    pub fn per_cubic_metre(&self) -> f64 {
        self.volume / (PI * self.mean.powi(3))
    }
}
