//! Isaac profiles that are written here are read back as the same beams.

use super::super::{Beams, SensorFormat, isaac_profile};
use super::read;
use crate::vehicle::{BeamTable, Lidar, Response};

/// A sensor of two channels, one of them off to the left.
fn spinning(azimuth_steps: u32, azimuth: Option<[f64; 2]>) -> Lidar {
    Lidar::Spinning {
        elevations: vec![-24.123456789, 15.0],
        azimuth_offsets: vec![0.0, 1.7],
        azimuth_steps,
        azimuth,
        range: 120.0,
    }
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
    let tilted = Lidar::Spinning {
        elevations: vec![100.0, 10.0],
        azimuth_offsets: vec![0.0; 2],
        azimuth_steps: 36,
        azimuth: None,
        range: 120.0,
    };
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
