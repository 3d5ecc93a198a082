//! A file's own word (windows, counts, ranges, and parts that are an error's text), and likely mistakes in it: radians,
//! channels that are there twice, decimal commas, spreadsheets.

use super::super::{Beams, Measures};
use super::{channels, doubts, message, notes, read};

/// 16 channels of 1024 columns with other parts beside them.
fn ouster(more: &str) -> String {
    let angles: Vec<String> = (0..16).map(|k| format!("{}", 15 - 2 * k)).collect();
    let angles = angles.join(", ");
    format!(
        r#"{{"beam_altitude_angles": [{angles}], "beam_azimuth_angles": [{angles}], "lidar_mode": "1024x20"{more}}}"#
    )
}

#[test]
fn ouster_windows_are_cast_alone() {
    // Columns 384 to 639 lie around the middle one, which looks ahead.
    let columns = r#", "data_format": {"columns_per_frame": 1024, "column_window": [384, 639]}"#;
    let step = 360.0 / 1024.0;
    let pattern = read(ouster(columns)).unwrap();
    assert_eq!(pattern.columns(1024), (256, Some([-127.0 * step, 128.0 * step])));
    // Half of the columns a turn, half of the columns in the window.
    assert_eq!(pattern.columns(512).0, 128);
    assert!(notes(&pattern).contains("256 of 1024 columns"));
    assert_eq!(pattern.measures.rate, Some(20.0));
    // A window through column 0, which looks back; the same one as angles.
    let back = r#", "data_format": {"column_window": [1022, 1]}"#;
    let angles = r#", "config_params": {"azimuth_window": [359500, 900]}"#;
    for window in [back, angles] {
        let ends = [180.0 - step, 180.0 + 2.0 * step];
        assert_eq!(read(ouster(window)).unwrap().columns(1024), (4, Some(ends)));
    }
    // ouster-sdk's 2_5_0_os-992146000760-128.json has both spellings of one window.
    let both = r#", "config_params": {"azimuth_window": [583, 39402]},
                   "lidar_data_format": {"columns_per_frame": 1024, "column_window": [912, 1022]}"#;
    let pattern = read(ouster(both)).unwrap();
    assert_eq!(pattern.columns(1024).0, 111);
    assert_eq!(pattern.notes.len(), 1, "{}", notes(&pattern));
    let apart = both.replace("39402", "90000");
    assert!(read(ouster(&apart)).unwrap().notes.iter().any(sightline_files::Note::is_doubt));
    for whole in [
        r#", "config_params": {"azimuth_window": [0, 360000]}"#,
        r#", "data_format": {"column_window": [0, 1023]}"#,
        // Firmware 1 counts hundredths of a degree.
        r#", "build_rev": "v1.13.0", "config_params": {"azimuth_window": [0, 36000]}"#,
    ] {
        let pattern = read(ouster(whole)).unwrap();
        assert_eq!((pattern.columns(1024), pattern.notes.len()), ((1024, None), 0), "{whole}");
    }
    let far = message(ouster(r#", "data_format": {"column_window": [0, 1024]}"#));
    assert_eq!(far, "f: column_window[1]: 1024 is not a whole number from 0 to 1023");
}

#[test]
fn ouster_counts_fit_their_lists() {
    let sparse = r#"{"prod_line": "OS-1-2-A0", "lidar_mode": "512x10",
        "beam_altitude_angles": [0, 5, 0, -5], "beam_azimuth_angles": [0, 1, 0, 0]}"#;
    let pattern = read(sparse).unwrap();
    let found = channels(&pattern);
    assert_eq!((found.len(), found[1][0]), (2, -5.0));
    assert_holds!(notes(&pattern), "2 of 4 places");
    let three = read(sparse.replace("OS-1-2", "OS-1-3")).unwrap();
    assert_eq!(channels(&three).len(), 4);
    assert_holds!(doubts(&three).join("\n"), "names 3 beams");
    let rows = message(ouster(r#", "data_format": {"pixels_per_column": 15}"#));
    assert_holds!(rows, "a list of 16 is not one angle for each of the 15");
    let modes = read(ouster(r#", "data_format": {"columns_per_frame": 512}"#)).unwrap();
    assert!(modes.notes[0].is_doubt() && modes.azimuth_steps == Some(512));
}

/// Firmware 1.12 answers a question that it does not know with a text.
#[test]
fn ouster_parts_that_nothing_needs_may_be_broken() {
    let broken = r#", "lidar_data_format": "error: Command not recognized.", "calibration_status": "error",
        "lidar_to_sensor_transform": "error", "lidar_origin_to_beam_origin_mm": [], "prod_line": 7, "odd": {"a": 1}"#;
    let pattern = read(ouster(broken)).unwrap();
    assert_eq!((pattern.azimuth_steps, pattern.model.as_deref()), (Some(1024), None));
    let said = notes(&pattern);
    assert_holds!(said, "lidar_data_format: the text", "lidar_to_sensor_transform: is no list");
    assert_holds!(
        said,
        "origin_mm: is no number",
        "prod_line: is no text",
        "`odd`: not known here"
    );
    assert!(!said.contains("calibration_status"), "{said}");
    let needed = message(r#"{"beam_intrinsics": "error: Command not recognized."}"#);
    assert_begins!(needed, "f: beam_intrinsics: \"error: Command");
}

fn isaac(kind: &str, more: &str) -> String {
    format!(
        r#"{{"profile": {{"scanType": "{kind}", "scanRateBaseHz": 10, "reportRateBaseHz": 3600, {more}
            "emitterStates": [{{"azimuthDeg": [-80, 0, 40], "elevationDeg": [-5, 0, 5]}}]}}}}"#
    )
}

#[test]
fn isaac_ranges_and_errors_are_the_files() {
    let more = r#""nearRangeM": 0.5, "farRangeM": 120, "rangeAccuracyM": 0.03, "minReflectance": 0.4,
        "minReflectanceRange": 100,"#;
    let pattern = read(isaac("rotary", more)).unwrap();
    // A quarter of the reflectance halves the range.
    let wanted = Measures {
        range: Some(120.0),
        min_range: Some(0.5),
        rated_range: Some(50.0),
        noise: Some(0.03),
        rate: Some(10.0),
    };
    assert_eq!((pattern.measures, pattern.notes), (wanted, vec![]));
    let beyond = read(isaac("rotary", r#""farRangeM": 45, "minReflectanceRange": 270,"#)).unwrap();
    assert!(beyond.notes[0].is_doubt() && beyond.notes[0].text().contains("270 m at 10 %"));
    let near = message(isaac("rotary", r#""farRangeM": 45, "nearRangeM": 50,"#));
    assert_eq!(near, "f: profile.nearRangeM: 50 is not a number from 0 to 45");
    let odd =
        read(isaac("rotary", r#""rollingShutter": true, "_comment4": "x", "wavelengthNm": 905,"#));
    assert!(notes(&odd.unwrap()).starts_with("f: profile: `rollingShutter`: not known here"));
}

#[test]
fn isaac_windows_and_counts() {
    let turn = read(isaac("rotary", r#""startAzimuthDeg": 0, "endAzimuthDeg": 360,"#)).unwrap();
    assert_eq!((turn.azimuth, turn.notes.len()), (None, 0));
    let part = r#""startAzimuthDeg": -45, "endAzimuthDeg": 45.5,"#;
    let pattern = read(isaac("rotary", part)).unwrap();
    assert_eq!(pattern.columns(360), (91, Some([-45.0, 45.0])));
    // The valid part cuts the other one, a turn further on or not.
    let valid = format!(r#"{part} "validStartAzimuthDeg": 350, "validEndAzimuthDeg": 20,"#);
    assert_eq!(read(isaac("rotary", &valid)).unwrap().columns(360), (31, Some([-10.0, 20.0])));
    let solid = read(isaac("solidState", part)).unwrap();
    assert!(matches!(&solid.beams, Beams::Directions(all) if all.len() == 2));
    assert!(notes(&solid).contains("2 of 3 emitters"));
    for (count, place) in [
        (r#""numberOfEmitters": 4,"#, "f: profile.numberOfEmitters: 4 is not the 3 emitters"),
        (r#""emitterStateCount": 2,"#, "f: profile.emitterStateCount: 2 is not the 1 states"),
        (
            r#""numRaysPerLine": [2, 2],"#,
            "f: profile.numRaysPerLine: 4 rays is not as many in all as the 3",
        ),
        (
            r#""rotationDirection": "left","#,
            "f: profile.rotationDirection: \"left\" is not \"CW\" or \"CCW\"",
        ),
    ] {
        assert_begins!(message(isaac("rotary", count)), place);
    }
}

#[test]
fn counts_of_tables_and_lasers_fit() {
    let table = r#"{"elevation_deg": [1, 2.5], "channels": 3}"#;
    for count in ["3", "3.0", "\"3\""] {
        let said = message(table.replace("\"channels\": 3", &format!("\"channels\": {count}")));
        assert!(said.starts_with("f: channels: 3 is not the 2 elevations"), "{said}");
    }
    let uneven = read(isaac("rotary", "").replace("3600", "3605")).unwrap();
    assert_eq!(uneven.azimuth_steps, Some(361));
    let told = "3605 columns a second in 10 turns are 360.5 a turn; 361 are cast";
    assert_holds!(notes(&uneven), told);
    let lasers = "num_lasers: 3\nlasers:\n- {rot_correction: 0, vert_correction: 0.1}\n";
    let twice = "lasers:\n- {laser_id: 0, rot_correction: 0, vert_correction: 0.1}\n\
                 - {laser_id: 0, rot_correction: 0, vert_correction: 0.2}\n";
    let comma = "lasers:\n- {rot_correction: 0, vert_correction: 0,2}\n";
    let across = "lasers:\n- {rot_correction: 400, vert_correction: 0.1}\n";
    let up = "lasers:\n- {rot_correction: 0, vert_correction: 100}\n";
    for (text, start) in [
        (lasers, "f: num_lasers: 3 is not the 1 lasers"),
        (twice, "f: lasers[1].laser_id: 0 is not an id of its own"),
        (comma, "f: lasers[0]: the key `2` is not the name of one; write decimals"),
        (across, "f: lasers[0].rot_correction: 400 is not an azimuth in radians"),
        (up, "f: lasers[0].vert_correction: 100 is not an elevation in radians"),
    ] {
        assert_begins!(message(text), start);
    }
    let odd = "speed: 1\nlasers:\n- {rot_correction: 0, vert_correction: 0.1, colour: 2, dist_correction: 1}\n";
    let said = notes(&read(odd).unwrap());
    assert_holds!(said, "`speed`: not known", "lasers[0]: `colour`: not known");
    assert!(!said.contains("dist_correction"));
}

/// Output of `sensor info --format json` for a sensor with a window is read back.
#[test]
fn facts_are_a_table() {
    let facts = r#"{"elevation_deg": [-5, 5], "azimuth_steps": 360, "azimuth_window": [-45, 45], "range": 80,
        "rated_range": 40, "noise": 0.03, "format": "x", "beams": 182, "odd": 1, "azimuth_sign": "clockwise",
        "azimuth_offset_deg": [0, 2]}"#;
    let pattern = read(facts).unwrap();
    assert_eq!(pattern.columns(360), (91, Some([-45.0, 45.0])));
    assert_eq!((pattern.measures.range, pattern.measures.noise), (Some(80.0), Some(0.03)));
    assert_holds!(notes(&pattern), "`odd`: not known", "`\"azimuth_offsets\": \"clockwise\"`");
}

/// Two values of one fact: refused where they decide the beams, else a doubt that has both.
#[test]
fn conflicting_values_are_told() {
    let twice = "Channel,Elevation,Elevation,Azimuth\n1,15,16,-2\n2,14,13,1\n";
    assert_begins!(message(twice), "f: line 1: \"Elevation\" is not the only column of that title");
    assert!(message("Channel,Channel,Elevation\n1,2,15\n").contains("\"Channel\" is not the only"));
    assert_holds!(message("Time,Azimuth,Zenith,Zenith\n0,1,90,91\n"), "\"Zenith\" is not the only");
    let table = |more: &str| format!(r#"{{"elevation_deg": [-15, 0], {more}}}"#);
    let told = message(table(r#""azimuth_steps": 100, "columns_per_frame": 200"#));
    let both =
        "f: columns_per_frame: 200 is not 100, as `azimuth_steps` says; correct one of the two";
    assert_eq!(told, both);
    assert!(read(table(r#""azimuth_steps": 100, "columns_per_frame": 100"#)).is_ok());
    let rated = read(table(r#""azimuth_steps": 100, "range": 50, "rated_range": 80"#)).unwrap();
    assert!(rated.notes[0].is_doubt(), "{}", notes(&rated));
    assert_holds!(notes(&rated), "a range of 80 m at 10 % reflectance lies beyond `range`, 50 m");
    let near = read(table(r#""azimuth_steps": 100, "range": 50, "rated_range": 50"#)).unwrap();
    assert!(near.notes.is_empty(), "{}", notes(&near));
    for (more, both) in [
        (r#", "config_params": {"lidar_mode": "512x10"}"#, ["1024x20", "512x10"]),
        (
            r#", "lidar_data_format": {"columns_per_frame": 1024}, "data_format": {"columns_per_frame": 512}"#,
            ["512", "1024"],
        ),
    ] {
        let pattern = read(ouster(more)).unwrap();
        assert_holds!(doubts(&pattern)[0], both[0], both[1]);
    }
}

#[test]
fn two_rates_of_an_isaac_profile_agree_or_are_doubted() {
    let doubted = |rate: u32| {
        let pattern = read(isaac("rotary", &format!("\"patternFiringRateHz\": {rate},"))).unwrap();
        assert_eq!(pattern.azimuth_steps, Some(360));
        doubts(&pattern).join("\n").contains("is 3600 and `patternFiringRateHz` 1800")
    };
    assert!(doubted(1800) && !doubted(3600));
}

/// 16 states at 3600 columns a turn: the columns of a window are a tenth of a degree apart, not 1.6 degrees.
#[test]
fn isaac_windows_cut_the_columns_of_all_states() {
    let profile = |window: [f64; 2], turns: &str| {
        let states: Vec<String> = (0..16)
            .map(|k| format!(r#"{{"azimuthDeg": [0], "elevationDeg": [{}]}}"#, k - 8))
            .collect();
        format!(
            r#"{{"profile": {{"scanType": "rotary", "scanRateBaseHz": 10, "reportRateBaseHz": 36000, {turns}
            "startAzimuthDeg": {}, "endAzimuthDeg": {}, "emitterStates": [{}]}}}}"#,
            window[0],
            window[1],
            states.join(", ")
        )
    };
    // Azimuth and elevation of each beam, in degrees: state s looks up by s − 8.
    let beams = |text: String| -> Vec<[f64; 2]> {
        let pattern = read(text).unwrap();
        let mut beams: Vec<[f64; 2]> = match &pattern.beams {
            Beams::Directions(all) => all
                .iter()
                .map(|[x, y, z]| [y.atan2(*x).to_degrees(), z.asin().to_degrees()])
                .collect(),
            Beams::Channels(all) => {
                let steps = pattern.azimuth_steps.unwrap();
                let (count, window) = pattern.columns(steps);
                let at = |k: u32| window.unwrap()[0] + f64::from(k) * 360.0 / f64::from(steps);
                let of = |k| all.iter().map(move |c| [at(k) + c.azimuth_offset, c.elevation]);
                (0..count).flat_map(of).collect()
            }
        };
        beams.sort_by(|a, b| a[0].total_cmp(&b[0]));
        beams
    };
    for (window, first, count, turns, clockwise) in [
        ([1.0, 2.0], 10, 11, "", false),
        ([1.0, 2.0], 10, 11, r#""rotationDirection": "CW","#, true),
        // Two whole rounds of the states stay channels.
        ([0.5, 3.6], 5, 32, "", false),
        ([0.5, 3.6], 5, 32, r#""rotationDirection": "CW","#, true),
    ] {
        let beams = beams(profile(window, turns));
        assert_eq!(beams.len(), count, "{window:?} {turns}");
        for (k, beam) in beams.iter().enumerate() {
            let column = first + k as i64;
            let state = if clockwise { -column } else { column }.rem_euclid(16);
            let wanted = [0.1 * column as f64, (state - 8) as f64];
            let off = (beam[0] - wanted[0]).abs().max((beam[1] - wanted[1]).abs());
            assert!(off < 1e-6, "{window:?} {turns}: {beam:?}, {wanted:?}");
        }
    }
    let empty = message(profile([1.01, 1.09], ""));
    assert!(empty.contains("a window that holds a column, one every 0.1 degrees"), "{empty}");
}

#[test]
fn ouster_transforms_that_are_others_are_doubted() {
    let transform = |t: &str| ouster(&format!(r#", "lidar_to_sensor_transform": [{t}]"#));
    let identity = read(transform("1,0,0,0, 0,1,0,0, 0,0,1,36.18, 0,0,0,1")).unwrap();
    assert_holds!(notes(&identity), "is not a half turn about z");
    let half = read(transform("-1,0,0,0, 0,-1,0,0, 0,0,1,36.18, 0,0,0,1")).unwrap();
    assert_eq!(doubts(&half), [""; 0]);
    let origin = |moved: f64| {
        let more = format!(
            r#", "lidar_origin_to_beam_origin_mm": 15.806, "beam_to_lidar_transform": [1,0,0,{moved}, 0,1,0,0, 0,0,1,0, 0,0,0,1]"#
        );
        read(ouster(&more)).unwrap()
    };
    let other = origin(27.1);
    let said = notes(&other);
    assert_holds!(said, "moves beams by 27.1 mm, and `lidar_origin_to_beam_origin_mm` says 15.806");
    assert_eq!(doubts(&origin(15.806)), [""; 0]);
}

#[test]
fn radians_in_place_of_degrees() {
    for (low, high, count) in [(-0.26, 0.26, 16), (-0.785, 0.785, 32), (-1.5, 1.5, 128)] {
        let step = (high - low) / f64::from(count - 1);
        let elevations: Vec<String> =
            (0..count).map(|k| (low + f64::from(k) * step).to_string()).collect();
        let pattern = read(format!(r#"{{"elevation_deg": [{}]}}"#, elevations.join(","))).unwrap();
        let said = doubts(&pattern);
        assert!(said.len() == 1 && said[0].contains("radians?"), "{said:?}");
    }
    // A short-range sensor of four channels, and one channel.
    for fine in ["[-1.5, -0.5, 0.5, 1.5]", "[0.1]"] {
        let pattern = read(format!(r#"{{"elevation_deg": {fine}}}"#)).unwrap();
        assert!(doubts(&pattern).is_empty(), "{pattern:?}");
    }
    let degrees = message("lasers:\n- {rot_correction: 0, vert_correction: -15}\n");
    assert!(degrees.contains("vert_correction: -15 is not an elevation in radians"), "{degrees}");
    let rows: String =
        (0..20).map(|k| format!("0.00{k:02},{},1.5{k:02}\n", 0.3 * f64::from(k))).collect();
    let livox = read(format!("Time,Azimuth,Zenith\n{rows}")).unwrap();
    assert!(doubts(&livox)[0].contains("radians?"), "{livox:?}");
    for few in ["0,0.1,1.57\n0.001,0.5,1.50\n0.002,3.1,1.4\n", "Time,Azimuth,Zenith\n0,0.1,1.57\n"]
    {
        let livox = read(few).unwrap();
        assert!(doubts(&livox)[0].contains("radians?"), "{livox:?}");
    }
    let timed = message("Time,Azimuth,Elevation\n0,1,10\n0.1,2,20\n");
    assert_holds!(timed, "line 1: \"Time\" is not a column of channels; a pattern");
    let title = message("Channel,Elevation(rad),Azimuth\n1,0.1,0\n");
    assert!(title.contains("is not a column of degrees"), "{title}");
}

#[test]
fn channels_that_are_there_twice() {
    let padded =
        read(r#"{"elevation_deg": [1, 0, 0, -1], "azimuth_offset_deg": [2, 0, 0, 2]}"#).unwrap();
    assert!(doubts(&padded)[0].contains("2 channels, 1 and 2 among them"), "{padded:?}");
    let twice = message("Channel,Elevation,Azimuth\n1,5,0\n1,6,0\n");
    assert_begins!(twice, "f: line 3: channel 1 is not listed once");
    let gap = read("Channel,Elevation,Azimuth\n1,5,0\n3,7,0\n").unwrap();
    assert!(doubts(&gap)[0].contains("numbered from 1 to 3: are 1 left out"), "{gap:?}");
}

#[test]
fn tables_that_a_spreadsheet_saved() {
    let good =
        read("\"Channel\",\"Elevation\",\"Azimuth\"\r1,\"14.5\",-1.25\r2,-3,0\r,,\r").unwrap();
    assert_eq!((channels(&good).len(), channels(&good)[0][0]), (2, 14.5));
    let commas = message("Channel,Elevation,Azimuth\n1,14,436,-3,257\n");
    assert!(commas.contains("write decimals with a point"), "{commas}");
    let semicolons = message("Channel;Elevation;Azimuth\n1;14,436;-3,257\n");
    assert!(semicolons.contains("commas between its columns"), "{semicolons}");
    assert!(message(b"\xff\xfeC\0h\0").contains("UTF-16"));
    let more = read("Channel,Elevation,Azimuth,Range\n1,14.5,-1.25,9\n").unwrap();
    assert!(more.notes[0].text().contains("line 1: `Range`: not known here"), "{more:?}");
}

#[test]
fn arrays_in_any_order_of_rows_and_bytes() {
    let array = |descr: &str, fortran: &str, shape: &str, data: Vec<u8>| {
        let header =
            format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        [b"\x93NUMPY\x02\x00", &(header.len() as u32).to_le_bytes()[..], header.as_bytes(), &data]
            .concat()
    };
    let rows = [0.1_f64, -0.2, 0.3, 0.4, 0.5, 0.6];
    let columns = [0.1_f64, 0.3, 0.5, -0.2, 0.4, 0.6];
    let c = read(array("<f8", "False", "(3, 2)", rows.map(f64::to_le_bytes).concat())).unwrap();
    let fortran = array("<f8", "True", "(3, 2)", columns.map(f64::to_le_bytes).concat());
    let big = array(">f8", "False", "(3, 2)", rows.map(f64::to_be_bytes).concat());
    assert_eq!(c.beams, read(fortran).unwrap().beams);
    assert_eq!(c.beams, read(big).unwrap().beams);
    let one = |angles: [f64; 2]| {
        message(array("<f8", "False", "(1, 2)", angles.map(f64::to_le_bytes).concat()))
    };
    let degrees = "radians are expected, this looks like degrees";
    assert_holds!(one([1.0, 52.0]), "an elevation in radians", degrees);
    assert_holds!(one([573.0, 0.2]), degrees);
}

#[test]
fn misspelt_keys_of_an_own_file_and_offsets_in_radians() {
    let file = |more: &str| read(format!(r#"{{"elevation_deg": [-5, 0, 5], {more}}}"#)).unwrap();
    for (more, word) in [
        (
            r#""azimuth_offset": [1, 2, 3]"#,
            "f: `azimuth_offset`: not known here, and not read; did you mean `azimuth_offset_deg`",
        ),
        (r#""rnage": 100"#, "did you mean `range`?"),
        (r#""azimuth_offset_deg": [0.02, 0, -0.08]"#, "all within ±0.08°; radians?"),
        (r#""noise": 5, "range": 100"#, "f: noise: 5 m; millimetres?"),
    ] {
        assert_holds!(doubts(&file(more)).join("\n"), word);
    }
    // `sensor info --format json` of a sensor whose offsets are small, such as Hesai's XT32M2X.
    let written =
        r#""format": "Hesai angle correction CSV", "azimuth_offset_deg": [0.17, 0, -0.17]"#;
    let zeros = r#""azimuth_offset_deg": [0, 0, 0]"#;
    for sound in [r#""owner": "me""#, zeros, r#""noise": 0.02"#, written] {
        assert!(doubts(&file(sound)).is_empty(), "{sound}");
    }
}

#[test]
fn decimal_commas_in_place_of_points() {
    let read = |text: &str| read(text).unwrap();
    let commas = read("-25,0\n-4,5\n-4,0\n");
    let told = doubts(&commas);
    assert_eq!(told.len(), 1, "{told:?}");
    assert_holds!(told[0], "line 2: -4,5 is read as an elevation of -4°");
    assert_ends!(told[0], "Write -4.5");
    for sure in ["-25,0\n-4,0\n", "-25.5,1\n-4,2\n", "-25,10\n-4,5\n", "-25,1\n-4,-1\n"] {
        assert!(doubts(&read(sure)).is_empty(), "{sure}");
    }
}
