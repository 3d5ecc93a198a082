//! Firing order of a sensor's beams, and neighbours among them.

use std::f64::consts::TAU;
use std::ops::Range;

use lidar_cast::maths::{self, mixed};
use sightline_scene::vehicle::BeamTable;

/// Pieces of a list of beams that fire one after the other.
const PIECES: usize = 1024;

/// Which beams fire at the same time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fires {
    /// Azimuth steps of a channel.
    pub columns: usize,
    /// Channels; 1 for a list of directions.
    pub channels: usize,
    /// Beams of one firing; the last firing may have fewer.
    size: usize,
    /// True if the columns make one whole turn.
    turns: bool,
    azimuths: Option<Azimuths>,
    /// Columns and channels beside a beam that lie within half of its width, and one more.
    overlaps: [usize; 2],
}

/// Azimuths of the columns in radians.
#[derive(Debug, Clone, Copy)]
struct Azimuths {
    start: f64,
    step: f64,
    /// Farthest that a channel's lies beside its column's.
    wide: f64,
}

/// Position of one beam in its sensor's pattern.
#[derive(Debug, Clone, Copy)]
pub(super) struct BeamPlace {
    /// Number in the table.
    pub beam: usize,
    pub channel: usize,
    pub column: usize,
    pub firing: usize,
    /// Number in the order in which beams fire.
    pub fired: usize,
}

impl Fires {
    /// An azimuth step of all channels fires together; of a list of directions so many that follow each other.
    /// Beams have a divergence in radians: full widths across and along.
    pub(crate) fn new(table: &BeamTable, divergence: [f64; 2]) -> Self {
        let beams = table.directions().len();
        match table.grid() {
            Some(grid) => {
                let [across, along] = divergence.map(|width| width / 2.0);
                let columns = (across / grid.step) as usize + 1;
                let near = |k: usize| {
                    let (elevation, _) = grid.channels[k];
                    let above = grid.channels[k + 1..].iter();
                    above.take_while(|(other, _)| (other - elevation).abs() <= along).count()
                };
                let channels = (0..grid.channels.len()).map(near).max().unwrap_or(0) + 1;
                let offsets = grid.channels.iter().map(|(_, offset)| offset.abs() + 1e-6);
                Self {
                    columns: grid.steps,
                    channels: grid.channels.len(),
                    size: grid.channels.len(),
                    turns: grid.turn,
                    azimuths: Some(Azimuths {
                        start: grid.start,
                        step: grid.step,
                        wide: offsets.fold(1e-6, f64::max),
                    }),
                    overlaps: [columns, channels],
                }
            }
            None => Self {
                columns: beams,
                channels: 1,
                size: beams.div_ceil(PIECES).max(1),
                turns: true,
                azimuths: None,
                overlaps: [1, 1],
            },
        }
    }

    pub(crate) fn firings(&self) -> usize {
        (self.columns * self.channels).div_ceil(self.size)
    }

    /// Beams that have fired before a firing.
    pub(crate) fn before(&self, firing: usize) -> usize {
        firing * self.size
    }

    pub(crate) fn together(&self, firing: usize) -> impl Iterator<Item = BeamPlace> + use<> {
        let (first, beams) = (self.before(firing), self.columns * self.channels);
        let (columns, in_grid) = (self.columns, self.azimuths.is_some());
        (first..(first + self.size).min(beams)).map(move |fired| {
            let (channel, column) = if in_grid { (fired - first, firing) } else { (0, fired) };
            BeamPlace { beam: channel * columns + column, channel, column, firing, fired }
        })
    }

    /// Beams of a channel in some columns, one after the other.
    pub(crate) fn in_row(
        &self,
        channel: usize,
        columns: Range<usize>,
    ) -> impl Iterator<Item = BeamPlace> + use<> {
        let Self { columns: all, channels, size, azimuths, .. } = *self;
        columns.map(move |column| {
            let beam = channel * all + column;
            let (firing, fired) = match azimuths {
                Some(_) => (column, column * channels + channel),
                None => (beam / size, beam),
            };
            BeamPlace { beam, channel, column, firing, fired }
        })
    }

    /// Neighbours of a beam in azimuth and in elevation, by their numbers in firing order. If steps are finer than half of the
    /// beam's width, all that it overlaps and one more.
    pub(crate) fn beside(&self, place: &BeamPlace) -> impl Iterator<Item = usize> + use<> {
        let Self { columns, channels, turns, overlaps, .. } = *self;
        let BeamPlace { channel, column, fired, .. } = *place;
        let in_azimuth = (1..=overlaps[0].min(columns - 1)).flat_map(move |step| {
            let (far, round) = (step * channels, (columns - step) * channels);
            let left =
                if column >= step { Some(fired - far) } else { turns.then(|| fired + round) };
            let right = match column + step < columns {
                true => Some(fired + far),
                false => turns.then(|| fired - round),
            };
            [left, right]
        });
        let in_elevation = (1..=overlaps[1].min(channels - 1)).flat_map(move |step| {
            let above = (channel + step < channels).then(|| fired + step);
            [above, (channel >= step).then(|| fired - step)]
        });
        in_azimuth.chain(in_elevation).flatten()
    }

    /// Azimuth of a firing in radians; none in particular of a list of directions.
    pub(crate) fn azimuth(&self, firing: usize) -> f64 {
        self.azimuths.map_or(0.0, |Azimuths { start, step, .. }| start + firing as f64 * step)
    }

    /// Farthest that a beam lies beside the azimuth of its firing, in radians.
    pub(crate) fn wide(&self) -> f64 {
        self.azimuths.map_or(TAU, |Azimuths { wide, .. }| wide)
    }
}

/// Use of a random number; draws for different purposes are independent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub(crate) enum Purpose {
    /// Detection of an echo near the threshold.
    Detection,
    /// Error of a range.
    RangeNoise,
    /// Where in the fog the light comes back.
    FogRange,
    /// Flakes in a beam.
    Snow,
    /// Another sensor's pulse that a beam takes for its own, and the time of that pulse.
    Crosstalk,
    /// Paint of an object: dark or bright.
    Object,
    /// Drops in a beam.
    Rain,
}

/// A source of numbers for one beam of a frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Chance {
    state: u64,
}

impl Chance {
    /// Random numbers of one beam of a LiDAR in a frame.
    pub(crate) fn new(seed: u64, frame: u32, lidar: u32, beam: u32) -> Self {
        let state = mixed(seed ^ 0x5ca9_0000_0000_0000);
        let state = mixed(state ^ (u64::from(frame) << 32 | u64::from(lidar)));
        Self { state: mixed(state ^ u64::from(beam)) }
    }

    /// The `k`-th number of a purpose, evenly from 0 to below 1.
    pub(crate) fn draw(&self, purpose: Purpose, k: u32) -> f64 {
        let word = mixed(self.state ^ (u64::from(purpose as u32) << 32 | u64::from(k)));
        (word >> 11) as f64 / (1u64 << 53) as f64
    }

    /// The numbers of a purpose, one after the other.
    pub(crate) fn draws(&self, purpose: Purpose) -> impl FnMut() -> f64 {
        let (chance, mut next) = (*self, 0);
        move || {
            next += 1;
            chance.draw(purpose, next - 1)
        }
    }

    /// The `k`-th number of a purpose from the standard normal distribution (Box and Muller 1958).
    pub(crate) fn normal(&self, purpose: Purpose, k: u32) -> f64 {
        // 1 − u is never 0.
        let radius = (-2.0 * maths::ln(1.0 - self.draw(purpose, 2 * k))).sqrt();
        radius * maths::cos(std::f64::consts::TAU * self.draw(purpose, 2 * k + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_spread_and_differ_by_all_that_they_are_for() {
        let draws = |chance: Chance, purpose| -> Vec<f64> {
            (0..4000).map(|k| chance.draw(purpose, k)).collect()
        };
        let first = draws(Chance::new(1, 2, 3, 4), Purpose::Snow);
        // A uniform variable has mean 1/2 and variance 1/12: four standard errors of 4000 draws.
        let mean = first.iter().sum::<f64>() / 4000.0;
        let variance = first.iter().map(|u| (u - mean).powi(2)).sum::<f64>() / 4000.0;
        assert!((mean - 0.5).abs() < 0.019 && (variance - 1.0 / 12.0).abs() < 0.005);
        let others = [[2, 2, 3, 4], [1, 3, 3, 4], [1, 2, 4, 4], [1, 2, 3, 5]]
            .map(|[seed, frame, lidar, beam]| Chance::new(seed.into(), frame, lidar, beam))
            .map(|chance| draws(chance, Purpose::Snow));
        for other in others.iter().chain([&draws(Chance::new(1, 2, 3, 4), Purpose::Object)]) {
            let product = |(a, b): (&f64, &f64)| (a - 0.5) * (b - 0.5);
            let covariance = first.iter().zip(other).map(product).sum::<f64>() / 4000.0;
            // The product's deviation is 1/12.
            assert!(covariance.abs() < 4.0 / 12.0 / 4000_f64.sqrt(), "{covariance}");
        }
    }

    #[test]
    fn normal_numbers_have_mean_0_and_variance_1() {
        let chance = Chance::new(7, 0, 0, 0);
        let draws: Vec<f64> = (0..4000).map(|k| chance.normal(Purpose::RangeNoise, k)).collect();
        let mean = draws.iter().sum::<f64>() / 4000.0;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / 4000.0;
        assert!(mean.abs() < 0.064 && (variance - 1.0).abs() < 0.09, "{mean} {variance}");
    }
}
