//! Water on the ground.

use super::fresnel::through_film;

/// Depth in millimetres from which water closes to a film.
pub(super) const FULL_FILM: f64 = 1.2;

/// Classes that water stands on: those that Robo3D takes for ground (road, other flat ground, sidewalk), with their
/// lane markings. Grass drains, and what is called bridge is what carries the road.
const GROUND: [&str; 11] = [
    "road",
    "road_line",
    "lane-marking",
    "sidewalk",
    "parking",
    "ground",
    "other-ground",
    "other_ground",
    "other_flat",
    "driveable_surface",
    "rail_track",
];

/// True if water stands on surfaces of a class.
pub fn is_ground(class: &str) -> bool {
    GROUND.contains(&class)
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

    /// What the ground reflects at an angle of incidence, so that the power is that · cos θ / r² as of dry ground.
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
