//! The ray-triangle test of `Ray::intersect` for a chunk of rays at a time, a lane a ray.

use glam::Vec3;

use super::lanes::{CHUNK, CHUNKS, Lanes, PacketHits, least, most};
use crate::bvh::{Hit, Ray, Triangle};

/// Parallel rays by chunk.
pub(super) struct Rays<'a> {
    /// The two axes of the shear, and the one of the largest component.
    pub(super) axes: [usize; 3],
    /// Which side of a box the rays enter first, by axis. That follows from the sign of the direction,
    /// since a distance never falls when the bound that it is taken to moves away, also in rounded
    /// arithmetic.
    pub(super) enters: [usize; 3],
    pub(super) origin: &'a [Lanes; 3],
    /// One of them: all share its direction.
    pub(super) ray: &'a Ray,
}

/// A triangle with its corners in the order of the rays' axes, and its bare box.
#[derive(Clone, Copy)]
pub(super) struct PermutedTriangle {
    pub(super) triangle: Triangle,
    /// Corners in the order of [`Rays::axes`].
    corners: [[f32; 3]; 3],
    /// Lower and upper corner of the bare box.
    sides: [[f32; 3]; 2],
}

impl PermutedTriangle {
    /// Its face is counted from `first_prim` on.
    #[inline(always)]
    pub(super) fn new(triangle: &Triangle, axes: [usize; 3], first_prim: u32) -> Self {
        let &Triangle { ref a, ref b, ref c, prim, .. } = triangle;
        let at = |corner: &[f32; 3]| [corner[axes[0]], corner[axes[1]], corner[axes[2]]];
        let mut sides = [*a; 2];
        for k in 0..3 {
            sides[0][k] = least(least(a[k], b[k]), c[k]);
            sides[1][k] = most(most(a[k], b[k]), c[k]);
        }
        let triangle = Triangle { prim: first_prim + prim, ..*triangle };
        Self { triangle, corners: [at(a), at(b), at(c)], sides }
    }
}

/// Triangles that are tested together, and pairs of them with a chunk: one bit of a `u64` each, the
/// triangles' bits one after the other.
pub(super) const PAIRS: usize = 8 * CHUNKS;
const _: () = assert!(PAIRS == u64::BITS as usize);

/// Lanes whose ray passes between the edges of a triangle: all ones, or zero; of each pair, and where
/// all do.
pub(super) type Inside = [[u32; CHUNK]; PAIRS + 1];
pub(super) const ALL_INSIDE: Inside = [[u32::MAX; CHUNK]; PAIRS + 1];

impl Rays<'_> {
    /// `Ray::intersect` for every ray of the pairs `meets` with up to eight triangles; those of `sure`
    /// are known to pass between the edges. Bits of the chunks in which a ray of another pair does.
    /// `inside` is working memory, of which the last stays all ones.
    #[inline(always)]
    pub(super) fn intersect(
        &self,
        triangles: &[PermutedTriangle],
        pad: f32,
        meets: u64,
        sure: u64,
        inside: &mut Inside,
        hits: &mut PacketHits,
    ) -> u32 {
        let mut hit = meets & sure;
        let mut left = meets & !sure;
        while left != 0 {
            let pair = left.trailing_zeros() as usize % PAIRS;
            left &= left - 1;
            let (slot, chunk) = (pair / CHUNKS, pair % CHUNKS);
            let any = self.inside_edges(&triangles[slot], chunk, &mut inside[pair]);
            hit |= u64::from(any) << pair;
        }
        let mut left = hit;
        while left != 0 {
            let pair = left.trailing_zeros() as usize % PAIRS;
            let (slot, chunk) = (pair / CHUNKS, pair % CHUNKS);
            let inside = &inside[if left & sure & left.wrapping_neg() != 0 { PAIRS } else { pair }];
            left &= left - 1;
            if self.distances(&triangles[slot], chunk, inside, hits) {
                self.retry(&triangles[slot], pad, chunk, inside, hits);
            }
        }
        let hit = hit & !sure;
        let hit = hit | hit >> 32;
        let hit = hit | hit >> 16;
        (hit | hit >> 8) as u32 & ((1 << CHUNKS) - 1)
    }

    /// Marks the lanes whose ray passes between the edges; whether there are any.
    #[inline(always)]
    fn inside_edges(
        &self,
        triangle: &PermutedTriangle,
        chunk: usize,
        inside: &mut [u32; CHUNK],
    ) -> bool {
        let [a, b, c] = triangle.corners;
        let [ox, oy, oz] = [0, 1, 2].map(|k| &self.origin[self.axes[k]][chunk]);
        let mut any = 0;
        let [sx, sy] = self.ray.shear;
        for i in 0..CHUNK {
            let (az, bz, cz) = (a[2] - oz[i], b[2] - oz[i], c[2] - oz[i]);
            let (ax, ay) = ((a[0] - ox[i]) - sx * az, (a[1] - oy[i]) - sy * az);
            let (bx, by) = ((b[0] - ox[i]) - sx * bz, (b[1] - oy[i]) - sy * bz);
            let (cx, cy) = ((c[0] - ox[i]) - sx * cz, (c[1] - oy[i]) - sy * cz);
            let u = cx * by - cy * bx;
            let v = ax * cy - ay * cx;
            let w = bx * ay - by * ax;
            let outside = ((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0));
            let det = u + v + w;
            let passes = if !outside & (det != 0.0) { u32::MAX } else { 0 };
            inside[i] = passes;
            any |= passes;
        }
        any != 0
    }

    /// Takes over the distances of marked lanes where they are best; whether a lane passes beside the
    /// bare box, so that the padded one decides.
    #[inline(always)]
    fn distances(
        &self,
        triangle: &PermutedTriangle,
        chunk: usize,
        inside: &[u32; CHUNK],
        hits: &mut PacketHits,
    ) -> bool {
        let [ox, oy, oz] = [0, 1, 2].map(|axis| &self.origin[axis][chunk]);
        let (best, prim) = (&mut hits.t[chunk], &mut hits.prim[chunk]);
        let Triangle { a, normal: n, prim: id, .. } = triangle.triangle;
        let sides = &triangle.sides;
        let [x, y, z] = self.enters;
        let low = [sides[x][0], sides[y][1], sides[z][2]];
        let high = [sides[1 - x][0], sides[1 - y][1], sides[1 - z][2]];
        let mut any_beside = 0;
        let [dx, dy, dz] = self.ray.direction.to_array();
        let [ix, iy, iz] = self.ray.inverse.to_array();
        for i in 0..CHUNK {
            let (x0, x1) = ((low[0] - ox[i]) * ix, (high[0] - ox[i]) * ix);
            let (y0, y1) = ((low[1] - oy[i]) * iy, (high[1] - oy[i]) * iy);
            let (z0, z1) = ((low[2] - oz[i]) * iz, (high[2] - oz[i]) * iz);
            let enter = most(most(most(x0, y0), z0), 0.0);
            let leave = least(least(x1, y1), z1);
            let towards = n[0] * dx + n[1] * dy + n[2] * dz;
            let above = n[0] * (a[0] - ox[i]) + n[1] * (a[1] - oy[i]) + n[2] * (a[2] - oz[i]);
            let quotient = above / towards;
            let t = least(most(quotient, enter), leave);
            let closer = (t < best[i]) | ((t == best[i]) & (id < prim[i]));
            let ahead =
                (towards != 0.0) & ((quotient > 0.0) | quotient.is_nan()) & (inside[i] != 0);
            let beside = enter > leave;
            let takes = ahead & (t > 0.0) & closer & !beside;
            best[i] = if takes { t } else { best[i] };
            prim[i] = if takes { id } else { prim[i] };
            any_beside |= u32::from(beside & ahead);
        }
        any_beside != 0
    }

    /// Asks `Ray::intersect` itself for the marked lanes that pass beside the bare box.
    #[cold]
    #[inline(never)]
    fn retry(
        &self,
        triangle: &PermutedTriangle,
        pad: f32,
        chunk: usize,
        inside: &[u32; CHUNK],
        hits: &mut PacketHits,
    ) {
        for i in (0..CHUNK).filter(|&i| inside[i] != 0) {
            let mut best = Hit { t: hits.t[chunk][i], prim: hits.prim[chunk][i] };
            let origin = Vec3::from([0, 1, 2].map(|axis| self.origin[axis][chunk][i]));
            let ray = Ray { origin, t_max: best.t, ..*self.ray };
            let [low, high] = triangle.sides;
            let (enter, leave) = ray.slab(low.into(), high.into());
            if enter > leave {
                ray.intersect(&triangle.triangle, pad, 0, &mut best);
                (hits.t[chunk][i], hits.prim[chunk][i]) = (best.t, best.prim);
            }
        }
    }
}
