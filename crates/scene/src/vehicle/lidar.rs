//! The LiDAR model of a scene with all its numbers resolved, and its response to light.

use super::description::ResponseDescription;
use super::lidar_reading::other;
use super::sensor_file::Measures;
use super::{BeamTable, Echoes, Response, SensorError};
use sightline_files::Note;
use sightline_files::json::check::{self, bad};
use sightline_files::json::{DescriptionError, Location};

/// The LiDAR that every sensor of a placement is.
#[derive(Debug, Clone, PartialEq)]
pub enum Lidar {
    /// Spinning sensor: channels that turn about z.
    Spinning {
        /// Elevation of each channel in degrees, in the order of the data sheet.
        elevations: Vec<f64>,
        /// Azimuth offset of each channel in degrees, counter-clockwise; as many as elevations.
        azimuth_offsets: Vec<f64>,
        /// Azimuth steps, A: a turn's, or the sector's.
        azimuth_steps: u32,
        /// Horizontal field of view `[from, to]` in degrees, counter-clockwise, less than a turn: step j points
        /// at from + j · (to − from)/(A − 1), a single one at from. A whole turn for `None`.
        azimuth: Option<[f64; 2]>,
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

    /// True if it turns all the way round.
    pub fn turns(&self) -> bool {
        matches!(self, Self::Spinning { azimuth: None, .. })
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
    /// Like [`BeamTable::spinning`], [`BeamTable::sector`] and [`BeamTable::from_directions`].
    pub fn table(&self) -> Result<BeamTable, SensorError> {
        match self {
            Self::Spinning { elevations, azimuth_offsets, azimuth_steps, range, .. } => {
                let channels: Vec<(f64, f64)> =
                    elevations.iter().copied().zip(azimuth_offsets.iter().copied()).collect();
                match self.sector() {
                    Some(sector) => BeamTable::sector(&channels, sector, *azimuth_steps, *range),
                    None => BeamTable::spinning(&channels, *azimuth_steps, *range),
                }
            }
            Self::Directions { directions, range } => {
                BeamTable::from_directions(directions.iter().map(|&d| d.into()), *range)
            }
        }
    }

    /// Azimuth of the first step and from step to step, in degrees, of a sensor that does not turn.
    pub fn sector(&self) -> Option<[f64; 2]> {
        match self {
            Self::Spinning { azimuth: Some([from, to]), azimuth_steps, .. } => {
                Some([*from, (to - from) / f64::from((*azimuth_steps).max(2) - 1)])
            }
            _ => None,
        }
    }

    /// The sensor with one of `divisor` azimuth steps, spread over the same field of view, or with every
    /// `divisor`-th of listed directions.
    #[must_use]
    pub fn thinned(&self, divisor: u32) -> Self {
        let mut thin = self.clone();
        match &mut thin {
            Self::Spinning { azimuth_steps, .. } => {
                *azimuth_steps = azimuth_steps.div_ceil(divisor);
            }
            Self::Directions { directions, .. } => {
                *directions = directions.iter().step_by(divisor as usize).copied().collect();
            }
        }
        thin
    }

    /// Degrees between two neighbouring azimuth steps; of listed directions, a turn by their number.
    pub fn azimuth_step(&self) -> f64 {
        match (self, self.sector()) {
            (_, Some([_, step])) => step,
            (Self::Spinning { azimuth_steps, .. }, _) => 360.0 / f64::from(*azimuth_steps),
            (Self::Directions { directions, .. }, _) => 360.0 / directions.len() as f64,
        }
    }
}

/// The usual response, with the numbers that a sensor file states in place of the usual ones.
pub fn stated(range: f64, measures: &Measures) -> Response {
    let usual = Response::usual(range);
    Response {
        rate: measures.rate.unwrap_or(usual.rate),
        rated_range: measures.rated_range.unwrap_or(usual.rated_range),
        noise: measures.noise.unwrap_or(usual.noise),
        // A range cut short by a scene leaves the sensor nothing nearer.
        min_range: measures.min_range.unwrap_or(usual.min_range).min(range),
        ..usual
    }
}

/// Reads the `response` of a sensor model whose beams go `range` metres. Its numbers count, then the sensor
/// file's; differences between the two are notes.
pub(super) fn read(
    at: &Location,
    written: Option<&ResponseDescription>,
    range: f64,
    measures: &Measures,
    notes: &mut Vec<Note>,
) -> Result<Response, DescriptionError> {
    let usual = stated(range, measures);
    let Some(written) = written else { return Ok(usual) };
    let both = [
        ("rate", written.rate, measures.rate),
        ("rated_range", written.rated_range, measures.rated_range),
        ("noise", written.noise, measures.noise),
        ("min_range", written.min_range, measures.min_range),
    ];
    notes
        .extend(both.into_iter().filter_map(|(key, given, stated)| other(at, key, given?, stated)));
    let between = |key: &str, value: Option<f64>, usual: f64, low: f64, high: f64| {
        let value = value.unwrap_or(usual);
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(bad(&at.key(key), value, format!("a number from {low} to {high}")))
    };
    let widths = written.divergence.unwrap_or(usual.divergence);
    let width = |k: usize| {
        let at = at.key("divergence").item(k);
        if (0.0..=0.1).contains(&widths[k]) {
            return Ok(widths[k]);
        }
        Err(bad(&at, widths[k], "a width in radians from 0 to 0.1; 3 mrad is 0.003"))
    };
    let echoes = match written.echoes.as_deref() {
        None => usual.echoes,
        Some("strongest") => Echoes::Strongest,
        Some("last") => Echoes::Last,
        Some("dual") => Echoes::Dual,
        Some(other) => {
            let wanted = "\"strongest\", \"last\" or \"dual\"";
            return Err(bad(&at.key("echoes"), format!("{other:?}"), wanted));
        }
    };
    Ok(Response {
        rate: check::rate(&at.key("rate"), written.rate.unwrap_or(usual.rate))?,
        rated_range: between("rated_range", written.rated_range, usual.rated_range, 0.1, 1e5)?,
        softness: between("softness", written.softness, usual.softness, 0.0, 1.0)?,
        noise: between("noise", written.noise, usual.noise, 0.0, 10.0)?,
        divergence: [width(0)?, width(1)?],
        pulse: between("pulse", written.pulse, usual.pulse, 0.0, 100.0)?,
        echoes,
        min_range: between("min_range", written.min_range, usual.min_range, 0.0, range)?,
    })
}
