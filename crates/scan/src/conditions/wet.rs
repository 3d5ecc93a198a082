//! Water on the ground.

use super::fresnel::through_film;
use sightline_scene::scene::Ground;

/// Depth in millimetres from which water closes to a film.
pub(super) const FULL_FILM: f64 = 1.2;

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
