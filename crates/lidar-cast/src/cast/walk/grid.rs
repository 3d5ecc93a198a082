//! A sensor's beams as rows and columns, cut into windows, with the tables that turn angles to indices.

use std::f64::consts::TAU;

use bytemuck::zeroed_box;

use super::ops::W;
use crate::maths;
use crate::sensor::{BeamGrid, BeamTable};

/// Most beams of a window: their directions and hits then lie in the second cache.
pub(super) const BEAMS: usize = 1 << 15;
/// Beams of a window, with room for a vector that begins at the last one.
pub(super) const ROOM: usize = BEAMS + W;
/// Cells of the table that turns tangents to rows.
pub(super) const CELLS: usize = 2048;
/// Narrowest cell: half of it exceeds the error of an estimated [`measure`].
const NARROWEST: f64 = 2e-4;
/// Error bound of azimuths of boxes and triangles, in radians.
const AZIMUTH_ERROR: f64 = 2e-4;

/// Numbers of the beams of a window: `[axis][row × columns + column]`.
pub(super) type Directions = [[f32; ROOM]; 3];

/// Beams as rows of ascending elevation and columns of ascending azimuth.
///
/// A channel's azimuth offset is so many whole columns, by which its row is shifted, and a rest of at
/// most half a column, by which all ranges of columns are widened.
pub(super) struct Grid {
    rows: Vec<GridRow>,
    pub(super) lookup: RowLookup,
    /// With the directions of their beams in the sensor frame; none of a grid of firings.
    pub(super) windows: Vec<(Window, Box<Directions>)>,
    pub(super) columns: ColumnScale,
    /// Beams of a channel.
    steps: usize,
    /// True if rows are closed: then they are shifted by turning.
    pub(super) turn: bool,
}

struct GridRow {
    channel: usize,
    /// Column of the channel's first beam.
    shift: usize,
}

/// From azimuths to columns: an angle between a and b lies in columns a·`per_radian` − `low` to
/// b·`per_radian` − `high`, or whole turns beside.
pub(super) struct ColumnScale {
    pub(super) per_radian: f32,
    pub(super) low: f32,
    pub(super) high: f32,
    /// Columns of a whole turn.
    pub(super) turn: f32,
}

/// From tangents of elevations to rows, by cells of their [`measure`].
pub(super) struct RowLookup {
    /// First and last row that a range may hold which begins or ends in a cell; rounded outwards.
    pub(super) first: Box<[i32; CELLS]>,
    pub(super) last: Box<[i32; CELLS]>,
    /// Measure at the first cell, and cells for one of it.
    pub(super) from: f32,
    pub(super) per_measure: f32,
    /// Tangent of each row, and zeros to fill a vector.
    pub(super) tangents: Vec<f32>,
}

/// Neighbouring columns of all rows.
#[derive(Clone, Copy)]
pub(super) struct Window {
    /// First column.
    pub(super) from: usize,
    pub(super) columns: usize,
}

/// Beams of a row that lie side by side in a window and in the order of the table.
pub(super) struct Piece {
    pub(super) column: usize,
    pub(super) beam: usize,
    pub(super) len: usize,
}

/// Grows with a tangent as the elevation does, but stays within ±1: t / (1 + |t|).
fn measure(tangent: f64) -> f64 {
    tangent / (1.0 + tangent.abs())
}

impl Grid {
    /// The grid of a table that has one with rows that fit into windows.
    pub(super) fn new(table: &BeamTable) -> Option<Self> {
        let (mut grid, slots) = Self::of(table.grid()?, true)?;
        grid.cut(slots, table.directions());
        Some(grid)
    }

    /// A grid whose columns are the beams of an azimuth step each, whatever the offsets of their channels: all
    /// ranges of columns are widened by these.
    pub(super) fn of_firings(beams: &BeamGrid) -> Option<Self> {
        Some(Self::of(beams, false)?.0)
    }

    /// Without windows, and its columns.
    fn of(beams: &BeamGrid, shifted: bool) -> Option<(Self, usize)> {
        let BeamGrid { channels, start, step, steps, turn } = beams;
        let (steps, turn) = (*steps, *turn);
        let mut order: Vec<usize> = (0..channels.len()).collect();
        order.sort_by(|&a, &b| channels[a].0.total_cmp(&channels[b].0));
        let shift = |&k: &usize| if shifted { (channels[k].1 / step).round() } else { 0.0 };
        let shifts: Vec<f64> = order.iter().map(shift).collect();
        let rest = order.iter().zip(&shifts).map(|(&k, shift)| channels[k].1 / step - shift);
        let (low, high) =
            rest.fold((f64::MAX, f64::MIN), |(low, high), x| (x.min(low), x.max(high)));
        let base = if turn { 0.0 } else { shifts.iter().copied().fold(f64::MAX, f64::min) };
        let most = shifts.iter().copied().fold(f64::MIN, f64::max);
        let slots = if turn { steps } else { steps + (most - base) as usize };
        if channels.len() > BEAMS / 2 || slots as f64 > TAU / step + 1.0 {
            return None;
        }
        let per_radian = 1.0 / step;
        let columns = ColumnScale {
            per_radian: per_radian as f32,
            low: ((start + AZIMUTH_ERROR) * per_radian + base + high) as f32,
            high: ((start - AZIMUTH_ERROR) * per_radian + base + low) as f32,
            turn: (TAU * per_radian) as f32,
        };
        let rows = order.iter().zip(&shifts).map(|(&channel, &shift)| {
            let shift = if turn { shift.rem_euclid(steps as f64) } else { shift - base };
            GridRow { channel, shift: shift as usize }
        });
        let tangents: Vec<f64> = order.iter().map(|&k| maths::tan(channels[k].0)).collect();
        let lookup = RowLookup::new(&tangents);
        let (rows, windows) = (rows.collect(), vec![]);
        Some((Self { rows, lookup, windows, columns, steps, turn }, slots))
    }

    /// Cuts into windows: at least two, so that no range of columns goes round within one.
    fn cut(&mut self, slots: usize, directions: &[[f32; 3]]) {
        let most = BEAMS / self.rows.len();
        let columns = slots.div_ceil(slots.div_ceil(most).max(2));
        for from in (0..slots).step_by(columns) {
            let mut local: Box<Directions> = zeroed_box();
            let columns = columns.min(slots - from);
            for row in 0..self.rows.len() {
                for piece in self.pieces(from, columns, row) {
                    let beams = &directions[piece.beam..piece.beam + piece.len];
                    let at = row * columns + piece.column;
                    for (axis, local) in local.iter_mut().enumerate() {
                        let numbers = local[at..at + piece.len].iter_mut().zip(beams);
                        numbers.for_each(|(number, beam)| *number = beam[axis]);
                    }
                }
            }
            self.windows.push((Window { from, columns }, local));
        }
    }

    pub(super) fn row_count(&self) -> usize {
        self.rows.len()
    }

    /// The channel of each row.
    pub(super) fn channels(&self) -> impl Iterator<Item = usize> {
        self.rows.iter().map(|row| row.channel)
    }

    /// The beams of a row in some columns.
    pub(super) fn pieces(
        &self,
        from: usize,
        columns: usize,
        row: usize,
    ) -> impl Iterator<Item = Piece> {
        let GridRow { channel, shift } = self.rows[row];
        let (first, steps) = (channel * self.steps, self.steps);
        let pieces = if self.turn {
            let begin = (from + steps - shift) % steps;
            let len = columns.min(steps - begin);
            [
                Piece { column: 0, beam: first + begin, len },
                Piece { column: len, beam: first, len: columns - len },
            ]
        } else {
            let low = from.max(shift);
            let len = (from + columns).min(shift + steps).saturating_sub(low);
            let beam = first + low.saturating_sub(shift).min(steps);
            let nothing = Piece { column: 0, beam: 0, len: 0 };
            [Piece { column: low - from, beam, len }, nothing]
        };
        pieces.into_iter().filter(|piece| piece.len > 0)
    }
}

impl RowLookup {
    fn new(tangents: &[f64]) -> Self {
        let measures: Vec<f64> = tangents.iter().map(|&t| measure(t)).collect();
        let (low, high) = (measures[0], measures[measures.len() - 1]);
        let cell = ((high - low) / (CELLS - 9) as f64).max(NARROWEST);
        let from = low - 4.0 * cell;
        let (mut first, mut last): (Box<[i32; CELLS]>, Box<[i32; CELLS]>) =
            (zeroed_box(), zeroed_box());
        for i in 0..CELLS {
            // Half a cell to spare; values beyond the table are kept in its ends.
            let below = if i == 0 { f64::MIN } else { from + (i as f64 - 0.5) * cell };
            let above = if i == CELLS - 1 { f64::MAX } else { from + (i as f64 + 1.5) * cell };
            first[i] = measures.partition_point(|&m| m < below) as i32;
            last[i] = measures.partition_point(|&m| m <= above) as i32 - 1;
        }
        let mut tangents: Vec<f32> = tangents.iter().map(|&t| t as f32).collect();
        tangents.resize(tangents.len() + W, 0.0);
        let (from, per_measure) = (from as f32, (1.0 / cell) as f32);
        Self { first, last, from, per_measure, tangents }
    }
}
