//! Units of times and angles.

use super::super::{Beams, SensorPattern};
use super::{channels, directions, doubts, message, read};

/// 240 samples of a Livox at 240 kHz: in seconds all are one frame, in other units the first ones alone.
#[test]
fn times_that_are_no_seconds_are_doubted() {
    let read = |unit: f64, whole: bool| {
        let time = |k: u32| {
            let time = f64::from(k) / 240_000.0 * unit;
            if whole { time.round() } else { time }
        };
        let row = |k: u32| format!("{},{},{}\n", time(k), 30 + k % 40, 80 + k % 20);
        read(format!("Time,Azimuth,Zenith\n{}", (0..240).map(row).collect::<String>())).unwrap()
    };
    let count = |pattern: &SensorPattern| match &pattern.beams {
        Beams::Directions(all) => all.len(),
        Beams::Channels(all) => all.len(),
    };
    let seconds = read(1.0, false);
    assert_eq!((count(&seconds), doubts(&seconds).len()), (240, 0));
    for (unit, whole) in [(1e3, false), (1e6, false), (1e9, false), (1e9, true), (1e6, true)] {
        let other = read(unit, whole);
        let said = doubts(&other);
        let told =
            format!("{} of 240 samples lie in the frame: are times in seconds?", count(&other));
        assert!(said.len() == 1 && said[0].contains(&told), "{unit} {whole}: {said:?}");
    }
}

/// Samples at 0, 1, 2, … s: two tell no unit, and a title may state it.
#[test]
fn whole_times_are_doubted_by_many_rows_of_no_stated_unit() {
    let doubted = |title: &str, count: u32| {
        let row = |k: u32| format!("{k},{},{}\n", 30 + k % 40, 80 + k % 20);
        let rows: String = (0..count).map(row).collect();
        let said = doubts(&read(format!("{title},Azimuth,Zenith\n{rows}")).unwrap()).join("; ");
        said.contains("are times in seconds?")
    };
    assert_eq!([2, 99, 100, 2000].map(|count| doubted("Time", count)), [false, false, true, true]);
    assert!(doubted("Times", 100));
    for title in ["Time/s", "Time (s)", "time_sec", "Timestamp[s]", "Time in seconds"] {
        assert_eq!([100, 2000].map(|count| doubted(title, count)), [false; 2], "{title}");
    }
    for title in ["Time/ms", "Timestamp (ns)", "Time of day in us", "timens"] {
        let told = message(format!("{title},Azimuth,Zenith\n0,30,80\n"));
        assert!(told.contains("is not a column of seconds; convert it"), "{told}");
    }
}

/// Hesai's rows without their titles would be a pattern of one beam: 15° to the side, straight up.
#[test]
fn channels_without_titles_are_no_pattern() {
    let rows = |title: &str| {
        let row = |k: u32| format!("{k},{},1.042\n", 15 - k);
        format!("{title}{}", (1..15).map(row).collect::<String>())
    };
    let told = message(rows(""));
    assert_holds!(
        told,
        "a first column that counts by one is not a column that a title explains; write `Channel,"
    );
    assert_eq!(channels(&read(rows("Channel,Elevation,Azimuth\n")).unwrap()).len(), 14);
    // Seconds, or one row, say nothing of channels.
    assert_eq!(directions(&read("0,30,80\n0.01,31,80\n").unwrap()).len(), 2);
    assert_eq!(directions(&read("1,30,80\n").unwrap()).len(), 1);
}

#[test]
fn titles_of_parts_of_a_degree_are_refused() {
    for unit in ["(mrad)", "[gon]", "/arcmin", "(0.01deg)", " (1/100 deg)", " / centidegrees"] {
        let told = message(format!("Channel,Elevation{unit},Azimuth\n1,15,1\n2,3,2\n"));
        assert!(told.contains("is not a column of degrees; convert it"), "{unit}: {told}");
    }
    for unit in ["", "(deg)", " [°]", "/degrees", " (clockwise, 0-360)"] {
        let read = read(format!("Channel,Elevation,Azimuth{unit}\n1,15,1\n2,3,2\n")).unwrap();
        assert_eq!(channels(&read).len(), 2, "{unit}");
    }
}

/// A window of Ouster is in thousandths of a degree, in firmware 1 in hundredths.
#[test]
fn windows_of_an_ouster_in_degrees_are_refused_and_whole_turns_are_no_window() {
    let file = |firmware: &str, window: &str| {
        format!(
            r#"{{"beam_altitude_angles": [5, -5], "beam_azimuth_angles": [1, -1], "lidar_mode": "1024x10",
                "build_rev": "{firmware}", "azimuth_window": {window}}}"#
        )
    };
    for window in ["[0, 360]", "[90, 270]", "[270, 90]", "[1, 359]"] {
        for firmware in ["v1.13.0", "v2.5.0"] {
            let told = message(file(firmware, window));
            assert!(told.contains("360000 a turn: are these degrees?"), "{told}");
        }
    }
    for whole in ["[0, 360000]", "[360000, 0]", "[0, 0]"] {
        let pattern = read(file("v2.5.0", whole)).unwrap();
        assert_eq!((pattern.azimuth, pattern.notes.len()), (None, 0), "{whole}");
    }
    let hundredths = read(file("v2.5.0", "[0, 36000]")).unwrap();
    assert!(doubts(&hundredths)[0].contains("hundredths, a whole turn?"));
    let narrow = read(file("v2.5.0", "[45000, 135000]")).unwrap();
    assert!(doubts(&narrow).is_empty() && narrow.azimuth.is_some());
}

#[test]
fn angles_of_a_solid_state_sensor_in_radians_are_doubted() {
    let said = |across: &str, up: &str| {
        let state = format!(r#"{{"azimuthDeg": {across}, "elevationDeg": {up}}}"#);
        let pattern = read(format!(
            r#"{{"profile": {{"scanType": "solidState", "emitterStates": [{state}]}}}}"#
        ));
        doubts(&pattern.unwrap()).join("; ")
    };
    assert!(said("[-1.05, 1.05]", "[-0.2, 0.2]").contains("azimuths reach 1.050"));
    for (across, up) in [("[-60, 60]", "[-0.2, 0.2]"), ("[-1, 1]", "[-12, 12]"), ("[0.5]", "[0]")] {
        assert_eq!(said(across, up), "");
    }
}

/// Lines of one file may end in different ways, where two programs wrote it.
#[test]
fn ends_of_lines_may_be_mixed() {
    let rows = ["Channel,Elevation,Azimuth", "1,15,-1", "2,3,1", "3,x,0"];
    for ends in [["\n", "\n", "\n"], ["\r", "\r", "\n"], ["\r\n", "\r", "\n"], ["\r", "\r", "\r"]] {
        let text: String = rows.iter().zip(ends).map(|(row, end)| format!("{row}{end}")).collect();
        assert_eq!(channels(&read(&text).unwrap()), [[15.0, 1.0], [3.0, -1.0]], "{ends:?}");
        let told = message(text + rows[3]);
        assert!(told.contains("line 4: \"x\" is not a number"), "{told}");
    }
    let latin_1 = message(b"Channel,Elevation(\xb0),Azimuth(\xb0)\n1,15,-1\n");
    assert_eq!(
        latin_1,
        "f: text that is not UTF-8, such as Latin-1, is not UTF-8 text; save the file as UTF-8"
    );
}

/// A right angle and a turn are more than 90° and 360° as `f32`, and with four decimals.
#[test]
fn right_angles_and_turns_may_be_rounded() {
    let array = |angles: [f32; 2]| {
        let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 2), }\n";
        let length = (header.len() as u32).to_le_bytes();
        let data = angles.map(f32::to_le_bytes).concat();
        [b"\x93NUMPY\x02\x00", &length[..], header.as_bytes(), &data].concat()
    };
    let (right, turn) = (std::f32::consts::FRAC_PI_2, std::f32::consts::TAU);
    let up = read(array([-turn, right])).unwrap();
    assert_eq!(directions(&up)[0], super::super::pattern::direction(-360.0, 90.0));
    let far = message(array([0.0, 1.6]));
    assert!(far.contains("[0]: 1.6") && far.contains("an elevation in radians"), "{far}");
    assert!(message(array([6.3, 0.0])).contains("an azimuth in radians within one turn"));
    let lasers = |across: &str, up: &str| {
        format!("lasers:\n- {{laser_id: 0, rot_correction: {across}, vert_correction: {up}}}\n")
    };
    let rounded = read(lasers("6.2832", "-1.5708")).unwrap();
    assert_eq!(channels(&rounded), [[-90.0, 360.0]]);
    assert!(message(lasers("0", "1.5709")).contains("an elevation in radians from -1.5708"));
    assert!(message(lasers("-6.2834", "0")).contains("an azimuth in radians from -6.2832"));
}
