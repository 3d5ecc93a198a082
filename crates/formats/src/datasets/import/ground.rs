//! Ground tiles to flat plates, everything else at rest to boxes.

use std::collections::{BTreeMap, HashMap, HashSet};

use glam::DVec3;
use serde_json::{Value, json};

use super::merge::{Block, Cell, merge};
use super::rounding::rounded;
use sightline_scene::scene::Ground;

/// Heights of plates are whole multiples of this, metres.
const STEP: f64 = 0.1;
/// Fewest points of a cell that is a thing: single ones are noise.
const LEAST_POINTS: u32 = 2;

/// Points of things at rest, counted by cell.
pub(super) struct Cells<'a> {
    edge: f64,
    classes: &'a [String],
    /// Class that a ground point of each class counts for; `None` is no ground.
    ground_as: Vec<Option<u16>>,
    /// Points and the sum of their heights, by tile and class.
    ground: HashMap<([i32; 2], u16), (u32, f64)>,
    /// Points by cell and class.
    solid: HashMap<(Cell, u16), u32>,
}

/// Shapes of a scene and how many of each.
pub(super) struct Shapes {
    pub shapes: Vec<Value>,
    pub plates: usize,
    pub boxes: usize,
}

impl<'a> Cells<'a> {
    pub(super) fn new(edge: f64, classes: &'a [String]) -> Self {
        let id = |name: &str| classes.iter().position(|class| class == name).map(|id| id as u16);
        // Lane markings lie on the road; a bridge is a body.
        let ground_as = |name: &String| match Ground::of(name)? {
            Ground::Bridge => None,
            _ if name == "road_line" => id("road"),
            _ => id(name),
        };
        let ground_as = classes.iter().map(ground_as).collect();
        Self { edge, classes, ground_as, ground: HashMap::new(), solid: HashMap::new() }
    }

    /// Counts a point; its coordinates are few enough cells from the origin.
    pub(super) fn add(&mut self, point: DVec3, class: u16) {
        let cell = (point / self.edge).floor().to_array().map(|v| v as i32);
        match self.ground_as[usize::from(class)] {
            Some(class) => {
                let (points, height) = self.ground.entry(([cell[0], cell[1]], class)).or_default();
                *points += 1;
                *height += point.z;
            }
            None => *self.solid.entry((cell, class)).or_default() += 1,
        }
    }

    /// Plates of the ground and boxes of the rest, each of its cell's most frequent class.
    pub(super) fn shapes(self) -> Shapes {
        let mut plates: BTreeMap<u16, HashSet<Cell>> = BTreeMap::new();
        let ground =
            self.ground.iter().map(|(&(tile, class), &(n, height))| (tile, class, n, height));
        for (tile, (class, points, height)) in most(ground) {
            let level = (height / f64::from(points) / STEP).round() as i32;
            plates.entry(class).or_default().insert([tile[0], tile[1], level]);
        }
        let mut things: BTreeMap<u16, HashSet<Cell>> = BTreeMap::new();
        for (cell, (class, points, ())) in
            most(self.solid.iter().map(|(&(cell, class), &n)| (cell, class, n, ())))
        {
            if points >= LEAST_POINTS {
                things.entry(class).or_default().insert(cell);
            }
        }
        let metres = |cell: Cell| cell.map(|v| rounded(f64::from(v) * self.edge));
        let mut shapes = Vec::new();
        for (class, cells) in plates {
            shapes.extend(merge(cells, &[1, 0]).into_iter().map(|Block { low, high }| {
                let z = rounded(f64::from(low[2]) * STEP);
                let ([x, y, _], [to_x, to_y, _]) = (metres(low), metres(high));
                json!({ "class": self.classes[usize::from(class)],
                        "plane": { "min": [x, y], "max": [to_x, to_y], "z": z } })
            }));
        }
        let plates = shapes.len();
        for (class, cells) in things {
            shapes.extend(merge(cells, &[2, 1, 0]).into_iter().map(|Block { low, high }| {
                json!({ "class": self.classes[usize::from(class)],
                        "box": { "min": metres(low), "max": metres(high) } })
            }));
        }
        Shapes { plates, boxes: shapes.len() - plates, shapes }
    }
}

/// Majority class of each place (ties: lowest id), with its point count and payload.
fn most<K: Ord, V>(counted: impl Iterator<Item = (K, u16, u32, V)>) -> BTreeMap<K, (u16, u32, V)> {
    let mut best: BTreeMap<K, (u16, u32, V)> = BTreeMap::new();
    for (place, class, points, value) in counted {
        let rank = (points, std::cmp::Reverse(class));
        match best.get(&place) {
            Some(&(other, most, _)) if (most, std::cmp::Reverse(other)) >= rank => {}
            _ => drop(best.insert(place, (class, points, value))),
        }
    }
    best
}
