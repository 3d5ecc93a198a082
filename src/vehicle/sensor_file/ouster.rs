//! Ouster: the sensor's metadata JSON, flat (firmware 1 and 2) or nested (3 and later).
//!
//! In the sensor's frame, column m of W looks to the azimuth π + 2π(1 − m/W) − `beam_azimuth_angles`: offsets
//! count clockwise, and the columns are those of a turn in W steps (ouster-sdk, `XYZLut`).

use serde::Deserialize;

use super::pattern::{SensorFormat, SensorPattern, channels_of};
use crate::Note;
use crate::json::check::{self, bad};
use crate::json::{self, DescriptionError, Place};

/// Most columns of a frame.
const MAX_COLUMNS: u64 = 100_000;
/// The whole turn, as `azimuth_window` writes it in thousandths of a degree.
const TURN: [f64; 2] = [0.0, 360_000.0];

#[derive(Deserialize)]
struct Metadata {
    beam_intrinsics: Option<Beam>,
    sensor_info: Option<Info>,
    config_params: Option<Config>,
    lidar_data_format: Option<DataFormat>,
    data_format: Option<DataFormat>,
    lidar_intrinsics: Option<Extrinsics>,
    // Flat files have the rest at the top.
    prod_line: Option<String>,
    lidar_mode: Option<String>,
    lidar_to_sensor_transform: Option<Vec<f64>>,
    beam_altitude_angles: Option<Vec<f64>>,
    beam_azimuth_angles: Option<Vec<f64>>,
    lidar_origin_to_beam_origin_mm: Option<f64>,
}

#[derive(Deserialize)]
struct Beam {
    beam_altitude_angles: Option<Vec<f64>>,
    beam_azimuth_angles: Option<Vec<f64>>,
    lidar_origin_to_beam_origin_mm: Option<f64>,
}

#[derive(Deserialize)]
struct Info {
    prod_line: Option<String>,
}

#[derive(Deserialize)]
struct Config {
    lidar_mode: Option<String>,
    azimuth_window: Option<[f64; 2]>,
}

#[derive(Deserialize)]
struct DataFormat {
    columns_per_frame: Option<u64>,
}

#[derive(Deserialize)]
struct Extrinsics {
    lidar_to_sensor_transform: Option<Vec<f64>>,
}

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let file: Metadata = json::parse(text, &at.file)?;
    let (list, beam) = match file.beam_intrinsics {
        Some(beam) => (at.key("beam_intrinsics"), beam),
        None => (
            at.clone(),
            Beam {
                beam_altitude_angles: file.beam_altitude_angles,
                beam_azimuth_angles: file.beam_azimuth_angles,
                lidar_origin_to_beam_origin_mm: file.lidar_origin_to_beam_origin_mm,
            },
        ),
    };
    let places = ["beam_altitude_angles", "beam_azimuth_angles"].map(|key| (list.key(key), key));
    let lists = [beam.beam_altitude_angles, beam.beam_azimuth_angles];
    let [Some(elevations), Some(offsets)] = &lists else {
        let key = places[usize::from(lists[0].is_some())].1;
        let mend = "list the angles of all beams in degrees, as the sensor's metadata has them";
        return Err(DescriptionError::Missing { at: Box::new(list), key, mend: mend.to_owned() });
    };
    let beams = channels_of([&places[0].0, &places[1].0], elevations, offsets, -1.0)?;
    let (config_mode, window) = file
        .config_params
        .map_or((None, None), |config| (config.lidar_mode, config.azimuth_window));
    let format = file.lidar_data_format.or(file.data_format);
    let columns = format.and_then(|format| format.columns_per_frame);
    let model = file.sensor_info.and_then(|info| info.prod_line).or(file.prod_line);
    let transform = file.lidar_intrinsics.and_then(|lidar| lidar.lidar_to_sensor_transform);
    let transform = transform.or(file.lidar_to_sensor_transform);
    let height = transform.and_then(|matrix| matrix.get(11).copied());
    Ok(SensorPattern {
        model: model.map(|name| check::text(&at.key("prod_line"), name)).transpose()?,
        azimuth_steps: steps(at, columns, config_mode.or(file.lidar_mode).as_deref())?,
        notes: notes(beam.lidar_origin_to_beam_origin_mm, height, window),
        ..SensorPattern::new(SensorFormat::Ouster, beams)
    })
}

/// Columns of a frame: as stated, or those of a mode such as `1024x10`.
fn steps(
    at: &Place,
    columns: Option<u64>,
    mode: Option<&str>,
) -> Result<Option<u32>, DescriptionError> {
    if let Some(columns) = columns {
        return check::count(&at.key("columns_per_frame"), columns, 1, MAX_COLUMNS).map(Some);
    }
    let Some(mode) = mode else { return Ok(None) };
    match mode.split_once('x').and_then(|(columns, _)| columns.parse::<u64>().ok()) {
        Some(columns) => check::count(&at.key("lidar_mode"), columns, 1, MAX_COLUMNS).map(Some),
        None => Err(bad(&at.key("lidar_mode"), format!("{mode:?}"), "a mode such as \"1024x10\"")),
    }
}

fn notes(origin: Option<f64>, height: Option<f64>, window: Option<[f64; 2]>) -> Vec<Note> {
    let mut notes = Vec::new();
    if let Some(mm) = origin.filter(|mm| *mm != 0.0) {
        notes.push(Note::fact(format!(
            "Beams leave the sensor {mm} mm from its axis; all start at one origin here, and miss their \
             own lines by that times the sine of their azimuth offset."
        )));
    }
    if let Some(mm) = height.filter(|mm| *mm != 0.0) {
        notes.push(Note::fact(format!(
            "The origin of the beams lies {mm} mm above that of the sensor's frame; a pose here is that \
             of the beams."
        )));
    }
    if let Some([from, to]) = window.filter(|window| *window != TURN) {
        notes.push(Note::fact(format!(
            "The sensor was set to look from {} to {} degrees of its encoder; all of the turn is cast \
             unless `azimuth` is given.",
            from / 1000.0,
            to / 1000.0
        )));
    }
    notes
}
