//! Power that surfaces send back, through whatever is in the air and on the ground, and whether it is seen.
//!
//! A surface's share of the light depends on its class and its object.

use sightline_scene::scene::{Reflectances, Scene};
use sightline_scene::vehicle::Response;

use crate::conditions::Weather;
use crate::fires::{Chance, Purpose};
use crate::{NO_INSTANCE, conditions};

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
    pub(crate) fn new(scene: &Scene, weather: Weather) -> Self {
        let classes = scene.classes();
        Self {
            weather,
            reflectance: Reflectance::new(classes, scene.reflectances()),
            ground: classes.iter().map(|class| conditions::holds_water(class)).collect(),
        }
    }

    /// ρ·cos θ / r² of a surface, dimmed by fog; snow is drawn for each beam apart. The seed decides how dark
    /// objects are.
    pub(crate) fn power(
        &self,
        seed: u64,
        class: u16,
        instance: u16,
        cosine: f64,
        range: f64,
    ) -> f64 {
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

    /// Power that fog sends back from before a range.
    pub(crate) fn of_fog(&self, range: f64) -> f64 {
        self.weather.fog.as_ref().map_or(0.0, |fog| fog.soft_power(range))
    }

    /// Share of light that fog leaves on the way to a range and back.
    pub(crate) fn through_fog(&self, range: f64) -> f64 {
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

/// Mixed classes, such as vehicles: share of dark objects, their reflectance, and the reflectance of all others. Some
/// car paint mirrors the beam away, other paint scatters it.
const DARK_SHARE: f64 = 0.3;
const DARK: f64 = 0.05;
const BRIGHT: f64 = 0.3;
/// Reflectance of a class that is in no table.
const UNKNOWN: f64 = 0.3;

/// Reflectance by class, from a remission that the device has calibrated.
///
/// Values are medians of an HDL-64E at 5 to 15 m in eight labelled frames of SemanticKITTI (987 000 points). A class
/// that KITTI lacks is like its neighbours, water from its mirror.
const REFLECTANCES: [(&str, f64); 24] = [
    ("building", 0.41),
    ("fence", 0.33),
    ("other", 0.30),
    ("pedestrian", 0.43),
    ("person", 0.43),
    ("pole", 0.23),
    ("road_line", 0.37),
    ("road", 0.26),
    ("parking", 0.32),
    ("sidewalk", 0.31),
    ("vegetation", 0.36),
    ("trunk", 0.36),
    ("wall", 0.41),
    ("traffic_sign", 0.39),
    ("ground", 0.30),
    ("bridge", 0.30),
    ("rail_track", 0.25),
    ("guard_rail", 0.33),
    ("traffic_light", 0.30),
    ("static", 0.30),
    ("dynamic", 0.30),
    ("water", 0.05),
    ("terrain", 0.36),
    ("truck", 0.32),
];
/// Classes whose objects differ.
const MIXED: [&str; 3] = ["vehicle", "car", "moving-car"];

/// Reflectance of the classes of a scene.
#[derive(Debug, Clone)]
pub(super) struct Reflectance {
    /// Reflectance by class; `None` where objects of a class differ.
    by_class: Vec<Option<f64>>,
    /// For each class: true if its objects differ, unless the scene says otherwise.
    mixed: Vec<bool>,
    /// Reflectance by actor, where the scene states it.
    by_actor: Vec<Option<f64>>,
}

impl Reflectance {
    /// Table values of `classes`, overridden by the scene's values for classes and actors.
    pub(crate) fn new(classes: &[String], said: &Reflectances) -> Self {
        let mixed = classes.iter().map(|class| MIXED.contains(&class.as_str())).collect();
        let of = |(id, class): (usize, &String)| {
            if let Some(&Some(reflectance)) = said.classes.get(id) {
                return Some(reflectance);
            }
            let known = REFLECTANCES.iter().find(|(name, _)| name == class);
            match known {
                Some(&(_, reflectance)) => Some(reflectance),
                None => (!MIXED.contains(&class.as_str())).then_some(UNKNOWN),
            }
        };
        let by_class = classes.iter().enumerate().map(of).collect();
        Self { by_class, mixed, by_actor: said.actors.clone() }
    }

    /// Reflectance of an object, 0 to 1; the same in all frames of a seed. Surfaces of the static world have the mean
    /// of their class.
    pub(crate) fn of(&self, class: u16, instance: u16, seed: u64) -> f64 {
        let actor = usize::from(instance).checked_sub(1).and_then(|actor| self.by_actor.get(actor));
        if let Some(&Some(reflectance)) = actor {
            return reflectance;
        }
        match self.by_class.get(usize::from(class)) {
            Some(Some(reflectance)) => *reflectance,
            Some(None) => match draw(instance, seed) {
                Some(u) if u < DARK_SHARE => DARK,
                Some(_) => BRIGHT,
                None => DARK_SHARE * DARK + (1.0 - DARK_SHARE) * BRIGHT,
            },
            None => UNKNOWN,
        }
    }

    fn is_mixed(&self, class: u16) -> bool {
        self.mixed.get(usize::from(class)).is_some_and(|&mixed| mixed)
    }
}

/// A random number from 0 to 1 that an object keeps; `None` for static surfaces.
fn draw(instance: u16, seed: u64) -> Option<f64> {
    let chance = Chance::new(seed, 0, 0, u32::from(instance));
    (instance != NO_INSTANCE).then(|| chance.draw(Purpose::Object, 0))
}
