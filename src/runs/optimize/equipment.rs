//! Which sensors a vehicle carries in a run, and how far the choice of them is.

use std::time::Instant;

use super::bars::Bars;
use super::begun::{Begun, Course, Saved, Wanted};
use super::record::{BETWEEN_CHECKPOINTS, Opened};
use crate::files::RunDir;
use crate::runs::{Computing, Error};
use crate::scene::Scene;
use crate::search::{EquipStep, Equipped, Equipping, Event, Suite};
use crate::vehicle::{SensorName, Vehicle};

/// The suite with a slot for each sensor of the scenes' vehicle; chosen under the budget, unless the run that
/// goes on has chosen already, and whether the time ended before that; `None` after Ctrl-C.
pub(super) fn equipped(
    begun: &mut Begun,
    wanted: Option<&Wanted>,
    opened: &Opened,
    folder: &RunDir<Saved>,
    deadline: Option<Instant>,
    computing: &Computing<'_>,
) -> Result<Option<(Suite, bool)>, Error> {
    let Some(vehicle) = opened.scenes.first().and_then(Scene::vehicle) else {
        return match begun.budget {
            Some(_) => Err(Error::Usage(
                "--budget: the scene has one LiDAR and no prices; give a vehicle with --vehicle"
                    .into(),
            )),
            None => Ok(Some((opened.suite.clone(), false))),
        };
    };
    let mut is_late = false;
    if let (Some(wanted), None) = (wanted, &begun.equipped) {
        let save = |wanted: &Wanted| {
            let course = Course::Equipping(Box::new(wanted.clone()));
            Ok(folder.save(&Saved { begun: begun.clone(), course })?)
        };
        let found =
            choose(vehicle, begun.budget, wanted, &opened.suite, deadline, computing, &save)?;
        let Some((found, late)) = found else {
            let folder = folder.path().display();
            computing.watcher.note(&format!(
                "stopped while the sensors were chosen; go on with --resume {folder}"
            ));
            return Ok(None);
        };
        (begun.equipped, is_late) = (Some(found), late);
    }
    if let Some(Equipped { equipment, placement, .. }) = &begun.equipped {
        let is_there = |&(mount, sensor): &(usize, SensorName)| {
            mount < vehicle.mounts.len() && vehicle.sensors.iter().any(|of| of.name == sensor)
        };
        if equipment.len() != placement.lidars.len() || !equipment.iter().all(is_there) {
            return Err(folder.refusal("its sensors are not those of the vehicle").into());
        }
    }
    let equipment = begun.equipped.as_ref().map(|equipped| &equipped.equipment);
    let equipment = equipment.cloned().unwrap_or_default();
    Ok(Some((opened.suite.with_constraints(&vehicle.constraints(&equipment)), is_late)))
}

/// Chooses from where `wanted` stands, and saves on the way; true where the time ended before the choice.
fn choose(
    vehicle: &Vehicle,
    budget: Option<f64>,
    wanted: &Wanted,
    suite: &Suite,
    deadline: Option<Instant>,
    computing: &Computing<'_>,
    save: &dyn Fn(&Wanted) -> Result<(), Error>,
) -> Result<Option<(Equipped, bool)>, Error> {
    let (watcher, engine) = (computing.watcher, &computing.engine);
    let budget = budget.unwrap_or(f64::INFINITY);
    let objective = &wanted.settings.objective;
    let mut bars = Bars::new(watcher);
    let mut observe = |event: &Event| {
        bars.show(event);
        watcher.goes_on()
    };
    let opened =
        Equipping::open(suite, vehicle, objective, budget, engine, deadline, &mut observe)?;
    let Some(choice) = opened else {
        save(wanted)?;
        return Ok(None);
    };
    let mut choice = choice.with_state(wanted.choosing.clone());
    let mut saved: Option<Instant> = None;
    let (found, is_late) = loop {
        let step = choice.step(&mut observe);
        let is_due = saved.is_none_or(|saved| saved.elapsed() > BETWEEN_CHECKPOINTS);
        if is_due || matches!(step, EquipStep::Stopped | EquipStep::OutOfTime(_)) {
            save(&Wanted { choosing: choice.state().clone(), ..wanted.clone() })?;
            saved = Some(Instant::now());
        }
        match step {
            EquipStep::On => {}
            EquipStep::Stopped => return Ok(None),
            EquipStep::Done(found) => break (found, false),
            EquipStep::OutOfTime(found) => break (found, true),
        }
    };
    bars.clear();
    watcher.note(&format!("equipment: {}", found.words_with_price(vehicle)));
    if found.missing > 0.0 {
        watcher.note(&format!(
            "what must be seen is not seen: {:.1} % is missing with the sensors chosen, over few frames; raise \
             --budget, or lower a `share`",
            100.0 * found.missing
        ));
    }
    Ok(Some((found, is_late)))
}
