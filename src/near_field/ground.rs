//! Cells around the own vehicle, and which of them are ground in a frame.

use glam::DVec3;
use rayon::prelude::*;

use super::{Footprint, WheelPlane};
use crate::bvh::Hit;
use crate::cast::cast_frame_closest;
use crate::geom::Pose;
use crate::maths;
use crate::problem::Frame;
use crate::vehicle::BeamTable;

/// Edge of a cell in metres.
pub const CELL: f64 = 0.25;
/// Metres around the own body that the near field reaches.
pub const NEAR: f64 = 10.0;
/// Metres around the own body of the inner ring.
pub const RING: f64 = 3.0;
/// Height in metres above the wheel plane from which ground is looked for, downwards, and as far below it.
const HEIGHT: f64 = 2.0;
/// Metres to the highest surface that may enclose a cell.
const SKY: f64 = 100.0;
/// Surfaces above a cell that are counted.
const MOST_ABOVE: usize = 64;
/// Metres by which a cast begins behind the surface that the one before ended at.
const STEP: f64 = 1e-3;

/// A square of ground: centre in the ego frame, and its distance from the body's outline, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    pub centre: [f64; 2],
    pub distance: f64,
}

/// The squares of a grid along the ego frame's axes whose centres lie outside a footprint and within
/// [`NEAR`] of its outline.
#[derive(Debug, Clone)]
pub(super) struct Cells {
    pub cells: Vec<Cell>,
    /// Grid coordinates of the first column and row.
    first: [i64; 2],
    shape: [usize; 2],
    /// Number of the cell at each place of the grid.
    numbers: Vec<Option<u32>>,
}

impl Cells {
    pub fn around(footprint: &Footprint) -> Self {
        let [low, high] = footprint.bounds();
        let first = low.map(|v| ((v - NEAR) / CELL).floor() as i64);
        let shape = [0, 1].map(|k| (((high[k] + NEAR) / CELL).ceil() as i64 - first[k]) as usize);
        let mut this = Self { cells: Vec::new(), first, shape, numbers: Vec::new() };
        for i in 0..shape[0] {
            for j in 0..shape[1] {
                let centre = this.centre([i, j]);
                let distance = footprint.distance(centre);
                let is_near = distance > 0.0 && distance <= NEAR;
                this.numbers.push(is_near.then_some(this.cells.len() as u32));
                if is_near {
                    this.cells.push(Cell { centre, distance });
                }
            }
        }
        this
    }

    fn centre(&self, place: [usize; 2]) -> [f64; 2] {
        [0, 1].map(|k| ((self.first[k] + place[k] as i64) as f64 + 0.5) * CELL)
    }

    /// Numbers of the cells whose centres lie within `radius` of a point.
    pub fn within(&self, point: [f64; 2], radius: f64) -> impl Iterator<Item = usize> + '_ {
        let range = move |k: usize| {
            // Casts saturate: a point far away has an empty range.
            let bound = |v: f64| {
                let cell = (v / CELL).floor() as i64;
                cell.saturating_sub(self.first[k]).clamp(0, self.shape[k] as i64) as usize
            };
            bound(point[k] - radius)..(bound(point[k] + radius) + 1).min(self.shape[k])
        };
        let places = range(0).flat_map(move |i| range(1).map(move |j| [i, j]));
        places.filter_map(move |[i, j]| {
            let number = self.numbers[i * self.shape[1] + j]? as usize;
            let [x, y] = self.cells[number].centre;
            (maths::hypot(x - point[0], y - point[1]) <= radius).then_some(number)
        })
    }

    /// True if each cell is ground in a frame: the first surface straight down from [`HEIGHT`] above the wheel plane
    /// over its centre is ground, and not inside of a closed thing, under whose surfaces it lies an odd number
    /// of times.
    pub fn are_ground(&self, frame: &Frame, is_ground: &[bool], wheels: &WheelPlane) -> Vec<bool> {
        let at = |&Cell { centre: [x, y], .. }: &Cell| DVec3::new(x, y, wheels.at([x, y]) + HEIGHT);
        let from: Vec<DVec3> = self.cells.iter().map(at).collect();
        let down = vertical(frame, &from, -DVec3::Z, 2.0 * HEIGHT);
        let on_ground = |hit: &Hit| hit.is_hit() && is_ground[hit.prim as usize];
        let mut ground: Vec<bool> = down.iter().map(on_ground).collect();
        let start = |(k, hit): (usize, &Hit)| {
            let z = from[k].z - f64::from(hit.t) + STEP;
            (k, from[k].with_z(z))
        };
        let open = down.iter().enumerate().filter(|(k, _)| ground[*k]);
        let mut open: Vec<(usize, DVec3)> = open.map(start).collect();
        for _ in 0..MOST_ABOVE {
            let from: Vec<DVec3> = open.iter().map(|(_, from)| *from).collect();
            let hits = vertical(frame, &from, DVec3::Z, SKY);
            let mut above = Vec::new();
            for ((k, from), hit) in open.into_iter().zip(hits).filter(|(_, hit)| hit.is_hit()) {
                ground[k] ^= !is_ground[hit.prim as usize];
                above.push((k, from + DVec3::Z * (f64::from(hit.t) + STEP)));
            }
            open = above;
        }
        ground
    }
}

/// Closest hits of vertical beams in a frame.
fn vertical(frame: &Frame, from: &[DVec3], direction: DVec3, range: f64) -> Vec<Hit> {
    // A table of one unit direction is never refused.
    let Ok(table) = BeamTable::from_directions([direction], range) else { return Vec::new() };
    let poses: Vec<Pose> =
        from.par_iter().map(|&translation| Pose { translation, ..Pose::IDENTITY }).collect();
    cast_frame_closest(&poses, &table, frame, table.range())
}
