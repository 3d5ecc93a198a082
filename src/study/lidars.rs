//! Number of LiDARs: the best placement of each number, and the gain of each one more.

use super::scene::StudyScene;
use super::table::{Cases, SCORES, made_large};
use super::{Row, StudyError, Table, TablePlot, table};
use crate::json::counted;
use crate::search::{EquipStep, Equipped, Equipping, Event, Limits, Settings, cost_front};
use crate::vehicle::{Constraints, Equipment, Placement, Vehicle, is_within_budget};

/// Numbers of LiDARs that are compared.
const LIDARS: std::ops::RangeInclusive<usize> = 1..=8;
/// Columns of [`SCORES`] that grow with every LiDAR: the gain and the near gain.
const GAINS: [usize; 2] = [0, 1];
/// Columns behind [`SCORES`]: LiDARs that the rig of a vehicle has, and their price.
const TAKEN: [&str; 2] = ["LiDARs taken", "price"];
/// Note of a row with fewer LiDARs than its number, where money is why.
const PAYS_NO_MORE: &str = "the budget pays for no more LiDARs beside these";

pub(super) fn lidars(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let held = held(scene.scene.vehicle());
    let counts: Vec<usize> = LIDARS.filter(|count| held.contains(count)).collect();
    // Where the mounts hold none of these numbers each row says so.
    let counts = if counts.is_empty() { LIDARS.collect() } else { counts };
    let left_out = counts.len() < LIDARS.count();
    let counts = counts.into_iter().map(|count| (count.to_string(), count)).collect();
    let (mut choice, mut last) = (None, None);
    let mut rows = cases.each(counts, |count, rows| {
        if scene.scene.vehicle().is_nameless() {
            one_more(scene, count, rows)
        } else {
            chosen(scene, count, &mut choice, &mut last)
        }
    })?;
    // Each gain gets a column of its increments beside it; the knee is taken of the gain that the searches maximize.
    let gains = GAINS.map(|gain| table::numbers(&rows, gain));
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
    notes.extend(left_out.then(|| {
        let [least, most] = [held.start(), held.end()];
        format!(
            "Left out are numbers that the mounts do not hold: they take {least} to {most} LiDARs."
        )
    }));
    Ok(Table::new(title, columns, rows, notes, drawing))
}

/// Numbers of LiDARs that the mounts of a vehicle hold together; any number on one without names.
fn held(vehicle: &Vehicle) -> std::ops::RangeInclusive<usize> {
    if vehicle.is_nameless() {
        return 0..=usize::MAX;
    }
    let sum = |end: usize| vehicle.mounts.iter().map(|mount| mount.count[end]).sum::<usize>();
    sum(0)..=sum(1)
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
    let constraints = scene.scene.constraints().with_lidars(count);
    // The best of one LiDAR less, with one more at each corner of the mount in turn.
    let mut starts = scene.layouts.clone();
    let before = rows.last().and_then(|row| row.placement.as_ref());
    starts.extend(before.iter().flat_map(|before| with_one_more(scene, before)));
    table::of_best(scene, &mut scene.evaluator_under(&constraints)?, &starts)
}

/// The best rig of a vehicle with a number of LiDARs at most, as its mounts, its symmetry and the budget allow.
fn chosen(
    scene: &StudyScene,
    count: usize,
    choice: &mut Option<EquipmentChoice>,
    last: &mut Option<(Equipped, Row)>,
) -> Result<Row, StudyError> {
    let vehicle = scene.scene.vehicle();
    let least = *held(vehicle).start();
    if count < least {
        let why = format!("the mounts of {} must hold {least} LiDARs or more", vehicle.name);
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
    let is_poor = equipped.equipment.len() < count && is_spent(vehicle, &equipped, limits.budget);
    let note = is_poor.then(|| PAYS_NO_MORE.to_owned());
    // Equal sensors on equal poses would be searched alike.
    if let Some((_, row)) = last.as_ref().filter(|(known, _)| *known == equipped) {
        return Ok(Row { note, ..row.clone() });
    }
    let SearchSpace { constraints, starts, .. } = SearchSpace::of(scene, &equipped);
    let mut row = table::of_best(scene, &mut scene.evaluator_under(&constraints)?, &starts)?;
    if row.placement.is_some() {
        row.values.extend([Some(equipped.equipment.len() as f64), Some(equipped.cost)]);
    }
    *last = Some((equipped, row.clone()));
    Ok(Row { note, ..row })
}

/// True if mounts could hold more LiDARs beside a rig, and the rest of the budget pays for none.
fn is_spent(vehicle: &Vehicle, equipped: &Equipped, budget: f64) -> bool {
    let open = equipped.open_mounts(vehicle);
    let is_dear = |price: f64| !is_within_budget(equipped.cost + price, budget);
    !open.is_empty() && open.iter().all(|mount| is_dear(mount.price))
}

/// True if there is a sensor, and each mount holds the number that it must.
fn is_whole(vehicle: &Vehicle, equipment: &Equipment) -> bool {
    let on = |mount: usize| equipment.iter().filter(|(k, _)| *k == mount).count();
    let mut mounts = vehicle.mounts.iter().enumerate();
    !equipment.is_empty() && mounts.all(|(k, mount)| on(k) >= mount.count[0])
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
            "The {} bends most at {}: up to there each adds more than the average of all {}.",
            drawn.trim_end_matches(" %"),
            counted(knee, "LiDAR"),
            gains.len()
        ));
    }
    notes
}

/// A placement with one more LiDAR at each corner of the mount's box.
fn with_one_more(scene: &StudyScene, before: &Placement) -> Vec<Placement> {
    let [low, high] = scene.scene.constraints().corners();
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

pub(super) fn cost(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let vehicle = scene.scene.vehicle();
    if vehicle.is_nameless() {
        return Err(StudyError::NoVehicle { scene: scene.place() });
    }
    let (suite, limits) = (scene.job.suite()?, scene.limits());
    let (objective, engine) = (&scene.settings.objective, &scene.settings.engine);
    let front = cost_front(&suite, vehicle, objective, limits, engine)?;
    let named: Vec<(String, Equipped)> = front
        .into_iter()
        .map(|equipped| (Equipped::words(&equipped.equipment, vehicle), equipped))
        .collect();
    let rows = cases.each(named, |equipped, _| {
        let SearchSpace { constraints, starts, .. } = SearchSpace::of(scene, &equipped);
        let mut evaluator = scene.evaluator_under(&constraints)?;
        let found = scene.optimize_from(&evaluator, objective, &starts)?;
        let best = found.unwrap_or_else(|| equipped.placement.clone());
        let scores = scene.score(&mut evaluator, &best)?;
        let mut values = vec![Some(equipped.cost)];
        values.extend(table::values(&scores));
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
    let columns =
        ["sensors", "price"].into_iter().chain(SCORES).chain(["LiDARs", "points missing"]);
    let drawn = made_large(&scene.settings.objective);
    let y_title = SCORES[drawn].to_owned();
    let drawing = TablePlot::Against { column: 1 + drawn, x_title: "price".to_owned(), y_title };
    Ok(Table::new(title, columns, rows, notes, drawing))
}

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
            let (constraints, starts) = (scene.scene.constraints(), scene.layouts.clone());
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
            &scene.job.suite()?,
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
            match self.0.step(&mut observer)? {
                EquipStep::On => {}
                EquipStep::Stopped => return Err(StudyError::Stopped),
                EquipStep::Done(found) | EquipStep::OutOfTime(found) => return Ok(found),
            }
        }
    }
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
