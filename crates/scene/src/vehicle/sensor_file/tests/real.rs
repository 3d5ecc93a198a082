//! Tables of real sensors in the shared data, and directions that a vendor's own library gives.

use std::path::{Path, PathBuf};

use super::super::{Beams, SensorFormat, read};
use crate::vehicle::Lidar;

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
        match read(&path, None).unwrap().beams {
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
        let pattern = read(&path, None).unwrap();
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
