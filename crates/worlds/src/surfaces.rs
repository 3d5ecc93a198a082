//! From a network to its surfaces: roads, walks with kerbs, paint, and the terrain around them.

use glam::{DVec2, DVec3};

use super::mask::{CELL, Mask, ROAD, THING, WALK};
use super::network::{MapShape, Network, Strip, StripUse};
use crate::network::{Model, class};

/// Metres of terrain around the network.
const MARGIN: f64 = 70.0;
/// Edge of a terrain cell; grows where the network is large.
const TERRAIN_CELL: f64 = 4.0;
/// Most terrain cells along an axis.
const MOST_CELLS: usize = 400;
/// Metres of terrain below the lowest road near it.
const BELOW: f64 = 0.06;
/// Metres that the outer faces of roads and walks reach down.
const SKIRT: f64 = 0.6;

/// Marks roads and walks, and draws all surfaces; the terrain is of the class `open`.
pub fn draw(network: &Network, model: &mut Model, open: u16) -> (Mask, Terrain) {
    let mut mask = Mask::default();
    for strip in &network.strips {
        if matches!(strip.used, StripUse::Road | StripUse::Rail) {
            quads(strip).for_each(|q| mask.fill_long(q, ROAD));
        }
    }
    let walked = |strip: &&Strip| strip.used == StripUse::Walk;
    let free = |mask: &Mask, q: &[DVec3; 4]| {
        let middle = (q[0] + q[1] + q[2] + q[3]).truncate() * 0.25;
        mask.get(Mask::cell(middle)) & ROAD == 0
    };
    let terrain = Terrain::under(network);
    for strip in network.strips.iter().filter(|s| s.used != StripUse::Walk) {
        let class = match strip.used {
            StripUse::Green => class::TERRAIN,
            StripUse::Rail => class::RAIL_TRACK,
            StripUse::Road | StripUse::Walk => class::ROAD,
        };
        quads(strip).for_each(|q| model.quad(q, class));
        if !strip.raised.is_empty() {
            quads(strip).for_each(|q| sides(model, q, class));
        }
    }
    let mut walks = Mask::default();
    for strip in network.strips.iter().filter(walked) {
        for (q, up) in quads(strip).zip(strip.raised.windows(2)) {
            if !free(&mask, &q) {
                // Maps lead walks across junctions: there they are part of the road, just below it.
                let up = [up[0][0], up[1][0], up[1][1], up[0][1]];
                let lowered = [0, 1, 2, 3].map(|k| q[k] - DVec3::Z * (up[k] + 0.004));
                model.quad(lowered, class::ROAD);
                continue;
            }
            model.quad(q, class::SIDEWALK);
            walks.fill_long(q, WALK);
            sides(model, q, class::SIDEWALK);
        }
    }
    walks.cells(WALK).for_each(|cell| mask.set(cell, WALK));
    for quad in &network.marks {
        model.quad(*quad, class::ROAD_LINE);
    }
    edges(network, model);
    terrain.draw(model, open);
    (mask, terrain)
}

/// Faces down from both sides of a raised quad.
fn sides(model: &mut Model, q: [DVec3; 4], class: u16) {
    for [a, b] in [[q[0], q[1]], [q[3], q[2]]] {
        let down = DVec3::Z * SKIRT;
        model.quad([a, b, b - down, a - down], class);
    }
}

/// Draws the shapes of the map, and keeps the ground under solid ones free of other things.
pub fn shapes(shapes: &[MapShape], mask: &mut Mask, model: &mut Model) {
    for shape in shapes {
        for &[a, b, c] in &shape.faces {
            model.triangle([a, b, c], shape.class);
            if !shape.solid {
                continue;
            }
            mask.fill([a, b, c, c], THING);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let pieces = ((to - from).truncate().length() / CELL).ceil().clamp(1.0, 1e4) as u32;
                for k in 0..=pieces {
                    let at = from.lerp(to, f64::from(k) / f64::from(pieces)).truncate();
                    mask.set(Mask::cell(at), THING);
                }
            }
        }
    }
}

/// Quads of a strip; the model leaves out those without area.
fn quads(strip: &Strip) -> impl Iterator<Item = [DVec3; 4]> {
    let pairs = strip.left.windows(2).zip(strip.right.windows(2));
    pairs.map(|(l, r)| [l[0], l[1], r[1], r[0]])
}

/// Points of both edges and between them, at most `step` metres apart.
fn samples(strip: &Strip, step: f64) -> impl Iterator<Item = DVec3> {
    let along = strip.left.windows(2).chain(strip.right.windows(2)).map(|p| (p[0], p[1]));
    let across = strip.left.iter().copied().zip(strip.right.iter().copied());
    along.chain(across).flat_map(move |(a, b)| {
        let pieces = ((b - a).length() / step).ceil().clamp(1.0, 1e4) as u32;
        (0..=pieces).map(move |k| a.lerp(b, f64::from(k) / f64::from(pieces)))
    })
}

/// Faces down from the outer edges of roads, so that no gap opens to a lower terrain.
fn edges(network: &Network, model: &mut Model) {
    for street in &network.streets {
        for (edge, walk) in street.edges.iter().zip(street.walks) {
            if walk == 0.0 {
                for pair in edge.points().windows(2) {
                    let down = DVec3::Z * SKIRT;
                    let face = [pair[0], pair[1], pair[1] - down, pair[0] - down];
                    model.quad(face, class::TERRAIN);
                }
            }
        }
    }
}

/// Heights of the ground around a network on a grid.
#[derive(Debug)]
pub struct Terrain {
    low: DVec2,
    cell: f64,
    size: [usize; 2],
    heights: Vec<f64>,
}

impl Terrain {
    /// Terrain that stays below all roads near it and blends in between.
    fn under(network: &Network) -> Self {
        let [low, high] = network.bounds().unwrap_or_default();
        let low = low.truncate() - MARGIN;
        let extent = high.truncate() + MARGIN - low;
        let cell = TERRAIN_CELL.max(extent.max_element() / MOST_CELLS as f64);
        let size = [extent.x, extent.y].map(|e| (e / cell).ceil() as usize + 2);
        let mut below = vec![f64::INFINITY; size[0] * size[1]];
        for strip in &network.strips {
            for p in samples(strip, 0.5 * cell) {
                let at = (p.truncate() - low) / cell;
                let (i, j) = (at.x as usize, at.y as usize);
                for (i, j) in [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)] {
                    let height = &mut below[i.min(size[0] - 1) * size[1] + j.min(size[1] - 1)];
                    *height = height.min(p.z);
                }
            }
        }
        let heights = blended(&below, size);
        Self { low, cell, size, heights }
    }

    /// Height of the ground at a place; outside the grid, the height of its border.
    pub fn height(&self, p: DVec2) -> f64 {
        let at = (p - self.low) / self.cell;
        let clamp = |v: f64, n: usize| v.clamp(0.0, n as f64 - 1.001);
        let (x, y) = (clamp(at.x, self.size[0]), clamp(at.y, self.size[1]));
        let (i, j) = (x as usize, y as usize);
        let (u, v) = (x - i as f64, y - j as f64);
        let h = |i: usize, j: usize| self.heights[i * self.size[1] + j];
        let near = h(i, j) * (1.0 - u) + h(i + 1, j) * u;
        near * (1.0 - v) + (h(i, j + 1) * (1.0 - u) + h(i + 1, j + 1) * u) * v
    }

    fn draw(&self, model: &mut Model, class: u16) {
        let corner = |i: usize, j: usize| {
            let place = self.low + DVec2::new(i as f64, j as f64) * self.cell;
            place.extend(self.heights[i * self.size[1] + j])
        };
        for i in 0..self.size[0] - 1 {
            for j in 0..self.size[1] - 1 {
                let quad = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                model.quad(quad, class);
            }
        }
    }
}

/// Known heights, a little lowered; gaps are filled from neighbours and smoothed.
fn blended(below: &[f64], [n, m]: [usize; 2]) -> Vec<f64> {
    let around = |k: usize| {
        let (i, j) = (k / m, k % m);
        let sides = [(i.wrapping_sub(1), j), (i + 1, j), (i, j.wrapping_sub(1)), (i, j + 1)];
        sides.into_iter().filter(move |(i, j)| *i < n && *j < m).map(move |(i, j)| i * m + j)
    };
    let mut heights: Vec<f64> = below.iter().map(|h| h - BELOW).collect();
    let mut front: Vec<usize> = (0..n * m).filter(|k| heights[*k].is_finite()).collect();
    if front.is_empty() {
        return vec![-BELOW; n * m];
    }
    while !front.is_empty() {
        let mut next = Vec::new();
        for &k in &front {
            for other in around(k) {
                if heights[other].is_infinite() {
                    heights[other] = heights[k];
                    next.push(other);
                }
            }
        }
        front = next;
    }
    for _ in 0..24 {
        let before = heights.clone();
        for k in (0..n * m).filter(|k| below[*k].is_infinite()) {
            let (sum, count) = around(k).fold((0.0, 0.0), |(s, c), o| (s + before[o], c + 1.0));
            heights[k] = sum / count;
        }
    }
    heights
}

/// Paves gaps of the mask inside junctions, at the height of the road around them.
pub fn pave_gaps(network: &Network, mask: &mut Mask, model: &mut Model) {
    /// Largest gap in cells: 50 m².
    const LARGEST: usize = 200;
    let gaps = mask.gaps(ROAD | WALK, LARGEST);
    if gaps.is_empty() {
        return;
    }
    let mut heights = std::collections::BTreeMap::new();
    let coarse = |p: DVec2| [(p.x / 4.0).floor() as i32, (p.y / 4.0).floor() as i32];
    for strip in network.strips.iter().filter(|s| s.used == StripUse::Road) {
        for p in strip.left.iter().chain(&strip.right) {
            heights.entry(coarse(p.truncate())).or_insert(p.z);
        }
    }
    for cell in gaps {
        let middle = Mask::middle(cell);
        let [x, y] = coarse(middle);
        let near = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [x + i, y + j]));
        let mut found = [[x, y]].into_iter().chain(near).filter_map(|c| heights.get(&c));
        if let Some(&z) = found.next() {
            let half = 0.5 * super::mask::CELL;
            let corner = |a: f64, b: f64| (middle + DVec2::new(a, b) * half).extend(z - 0.005);
            let quad = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            model.quad(quad, class::ROAD);
            mask.set(cell, ROAD);
        }
    }
}
