//! Ouster: the sensor's metadata JSON, flat (firmware 1 and 2) or nested (3 and later).
//!
//! In the sensor's frame, column m of W looks to the azimuth π + 2π(1 − m/W) − `beam_azimuth_angles`: offsets
//! count clockwise, and the columns are those of a turn in W steps (ouster-sdk, `XYZLut`).

use serde::Deserialize;
use serde_json::Value;
use sightline_files::json::check::bad;
use sightline_files::json::{Checked, Location, check};
use sightline_files::{Note, json};

use super::column_window::{ColumnWindow, TURN};
use super::pattern::{
    self, Answer, Beams, MAX_COLUMNS, Measures, Passed, Rest, SensorFormat, SensorPattern,
    channels_of, quoted,
};

/// Keys that are passed over, wherever they stand.
const PASSED: Passed = &[
    ("imu_to_sensor_transform imu_intrinsics imu_data_format", "no beam depends on the IMU"),
    ("sensor_to_body_transform user_data zones zone_set", "the user's own additions"),
    ("calibration_status reflectivity_calibration", "reflectivity"),
    ("pixel_shift_by_row", "repeats the azimuth angles in columns, for images"),
    ("base_pn base_sn prod_pn prod_sn hostname build_date image_rev", "which unit and firmware"),
    (
        "client_version initialization_id json_calibration_version ouster-sdk \
         power_on_active_ids proto_rev status version",
        "who wrote the file",
    ),
    (
        "accel_fsr auto_start_flag bloom_reduction_optimization columns_per_packet gyro_fsr \
         header_type imu_packets_per_frame lidar_frame_azimuth_offset min_range_threshold_cm \
         multipurpose_io_mode operating_mode phase_lock_enable phase_lock_offset return_order \
         signal_multiplier timestamp_mode window_rejection_enable",
        "how packets are filled; directions do not depend on it",
    ),
    (
        "fps nmea_baud_rate nmea_ignore_valid_char nmea_in_polarity nmea_leap_seconds \
         sync_pulse_in_polarity sync_pulse_out_angle sync_pulse_out_frequency \
         sync_pulse_out_polarity sync_pulse_out_pulse_width udp_dest udp_dest_zm udp_ip \
         udp_multicast_ttl udp_port_imu udp_port_lidar udp_port_zm udp_profile_imu \
         udp_profile_lidar",
        "network and clocks",
    ),
];

#[derive(Deserialize)]
struct Metadata {
    beam_intrinsics: Option<Answer<BeamIntrinsics>>,
    sensor_info: Option<Answer<Info>>,
    // Ouster Studio's name for it stands second.
    #[serde(alias = "config_txt")]
    config_params: Option<Answer<Config>>,
    lidar_data_format: Option<Answer<DataFormat>>,
    data_format: Option<Answer<DataFormat>>,
    lidar_intrinsics: Option<Answer<Extrinsics>>,
    // Flat files have the rest at the top.
    prod_line: Option<Value>,
    build_rev: Option<Value>,
    lidar_mode: Option<Value>,
    azimuth_window: Option<[f64; 2]>,
    lidar_to_sensor_transform: Option<Value>,
    beam_altitude_angles: Option<Vec<f64>>,
    beam_azimuth_angles: Option<Vec<f64>>,
    lidar_origin_to_beam_origin_mm: Option<Value>,
    beam_to_lidar_transform: Option<Value>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Deserialize)]
struct BeamIntrinsics {
    beam_altitude_angles: Option<Vec<f64>>,
    beam_azimuth_angles: Option<Vec<f64>>,
    lidar_origin_to_beam_origin_mm: Option<Value>,
    beam_to_lidar_transform: Option<Value>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Deserialize)]
struct Info {
    prod_line: Option<Value>,
    build_rev: Option<Value>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Deserialize)]
struct Config {
    lidar_mode: Option<Value>,
    azimuth_window: Option<[f64; 2]>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Deserialize)]
struct DataFormat {
    columns_per_frame: Option<u64>,
    column_window: Option<[u64; 2]>,
    pixels_per_column: Option<u64>,
    #[serde(flatten)]
    rest: Rest,
}

#[derive(Deserialize)]
struct Extrinsics {
    lidar_to_sensor_transform: Option<Value>,
    #[serde(flatten)]
    rest: Rest,
}

/// One spelling of all that is read.
#[derive(Default)]
struct Facts {
    prod_line: Option<String>,
    mode: Option<String>,
    azimuth_window: Option<[f64; 2]>,
    is_firmware_1: bool,
    columns: Option<u64>,
    column_window: Option<[u64; 2]>,
    rows: Option<u64>,
    origin: Option<f64>,
    height: Option<f64>,
    notes: Vec<Note>,
}

pub(super) fn parse(at: &Location, text: &str) -> Checked<SensorPattern> {
    let mut file: Metadata = json::parse(text, &at.file)?;
    let (list, beam, mut notes) = beams_of(at, &mut file)?;
    let places = ["beam_altitude_angles", "beam_azimuth_angles"].map(|key| (list.key(key), key));
    let lists = [&beam.beam_altitude_angles, &beam.beam_azimuth_angles];
    let [Some(elevations), Some(offsets)] = lists else {
        let key = places[usize::from(lists[0].is_some())].1;
        let mend = "list the angles of all beams in degrees, as the sensor's metadata has them";
        return Err(check::missing(&list, key, mend));
    };
    let beams = channels_of([&places[0].0, &places[1].0], elevations, offsets, -1.0)?;
    let mut facts = facts(at, file, &beam, &list)?;
    notes.append(&mut facts.notes);
    let beams = real_beams(&places[0].0, beams, &facts, &mut notes)?;
    let steps = steps(at, &facts, &mut notes)?;
    let azimuth = steps.map(|steps| window(at, &facts, steps, &mut notes)).transpose()?.flatten();
    notes.extend(offsets_dropped(&facts));
    let rate = facts.mode.as_deref().and_then(|mode| mode.split_once('x')?.1.parse::<f64>().ok());
    Ok(SensorPattern {
        model: facts.prod_line.map(|name| check::name(&at.key("prod_line"), name)).transpose()?,
        azimuth_steps: steps,
        azimuth,
        measures: Measures {
            rate: rate.filter(|rate| (1.0..=100.0).contains(rate)),
            ..Measures::default()
        },
        notes,
        ..SensorPattern::new(SensorFormat::Ouster, beams)
    })
}

/// The angles, from one of the two places where they stand.
fn beams_of(at: &Location, file: &mut Metadata) -> Checked<(Location, BeamIntrinsics, Vec<Note>)> {
    let flat = BeamIntrinsics {
        beam_altitude_angles: file.beam_altitude_angles.take(),
        beam_azimuth_angles: file.beam_azimuth_angles.take(),
        lidar_origin_to_beam_origin_mm: file.lidar_origin_to_beam_origin_mm.take(),
        beam_to_lidar_transform: file.beam_to_lidar_transform.take(),
        rest: Rest::new(),
    };
    let nested_at = at.key("beam_intrinsics");
    let mut notes = Vec::new();
    let nested = match file.beam_intrinsics.take() {
        Some(Answer::Text(text)) if flat.beam_altitude_angles.is_none() => {
            let wanted = "an object with the angles of all beams; ask the sensor again";
            return Err(bad(&nested_at, quoted(&text), wanted));
        }
        other => other.and_then(|answer| answer.or_note(&nested_at, &mut notes)),
    };
    let Some(nested) = nested else { return Ok((at.clone(), flat, notes)) };
    notes.extend(pattern::unknown(&nested_at, &nested.rest, PASSED));
    let differ = |a: &Option<Vec<f64>>, b: &Option<Vec<f64>>| a.is_some() && b.is_some() && a != b;
    if differ(&flat.beam_altitude_angles, &nested.beam_altitude_angles)
        || differ(&flat.beam_azimuth_angles, &nested.beam_azimuth_angles)
    {
        let wanted = "equal to that in `beam_intrinsics`; leave one out";
        return Err(bad(at, "the list of angles at the top", wanted));
    }
    Ok((nested_at, nested, notes))
}

/// Reads all but the angles: windows, origin, model, firmware. Broken parts that no beam depends on become notes.
fn facts(at: &Location, file: Metadata, beam: &BeamIntrinsics, list: &Location) -> Checked<Facts> {
    let mut facts = Facts::default();
    let notes = &mut facts.notes;
    notes.extend(pattern::unknown(at, &file.rest, PASSED));
    let info_at = at.key("sensor_info");
    let info = file.sensor_info.and_then(|info| info.or_note(&info_at, notes));
    notes.extend(info.as_ref().and_then(|info| pattern::unknown(&info_at, &info.rest, PASSED)));
    let (line, firmware) = info.map_or((None, None), |info| (info.prod_line, info.build_rev));
    let line = line.or(file.prod_line);
    let firmware = text(&at.key("build_rev"), firmware.or(file.build_rev), notes);
    facts.is_firmware_1 = firmware.is_some_and(|firmware| firmware.starts_with("v1."));
    facts.prod_line = text(&at.key("prod_line"), line, notes);
    let config_at = at.key("config_params");
    let config = file.config_params.and_then(|config| config.or_note(&config_at, notes));
    notes.extend(
        config.as_ref().and_then(|config| pattern::unknown(&config_at, &config.rest, PASSED)),
    );
    let (mode, window) = config.map_or((None, None), |c| (c.lidar_mode, c.azimuth_window));
    let mode = first_of(&at.key("lidar_mode"), mode, file.lidar_mode, notes);
    facts.mode = text(&at.key("lidar_mode"), mode, notes);
    let window_at = at.key("azimuth_window");
    facts.azimuth_window = first_of(&window_at, window, file.azimuth_window, notes);
    for (key, format) in
        [("lidar_data_format", file.lidar_data_format), ("data_format", file.data_format)]
    {
        let format_at = at.key(key);
        let Some(format) = format.and_then(|format| format.or_note(&format_at, notes)) else {
            continue;
        };
        notes.extend(pattern::unknown(&format_at, &format.rest, PASSED));
        let key = |key| format_at.key(key);
        facts.columns =
            first_of(&key("columns_per_frame"), facts.columns, format.columns_per_frame, notes);
        facts.column_window =
            first_of(&key("column_window"), facts.column_window, format.column_window, notes);
        facts.rows =
            first_of(&key("pixels_per_column"), facts.rows, format.pixels_per_column, notes);
    }
    let lidar_at = at.key("lidar_intrinsics");
    let lidar = file.lidar_intrinsics.and_then(|lidar| lidar.or_note(&lidar_at, notes));
    notes.extend(lidar.as_ref().and_then(|lidar| pattern::unknown(&lidar_at, &lidar.rest, PASSED)));
    let transform = lidar.and_then(|lidar| lidar.lidar_to_sensor_transform);
    let transform = transform.or(file.lidar_to_sensor_transform);
    let transform_at = at.key("lidar_to_sensor_transform");
    facts.height = entry(&transform_at, transform.as_ref(), 11, notes);
    notes.extend(transform.as_ref().and_then(|transform| other_turn(&transform_at, transform)));
    facts.origin = beam_origin(beam, list, notes);
    Ok(facts)
}

/// Distance of the beams' origin from the axis of the LiDAR, millimetres; `None`, with a note, where it is no number.
fn beam_origin(beam: &BeamIntrinsics, list: &Location, notes: &mut Vec<Note>) -> Option<f64> {
    let origin = beam.lidar_origin_to_beam_origin_mm.as_ref().filter(|value| !value.is_null());
    match origin {
        Some(value) if value.is_number() => {
            let at = list.key("beam_to_lidar_transform");
            let other = entry(&at, beam.beam_to_lidar_transform.as_ref(), 3, notes);
            let own = value.as_f64();
            if let (Some(own), Some(other)) = (own, other)
                && (own - other).abs() > SAME_MM
            {
                notes.push(Note::doubt(format!(
                    "{at}: moves beams by {other} mm, and `lidar_origin_to_beam_origin_mm` says {own}; the latter is \
                     read. Correct one of the two."
                )));
            }
            own
        }
        Some(_) => {
            let at = list.key("lidar_origin_to_beam_origin_mm");
            notes.push(Note::fact(format!("{at}: is no number; not read.")));
            None
        }
        None => {
            let at = list.key("beam_to_lidar_transform");
            entry(&at, beam.beam_to_lidar_transform.as_ref(), 3, notes)
        }
    }
}

/// Millimetres within which two places say the same.
const SAME_MM: f64 = 0.01;
/// Largest difference of an entry of a rotation that rounding leaves.
const SAME_TURN: f64 = 1e-3;

/// A doubt about a rotation from the LiDAR's frame to the sensor's that is not the half turn about z of every Ouster:
/// beams are cast in the sensor's frame by that half turn.
fn other_turn(at: &Location, transform: &Value) -> Option<Note> {
    let numbers = transform.as_array().filter(|list| list.len() == 16)?;
    let half_turn = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]];
    let is_off = |(row, column): (usize, usize)| {
        let entry = numbers[4 * row + column].as_f64();
        entry.is_some_and(|v: f64| (v - half_turn[row][column]).abs() > SAME_TURN)
    };
    let mut places = (0..3).flat_map(|row| (0..3).map(move |column| (row, column)));
    places.any(is_off).then(|| {
        Note::doubt(format!(
            "{at}: its rotation is not a half turn about z, as every Ouster has it, and is not applied; turn the \
             sensor's pose instead, or correct the file"
        ))
    })
}

/// The first of two places of one fact; a doubt where the second, at `at`, says something else.
fn first_of<T: PartialEq + std::fmt::Debug>(
    at: &Location,
    first: Option<T>,
    second: Option<T>,
    notes: &mut Vec<Note>,
) -> Option<T> {
    if let (Some(first), Some(second)) = (&first, &second)
        && first != second
    {
        notes.push(Note::doubt(format!(
            "{at}: {second:?}, and another place of the file says {first:?}; the latter is read. Correct one of the two."
        )));
    }
    first.or(second)
}

/// A text that no beam depends on.
fn text(at: &Location, value: Option<Value>, notes: &mut Vec<Note>) -> Option<String> {
    match value? {
        Value::String(text) => Some(text),
        Value::Null => None,
        _ => {
            notes.push(Note::fact(format!("{at}: is no text; not read.")));
            None
        }
    }
}

/// Entry `k` of a 4×4 matrix of millimetres that no beam's direction depends on.
fn entry(at: &Location, value: Option<&Value>, k: usize, notes: &mut Vec<Note>) -> Option<f64> {
    let value = value.filter(|value| !value.is_null())?;
    let numbers = value.as_array().filter(|list| list.len() == 16);
    let entry = numbers.and_then(|list| list[k].as_f64());
    if entry.is_none() {
        notes.push(Note::fact(format!("{at}: is no list of 16 numbers; not read.")));
    }
    entry
}

/// The beams that are there: sensors of the first generation list 64 places, empty ones at 0, 0.
fn real_beams(at: &Location, beams: Beams, facts: &Facts, notes: &mut Vec<Note>) -> Checked<Beams> {
    let Beams::Channels(mut channels) = beams else { return Ok(beams) };
    let count = channels.len();
    // OS-1-16-A0: a family, beams, a revision.
    let named = facts.prod_line.as_deref();
    let named = named.and_then(|line| line.split('-').nth(2)?.parse::<usize>().ok());
    let rows = facts.rows.map(|rows| rows as usize);
    let is_real =
        |channel: &super::Channel| channel.elevation != 0.0 || channel.azimuth_offset != 0.0;
    let real = channels.iter().filter(|channel| is_real(channel)).count();
    let said = [named, rows].into_iter().flatten();
    if said.clone().any(|said| said < count && said == real) {
        channels.retain(is_real);
        notes.push(Note::fact(format!(
            "{at}: {} of {count} places stand at 0, 0 and hold no beam; the {real} others are cast, as many as \
             the file states.",
            count - real
        )));
        return Ok(Beams::Channels(channels));
    }
    if let Some(rows) = rows.filter(|rows| *rows != count) {
        let wanted =
            format!("one angle for each of the {rows} `pixels_per_column`; correct one of the two");
        return Err(bad(at, format!("a list of {count}"), wanted));
    }
    if let Some(named) = named.filter(|named| *named != count) {
        notes.push(Note::doubt(format!(
            "{at}: lists {count} angles, and `prod_line` names {named} beams; the {count} are cast."
        )));
    }
    Ok(Beams::Channels(channels))
}

/// Columns of a turn: as stated, or read from a mode such as `1024x10`.
fn steps(at: &Location, facts: &Facts, notes: &mut Vec<Note>) -> Checked<Option<u32>> {
    let mode_at = at.key("lidar_mode");
    let of_mode = facts.mode.as_deref().map(|mode| {
        let columns = mode.split_once('x').and_then(|(columns, _)| columns.parse::<u64>().ok());
        columns.ok_or_else(|| bad(&mode_at, quoted(mode), "a mode such as \"1024x10\""))
    });
    if let Some(columns) = facts.columns {
        match of_mode {
            Some(Ok(mode)) if mode != columns => notes.push(Note::doubt(format!(
                "{mode_at}: has {mode} columns, and `columns_per_frame` says {columns}; {columns} are cast."
            ))),
            Some(Err(_)) => notes.push(Note::fact(format!("{mode_at}: is no mode; not read."))),
            _ => {}
        }
        return check::count(&at.key("columns_per_frame"), columns, 1, MAX_COLUMNS).map(Some);
    }
    of_mode.transpose()?.map(|columns| check::count(&mode_at, columns, 1, MAX_COLUMNS)).transpose()
}

/// The part of a turn that the sensor is set to look at.
fn window(
    at: &Location,
    facts: &Facts,
    steps: u32,
    notes: &mut Vec<Note>,
) -> Checked<Option<[f64; 2]>> {
    let stated = facts.column_window;
    let stated =
        stated.map(|columns| ColumnWindow::of_columns(&at.key("column_window"), columns, steps));
    // Firmware 1 counts hundredths of a degree, later ones thousandths.
    let unit = if facts.is_firmware_1 { 10.0 } else { 1.0 };
    let window_at = at.key("azimuth_window");
    let angles = facts.azimuth_window;
    if let Some(ends) = angles.filter(|[from, to]| from != to && from.max(*to) <= 360.0) {
        let wanted = "two angles in thousandths of a degree, 360000 a turn: are these degrees?";
        return Err(bad(&window_at, format!("{ends:?}"), wanted));
    }
    if angles == Some([0.0, TURN / 10.0]) && !facts.is_firmware_1 && stated.is_none() {
        notes.push(Note::doubt(format!(
            "{window_at}: 0 to 36 degrees, as thousandths of a degree; hundredths, a whole turn? Write [0, 360000]."
        )));
    }
    let of_angles = angles
        .map(|angles| ColumnWindow::of_angles(&window_at, angles.map(|angle| unit * angle), steps));
    let (stated, of_angles) = (stated.transpose()?, of_angles.transpose()?);
    if let (Some(columns), Some(angles)) = (stated, of_angles)
        && !columns.is_near(&angles, steps)
    {
        notes.push(Note::doubt(format!(
            "{at}: `column_window` holds {} of {steps} columns, and `azimuth_window` {}; the first is cast. Give \
             `azimuth` and `azimuth_steps` for another one.",
            columns.count, angles.count
        )));
    }
    let window = stated.or(of_angles).filter(|window| window.count < steps);
    notes.extend(window.map(|window| {
        Note::fact(format!(
            "The sensor is set to look at {} of {steps} columns; only this window is cast.",
            window.count
        ))
    }));
    Ok(window.map(|window| window.azimuths(steps)))
}

/// Notes on beam origins in the file that one common origin ignores.
fn offsets_dropped(facts: &Facts) -> Vec<Note> {
    let origin = facts.origin.filter(|mm| *mm != 0.0).map(|mm| {
        format!(
            "Beams leave the sensor {mm} mm from its axis; all start at one origin here, and miss their \
             own lines by that times the sine of their azimuth offset."
        )
    });
    let height = facts.height.filter(|mm| *mm != 0.0).map(|mm| {
        format!(
            "The origin of the beams lies {mm} mm above that of the sensor's frame; a pose here is that \
             of the beams."
        )
    });
    origin.into_iter().chain(height).map(Note::fact).collect()
}
