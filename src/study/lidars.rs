//! Number of LiDARs: the best placement of each number, and the gain of each one more.

use super::cases::Cases;
use super::columns::{self, SCORES, made_large};
use super::rig::{EquipmentChoice, SearchSpace};
use super::scene::StudyScene;
use super::{Row, StudyError, Table, TablePlot};
use crate::search::{Equipped, Limits};
use crate::vehicle::{Constraints, Equipment, Placement, Vehicle};

/// Numbers of LiDARs that are compared.
const LIDARS: std::ops::RangeInclusive<usize> = 1..=8;
/// Columns of [`SCORES`] that grow with every LiDAR: the gain and the near gain.
const GAINS: [usize; 2] = [0, 1];
/// Columns behind [`SCORES`]: LiDARs that the rig of a vehicle has, and their price.
const TAKEN: [&str; 2] = ["LiDARs taken", "price"];

pub(super) fn lidars(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let counts = LIDARS.map(|count| (count.to_string(), count)).collect();
    let (mut choice, mut last) = (None, None);
    let mut rows = cases.each(counts, |count, rows| {
        if scene.scene.vehicle().is_nameless() {
            one_more(scene, count, rows)
        } else {
            chosen(scene, count, &mut choice, &mut last)
        }
    })?;
    // Each gain gets a column of its increments beside it; the knee is taken of the gain that the searches maximize.
    let gains = GAINS.map(|gain| columns::numbers(&rows, gain));
    for (k, row) in rows.iter_mut().enumerate() {
        row.values.resize(SCORES.len() + TAKEN.len(), None);
        for (gain, gains) in GAINS.into_iter().zip(&gains).rev() {
            // Numbers before the first that the mounts allow gain nothing.
            let before = gains[..k].last().filter(|_| !gains[..k].iter().all(|g| g.is_nan()));
            let before = before.copied().unwrap_or(0.0);
            row.values.insert(gain + 1, Some(gains[k] - before).filter(|more| !more.is_nan()));
        }
    }
    let marginal = ["marginal gain %", "marginal near gain %"];
    let of_gains = GAINS.into_iter().zip(marginal).flat_map(|(gain, more)| [SCORES[gain], more]);
    let columns = ["LiDARs"].into_iter().chain(of_gains).chain(SCORES[GAINS.len()..].to_vec());
    let columns = columns.chain(TAKEN);
    let drawn = usize::from(made_large(&scene.settings.objective) == GAINS[1]);
    let drawing = TablePlot::of_column(2 * drawn, SCORES[drawn], true);
    let title = scene.title("the best placement of each number of LiDARs");
    let known: Vec<f64> = gains[drawn].iter().copied().take_while(|gain| !gain.is_nan()).collect();
    let mut notes = notes(scene, SCORES[drawn], &known);
    notes.extend(repeated(&rows));
    Ok(Table::new(title, columns, rows, notes, drawing))
}

/// Sentences on rows that repeat the rig of the row before.
fn repeated(rows: &[Row]) -> Vec<String> {
    let is_again = |a: &Row, b: &Row| match (&a.placement, &b.placement) {
        (Some(a), Some(b)) => a.lidars == b.lidars,
        _ => false,
    };
    let told = rows.chunk_by(is_again).filter(|alike| alike.len() > 1).map(|alike| {
        let names: Vec<&str> = alike[1..].iter().map(|row| &*row.name).collect();
        let rows = if names.len() == 1 { "Row" } else { "Rows" };
        let repeat = if names.len() == 1 { "repeats" } else { "repeat" };
        format!(
            "{rows} {} {repeat} the rig of {}: no more are taken.",
            names.join(", "),
            alike[0].name
        )
    });
    told.collect()
}

/// The best placement of a number of the scene's own LiDARs.
fn one_more(scene: &StudyScene, count: usize, rows: &[Row]) -> Result<Row, StudyError> {
    let constraints = scene.constraints().with_lidars(count);
    // The best of one LiDAR less, with one more at each corner of the mount in turn.
    let mut starts = scene.layouts.clone();
    let before = rows.last().and_then(|row| row.placement.as_ref());
    starts.extend(before.iter().flat_map(|before| with_one_more(scene, before)));
    searched(scene, &constraints, &starts)
}

/// The best rig of a vehicle with a number of LiDARs at most, as its mounts, its symmetry and the budget allow.
fn chosen(
    scene: &StudyScene,
    count: usize,
    choice: &mut Option<EquipmentChoice>,
    last: &mut Option<(Equipped, Row)>,
) -> Result<Row, StudyError> {
    let vehicle = scene.scene.vehicle();
    let sum = |end: usize| vehicle.mounts.iter().map(|mount| mount.count[end]).sum::<usize>();
    let (least, most) = (sum(0), sum(1));
    if count < least {
        let why = format!("the mounts of {} must hold {least} LiDARs or more", vehicle.name);
        return Ok(Row::unanswered(why));
    }
    if count > most {
        let why = format!("the mounts of {} hold {most} LiDARs at most", vehicle.name);
        return Ok(Row::unanswered(why));
    }
    let choice = match choice {
        Some(choice) => choice,
        none => none.insert(EquipmentChoice::open(scene)?),
    };
    let limits = Limits { sensors: count, ..scene.limits() };
    let equipped = choice.best(scene, limits)?;
    if !is_whole(vehicle, &equipped.equipment) {
        let pairs = if vehicle.ties.symmetric { ", as LiDARs come in mirrored pairs" } else { "" };
        let why = format!(
            "the mounts of {} hold no rig of {count} or fewer within rules and budget{pairs}",
            vehicle.name
        );
        return Ok(Row::unanswered(why));
    }
    // Equal sensors on equal poses would be searched alike.
    if let Some((_, row)) = last.as_ref().filter(|(known, _)| *known == equipped) {
        return Ok(row.clone());
    }
    let SearchSpace { constraints, starts, .. } = SearchSpace::of(scene, &equipped);
    let mut row = searched(scene, &constraints, &starts)?;
    if row.placement.is_some() {
        row.values.extend([Some(equipped.equipment.len() as f64), Some(equipped.cost)]);
    }
    *last = Some((equipped, row.clone()));
    Ok(row)
}

/// True if there is a sensor, and each mount holds the number that it must.
fn is_whole(vehicle: &Vehicle, equipment: &Equipment) -> bool {
    let on = |mount: usize| equipment.iter().filter(|(k, _)| *k == mount).count();
    let mut mounts = vehicle.mounts.iter().enumerate();
    !equipment.is_empty() && mounts.all(|(k, mount)| on(k) >= mount.count[0])
}

/// The best placement under some rules, and its scores.
fn searched(
    scene: &StudyScene,
    constraints: &Constraints,
    starts: &[Placement],
) -> Result<Row, StudyError> {
    let mut evaluator = scene.evaluator_under(constraints)?;
    let best = scene.optimize_from(&evaluator, &scene.settings.objective, starts)?;
    let Some(best) = best else { return Ok(scene.none_found()) };
    let scores = scene.score(&mut evaluator, &best)?;
    Ok(Row::scored(columns::values(&scores), best, &scores))
}

fn notes(scene: &StudyScene, drawn: &str, gains: &[f64]) -> Vec<String> {
    let mut notes = vec![format!(
        "Each number has its own search of {} evaluations for `{}`; where a value falls, raise --evaluations.",
        scene.settings.evaluations, scene.settings.objective
    )];
    let vehicle = scene.scene.vehicle();
    if !vehicle.is_nameless() {
        notes.push(format!(
            "Models and mounts of each number are chosen as far as {} allows, requirements before gain, so that a gain \
             may fall; fewer are taken where one more adds nothing, costs too much or needs its mirror image.",
            vehicle.name
        ));
    }
    let from_none: Vec<f64> = std::iter::once(0.0).chain(gains.iter().copied()).collect();
    if let Some(knee) = knee(&from_none) {
        notes.push(format!(
            "The {} bends most at {knee} LiDAR(s): up to there each adds more than the average of all {}.",
            drawn.trim_end_matches(" %"),
            gains.len()
        ));
    }
    notes
}

/// A placement with one more LiDAR at each corner of the mount's box.
fn with_one_more(scene: &StudyScene, before: &Placement) -> Vec<Placement> {
    let [low, high] = scene.constraints().corners();
    let corners = (0..8).map(|corner| {
        let mut pose = before.lidars[0];
        let side = |k: usize| if corner >> k & 1 == 1 { high[k] } else { low[k] };
        (pose.x, pose.y, pose.z) = (side(0), side(1), side(2));
        let lidars = before.lidars.iter().copied().chain([pose]).collect();
        Placement { name: format!("corner-{corner}"), lidars }
    });
    corners.collect()
}

/// Index at which a curve of falling gains bends most: the point farthest above the line from the first to the last,
/// after both axes are scaled to [0, 1]. `None` with fewer than three points or without rise.
fn knee(values: &[f64]) -> Option<usize> {
    let (first, last) = (*values.first()?, *values.last()?);
    if values.len() < 3 || last <= first {
        return None;
    }
    let steps = (values.len() - 1) as f64;
    let above = |k: usize| (values[k] - first) / (last - first) - k as f64 / steps;
    (1..values.len() - 1).max_by(|&a, &b| above(a).total_cmp(&above(b))).filter(|&k| above(k) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_knee_is_where_the_curve_bends() {
        assert_eq!(knee(&[0.0, 8.0, 9.0, 9.5, 10.0]), Some(1));
        assert_eq!(knee(&[0.0, 1.0, 2.0]), None, "a line has no knee");
        assert_eq!(knee(&[3.0, 2.0, 1.0]), None);
    }
}
