//! Rules of a vehicle for a placement: mounts and their numbers of LiDARs, distances, keep-out boxes, ties.

use sightline::vehicle::{Placement, Vehicle};
use sightline::{Constraints, Scores};

/// Rules of a vehicle, whatever of its equipment a placement has.
pub struct Rules<'a> {
    vehicle: &'a Vehicle,
    rules: Constraints,
}

impl<'a> Rules<'a> {
    pub fn new(vehicle: &'a Vehicle) -> Self {
        Self { vehicle, rules: vehicle.rules() }
    }

    /// True if a placement keeps every rule of the mounts, meets all requirements, and no guard doubts its scores.
    pub fn are_met(&self, placement: &Placement, scores: &Scores) -> bool {
        let is_doubted = scores.guards.iter().any(|guard| guard.is_doubt());
        !is_doubted && scores.missing() == 0.0 && self.are_kept(placement)
    }

    /// True if a placement keeps every rule of the mounts, with as many LiDARs on each as it holds.
    fn are_kept(&self, placement: &Placement) -> bool {
        let mounts = self.rules.mounts_of(&placement.lidars);
        let are_counted = self.vehicle.mounts.iter().all(|mount| {
            let on = |region: &&sightline::vehicle::Region| **region == *mount.region;
            let count = mounts.iter().flatten().filter(|region| on(region)).count();
            (mount.count[0]..=mount.count[1]).contains(&count)
        });
        let have_mounts = mounts.iter().all(Option::is_some);
        have_mounts && are_counted && self.rules.violations(placement).is_empty()
    }
}
