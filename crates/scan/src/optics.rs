//! Power that surfaces send back, through whatever is in the air and on the ground, and whether it is seen.

use super::conditions::{self, Weather};
use super::reflectance::{Reflectance, draw};
use sightline_scene::scene::Scene;
use sightline_scene::vehicle::Response;

/// Standard deviations of the threshold beyond which nothing is left to chance.
const CERTAIN: f64 = 5.0;

/// Surfaces and weather of a scene.
#[derive(Debug)]
pub(super) struct Optics {
    pub weather: Weather,
    pub reflectance: Reflectance,
    /// One for each class: whether water may stand on it.
    ground: Vec<bool>,
}

impl Optics {
    pub fn new(scene: &Scene, weather: Weather) -> Self {
        let classes = scene.classes();
        Self {
            weather,
            reflectance: Reflectance::new(classes, scene.reflectances()),
            ground: classes.iter().map(|class| conditions::holds_water(class)).collect(),
        }
    }

    /// ρ·cos θ / r² of a surface, dimmed by fog; snow is drawn for each beam apart. The seed decides how dark
    /// objects are.
    pub fn power(&self, seed: u64, class: u16, instance: u16, cosine: f64, range: f64) -> f64 {
        let weather = &self.weather;
        let mut reflectance = self.reflectance.of(class, instance, seed);
        if let Some(echo) = &weather.echo
            && self.reflectance.is_mixed(class)
        {
            reflectance = echo.reflectance(reflectance, draw(instance, seed));
        }
        if let Some(wet) = &weather.wet
            && self.ground.get(usize::from(class)).is_some_and(|&ground| ground)
        {
            reflectance = wet.reflectance(reflectance, cosine);
        }
        reflectance * cosine / (range * range) * self.through_fog(range)
    }

    /// Share of light that fog leaves on the way to a range and back.
    pub fn through_fog(&self, range: f64) -> f64 {
        self.weather.fog.as_ref().map_or(1.0, |fog| fog.attenuation(range))
    }
}

/// True if an echo of a power is seen: with probability Φ((P/P_min − 1)/softness), by a draw from 0 to 1.
pub(super) fn is_seen(response: &Response, power: f64, draw: impl FnOnce() -> f64) -> bool {
    let over = power / response.threshold() - 1.0;
    let sure = CERTAIN * response.softness;
    over > sure || over > -sure && draw() < normal_share(over / response.softness)
}

/// Share of a normal distribution below x.
fn normal_share(x: f64) -> f64 {
    0.5 * lidar_cast::maths::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)
}
