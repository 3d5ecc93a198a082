//! Faults of the sensor and of targets (motion left in, pulses of other sensors, dark vehicles), and water on the ground.

use sightline_scene::scene::Ground;

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

/// Depth in millimetres from which water closes to a film.
const FULL_FILM: f64 = 1.2;

/// True if water stands on surfaces of a class: the ground that Robo3D wets. Soil drains, and bridges carry a road.
pub fn holds_water(class: &str) -> bool {
    matches!(Ground::of(class), Some(Ground::Road | Ground::Hard))
}

/// Water on the ground, so and so deep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WetGround {
    /// Share of the ground that the film covers.
    film: f64,
}

impl WetGround {
    /// Water of a depth in millimetres; from 1.2 on all ground is covered.
    pub fn new(water: f64) -> Self {
        Self { film: (water / FULL_FILM).min(1.0) }
    }

    /// Reflectance ρ′ of wet ground at an angle of incidence; the echo's power stays ρ′·cos θ / r².
    ///
    /// (1 − f)·ρ + f·½(t_s + t_p), the film's share f, with light that is not polarized.
    pub fn reflectance(&self, reflectance: f64, cos: f64) -> f64 {
        if self.film == 0.0 {
            return reflectance;
        }
        let [s, p] = through_film(reflectance, cos);
        (1.0 - self.film) * reflectance + self.film * 0.5 * (s + p)
    }
}

/// Refractive indices of air and water in the near infrared, as the public wet ground takes them.
const AIR: f64 = 1.0003;
const WATER: f64 = 1.33;

/// Shares of light that water mirrors, by Fresnel's equations: polarized across the plane of incidence (s) and in
/// it (p). `cos` is the cosine of the angle of incidence in air. The rest passes; light that leaves the water along the
/// refracted angle has equal shares.
pub(super) fn mirrored(cos: f64) -> [f64; 2] {
    let cos = cos.clamp(0.0, 1.0);
    let sin = (1.0 - cos * cos).sqrt() * AIR / WATER;
    let below = (1.0 - sin * sin).sqrt();
    let s = (AIR * cos - WATER * below) / (AIR * cos + WATER * below);
    let p = (WATER * cos - AIR * below) / (WATER * cos + AIR * below);
    [s * s, p * p]
}

/// Share of the power that comes back out of a full film on ground of `reflectance`, for s and p: in through the
/// surface, scattered, out again, with all that goes to and fro below it.
fn through_film(reflectance: f64, cos: f64) -> [f64; 2] {
    mirrored(cos).map(|r| (1.0 - r) * reflectance * (1.0 - r) / (1.0 - reflectance * r))
}
