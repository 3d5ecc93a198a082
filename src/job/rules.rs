//! Rules of the mounts before a search: a rig that keeps them, and where the search starts.

use std::path::PathBuf;

use super::{Job, JobError};
use crate::search::{SearchError, Settings};
use crate::vehicle::{Constraints, PoseGrid, random_placements_by_the_rules};

impl Job {
    /// Checks that some rig keeps the rules of the mounts, and that the grid of `delta` has no more poses than are possible,
    /// before anything is written.
    ///
    /// # Errors
    /// No rig is found, or too many poses.
    pub fn check_room(&self) -> Result<(), JobError> {
        let place = |file: &PathBuf| file.display().to_string();
        let vehicle = self.scene().vehicle();
        let found = vehicle.rig_by_the_rules();
        let (equipment, _) = found.map_err(|error| JobError::InScene {
            scene: self.vehicle_file.as_ref().map_or_else(|| self.scenes[0].place(), place),
            source: error.into(),
        })?;
        if let Some(spacing) = self.settings.delta {
            let grid = PoseGrid::new(&vehicle.constraints(&equipment), spacing);
            grid.map_err(SearchError::from)?;
        }
        Ok(())
    }
}

/// Seed of the random placement that is tried before one is worked out.
const SEED: u64 = 0;

/// Settings that start from a placement by the rules where hardly any random one keeps them.
pub(super) fn by_the_rules(mut settings: Settings, constraints: &Constraints) -> Settings {
    if random_placements_by_the_rules(constraints, 1, SEED).is_empty() {
        settings.starts.extend(constraints.placement_by_the_rules());
    }
    settings
}
