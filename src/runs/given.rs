//! Checks of a file's placements against their scene: sensors that the vehicle lacks are errors, likely mistakes are
//! noted.

use std::path::{Path, PathBuf};

use super::{Computing, RunError, Watcher};
use crate::Note;
use crate::problem::Problem;
use crate::vehicle::{
    Constraints, Doubts, ForeignLidar, Placement, PlacementFileError, SensorChoice, Sensors,
    Vehicle, name_lidars, table_7, table_7_held_by,
};

/// Most doubts that are noted: of a million placements in degrees the first few say enough.
const MOST_TOLD: u64 = 3;

/// Checks the placements of a file.
pub struct Given<'a> {
    file: PathBuf,
    sensors: Sensors,
    doubts: Doubts,
    choices: Vec<SensorChoice>,
    watcher: &'a dyn Watcher,
    found: u64,
}

impl<'a> Given<'a> {
    /// Checks placements against the sensors and mounts of a vehicle.
    pub fn new(
        file: &Path,
        sensors: &Sensors,
        constraints: &Constraints,
        computing: &Computing<'a>,
    ) -> Self {
        let (file, sensors, doubts) = (file.to_owned(), sensors.clone(), Doubts::of(constraints));
        let (choices, watcher) = (computing.sensors.clone(), computing.watcher);
        Self { file, sensors, doubts, choices, watcher, found: 0 }
    }

    /// Checks placements against the sensors and mounts of a problem.
    pub fn in_problem(file: &Path, problem: &Problem, computing: &Computing<'a>) -> Self {
        Self::new(file, problem.sensors(), problem.constraints(), computing)
    }

    /// Leaves out doubts about the mount's rules, which the search reports; units are still checked.
    #[must_use]
    pub fn ruled(self) -> Self {
        Self { doubts: Doubts::of_units(), ..self }
    }

    /// Names LiDARs by `--sensor`, and checks some placements.
    ///
    /// # Errors
    /// A sensor that the vehicle does not have, or none where it has several.
    pub fn look<'p>(
        &mut self,
        placements: impl IntoIterator<Item = &'p mut Placement>,
    ) -> Result<(), RunError> {
        for placement in placements {
            let unknown = |source| PlacementFileError::Sensor { path: self.file.clone(), source };
            name_lidars(&self.choices, placement).map_err(unknown)?;
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

    /// Notes how many more doubts there are than were noted.
    pub fn finish(&self) {
        if self.found > MOST_TOLD {
            let (more, file) = (self.found - MOST_TOLD, self.file.display());
            self.watcher.note(&format!("{file}: {more} more LiDAR(s) have such a problem"));
        }
    }

    /// Checks all placements.
    ///
    /// # Errors
    /// See [`Self::look`].
    pub fn all<'p>(
        mut self,
        placements: impl IntoIterator<Item = &'p mut Placement>,
    ) -> Result<(), RunError> {
        self.look(placements)?;
        self.finish();
        Ok(())
    }
}

/// The layouts of Table 7 where a vehicle is the paper's car: one model, a mount that holds them; else none. See
/// [`name_published`] for their models.
///
/// # Errors
/// See [`name_published`].
pub fn held(
    vehicle: &Vehicle,
    sensors: &Sensors,
    computing: &Computing<'_>,
) -> Result<Vec<Placement>, RunError> {
    let mut layouts = table_7_held_by(vehicle);
    name_published(&mut layouts, sensors, computing)?;
    Ok(layouts)
}

/// The layouts of Table 7 of the paper. See [`name_published`] for their models.
///
/// # Errors
/// See [`name_published`].
pub fn published(sensors: &Sensors, computing: &Computing<'_>) -> Result<Vec<Placement>, RunError> {
    let mut layouts = table_7();
    name_published(&mut layouts, sensors, computing)?;
    Ok(layouts)
}

/// Names the models of layouts of the paper: by `--sensor`, else the first of several models, which is noted.
///
/// # Errors
/// A model of `--sensor` that the vehicle does not have.
pub fn name_published(
    layouts: &mut [Placement],
    sensors: &Sensors,
    computing: &Computing<'_>,
) -> Result<(), RunError> {
    for layout in layouts.iter_mut() {
        name_lidars(&computing.sensors, layout).map_err(wrong_choice)?;
    }
    if sensors.name_first(layouts) {
        let first = sensors.models()[0].name;
        computing.watcher.note(&format!(
            "LiDARs of the layouts of Table 7 are the vehicle's first model, `{first}`; --sensor all=MODEL \
             gives them another"
        ));
    }
    layouts.iter().try_for_each(|layout| sensors.check(layout)).map_err(wrong_choice)
}

fn wrong_choice(fault: ForeignLidar) -> RunError {
    RunError::Usage(format!("--sensor: {fault}"))
}
