//! A car all round a rig, at every place at which a range card looks for blind sectors.

use super::beams::{PlacedTarget, TargetSite};
use super::card::{CARD_BEAMS, car_places, card_targets};
use crate::problem::Problem;
use crate::scene::Target;
use crate::vehicle::{SensorPose, UnknownSensor};

/// Places of a car on level ground that a rig must not lose.
pub(crate) struct CarAllRound {
    site: TargetSite,
    places: Vec<[f64; 3]>,
}

impl CarAllRound {
    /// Places around the vehicle of a scene that is no mirror image; `None` with coverage `through`, where nothing is known of
    /// a body.
    pub(crate) fn of(problem: &Problem) -> Option<Self> {
        let site = problem.ends_at_hits().then(|| TargetSite::of(problem))?;
        let places = car_places(&site);
        Some(Self { site, places })
    }

    /// Number of places that lose the car: fewer than [`CARD_BEAMS`] beams of the LiDARs meet it.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub(crate) fn lost(&self, lidars: &[SensorPose]) -> Result<usize, UnknownSensor> {
        let car: &Target = &card_targets()[0];
        let standing = |&at: &[f64; 3]| PlacedTarget { target: car, at };
        let standing: Vec<PlacedTarget<'_>> = self.places.iter().map(standing).collect();
        let met = self.site.met(lidars, &standing, CARD_BEAMS)?;
        Ok(met.iter().filter(|is_met| !**is_met).count())
    }
}
