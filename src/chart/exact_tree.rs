//! A tree over triangles with `f64` boxes and an `f64` triangle test.

use glam::DVec3;

use crate::geom::TriangleSoup;

/// Most triangles of a leaf.
const LEAF: usize = 2;
/// Depth from which on ranges are halved by count, so that no input makes the recursion deep.
const HALVING_DEPTH: usize = 40;
/// Metres by which rounding may move the entry or exit of a ray at a box.
const SLACK: f64 = 1e-9;

/// Triangles under a tree by surface area, all in `f64`; shares no code with [`crate::bvh`].
#[derive(Debug, Clone)]
pub(super) struct ExactTree {
    nodes: Vec<NodeF64>,
    triangles: Vec<[DVec3; 3]>,
}

#[derive(Debug, Clone, Copy)]
struct NodeF64 {
    min: DVec3,
    max: DVec3,
    /// Leaf: first triangle. Inner node: right child; the left one is the next node.
    first: u32,
    /// Triangles of a leaf; 0 marks an inner node.
    count: u32,
}

impl ExactTree {
    pub(super) fn build(soup: &TriangleSoup) -> Self {
        let corner = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        let mut triangles: Vec<[DVec3; 3]> =
            (0..soup.faces.len() as u32).map(|prim| soup.corners(prim).map(corner)).collect();
        let mut nodes = Vec::new();
        if !triangles.is_empty() {
            let count = triangles.len();
            split(&mut triangles, [0, count], 0, &mut nodes);
        }
        Self { nodes, triangles }
    }

    /// Metres along the unit `direction` to the closest triangle with 0 < t ≤ `range`.
    pub(super) fn closest(&self, origin: DVec3, direction: DVec3, range: f64) -> Option<f64> {
        let inverse = direction.recip();
        let mut best = None;
        let mut limit = range;
        // Nodes to visit and the ray's entry into them, the nearest last.
        let mut stack = Vec::with_capacity(64);
        let enters = |index: usize, limit: f64| enter(&self.nodes[index], origin, inverse, limit);
        if !self.nodes.is_empty() {
            stack.extend(enters(0, limit).map(|t| (t, 0)));
        }
        while let Some((entered, index)) = stack.pop() {
            if entered > limit + SLACK {
                continue;
            }
            let node = &self.nodes[index];
            let first = node.first as usize;
            if node.count == 0 {
                let children = [index + 1, first].map(|child| (enters(child, limit), child));
                let [near, far] = match children {
                    [(Some(left), _), (Some(right), _)] if right < left => {
                        [children[1], children[0]]
                    }
                    _ => children,
                };
                stack.extend([far, near].into_iter().filter_map(|(t, child)| Some((t?, child))));
                continue;
            }
            for triangle in &self.triangles[first..first + node.count as usize] {
                if let Some(t) = meet(triangle, origin, direction)
                    && t > 0.0
                    && t <= limit
                {
                    limit = t;
                    best = Some(t);
                }
            }
        }
        best
    }

    pub(super) fn triangle_count(&self) -> usize {
        self.triangles.len()
    }

    pub(super) fn bytes(&self) -> u64 {
        (size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice())) as u64
    }
}

/// Appends the tree of `triangles[begin..end]`, which it reorders.
fn split(
    triangles: &mut [[DVec3; 3]],
    [begin, end]: [usize; 2],
    depth: usize,
    nodes: &mut Vec<NodeF64>,
) {
    let part = &mut triangles[begin..end];
    let corners = || part.iter().flatten();
    let min = corners().fold(DVec3::INFINITY, |low, c| low.min(*c));
    let max = corners().fold(DVec3::NEG_INFINITY, |high, c| high.max(*c));
    let own = nodes.len();
    nodes.push(NodeF64 { min, max, first: begin as u32, count: part.len() as u32 });
    if part.len() <= LEAF {
        return;
    }
    let centre = |t: &[DVec3; 3]| t[0] + t[1] + t[2];
    let along = |axis: usize| {
        move |a: &[DVec3; 3], b: &[DVec3; 3]| centre(a)[axis].total_cmp(&centre(b)[axis])
    };
    let mut best = (f64::INFINITY, 0, part.len() / 2);
    for axis in 0..3 {
        part.sort_unstable_by(along(axis));
        let below = areas(part.iter());
        let above = areas(part.iter().rev());
        let middles = if depth < HALVING_DEPTH { 1..part.len() } else { 0..0 };
        for middle in middles {
            let rest = part.len() - middle;
            let cost = below[middle - 1] * middle as f64 + above[rest - 1] * rest as f64;
            if cost < best.0 {
                best = (cost, axis, middle);
            }
        }
    }
    let (_, axis, middle) = best;
    part.sort_unstable_by(along(axis));
    split(triangles, [begin, begin + middle], depth + 1, nodes);
    let right = nodes.len() as u32;
    split(triangles, [begin + middle, end], depth + 1, nodes);
    (nodes[own].first, nodes[own].count) = (right, 0);
}

/// Half the surface of the box around the first triangle, the first two, …, all.
fn areas<'a>(triangles: impl Iterator<Item = &'a [DVec3; 3]>) -> Vec<f64> {
    let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let grown = triangles.map(|corners| {
        for corner in corners {
            (min, max) = (min.min(*corner), max.max(*corner));
        }
        let edge = max - min;
        edge.dot(DVec3::new(edge.y, edge.z, edge.x))
    });
    grown.collect()
}

/// Entry of the ray into the box, if it is somewhere in 0 ≤ t ≤ `limit`; rounding and 0 · ∞ only add visits.
fn enter(node: &NodeF64, origin: DVec3, inverse: DVec3, limit: f64) -> Option<f64> {
    let (mut enter, mut leave) = (0.0_f64, limit);
    for axis in 0..3 {
        let a = (node.min[axis] - origin[axis]) * inverse[axis];
        let b = (node.max[axis] - origin[axis]) * inverse[axis];
        // 0 · ∞ is no bound: a ray within a face's plane is not turned away. Comparisons take half the time of
        // `f64::max` and `min`.
        let (near, far) = if a > b { (b, a) } else { (a, b) };
        enter = if near > enter { near } else { enter };
        leave = if far < leave { far } else { leave };
    }
    (enter <= leave + SLACK).then_some(enter)
}

/// Metres to the triangle if the ray's line meets it (Möller, Trumbore 1997).
fn meet([a, b, c]: &[DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (e1, e2) = (*b - *a, *c - *a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - *a;
    let u = s.dot(p) / det;
    if !(0.0..=1.0).contains(&u) {
        return None;
    }
    let q = s.cross(e1);
    let v = direction.dot(q) / det;
    (v >= 0.0 && u + v <= 1.0).then(|| e2.dot(q) / det)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn the_tree_finds_what_all_triangles_give() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut soup = TriangleSoup::default();
        for face in 0..500_u32 {
            let centre = [0; 3].map(|_| rng.random_range(-10.0_f32..10.0));
            for _ in 0..3 {
                soup.vertices.push(centre.map(|c| c + rng.random_range(-1.0_f32..1.0)));
            }
            soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
            soup.face_class.push(0);
        }
        let tree = ExactTree::build(&soup);
        let mut hits = 0;
        for _ in 0..2000 {
            let mut vector = || DVec3::from([0; 3].map(|_| rng.random_range(-1.0..1.0)));
            let (origin, direction) = (vector() * 5.0, vector().normalize());
            let all = tree.triangles.iter().filter_map(|t| meet(t, origin, direction));
            let want = all.filter(|t| *t > 0.0 && *t <= 12.0).min_by(f64::total_cmp);
            assert_eq!(tree.closest(origin, direction, 12.0), want);
            hits += usize::from(want.is_some());
        }
        assert!(hits > 200, "only {hits} hits");
        assert_eq!(
            ExactTree::build(&TriangleSoup::default()).closest(DVec3::ZERO, DVec3::X, 1.0),
            None
        );
    }
    #[test]
    fn a_ray_in_the_plane_of_a_box_face_meets_what_ends_there() {
        let vertices = vec![[5.0, 0.0, 0.0], [5.0, 1.0, 0.0], [5.0, 0.0, 1.0]];
        let soup = TriangleSoup { vertices, faces: vec![[0, 1, 2]], face_class: vec![0] };
        let tree = ExactTree::build(&soup);
        let hit = |y: f64| tree.closest(DVec3::new(0.0, y, 0.5), DVec3::X, 9.0);
        assert_eq!([-0.1, 0.0, 0.1].map(hit), [None, Some(5.0), Some(5.0)]);
    }
}
