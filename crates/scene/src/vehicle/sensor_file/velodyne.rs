//! Velodyne: the calibration YAML of the ROS drivers.
//!
//! Angles are radians. The driver takes `rot_correction` off an azimuth that counts clockwise, so that a
//! positive one turns counter-clockwise (ros-drivers/velodyne, rawdata.cc).

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

use serde::Deserialize;

use super::pattern::{
    self, Beams, Passed, Rest, SensorFormat, SensorPattern, channel, check_count,
};
use sightline_files::Note;
use sightline_files::json::check::bad;
use sightline_files::json::{DescriptionError, Place, Quantity, parse_yaml};

/// Keys that are read.
const READ: &str = "lasers num_lasers laser_id rot_correction vert_correction vert_offset_correction \
                    horiz_offset_correction";
/// Keys that are passed over, wherever they stand.
const PASSED: Passed = &[
    (READ, "read"),
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

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
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
        let up = laser.vert_correction;
        if (FRAC_PI_2..=90.0).contains(&up.abs()) {
            let wanted = "an elevation in radians from -1.5708 to 1.5708: is it in degrees?";
            return Err(bad(&at.key("vert_correction"), up, wanted));
        }
        let elevation = (&at.key("vert_correction"), up.to_degrees());
        channel(elevation, (&at.key("rot_correction"), laser.rot_correction.to_degrees()))
    });
    let beams = Beams::Channels(channels.collect::<Result<_, _>>()?);
    let mut notes: Vec<Note> = dropped_origins(&lasers).into_iter().collect();
    notes.extend(pattern::unknown(at, &document.read::<Rest>()?, PASSED));
    let lasers = document.read::<UnreadKeys>()?.lasers.into_iter().enumerate();
    let unknown = |(i, keys): (usize, Rest)| pattern::unknown(&list.item(i), &keys, PASSED);
    notes.extend(lasers.filter_map(unknown).take(1));
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Velodyne, beams) })
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
