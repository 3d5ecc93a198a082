//! Isaac Sim: the lidar profile JSON, `rotary` or `solidState`.
//!
//! Degrees, counter-clockwise from +x. A rotary profile applies its firing pattern `reportRateBaseHz` (later
//! `patternFiringRateHz`) times a second and turns `scanRateBaseHz` times; several emitter states take turns.

use std::f64::consts::{FRAC_PI_2, TAU};

use serde::Deserialize;
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check};
use sightline_files::{Note, json};

use super::pattern::{
    self, Beams, Channel, MAX_BEAMS, Measures, Passed, Rest, SensorFormat, SensorPattern, azimuth,
    channel, check_count, direction, quoted,
};

const MAX_COLUMNS: f64 = 100_000.0;
/// Reflectance that `minReflectanceRange` is stated for by default, and that ranges are rated for here.
pub(super) const RATED: f64 = 0.1;
/// Degrees by which azimuths at the ends of a window may be off.
const EDGE: f64 = 1e-6;

/// Keys that are passed over, wherever they stand.
const PASSED: Passed = &[
    ("class type driveWorksId", "kind of the file and of the sensor in DriveWorks"),
    (
        "avgPowerW wavelengthNm effectiveApertureSize focusDistM",
        "`response` has its own law of power",
    ),
    ("intensityMappingType intensityProcessing intensityScalePercent", "intensities"),
    ("pulseTimeNs minDistBetweenEchos maxReturns", "`response` says which echoes are reported"),
    ("rangeResolutionM rangeOffset rangeCount ranges rangeId", "steps of the reported range"),
    (
        "azimuthErrorMean azimuthErrorStd elevationErrorMean elevationErrorStd",
        "beams go where the emitters point",
    ),
    ("rayType stateResolutionStep", "how the simulator casts"),
    ("upElevationDeg downElevationDeg", "repeat what the emitters' elevations say"),
    ("numberOfChannels numLines channelId bank", "how emitters are numbered in packets"),
    ("fireTimeNs", "emitters of a column fire together here"),
];

#[derive(Deserialize)]
struct IsaacFile {
    name: Option<String>,
    profile: IsaacProfile,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct IsaacProfile {
    scan_type: Option<String>,
    rotation_direction: Option<String>,
    near_range_m: Option<f64>,
    far_range_m: Option<f64>,
    range_accuracy_m: Option<f64>,
    min_reflectance: Option<f64>,
    min_reflectance_range: Option<f64>,
    start_azimuth_deg: Option<f64>,
    end_azimuth_deg: Option<f64>,
    valid_start_azimuth_deg: Option<f64>,
    valid_end_azimuth_deg: Option<f64>,
    scan_rate_base_hz: Option<f64>,
    report_rate_base_hz: Option<f64>,
    pattern_firing_rate_hz: Option<f64>,
    number_of_emitters: Option<u64>,
    emitter_state_count: Option<u64>,
    num_rays_per_line: Option<Vec<u64>>,
    #[serde(default)]
    emitter_states: Vec<EmitterState>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct EmitterState {
    azimuth_deg: Vec<f64>,
    elevation_deg: Vec<f64>,
    #[serde(default)]
    hor_offset_m: Vec<f64>,
    #[serde(default)]
    vert_offset_m: Vec<f64>,
    #[serde(flatten)]
    rest: Rest,
}

pub(super) fn parse(at: &Location, text: &str) -> Checked<SensorPattern> {
    let IsaacFile { name, profile, rest } = json::parse(text, &at.file)?;
    let model = name.map(|name| check::name(&at.key("name"), name)).transpose()?;
    let top = pattern::unknown(at, &rest, PASSED);
    let at = at.key("profile");
    let list = at.key("emitterStates");
    check_counts(&at, &list, &profile)?;
    let window = window(&at, &profile)?;
    let mut pattern = match profile.scan_type.as_deref().map(str::to_ascii_lowercase).as_deref() {
        Some("rotary") => rotary(&at, &list, &profile, window)?,
        Some("solidstate" | "solid_state") => solid_state(&list, &profile, window)?,
        other => {
            let found = other.unwrap_or("nothing");
            let wanted = "\"rotary\" or \"solidState\"";
            return Err(bad(&at.key("scanType"), quoted(found), wanted));
        }
    };
    pattern.notes.extend(two_rates(&at, &profile));
    pattern.notes.extend(rounded_columns(&at, &profile, pattern.azimuth_steps));
    pattern.model = model;
    pattern.measures = measures(&at, &profile, &mut pattern.notes)?;
    pattern.notes.extend(top);
    pattern.notes.extend(pattern::unknown(&at, &profile.rest, PASSED));
    let states = profile.emitter_states.iter().enumerate();
    pattern.notes.extend(
        states
            .filter_map(|(s, state)| pattern::unknown(&list.item(s), &state.rest, PASSED))
            .take(1),
    );
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

/// A note where the rates give no whole number of columns a turn, and it is rounded.
fn rounded_columns(at: &Location, profile: &IsaacProfile, steps: Option<u32>) -> Option<Note> {
    let rate = profile.report_rate_base_hz.or(profile.pattern_firing_rate_hz)?;
    let turns = profile.scan_rate_base_hz?;
    let columns = rate / turns;
    (steps.is_some() && (columns - columns.round()).abs() > 1e-6).then(|| {
        Note::fact(format!(
            "{at}: {rate} columns a second in {turns} turns are {columns} a turn; {} are cast",
            columns.round()
        ))
    })
}

/// Refuses lists of other lengths than each other and than the counts beside them.
fn check_counts(at: &Location, list: &Location, profile: &IsaacProfile) -> Checked<()> {
    let states = &profile.emitter_states;
    if states.is_empty() {
        return Err(bad(list, "a list of 0", "a list of at least one emitter state"));
    }
    for (s, state) in states.iter().enumerate() {
        let (across, up) = (state.azimuth_deg.len(), state.elevation_deg.len());
        if across != up {
            let found = format!("{across} azimuths and {up} elevations");
            return Err(bad(&list.item(s), found, "an azimuth and an elevation for each emitter"));
        }
    }
    let correct = "correct the count or the list";
    if let Some(count) = profile.emitter_state_count.filter(|count| *count != states.len() as u64) {
        let wanted = format!("the {} states of `emitterStates`; {correct}", states.len());
        return Err(bad(&at.key("emitterStateCount"), count, wanted));
    }
    let lengths = || states.iter().map(|state| state.elevation_deg.len() as u64);
    let fits =
        |count: u64| lengths().all(|length| length == count) || lengths().sum::<u64>() == count;
    if let Some(count) = profile.number_of_emitters.filter(|count| !fits(*count)) {
        let found = lengths().next().unwrap_or(0);
        let wanted = format!("the {found} emitters that the first state lists; {correct}");
        return Err(bad(&at.key("numberOfEmitters"), count, wanted));
    }
    let rays = profile.num_rays_per_line.as_ref();
    let rays = rays.map(|rays| rays.iter().fold(0, |sum: u64, rays| sum.saturating_add(*rays)));
    if let Some(count) = rays.filter(|count| !fits(*count)) {
        let wanted = format!(
            "as many in all as the {} emitters of a state; {correct}",
            lengths().next().unwrap_or(0)
        );
        return Err(bad(&at.key("numRaysPerLine"), format!("{count} rays"), wanted));
    }
    Ok(())
}

/// Azimuths between which the sensor measures, in degrees, the smaller first; `None` for a whole turn.
fn window(at: &Location, profile: &IsaacProfile) -> Checked<Option<[f64; 2]>> {
    let pairs = [
        ("startAzimuthDeg", profile.start_azimuth_deg, "endAzimuthDeg", profile.end_azimuth_deg),
        (
            "validStartAzimuthDeg",
            profile.valid_start_azimuth_deg,
            "validEndAzimuthDeg",
            profile.valid_end_azimuth_deg,
        ),
    ];
    let mut window: Option<[f64; 2]> = None;
    for (from_key, from, to_key, to) in pairs {
        if from.is_none() && to.is_none() {
            continue;
        }
        let from = azimuth(&at.key(from_key), from.unwrap_or(0.0))?;
        let mut to = azimuth(&at.key(to_key), to.unwrap_or(360.0))?;
        if to < from {
            to += 360.0;
        }
        if to - from >= 360.0 {
            continue;
        }
        window = Some(match window {
            None => [from, to],
            // The later pair cuts the earlier one; a turn more or less makes them meet.
            Some([low, high]) => {
                let shifts =
                    [-360.0, 0.0, 360.0].map(|turn| [low.max(from + turn), high.min(to + turn)]);
                let [low, high] = shifts.into_iter().fold([0.0, -1.0], |best: [f64; 2], cut| {
                    if cut[1] - cut[0] > best[1] - best[0] { cut } else { best }
                });
                if high < low {
                    let wanted = "a range that meets that of `startAzimuthDeg` and `endAzimuthDeg`";
                    return Err(bad(&at.key(from_key), format!("{from} to {to} degrees"), wanted));
                }
                [low, high]
            }
        });
    }
    Ok(window)
}

fn measures(at: &Location, profile: &IsaacProfile, notes: &mut Vec<Note>) -> Checked<Measures> {
    let within = |key: &str, value, low, high| check::within(at, key, value, low, high);
    let range =
        profile.far_range_m.map(|range| check::range(&at.key("farRangeM"), range)).transpose()?;
    let min_range = within("nearRangeM", profile.near_range_m, 0.0, range.unwrap_or(1e5))?;
    let noise = within("rangeAccuracyM", profile.range_accuracy_m, 0.0, 10.0)?;
    let reflectance =
        within("minReflectance", profile.min_reflectance, 1e-3, 1.0)?.unwrap_or(RATED);
    let stated = within("minReflectanceRange", profile.min_reflectance_range, 0.1, 1e4)?;
    // The power of an echo goes with the reflectance over the square of the range.
    let rated_range = stated.map(|stated| stated * (RATED / reflectance).sqrt());
    let rate = within("scanRateBaseHz", profile.scan_rate_base_hz, 1e-3, 1e4)?;
    let measures = Measures { range, min_range, rated_range, noise, rate };
    notes.extend(pattern::rated_too_far(at, &measures, "farRangeM"));
    Ok(measures)
}

/// A doubt where the two names for one rate give two numbers.
fn two_rates(at: &Location, profile: &IsaacProfile) -> Option<Note> {
    let (report, firing) = profile.report_rate_base_hz.zip(profile.pattern_firing_rate_hz)?;
    (report != firing).then(|| {
        Note::doubt(format!(
            "{at}: `reportRateBaseHz` is {report} and `patternFiringRateHz` {firing}, two names for one rate; \
             `reportRateBaseHz` is taken: leave the wrong one out"
        ))
    })
}

/// Emitters as channels; of several states, each fires at every n-th column, one column after the other.
fn rotary(
    at: &Location,
    list: &Location,
    profile: &IsaacProfile,
    window: Option<[f64; 2]>,
) -> Checked<SensorPattern> {
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
    let clockwise = match profile.rotation_direction.as_deref() {
        None => false,
        Some(word) if word.eq_ignore_ascii_case("CCW") => false,
        Some(word) if word.eq_ignore_ascii_case("CW") => true,
        Some(other) => {
            return Err(bad(&at.key("rotationDirection"), quoted(other), "\"CW\" or \"CCW\""));
        }
    };
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
    let mut pattern = SensorPattern::new(SensorFormat::Isaac, Beams::Channels(channels));
    pattern.azimuth_steps = ticks.map(|ticks| (ticks / states) as u32);
    match (window, ticks) {
        (Some(window), Some(ticks)) if states > 1 => {
            let step = 360.0 / ticks as f64;
            let [first, last] = whole_columns(at, window, step)?.map(|column| column as i64);
            let columns = WindowColumns { first, count: last - first + 1, step, clockwise };
            columns.cut(at, list, profile, &mut pattern)?;
            pattern.notes.push(cut_to(window));
        }
        (Some(window), _) => cut(at, &mut pattern, window)?,
        (None, _) => {}
    }
    Ok(pattern)
}

/// The columns of a window, where several states take turns at them.
struct WindowColumns {
    /// Number of the first column, counter-clockwise from ahead.
    first: i64,
    count: i64,
    /// Degrees from column to column.
    step: f64,
    clockwise: bool,
}

impl WindowColumns {
    /// The state that fires at a column.
    fn state(&self, column: i64, states: usize) -> usize {
        let turn = if self.clockwise { -1 } else { 1 };
        (turn * column).rem_euclid(states as i64) as usize
    }

    /// Leaves the beams of these columns: channels where all states fire equally often, else a list of directions.
    fn cut(
        &self,
        at: &Location,
        list: &Location,
        profile: &IsaacProfile,
        pattern: &mut SensorPattern,
    ) -> Checked<()> {
        let states = &profile.emitter_states;
        let emitters = |state: &EmitterState| {
            let pairs = state.azimuth_deg.iter().zip(&state.elevation_deg);
            pairs.map(|(across, up)| (*across, *up)).collect::<Vec<_>>()
        };
        let turns = self.count / states.len() as i64;
        if turns > 0 && self.count % states.len() as i64 == 0 {
            let mut channels = Vec::new();
            // States in the order of the file, each from its first column on.
            for (s, state) in states.iter().enumerate() {
                let of_state = |k: &i64| self.state(self.first + k, states.len()) == s;
                let behind = (0..states.len() as i64).find(of_state).unwrap_or(0) as f64;
                for (across, up) in emitters(state) {
                    let offset = across + behind * self.step;
                    channels.push(channel((list, up), (list, offset))?);
                }
            }
            let from = self.first as f64 * self.step;
            let to = from + (turns - 1) as f64 * states.len() as f64 * self.step;
            pattern.beams = Beams::Channels(channels);
            pattern.azimuth = Some(within_a_turn([from, to]));
            return Ok(());
        }
        let mut directions = Vec::new();
        for column in self.first..self.first + self.count {
            let state = &states[self.state(column, states.len())];
            for (across, up) in emitters(state) {
                directions.push(direction(column as f64 * self.step + across, up));
            }
            if directions.len() as u64 > MAX_BEAMS {
                let wanted = format!("a window of at most {MAX_BEAMS} beams; narrow it");
                return Err(bad(at, format!("a window of {} columns", self.count), wanted));
            }
        }
        if directions.is_empty() {
            return Err(bad(
                list,
                "a list of states without emitters in the window",
                "1 emitter or more",
            ));
        }
        pattern.beams = Beams::Directions(directions);
        pattern.azimuth_steps = None;
        Ok(())
    }
}

/// Numbers of the first and the last column of a window in degrees, `step` degrees apart.
fn whole_columns(at: &Location, [from, to]: [f64; 2], step: f64) -> Checked<[f64; 2]> {
    let [first, last] = [((from - EDGE) / step).ceil(), ((to + EDGE) / step).floor()];
    if last < first {
        let found = format!("{from} to {to} degrees");
        let wanted = format!("a window that holds a column, one every {step} degrees");
        return Err(bad(at, found, wanted));
    }
    Ok([first, last])
}

/// A window that ends within a turn from ahead, a turn earlier if need be.
fn within_a_turn([from, to]: [f64; 2]) -> [f64; 2] {
    if to > 360.0 { [from - 360.0, to - 360.0] } else { [from, to] }
}

fn cut_to([from, to]: [f64; 2]) -> Note {
    Note::fact(format!(
        "The profile measures from {from} to {to} degrees; only columns of this window are cast."
    ))
}

/// Leaves the whole columns of a window in degrees.
fn cut(at: &Location, pattern: &mut SensorPattern, window: [f64; 2]) -> Checked<()> {
    let [from, to] = window;
    // Without columns of its own the window ends where the file says.
    let step = pattern.azimuth_steps.map_or(EDGE, |steps| 360.0 / f64::from(steps));
    let [first, last] = whole_columns(at, [from, to], step)?.map(|column| column * step);
    pattern.azimuth = Some(within_a_turn([first, last]));
    pattern.notes.push(cut_to(window));
    Ok(())
}

/// Emitters of the first state as directions: each scan takes one state.
fn solid_state(
    list: &Location,
    profile: &IsaacProfile,
    window: Option<[f64; 2]>,
) -> Checked<SensorPattern> {
    let (at, state) = (list.item(0), &profile.emitter_states[0]);
    let count = state.elevation_deg.len();
    if count == 0 || count as u64 > MAX_BEAMS {
        return Err(bad(&at, format!("a list of {count}"), format!("1 to {MAX_BEAMS} emitters")));
    }
    let mut directions = Vec::with_capacity(count);
    for (e, (&across, &up)) in state.azimuth_deg.iter().zip(&state.elevation_deg).enumerate() {
        let across = azimuth(&at.key("azimuthDeg").item(e), across)?;
        let up = check::elevation(&at.key("elevationDeg").item(e), up)?;
        let inside = |[from, to]: [f64; 2]| {
            (across - from + EDGE).rem_euclid(360.0) <= to - from + 2.0 * EDGE
        };
        if window.is_none_or(inside) {
            directions.push(direction(across, up));
        }
    }
    let mut notes = Vec::new();
    if let Some([from, to]) = window.filter(|_| directions.len() < count) {
        if directions.is_empty() {
            let wanted =
                format!("an emitter between the window's {from} and {to} degrees of azimuth");
            return Err(bad(&at, format!("a list of {count}"), wanted));
        }
        notes.push(Note::fact(format!(
            "{} of {count} emitters point into the profile's window from {from} to {to} degrees; they are cast.",
            directions.len()
        )));
    }
    let largest = |angles: &[f64]| angles.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
    let [across, up] = [&state.azimuth_deg, &state.elevation_deg].map(|list| largest(list));
    if count > 1 && across.max(up) > 0.0 && across <= TAU && up <= FRAC_PI_2 {
        notes.push(Note::doubt(format!(
            "{at}: azimuths reach {across:.3} and elevations {up:.3} degrees: radians? Write degrees."
        )));
    }
    let states = profile.emitter_states.len();
    if states > 1 {
        let text = format!("The first of {states} emitter states is cast: each scan takes one.");
        notes.push(Note::fact(text));
    }
    let beams = Beams::Directions(directions);
    Ok(SensorPattern { notes, ..SensorPattern::new(SensorFormat::Isaac, beams) })
}
