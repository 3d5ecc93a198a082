//! The outline of flat triangles: they are laid on a fine grid, and the border of the filled cells is followed.

use std::collections::HashMap;

use crate::maths;

/// Most cells along a side of the grid.
const MOST_CELLS: f64 = 1200.0;
/// Size of a cell in metres, unless there would be more than [`MOST_CELLS`].
const FINEST: f64 = 0.01;
/// Cells that a corner may lie beside the line between its neighbours and be left out.
/// The corners of a slope's steps lie up to one cell apart.
const SLACK: f64 = 1.05;

/// A point of a view.
pub(crate) type Flat = [f64; 2];
/// A corner of the grid.
type Corner = [i32; 2];

/// Closed loops around the union of triangles, holes among them, in the triangles' unit: metres. A corner is off by at
/// most about a cell: a centimetre, or a 1200th of the longer side.
pub(in super::super) fn outline(triangles: &[[Flat; 3]]) -> Vec<Vec<Flat>> {
    let corners = || triangles.iter().flatten();
    let least = |k: usize| corners().map(|c| c[k]).fold(f64::INFINITY, f64::min);
    let most = |k: usize| corners().map(|c| c[k]).fold(f64::NEG_INFINITY, f64::max);
    let low = [least(0), least(1)];
    let size = [most(0) - low[0], most(1) - low[1]];
    if !size.iter().all(|side| *side > 0.0 && side.is_finite()) {
        return Vec::new();
    }
    let cell = FINEST.max(size[0].max(size[1]) / MOST_CELLS);
    let cells = size.map(|side| (side / cell).ceil().max(1.0));
    // Whole cells along both sides, so that a box keeps its corners.
    let step = [0, 1].map(|k| size[k] / cells[k]);
    let on_grid = |corner: Flat| [0, 1].map(|k| (corner[k] - low[k]) / step[k]);
    let grid = Raster::of(triangles.iter().map(|t| t.map(on_grid)), cells.map(|n| n as usize));
    let back = |corner: Flat| [0, 1].map(|k| low[k] + corner[k] * step[k]);
    let loops = grid.border().into_iter().map(|corners| simple(&corners));
    loops.filter(|corners| corners.len() > 2).map(|l| l.into_iter().map(back).collect()).collect()
}

/// Cells whose middle lies in a triangle.
struct Raster {
    columns: usize,
    rows: usize,
    filled: Vec<bool>,
}

impl Raster {
    fn of(triangles: impl Iterator<Item = [Flat; 3]>, [columns, rows]: [usize; 2]) -> Self {
        // By row: where runs begin, +1, and end, −1. A triangle costs its height, however wide it is.
        let mut changes = vec![0_i32; (columns + 1) * rows];
        for corners in triangles {
            let low = corners.iter().map(|c| c[1]).fold(f64::INFINITY, f64::min);
            let high = corners.iter().map(|c| c[1]).fold(f64::NEG_INFINITY, f64::max);
            let row = |y: f64| ((y - 0.5).ceil().max(0.0) as usize).min(rows);
            for row in row(low)..row(high) {
                let [from, to] = across(&corners, row as f64 + 0.5);
                let column = |x: f64| ((x - 0.5).ceil().max(0.0) as usize).min(columns);
                let (from, to) = (column(from), column(to));
                if from < to {
                    changes[row * (columns + 1) + from] += 1;
                    changes[row * (columns + 1) + to] -= 1;
                }
            }
        }
        let mut filled = Vec::with_capacity(columns * rows);
        for row in changes.chunks(columns + 1) {
            let runs = row[..columns].iter().scan(0, |sum, change| {
                *sum += change;
                Some(*sum > 0)
            });
            filled.extend(runs);
        }
        Self { columns, rows, filled }
    }

    fn is_filled(&self, x: i32, y: i32) -> bool {
        let inside = (0..self.columns as i32).contains(&x) && (0..self.rows as i32).contains(&y);
        inside && self.filled[y as usize * self.columns + x as usize]
    }

    /// Closed loops along the sides between filled and empty cells, the filled ones to the left.
    fn border(&self) -> Vec<Vec<Corner>> {
        let mut next: HashMap<Corner, Vec<Corner>> = HashMap::new();
        let mut starts = Vec::new();
        for y in 0..self.rows as i32 {
            for x in 0..self.columns as i32 {
                if !self.is_filled(x, y) {
                    continue;
                }
                let sides = [
                    ([x, y - 1], [x, y], [x + 1, y]),
                    ([x + 1, y], [x + 1, y], [x + 1, y + 1]),
                    ([x, y + 1], [x + 1, y + 1], [x, y + 1]),
                    ([x - 1, y], [x, y + 1], [x, y]),
                ];
                for ([a, b], from, to) in sides {
                    if !self.is_filled(a, b) {
                        next.entry(from).or_default().push(to);
                        starts.push(from);
                    }
                }
            }
        }
        let mut loops = Vec::new();
        for start in starts {
            let (mut corners, mut at) = (Vec::new(), start);
            // Every corner ends as many sides as it begins, so that the way ends at its start.
            while let Some(to) = next.get_mut(&at).and_then(Vec::pop) {
                corners.push(at);
                at = to;
            }
            if !corners.is_empty() {
                loops.push(corners);
            }
        }
        loops
    }
}

/// Least and greatest x of a triangle at a height.
fn across(corners: &[Flat; 3], y: f64) -> [f64; 2] {
    let mut range = [f64::INFINITY, f64::NEG_INFINITY];
    for k in 0..3 {
        let ([ax, ay], [bx, by]) = (corners[k], corners[(k + 1) % 3]);
        if (ay - y) * (by - y) <= 0.0 && ay != by {
            let x = ax + (y - ay) / (by - ay) * (bx - ax);
            range = [range[0].min(x), range[1].max(x)];
        }
    }
    range
}

/// A loop without the corners that lie beside the lines between others by less than [`SLACK`] (Douglas, Peucker 1973).
fn simple(corners: &[Corner]) -> Vec<Flat> {
    let corners: Vec<Flat> = corners.iter().map(|c| c.map(f64::from)).collect();
    // Two corners far apart stay; both halves between them are thinned.
    let first = farthest(&corners, corners[0]);
    let turned: Vec<Flat> = corners[first..].iter().chain(&corners[..first]).copied().collect();
    let second = farthest(&turned, turned[0]);
    let mut kept = vec![false; turned.len() + 1];
    let closed: Vec<Flat> = turned.iter().chain(&turned[..1]).copied().collect();
    let mut halves = vec![(0, second), (second, turned.len())];
    while let Some((from, to)) = halves.pop() {
        kept[from] = true;
        let beside = |k: usize| (k, distance(closed[from], closed[to], closed[k]));
        let farthest = (from + 1..to).map(beside).max_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((k, _)) = farthest.filter(|(_, by)| *by > SLACK) {
            halves.extend([(from, k), (k, to)]);
        }
    }
    turned.iter().zip(&kept).filter(|(_, kept)| **kept).map(|(corner, _)| *corner).collect()
}

/// Number of the corner that is farthest from a point.
fn farthest(corners: &[Flat], from: Flat) -> usize {
    let distance = |c: &Flat| maths::hypot(c[0] - from[0], c[1] - from[1]);
    let all = corners.iter().enumerate();
    all.max_by(|a, b| distance(a.1).total_cmp(&distance(b.1))).map_or(0, |(k, _)| k)
}

/// Distance of a point from the line through two others, or from the first where both are one.
fn distance(a: Flat, b: Flat, point: Flat) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
    let length = maths::hypot(along[0], along[1]);
    if length == 0.0 {
        return maths::hypot(to[0], to[1]);
    }
    (along[0] * to[1] - along[1] * to[0]).abs() / length
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rectangle([ax, ay]: Flat, [bx, by]: Flat) -> [[Flat; 3]; 2] {
        [[[ax, ay], [bx, ay], [bx, by]], [[ax, ay], [bx, by], [ax, by]]]
    }

    fn area(corners: &[Flat]) -> f64 {
        let next = corners.iter().cycle().skip(1);
        0.5 * corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - b[0] * a[1]).sum::<f64>()
    }

    #[test]
    fn a_box_keeps_its_corners() {
        let loops = outline(&rectangle([-2.013, -1.0], [2.0, 0.777]));
        assert_eq!(loops.len(), 1);
        let mut corners = loops[0].clone();
        corners.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let wanted = [[-2.013, -1.0], [-2.013, 0.777], [2.0, -1.0], [2.0, 0.777]];
        assert_eq!(corners.len(), 4, "{corners:?}");
        for (found, wanted) in corners.iter().zip(wanted) {
            assert!((found[0] - wanted[0]).abs() < 1e-12 && (found[1] - wanted[1]).abs() < 1e-12);
        }
    }

    #[test]
    fn a_ring_has_a_hole_and_a_slope_stays_within_a_cell() {
        let ring = [
            rectangle([0.0, 0.0], [4.0, 1.0]),
            rectangle([0.0, 3.0], [4.0, 4.0]),
            rectangle([0.0, 0.0], [1.0, 4.0]),
            rectangle([3.0, 0.0], [4.0, 4.0]),
        ];
        let loops = outline(&ring.concat());
        let mut areas: Vec<f64> = loops.iter().map(|corners| area(corners)).collect();
        areas.sort_by(f64::total_cmp);
        assert_eq!(areas.len(), 2);
        assert!((areas[0] + 4.0).abs() < 1e-9 && (areas[1] - 16.0).abs() < 1e-9, "{areas:?}");
        let slope = outline(&[[[0.0, 0.0], [3.0, 0.0], [0.0, 1.0]]]);
        assert!((area(&slope[0]) - 1.5).abs() < 0.03, "{}", area(&slope[0]));
        assert!(slope[0].len() < 12, "{} corners", slope[0].len());
    }

    #[test]
    fn what_has_no_area_has_no_outline() {
        assert!(outline(&[]).is_empty());
        assert!(outline(&[[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]]).is_empty());
    }
}
