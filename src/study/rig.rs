//! Sensors of a vehicle for the budget: the rig whose placements a study searches.

use super::StudyError;
use super::scene::StudyScene;
use crate::search::{EquipStep, Equipped, Equipping, Event, Limits, Settings};
use crate::vehicle::{Constraints, Placement};

/// Rules of placements that are searched, and where the search starts.
pub(super) struct SearchSpace {
    /// A slot for each sensor.
    pub(super) constraints: Constraints,
    /// Placements to start from.
    pub(super) starts: Vec<Placement>,
    /// Sensors and their price in words; `None` for a scene without a vehicle.
    pub(super) words: Option<String>,
}

impl SearchSpace {
    /// Chosen sensors of a vehicle; the search starts from their poses on the coarse grid and from a plain layout.
    pub(super) fn of(scene: &StudyScene, equipped: &Equipped) -> Self {
        let vehicle = scene.scene.vehicle();
        let constraints = vehicle.constraints(&equipped.equipment);
        let Settings { baselines, starts, .. } =
            equipped.begin(Settings::default(), &constraints, true);
        let words = Some(equipped.words_with_price(vehicle));
        Self { constraints, starts: [starts, baselines].concat(), words }
    }

    /// The scene's own LiDAR and mount, or the sensors chosen from a vehicle for the budget.
    pub(super) fn chosen(scene: &StudyScene) -> Result<Self, StudyError> {
        if scene.scene.vehicle().is_nameless() {
            let (constraints, starts) = (scene.constraints(), scene.layouts.clone());
            return Ok(Self { constraints, starts, words: None });
        }
        let limits = scene.limits();
        let equipped = EquipmentChoice::open(scene)?.best(scene, limits)?;
        Ok(Self::of(scene, &equipped))
    }
}

/// Every model on every mount, cast once, from which equipment is chosen under different limits.
pub(super) struct EquipmentChoice(Equipping);

impl EquipmentChoice {
    /// Casts the poses.
    ///
    /// # Errors
    /// See [`Equipping::open`]; [`StudyError::Stopped`] once the observer wants to stop.
    pub(super) fn open(scene: &StudyScene) -> Result<Self, StudyError> {
        let (vehicle, settings) = (scene.scene.vehicle(), scene.settings);
        let mut observer = |_: &Event| scene.goes_on();
        let opened = Equipping::open(
            &scene.suite()?,
            vehicle,
            &settings.objective,
            scene.limits(),
            &settings.engine,
            None,
            &mut observer,
        )?;
        opened.map(Self).ok_or(StudyError::Stopped)
    }

    /// The best equipment under some limits; without sensors where none keeps them.
    ///
    /// # Errors
    /// [`StudyError::Stopped`] once the observer wants to stop.
    pub(super) fn best(
        &mut self,
        scene: &StudyScene,
        limits: Limits,
    ) -> Result<Equipped, StudyError> {
        self.0.again(limits);
        let mut observer = |_: &Event| scene.goes_on();
        loop {
            match self.0.step(&mut observer) {
                EquipStep::On => {}
                EquipStep::Stopped => return Err(StudyError::Stopped),
                EquipStep::Done(found) | EquipStep::OutOfTime(found) => return Ok(found),
            }
        }
    }
}
