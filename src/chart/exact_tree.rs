//! Closest triangles by `f64` tests, down the boxes of a backend's tree.

use glam::DVec3;

use crate::bvh::{Bvh, BvhNode, Triangle};
use crate::geom::TriangleSoup;

/// Metres by which rounding may move the entry or exit of a ray at a box.
const SLACK: f64 = 1e-9;

/// Triangles under the boxes of a [`Bvh`], which hold them exactly; the way down and both tests are in `f64` and share
/// no code with [`crate::cast`].
#[derive(Debug, Clone)]
pub(super) struct ExactTree(Bvh);

impl ExactTree {
    pub(super) fn build(soup: &TriangleSoup) -> Self {
        Self(Bvh::build(soup, 0.0))
    }

    /// Metres along the unit `direction` to the closest triangle with 0 < t ≤ `range`.
    pub(super) fn closest(&self, origin: DVec3, direction: DVec3, range: f64) -> Option<f64> {
        let Self(Bvh { nodes, triangles, .. }) = self;
        let inverse = direction.recip();
        let (mut best, mut limit) = (None, range);
        let enters = |index: usize, limit: f64| {
            let entered = enter(nodes.get(index)?, origin, inverse, limit)?;
            Some((entered, index))
        };
        // Nodes to visit and the ray's entry into them, the nearest last.
        let mut stack = Vec::with_capacity(64);
        stack.extend(enters(0, limit));
        while let Some((entered, index)) = stack.pop() {
            if entered > limit + SLACK {
                continue;
            }
            let (first, count) = (nodes[index].first as usize, nodes[index].count as usize);
            if count == 0 {
                let [left, right] = [first, first + 1].map(|child| enters(child, limit));
                let is_right_near = matches!((left, right), (Some(l), Some(r)) if r.0 < l.0);
                let order = if is_right_near { [left, right] } else { [right, left] };
                stack.extend(order.into_iter().flatten());
                continue;
            }
            for triangle in &triangles[first..first + count] {
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
        self.0.triangles.len()
    }

    pub(super) fn bytes(&self) -> u64 {
        self.0.bytes()
    }
}

/// Entry of the ray into the box, if it is somewhere in 0 ≤ t ≤ `limit`; rounding and 0 · ∞ only add visits.
fn enter(node: &BvhNode, origin: DVec3, inverse: DVec3, limit: f64) -> Option<f64> {
    let (mut enter, mut leave) = (0.0_f64, limit);
    for axis in 0..3 {
        let a = (f64::from(node.min[axis]) - origin[axis]) * inverse[axis];
        let b = (f64::from(node.max[axis]) - origin[axis]) * inverse[axis];
        // 0 · ∞ is no bound: a ray within a face's plane is not turned away. Comparisons take half the time of
        // `f64::max` and `min`.
        let (near, far) = if a > b { (b, a) } else { (a, b) };
        enter = if near > enter { near } else { enter };
        leave = if far < leave { far } else { leave };
    }
    (enter <= leave + SLACK).then_some(enter)
}

/// Metres to the triangle if the ray's line meets it (Möller, Trumbore 1997).
fn meet(triangle: &Triangle, origin: DVec3, direction: DVec3) -> Option<f64> {
    let [a, b, c] = [triangle.a, triangle.b, triangle.c].map(|v| DVec3::from(v.map(f64::from)));
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    if det == 0.0 {
        return None;
    }
    let s = origin - a;
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
            let all = tree.0.triangles.iter().filter_map(|t| meet(t, origin, direction));
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
