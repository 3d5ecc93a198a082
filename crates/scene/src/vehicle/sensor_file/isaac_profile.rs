//! The profile of a sensor model for Isaac Sim.

use lidar_cast::maths;
use serde_json::{Value, json};

use super::isaac::RATED;
use super::pattern::direction;
use crate::vehicle::{Lidar, Response};

/// Degrees by which the columns of a sector may be off the columns of a turn.
const OFF: f64 = 1e-9;

/// The profile of a sensor model as Isaac Sim reads it, `rotary` or `solidState`, in degrees and metres.
///
/// A sensor that turns is `rotary`. One that looks to a side is `rotary` with a window where its columns are also columns
/// of a turn; any other, and a list of directions, is `solidState` with an emitter a beam. Beam divergence, pulse and phase
/// have no place in a profile.
pub fn isaac_profile(name: &str, lidar: &Lidar, response: &Response) -> Value {
    let mut profile = json!({
        "scanType": "rotary",
        "intensityProcessing": "normalization",
        "rayType": "IDEALIZED",
        "nearRangeM": response.min_range,
        "minDistBetweenEchos": response.pulse,
        "farRangeM": lidar.range(),
        "rangeAccuracyM": response.noise,
        "minReflectance": RATED,
        "minReflectanceRange": response.rated_range,
        "scanRateBaseHz": response.rate,
    });
    let emitters = match own_rotary(lidar, response.rate) {
        Some(Rotary { columns, window, channels }) => {
            profile["reportRateBaseHz"] = json!(columns * response.rate);
            if let Some([from, to]) = window {
                profile["startAzimuthDeg"] = json!(from);
                profile["endAzimuthDeg"] = json!(to);
            }
            channels
        }
        None => {
            profile["scanType"] = json!("solidState");
            profile["reportRateBaseHz"] = json!(response.rate);
            directions(lidar)
        }
    };
    let (across, up): (Vec<f64>, Vec<f64>) = emitters.into_iter().unzip();
    let count = across.len();
    profile["numberOfEmitters"] = json!(count);
    profile["numberOfChannels"] = json!(count);
    profile["numLines"] = json!(1);
    profile["numRaysPerLine"] = json!([count]);
    profile["emitterStateCount"] = json!(1);
    profile["emitterStates"] =
        json!([{ "azimuthDeg": across, "elevationDeg": up, "fireTimeNs": vec![0; count] }]);
    json!({
        "class": "sensor",
        "type": "lidar",
        "name": name,
        "driveWorksId": "GENERIC",
        "profile": profile,
    })
}

/// A sensor as a turn of equal columns.
struct Rotary {
    /// Columns of a whole turn.
    columns: f64,
    /// First and last azimuth of a sector, degrees.
    window: Option<[f64; 2]>,
    /// Azimuth and elevation of each emitter, degrees.
    channels: Vec<(f64, f64)>,
}

/// The columns of a sensor; `None` for one that no turn gives.
fn own_rotary(lidar: &Lidar, rate: f64) -> Option<Rotary> {
    let Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, .. } = lidar else {
        return None;
    };
    let over = |elevation: &f64| elevation.abs() > 90.0;
    if elevations.iter().any(over) || !(1e-3..=1e4).contains(&rate) {
        return None;
    }
    let channels = azimuth_offsets.iter().copied().zip(elevations.iter().copied()).collect();
    let Some([from, to]) = *azimuth else {
        return Some(Rotary { columns: f64::from(*azimuth_steps), window: None, channels });
    };
    let [_, step] = lidar.sector()?;
    let columns = (360.0 / step).round();
    let is_whole = |number: f64| (number - number.round()).abs() * step < OFF;
    let fits = is_whole(360.0 / step) && is_whole(from / step) && *azimuth_steps > 1;
    // A window that crosses the turn's end would be read from the other end.
    let within = (0.0..=360.0).contains(&from) && to <= 360.0 || (-360.0..0.0).contains(&from);
    (fits && within).then_some(Rotary { columns, window: Some([from, to]), channels })
}

/// Azimuth and elevation of each beam in degrees.
fn directions(lidar: &Lidar) -> Vec<(f64, f64)> {
    let angles = |[x, y, z]: [f64; 3]| {
        let flat = maths::hypot(x, y);
        (maths::atan2(y, x).to_degrees(), maths::atan2(z, flat).to_degrees())
    };
    match lidar {
        Lidar::Directions { directions, .. } => directions.iter().copied().map(angles).collect(),
        Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, .. } => {
            let [start, step] = lidar.sector().unwrap_or([0.0, lidar.azimuth_step()]);
            let channels = elevations.iter().zip(azimuth_offsets);
            let beams = channels.flat_map(|(&elevation, &offset)| {
                (0..*azimuth_steps).map(move |j| {
                    let azimuth = start + step * f64::from(j) + offset;
                    direction(azimuth, elevation)
                })
            });
            beams.map(angles).collect()
        }
    }
}
