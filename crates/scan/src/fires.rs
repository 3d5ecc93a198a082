//! Firing order of a sensor's beams, and neighbours among them.

use std::f64::consts::TAU;
use std::ops::Range;

use sightline_scene::vehicle::BeamTable;

/// Pieces of a list of beams that fire one after the other.
const PIECES: usize = 1024;

/// Which beams fire at the same time.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fires {
    /// Beams that follow each other in a channel, and channels; one of a list of directions.
    pub columns: usize,
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
    /// Number of the firing.
    pub firing: usize,
    /// Number in the order in which beams fire.
    pub fired: usize,
}

impl Fires {
    /// An azimuth step of all channels fires together; of a list of directions so many that follow each other.
    /// Beams have a divergence in radians: full widths across and along.
    pub fn new(table: &BeamTable, divergence: [f64; 2]) -> Self {
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

    pub fn firings(&self) -> usize {
        (self.columns * self.channels).div_ceil(self.size)
    }

    /// Beams that have fired before a firing.
    pub fn before(&self, firing: usize) -> usize {
        firing * self.size
    }

    /// Beams of a firing.
    pub fn together(&self, firing: usize) -> impl Iterator<Item = BeamPlace> + use<> {
        let (first, beams) = (self.before(firing), self.columns * self.channels);
        let (columns, in_grid) = (self.columns, self.azimuths.is_some());
        (first..(first + self.size).min(beams)).map(move |fired| {
            let (channel, column) = if in_grid { (fired - first, firing) } else { (0, fired) };
            BeamPlace { beam: channel * columns + column, channel, column, firing, fired }
        })
    }

    /// Beams of a channel in some columns, one after the other.
    pub fn in_row(
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

    /// Beams beside a beam in azimuth and in elevation, by their numbers in the order in which they fire: its
    /// neighbours, and where steps are finer than half of its width all that it overlaps and the next.
    pub fn beside(&self, place: &BeamPlace) -> impl Iterator<Item = usize> + use<> {
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
    pub fn azimuth(&self, firing: usize) -> f64 {
        self.azimuths.map_or(0.0, |Azimuths { start, step, .. }| start + firing as f64 * step)
    }

    /// Farthest that a beam lies beside the azimuth of its firing, in radians.
    pub fn wide(&self) -> f64 {
        self.azimuths.map_or(TAU, |Azimuths { wide, .. }| wide)
    }
}
