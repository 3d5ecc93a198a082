//! The LiDAR model of a scene, with all its numbers resolved.

use std::path::Path;

use super::description::{LidarDescription, SensorDescription};
use super::{BeamTable, SensorError};
use crate::json::check::{self, bad};
use crate::json::{self, DescriptionError, Place, read_limited};

/// Most beams of one LiDAR.
const MAX_BEAMS: u64 = 10_000_000;
const MAX_STEPS: u64 = 100_000;
const MAX_CHANNELS: u64 = 1024;
const MAX_SENSOR_FILE: u64 = 64 << 20;

/// The LiDAR that every sensor of a placement is.
#[derive(Debug, Clone, PartialEq)]
pub enum Lidar {
    /// Spinning sensor: channels that turn about z.
    Spinning {
        /// Elevation of each channel in degrees, in the order of the data sheet.
        elevations: Vec<f64>,
        /// Azimuth offset of each channel in degrees, counter-clockwise; as many as elevations.
        azimuth_offsets: Vec<f64>,
        /// Azimuth steps a turn.
        azimuth_steps: u32,
        /// Range in metres.
        range: f64,
    },
    /// Fixed list of beams, for patterns that do not repeat by turning.
    Directions {
        /// Unit vectors in the sensor frame.
        directions: Vec<[f64; 3]>,
        /// Range in metres.
        range: f64,
    },
}

impl Lidar {
    /// Range in metres.
    pub fn range(&self) -> f64 {
        match self {
            Self::Spinning { range, .. } | Self::Directions { range, .. } => *range,
        }
    }

    /// Whether it turns all the way round.
    pub fn turns(&self) -> bool {
        matches!(self, Self::Spinning { .. })
    }

    /// Beams of one sensor in one frame.
    pub fn beam_count(&self) -> usize {
        match self {
            Self::Spinning { elevations, azimuth_steps, .. } => {
                elevations.len() * *azimuth_steps as usize
            }
            Self::Directions { directions, .. } => directions.len(),
        }
    }

    /// Beam table of the sensor.
    ///
    /// # Errors
    /// As [`BeamTable::spinning`] and [`BeamTable::from_directions`].
    pub fn table(&self) -> Result<BeamTable, SensorError> {
        match self {
            Self::Spinning { elevations, azimuth_offsets, azimuth_steps, range } => {
                let channels: Vec<(f64, f64)> =
                    elevations.iter().copied().zip(azimuth_offsets.iter().copied()).collect();
                BeamTable::spinning(&channels, *azimuth_steps, *range)
            }
            Self::Directions { directions, range } => {
                BeamTable::from_directions(directions.iter().map(|&d| d.into()), *range)
            }
        }
    }

    /// Reads a spinning LiDAR from a sensor file.
    ///
    /// The file lists `elevation_deg` and, optionally, `azimuth_offset_deg` by channel, counter-clockwise.
    /// `azimuth_steps` a turn, `range` in metres.
    ///
    /// # Errors
    /// A file that cannot be read or lists no usable elevations.
    pub fn from_sensor_file(
        path: &Path,
        azimuth_steps: u32,
        range: f64,
    ) -> Result<Self, DescriptionError> {
        let at = Place::top(&path.display().to_string());
        let (elevations, azimuth_offsets) = read_sensor(&at, path, None)?;
        Ok(Self::Spinning { elevations, azimuth_offsets, azimuth_steps, range })
    }

    pub(crate) fn new(
        at: &Place,
        lidar: LidarDescription,
        dir: &Path,
    ) -> Result<Self, DescriptionError> {
        let range = check::range(&at.key("range"), lidar.range)?;
        let mut found = Vec::new();
        found.extend(lidar.channels.map(|_| "channels"));
        found.extend(lidar.file.as_ref().map(|_| "file"));
        found.extend(lidar.directions.as_ref().map(|_| "directions"));
        if found.len() != 1 {
            let of = &["channels", "file", "directions"];
            return Err(DescriptionError::Choice { at: Box::new(at.clone()), found, of });
        }
        let spare = |key, there: bool, mend: &str| match there {
            true => {
                let (at, mend) = (Box::new(at.clone()), mend.to_owned());
                Err(DescriptionError::Misplaced { at, key, mend })
            }
            false => Ok(()),
        };
        spare("fov", lidar.fov.is_some() && found != ["channels"], "it belongs to `channels`")?;
        let offsets = lidar.azimuth_offsets.as_deref();
        spare("azimuth_offsets", offsets.is_some() && found != ["file"], "it belongs to `file`")?;
        if let Some(directions) = lidar.directions {
            let turning = lidar.azimuth_steps.is_some();
            spare("azimuth_steps", turning, "listed directions are not repeated by turning")?;
            let directions = unit_vectors(&at.key("directions"), directions)?;
            return Ok(Self::Directions { directions, range });
        }
        let (elevations, azimuth_offsets) = match (lidar.file, lidar.channels) {
            (Some(file), _) => read_sensor(at, &dir.join(file), offsets)?,
            (None, channels) => even_channels(at, channels.unwrap_or(0), lidar.fov)?,
        };
        let missing = || DescriptionError::Missing {
            at: Box::new(at.clone()),
            key: "azimuth_steps",
            mend: "give the measurements of one channel in a turn, 250 for example".to_owned(),
        };
        let steps = lidar.azimuth_steps.ok_or_else(missing)?;
        let azimuth_steps = check::count(&at.key("azimuth_steps"), steps, 1, MAX_STEPS)?;
        let beams = elevations.len() as u64 * steps;
        if beams > MAX_BEAMS {
            return Err(DescriptionError::TooMany {
                at: Box::new(at.clone()),
                what: "beams",
                count: beams,
                limit: MAX_BEAMS,
                mend: "take fewer channels or azimuth steps",
            });
        }
        Ok(Self::Spinning { elevations, azimuth_offsets, azimuth_steps, range })
    }
}

/// Elevations and offsets of `count` channels spread evenly over `fov`; one channel takes the lower end.
fn even_channels(
    at: &Place,
    count: u64,
    fov: Option<[f64; 2]>,
) -> Result<(Vec<f64>, Vec<f64>), DescriptionError> {
    if count == 0 {
        let wanted = "a number of channels: a LiDAR without channels casts no beam; give 1 to 1024";
        return Err(bad(&at.key("channels"), 0, wanted));
    }
    let n = check::count(&at.key("channels"), count, 1, MAX_CHANNELS)?;
    let Some(fov) = fov else {
        return Err(DescriptionError::Missing {
            at: Box::new(at.clone()),
            key: "fov",
            mend: "give the vertical field of view in degrees, [-24.8, 2.0] for example".to_owned(),
        });
    };
    let [lower, upper] = check::fov(&at.key("fov"), fov)?;
    let step = |k: u32| f64::from(k) * (upper - lower) / f64::from(n.max(2) - 1);
    Ok(((0..n).map(|k| lower + step(k)).collect(), vec![0.0; n as usize]))
}

/// Elevations and offsets of a sensor file; `sign` is the direction of its offsets, counter-clockwise
/// by default.
fn read_sensor(
    at: &Place,
    file: &Path,
    sign: Option<&str>,
) -> Result<(Vec<f64>, Vec<f64>), DescriptionError> {
    let sign = match sign {
        None | Some("counter-clockwise") => 1.0,
        Some("clockwise") => -1.0,
        Some(other) => {
            let wanted = "\"counter-clockwise\" or \"clockwise\"";
            return Err(bad(&at.key("azimuth_offsets"), format!("{other:?}"), wanted));
        }
    };
    let name = file.display().to_string();
    let bytes = read_limited(file, MAX_SENSOR_FILE)?;
    let text = String::from_utf8_lossy(&bytes);
    let sensor: SensorDescription = json::parse(&text, &name)?;
    let top = Place::top(&name);
    let Some(elevations) = sensor.elevation_deg else {
        return Err(DescriptionError::Missing {
            at: Box::new(top),
            key: "elevation_deg",
            mend: "list the elevation of each channel in degrees; a pattern without channels goes \
                   into the scene as `directions`"
                .to_owned(),
        });
    };
    let at = top.key("elevation_deg");
    if elevations.is_empty() || elevations.len() as u64 > MAX_CHANNELS {
        return Err(bad(&at, format!("a list of {}", elevations.len()), "1 to 1024 elevations"));
    }
    for (i, e) in elevations.iter().enumerate() {
        check::elevation(&at.item(i), *e)?;
    }
    let mut offsets = sensor.azimuth_offset_deg.unwrap_or_else(|| vec![0.0; elevations.len()]);
    let at = top.key("azimuth_offset_deg");
    if offsets.len() != elevations.len() {
        let wanted = format!("one offset for each of the {} elevations", elevations.len());
        return Err(bad(&at, format!("a list of {}", offsets.len()), wanted));
    }
    for (i, o) in offsets.iter_mut().enumerate() {
        if o.abs() > 360.0 {
            return Err(bad(&at.item(i), *o, "an azimuth offset from -360 to 360 degrees"));
        }
        *o *= sign;
    }
    Ok((elevations, offsets))
}

fn unit_vectors(at: &Place, mut list: Vec<[f64; 3]>) -> Result<Vec<[f64; 3]>, DescriptionError> {
    if list.is_empty() || list.len() as u64 > MAX_BEAMS {
        let wanted = format!("1 to {MAX_BEAMS} directions");
        return Err(bad(at, format!("a list of {}", list.len()), wanted));
    }
    for (i, d) in list.iter_mut().enumerate() {
        // Scaling by the largest component first keeps squares from vanishing or overflowing.
        let largest = d.iter().fold(0.0f64, |m, v| m.max(v.abs()));
        if largest == 0.0 {
            let wanted = "a direction: its length is 0; give a vector that points somewhere";
            return Err(bad(&at.item(i), format!("{d:?}"), wanted));
        }
        let scaled = d.map(|v| v / largest);
        let norm = scaled.iter().map(|v| v * v).sum::<f64>().sqrt();
        *d = scaled.map(|v| v / norm);
    }
    Ok(list)
}
