//! Placements of a file beside the scene that they are for: sensors that the vehicle lacks are errors, what is most
//! likely not meant is told.

use std::path::{Path, PathBuf};

use super::{Error, Watcher};
use crate::Note;
use crate::problem::Problem;
use crate::vehicle::{Constraints, Doubts, Placement, PlacementFileError, Sensors};

/// Doubts that are told: of a million placements in degrees, the first say enough.
const MOST_TOLD: u64 = 3;

/// Looks at the placements of a file.
pub struct Given<'a> {
    file: PathBuf,
    sensors: Sensors,
    doubts: Doubts,
    watcher: &'a dyn Watcher,
    found: u64,
}

impl<'a> Given<'a> {
    /// Of placements that are taken as they are, by the sensors and mounts of a vehicle.
    pub fn new(
        file: &Path,
        sensors: &Sensors,
        constraints: &Constraints,
        watcher: &'a dyn Watcher,
    ) -> Self {
        let (file, sensors, doubts) = (file.to_owned(), sensors.clone(), Doubts::of(constraints));
        Self { file, sensors, doubts, watcher, found: 0 }
    }

    /// The same by a problem.
    pub fn in_problem(file: &Path, problem: &Problem, watcher: &'a dyn Watcher) -> Self {
        Self::new(file, problem.sensors(), problem.constraints(), watcher)
    }

    /// The same where what a placement breaks of the mount's rules is told elsewhere.
    #[must_use]
    pub fn ruled(self) -> Self {
        Self { doubts: Doubts::of_units(), ..self }
    }

    /// Looks at some placements.
    ///
    /// # Errors
    /// A sensor that the vehicle does not have.
    pub fn look<'p>(
        &mut self,
        placements: impl IntoIterator<Item = &'p Placement>,
    ) -> Result<(), Error> {
        for placement in placements {
            let unknown = |source| PlacementFileError::Sensor { path: self.file.clone(), source };
            self.sensors.check(placement).map_err(unknown)?;
            for doubt in self.doubts.about(placement) {
                self.found += 1;
                if self.found <= MOST_TOLD {
                    let doubt = Note::doubt(format!("{}: {doubt}", self.file.display()));
                    self.watcher.tell(&doubt)?;
                }
            }
        }
        Ok(())
    }

    /// Says of how many more there is doubt than was told.
    pub fn finish(&self) {
        if self.found > MOST_TOLD {
            let (more, file) = (self.found - MOST_TOLD, self.file.display());
            self.watcher.note(&format!("{file}: there is doubt of {more} more LiDAR(s)"));
        }
    }

    /// Looks at all placements there are.
    ///
    /// # Errors
    /// As [`Self::look`].
    pub fn all<'p>(
        mut self,
        placements: impl IntoIterator<Item = &'p Placement>,
    ) -> Result<(), Error> {
        self.look(placements)?;
        self.finish();
        Ok(())
    }
}
