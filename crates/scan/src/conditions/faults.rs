//! Faults of the sensor and of targets: motion left in, pulses of other sensors, dark vehicles.

/// Reflectance of a vehicle that mirrors the beam away.
const DARK: f64 = 0.05;

/// Motion during a turn that is left in the cloud.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionBlur {
    share: f64,
}

impl MotionBlur {
    /// Leaves a share of the true motion: 0 the points where they were, 1 the raw points.
    pub fn new(share: f64) -> Self {
        Self { share }
    }

    /// The share that is left.
    pub fn share(&self) -> f64 {
        self.share
    }
}

/// Pulses of other sensors that come before the beam's own echo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Crosstalk {
    share: f64,
}

impl Crosstalk {
    /// Hits a share of the returns.
    pub fn new(share: f64) -> Self {
        Self { share }
    }

    /// Share of the returns that are hit.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Apparent range of a return at `range` metres: uniform from the sensor's `least` on, by `u` from 0 to below 1.
    /// Pulses later than the own echo are not waited for.
    pub fn false_range(&self, least: f64, range: f64, u: f64) -> f64 {
        least + u * (range - least).max(0.0)
    }
}

/// Vehicles whose paint mirrors the beam away.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IncompleteEcho {
    ratio: f64,
}

impl IncompleteEcho {
    /// Makes this share of the vehicles dark.
    pub fn new(ratio: f64) -> Self {
        Self { ratio }
    }

    /// Reflectance of a vehicle that has `reflectance` otherwise; `u_object` from 0 to below 1 is the vehicle's
    /// own and the same in all frames, so that more vehicles are dark at a greater ratio, never others. Vehicles that
    /// cannot be told apart have none, and all of them the mean.
    pub fn reflectance(&self, reflectance: f64, u_object: Option<f64>) -> f64 {
        let dark = reflectance.min(DARK);
        match u_object {
            Some(u) if u < self.ratio => dark,
            Some(_) => reflectance,
            None => self.ratio * dark + (1.0 - self.ratio) * reflectance,
        }
    }
}
