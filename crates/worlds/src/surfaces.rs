//! From a network to its surfaces: roads, walks with kerbs, paint, and the terrain around them.
//!
//! Ground occupancy: roads, walks, houses and things on a 0.5 m grid, kept in tiles, and things that a map itself has.
//! None of our poles, signs and barriers stand beside poles, signs and barriers of the map.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};
use rand_chacha::ChaCha8Rng;

use crate::network::{GroundRect, MapShape, Model, Network, Strip, StripUse, class, left_of};
use crate::style::Style;

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

/// A static world that is being drawn: surfaces, then houses and things.
pub(crate) struct WorldDraft<'a> {
    pub network: &'a Network,
    pub style: &'a Style,
    pub terrain: Terrain,
    pub mask: Mask,
    pub model: Model,
    /// Generator of the step that draws now.
    pub rng: ChaCha8Rng,
    /// Where the map itself has things.
    pub of_map: MapObjects,
    /// Ground plans of the houses, corner by corner.
    pub houses: Vec<[DVec2; 4]>,
    /// Feet of the trees.
    pub trees: Vec<DVec2>,
    /// Signals of the map that would stand on the road.
    pub left_out: usize,
}

impl<'a> WorldDraft<'a> {
    /// Draws the surfaces of a network and the shapes that it brings.
    pub(crate) fn new(network: &'a Network, style: &'a Style, rng: ChaCha8Rng) -> Self {
        let mut model = Model::default();
        let open = if style.goods { class::GROUND } else { class::TERRAIN };
        let (mut mask, terrain) = draw(network, &mut model, open);
        pave_gaps(network, &mut mask, &mut model);
        shapes(&network.shapes, &mut mask, &mut model);
        let (of_map, houses, trees) = (MapObjects::of(network), Vec::new(), Vec::new());
        Self { network, style, terrain, mask, model, rng, of_map, houses, trees, left_out: 0 }
    }
}

/// Marks roads and walks, and draws all surfaces; the terrain is of the class `open`.
fn draw(network: &Network, model: &mut Model, open: u16) -> (Mask, Terrain) {
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
    skirt(model, [q[0], q[1]], class);
    skirt(model, [q[3], q[2]], class);
}

/// A face down from an edge.
fn skirt(model: &mut Model, [a, b]: [DVec3; 2], class: u16) {
    let down = DVec3::Z * SKIRT;
    model.quad([a, b, b - down, a - down], class);
}

/// Draws the shapes of the map, and keeps the ground under solid ones free of other things.
fn shapes(shapes: &[MapShape], mask: &mut Mask, model: &mut Model) {
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
                let pairs = edge.points().windows(2);
                pairs.for_each(|pair| skirt(model, [pair[0], pair[1]], class::TERRAIN));
            }
        }
    }
}

/// Heights of the ground around a network on a grid.
#[derive(Debug)]
pub(crate) struct Terrain {
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
    pub(crate) fn height(&self, p: DVec2) -> f64 {
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
fn pave_gaps(network: &Network, mask: &mut Mask, model: &mut Model) {
    /// Largest gap in cells: 50 m².
    const LARGEST: usize = 200;
    let gaps = mask.gaps(ROAD | WALK, LARGEST);
    if gaps.is_empty() {
        return;
    }
    let mut heights = BTreeMap::new();
    let coarse = |p: DVec2| [(p.x / 4.0).floor() as i32, (p.y / 4.0).floor() as i32];
    for strip in network.strips.iter().filter(|s| s.used == StripUse::Road) {
        for p in strip.left.iter().chain(&strip.right) {
            heights.entry(coarse(p.truncate())).or_insert(p.z);
        }
    }
    for cell in gaps {
        let middle = Mask::middle(cell);
        let tile = GroundRect::new(middle, DVec2::X, [0.5 * CELL; 2]);
        let [x, y] = coarse(middle);
        let near = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [x + i, y + j]));
        let mut found = [[x, y]].into_iter().chain(near).filter_map(|c| heights.get(&c));
        if let Some(&z) = found.next() {
            model.quad(tile.corners().map(|p| p.extend(z - 0.005)), class::ROAD);
            mask.set(cell, ROAD);
        }
    }
}

/// Bits of a cell.
pub(crate) const ROAD: u8 = 1;
pub(crate) const WALK: u8 = 2;
pub(crate) const HOUSE: u8 = 4;
pub(crate) const THING: u8 = 8;

/// Edge of a cell, metres.
const CELL: f64 = 0.5;
/// Cells along the edge of a tile.
const TILE: i32 = 64;

/// Bits by cell; cells never marked are 0.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mask {
    tiles: BTreeMap<[i32; 2], Vec<u8>>,
}

impl Mask {
    pub(crate) fn cell(p: DVec2) -> [i32; 2] {
        [(p.x / CELL).floor() as i32, (p.y / CELL).floor() as i32]
    }

    pub(crate) fn middle([x, y]: [i32; 2]) -> DVec2 {
        DVec2::new((f64::from(x) + 0.5) * CELL, (f64::from(y) + 0.5) * CELL)
    }

    /// Bits of a cell.
    pub(crate) fn get(&self, [x, y]: [i32; 2]) -> u8 {
        let tile = self.tiles.get(&[x.div_euclid(TILE), y.div_euclid(TILE)]);
        tile.map_or(0, |t| t[(x.rem_euclid(TILE) * TILE + y.rem_euclid(TILE)) as usize])
    }

    pub(crate) fn set(&mut self, [x, y]: [i32; 2], bits: u8) {
        let tile = self.tiles.entry([x.div_euclid(TILE), y.div_euclid(TILE)]);
        let tile = tile.or_insert_with(|| vec![0; (TILE * TILE) as usize]);
        tile[(x.rem_euclid(TILE) * TILE + y.rem_euclid(TILE)) as usize] |= bits;
    }

    /// All cells with one of `bits`, in the order of tiles.
    pub(crate) fn cells(&self, bits: u8) -> impl Iterator<Item = [i32; 2]> {
        self.tiles.iter().flat_map(move |([tx, ty], tile)| {
            let marked = tile.iter().zip(0_i32..).filter(move |(cell, _)| **cell & bits != 0);
            marked.map(move |(_, i)| [tx * TILE + i / TILE, ty * TILE + i % TILE])
        })
    }

    /// Marks the cells whose middle lies in a quad that is convex in plan.
    pub(crate) fn fill(&mut self, quad: [DVec3; 4], bits: u8) {
        let q = quad.map(|p| p.truncate());
        let low = Self::cell(q.iter().fold(q[0], |a, b| a.min(*b)));
        let high = Self::cell(q.iter().fold(q[0], |a, b| a.max(*b)));
        for cell in (low[0]..=high[0]).flat_map(|x| (low[1]..=high[1]).map(move |y| [x, y])) {
            let p = Self::middle(cell);
            if in_triangle(p, q[0], q[1], q[2]) || in_triangle(p, q[0], q[2], q[3]) {
                self.set(cell, bits);
            }
        }
    }

    /// Like [`Mask::fill`], for a quad whose sides from its first and last corner are long: in pieces.
    pub(crate) fn fill_long(&mut self, [a, b, c, d]: [DVec3; 4], bits: u8) {
        let length = (b - a).length().max((c - d).length());
        let pieces = (length / 4.0).ceil().clamp(1.0, 1e5) as u32;
        for k in 0..pieces {
            let [u, v] = [k, k + 1].map(|k| f64::from(k) / f64::from(pieces));
            self.fill([a.lerp(b, u), a.lerp(b, v), d.lerp(c, v), d.lerp(c, u)], bits);
        }
    }

    /// True if a rectangle touches a cell with one of `bits`.
    pub(crate) fn touches(&self, rect: &GroundRect, bits: u8) -> bool {
        // Half a cell's diagonal more, so that no marked cell lies between two that are looked at.
        let (half, left) = (rect.half + DVec2::splat(0.36), left_of(rect.ahead));
        let steps = |h: f64| (2.0 * h / CELL).ceil().max(1.0) as i32;
        let [n, m] = [steps(half.x), steps(half.y)];
        (0..=n).any(|i| {
            (0..=m).any(|j| {
                let at = |k: i32, n: i32, h: f64| h * (2.0 * f64::from(k) / f64::from(n) - 1.0);
                let p = rect.middle + rect.ahead * at(i, n, half.x) + left * at(j, m, half.y);
                self.get(Self::cell(p)) & bits != 0
            })
        })
    }

    pub(crate) fn block(&mut self, rect: &GroundRect, bits: u8) {
        self.fill(rect.corners().map(|p| p.extend(0.0)), bits);
        self.set(Self::cell(rect.middle), bits);
    }

    /// Unmarked cells in gaps of at most `most` cells between cells with one of `bits`.
    pub(crate) fn gaps(&self, bits: u8, most: usize) -> Vec<[i32; 2]> {
        let mut known: BTreeMap<[i32; 2], bool> = BTreeMap::new();
        let mut found = Vec::new();
        for cell in self.cells(bits) {
            for start in around(cell) {
                if self.get(start) & bits != 0 || known.contains_key(&start) {
                    continue;
                }
                let (mut group, mut next, mut closed) = (vec![start], 0, true);
                let mut seen = BTreeSet::from([start]);
                while next < group.len() && closed {
                    for other in around(group[next]) {
                        if self.get(other) & bits == 0 && seen.insert(other) {
                            closed &= known.get(&other) != Some(&false) && group.len() < most;
                            group.push(other);
                        }
                    }
                    next += 1;
                }
                known.extend(group.iter().map(|c| (*c, closed)));
                if closed {
                    found.extend(group);
                }
            }
        }
        found
    }
}

fn around([x, y]: [i32; 2]) -> [[i32; 2]; 4] {
    [[x + 1, y], [x - 1, y], [x, y + 1], [x, y - 1]]
}

fn in_triangle(p: DVec2, a: DVec2, b: DVec2, c: DVec2) -> bool {
    let side = |a: DVec2, b: DVec2| (b - a).perp_dot(p - a);
    let [u, v, w] = [side(a, b), side(b, c), side(c, a)];
    (u >= 0.0 && v >= 0.0 && w >= 0.0) || (u <= 0.0 && v <= 0.0 && w <= 0.0)
}

/// Edge of a cell in metres: the map's own thing in a cell, or in one beside it, is the thing that ours would be.
const NEAR: f64 = 2.0;

/// Cells of [`NEAR`] metres in which a map itself has a thing of a class.
#[derive(Debug, Default)]
pub(crate) struct MapObjects(BTreeSet<(u16, [i32; 2])>);

impl MapObjects {
    /// All posts and shapes of a network; barriers of all kinds are one class.
    pub(crate) fn of(network: &Network) -> Self {
        let signs = network.posts.iter().map(|post| (class::TRAFFIC_SIGN, post.foot));
        let barrier = |class| match class {
            class::FENCE | class::WALL | class::GUARD_RAIL => class::GUARD_RAIL,
            other => other,
        };
        let shapes = network.shapes.iter().flat_map(|shape| {
            let class = barrier(shape.class);
            let edges = shape.faces.iter().flat_map(|[a, b, c]| [(*a, *b), (*b, *c), (*c, *a)]);
            edges.flat_map(move |(from, to)| {
                // A rail of one piece is there all along.
                let pieces = ((to - from).truncate().length() / NEAR).ceil().clamp(1.0, 1e3) as u32;
                (0..pieces).map(move |k| (class, from.lerp(to, f64::from(k) / f64::from(pieces))))
            })
        });
        Self(signs.chain(shapes).map(|(class, p)| (class, cell(p.truncate()))).collect())
    }

    /// True if the map has a thing of the class within 2 to 4 m.
    pub(crate) fn near(&self, class: u16, p: DVec2) -> bool {
        let [x, y] = cell(p);
        (-1..=1).any(|i| (-1..=1).any(|j| self.0.contains(&(class, [x + i, y + j]))))
    }
}

fn cell(p: DVec2) -> [i32; 2] {
    [(p.x / NEAR).floor() as i32, (p.y / NEAR).floor() as i32]
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn a_pole_takes_the_place_of_one_within_3_m_and_a_rail_of_all_along_it() {
        let shape = |class, faces| MapShape { class, faces, solid: true };
        let rail = [DVec3::ZERO, DVec3::X * 100.0, DVec3::new(100.0, 0.0, 0.8)];
        let pole = [DVec3::new(1.0, 41.0, 0.0); 3];
        let shapes = vec![shape(class::WALL, vec![rail]), shape(class::POLE, vec![pole])];
        let of_map = MapObjects::of(&Network { shapes, ..Network::default() });
        let near = |class, x, y| of_map.near(class, DVec2::new(x, y));
        assert!(near(class::POLE, 2.9, 41.0) && near(class::POLE, 1.0, 39.1));
        assert!(!near(class::POLE, 5.1, 41.0) && !near(class::POLE, 1.0, 46.0));
        assert!(near(class::GUARD_RAIL, 53.0, 1.0) && !near(class::GUARD_RAIL, 53.0, 5.0));
        assert!(!near(class::POLE, 53.0, 1.0));
    }
}
