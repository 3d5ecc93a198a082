//! Likely mistakes: radians, channels that are there twice, decimal commas, spreadsheets.

use super::super::{Beams, SensorPattern};
use super::{message, read};

fn doubts(pattern: &SensorPattern) -> Vec<&str> {
    pattern.notes.iter().filter(|note| note.is_doubt()).map(|note| note.text()).collect()
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
    assert!(timed.contains("line 1: \"Time\" is not a column of channels; a pattern"), "{timed}");
    let title = message("Channel,Elevation(rad),Azimuth\n1,0.1,0\n");
    assert!(title.contains("is not a column of degrees"), "{title}");
}

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

#[test]
fn channels_that_are_there_twice() {
    let padded =
        read(r#"{"elevation_deg": [1, 0, 0, -1], "azimuth_offset_deg": [2, 0, 0, 2]}"#).unwrap();
    assert!(doubts(&padded)[0].contains("2 channels, 1 and 2 among them"), "{padded:?}");
    let twice = message("Channel,Elevation,Azimuth\n1,5,0\n1,6,0\n");
    assert!(twice.starts_with("f: line 3: channel 1 is not listed once"), "{twice}");
    let gap = read("Channel,Elevation,Azimuth\n1,5,0\n3,7,0\n").unwrap();
    assert!(doubts(&gap)[0].contains("numbered from 1 to 3: are 1 left out"), "{gap:?}");
}

#[test]
fn tables_that_a_spreadsheet_saved() {
    let good =
        read("\"Channel\",\"Elevation\",\"Azimuth\"\r1,\"14.5\",-1.25\r2,-3,0\r,,\r").unwrap();
    assert!(
        matches!(&good.beams, Beams::Channels(all) if all.len() == 2 && all[0].elevation == 14.5)
    );
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
    let degrees =
        message(array("<f8", "False", "(1, 2)", [1.0_f64, 52.0].map(f64::to_le_bytes).concat()));
    assert!(degrees.contains("an elevation in radians"), "{degrees}");
    let across =
        message(array("<f8", "False", "(1, 2)", [573.0_f64, 0.2].map(f64::to_le_bytes).concat()));
    for told in [degrees, across] {
        assert!(told.contains("radians are expected, this looks like degrees"), "{told}");
    }
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
        let pattern = file(more);
        assert!(doubts(&pattern).join("\n").contains(word), "{word}: {pattern:?}");
    }
    for sound in [r#""owner": "me""#, r#""azimuth_offset_deg": [0, 0, 0]"#, r#""noise": 0.02"#] {
        assert!(doubts(&file(sound)).is_empty(), "{sound}");
    }
}

#[test]
fn decimal_commas_in_place_of_points() {
    let read = |text: &str| read(text).unwrap();
    let commas = read("-25,0\n-4,5\n-4,0\n");
    let told = doubts(&commas);
    assert!(
        told.len() == 1 && told[0].contains("line 2: -4,5 is read as an elevation of -4°"),
        "{told:?}"
    );
    assert!(told[0].ends_with("Write -4.5"), "{told:?}");
    for sure in ["-25,0\n-4,0\n", "-25.5,1\n-4,2\n", "-25,10\n-4,5\n", "-25,1\n-4,-1\n"] {
        assert!(doubts(&read(sure)).is_empty(), "{sure}");
    }
}
