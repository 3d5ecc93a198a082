//! Sensors: numbers of channels over one field of view, and models from files.

use super::scene::StudyScene;
use super::table::{Cases, SCORES, check_distinct, made_large};
use super::{Row, StudyError, Table, TablePlot, table};
use crate::engine::BackendError;
use crate::job::{Job, JobError};
use crate::maths;
use crate::near_field::NearSite;
use crate::scan::conditions::Condition;
use crate::search::Evaluator;
use crate::targets::{CARD_BEAMS, RangeCard};
use crate::vehicle::{Lidar, Placement, VehicleSensor};

/// Channels that are compared over the scene's own field of view.
const CHANNELS: [u32; 4] = [16, 32, 64, 128];

/// Ground within 10 m and within 3 m that is seen: the cost of crowding channels at the horizon.
const NEAR_COLUMNS: [&str; 2] = ["near %", "3 m %"];

/// Powers by which the elevations of the scene's own number of channels are crowded at the horizon.
const CROWDED: [f64; 3] = [1.25, 1.5, 2.0];

/// An elevation in degrees, drawn to the horizon: a share x of the way from there to the end of the field of view
/// becomes x^power. The ends stay where they are.
fn crowded(elevation: f64, [low, high]: [f64; 2], power: f64) -> f64 {
    let end = if elevation < 0.0 { low } else { high };
    end * maths::pow(elevation / end, power)
}

/// The scene's own sensor with its elevations crowded; none where no channel lies to one side of the horizon.
fn crowded_sensors(lidar: &Lidar, [low, high]: [f64; 2]) -> Vec<(String, Lidar)> {
    let Lidar::Spinning { elevations, .. } = lidar else { return Vec::new() };
    let count = elevations.len();
    if count < 2 || low >= 0.0 || high <= 0.0 {
        return Vec::new();
    }
    let even = |k: usize| low + k as f64 * (high - low) / (count - 1) as f64;
    let sensor = |power: f64| {
        let mut lidar = lidar.clone();
        if let Lidar::Spinning { elevations, azimuth_offsets, .. } = &mut lidar {
            *elevations = (0..count).map(|k| crowded(even(k), [low, high], power)).collect();
            azimuth_offsets.fill(0.0);
        }
        (format!("{count} channels, crowded to the power of {power}"), lidar)
    };
    CROWDED.into_iter().map(sensor).collect()
}

/// Values of [`NEAR_COLUMNS`] of a placement; none in a scene without a near field.
fn near_field(
    scene: &StudyScene,
    evaluator: &mut Evaluator,
    placement: &Placement,
) -> Result<[Option<f64>; 2], StudyError> {
    let problem = evaluator.shared_problem();
    let Ok(site) = NearSite::new(scene.scene, &problem) else { return Ok([None; 2]) };
    let near = site.look(evaluator.backend_mut(), placement)?;
    Ok([Some(near.near_field), near.ring].map(|share| share.map(|share| 100.0 * share)))
}

/// Sensors to compare: some numbers of channels spaced evenly over the field of view, the scene's own number crowded at
/// the horizon, and the models of the files; and a note about them.
fn compared_sensors(
    scene: &StudyScene,
    model: usize,
) -> Result<(Vec<(String, Lidar)>, String), StudyError> {
    let own = scene.scene.lidars()[model];
    let Lidar::Spinning { elevations, azimuth_steps, azimuth, range, .. } = own else {
        return Err(StudyError::NoChannels { scene: scene.place() });
    };
    let fold = |f: fn(f64, f64) -> f64| elevations.iter().copied().reduce(f).unwrap_or(0.0);
    let (low, high) = (fold(f64::min), fold(f64::max));
    let even = |count: u32| {
        let step = (high - low) / f64::from(count - 1);
        let lidar = Lidar::Spinning {
            elevations: (0..count).map(|k| low + f64::from(k) * step).collect(),
            azimuth_offsets: vec![0.0; count as usize],
            azimuth_steps: *azimuth_steps,
            azimuth: *azimuth,
            range: *range,
        };
        (format!("{count} channels"), lidar)
    };
    let mut sensors: Vec<(String, Lidar)> = CHANNELS.into_iter().map(even).collect();
    sensors.extend(crowded_sensors(own, [low, high]));
    for path in &scene.settings.sensors {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut lidar = Lidar::from_sensor_file(path, *azimuth_steps, *range)?;
        // A window set in the file is kept.
        if let Lidar::Spinning { azimuth: sector @ None, .. } = &mut lidar {
            *sector = *azimuth;
        }
        sensors.push((name, lidar));
    }
    let names = sensors.iter().map(|(name, _)| name.as_str());
    check_distinct(names, "sensors", "rename one of the files")?;
    let note = format!(
        "Channels from {low}° to {high}°, as the scene's own, evenly spaced, or drawn to the horizon: the share x \
         of the way from there to an end becomes x to the power given. Every sensor turns in {azimuth_steps} steps and \
         sees {range} m far, so that elevations alone differ."
    );
    Ok((sensors, note))
}

/// Number of the first model with channels that the searched rig has.
fn varied_model(scene: &StudyScene) -> Result<usize, StudyError> {
    let kinds = scene.rig()?.constraints.kinds();
    let varies = |model: &VehicleSensor| {
        matches!(model.lidar, Lidar::Spinning { .. })
            && kinds.iter().any(|(slot, _)| slot.sensor == model.name)
    };
    let found = scene.scene.vehicle().sensors.iter().position(varies);
    found.ok_or_else(|| StudyError::NoChannels { scene: scene.place() })
}

pub(super) fn channels(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let model = varied_model(scene)?;
    let (sensors, note) = compared_sensors(scene, model)?;
    let rows = cases.each(sensors, |lidar, _| {
        let table = lidar.table()?;
        let beams = table.directions().len();
        let sensors = scene.scene.sensors()?.with_beams(model, table);
        let job = scene.job.clone().sensors(&sensors).constraints(&scene.rig()?.constraints);
        let mut evaluator = scene.open(&job)?;
        let mut row = table::of_best(scene, &mut evaluator, &scene.rig()?.starts)?;
        if let Some(best) = &row.placement {
            row.values.extend(near_field(scene, &mut evaluator, best)?);
            row.values.insert(0, Some(beams as f64));
        }
        Ok(row)
    })?;
    let mut notes = vec![note];
    if let models @ [_, _, ..] = &scene.scene.vehicle().sensors[..] {
        notes.push(format!(
            "The sensor that differs is `{}`, the first model with channels of the rig; its others stay as they are.",
            models[model].name
        ));
    }
    if let Err(why) = NearSite::new(scene.scene, &scene.evaluator()?.shared_problem()) {
        notes.push(format!("No near field: {why}."));
    }
    let title = scene.title("the best placement of each sensor");
    let columns = ["sensor", "beams a LiDAR"].into_iter().chain(SCORES).chain(NEAR_COLUMNS);
    let drawn = made_large(&scene.settings.objective);
    Ok(Table::new(
        title,
        columns,
        rows,
        notes,
        TablePlot::of_column(1 + drawn, SCORES[drawn], true),
    ))
}

/// Conditions without any in the settings, at their usual strengths.
const USUAL: [&str; 3] = ["fog", "snow", "rain"];
/// Columns after the scores.
const LAST: [&str; 2] = ["count not met", "car ahead m"];

pub(super) fn weather(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let skies = skies(&scene.settings.conditions)?;
    let mut named = Vec::new();
    for (index, (sky, condition)) in skies.iter().enumerate() {
        let rigs = scene.some_layouts()?.iter();
        named.extend(rigs.map(|rig| (format!("{}, {sky}", rig.name), (index, condition, rig))));
    }
    let mut open: Option<(usize, Job, Evaluator)> = None;
    let rows = cases.each(named, |(index, condition, rig), _| {
        // One engine at a time: rigs under one condition follow each other.
        let (_, job, evaluator) = match open.take() {
            Some(known) if known.0 == index => open.insert(known),
            _ => {
                let job = scene.job.clone().conditions(condition);
                let evaluator = scene.open(&job)?;
                open.insert((index, job, evaluator))
            }
        };
        row(scene, (job, evaluator), condition, rig)
    })?;
    let notes = vec![
        "Each condition for itself. Clear air limits no beam, as `score` without --condition does; under a condition a \
         beam counts that its sensor's echo model returns. count not met: requirements."
            .to_owned(),
        format!(
            "car ahead m: end of the first stretch of the range card's distances (every 2.5 m to 20 m, every 5 m to 60 m, then \
             every 10 m) at each of which a car straight ahead has {CARD_BEAMS} beams or more, from the origin on level ground; \
             0 where there is none. Conditions other than fog, snow and rain have no such number."
        ),
    ];
    let drawn = made_large(&scene.settings.objective);
    let columns = std::iter::once("placement").chain(SCORES).chain(LAST);
    let title = scene.title("rigs in weather");
    Ok(Table::new(title, columns, rows, notes, TablePlot::of_column(drawn, SCORES[drawn], false)))
}

/// Clear air and each condition, by name.
fn skies(given: &[Condition]) -> Result<Vec<(String, Vec<Condition>)>, StudyError> {
    let usual = USUAL.iter().map(|name| name.parse());
    let all = match given {
        [] => usual.collect::<Result<_, _>>().map_err(JobError::Scan)?,
        given => given.to_vec(),
    };
    let named = all.into_iter().map(|one: Condition| (one.to_string(), vec![one]));
    let skies: Vec<_> = std::iter::once(("clear".to_owned(), Vec::new())).chain(named).collect();
    let names = skies.iter().map(|(name, _)| &**name);
    check_distinct(names, "conditions", "give each --condition once")?;
    Ok(skies)
}

/// Scores of a rig under a condition, requirements that it misses, and the range of a car ahead.
fn row(
    scene: &StudyScene,
    (job, evaluator): (&Job, &mut Evaluator),
    condition: &[Condition],
    rig: &Placement,
) -> Result<Row, StudyError> {
    let scores = scene.score(evaluator, rig)?;
    let not_met = scores.required.iter().filter(|seen| !seen.is_met()).count() as f64;
    let mut values = table::values(&scores);
    values.push((!scores.required.is_empty()).then_some(not_met));
    if condition.iter().all(Condition::dims_light) {
        let card = job.target_site()?.map(|site| RangeCard::new(site, &rig.lidars)).transpose();
        let card = card.map_err(BackendError::from)?;
        let ahead = card.as_ref().and_then(|card| card.targets.first()?.bearings.first());
        values.push(ahead.map(|ahead| ahead.met.first().map_or(0.0, |[_, to]| *to)));
    }
    Ok(Row::scored(values, rig.clone(), &scores))
}
