use glam::Vec3;
use rayon::prelude::*;

use super::build::PAD_SHARE;
use super::{Bvh, Ray};
use crate::geom::Aabb;

/// Bits of a column or row.
const BITS: u32 = 8;
/// Parts of a face that are worked on in parallel, along an edge.
const TASK_EDGE: u32 = 4;
/// Longest list: far below the loop steps that every driver grants an invocation.
const LONGEST: usize = 1 << 14;
/// Growth of a square in slopes: rounding moves a slope by 2⁻²⁴ at most.
const SLOPE_SLACK: f32 = 1e-6;
/// Rounding of a distance, as a share of it: several times what a slab test can be off.
const DISTANCE_SLACK: f32 = 1e-5;

/// A triangle that a ray of a shaft may hit, 8 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Candidate {
    /// Index in [`Bvh::triangles`].
    pub triangle: u32,
    /// No ray of the shaft hits it closer than so many metres.
    pub enter: f32,
}

/// For every shaft the triangles that its rays can hit, nearest first.
///
/// A shaft holds the rays that start in a box and whose direction goes through one square of the cube
/// around it, each face of which is cut into `edge` × `edge`; see [`Self::of`]. Whatever [`Ray`] hits is in the list of its shaft: a hit needs
/// a ray that is inside the triangle's padded box, and a triangle is left out only where that box lies
/// beside the shaft by more than rounding could change. So the closest hit among the list is the
/// closest of all, with the same bits, and a list may be left once the best hit is closer than the
/// next entry.
#[derive(Debug, Clone)]
pub struct Shafts {
    /// Where each shaft's list begins, and the end of the last; `[shafts + 1]`.
    pub starts: Vec<u32>,
    /// The lists, shaft after shaft.
    pub candidates: Vec<Candidate>,
}

impl Shafts {
    /// Lists for rays of up to `range` metres that start in `origins`; `None` when they would hold
    /// more than `most` candidates, or one of them very many, as for fine meshes near the box.
    ///
    /// `edge` is a power of two from 4 on.
    pub fn build(bvh: &Bvh, origins: &Aabb, range: f32, edge: u32, most: usize) -> Option<Self> {
        let boxes: Vec<Aabb> =
            bvh.triangles.iter().map(|triangle| Bvh::padded_box(triangle, bvh.pad)).collect();
        let farthest = origins.min.abs().max(origins.max.abs()).max_element();
        let slack = 4.0 * (bvh.pad + (farthest + range) * PAD_SHARE);
        let side = edge / TASK_EDGE;
        let tasks = 6 * TASK_EDGE * TASK_EDGE;
        // A part of a face that alone takes so much is a sign of too much in all.
        let share = most / 8;
        let lists = (0..tasks).into_par_iter().map(|task| {
            let face = task / (TASK_EDGE * TASK_EDGE);
            let [column, row] = unpack(task % (TASK_EDGE * TASK_EDGE));
            let mut search = Search {
                boxes: &boxes,
                origins,
                range,
                edge,
                slack,
                axes: [face / 2 + 1, face / 2 + 2, face / 2].map(|axis| (axis % 3) as usize),
                backward: face % 2 == 1,
                most: share,
                too_long: false,
                counts: Vec::new(),
                found: Vec::new(),
            };
            let square = Square { column: column * side, row: row * side, side };
            search.refine(square, &(0..boxes.len() as u32).collect::<Vec<_>>());
            let fits = search.found.len() <= share && !search.too_long;
            fits.then_some((search.counts, search.found))
        });
        let lists = lists.collect::<Option<Vec<_>>>()?;
        let mut shafts = Self { starts: vec![0], candidates: Vec::new() };
        for (counts, mut found) in lists {
            for count in counts {
                shafts.starts.push(shafts.starts[shafts.starts.len() - 1] + count);
            }
            shafts.candidates.append(&mut found);
        }
        (shafts.candidates.len() <= most).then_some(shafts)
    }

    /// Shafts around a box.
    pub fn count(edge: u32) -> usize {
        6 * (edge * edge) as usize
    }

    /// Number of the shaft of a ray that starts in the box.
    pub fn of(ray: &Ray, edge: u32) -> u32 {
        let backward = u32::from(ray.direction[ray.major] < 0.0);
        let [column, row] = ray.shear.map(|slope| {
            let at = (slope + 1.0) * (edge / 2) as f32;
            (at as u32).min(edge - 1)
        });
        (2 * ray.major as u32 + backward) * edge * edge + pack(column, row)
    }
}

/// Bits of both numbers in turn: squares that are refined together have numbers that follow on.
fn pack(column: u32, row: u32) -> u32 {
    (0..BITS).map(|bit| (column >> bit & 1) << (2 * bit) | (row >> bit & 1) << (2 * bit + 1)).sum()
}

fn unpack(number: u32) -> [u32; 2] {
    let every_other =
        |from: u32| (0..BITS).map(|bit| (number >> (2 * bit + from) & 1) << bit).sum();
    [every_other(0), every_other(1)]
}

/// Part of a face of the cube of directions.
#[derive(Clone, Copy)]
struct Square {
    column: u32,
    row: u32,
    side: u32,
}

struct Search<'a> {
    boxes: &'a [Aabb],
    origins: &'a Aabb,
    range: f32,
    edge: u32,
    slack: f32,
    /// The two axes along the face and the one across it.
    axes: [usize; 3],
    /// Whether the rays go towards lower coordinates across the face.
    backward: bool,
    most: usize,
    /// Whether a list was longer than [`LONGEST`].
    too_long: bool,
    counts: Vec<u32>,
    found: Vec<Candidate>,
}

/// What holds for all rays of a square.
struct Frustum {
    /// Slopes with which a point's coordinate, less slope times depth, has its largest and its least
    /// value at the origin; and these values.
    sides: [[(f32, f32); 2]; 2],
    /// Depths between which the rays lie.
    depth: [f32; 2],
    /// Most metres along each axis that a ray goes in one metre.
    pace: [f32; 3],
}

impl Search<'_> {
    fn refine(&mut self, square: Square, among: &[u32]) {
        if self.found.len() > self.most || self.too_long {
            return;
        }
        let frustum = self.frustum(square);
        if square.side == 1 {
            let mut list: Vec<Candidate> = among
                .iter()
                .map(|&triangle| (triangle, &self.boxes[triangle as usize]))
                .filter(|(_, bounds)| self.meets(&frustum, bounds))
                .map(|(triangle, bounds)| Candidate {
                    triangle,
                    enter: self.enter(&frustum, bounds),
                })
                .filter(|candidate| candidate.enter <= self.range)
                .collect();
            list.sort_unstable_by(|a, b| {
                a.enter.total_cmp(&b.enter).then(a.triangle.cmp(&b.triangle))
            });
            self.too_long |= list.len() > LONGEST;
            self.counts.push(list.len() as u32);
            self.found.append(&mut list);
            return;
        }
        let inside: Vec<u32> = among
            .iter()
            .copied()
            .filter(|&triangle| self.meets(&frustum, &self.boxes[triangle as usize]))
            .collect();
        let side = square.side / 2;
        for quarter in 0..4 {
            let (column, row) =
                (square.column + side * (quarter & 1), square.row + side * (quarter >> 1));
            self.refine(Square { column, row, side }, &inside);
        }
    }

    fn frustum(&self, square: Square) -> Frustum {
        let slope = |at: u32| at as f32 * (2.0 / self.edge as f32) - 1.0;
        let slopes = [square.column, square.row]
            .map(|first| [slope(first) - SLOPE_SLACK, slope(first + square.side) + SLOPE_SLACK]);
        let [low, high] = [self.origins.min, self.origins.max];
        let across = self.axes[2];
        let sides = [0, 1].map(|k| {
            let [mut above, mut below] = [slopes[k][1], slopes[k][0]];
            if self.backward {
                (above, below) = (below, above);
            }
            let axis = self.axes[k];
            let most = high[axis] - (above * low[across]).min(above * high[across]);
            let least = low[axis] - (below * low[across]).max(below * high[across]);
            [(above, most + self.slack), (below, least - self.slack)]
        });
        let depth = if self.backward {
            [low[across] - self.range, high[across]]
        } else {
            [low[across], high[across] + self.range]
        };
        let largest = slopes.map(|[low, high]| low.abs().max(high.abs()));
        let least = slopes.map(|[low, high]| low.max(-high).max(0.0));
        let mut pace = [0.0; 3];
        pace[across] = 1.0 / (1.0 + least[0] * least[0] + least[1] * least[1]).sqrt();
        for k in 0..2 {
            let other = least[1 - k];
            pace[self.axes[k]] =
                largest[k] / (1.0 + largest[k] * largest[k] + other * other).sqrt();
        }
        Frustum { sides, depth: [depth[0] - self.slack, depth[1] + self.slack], pace }
    }

    /// Whether a ray of the frustum may be inside a box.
    fn meets(&self, frustum: &Frustum, bounds: &Aabb) -> bool {
        let across = self.axes[2];
        let near = bounds.min[across].max(frustum.depth[0]);
        let far = bounds.max[across].min(frustum.depth[1]);
        near <= far
            && (0..2).all(|k| {
                let [(above, most), (below, least)] = frustum.sides[k];
                let axis = self.axes[k];
                bounds.min[axis] - (above * near).max(above * far) <= most
                    && bounds.max[axis] - (below * near).min(below * far) >= least
            })
    }

    /// A distance before which no ray of the frustum enters a box.
    fn enter(&self, frustum: &Frustum, bounds: &Aabb) -> f32 {
        let gaps = (bounds.min - self.origins.max).max(self.origins.min - bounds.max);
        let along = gaps.max(Vec3::ZERO) / Vec3::from(frustum.pace).max(Vec3::splat(1e-6));
        (along.max_element() * (1.0 - DISTANCE_SLACK) - 2.0 * self.slack).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_numbered_in_the_order_of_refinement() {
        for number in [0, 1, 2, 3, 77, 4095] {
            let [column, row] = unpack(number);
            assert_eq!(pack(column, row), number);
        }
        let ray = |x: f32, y: f32, z: f32| {
            Shafts::of(&Ray::new(Vec3::ZERO, Vec3::new(x, y, z).normalize(), 1.0), 64)
        };
        assert_eq!(ray(0.0, 0.0, -1.0) / 4096, 5);
        let corners = [ray(1.0, 1.0, 1.0), ray(-1.0, -1.0, -1.0), ray(1.0, 0.0, -0.0)];
        assert!(corners.iter().all(|&shaft| (shaft as usize) < Shafts::count(64)));
    }
}
