//! Which sensor: numbers of channels over one field of view, and sensors from files.

use super::cases::Cases;
use super::columns::{self, SCORES, check_distinct};
use super::scene::StudyScene;
use super::{Drawing, StudyError, Table};
use crate::vehicle::Lidar;

/// Channels that are compared over the scene's own field of view.
const CHANNELS: [u32; 4] = [16, 32, 64, 128];

pub(super) fn channels(scene: &StudyScene, cases: &mut Cases) -> Result<Table, StudyError> {
    let Lidar::Spinning { elevations, azimuth_steps, azimuth, range, .. } = scene.scene.lidar()
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
    for path in &scene.settings.sensors {
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let mut lidar = Lidar::from_sensor_file(path, *azimuth_steps, *range)?;
        if let Lidar::Spinning { azimuth: sector, .. } = &mut lidar {
            *sector = *azimuth;
        }
        sensors.push((name, lidar));
    }
    let names = sensors.iter().map(|(name, _)| name.as_str());
    check_distinct(names, "sensors", "rename one of the files")?;
    let rows = cases.each(sensors, |lidar, _| {
        let table = lidar.table()?;
        let beams = table.directions().len();
        let mut evaluator = scene.evaluator_with(table, scene.constraints())?;
        let (mut values, best) = columns::of_best(scene, &mut evaluator)?;
        values.insert(0, Some(beams as f64));
        Ok((values, best))
    })?;
    let notes = vec![format!(
        "Evenly spaced channels from {low}° to {high}°, as the scene's own; every sensor turns in {} \
         steps and sees {} m far, so that elevations alone differ.",
        azimuth_steps, range
    )];
    let title = scene.title("the best placement of each sensor");
    let columns = ["sensor", "beams a LiDAR"].into_iter().chain(SCORES);
    Ok(Table::new(title, columns, rows, notes, Drawing::of_column(1, SCORES[0], true)))
}
