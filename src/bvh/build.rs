//! Building the binary tree by a binned surface-area heuristic.

use glam::Vec3;

use super::bvh8::Bvh8;
use super::bvh16::Bvh16;
use super::{Bvh, MAX_DEPTH, Node, Triangle};
use crate::geom::{Aabb, TriangleSoup};

/// Bins per axis (Wald, "On fast construction of SAH-based bounding volume hierarchies", 2007).
const BINS: usize = 16;
/// A leaf with more triangles than this is split whatever the heuristic says.
const MAX_LEAF: usize = 4;
/// From this depth on ranges are halved by count, so that no input makes a path longer than a stack:
/// 32 levels of heuristic splits and at most 31 of halving.
const HALVING_DEPTH: usize = MAX_DEPTH / 2;
/// Pad as a share of the largest distance that enters a hit test: several times the rounding of
/// `(bound − origin) · inverse`.
pub(crate) const PAD_SHARE: f32 = 1.0 / (1 << 20) as f32;

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    centroid: Vec3,
    triangle: u32,
}

struct Builder<'a> {
    source: &'a [Triangle],
    nodes: Vec<Node>,
    triangles: Vec<Triangle>,
    /// Working memory of a split.
    above: Vec<Item>,
}

impl Bvh {
    /// Builds the tree over a soup whose hits are looked for up to `range` metres away.
    ///
    /// Boxes are padded by 2⁻²⁰ of the largest distance a test can meet, so that rounding never
    /// removes a triangle that the edge tests accept. Coordinates must be finite.
    pub fn build(soup: &TriangleSoup, range: f32) -> Self {
        let largest = soup.vertices.iter().flatten().fold(0.0_f32, |m, &c| m.max(c.abs()));
        let pad = (largest + range) * PAD_SHARE;
        let source: Vec<Triangle> = (0..soup.faces.len() as u32)
            .map(|prim| Triangle::new(soup.corners(prim), prim))
            .collect();
        let mut items: Vec<Item> = source
            .iter()
            .map(|triangle| {
                let bounds = Self::padded_box(triangle, pad);
                Item { bounds, centroid: 0.5 * (bounds.min + bounds.max), triangle: triangle.prim }
            })
            .collect();
        let mut builder = Builder {
            source: &source,
            nodes: Vec::new(),
            triangles: Vec::with_capacity(items.len()),
            above: Vec::new(),
        };
        if !items.is_empty() {
            builder.nodes.push(Node { min: [0.0; 3], first: 0, max: [0.0; 3], count: 0 });
            builder.subdivide(0, &mut items, 1);
        }
        let bvh8 = Bvh8::collapse(&builder.nodes, &builder.triangles);
        let bvh16 = Bvh16::collapse(&builder.nodes, &builder.triangles);
        Self { nodes: builder.nodes, triangles: builder.triangles, pad, bvh8, bvh16 }
    }
}

impl Builder<'_> {
    fn subdivide(&mut self, at: usize, items: &mut [Item], depth: usize) {
        let mut bounds = Aabb::EMPTY;
        for item in items.iter() {
            bounds.merge(&item.bounds);
        }
        let split = if items.len() == 1 {
            None
        } else if depth >= HALVING_DEPTH {
            (items.len() > MAX_LEAF).then_some(items.len() / 2)
        } else {
            best_split(items, &bounds, &mut self.above)
        };
        let Some(middle) = split else {
            let first = self.triangles.len() as u32;
            self.triangles.extend(items.iter().map(|i| self.source[i.triangle as usize]));
            self.nodes[at] = Node {
                min: bounds.min.into(),
                first,
                max: bounds.max.into(),
                count: items.len() as u32,
            };
            return;
        };
        let left = self.nodes.len();
        let empty = Node { min: [0.0; 3], first: 0, max: [0.0; 3], count: 0 };
        self.nodes.extend([empty, empty]);
        self.nodes[at] =
            Node { min: bounds.min.into(), first: left as u32, max: bounds.max.into(), count: 0 };
        let (below, above) = items.split_at_mut(middle);
        self.subdivide(left, below, depth + 1);
        self.subdivide(left + 1, above, depth + 1);
    }
}

/// Reorders `items` and returns where to cut them, or `None` where a leaf is cheaper.
fn best_split(items: &mut [Item], bounds: &Aabb, aside: &mut Vec<Item>) -> Option<usize> {
    let mut centroids = Aabb::EMPTY;
    for item in items.iter() {
        centroids.grow(item.centroid);
    }
    let extent = centroids.max - centroids.min;
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in 0..3 {
        if extent[axis] <= 0.0 {
            continue;
        }
        let mut boxes = [Aabb::EMPTY; BINS];
        let mut counts = [0_usize; BINS];
        for item in items.iter() {
            let bin = bin_of(item, axis, &centroids);
            boxes[bin].merge(&item.bounds);
            counts[bin] += 1;
        }
        let mut above_cost = [0.0_f32; BINS];
        let (mut above, mut count) = (Aabb::EMPTY, 0);
        for bin in (1..BINS).rev() {
            if counts[bin] == 0 {
                above_cost[bin] = above_cost.get(bin + 1).copied().unwrap_or(0.0);
                continue;
            }
            above.merge(&boxes[bin]);
            count += counts[bin];
            above_cost[bin] = above.half_area() * count as f32;
        }
        let (mut below, mut count) = (Aabb::EMPTY, 0);
        // A cut behind an empty bin is the cut before it.
        for bin in (0..BINS - 1).filter(|&bin| counts[bin] > 0) {
            below.merge(&boxes[bin]);
            count += counts[bin];
            let cost = below.half_area() * count as f32 + above_cost[bin + 1];
            if count < items.len() && best.is_none_or(|(c, ..)| cost < c) {
                best = Some((cost, axis, bin));
            }
        }
    }
    let Some((cost, axis, last_below)) = best else {
        // All centroids coincide: no plane separates them.
        return (items.len() > MAX_LEAF).then_some(items.len() / 2);
    };
    let leaf_cost = bounds.half_area() * items.len() as f32;
    if items.len() <= MAX_LEAF && bounds.half_area() + cost >= leaf_cost {
        return None;
    }
    // A stable partition keeps equal input in input order, so that the tree is reproducible.
    aside.clear();
    let mut below = 0;
    for at in 0..items.len() {
        let item = items[at];
        if bin_of(&item, axis, &centroids) <= last_below {
            items[below] = item;
            below += 1;
        } else {
            aside.push(item);
        }
    }
    items[below..].copy_from_slice(aside);
    Some(below)
}

fn bin_of(item: &Item, axis: usize, centroids: &Aabb) -> usize {
    let offset = item.centroid[axis] - centroids.min[axis];
    let share = offset / (centroids.max[axis] - centroids.min[axis]);
    ((share * BINS as f32) as usize).min(BINS - 1)
}
