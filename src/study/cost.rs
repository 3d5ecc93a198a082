//! Sensors against their price: the front of gain and cost.

use super::cases::Cases;
use super::columns::{self, SCORES, made_large};
use super::rig::SearchSpace;
use super::scene::StudyScene;
use super::{Row, StudyError, Table, TablePlot};
use crate::search::{Equipped, cost_front};

pub(super) fn cost(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let vehicle = scene.scene.vehicle();
    if vehicle.is_nameless() {
        return Err(StudyError::NoVehicle { scene: scene.place() });
    }
    let (suite, limits) = (scene.suite()?, scene.limits());
    let (objective, engine) = (&scene.settings.objective, &scene.settings.engine);
    let front = cost_front(&suite, vehicle, objective, limits, engine)?;
    let named: Vec<(String, Equipped)> =
        front.into_iter().map(|equipped| (equipped.words(vehicle), equipped)).collect();
    let rows = cases.each(named, |equipped, _| {
        let SearchSpace { constraints, starts, .. } = SearchSpace::of(scene, &equipped);
        let mut evaluator = scene.evaluator_under(&constraints)?;
        let found = scene.optimize_from(&evaluator, objective, &starts)?;
        let best = found.unwrap_or_else(|| equipped.placement.clone());
        let scores = scene.score(&mut evaluator, &best)?;
        let mut values = vec![Some(equipped.cost)];
        values.extend(columns::values(&scores));
        values.push(Some(best.lidars.len() as f64));
        values.push(Some(100.0 * scores.missing()));
        Ok(Row::scored(values, best, &scores))
    })?;
    let notes = vec![
        "Models, mounts and numbers are chosen for each budget on a coarse grid, then poses are searched; a fall \
         is a search that ended early, not a sensor that harms."
            .to_owned(),
        format!("Prices, and what the mounts may hold, are those of {}.", vehicle.name),
    ];
    let title = scene.title("what is gained for the money");
    let columns = ["sensors", "price"].into_iter().chain(SCORES).chain(["LiDARs", "not seen %"]);
    let drawn = made_large(&scene.settings.objective);
    let y_title = SCORES[drawn].to_owned();
    let drawing = TablePlot::Against { column: 1 + drawn, x_title: "price".to_owned(), y_title };
    Ok(Table::new(title, columns, rows, notes, drawing))
}
