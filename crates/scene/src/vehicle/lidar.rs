//! The LiDAR model of a scene, with all its numbers resolved.

use super::{BeamTable, SensorError};

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
