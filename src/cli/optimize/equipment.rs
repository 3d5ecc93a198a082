//! Which sensors a vehicle carries in a run, and what the result is compared with.

use sightline::scene::Scene;
use sightline::search::{Equipped, Settings, Suite, equip};
use sightline::vehicle::{Placement, Vehicle};

use super::settings::{self, Args, Begun};
use crate::cli::error::Error;

/// The suite with a slot for each sensor of the scenes' vehicle; chosen under the budget, unless the run that
/// goes on has chosen already.
pub(super) fn equipped(
    begun: &mut Begun,
    scenes: &[Scene],
    suite: &Suite,
    args: &Args,
) -> Result<Suite, Error> {
    let Some(vehicle) = scenes.first().and_then(Scene::vehicle) else {
        return match begun.budget {
            Some(_) => Err(Error::Usage(
                "--budget: the scene has one LiDAR and no prices; give a vehicle with --vehicle"
                    .into(),
            )),
            None => Ok(suite.clone()),
        };
    };
    if begun.equipped.is_none() {
        begun.equipped = Some(choose(vehicle, begun.budget, suite, args)?);
    }
    let equipment = begun.equipped.as_ref().map(|equipped| &equipped.equipment);
    let equipment = equipment.cloned().unwrap_or_default();
    Ok(suite.with_constraints(&vehicle.constraints(&equipment)))
}

fn choose(
    vehicle: &Vehicle,
    budget: Option<f64>,
    suite: &Suite,
    args: &Args,
) -> Result<Equipped, Error> {
    let talk = args.compute.talk;
    let objective = settings::of(args)?.objective;
    let budget = budget.unwrap_or(f64::INFINITY);
    let found = equip(suite, vehicle, &objective, budget, &args.compute.engine())?;
    talk.note(format!("equipment: {}, {} in all", found.words(vehicle), found.cost));
    if found.missing > 0.0 {
        talk.note(format!(
            "what must be seen is not seen: {:.1} % is missing with the sensors chosen, over few frames; raise \
             --budget, or lower a `share`",
            100.0 * found.missing
        ));
    }
    Ok(found)
}

/// Settings that start from the chosen sensors, and compare with the same sensors put up plainly: in the middle of
/// their mounts, or evenly around it, looking straight.
pub(super) fn begin(mut settings: Settings, begun: &Begun, suite: &Suite, args: &Args) -> Settings {
    let Some(equipped) = &begun.equipped else { return settings };
    if args.has_no_baselines() {
        let models: Vec<_> = equipped.equipment.iter().map(|(_, sensor)| *sensor).collect();
        let plain = sightline::internals::reference_layout(suite.constraints(), &models);
        settings.baselines = vec![Placement { name: "plain".into(), ..plain }];
    }
    settings.starts.push(equipped.placement.clone());
    settings
}
