//! Build of the binary tree, and its nodes.

use std::sync::OnceLock;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use rayon::prelude::*;

use super::bvh8::Bvh8;
use super::bvh16::{Bvh16, WIDTH};
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
/// Fewest triangles of a subtree that is worth a parallel task.
const TASK: usize = 1 << 13;

#[derive(Clone, Copy)]
struct Item {
    bounds: Aabb,
    triangle: u32,
}

impl Item {
    /// Twice the middle of the box: the factor changes no bin.
    fn centroid(&self) -> Vec3 {
        self.bounds.min + self.bounds.max
    }
}

/// Bounds of a range of triangles and of their centres.
#[derive(Clone, Copy)]
struct CentroidBounds {
    bounds: Aabb,
    centroids: Aabb,
}

impl CentroidBounds {
    const EMPTY: Self = Self { bounds: Aabb::EMPTY, centroids: Aabb::EMPTY };

    fn of(items: &[Item]) -> Self {
        let part = |items: &[Item]| {
            let mut extent = Self::EMPTY;
            for item in items {
                extent.bounds.merge(&item.bounds);
                extent.centroids.grow(item.centroid());
            }
            extent
        };
        if items.len() < TASK {
            return part(items);
        }
        // Least and largest are the same in any order.
        items.par_chunks(TASK).map(part).reduce(
            || Self::EMPTY,
            |mut a, b| {
                a.bounds.merge(&b.bounds);
                a.centroids.merge(&b.centroids);
                a
            },
        )
    }

    fn node(&self, first: usize, count: usize) -> BvhNode {
        let Aabb { min, max } = self.bounds;
        BvhNode { min: min.into(), first: first as u32, max: max.into(), count: count as u32 }
    }
}

impl Bvh {
    /// Builds the tree over a soup whose hits are looked for up to `range` metres away.
    ///
    /// Boxes are padded by 2⁻²⁰ of the largest distance a test can meet, so that rounding never
    /// removes a triangle that the edge tests accept. Coordinates must be finite.
    pub fn build(soup: &TriangleSoup, range: f32) -> Self {
        let largest = soup.vertices.iter().flatten().fold(0.0_f32, |m, &c| m.max(c.abs()));
        let pad = (largest + range) * PAD_SHARE;
        let mut items = vec![Item { bounds: Aabb::EMPTY, triangle: 0 }; soup.faces.len()];
        items.par_iter_mut().enumerate().with_min_len(TASK).for_each(|(prim, item)| {
            let mut bounds = Aabb::EMPTY;
            soup.corners(prim as u32).into_iter().for_each(|corner| bounds.grow(corner.into()));
            bounds = Aabb { min: bounds.min - pad, max: bounds.max + pad };
            *item = Item { bounds, triangle: prim as u32 };
        });
        let mut aside = items.clone();
        let nodes = if items.is_empty() {
            Vec::new()
        } else {
            let extent = CentroidBounds::of(&items);
            subtree(&mut items, &mut aside, 0, extent, 1)
        };
        drop(aside);
        let triangles: Vec<Triangle> = items
            .par_iter()
            .with_min_len(TASK)
            .map(|item| Triangle::new(soup.corners(item.triangle), item.triangle))
            .collect();
        drop(items);
        let bvh16 = Bvh16::collapse(&nodes, &triangles);
        Self { nodes, triangles, pad, bvh16, bvh8: OnceLock::new() }
    }

    /// The padded box of a triangle, which its leaf and all nodes above contain.
    pub(crate) fn padded_box(triangle: &Triangle, pad: f32) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for corner in [triangle.a, triangle.b, triangle.c] {
            bounds.grow(corner.into());
        }
        Aabb { min: bounds.min - pad, max: bounds.max + pad }
    }

    /// The padded box of all triangles; none where there are none.
    pub fn bounds(&self) -> Option<Aabb> {
        self.nodes.first().map(|root| Aabb { min: root.min.into(), max: root.max.into() })
    }

    /// The tree that single rays go down.
    pub(crate) fn bvh8(&self) -> &Bvh8 {
        self.bvh8.get_or_init(|| Bvh8::collapse(&self.nodes, &self.triangles))
    }

    /// Bytes of the triangles, the binary and the wide trees.
    pub fn bytes(&self) -> u64 {
        let own = size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice());
        own as u64 + self.bvh16.bytes() + self.bvh8.get().map_or(0, Bvh8::bytes)
    }

    /// Checks that every triangle is in one leaf, boxes nest exactly, and no path is too deep.
    ///
    /// # Errors
    /// The first violation found, as a sentence.
    pub fn validate(&self) -> Result<(), String> {
        let outside = |node: usize| format!("node {node} points outside the tree");
        let mut times = vec![0_u32; self.triangles.len()];
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![(0_usize, 1_usize)] };
        while let Some((index, depth)) = stack.pop() {
            let node = self.nodes.get(index).ok_or_else(|| outside(index))?;
            if depth > MAX_DEPTH {
                return Err(format!(
                    "node {index} lies {depth} deep, traversal stacks hold {MAX_DEPTH}"
                ));
            }
            let outer = Aabb { min: node.min.into(), max: node.max.into() };
            let mut inner = Aabb::EMPTY;
            if node.count > 0 {
                let range = node.first as usize..node.first as usize + node.count as usize;
                let leaf = self.triangles.get(range).ok_or_else(|| outside(index))?;
                for triangle in leaf {
                    inner.merge(&Self::padded_box(triangle, self.pad));
                    let slot =
                        times.get_mut(triangle.prim as usize).ok_or_else(|| outside(index))?;
                    *slot += 1;
                }
            } else {
                for child in [node.first as usize, node.first as usize + 1] {
                    let below = self.nodes.get(child).ok_or_else(|| outside(index))?;
                    inner.merge(&Aabb { min: below.min.into(), max: below.max.into() });
                    stack.push((child, depth + 1));
                }
            }
            if inner.min.cmplt(outer.min).any() || inner.max.cmpgt(outer.max).any() {
                return Err(format!("the box of node {index} does not hold its children"));
            }
        }
        match times.iter().position(|&t| t != 1) {
            Some(prim) => Err(format!("triangle {prim} is in {} leaves, not in one", times[prim])),
            None => Ok(()),
        }
    }
}

/// The tree over `items`, which lie from `first` on in leaf order: its root first, siblings adjacent,
/// children after their parents. `aside` is working memory of the same length.
fn subtree(
    items: &mut [Item],
    aside: &mut [Item],
    first: usize,
    extent: CentroidBounds,
    depth: usize,
) -> Vec<BvhNode> {
    if items.len() < TASK {
        let mut nodes = vec![extent.node(0, 0)];
        subdivide(&mut nodes, 0, items, aside, first, extent, depth);
        return nodes;
    }
    let Some(middle) = split(items, aside, &extent, depth) else {
        return vec![extent.node(first, items.len())];
    };
    let (below, above) = items.split_at_mut(middle);
    let (aside_below, aside_above) = aside.split_at_mut(middle);
    let (below, above) = rayon::join(
        || {
            let extent = CentroidBounds::of(below);
            subtree(below, aside_below, first, extent, depth + 1)
        },
        || {
            let extent = CentroidBounds::of(above);
            subtree(above, aside_above, first + middle, extent, depth + 1)
        },
    );
    joined(extent, &below, &above)
}

/// A root over two trees: root, their roots, all else of the one, all else of the other.
fn joined(extent: CentroidBounds, below: &[BvhNode], above: &[BvhNode]) -> Vec<BvhNode> {
    let mut nodes = Vec::with_capacity(1 + below.len() + above.len());
    nodes.push(extent.node(1, 0));
    let moved = |by: usize| {
        move |node: &BvhNode| {
            let by = if node.count == 0 { by as u32 } else { 0 };
            BvhNode { first: node.first + by, ..*node }
        }
    };
    // Node i ≥ 1 of a tree comes to 2 + i, or behind the rest of the other.
    let (to_below, to_above) = (moved(2), moved(1 + below.len()));
    nodes.push(to_below(&below[0]));
    nodes.push(to_above(&above[0]));
    nodes.extend(below[1..].iter().map(to_below));
    nodes.extend(above[1..].iter().map(to_above));
    nodes
}

/// Makes node `at` the root of the tree over `items`.
fn subdivide(
    nodes: &mut Vec<BvhNode>,
    at: usize,
    items: &mut [Item],
    aside: &mut [Item],
    first: usize,
    extent: CentroidBounds,
    depth: usize,
) {
    let Some(middle) = split(items, aside, &extent, depth) else {
        nodes[at] = extent.node(first, items.len());
        return;
    };
    let left = nodes.len();
    nodes[at] = extent.node(left, 0);
    nodes.extend([nodes[at]; 2]);
    let (below, above) = items.split_at_mut(middle);
    let of_below = CentroidBounds::of(below);
    subdivide(nodes, left, below, aside, first, of_below, depth + 1);
    let of_above = CentroidBounds::of(above);
    subdivide(nodes, left + 1, above, aside, first + middle, of_above, depth + 1);
}

/// Reorders `items` and returns where to cut them; `None` for a leaf.
fn split(
    items: &mut [Item],
    aside: &mut [Item],
    extent: &CentroidBounds,
    depth: usize,
) -> Option<usize> {
    if items.len() == 1 {
        None
    } else if depth >= HALVING_DEPTH {
        (items.len() > MAX_LEAF).then_some(items.len() / 2)
    } else {
        best_split(items, aside, extent)
    }
}

/// Boxes and counts of the triangles in each bin, by axis.
type Bins = [[(Aabb, usize); BINS]; 3];

fn bins_of(items: &[Item], centroids: &Aabb) -> Bins {
    let part = |items: &[Item]| {
        let mut bins: Bins = [[(Aabb::EMPTY, 0); BINS]; 3];
        for item in items {
            for (axis, bins) in bins.iter_mut().enumerate() {
                let (bounds, count) = &mut bins[bin_of(item, axis, centroids)];
                bounds.merge(&item.bounds);
                *count += 1;
            }
        }
        bins
    };
    if items.len() < TASK {
        return part(items);
    }
    items.par_chunks(TASK).map(part).reduce(
        || [[(Aabb::EMPTY, 0); BINS]; 3],
        |mut a, b| {
            for (a, b) in a.as_flattened_mut().iter_mut().zip(b.as_flattened()) {
                a.0.merge(&b.0);
                a.1 += b.1;
            }
            a
        },
    )
}

/// Reorders `items` and returns where to cut them, or `None` where a leaf is cheaper.
fn best_split(items: &mut [Item], aside: &mut [Item], extent: &CentroidBounds) -> Option<usize> {
    let CentroidBounds { bounds, centroids } = extent;
    let spread = centroids.max - centroids.min;
    let bins = bins_of(items, centroids);
    let mut best: Option<(f32, usize, usize)> = None;
    for axis in (0..3).filter(|&axis| spread[axis] > 0.0) {
        let bins = &bins[axis];
        let mut above_cost = [0.0_f32; BINS];
        let (mut above, mut count) = (Aabb::EMPTY, 0);
        for bin in (1..BINS).rev() {
            if bins[bin].1 == 0 {
                above_cost[bin] = above_cost.get(bin + 1).copied().unwrap_or(0.0);
                continue;
            }
            above.merge(&bins[bin].0);
            count += bins[bin].1;
            above_cost[bin] = above.half_area() * weight(count, items.len());
        }
        let (mut below, mut count) = (Aabb::EMPTY, 0);
        // A cut behind an empty bin is the cut before it.
        for bin in (0..BINS - 1).filter(|&bin| bins[bin].1 > 0) {
            below.merge(&bins[bin].0);
            count += bins[bin].1;
            let cost = below.half_area() * weight(count, items.len()) + above_cost[bin + 1];
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
    let (mut below, mut above) = (0, 0);
    for at in 0..items.len() {
        let item = items[at];
        if bin_of(&item, axis, centroids) <= last_below {
            items[below] = item;
            below += 1;
        } else {
            aside[above] = item;
            above += 1;
        }
    }
    items[below..].copy_from_slice(&aside[..above]);
    Some(below)
}

/// Cost weight of a child with `count` of its parent's `all` triangles: `count`, in whole blocks if `all` exceeds one.
///
/// The walk sees a block's sixteen triangles at once, however many there are. Halves are therefore counted in whole
/// blocks as long as there is more than one. Blocks become fuller: 13 of 16 triangles in place of 11, and a fifth
/// fewer blocks.
fn weight(count: usize, all: usize) -> f32 {
    let counted = if all > WIDTH { count.next_multiple_of(WIDTH) } else { count };
    counted as f32
}

fn bin_of(item: &Item, axis: usize, centroids: &Aabb) -> usize {
    let offset = item.centroid()[axis] - centroids.min[axis];
    let share = offset / (centroids.max[axis] - centroids.min[axis]);
    // Not a number where the axis has no extent.
    ((share * BINS as f32) as usize).min(BINS - 1)
}

/// Triangles of one rigid thing under a flat binary tree; node 0 is the root.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Nodes, siblings adjacent; empty when there are no triangles.
    pub nodes: Vec<BvhNode>,
    /// Triangles in leaf order.
    pub triangles: Vec<Triangle>,
    /// Metres by which each triangle's box is grown; see [`Bvh::build`].
    pub pad: f32,
    /// The triangles again in a tree of sixteen-wide nodes, for packets of beams.
    pub(crate) bvh16: Bvh16,
    /// The triangles in a tree of eight-wide nodes, for single rays; made when the first one comes.
    bvh8: OnceLock<Bvh8>,
}

/// Most nodes on a path from the root to a leaf; traversal stacks hold this many entries.
pub const MAX_DEPTH: usize = 64;

/// One node, 32 bytes: two to a cache line, so that a pair of siblings is one fetch.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BvhNode {
    /// Lower corner of the padded box.
    pub min: [f32; 3],
    /// Leaf: first triangle. Inner node: left child; the right child is the next node.
    pub first: u32,
    /// Upper corner of the padded box.
    pub max: [f32; 3],
    /// Triangles of a leaf; 0 marks an inner node.
    pub count: u32,
}

/// One triangle in leaf order, 64 bytes; corners as read, so that neighbours share exact edges.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// First corner.
    pub a: [f32; 3],
    /// Index of the face in the soup.
    pub prim: u32,
    /// Second corner.
    pub b: [f32; 3],
    /// Zero.
    pub pad0: u32,
    /// Third corner.
    pub c: [f32; 3],
    /// Zero.
    pub pad1: u32,
    /// Unit normal, computed in `f64` and rounded once; zero where the triangle has no area.
    pub normal: [f32; 3],
    /// Zero.
    pub pad2: u32,
}

impl Triangle {
    /// A triangle from its corners in metres and its index in the soup.
    pub(crate) fn new([a, b, c]: [[f32; 3]; 3], prim: u32) -> Self {
        let corner = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let normal = (corner(b) - corner(a)).cross(corner(c) - corner(a)).normalize_or_zero();
        let normal = normal.as_vec3().to_array();
        Self { a, prim, b, pad0: 0, c, pad1: 0, normal, pad2: 0 }
    }
}
