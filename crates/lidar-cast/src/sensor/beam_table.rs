//! Beams of one sensor: directions, the grid that they lie in, their mirror image, and how they measure.
//!
//! A response has echo power and threshold, range error, and beam width.

use std::f64::consts::{FRAC_PI_2, TAU};
use std::sync::Arc;

use glam::DVec3;
use serde::Serialize;

use super::SensorError;
use crate::maths;

/// Unit beam directions of one sensor, in the sensor frame (x forward, z up).
///
/// All LiDARs of a placement share one table. Directions are computed in `f64` and rounded to `f32`
/// once, so that every backend reads the same numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct BeamTable {
    directions: Arc<[[f32; 3]]>,
    pub(super) range: f32,
    grid: Option<Arc<BeamGrid>>,
}

/// Beams by channel, then azimuth step: beam (k, j) has the elevation of channel k and the azimuth
/// start + j · step + offset of channel k, all in radians, counter-clockwise from +x.
#[derive(Debug, Clone, PartialEq)]
pub struct BeamGrid {
    /// Elevation from −π/2 to π/2 and azimuth offset of each channel, in the order of the beams.
    pub channels: Vec<(f64, f64)>,
    /// Azimuth of the first step.
    pub start: f64,
    /// From step to step, positive.
    pub step: f64,
    /// Azimuth steps.
    pub steps: usize,
    /// True if the steps make one whole turn.
    pub turn: bool,
}

impl BeamTable {
    /// A spinning sensor: beams ordered by channel, then azimuth step.
    ///
    /// `channels` holds (elevation, azimuth offset) in degrees; beam (k, j) has azimuth
    /// 2πj/`azimuth_steps` + offset, counter-clockwise from +x, and elevation up from the xy plane:
    /// d = (cos e cos a, cos e sin a, sin e). `range` is in metres.
    ///
    /// # Errors
    /// No beams, or a range that is not positive.
    pub fn spinning(
        channels: &[(f64, f64)],
        azimuth_steps: u32,
        range: f64,
    ) -> Result<Self, SensorError> {
        let steps = f64::from(azimuth_steps);
        let grid = Some((0.0, TAU / steps, true));
        Self::of_channels(channels, azimuth_steps, range, grid, |j| TAU * f64::from(j) / steps)
    }

    /// A sensor that looks to one side: beams ordered by channel, then azimuth step, as
    /// [`Self::spinning`] has them, with azimuths `start` + j · `step` + offset in degrees.
    ///
    /// # Errors
    /// No beams, angles that are not finite, or a range that is not positive.
    pub fn sector(
        channels: &[(f64, f64)],
        [start, step]: [f64; 2],
        azimuth_steps: u32,
        range: f64,
    ) -> Result<Self, SensorError> {
        let [start, step] = [start.to_radians(), step.to_radians()];
        // Beams that overlap, or run backwards, stay a list.
        let in_grid = step > 0.0 && step * f64::from(azimuth_steps) <= TAU;
        let grid = in_grid.then_some((start, step, false));
        Self::of_channels(channels, azimuth_steps, range, grid, |j| start + step * f64::from(j))
    }

    /// Beams by channel, then step, at some azimuth. `grid` has start, step and turn of a [`BeamGrid`]; channels that lean
    /// over backwards have none.
    fn of_channels(
        channels: &[(f64, f64)],
        steps: u32,
        range: f64,
        grid: Option<(f64, f64, bool)>,
        azimuth: impl Fn(u32) -> f64,
    ) -> Result<Self, SensorError> {
        let radians =
            |&(elevation, offset): &(f64, f64)| (elevation.to_radians(), offset.to_radians());
        let channels: Vec<(f64, f64)> = channels.iter().map(radians).collect();
        let azimuth = &azimuth;
        let directions = channels.iter().flat_map(|&(elevation, offset)| {
            let (sin_e, cos_e) = maths::sin_cos(elevation);
            (0..steps).map(move |j| {
                let (sin_a, cos_a) = maths::sin_cos(azimuth(j) + offset);
                DVec3::new(cos_e * cos_a, cos_e * sin_a, sin_e)
            })
        });
        let mut table = Self::from_directions(directions, range)?;
        let is_upright = channels.iter().all(|(elevation, _)| elevation.abs() <= FRAC_PI_2);
        if let Some((start, step, turn)) = grid.filter(|_| is_upright) {
            let steps = steps as usize;
            table.grid = Some(Arc::new(BeamGrid { channels, start, step, steps, turn }));
        }
        Ok(table)
    }

    /// An explicit list of directions, each scaled to unit length. `range` is in metres.
    ///
    /// # Errors
    /// No beams, a vector without length, or a range that is not positive.
    pub fn from_directions(
        directions: impl IntoIterator<Item = DVec3>,
        range: f64,
    ) -> Result<Self, SensorError> {
        if !(range > 0.0 && range.is_finite()) {
            return Err(SensorError::BadRange { range });
        }
        let directions = directions
            .into_iter()
            .enumerate()
            .map(|(index, d)| match d.try_normalize() {
                Some(unit) => Ok(unit.as_vec3().to_array()),
                None => Err(SensorError::ZeroDirection { index }),
            })
            .collect::<Result<Vec<_>, _>>()?;
        if directions.is_empty() {
            return Err(SensorError::NoBeams);
        }
        Ok(Self { directions: directions.into(), range: range as f32, grid: None })
    }

    /// Unit directions `[D]` in the sensor frame, in beam order.
    pub fn directions(&self) -> &[[f32; 3]] {
        &self.directions
    }

    /// The grid that the directions lie in; none for an explicit list.
    pub fn grid(&self) -> Option<&BeamGrid> {
        self.grid.as_deref()
    }

    /// Farthest distance in metres at which a beam returns.
    pub fn range(&self) -> f32 {
        self.range
    }

    /// The sensor as a mirror in its xz plane shows it: y of each direction changes sign. Beams on a grid
    /// come by rising azimuth again.
    #[must_use]
    pub fn mirrored(&self) -> Self {
        let flipped = |&[x, y, z]: &[f32; 3]| [x, 0.0 - y, z];
        let Some(grid) = self.grid() else {
            return Self {
                directions: self.directions.iter().map(flipped).collect(),
                ..self.clone()
            };
        };
        // Step j is mirrored to −(start + j · step): on a whole turn the step n − j after −start, otherwise
        // the step n − 1 − j after the last one's mirror image.
        let steps = grid.steps;
        let back = if grid.turn { steps } else { steps - 1 };
        let turned = if grid.turn { 0.0 } else { back as f64 * grid.step };
        let row = |row: &[[f32; 3]]| -> Vec<[f32; 3]> {
            (0..steps).map(|j| flipped(&row[(back - j) % steps])).collect()
        };
        let channels = grid.channels.iter().map(|&(elevation, offset)| (elevation, 0.0 - offset));
        let mirrored = BeamGrid {
            channels: channels.collect(),
            start: 0.0 - (grid.start + turned),
            ..grid.clone()
        };
        Self {
            directions: self.directions.chunks(steps).flat_map(row).collect(),
            grid: Some(Arc::new(mirrored)),
            ..self.clone()
        }
    }
}

/// Reflectance of the target that ranges are rated for.
const RATED_REFLECTANCE: f64 = 0.1;

/// Echoes of one pulse that a sensor reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Echoes {
    /// The one of most power.
    Strongest,
    /// The farthest that is strong enough.
    Last,
    /// Both. Where the strongest is also the farthest, the second strongest comes with it.
    Dual,
}

/// Response of a sensor to the surfaces that its beams meet.
///
/// Power is P = ρ·cos θ / r², with reflectance ρ, angle of incidence θ and distance r; a pulse is seen from
/// `P_min` = 0.1 / `rated_range`² on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Response {
    /// Turns, or whole patterns, a second.
    pub rate: f64,
    /// Metres at which a target that reflects 10 % and faces the sensor is seen half of the time.
    pub rated_range: f64,
    /// Standard deviation of the threshold, as a share of it.
    pub softness: f64,
    /// Standard deviation of the range of strong returns, in metres; three times as much at the threshold.
    pub noise: f64,
    /// Full width of the beam across and along its channel's axis (horizontal, vertical), in radians.
    pub divergence: [f64; 2],
    /// Echoes closer together than this many metres merge.
    pub pulse: f64,
    /// Echoes that are reported.
    pub echoes: Echoes,
    /// Nothing is seen closer than this, in metres.
    pub min_range: f64,
}

impl Response {
    /// A response that is usual for spinning sensors, of one whose beams go `range` metres: rated for 0.6 of
    /// them, 2 cm of noise, 3 × 1.5 mrad, ten turns a second.
    pub fn usual(range: f64) -> Self {
        Self {
            rate: 10.0,
            rated_range: 0.6 * range,
            softness: 0.1,
            noise: 0.02,
            divergence: [3.0e-3, 1.5e-3],
            pulse: 0.4,
            echoes: Echoes::Strongest,
            min_range: 0.0,
        }
    }

    /// Least power that is seen, in the unit of ρ·cos θ / r².
    pub fn threshold(&self) -> f64 {
        RATED_REFLECTANCE / (self.rated_range * self.rated_range)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beams_follow_the_contract() {
        // Two channels at -30° and +30°, four steps: 0°, 90°, 180°, 270° counter-clockwise.
        let table = BeamTable::spinning(&[(-30.0, 0.0), (30.0, 0.0)], 4, 10.0).unwrap();
        let (c, s) = (0.75_f32.sqrt(), 0.5_f32);
        let want = [
            [c, 0.0, -s],
            [0.0, c, -s],
            [-c, 0.0, -s],
            [0.0, -c, -s],
            [c, 0.0, s],
            [0.0, c, s],
            [-c, 0.0, s],
            [0.0, -c, s],
        ];
        for (got, want) in table.directions().iter().zip(want) {
            for axis in 0..3 {
                assert!((got[axis] - want[axis]).abs() < 1e-7, "{got:?} is not {want:?}");
            }
        }
    }

    #[test]
    fn bad_sensors_are_errors() {
        assert_eq!(BeamTable::spinning(&[], 4, 1.0), Err(SensorError::NoBeams));
        assert_eq!(BeamTable::spinning(&[(0.0, 0.0)], 0, 1.0), Err(SensorError::NoBeams));
        let directions = [DVec3::X, DVec3::ZERO];
        let got = BeamTable::from_directions(directions, 1.0);
        assert_eq!(got, Err(SensorError::ZeroDirection { index: 1 }));
        assert!(BeamTable::from_directions([DVec3::X], f64::NAN).is_err());
    }

    /// Directions that the grid of a table says, in `f64`.
    fn by_grid(table: &BeamTable) -> Vec<[f64; 3]> {
        let grid = table.grid().unwrap();
        let direction = |&(e, offset): &(f64, f64), j: usize| {
            let a = grid.start + grid.step * j as f64 + offset;
            [e.cos() * a.cos(), e.cos() * a.sin(), e.sin()]
        };
        let rows = grid.channels.iter();
        rows.flat_map(|channel| (0..grid.steps).map(move |j| direction(channel, j))).collect()
    }

    #[test]
    fn mirrored_beams_lie_on_their_grid_and_are_the_flipped_ones() {
        let channels = [(-20.0, 3.0), (0.0, -1.0), (15.0, 0.0)];
        for table in [
            BeamTable::spinning(&channels, 7, 50.0).unwrap(),
            BeamTable::sector(&channels, [-50.0, 4.0], 9, 50.0).unwrap(),
        ] {
            let image = table.mirrored();
            for (got, want) in image.directions().iter().zip(by_grid(&image)) {
                let off = (0..3).map(|k| (f64::from(got[k]) - want[k]).abs()).fold(0.0, f64::max);
                assert!(off < 1e-6, "{got:?} is not {want:?}");
            }
            let bits = |[x, y, z]: [f32; 3]| [x, y + 0.0, z].map(f32::to_bits);
            let sorted = |directions: Vec<[u32; 3]>| {
                let mut directions = directions;
                directions.sort_unstable();
                directions
            };
            let flipped = table.directions().iter().map(|&[x, y, z]| bits([x, -y, z])).collect();
            let got = image.directions().iter().map(|&d| bits(d)).collect();
            assert_eq!(sorted(got), sorted(flipped));
            assert_eq!(image.range(), table.range());
            assert_eq!(image.mirrored().directions(), table.directions());
        }
        let list = BeamTable::from_directions([DVec3::new(1.0, 2.0, 2.0)], 5.0).unwrap();
        let [[x, y, z]] = list.mirrored().directions()[..] else { panic!("one beam") };
        assert_eq!([[x, -y, z]], list.directions());
    }
}
