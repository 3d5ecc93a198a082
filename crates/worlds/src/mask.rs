//! Ground occupancy: roads, walks, houses and things on a 0.5 m grid, kept in tiles, and things that a map itself has.
//!
//! None of our poles, signs and barriers stand beside poles, signs and barriers of the map.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DVec2, DVec3};

use crate::network::{Network, class};

/// Bits of a cell.
pub const ROAD: u8 = 1;
pub const WALK: u8 = 2;
pub const HOUSE: u8 = 4;
pub const THING: u8 = 8;

/// Edge of a cell, metres.
pub const CELL: f64 = 0.5;
/// Cells along the edge of a tile.
const TILE: i32 = 64;

/// Bits by cell; cells never marked are 0.
#[derive(Debug, Clone, Default)]
pub struct Mask {
    tiles: BTreeMap<[i32; 2], Vec<u8>>,
}

impl Mask {
    /// The cell of a point.
    pub fn cell(p: DVec2) -> [i32; 2] {
        [(p.x / CELL).floor() as i32, (p.y / CELL).floor() as i32]
    }

    /// Middle of a cell.
    pub fn middle([x, y]: [i32; 2]) -> DVec2 {
        DVec2::new((f64::from(x) + 0.5) * CELL, (f64::from(y) + 0.5) * CELL)
    }

    /// Bits of a cell.
    pub fn get(&self, [x, y]: [i32; 2]) -> u8 {
        let tile = self.tiles.get(&[x.div_euclid(TILE), y.div_euclid(TILE)]);
        tile.map_or(0, |t| t[(x.rem_euclid(TILE) * TILE + y.rem_euclid(TILE)) as usize])
    }

    /// Adds bits to a cell.
    pub fn set(&mut self, [x, y]: [i32; 2], bits: u8) {
        let tile = self.tiles.entry([x.div_euclid(TILE), y.div_euclid(TILE)]);
        let tile = tile.or_insert_with(|| vec![0; (TILE * TILE) as usize]);
        tile[(x.rem_euclid(TILE) * TILE + y.rem_euclid(TILE)) as usize] |= bits;
    }

    /// All cells with one of `bits`, in the order of tiles.
    pub fn cells(&self, bits: u8) -> impl Iterator<Item = [i32; 2]> {
        self.tiles.iter().flat_map(move |([tx, ty], tile)| {
            let marked = tile.iter().zip(0_i32..).filter(move |(cell, _)| **cell & bits != 0);
            marked.map(move |(_, i)| [tx * TILE + i / TILE, ty * TILE + i % TILE])
        })
    }

    /// Marks the cells whose middle lies in a quad that is convex in plan.
    pub fn fill(&mut self, quad: [DVec3; 4], bits: u8) {
        let q = quad.map(|p| p.truncate());
        for cell in cells_between(q) {
            let p = Self::middle(cell);
            if in_triangle(p, q[0], q[1], q[2]) || in_triangle(p, q[0], q[2], q[3]) {
                self.set(cell, bits);
            }
        }
    }

    /// Like [`Mask::fill`], for a quad whose sides from its first and last corner are long: in pieces.
    pub fn fill_long(&mut self, [a, b, c, d]: [DVec3; 4], bits: u8) {
        let length = (b - a).length().max((c - d).length());
        let pieces = (length / 4.0).ceil().clamp(1.0, 1e5) as u32;
        for k in 0..pieces {
            let [u, v] = [k, k + 1].map(|k| f64::from(k) / f64::from(pieces));
            self.fill([a.lerp(b, u), a.lerp(b, v), d.lerp(c, v), d.lerp(c, u)], bits);
        }
    }

    /// True if a rectangle (middle, unit direction, half sizes) touches a cell with one of `bits`.
    pub fn touches(&self, middle: DVec2, ahead: DVec2, half: DVec2, bits: u8) -> bool {
        // Half a cell's diagonal more, so that no marked cell lies between two that are looked at.
        let half = half + DVec2::splat(0.36);
        let steps = |h: f64| (2.0 * h / CELL).ceil().max(1.0) as i32;
        let [n, m] = [steps(half.x), steps(half.y)];
        let left = crate::network::left_of(ahead);
        (0..=n).any(|i| {
            (0..=m).any(|j| {
                let at = |k: i32, n: i32, h: f64| h * (2.0 * f64::from(k) / f64::from(n) - 1.0);
                let p = middle + ahead * at(i, n, half.x) + left * at(j, m, half.y);
                self.get(Self::cell(p)) & bits != 0
            })
        })
    }

    /// Marks a rectangle (middle, unit direction, half sizes).
    pub fn block(&mut self, middle: DVec2, ahead: DVec2, half: DVec2, bits: u8) {
        let left = crate::network::left_of(ahead);
        let corner = |x: f64, y: f64| (middle + ahead * half.x * x + left * half.y * y).extend(0.0);
        self.fill(
            [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
            bits,
        );
        self.set(Self::cell(middle), bits);
    }

    /// Unmarked cells in gaps of at most `most` cells between cells with one of `bits`.
    pub fn gaps(&self, bits: u8, most: usize) -> Vec<[i32; 2]> {
        let mut known: BTreeMap<[i32; 2], bool> = BTreeMap::new();
        let mut found = Vec::new();
        for cell in self.cells(bits) {
            for start in around(cell) {
                if self.get(start) & bits != 0 || known.contains_key(&start) {
                    continue;
                }
                let (mut group, mut next, mut closed) = (vec![start], 0, true);
                let mut seen = std::collections::BTreeSet::from([start]);
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

fn cells_between(q: [DVec2; 4]) -> impl Iterator<Item = [i32; 2]> {
    let low = Mask::cell(q.iter().fold(q[0], |a, b| a.min(*b)));
    let high = Mask::cell(q.iter().fold(q[0], |a, b| a.max(*b)));
    (low[0]..=high[0]).flat_map(move |x| (low[1]..=high[1]).map(move |y| [x, y]))
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
pub struct MapObjects(BTreeSet<(u16, [i32; 2])>);

impl MapObjects {
    /// All posts and shapes of a network; barriers of all kinds are one class.
    pub fn of(network: &Network) -> Self {
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
    pub fn near(&self, class: u16, p: DVec2) -> bool {
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
    use crate::network::MapShape;

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
