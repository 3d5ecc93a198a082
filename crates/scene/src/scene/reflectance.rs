//! Reflectances in a scene file: shares of light, 0 to 1, that its surfaces send back.

use super::classes::Classes;
use super::description::{ActorDescription, Dictionary};
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place};

/// Reflectances that a scene states, from 0 to 1, of a surface that faces the sensor.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Reflectances {
    /// Reflectance by class id; `None` leaves the class at its usual value.
    pub classes: Vec<Option<f64>>,
    /// Reflectance by actor, as listed; `None` leaves the actor at its classes' values.
    pub actors: Vec<Option<f64>>,
}

impl Reflectances {
    /// From `reflectance` of a scene and of its actors.
    ///
    /// # Errors
    /// A class that the scene does not have, a number that is no share.
    pub(super) fn new(
        top: &Place,
        classes: &Classes,
        of_classes: &Dictionary<f64>,
        actors: &[ActorDescription],
    ) -> Result<Self, DescriptionError> {
        let (at, mut by_class) = (top.key("reflectance"), vec![None; classes.names.len()]);
        for (name, value) in &of_classes.0 {
            let at = at.key(name);
            by_class[usize::from(classes.id(&at, name)?)] = Some(share(&at, *value)?);
        }
        let of_actor = |(i, actor): (usize, &ActorDescription)| {
            let at = top.key("actors").item(i).key("reflectance");
            actor.reflectance.map(|value| share(&at, value)).transpose()
        };
        let actors = actors.iter().enumerate().map(of_actor).collect::<Result<_, _>>()?;
        Ok(Self { classes: by_class, actors })
    }
}

fn share(at: &Place, value: f64) -> Result<f64, DescriptionError> {
    if (0.0..=1.0).contains(&value) {
        return Ok(value);
    }
    let wanted = "the share of light that the surface sends back, from 0 to 1; asphalt has 0.26";
    Err(bad(at, value, wanted))
}
