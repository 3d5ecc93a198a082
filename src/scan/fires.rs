//! In which order the beams of a sensor fire, and which of them lie side by side.

use std::f64::consts::TAU;

use crate::vehicle::BeamTable;

/// Pieces of a list of beams that fire one after the other.
const PIECES: usize = 1024;

/// Which beams fire at the same time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fires {
    /// Beams that follow each other in a channel, and channels; one of a list of directions.
    pub columns: usize,
    pub channels: usize,
    /// Of one firing, but perhaps for the last.
    size: usize,
    /// Whether the columns make one whole turn.
    turns: bool,
    azimuths: Option<Azimuths>,
}

/// Azimuths of the columns in radians.
#[derive(Debug, Clone, Copy)]
struct Azimuths {
    start: f64,
    step: f64,
    /// Farthest that a channel's lies beside its column's.
    wide: f64,
}

/// A beam among those of its sensor.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Number in the table.
    pub beam: usize,
    pub channel: usize,
    pub column: usize,
    /// Number of the firing.
    pub firing: usize,
    /// Number in the order in which beams fire.
    pub fired: usize,
}

impl Fires {
    /// An azimuth step of all channels fires together; of a list of directions so many that follow each other.
    pub fn new(table: &BeamTable) -> Self {
        let beams = table.directions().len();
        match table.grid() {
            Some(grid) => {
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
                }
            }
            None => Self {
                columns: beams,
                channels: 1,
                size: beams.div_ceil(PIECES).max(1),
                turns: true,
                azimuths: None,
            },
        }
    }

    pub fn firings(&self) -> usize {
        (self.columns * self.channels).div_ceil(self.size)
    }

    /// Beams that have fired before a firing.
    pub fn before(&self, firing: usize) -> usize {
        firing * self.size
    }

    /// Beams of a firing.
    pub fn together(&self, firing: usize) -> impl Iterator<Item = Place> + use<> {
        let (first, beams) = (self.before(firing), self.columns * self.channels);
        let (columns, in_grid) = (self.columns, self.azimuths.is_some());
        (first..(first + self.size).min(beams)).map(move |fired| {
            let (channel, column) = if in_grid { (fired - first, firing) } else { (0, fired) };
            Place { beam: channel * columns + column, channel, column, firing, fired }
        })
    }

    /// Beams in the order of the table.
    pub fn in_order(&self, beams: std::ops::Range<usize>) -> impl Iterator<Item = Place> + use<> {
        let Self { columns, channels, size, azimuths, .. } = *self;
        let (mut channel, mut column) = (beams.start / columns, beams.start % columns);
        beams.map(move |beam| {
            let (firing, fired) = match azimuths {
                Some(_) => (column, column * channels + channel),
                None => (beam / size, beam),
            };
            let place = Place { beam, channel, column, firing, fired };
            column += 1;
            if column == columns {
                (channel, column) = (channel + 1, 0);
            }
            place
        })
    }

    /// Beams beside a beam in azimuth and in elevation, by their numbers in the order in which they fire.
    pub fn beside(&self, place: &Place) -> impl Iterator<Item = usize> + use<> {
        let Self { columns, channels, turns, .. } = *self;
        let Place { channel, column, fired, .. } = *place;
        let round = (columns - 1) * channels;
        let left = if column > 0 { Some(fired - channels) } else { turns.then(|| fired + round) };
        let right = match column + 1 < columns {
            true => Some(fired + channels),
            false => turns.then(|| fired - round),
        };
        let above = (channel + 1 < channels).then(|| fired + 1);
        let below = (channel > 0).then(|| fired - 1);
        [left, right, above, below].into_iter().flatten()
    }

    /// Azimuth of a firing in radians and how far its beams lie beside it; all around of a list of directions.
    pub fn azimuth(&self, firing: usize) -> (f64, f64) {
        self.azimuths.map_or((0.0, TAU), |Azimuths { start, step, wide }| {
            (start + firing as f64 * step, wide)
        })
    }
}
