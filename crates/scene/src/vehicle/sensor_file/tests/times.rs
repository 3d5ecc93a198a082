//! Units of the times of a Livox pattern.

use super::super::{Beams, SensorPattern};
use super::{doubts, message, read};

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
