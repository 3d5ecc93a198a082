//! Sensors: numbers of channels over one field of view, and models from files.

use super::cases::Cases;
use super::columns::{self, SCORES, check_distinct, made_large};
use super::scene::StudyScene;
use super::{StudyError, Table, TablePlot};
use crate::maths;
use crate::near_field::NearSite;
use crate::search::Evaluator;
use crate::vehicle::{Lidar, Placement};

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

pub(super) fn channels(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let Lidar::Spinning { elevations, azimuth_steps, azimuth, range, .. } = scene.scene.lidars()[0]
    else {
        return Err(StudyError::NoChannels { scene: scene.place() });
    };
    let fold = |f: fn(f64, f64) -> f64| elevations.iter().copied().reduce(f).unwrap_or(0.0);
    let (low, high) = (fold(f64::min), fold(f64::max));
    let mut sensors = Vec::new();
    for count in CHANNELS {
        let step = (high - low) / f64::from(count - 1);
        let lidar = Lidar::Spinning {
            elevations: (0..count).map(|k| low + f64::from(k) * step).collect(),
            azimuth_offsets: vec![0.0; count as usize],
            azimuth_steps: *azimuth_steps,
            azimuth: *azimuth,
            range: *range,
        };
        sensors.push((format!("{count} channels"), lidar));
    }
    sensors.extend(crowded_sensors(scene.scene.lidars()[0], [low, high]));
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
    let rows = cases.each(sensors, |lidar, _| {
        let table = lidar.table()?;
        let beams = table.directions().len();
        let sensors = scene.scene.sensors()?.with_beams(0, table);
        let mut evaluator = scene.evaluator_with(&sensors)?;
        let mut row = columns::of_best(scene, &mut evaluator)?;
        if let Some(best) = &row.placement {
            row.values.extend(near_field(scene, &mut evaluator, best)?);
            row.values.insert(0, Some(beams as f64));
        }
        Ok(row)
    })?;
    let mut notes = vec![format!(
        "Channels from {low}° to {high}°, as the scene's own, evenly spaced, or drawn to the horizon: the share x \
         of the way from there to an end becomes x to the power given. Every sensor turns in {} steps and sees \
         {} m far, so that elevations alone differ.",
        azimuth_steps, range
    )];
    if let [first, _, ..] = &scene.scene.vehicle().sensors[..] {
        notes.push(format!(
            "The sensor that differs is `{}`, the vehicle's first model; its others stay as they are.",
            first.name
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
