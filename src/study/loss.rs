//! The loss of one LiDAR: the score after it, and the placement that loses least.

use std::collections::HashMap;

use sightline_cma::{Cma, CmaOptions};

use super::scene::StudyScene;
use super::table::{Cases, shown_objective};
use super::{AfterLoss, Row, StudyError, Table, TablePlot};
use crate::job::{Loss, Losses, without};
use crate::problem::Problem;
use crate::score::{Objective, Scores};
use crate::search::{Evaluator, SearchError};
use crate::targets::{BlindSector, RangeCard};
use crate::vehicle::{Constraints, Placement, SensorPose};

/// Step size at the start, as a share of each range.
const STEP_SIZE: f64 = 0.3;
/// Cost of a candidate that keeps the rules and has no value: above all values, below [`MISSED`].
const NO_VALUE: f64 = 1e150;
/// Cost of a candidate that misses nothing of its requirements; it grows with the missing share.
const MISSED: f64 = 1e175;
/// Cost of a candidate that breaks a rule by nothing; it grows with the amount.
const BROKEN: f64 = 1e200;

/// The two cases, in order: the best of all LiDARs is a start of the second search, which can so not end
/// below it.
const OPTIMIZED: [&str; 2] = ["optimized", "optimized for the worst loss"];

/// Columns before the value without each LiDAR, and further ones of own rigs, behind it.
const OF_VALUE: [&str; 2] = ["all LiDARs", "after the worst loss"];
const OF_OWN: [&str; 2] = ["most not met", "most blind °"];

/// Note of a rig without a value after a loss.
const NOTHING_LEFT: &str = "one LiDAR: nothing is left when it is lost";

/// Table of rigs; `names` are those of the LiDARs that are lost.
fn table(
    scene: &StudyScene,
    names: &[String],
    further: &[&str],
    rows: Vec<Row>,
    mut notes: Vec<String>,
) -> Table {
    let (title, factor) = shown_objective(&scene.settings.objective);
    let heading = format!("{title} with all LiDARs, and after the loss of one");
    // A column says its unit where that is not the objective's own.
    let unit = if factor == 1.0 { "" } else { " %" };
    // Where every LiDAR has a mount, columns are wide enough without the word.
    let has_mounts = names.iter().all(|name| name.contains('('));
    let short = |name: &str| name.strip_prefix("LiDAR ").filter(|_| has_mounts).map(str::to_owned);
    let losses = names.iter().map(|name| short(name).unwrap_or_else(|| name.clone()));
    let losses = losses.map(|name| format!("without {name}"));
    let of_value = OF_VALUE.map(str::to_owned).into_iter().chain(losses);
    let mut columns = vec!["placement".to_owned()];
    columns.extend(of_value.map(|column| format!("{column}{unit}")));
    let drawn = columns.len() - 1;
    columns.extend(further.iter().map(|column| (*column).to_owned()));
    if rows.iter().any(|row| !row.unmet_at.is_empty()) {
        notes.push("! before a value: a requirement is not met.".to_owned());
    }
    let has_no_value = |row: &Row| row.placement.is_some() && row.values.get(1) == Some(&None);
    if rows.iter().any(|row| row.note.is_none() && has_no_value(row)) {
        notes.push(format!(
            "– {}: without one LiDAR there is no value, or a guard speaks against the others.",
            OF_VALUE[1]
        ));
    }
    let drawing = TablePlot::ByColumn {
        columns: (0..drawn).collect(),
        x_title: "LiDARs that work".to_owned(),
        y_title: title,
    };
    let columns = columns.iter().map(String::as_str);
    Table::new(scene.title(&heading), columns, rows, notes, drawing)
}

/// Names of the LiDARs of rigs: number and mount, or the number alone where mounts differ from rig to rig.
fn names_of<'r>(scene: &StudyScene, rigs: impl Iterator<Item = &'r Placement>) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for rig in rigs {
        let of_rig = scene.lidar_names(rig);
        for (lidar, name) in of_rig.into_iter().enumerate() {
            match names.get_mut(lidar) {
                Some(known) if *known != name => *known = format!("LiDAR {lidar}"),
                Some(_) => {}
                None => names.push(name),
            }
        }
    }
    names
}

/// Own rigs with each LiDAR lost in turn: the objective, requirements that fail, and sectors that become blind.
fn own_rigs(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let (rigs, objective) = (&scene.settings.placements, &scene.settings.objective);
    let most = rigs.iter().map(|rig| rig.lidars.len()).max().unwrap_or(0);
    let mut evaluator = scene.evaluator()?;
    let named = rigs.iter().map(|rig| (rig.name.clone(), rig)).collect();
    let mut looked: HashMap<String, Losses> = HashMap::new();
    let rows = cases.each(named, |rig: &Placement, _| {
        let losses = scene.losses(&mut evaluator, rig)?;
        let (_, factor) = shown_objective(objective);
        let value = |scores| objective.value(scores).map(|value| factor * value);
        let left: Vec<Option<f64>> = losses.losses.iter().map(|loss| value(&loss.scores)).collect();
        let worst = left.iter().try_fold(f64::INFINITY, |worst, value| Some(worst.min((*value)?)));
        let most_unmet = losses.losses.iter().map(|loss| loss.unmet().count()).max();
        let blind = losses.losses.iter().filter_map(Loss::blind_degrees).reduce(f64::max);
        let mut values = vec![value(&losses.scores), worst.filter(|worst| worst.is_finite())];
        values.extend(left);
        values.resize(OF_VALUE.len() + most, None);
        values.extend([most_unmet.map(|count| count as f64), blind]);
        let row = Row::scored(values, rig.clone(), &losses.scores);
        let each = losses.losses.iter();
        let after = each.map(|of| AfterLoss::new(of.lidar, of.name.clone(), &of.scores));
        let after_loss = after.collect();
        let note = (rig.lidars.len() == 1).then(|| NOTHING_LEFT.to_owned());
        let row = Row { unmet_at: unmet_at(&losses, objective), after_loss, note, ..row };
        looked.insert(rig.name.clone(), losses);
        Ok(row)
    })?;
    let (mut notes, mut between) = (Vec::new(), RangeCard::between_in_words(None));
    for rig in rows.iter().filter_map(|row| row.placement.as_ref()) {
        // Rows of an interrupted study are known without their losses.
        let losses = match looked.remove(&rig.name) {
            Some(losses) => losses,
            None => scene.losses(&mut evaluator, rig)?,
        };
        let card = losses.scores.range_card.as_ref();
        between = card.map_or(between, |card| RangeCard::between_in_words(Some(card)));
        let known: Vec<String> = losses.blind().iter().map(BlindSector::to_string).collect();
        if !known.is_empty() {
            notes.push(format!("{} with all LiDARs already: {}", rig.name, known.join("; ")));
        }
        for loss in &losses.losses {
            let told = loss.told();
            if !told.is_empty() {
                notes.push(format!("{} without {}: {}", rig.name, loss.name, told.join("; ")));
            }
        }
    }
    let (title, _) = shown_objective(objective);
    notes.push(format!(
        "{title} with one LiDAR failed. most not met: most requirements that a loss leaves unmet; one that must \
         hold without any one LiDAR is looked at with this one lost. already: missed with all LiDARs, too. most blind °: \
         width of the sectors of 30° in which a car is lost somewhere {between}, after the loss that leaves most."
    ));
    Ok(table(scene, &names_of(scene, rigs.iter()), &OF_OWN, rows, notes))
}

/// Values of [`OF_VALUE`] and of each loss, by number, beside which a requirement is not met.
fn unmet_at(losses: &Losses, objective: &Objective) -> Vec<usize> {
    let value = |loss: &&Loss| objective.value(&loss.scores).unwrap_or(f64::INFINITY);
    let is_unmet = |loss: &Loss| loss.unmet().next().is_some();
    let worst = losses.losses.iter().min_by(|a, b| value(a).total_cmp(&value(b)));
    let first = [!losses.is_met(), worst.is_some_and(is_unmet)];
    let each = first.into_iter().chain(losses.losses.iter().map(is_unmet));
    each.enumerate().filter(|(_, is_unmet)| *is_unmet).map(|(at, _)| at).collect()
}

pub(super) fn loss(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    if !scene.settings.placements.is_empty() {
        return own_rigs(scene, cases);
    }
    let lidars = scene.rig()?.constraints.lidars();
    if lidars < 2 {
        return Err(StudyError::OneLidar { scene: scene.place() });
    }
    let objective = &scene.settings.objective;
    let mut evaluator = scene.evaluator_of_rig()?;
    let both = OPTIMIZED.map(|name| (name.to_owned(), name)).to_vec();
    let rows = cases.each(both, |name, rows| {
        let found = if name == OPTIMIZED[0] {
            scene.optimize(&evaluator)?
        } else {
            most_robust(scene, &mut evaluator, rows)?
        };
        match found {
            Some(placement) => with_losses(scene, &mut evaluator, placement),
            None => Ok(scene.none_found()),
        }
    })?;
    let (title, _) = shown_objective(objective);
    let notes = vec![format!(
        "{title} with one LiDAR failed. The second placement was searched for the score that is left \
         after its worst loss, by {} evaluations without swaps; the first for the score of all. Requirements come first \
         in both.",
        scene.settings.evaluations
    )];
    let names: Vec<String> = (0..lidars).map(|lidar| format!("LiDAR {lidar}")).collect();
    Ok(table(scene, &names, &[], rows, notes))
}

/// The objective with all LiDARs, after the worst loss, and without each LiDAR in turn.
fn with_losses(
    scene: &StudyScene,
    evaluator: &mut Evaluator,
    placement: Placement,
) -> Result<Row, StudyError> {
    let objective = &scene.settings.objective;
    let all = scene.score(evaluator, &placement)?;
    let whole = objective.value(&all);
    let worst = after_worst_loss(scene, evaluator, std::slice::from_ref(&placement))?[0];
    let left = scene.scores(evaluator, &without_each(&placement))?;
    let mut values = vec![whole, worst];
    values.extend(left.iter().map(|scores| objective.value(scores)));
    let (_, factor) = shown_objective(objective);
    values.iter_mut().flatten().for_each(|value| *value *= factor);
    let names = scene.lidar_names(&placement);
    let after = left.iter().zip(names).enumerate();
    let after = after.map(|(lidar, (scores, name))| AfterLoss::new(lidar, name, scores));
    let after_loss = after.collect();
    Ok(Row { after_loss, ..Row::scored(values, placement, &all) })
}

/// The placement without each of its LiDARs in turn.
fn without_each(placement: &Placement) -> Vec<Placement> {
    (0..placement.lidars.len()).map(|lost| without(placement, lost)).collect()
}

/// The objective after the most valuable LiDAR has failed: the least over all single losses. `None`
/// where it does not exist after one of them, or a guard speaks against the other LiDARs.
fn after_worst_loss(
    scene: &StudyScene,
    evaluator: &mut Evaluator,
    placements: &[Placement],
) -> Result<Vec<Option<f64>>, StudyError> {
    let left: Vec<Placement> = placements.iter().flat_map(without_each).collect();
    // No closer look at targets: requirements are not asked.
    let scores = evaluator.scores_while(&left, &mut || scene.goes_on())?;
    let scores = scores.ok_or(StudyError::Stopped)?;
    let value = |s: &Scores| scene.settings.objective.value(s).filter(|_| s.doubts() == 0);
    let mut values = scores.iter().map(value);
    let worst = |placement: &Placement| {
        let each: Vec<Option<f64>> = values.by_ref().take(placement.lidars.len()).collect();
        each.into_iter().try_fold(f64::INFINITY, |worst, value| Some(worst.min(value?)))
    };
    Ok(placements.iter().map(worst).collect())
}

/// CMA-ES for the placement that is best after its worst loss, no worse than the placements of `rows` and the ones that
/// searches of the rig start from, at which it begins.
fn most_robust(
    scene: &StudyScene,
    evaluator: &mut Evaluator,
    rows: &[Row],
) -> Result<Option<Placement>, StudyError> {
    let rig = scene.rig()?;
    let constraints = &rig.constraints;
    let starts = rows.iter().filter_map(|row| row.placement.as_ref()).chain(&rig.starts);
    let usable = starts.filter(|p| constraints.violations(p).is_empty());
    let named = |lidars: Vec<SensorPose>| Placement { name: "robust".into(), lidars };
    let given: Vec<Placement> = usable.map(|start| named(start.lidars.clone())).collect();
    let starts: Vec<Vec<f64>> = given.iter().filter_map(|p| constraints.variables_of(p)).collect();
    let bounds = constraints.variable_bounds();
    let middle: Vec<f64> = bounds.iter().map(|(low, high)| 0.5 * (low + high)).collect();
    let seed = scene.settings.seed;
    let options = CmaOptions { seed, bounds: Some(bounds), ..CmaOptions::default() };
    let mut cma = Cma::new(&middle, STEP_SIZE, options).map_err(SearchError::from)?;
    cma.inject(&starts).map_err(SearchError::from)?;
    let mut best: Option<(f64, Placement)> = None;
    let requires = requires(evaluator.problem());
    let mut keep = |placements: &[Placement], costs: &[f64]| {
        for (placement, &cost) in placements.iter().zip(costs) {
            // A rig that meets all requirements comes before one that does not, with a value or without.
            let counts = cost < NO_VALUE || (requires && cost < BROKEN);
            if counts && best.as_ref().is_none_or(|(least, _)| cost < *least) {
                best = Some((cost, placement.clone()));
            }
        }
    };
    // The CMA-ES moves starts that are far from its mean.
    keep(&given, &costs(scene, evaluator, constraints, &given)?);
    let mut evaluations = given.len() as u64;
    while evaluations < scene.settings.evaluations && cma.stop().is_none() && scene.goes_on() {
        let candidates = cma.ask();
        let poses = candidates.iter().map(|candidate| constraints.poses_of(candidate.point()));
        let placements: Vec<Placement> = poses.map(named).collect();
        let costs = costs(scene, evaluator, constraints, &placements)?;
        keep(&placements, &costs);
        cma.tell(&candidates, &costs).map_err(SearchError::from)?;
        evaluations += candidates.len() as u64;
    }
    Ok(best.map(|(_, placement)| placement))
}

fn requires(problem: &Problem) -> bool {
    !problem.content().areas().is_empty() || problem.requires_sight()
}

/// −objective after the worst loss; rules come before requirements, these before guards, and guards before the objective.
fn costs(
    scene: &StudyScene,
    evaluator: &mut Evaluator,
    constraints: &Constraints,
    placements: &[Placement],
) -> Result<Vec<f64>, StudyError> {
    let broken = |p: &Placement| constraints.violations(p).iter().map(|v| v.amount()).sum::<f64>();
    let broken: Vec<f64> = placements.iter().map(broken).collect();
    let keeps_rules =
        |(placement, &broken): (&Placement, &f64)| (broken == 0.0).then(|| placement.clone());
    let kept: Vec<Placement> = placements.iter().zip(&broken).filter_map(keeps_rules).collect();
    let missing: Vec<f64> = match requires(evaluator.problem()) {
        true => scene.scores(evaluator, &kept)?.iter().map(Scores::missing).collect(),
        false => vec![0.0; kept.len()],
    };
    let values = after_worst_loss(scene, evaluator, &kept)?;
    let mut kept = missing.into_iter().zip(values);
    let cost = |&broken: &f64| match broken {
        0.0 => kept.next().map_or(NO_VALUE, |(missing, value)| cost_of(missing, value)),
        amount => f64::MAX.min(BROKEN * (1.0 + amount)),
    };
    Ok(broken.iter().map(cost).collect())
}

/// Cost of a candidate that keeps the rules, by its missing share of requirements and its value after the worst loss.
fn cost_of(missing: f64, value: Option<f64>) -> f64 {
    match value {
        _ if missing > 0.0 => MISSED * (1.0 + missing),
        Some(value) => -value,
        None => NO_VALUE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requirements_come_after_rules_and_before_guards_and_values() {
        let costs = [
            cost_of(0.0, Some(0.5)),
            cost_of(0.0, Some(0.1)),
            cost_of(0.0, None),
            cost_of(0.1, Some(0.9)),
            cost_of(0.4, Some(0.9)),
            cost_of(100.0, None),
            BROKEN,
        ];
        assert!(costs.is_sorted_by(|a, b| a < b), "{costs:?}");
    }
}
