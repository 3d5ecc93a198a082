//! Which sensors a vehicle carries in a run, and what the result is compared with.

use crate::scene::Scene;
use crate::search::{Equipped, Event, Suite, equip};
use crate::vehicle::Vehicle;

use super::bars::Bars;
use super::settings::{self, Args, Begun};
use crate::cli::error::Error;
use crate::cli::interrupt::Interrupt;

/// The suite with a slot for each sensor of the scenes' vehicle; chosen under the budget, unless the run that
/// goes on has chosen already. `None` after Ctrl-C.
pub(super) fn equipped(
    begun: &mut Begun,
    scenes: &[Scene],
    suite: &Suite,
    args: &Args,
    interrupt: &Interrupt,
) -> Result<Option<Suite>, Error> {
    let Some(vehicle) = scenes.first().and_then(Scene::vehicle) else {
        return match begun.budget {
            Some(_) => Err(Error::Usage(
                "--budget: the scene has one LiDAR and no prices; give a vehicle with --vehicle"
                    .into(),
            )),
            None => Ok(Some(suite.clone())),
        };
    };
    if begun.equipped.is_none() {
        begun.equipped = choose(vehicle, begun.budget, suite, args, interrupt)?;
    }
    if begun.equipped.is_none() {
        return Ok(None);
    }
    let equipment = begun.equipped.as_ref().map(|equipped| &equipped.equipment);
    let equipment = equipment.cloned().unwrap_or_default();
    Ok(Some(suite.with_constraints(&vehicle.constraints(&equipment))))
}

fn choose(
    vehicle: &Vehicle,
    budget: Option<f64>,
    suite: &Suite,
    args: &Args,
    interrupt: &Interrupt,
) -> Result<Option<Equipped>, Error> {
    let talk = args.compute.talk;
    let objective = settings::of(args)?.objective;
    let budget = budget.unwrap_or(f64::INFINITY);
    let mut bars = Bars::new(talk);
    let mut observe = |event: &Event| {
        bars.show(event);
        !interrupt.is_set()
    };
    let engine = args.compute.engine();
    let found = equip(suite, vehicle, &objective, budget, &engine, &mut observe)?;
    bars.clear();
    let Some(found) = found else {
        talk.note("stopped while the sensors were chosen; nothing is written, start again");
        return Ok(None);
    };
    talk.note(format!("equipment: {}, {} in all", found.words(vehicle), found.cost));
    if found.missing > 0.0 {
        talk.note(format!(
            "what must be seen is not seen: {:.1} % is missing with the sensors chosen, over few frames; raise \
             --budget, or lower a `share`",
            100.0 * found.missing
        ));
    }
    Ok(Some(found))
}
