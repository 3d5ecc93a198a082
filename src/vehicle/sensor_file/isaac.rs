//! Isaac Sim: the lidar profile JSON, `rotary` or `solidState`.
//!
//! Degrees, counter-clockwise from +x. A rotary profile applies its firing pattern `reportRateBaseHz` (later
//! `patternFiringRateHz`) times a second and turns `scanRateBaseHz` times; several emitter states take turns.

use serde::Deserialize;

use super::pattern::{
    Beams, Channel, MAX_BEAMS, SensorFormat, SensorPattern, azimuth, channel, check_count,
    direction,
};
use crate::Note;
use crate::json::check::{self, bad};
use crate::json::{self, DescriptionError, Place};

/// Most columns of a turn.
const MAX_COLUMNS: f64 = 100_000.0;

#[derive(Deserialize)]
struct File {
    name: Option<String>,
    profile: Profile,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Profile {
    scan_type: Option<String>,
    rotation_direction: Option<String>,
    far_range_m: Option<f64>,
    scan_rate_base_hz: Option<f64>,
    report_rate_base_hz: Option<f64>,
    pattern_firing_rate_hz: Option<f64>,
    #[serde(default)]
    emitter_states: Vec<State>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct State {
    azimuth_deg: Vec<f64>,
    elevation_deg: Vec<f64>,
    #[serde(default)]
    hor_offset_m: Vec<f64>,
    #[serde(default)]
    vert_offset_m: Vec<f64>,
}

pub(super) fn parse(at: &Place, text: &str) -> Result<SensorPattern, DescriptionError> {
    let File { name, profile } = json::parse(text, &at.file)?;
    let model = name.map(|name| check::text(&at.key("name"), name)).transpose()?;
    let at = at.key("profile");
    let list = at.key("emitterStates");
    if profile.emitter_states.is_empty() {
        return Err(bad(&list, "a list of 0", "a list of at least one emitter state"));
    }
    for (s, state) in profile.emitter_states.iter().enumerate() {
        let (across, up) = (state.azimuth_deg.len(), state.elevation_deg.len());
        if across != up {
            let found = format!("{across} azimuths and {up} elevations");
            return Err(bad(&list.item(s), found, "an azimuth and an elevation for each emitter"));
        }
    }
    let mut pattern = match profile.scan_type.as_deref().map(str::to_ascii_lowercase).as_deref() {
        Some("rotary") => rotary(&at, &list, &profile)?,
        Some("solidstate" | "solid_state") => solid_state(&list, &profile)?,
        other => {
            let found = other.unwrap_or("nothing");
            let wanted = "\"rotary\" or \"solidState\"";
            return Err(bad(&at.key("scanType"), super::pattern::quoted(found), wanted));
        }
    };
    pattern.model = model;
    pattern.notes.extend(profile.far_range_m.map(|range| {
        Note::fact(format!(
            "The profile states a range of {range} m; that of the scene's `lidar` counts."
        ))
    }));
    let offsets =
        profile.emitter_states.iter().flat_map(|s| s.hor_offset_m.iter().chain(&s.vert_offset_m));
    let largest = offsets.fold(0.0, |most: f64, offset| most.max(1000.0 * offset.abs()));
    if largest > 0.0 {
        pattern.notes.push(Note::fact(format!(
            "Emitters stand up to {largest:.0} mm from the origin; all beams start there here."
        )));
    }
    Ok(pattern)
}

/// Emitters as channels; of several states, each fires at every n-th column, one column after the other.
fn rotary(at: &Place, list: &Place, profile: &Profile) -> Result<SensorPattern, DescriptionError> {
    let states = profile.emitter_states.len();
    let rate = profile.report_rate_base_hz.or(profile.pattern_firing_rate_hz);
    let ticks = rate.zip(profile.scan_rate_base_hz).map(|(ticks, scans)| (ticks / scans).round());
    if let Some(ticks) = ticks.filter(|ticks| !(1.0..=MAX_COLUMNS).contains(ticks)) {
        let wanted = "1 to 100000: check `reportRateBaseHz` and `scanRateBaseHz`";
        return Err(bad(at, format!("a turn of {ticks} columns"), wanted));
    }
    let ticks = ticks.map(|ticks| ticks as usize);
    if states > 1 && ticks.is_none_or(|ticks| ticks % states != 0) {
        let found = format!("{states} states in {} columns a turn", ticks.unwrap_or(0));
        return Err(bad(list, found, "a number of states that divides the columns of a turn"));
    }
    let clockwise = profile.rotation_direction.as_deref() == Some("CW");
    let column = 360.0 / ticks.unwrap_or(1) as f64 * if clockwise { -1.0 } else { 1.0 };
    check_count(list, profile.emitter_states.iter().map(|s| s.elevation_deg.len()).sum())?;
    let mut channels: Vec<Channel> = Vec::new();
    for (s, state) in profile.emitter_states.iter().enumerate() {
        let at = list.item(s);
        for (e, (&up, &across)) in state.elevation_deg.iter().zip(&state.azimuth_deg).enumerate() {
            let offset = across + s as f64 * column;
            let (up_at, across_at) = (at.key("elevationDeg"), at.key("azimuthDeg"));
            channels.push(channel((&up_at.item(e), up), (&across_at.item(e), offset))?);
        }
    }
    let azimuth_steps = ticks.map(|ticks| (ticks / states) as u32);
    let beams = Beams::Channels(channels);
    Ok(SensorPattern { azimuth_steps, ..SensorPattern::new(SensorFormat::Isaac, beams) })
}

/// Emitters of the first state as directions: each scan takes one state.
fn solid_state(list: &Place, profile: &Profile) -> Result<SensorPattern, DescriptionError> {
    let (at, state) = (list.item(0), &profile.emitter_states[0]);
    let count = state.elevation_deg.len();
    if count == 0 || count as u64 > MAX_BEAMS {
        return Err(bad(&at, format!("a list of {count}"), format!("1 to {MAX_BEAMS} emitters")));
    }
    let both = state.azimuth_deg.iter().zip(&state.elevation_deg).enumerate();
    let directions = both.map(|(e, (&across, &up))| {
        let across = azimuth(&at.key("azimuthDeg").item(e), across)?;
        let up = check::elevation(&at.key("elevationDeg").item(e), up)?;
        Ok(direction(across, up))
    });
    let beams = Beams::Directions(directions.collect::<Result<_, DescriptionError>>()?);
    let states = profile.emitter_states.len();
    let later =
        Note::fact(format!("Of {states} emitter states the first is cast: each scan takes one."));
    let notes = (states > 1).then_some(later).into_iter().collect();
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Isaac, beams) })
}
