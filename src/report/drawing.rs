//! A drawing on a sheet of paper as a list of shapes, written as SVG and as PDF, and the outline of flat triangles.
//!
//! | file | holds |
//! |---|---|
//! | `pdf` | the drawing as PDF, with the standard font Helvetica |

mod pdf;

use std::collections::HashMap;

use maud::{Markup, html};

use crate::maths;

/// A point on the sheet: millimetres from its left and its upper edge.
pub(super) type Point = [f64; 2];

/// A colour, `#rrggbb`, and how opaque it is: 0 to 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ink(pub &'static str, pub f64);

impl Ink {
    pub(super) const fn full(colour: &'static str) -> Self {
        Self(colour, 1.0)
    }

    fn rgb(self) -> [f64; 3] {
        let part = |k: usize| self.0.get(1 + 2 * k..3 + 2 * k);
        let value = |k: usize| part(k).and_then(|hex| u8::from_str_radix(hex, 16).ok());
        [0, 1, 2].map(|k| f64::from(value(k).unwrap_or(0)) / 255.0)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Stroke {
    pub ink: Ink,
    pub width: f64,
    /// Length of dashes and of the gaps between them, millimetres; 0 for a solid line.
    pub dash: f64,
}

impl Stroke {
    pub(super) const fn solid(colour: &'static str, width: f64) -> Self {
        Self { ink: Ink::full(colour), width, dash: 0.0 }
    }

    pub(super) const fn dashed(colour: &'static str, width: f64) -> Self {
        Self { ink: Ink::full(colour), width, dash: 1.2 }
    }
}

/// Part of a text that stands at its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    /// Share of the width of words that lies left of their point.
    pub(super) fn share(self) -> f64 {
        0.5 * f64::from(self as u8)
    }
}

/// One shape of a drawing; later ones lie over earlier ones.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    /// Closed loops, filled where an odd number of them lies around a point.
    Area {
        loops: Vec<Vec<Point>>,
        fill: Option<Ink>,
        stroke: Option<Stroke>,
    },
    Line {
        points: Vec<Point>,
        stroke: Stroke,
    },
    Disc {
        at: Point,
        radius: f64,
        fill: Ink,
    },
    /// A line of words; `size` is that of the font in millimetres, the point lies on the base line.
    Words {
        at: Point,
        words: String,
        size: f64,
        anchor: Anchor,
        bold: bool,
        ink: Ink,
    },
}

/// A sheet of paper with shapes on it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Drawing {
    /// Width and height in millimetres.
    pub(super) size: [f64; 2],
    /// Title for readers that show one.
    pub(super) title: String,
    pub(super) shapes: Vec<Shape>,
}

impl Drawing {
    pub(super) fn new(size: [f64; 2], title: &str) -> Self {
        Self { size, title: title.to_owned(), shapes: Vec::new() }
    }

    pub(super) fn area(
        &mut self,
        loops: Vec<Vec<Point>>,
        fill: Option<Ink>,
        stroke: Option<Stroke>,
    ) {
        if loops.iter().any(|corners| !corners.is_empty()) {
            self.shapes.push(Shape::Area { loops, fill, stroke });
        }
    }

    pub(super) fn line(&mut self, points: impl Into<Vec<Point>>, stroke: Stroke) {
        self.shapes.push(Shape::Line { points: points.into(), stroke });
    }

    pub(super) fn disc(&mut self, at: Point, radius: f64, fill: Ink) {
        self.shapes.push(Shape::Disc { at, radius, fill });
    }

    /// Words of a size, dark and beginning at a point.
    pub(super) fn words(&mut self, at: Point, size: f64, words: impl Into<String>) {
        self.text(at, size, words, Anchor::Start, false, Ink::full(super::svg::INK));
    }

    pub(super) fn text(
        &mut self,
        at: Point,
        size: f64,
        words: impl Into<String>,
        anchor: Anchor,
        bold: bool,
        ink: Ink,
    ) {
        self.shapes.push(Shape::Words { at, words: words.into(), size, anchor, bold, ink });
    }

    /// The drawing as an SVG file of the sheet's size.
    pub(crate) fn svg(&self) -> String {
        let [width, height] = self.size.map(mm);
        html! {
            svg xmlns="http://www.w3.org/2000/svg" viewBox={ "0 0 " (width) " " (height) } width={ (width) "mm" }
                height={ (height) "mm" } role="img" font-family="Helvetica,Arial,sans-serif" {
                title { (self.title) }
                rect width="100%" height="100%" fill="#fff" {}
                @for shape in &self.shapes { (markup(shape)) }
            }
        }
        .into_string()
            + "\n"
    }
}

/// Colour of the paper, and of words on a sign, which have no halo.
const WHITE: &str = "#ffffff";
/// Width of the white line around words, which keeps them clear of other lines, as a share of the size of the font.
const HALO: f64 = 0.3;

/// A number of the sheet to a thousandth of a millimetre.
fn mm(value: f64) -> String {
    super::svg::trimmed(value, 3)
}

fn opacity(ink: Ink) -> Option<String> {
    (ink.1 < 1.0).then(|| mm(ink.1))
}

fn dashes(stroke: Stroke) -> Option<String> {
    (stroke.dash > 0.0).then(|| mm(stroke.dash))
}

fn path(points: &[Point], close: &str) -> String {
    let corners: Vec<String> =
        points.iter().map(|[x, y]| format!("{} {}", mm(*x), mm(*y))).collect();
    format!("M{}{close}", corners.join("L"))
}

fn markup(shape: &Shape) -> Markup {
    match shape {
        Shape::Area { loops, fill, stroke } => {
            let d: String = loops.iter().map(|corners| path(corners, "Z")).collect();
            html! {
                path d=(d) fill=(fill.map_or("none", |ink| ink.0)) fill-rule="evenodd"
                    fill-opacity=[fill.and_then(opacity)] stroke=[stroke.map(|s| s.ink.0)]
                    stroke-width=[stroke.map(|s| mm(s.width))] stroke-dasharray=[stroke.and_then(dashes)]
                    stroke-opacity=[stroke.and_then(|s| opacity(s.ink))] {}
            }
        }
        Shape::Line { points, stroke } => html! {
            path d=(path(points, "")) fill="none" stroke=(stroke.ink.0) stroke-width=(mm(stroke.width))
                stroke-dasharray=[dashes(*stroke)] stroke-opacity=[opacity(stroke.ink)] {}
        },
        Shape::Disc { at: [x, y], radius, fill } => html! {
            circle cx=(mm(*x)) cy=(mm(*y)) r=(mm(*radius)) fill=(fill.0) fill-opacity=[opacity(*fill)] {}
        },
        Shape::Words { at: [x, y], words, size, anchor, bold, ink } => {
            let anchor = match anchor {
                Anchor::Start => None,
                Anchor::Middle => Some("middle"),
                Anchor::End => Some("end"),
            };
            html! {
                @let halo = (ink.0 != WHITE).then(|| mm(HALO * size));
                text x=(mm(*x)) y=(mm(*y)) font-size=(mm(*size)) fill=(ink.0) fill-opacity=[opacity(*ink)]
                    stroke=[halo.is_some().then_some(WHITE)] stroke-width=[halo.as_ref()]
                    stroke-linejoin=[halo.is_some().then_some("round")] paint-order=[halo.is_some().then_some("stroke")]
                    text-anchor=[anchor] font-weight=[bold.then_some("bold")] { (words) }
            }
        }
    }
}

/// Most cells along a side of the grid.
const MOST_CELLS: f64 = 1200.0;
/// Size of a cell in metres, unless there would be more than [`MOST_CELLS`].
const FINEST: f64 = 0.01;
/// Cells that a corner may lie beside the line between its neighbours and be left out.
/// The corners of a slope's steps lie up to one cell apart.
const SLACK: f64 = 1.05;

pub(crate) type Flat = [f64; 2];
type Corner = [i32; 2];

/// Closed loops around the union of triangles, holes among them, in the triangles' unit: metres. A corner is off by at
/// most about a cell: a centimetre, or a 1200th of the longer side.
pub(super) fn outline(triangles: &[[Flat; 3]]) -> Vec<Vec<Flat>> {
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
