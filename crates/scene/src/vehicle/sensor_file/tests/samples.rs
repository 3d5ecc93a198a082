//! A small file of each format, and errors of broken ones; profiles for Isaac that are read back; tables of real sensors,
//! and directions that a vendor's own library gives.

use std::path::{Path, PathBuf};

use super::super::{self as sensor_file, Beams, SensorFormat, isaac_profile, parse};
use super::{channels, directions, message, notes, read};
use crate::vehicle::{BeamTable, Lidar, Response};
use sightline_files::json::Location;

fn assert_near(got: &[[f64; 3]], want: &[[f64; 3]]) {
    assert_eq!(got.len(), want.len());
    for (got, want) in got.iter().zip(want) {
        let off = got.iter().zip(want).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-7, "{got:?} is not {want:?}");
    }
}

#[test]
fn our_tables() {
    let pattern =
        read(r#"{"name": "two", "elevation_deg": [-5, 5.5], "azimuth_offset_deg": [1, 0]}"#);
    let pattern = pattern.unwrap();
    assert_eq!((pattern.format, pattern.model.as_deref()), (SensorFormat::Table, Some("two")));
    assert_eq!(channels(&pattern), [[-5.0, 1.0], [5.5, 0.0]]);
    let short = r#"{"elevation_deg": [1, 2], "azimuth_offset_deg": [1]}"#;
    let wanted =
        "f: azimuth_offset_deg: a list of 1 is not one offset for each of the 2 elevations";
    assert_eq!(message(short), wanted);
    assert!(message(r#"{"elevation_deg": []}"#).contains("a list of 0 is not 1 to 1024"));
    assert!(message(r#"{"elevation_deg": [0, 90.5]}"#).starts_with("f: elevation_deg[1]: 90.5 "));
    assert_holds!(message(r#"{"name": "none"}"#), "`elevation_deg` is missing", "Hesai");
    assert_holds!(message(r#"{"elevations_deg": [1]}"#), "call `elevations_deg` so, if it lists");
    let facts = message(r#"{"name": "x", "file": "x.npy"}"#);
    assert!(facts.ends_with("it names \"x.npy\" as its `file`; give that one"), "{facts}");
}

/// Radians; a positive correction turns counter-clockwise.
#[test]
fn velodyne_in_block_and_flow() {
    let block = "distance_resolution: 0.002\nlasers:\n- laser_id: 0\n  rot_correction: 0.017453292519943295\n  \
                 vert_correction: -0.2617993877991494\n  vert_offset_correction: 0.21\n  \
                 horiz_offset_correction: -0.026\n- {laser_id: 1, rot_correction: 0, vert_correction: 0.0}\n\
                 num_lasers: 2\n";
    let flow = format!(
        "{{num_lasers: 2, lasers: [{{rot_correction: {}, vert_correction: {},\n vert_offset_correction: \
         0.21, horiz_offset_correction: -0.026}}, {{rot_correction: 0, vert_correction: 0}}]}}",
        1_f64.to_radians(),
        (-15_f64).to_radians()
    );
    let flow = flow.replace("lasers: [", "\nlasers: [");
    for text in [block, &flow] {
        let pattern = read(text).unwrap();
        assert_eq!(pattern.format, SensorFormat::Velodyne);
        let [first, second] = channels(&pattern)[..] else { panic!() };
        assert!((first[0] + 15.0).abs() < 1e-12 && (first[1] - 1.0).abs() < 1e-12, "{first:?}");
        assert_eq!(second, [0.0, 0.0]);
        assert!(pattern.notes[0].text().contains("0 to 210 mm above and -26 to 0 mm beside"));
    }
    let wrong = message("lasers:\n- rot_correction: 0\n");
    assert_holds!(wrong, "lasers[0]: missing key `vert_correction`");
    let nan = message("lasers:\n- {rot_correction: 0, vert_correction: .nan}\n");
    let wanted = "string \".nan\" stands where a number belongs (line 2";
    assert_holds!(nan, "f: lasers[0].vert_correction: ", wanted);
    let tagged = "lasers:\n- {rot_correction: !degrees -2, vert_correction: !degrees 15}\n";
    let [first] = channels(&read(tagged).unwrap())[..] else { panic!() };
    assert!((first[0] - 15.0).abs() < 1e-12 && (first[1] + 2.0).abs() < 1e-12, "{first:?}");
    let length = message(tagged.replace("!degrees 15", "!inches 15"));
    assert_holds!(length, "`!inches` is the unit of a length", "line 2");
    assert!(message("lasers: []\n").contains("a list of 0"));
    let offset = |angle: f64| {
        let text = format!("lasers:\n- {{rot_correction: {angle}, vert_correction: 0.1}}\n");
        read(&text).unwrap().notes.iter().map(ToString::to_string).collect::<String>()
    };
    assert_eq!([offset(0.2), offset(-6.2)], ["", ""]);
    assert!(
        offset(4.2).ends_with("4.2 rad is 241°; degrees? 4.2° are 0.0733 rad"),
        "{}",
        offset(4.2)
    );
}

/// Degrees; offsets count clockwise. Versions, titles, line ends, byte order marks and checksums differ.
#[test]
fn hesai_in_all_its_forms() {
    let texts = [
        "Channel,Elevation,Azimuth\r\n1,14.5,-1.25\r\n2,-3,0\r\n",
        "Laser id,Elevation,Azimuth\n1,14.5,-1.25\n2,-3,0",
        "LaserID,Elevation,Azimuth\n1,14.5,-1.25\n2,-3,0\n\n",
        "EEFF,1,1\nLaser id,Elevation,Azimuth\n1,14.5,-1.25\n2,-3,0\n",
        "\u{feff}Channel,Elevation,Azimuth\r\n1,14.5,-1.25\r\n2,-3,0\r\n",
        "channel,azimuth(deg),elevation(deg)\n1,-1.25,14.5\n2,0,-3\n",
        "# Channel, Elevation, Azimuth\n1,14.5,-1.25\n2,-3,0\n",
    ];
    let checksum = format!("{}{},,\r\n", texts[0], "0123456789abcdef".repeat(4));
    let comments = ["made by x, y", "Elevation, in degrees", "azimuth and elevation", "Elevation"];
    let commented = comments.map(|comment| format!("# {comment}\n{}", texts[0]));
    let more = commented.iter().map(String::as_str).chain([checksum.as_str()]);
    for text in texts.into_iter().chain(more) {
        let pattern = read(text).unwrap();
        assert_eq!(pattern.format, SensorFormat::Hesai, "{text}");
        assert_eq!(channels(&pattern), [[14.5, 1.25], [-3.0, 0.0]], "{text}");
        assert!(channels(&pattern)[1][1].is_sign_positive());
        assert_eq!(notes(&pattern), "", "{text}");
    }
    let gap = message("Channel,Elevation,Azimuth\n1,14.5,-1.25\n5,,\n");
    assert_eq!(gap, "f: line 3: \"\" is not a number in column 2, as 1.5");
    let untitled = message("Channel,Elevation,Horizontal offset\n1,2,3\n");
    assert_holds!(untitled, "line 1: ", "write `Channel,Elevation,Azimuth`");
    for plain in ["elevation\n14.5\n-3\n", "channel,elevation_deg\n1,14.5\n2,-3\n"] {
        let pattern = read(plain).unwrap();
        assert_eq!(channels(&pattern), [[14.5, 0.0], [-3.0, 0.0]], "{plain}");
        assert!(notes(&pattern).contains("line 1: has no column `Azimuth`; offsets are 0"));
    }
    assert!(message("Channel,Elevation,Azimuth\n").contains("a list of 0"));
    // The firing table of a Hesai holds no angles.
    let firing = message("EEFF,1,1\nLaserNum,80,BlockNum,2\nLoop1,Loop2\n49,17\n");
    assert_holds!(firing, "not that of a");
    let counter = message("Channel,Elevation,Azimuth (ccw)\n1,14.5,-1.25\n");
    assert!(counter.contains("a column of azimuths that count clockwise"), "{counter}");
}

#[test]
fn ouster_flat_and_nested() {
    let flat = r#"{"beam_altitude_angles": [20.5, -1], "beam_azimuth_angles": [4.25, 0],
        "lidar_mode": "512x10", "prod_line": "OS-1-2", "lidar_origin_to_beam_origin_mm": 15.806}"#;
    let nested = r#"{"beam_intrinsics": {"beam_altitude_angles": [20.5, -1], "beam_azimuth_angles": [4.25, 0]},
        "sensor_info": {"prod_line": "OS-1-2"}, "config_params": {"lidar_mode": "2048x10",
        "azimuth_window": [0, 360000]}, "lidar_data_format": {"columns_per_frame": 2048},
        "lidar_intrinsics": {"lidar_to_sensor_transform": [-1,0,0,0, 0,-1,0,0, 0,0,1,38.195, 0,0,0,1]}}"#;
    for (text, steps, note) in [(flat, 512, "15.806 mm"), (nested, 2048, "38.195 mm above")] {
        let pattern = read(text).unwrap();
        assert_eq!(channels(&pattern), [[20.5, -4.25], [-1.0, 0.0]]);
        assert_eq!(pattern.azimuth_steps, Some(steps));
        assert_eq!(pattern.model.as_deref(), Some("OS-1-2"));
        assert_holds!(pattern.notes[0], note);
    }
    // The name that Ouster Studio writes.
    let studio = read(
        nested.replace("config_params", "config_txt").replace("[0, 360000]", "[90000, 270000]"),
    );
    let [from, to] = studio.unwrap().azimuth.unwrap();
    assert!((from - -90.0).abs() < 0.2 && (to - 90.0).abs() < 0.2, "{from} {to}");
    let missing = message(r#"{"beam_intrinsics": {"beam_altitude_angles": [1]}}"#);
    assert_begins!(missing, "f: beam_intrinsics: `beam_azimuth_angles` is missing");
    let mode = message(flat.replace("512x10", "fast"));
    assert_eq!(mode, "f: lidar_mode: \"fast\" is not a mode such as \"1024x10\"");
}

#[test]
fn livox_cuts_a_window() {
    let with = "Time/s,Azimuth/deg,Zenith/deg\n0,0,90\n0.05,90,60\n0.1,180,90\n0.15,270,180\n";
    let without = with.split_once('\n').unwrap().1;
    let (half, root) = (0.5, 0.75_f64.sqrt());
    for text in [with, without] {
        let pattern = read(text).unwrap();
        assert_near(directions(&pattern), &[[1.0, 0.0, 0.0], [0.0, root, half]]);
        assert!(pattern.notes[0].text().contains("2 of 4 samples"), "{:?}", pattern.notes);
        let later = parse(&Location::top("f"), text.as_bytes(), Some([0.1, 1.0])).unwrap();
        assert_near(directions(&later), &[[-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]]);
        let none = parse(&Location::top("f"), text.as_bytes(), Some([2.0, 3.0]));
        assert_holds!(none.unwrap_err(), "0 of 4 samples from 2 to 3 s");
    }
    assert_begins!(message("Time,Azimuth,Zenith\n0,0,181\n"), "f: line 2: 181 is not a zenith");
    assert!(message("Time,Azimuth,Zenith\n").contains("0 of 0 samples"));
    // The window begins with the least time, whatever the order of rows.
    let mixed = read("0.05,90,60\n0.15,270,180\n0,0,90\n").unwrap();
    assert_near(directions(&mixed), &[[0.0, root, half], [1.0, 0.0, 0.0]]);
    for title in ["Time/us", "time (ms)", "Time_ns"] {
        let said = message(format!("{title},Azimuth/deg,Zenith/deg\n0,0,90\n10,1,85\n"));
        assert_holds!(said, "a column of seconds; convert it");
    }
}

#[test]
fn robosense_with_one_column_or_two() {
    let one = read("-15.5\r\n 0\r\n").unwrap();
    assert_eq!(one.format, SensorFormat::RoboSense);
    assert_eq!(channels(&one), [[-15.5, 0.0], [0.0, 0.0]]);
    assert_eq!(channels(&read("89.5,0\n-3,7.25\n").unwrap()), [[89.5, 0.0], [-3.0, -7.25]]);
    assert_eq!(message("1,2\n3\n"), "f: line 2: \"3\" is not a row of 2 columns, as the first one");
    // A spreadsheet writes a comma behind the last column.
    let open = read("-25.0,1.5,\n-20,2,\n").unwrap();
    assert_eq!(channels(&open), channels(&read("-25.0,1.5\n-20,2\n").unwrap()));
}

#[test]
fn isaac_that_turns_and_that_does_not() {
    let state = r#"{"azimuthDeg": [3, -3], "elevationDeg": [-15, 15], "fireTimeNs": [0, 1]}"#;
    let profile = |kind: &str, more: &str, states: &str| {
        format!(
            r#"{{"class": "sensor", "name": "x", "profile": {{"scanType": "{kind}", "farRangeM": 200.0,
                "scanRateBaseHz": 10, "reportRateBaseHz": 36000, {more} "emitterStates": [{states}]}}}}"#
        )
    };
    let pattern = read(profile("rotary", "", state)).unwrap();
    assert_eq!((pattern.azimuth_steps, pattern.model.as_deref()), (Some(3600), Some("x")));
    assert_eq!(channels(&pattern), [[-15.0, 3.0], [15.0, -3.0]]);
    assert_eq!((pattern.measures.range, pattern.measures.rate), (Some(200.0), Some(10.0)));
    assert_eq!(pattern.notes, []);
    // Two states take turns, so that the second one is a column further on.
    for (more, sign) in [("\"rotationDirection\": \"CW\",", -1.0), ("", 1.0)] {
        let pattern = read(profile("rotary", more, &format!("{state}, {state}"))).unwrap();
        assert_eq!(pattern.azimuth_steps, Some(1800));
        assert_eq!(channels(&pattern)[2..], [[-15.0, 3.0 + 0.1 * sign], [15.0, -3.0 + 0.1 * sign]]);
    }
    let uneven = message(profile("rotary", "", &[state; 7].join(",")));
    assert!(uneven.contains("7 states in 3600 columns a turn"), "{uneven}");
    let solid = read(profile("solidState", "", &format!("{state}, {state}"))).unwrap();
    let (up, out) = (15_f64.to_radians().sin(), 15_f64.to_radians().cos());
    let (ahead, aside) = (3_f64.to_radians().cos() * out, 3_f64.to_radians().sin() * out);
    assert_near(directions(&solid), &[[ahead, aside, -up], [ahead, -aside, up]]);
    assert!(solid.notes[0].text().contains("The first of 2 emitter states is cast"));
    assert!(message(profile("flash", "", state)).contains("\"flash\" is not \"rotary\" or"));
    let short = message(profile("rotary", "", &state.replace("3, -3", "3")));
    assert!(short.contains("emitterStates[0]: 1 azimuths and 2 elevations"), "{short}");
    assert!(message(profile("rotary", "", "")).contains("a list of 0"));
}

/// A ray leaves along the third column, from the fourth one.
#[test]
fn rgl_matrices() {
    let level = [0.0_f32, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.03];
    let left = [0.0_f32, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0];
    let bytes: Vec<u8> = level.iter().chain(&left).flat_map(|v| v.to_le_bytes()).collect();
    let pattern = read(&bytes).unwrap();
    assert_eq!(pattern.format, SensorFormat::Rgl);
    assert_near(directions(&pattern), &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert!(pattern.notes[0].text().contains("30 mm"));
    assert!(message(&bytes[..95]).contains("95 bytes is not a multiple of 48"));
    let mut skewed = bytes.clone();
    skewed[48 + 26] = 0x40;
    assert!(message(&skewed).starts_with("f: matrix 1: its third column is not a unit vector"));
}

#[test]
fn numpy_arrays() {
    let array = |descr: &str, shape: &str, data: &[u8]| {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
        let header = format!("{header:<117}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    };
    let angles = [0.0, 0.0, std::f64::consts::FRAC_PI_2, std::f64::consts::FRAC_PI_6];
    let double: Vec<u8> = angles.iter().flat_map(|v| v.to_le_bytes()).collect();
    let single: Vec<u8> = angles.iter().flat_map(|v| (*v as f32).to_le_bytes()).collect();
    for (descr, data) in [("<f8", &double), ("<f4", &single)] {
        let pattern = read(array(descr, "(2, 2)", data)).unwrap();
        assert_near(directions(&pattern), &[[1.0, 0.0, 0.0], [0.0, 0.75_f64.sqrt(), 0.5]]);
    }
    assert!(message(array("<i8", "(2, 2)", &double)).contains("float32 or float64"));
    assert!(message(array("<f8", "(4,)", &double)).contains("an array [N, 2]"));
    let large = message(array("<f8", "(1152921504606846976, 2)", &double));
    assert!(large.contains("promises more elements than any file holds"), "{large}");
    assert!(message(array("<f4", "(2, 2)", &double)).contains("write it again"));
    assert!(message(array("<f4", "(0, 2)", &[])).contains("a list of 0 is not 1 to"));
    assert!(message(b"\x93NUMPY").contains("a header where it ends inside the header"));
}

#[test]
fn the_unknown_is_told_what_is_read() {
    for bytes in
        [&b"<sdf/>"[..], b"\xee\xff\x01\x05\0\0", b"a,b,c\n", b"1,2,3,4\n", b"EEFF,1,1\n", b"PK"]
    {
        let told = message(bytes);
        assert_begins!(told, "f: the content is not that of a sensor file that is read");
        for vendor in ["Velodyne", "Hesai", "Ouster", "Livox", "RoboSense", "Isaac", "RGL"] {
            assert_holds!(told, vendor);
        }
    }
    assert!(message(b"").contains("the file is empty"));
}

/// A sensor of two channels, one of them off to the left.
fn spinning(azimuth_steps: u32, azimuth: Option<[f64; 2]>) -> Lidar {
    spinning_at([-24.123456789, 15.0], [0.0, 1.7], azimuth_steps, azimuth)
}

fn spinning_at(
    elevations: [f64; 2],
    offsets: [f64; 2],
    azimuth_steps: u32,
    azimuth: Option<[f64; 2]>,
) -> Lidar {
    let (elevations, azimuth_offsets) = (elevations.to_vec(), offsets.to_vec());
    Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range: 120.0 }
}

/// The beams that a profile is read as.
fn beams(profile: &serde_json::Value) -> (BeamTable, bool) {
    let pattern = read(profile.to_string()).unwrap();
    assert_eq!(pattern.format, SensorFormat::Isaac);
    assert_eq!(pattern.model.as_deref(), Some("a sensor"));
    let measures = pattern.measures;
    assert_eq!((measures.range, measures.min_range), (Some(120.0), Some(0.7)));
    assert_eq!((measures.noise, measures.rated_range), (Some(0.03), Some(70.0)));
    assert_eq!(measures.rate, Some(12.5));
    let (steps, azimuth) = pattern.columns(pattern.azimuth_steps.unwrap_or(1));
    let lidar = match pattern.beams {
        Beams::Directions(directions) => Lidar::Directions { directions, range: 120.0 },
        Beams::Channels(channels) => Lidar::Spinning {
            elevations: channels.iter().map(|channel| channel.elevation).collect(),
            azimuth_offsets: channels.iter().map(|channel| channel.azimuth_offset).collect(),
            azimuth_steps: steps,
            azimuth,
            range: 120.0,
        },
    };
    (lidar.table().unwrap(), matches!(lidar, Lidar::Spinning { .. }))
}

#[test]
fn profiles_are_read_back_as_the_same_beams_in_the_same_order() {
    let response = Response {
        rate: 12.5,
        rated_range: 70.0,
        noise: 0.03,
        min_range: 0.7,
        ..Response::usual(120.0)
    };
    let listed = vec![[1.0, 0.0, 0.0], [0.6, 0.0, 0.8], [-0.48, -0.64, -0.6], [0.0, 0.0, 1.0]];
    let tilted = spinning_at([100.0, 10.0], [0.0; 2], 36, None);
    for (lidar, turns) in [
        (spinning(900, None), true),
        // Columns of a turn of 360: a window of it, before and behind 0°.
        (spinning(121, Some([-60.0, 60.0])), true),
        (spinning(31, Some([300.0, 330.0])), true),
        // 120° in 239 steps: no turn has such columns.
        (spinning(240, Some([-60.0, 60.0])), false),
        (spinning(61, Some([330.0, 390.0])), false),
        (spinning(1, Some([5.0, 5.0])), false),
        (tilted, false),
        (Lidar::Directions { directions: listed, range: 120.0 }, false),
    ] {
        let wanted = lidar.table().unwrap();
        let (found, is_rotary) = beams(&isaac_profile("a sensor", &lidar, &response));
        assert_eq!(is_rotary, turns, "{lidar:?}");
        assert_eq!(found.directions().len(), wanted.directions().len(), "{lidar:?}");
        for (k, (found, wanted)) in found.directions().iter().zip(wanted.directions()).enumerate() {
            for (a, b) in found.iter().zip(wanted) {
                assert!((a - b).abs() < 2e-7, "beam {k} of {lidar:?}: {found:?}, not {wanted:?}");
            }
        }
    }
}

fn sensors() -> PathBuf {
    Path::new(env!("REAL_DATA")).join("sensors")
}

/// Every table and pattern is read; the notes on the two patterns hold no beams.
#[test]
#[cfg_attr(not(has_sensors), ignore = "needs sensors in ../shared/data or SIGHTLINE_DATA")]
fn every_table_of_a_real_sensor_is_read() {
    let (mut tables, mut patterns) = (0, 0);
    for entry in std::fs::read_dir(sensors()).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            continue;
        }
        let text = std::fs::read(&path).unwrap();
        if String::from_utf8_lossy(&text).contains("\"non-repetitive scan pattern\"") {
            continue;
        }
        match sensor_file::read(&path, None).unwrap().beams {
            Beams::Channels(channels) => {
                let plain: serde_json::Value = serde_json::from_slice(&text).unwrap();
                assert_eq!(plain["channels"], channels.len(), "{}", path.display());
                tables += 1;
            }
            Beams::Directions(directions) => {
                assert!(directions.len() >= 20_000, "{}", path.display());
                patterns += 1;
            }
        }
    }
    assert_eq!((tables, patterns), (23, 2));
}

/// (channel, column, unit direction): `ouster.sdk.core.XYZLut(info, use_extrinsics=False)` of ouster-sdk
/// 1.0.1, at the ranges of 2000 and 1000 mm; the difference, normalized.
type Golden = [(usize, usize, [f64; 3]); 6];

const OS1: Golden = [
    (0, 0, [-0.931372864, 0.068559182, 0.357553111]),
    (0, 1, [-0.930934660, 0.074272688, 0.357553111]),
    (1, 700, [0.357993134, -0.864431899, 0.352984998]),
    (63, 512, [0.997289771, 0.073411384, -0.004886902]),
    (127, 1023, [-0.925428402, -0.073670839, -0.371691916]),
    (64, 100, [-0.772948389, 0.634370571, -0.011169875]),
];

const OS0: Golden = [
    (0, 0, [-0.702898549, 0.134720891, 0.698415285]),
    (0, 1, [-0.702058686, 0.139031260, 0.698415285]),
    (1, 700, [0.249859841, -0.677775592, 0.691513056]),
    (63, 512, [0.989470061, 0.144524446, -0.007853901]),
    (127, 1023, [-0.679049646, -0.136569727, -0.721276845]),
    (64, 100, [-0.726350828, 0.687025936, -0.020244436]),
];

#[test]
#[cfg_attr(not(has_sensors), ignore = "needs sensors in ../shared/data or SIGHTLINE_DATA")]
fn ouster_metadata_gives_the_directions_of_its_sdk() {
    for (file, golden) in [("os1_128", OS1), ("os0_128", OS0)] {
        let path = sensors().join(format!("raw/ouster_{file}_metadata.json"));
        let pattern = sensor_file::read(&path, None).unwrap();
        let steps = pattern.azimuth_steps.unwrap();
        assert_eq!((pattern.format, steps), (SensorFormat::Ouster, 1024));
        let table = Lidar::from_sensor_file(&path, steps, 100.0).unwrap().table().unwrap();
        for (channel, column, want) in golden {
            // Columns of the sensor go clockwise from behind, ours counter-clockwise from ahead.
            let step = (512 + 1024 - column) % 1024;
            let got = table.directions()[channel * 1024 + step];
            let off = (0..3).map(|axis| (f64::from(got[axis]) - want[axis]).abs());
            assert!(off.clone().fold(0.0, f64::max) < 1e-6, "{file} {channel} {column}: {got:?}");
        }
    }
}
