//! What a sensor file gives, whoever wrote it: beams and facts, in the frame and signs of this library.

use std::fmt;

use crate::Note;
use crate::json::check::{self, bad};
use crate::json::{DescriptionError, Place};
use crate::maths;

/// Most channels of a sensor.
pub(crate) const MAX_CHANNELS: usize = 1024;
/// Most beams of one LiDAR.
pub(crate) const MAX_BEAMS: u64 = 10_000_000;
/// Longest piece of a file that an error repeats, in characters.
const LONGEST_QUOTE: usize = 24;

/// A sensor as its file describes it.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorPattern {
    /// Who wrote the file.
    pub format: SensorFormat,
    /// Name of the model, if the file states one.
    pub model: Option<String>,
    /// The beams.
    pub beams: Beams,
    /// Columns a turn, if the file states them.
    pub azimuth_steps: Option<u32>,
    /// Sentences about what the file states and one origin for all beams leaves out.
    pub notes: Vec<Note>,
}

/// Formats that are told apart by content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorFormat {
    /// JSON with `elevation_deg` and `azimuth_offset_deg`.
    Table,
    /// Calibration YAML of the ROS drivers for Velodyne.
    Velodyne,
    /// Angle correction CSV.
    Hesai,
    /// Metadata JSON.
    Ouster,
    /// Scan pattern CSV: time, azimuth, zenith.
    Livox,
    /// Angle CSV without a header.
    RoboSense,
    /// Lidar profile JSON of Isaac Sim.
    Isaac,
    /// 3×4 matrices of `f32`, one a ray, as RGL reads them.
    Rgl,
    /// Array `[N, 2]` of azimuth and elevation in radians, `.npy`.
    Numpy,
}

/// One channel of a spinning sensor, in degrees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Channel {
    /// Up from the xy plane.
    pub elevation: f64,
    /// Counter-clockwise, added to the azimuth of each step.
    pub azimuth_offset: f64,
}

/// Beams of a sensor file.
#[derive(Debug, Clone, PartialEq)]
pub enum Beams {
    /// Channels that turn about z, in the order of the file.
    Channels(Vec<Channel>),
    /// Unit vectors in the sensor frame (x forward, y left, z up), in the order of the file.
    Directions(Vec<[f64; 3]>),
}

impl SensorFormat {
    /// Every format, in the order in which they are listed to users.
    pub const ALL: [Self; 9] = [
        Self::Table,
        Self::Velodyne,
        Self::Hesai,
        Self::Ouster,
        Self::Livox,
        Self::RoboSense,
        Self::Isaac,
        Self::Rgl,
        Self::Numpy,
    ];
}

impl fmt::Display for SensorFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Table => "JSON with `elevation_deg`",
            Self::Velodyne => "Velodyne calibration YAML",
            Self::Hesai => "Hesai angle correction CSV",
            Self::Ouster => "Ouster metadata JSON",
            Self::Livox => "Livox pattern CSV",
            Self::RoboSense => "RoboSense angle CSV",
            Self::Isaac => "Isaac lidar profile JSON",
            Self::Rgl => "RGL pattern of 3×4 matrices",
            Self::Numpy => "NumPy array of azimuth and elevation",
        })
    }
}

impl SensorPattern {
    /// A pattern of which nothing is known but its beams.
    pub(super) fn new(format: SensorFormat, beams: Beams) -> Self {
        Self { format, model: None, beams, azimuth_steps: None, notes: Vec::new() }
    }
}

/// A checked channel; `elevation` and `offset` are places and values.
pub(super) fn channel(
    elevation: (&Place, f64),
    offset: (&Place, f64),
) -> Result<Channel, DescriptionError> {
    Ok(Channel {
        elevation: check::elevation(elevation.0, elevation.1)?,
        azimuth_offset: azimuth(offset.0, offset.1)?,
    })
}

/// An azimuth in degrees.
pub(super) fn azimuth(at: &Place, value: f64) -> Result<f64, DescriptionError> {
    if value.abs() <= 360.0 {
        return Ok(value);
    }
    Err(bad(at, value, "an azimuth from -360 to 360 degrees"))
}

/// Channels of two lists of the same length: elevations, and offsets counted by `sign`.
pub(super) fn channels_of(
    [elevation_at, offset_at]: [&Place; 2],
    elevations: &[f64],
    offsets: &[f64],
    sign: f64,
) -> Result<Beams, DescriptionError> {
    check_count(elevation_at, elevations.len())?;
    if offsets.len() != elevations.len() {
        let wanted = format!("one offset for each of the {} elevations", elevations.len());
        return Err(bad(offset_at, format!("a list of {}", offsets.len()), wanted));
    }
    let both = elevations.iter().zip(offsets).enumerate();
    let channels = both.map(|(i, (&elevation, &offset))| {
        // Adding 0 makes 0 of -0.
        let offset = sign * offset + 0.0;
        channel((&elevation_at.item(i), elevation), (&offset_at.item(i), offset))
    });
    Ok(Beams::Channels(channels.collect::<Result<_, _>>()?))
}

/// Refuses a sensor without channels or with too many.
pub(super) fn check_count(at: &Place, count: usize) -> Result<(), DescriptionError> {
    if (1..=MAX_CHANNELS).contains(&count) {
        return Ok(());
    }
    Err(bad(at, format!("a list of {count}"), format!("1 to {MAX_CHANNELS} elevations")))
}

/// Unit vector of an azimuth and an elevation in degrees.
pub(super) fn direction(azimuth: f64, elevation: f64) -> [f64; 3] {
    let (sin_a, cos_a) = maths::sin_cos(azimuth.to_radians());
    let (sin_e, cos_e) = maths::sin_cos(elevation.to_radians());
    [cos_e * cos_a, cos_e * sin_a, sin_e]
}

/// The start of a text, in quotes, for an error.
pub(super) fn quoted(text: &str) -> String {
    match text.char_indices().nth(LONGEST_QUOTE) {
        Some((end, _)) => format!("{:?}…", &text[..end]),
        None => format!("{text:?}"),
    }
}
