//! Checks before a search: sensors that were read fit the vehicle, some rig keeps its rules, the grid is not too fine.

use crate::job::{Job, JobError};
use crate::search::{Equipped, SearchError};
use crate::vehicle::{PoseGrid, SensorName, Vehicle, is_within_budget};

/// Checks that a vehicle can carry sensors that were read from a file.
pub(super) fn check_equipped(vehicle: &Vehicle, equipped: &Equipped) -> Result<(), JobError> {
    let Equipped { equipment, placement, .. } = equipped;
    let is_there = |&(mount, sensor): &(usize, SensorName)| {
        mount < vehicle.mounts.len() && vehicle.sensors.iter().any(|of| of.name == sensor)
    };
    match equipment.len() == placement.lidars.len() && equipment.iter().all(is_there) {
        true => Ok(()),
        false => {
            let why = "its sensors are not those of the vehicle".to_owned();
            Err(JobError::OtherState { why })
        }
    }
}

impl Job {
    /// Checks that some rig keeps the rules of the mounts and costs no more than the budget, and that the grid of `delta` has
    /// no more poses than are possible, before anything is written.
    ///
    /// # Errors
    /// No rig is found, too little money, too many poses, or mounts that lie inside the own body.
    pub fn check_room(&self) -> Result<(), JobError> {
        if let Some(told) = self.scenes.iter().find_map(|scene| scene.scene().buried_mounts()) {
            return Err(JobError::Buried(told.to_owned()));
        }
        let place = |file: &std::path::PathBuf| file.display().to_string();
        let vehicle = self.scene().vehicle();
        let found = vehicle.rig_by_the_rules();
        let (equipment, _) = found.map_err(|error| JobError::InScene {
            scene: self.vehicle_file.as_ref().map_or_else(|| self.scenes[0].place(), place),
            source: error.into(),
        })?;
        if let Some(budget) = self.budget {
            let mut costs =
                [&vehicle.cheapest(), &equipment].map(|rig| vehicle.cost(rig)).into_iter();
            if let Some(least) = costs.find(|least| !is_within_budget(*least, budget)) {
                return Err(SearchError::Budget { budget, least }.into());
            }
        }
        if let Some(spacing) = self.settings.delta {
            let regions = || vehicle.mounts.iter().map(|mount| &mount.region);
            let sides = regions().flat_map(|r| [0, 1, 2].map(|k| r.upper[k] - r.lower[k]));
            let widest = sides.fold(0.0, f64::max);
            if widest > 0.0 && spacing.metres > widest {
                let scene =
                    self.vehicle_file.as_ref().map_or_else(|| self.scenes[0].place(), place);
                return Err(JobError::WideStep { given: spacing.metres, scene, widest });
            }
            let grid = PoseGrid::new(&vehicle.constraints(&equipment), spacing);
            grid.map_err(SearchError::from)?;
        }
        Ok(())
    }
}
