//! Sight of a car all round, as a number that a search can raise: no placement should win by looking away.

use serde::{Deserialize, Serialize};
use std::sync::Arc;

use super::beams::{Standing, TargetSite};
use super::card::{CARD_BEAMS, card_targets, position};
use crate::problem::Problem;
use crate::scene::Target;
use crate::vehicle::{SensorPose, UnknownSensor};

/// Bearings that a car stands at.
const BEARINGS: usize = 24;
/// Distances that it stands at, metres: those between which a sector must not lose it.
const DISTANCES: [f64; 8] = [5.0, 7.5, 10.0, 15.0, 20.0, 30.0, 40.0, 50.0];

/// Worth of the beams that a car all round lacks, in the unit of a near gain: one that is seen nowhere takes 1 off.
/// docs/targets.md has the trials of other weights.
pub const CAR_WEIGHT: f64 = 1.0;

/// Places of a car all round a vehicle on level ground.
#[derive(Debug)]
pub struct CarSight {
    site: TargetSite,
    car: Arc<Target>,
    places: Vec<[f64; 3]>,
}

/// Beams of a LiDAR on the car at each place, counted up to five.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CarBeams(Box<[u8]>);

impl CarBeams {
    /// Adds the beams of another LiDAR.
    pub fn add(&mut self, other: &Self) {
        if self.0.is_empty() {
            *self = other.clone();
            return;
        }
        for (sum, beams) in self.0.iter_mut().zip(&other.0) {
            *sum = (*sum + beams).min(CARD_BEAMS as u8);
        }
    }

    /// Beams that are missing, as a share: 0 where five meet the car at every place, 1 where none does anywhere.
    ///
    /// Falls with every LiDAR by less the more there are, as a gain rises: it is submodular.
    pub fn missing(&self) -> f64 {
        share(self.0.iter().map(|&beams| u32::from(beams)).sum(), self.0.len())
    }

    /// The share that is missing with the beams of another LiDAR.
    pub fn missing_with(&self, other: &Self) -> f64 {
        if self.0.is_empty() {
            return other.missing();
        }
        let both = self.0.iter().zip(&other.0).map(|(a, b)| u32::from(a + b).min(CARD_BEAMS));
        share(both.sum(), self.0.len())
    }
}

/// Share of five beams at each place that is missing.
fn share(beams: u32, places: usize) -> f64 {
    if places == 0 { 1.0 } else { 1.0 - f64::from(beams) / (f64::from(CARD_BEAMS) * places as f64) }
}

impl CarSight {
    /// Sight of a problem's vehicle; `None` where beams end at nothing, so that nothing is known of a body.
    pub fn of(problem: &Problem) -> Option<Self> {
        let car = card_targets().first().filter(|_| problem.ends_at_hits())?.clone();
        let site = TargetSite::of(problem);
        let step = 360.0 / BEARINGS as f64;
        let all = (0..BEARINGS).flat_map(|b| DISTANCES.map(|d| position(d, step * b as f64)));
        let places = all.filter(|&at| site.has_room(&car, at)).collect();
        Some(Self { site, car, places })
    }

    /// Beams of a LiDAR.
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn beams(&self, lidar: &SensorPose) -> Result<CarBeams, UnknownSensor> {
        let standing = |&at: &[f64; 3]| Standing { target: &self.car, at };
        let standing: Vec<Standing<'_>> = self.places.iter().map(standing).collect();
        let beams = self.site.beams(lidar, &standing, CARD_BEAMS)?;
        Ok(CarBeams(beams.into_iter().map(|beams| beams as u8).collect()))
    }

    /// Share of beams that LiDARs together miss; see [`CarBeams::missing`].
    ///
    /// # Errors
    /// A model that the vehicle does not have.
    pub fn missing(&self, lidars: &[SensorPose]) -> Result<f64, UnknownSensor> {
        let mut all = CarBeams::default();
        for lidar in lidars {
            all.add(&self.beams(lidar)?);
        }
        Ok(all.missing())
    }
}
