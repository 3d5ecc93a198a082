//! Tables of channels: our own in JSON, and the calibration YAML of Velodyne's ROS drivers.
//!
//! Our own has one elevation and, if need be, one azimuth offset a channel. Velodyne's angles are radians. The driver
//! takes `rot_correction` off an azimuth that counts clockwise, so that a positive one turns counter-clockwise
//! (ros-drivers/velodyne, rawdata.cc).

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use serde::Deserialize;
use serde_json::Value;

use super::pattern::{
    self, Beams, MAX_COLUMNS, Measures, Passed, Rest, SensorFormat, SensorPattern, azimuth,
    channel, channels_of, check_count, degrees,
};
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{self, Checked, Location, Quantity, parse_yaml};

const READ: &str = "name elevation_deg azimuth_offset_deg azimuth_sign channels azimuth_steps columns_per_frame \
                    azimuth_window range min_range rated_range noise rate";
/// Largest azimuth offset in degrees of a sensor that has some: smaller ones are most likely radians.
const OFFSET: f64 = 0.2;
const PASSED: Passed = &[
    ("vendor source licence license prod_line lidar_mode", "words for people"),
    ("format elevation spacing half azimuth beams notes fov_deg", "follow from the lists"),
    (
        "lidar_origin_to_beam_origin_mm beam_to_lidar_transform lidar_to_sensor_transform \
         vert_offset_m horiz_offset_m distance_resolution_m",
        "all beams start at one origin, and ranges have no steps",
    ),
];

/// The file; keys beside these are notes.
#[derive(Deserialize)]
struct TableFile {
    name: Option<String>,
    elevation_deg: Vec<f64>,
    azimuth_offset_deg: Option<Vec<f64>>,
    azimuth_sign: Option<Value>,
    channels: Option<Value>,
    azimuth_steps: Option<u64>,
    columns_per_frame: Option<u64>,
    azimuth_window: Option<[f64; 2]>,
    range: Option<f64>,
    min_range: Option<f64>,
    rated_range: Option<f64>,
    noise: Option<f64>,
    rate: Option<f64>,
    #[serde(flatten)]
    rest: Rest,
}

pub(super) fn parse(at: &Location, text: &str) -> Checked<SensorPattern> {
    let table: TableFile = json::parse(text, &at.file)?;
    let elevations = table.elevation_deg;
    let offsets = table.azimuth_offset_deg.unwrap_or_else(|| vec![0.0; elevations.len()]);
    let places = [&at.key("elevation_deg"), &at.key("azimuth_offset_deg")];
    let beams = channels_of(places, &elevations, &offsets, 1.0)?;
    let number = |value: &Value| value.as_f64().or_else(|| value.as_str()?.trim().parse().ok());
    if let Some(count) = table.channels.as_ref().and_then(number)
        && count != elevations.len() as f64
    {
        let wanted =
            format!("the {} elevations that are listed; correct one of the two", elevations.len());
        return Err(check::bad(&at.key("channels"), count, wanted));
    }
    let model = table.name.map(|name| check::name(&at.key("name"), name)).transpose()?;
    let steps =
        [("azimuth_steps", table.azimuth_steps), ("columns_per_frame", table.columns_per_frame)];
    if let [(_, Some(steps)), (key, Some(columns))] = steps
        && steps != columns
    {
        let wanted = format!("{steps}, as `azimuth_steps` says; correct one of the two");
        return Err(check::bad(&at.key(key), columns, wanted));
    }
    let steps = steps.into_iter().find_map(|(key, steps)| Some((at.key(key), steps?)));
    let steps = steps.map(|(at, steps)| check::count(&at, steps, 1, MAX_COLUMNS));
    let window =
        table.azimuth_window.map(|ends| window(&at.key("azimuth_window"), ends)).transpose()?;
    let range = table.range.map(|range| check::range(&at.key("range"), range)).transpose()?;
    let rate = table.rate.map(|rate| check::rate(&at.key("rate"), rate)).transpose()?;
    let within = |key: &str, value, low, high| check::within(at, key, value, low, high);
    let measures = Measures {
        range,
        min_range: within("min_range", table.min_range, 0.0, range.unwrap_or(1e5))?,
        rated_range: within("rated_range", table.rated_range, 0.1, 1e5)?,
        noise: within("noise", table.noise, 0.0, 10.0)?,
        rate,
    };
    let mut notes: Vec<Note> =
        pattern::unknown_or_slip(at, &table.rest, PASSED, READ).into_iter().collect();
    // `sensor info` has written the file where it names a format, in degrees.
    let is_written = table.rest.keys().any(|key| key.as_ref() == "format");
    let doubt = offsets_in_radians(&at.key("azimuth_offset_deg"), &offsets);
    notes.extend(doubt.filter(|_| !is_written));
    notes.extend(pattern::rated_too_far(at, &measures, "range"));
    let sign = table.azimuth_sign.filter(|_| offsets.iter().any(|offset| *offset != 0.0));
    notes.extend(sign.map(|sentence| sign_note(&at.key("azimuth_sign"), &sentence)));
    Ok(SensorPattern {
        model,
        azimuth_steps: steps.transpose()?,
        azimuth: window,
        measures,
        notes,
        ..SensorPattern::new(SensorFormat::Table, beams)
    })
}

/// Words of the note on the sign of azimuth offsets.
const COUNTED: &str = "; offsets count counter-clockwise here, unless ";

/// True for the note on the sign of azimuth offsets, which a description that says the sign makes idle.
pub(in crate::vehicle) fn is_on_sign(note: &Note) -> bool {
    note.text().contains(COUNTED)
}

/// Note on the sign of azimuth offsets: a sentence for people, of whose meaning no program can be sure.
fn sign_note(at: &Location, sentence: &Value) -> Note {
    let sentence: String = sentence.to_string().chars().take(120).collect();
    Note::fact(format!(
        "{at}: {sentence}{COUNTED}`lidar` says `\"azimuth_offsets\": \"clockwise\"`; give it either way, and this \
         note goes"
    ))
}

/// A doubt about azimuth offsets that are all so small that they are most likely radians.
fn offsets_in_radians(at: &Location, offsets: &[f64]) -> Option<Note> {
    let largest = offsets.iter().fold(0.0, |largest: f64, offset| largest.max(offset.abs()));
    (largest > 0.0 && largest <= OFFSET).then(|| {
        let degrees = largest.to_degrees();
        Note::doubt(format!(
            "{at}: all within ±{largest}°; radians? Write degrees, {largest} rad are {degrees:.2}°"
        ))
    })
}

/// Azimuths of the first and the last column, at most a turn apart.
fn window(at: &Location, [from, to]: [f64; 2]) -> Checked<[f64; 2]> {
    let (from, to) = (azimuth(&at.item(0), from)?, azimuth(&at.item(1), to)?);
    if from <= to && to - from < 360.0 {
        return Ok([from, to]);
    }
    Err(check::bad(
        at,
        format!("{:?}", [from, to]),
        "a range [from, to] of less than a turn, from <= to",
    ))
}

const VELODYNE_READ: &str = "lasers num_lasers laser_id rot_correction vert_correction vert_offset_correction \
                    horiz_offset_correction";
/// Keys that are passed over, wherever they stand.
const VELODYNE_PASSED: Passed = &[
    (VELODYNE_READ, "read"),
    ("distance_resolution", "ranges have no steps"),
    (
        "dist_correction dist_correction_x dist_correction_y two_pt_correction_available \
         focal_distance focal_slope focal_offset max_intensity min_intensity",
        "corrections of distances and intensities",
    ),
];

#[derive(Deserialize)]
struct Calibration {
    lasers: Vec<Laser>,
    num_lasers: Option<u64>,
}

#[derive(Deserialize)]
struct Laser {
    laser_id: Option<u64>,
    vert_correction: f64,
    rot_correction: f64,
    #[serde(default)]
    vert_offset_correction: f64,
    #[serde(default)]
    horiz_offset_correction: f64,
}

/// The keys of the file and of its lasers. A struct that keeps unknown keys would keep their values, too, and
/// aliases make them large.
#[derive(Deserialize)]
struct UnreadKeys {
    lasers: Vec<Rest>,
}

/// True if a line of the text begins the list of lasers; JSON would have quotes around the key.
pub(super) fn is_velodyne(text: &str) -> bool {
    text.lines().any(|line| line.trim_start_matches(['{', ' ']).starts_with("lasers:"))
}

pub(super) fn parse_velodyne(at: &Location, text: &str) -> Checked<SensorPattern> {
    let document = parse_yaml(text, &at.file, quantity)?;
    let Calibration { lasers, num_lasers } = document.read()?;
    let list = at.key("lasers");
    check_count(&list, lasers.len())?;
    if let Some(count) = num_lasers.filter(|count| *count != lasers.len() as u64) {
        let wanted = format!("the {} lasers that are listed; correct one of the two", lasers.len());
        return Err(bad(&at.key("num_lasers"), count, wanted));
    }
    let mut ids = BTreeSet::new();
    for (i, id) in lasers.iter().enumerate().filter_map(|(i, laser)| Some((i, laser.laser_id?))) {
        if !ids.insert(id) {
            return Err(bad(&list.item(i).key("laser_id"), id, "an id of its own; it comes twice"));
        }
    }
    let channels = lasers.iter().enumerate().map(|(i, laser)| {
        let at = list.item(i);
        let up = (at.key("vert_correction"), degrees(laser.vert_correction, 90.0));
        if up.1.abs() > 90.0 {
            let wanted = "an elevation in radians from -1.5708 to 1.5708: is it in degrees?";
            return Err(bad(&up.0, laser.vert_correction, wanted));
        }
        let across = (at.key("rot_correction"), degrees(laser.rot_correction, 360.0));
        if across.1.abs() > 360.0 {
            let wanted = "an azimuth in radians from -6.2832 to 6.2832: is it in degrees?";
            return Err(bad(&across.0, laser.rot_correction, wanted));
        }
        channel((&up.0, up.1), (&across.0, across.1))
    });
    let beams = Beams::Channels(channels.collect::<Result<_, _>>()?);
    let mut notes: Vec<Note> = dropped_origins(&lasers).into_iter().collect();
    notes.extend(offsets_in_degrees(&list, &lasers));
    notes.extend(pattern::unknown(at, &document.read::<Rest>()?, VELODYNE_PASSED));
    let lasers = document.read::<UnreadKeys>()?.lasers;
    let keys = || lasers.iter().enumerate().map(|(i, keys)| (list.item(i), keys));
    keys().try_for_each(|(at, keys)| refuse_numbers(&at, keys))?;
    let unknown = |(at, keys): (Location, &Rest)| pattern::unknown(&at, keys, VELODYNE_PASSED);
    notes.extend(keys().filter_map(unknown).take(1));
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Velodyne, beams) })
}

/// A doubt about the first azimuth offset that no sensor has in radians: the largest known are below 0.2.
fn offsets_in_degrees(list: &Location, lasers: &[Laser]) -> Option<Note> {
    const MOST: f64 = 1.0;
    let offset = |laser: &Laser| laser.rot_correction - TAU * (laser.rot_correction / TAU).round();
    let (i, laser) = lasers.iter().enumerate().find(|(_, laser)| offset(laser).abs() > MOST)?;
    let (at, angle) = (list.item(i).key("rot_correction"), laser.rot_correction);
    Some(Note::doubt(format!(
        "{at}: {angle} rad is {:.0}°; degrees? {angle}° are {:.4} rad",
        angle.to_degrees(),
        angle.to_radians()
    )))
}

/// Refuses a number among keys: a comma ends `0,2` behind the 0, and the 2 is a key then.
fn refuse_numbers(at: &Location, keys: &Rest) -> Checked<()> {
    let number = keys.keys().map(AsRef::as_ref).find(|key: &&str| key.parse::<f64>().is_ok());
    let wanted = "the name of one; write decimals with a point, as 0.2";
    number.map_or(Ok(()), |key| Err(bad(at, format!("the key `{key}`"), wanted)))
}

/// Quantity under a key of a laser.
fn quantity(_: &str, key: &str) -> Option<Quantity> {
    match key {
        "vert_correction" | "rot_correction" => Some(Quantity::Angle),
        "vert_offset_correction" | "horiz_offset_correction" => Some(Quantity::Length),
        "laser_id" | "num_lasers" => Some(Quantity::Bare),
        _ => None,
    }
}

/// Note on laser origins in the file that one common origin ignores.
fn dropped_origins(lasers: &[Laser]) -> Option<Note> {
    let span = |of: fn(&Laser) -> f64| {
        let values = || lasers.iter().map(|laser| 1000.0 * of(laser));
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
    };
    let up = span(|laser| laser.vert_offset_correction);
    let across = span(|laser| laser.horiz_offset_correction);
    if up == [0.0; 2] && across == [0.0; 2] {
        return None;
    }
    Some(Note::fact(format!(
        "Lasers leave the sensor {:.0} to {:.0} mm above and {:.0} to {:.0} mm beside its origin; all \
         beams start at the origin here.",
        up[0], up[1], across[0], across[1]
    )))
}
