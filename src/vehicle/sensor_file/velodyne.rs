//! Velodyne: the calibration YAML of the ROS drivers.
//!
//! Angles are radians. The driver takes `rot_correction` off an azimuth that counts clockwise, so that a
//! positive one turns counter-clockwise (ros-drivers/velodyne, rawdata.cc).

use serde::Deserialize;

use super::pattern::{Beams, SensorFormat, SensorPattern, channel, check_count};
use crate::Note;
use crate::json::{DescriptionError, Place, parse_yaml};

#[derive(Deserialize)]
struct Calibration {
    lasers: Vec<Laser>,
}

#[derive(Deserialize)]
struct Laser {
    vert_correction: f64,
    rot_correction: f64,
    #[serde(default)]
    vert_offset_correction: f64,
    #[serde(default)]
    horiz_offset_correction: f64,
}

/// Whether a line of the text begins the list of lasers; JSON would have quotes around the key.
pub(super) fn is_velodyne(text: &str) -> bool {
    text.lines().any(|line| line.trim_start_matches(['{', ' ']).starts_with("lasers:"))
}

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let lasers = parse_yaml::<Calibration>(text, &at.file)?.lasers;
    let list = at.key("lasers");
    check_count(&list, lasers.len())?;
    let channels = lasers.iter().enumerate().map(|(i, laser)| {
        let at = list.item(i);
        let elevation = (&at.key("vert_correction"), laser.vert_correction.to_degrees());
        channel(elevation, (&at.key("rot_correction"), laser.rot_correction.to_degrees()))
    });
    let beams = Beams::Channels(channels.collect::<Result<_, _>>()?);
    let notes = dropped_origins(&lasers).into_iter().collect();
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Velodyne, beams) })
}

/// What one origin for all lasers leaves out.
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
