//! Bounds that hold for all rays of a fan: over all its directions, and in one of them, where the rays
//! are parallel.

use glam::Vec3;

use super::bounds::Bounds;
use super::lanes::{Across, CHUNK, CHUNKS, ChunkRange, FAN_DIRECTIONS, fold, least, most, to_bits};
use crate::bvh::bvh8::{Block, WIDTH};
use crate::bvh::{Ray, Triangle, axes_of, major_axis};

/// Least and largest numbers of the rays of a fan.
pub(super) struct FanRanges {
    /// The two axes of the shear, and the one of the largest component.
    pub(super) axes: [usize; 3],
    /// In the middle of the origins, on the last axis.
    plane: f32,
    /// How far before the plane the origins of each chunk lie.
    before: ChunkRange,
    /// Least and largest of all directions, by axis of the shear and by axis.
    shear: [[f32; 2]; 2],
    inverse: [[f32; 2]; 3],
    /// Where the plane is crossed with the least shear and with the largest, by chunk and by all rays.
    crossing: [[ChunkRange; 2]; 2],
    crossing_of_all: [[[f32; 2]; 2]; 2],
    /// The directions, as rays from nowhere.
    rays: [Ray; FAN_DIRECTIONS],
}

impl FanRanges {
    #[inline(always)]
    pub(super) fn new(across: &[Across; 3], directions: &[Vec3], t_max: f32) -> Self {
        let mut rays = [Ray::new(Vec3::ZERO, directions[0], t_max); FAN_DIRECTIONS];
        let axes = axes_of(major_axis(directions[0]));
        let mut inverse = [[f32::INFINITY, f32::NEG_INFINITY]; 3];
        let mut shear = [[f32::INFINITY, f32::NEG_INFINITY]; 2];
        for (ray, &direction) in rays.iter_mut().zip(directions) {
            *ray = Ray::new(Vec3::ZERO, direction, t_max);
            for ([low, high], x) in inverse.iter_mut().zip(ray.inverse.to_array()) {
                (*low, *high) = (least(x, *low), most(x, *high));
            }
            for ([low, high], x) in shear.iter_mut().zip(ray.shear) {
                (*low, *high) = (least(x, *low), most(x, *high));
            }
        }
        let mut depths = ChunkRange::EMPTY;
        for numbers in &across[axes[2]] {
            depths.grow(numbers);
        }
        let [low, high] = depths.all();
        let plane = 0.5 * (low + high);
        let mut before_all = ChunkRange::EMPTY;
        let mut crossing = [[ChunkRange::EMPTY; 2]; 2];
        let [x, y, z] = axes.map(|axis| &across[axis]);
        for ((x, y), z) in x.iter().zip(y).zip(z) {
            let mut before = [0.0; CHUNKS];
            for chunk in 0..CHUNKS {
                before[chunk] = plane - z[chunk];
            }
            before_all.grow(&before);
            for (k, from) in [x, y].into_iter().enumerate() {
                for (range, shear) in crossing[k].iter_mut().zip(shear[k]) {
                    let mut at = [0.0; CHUNKS];
                    for chunk in 0..CHUNKS {
                        at[chunk] = from[chunk] + shear * before[chunk];
                    }
                    range.grow(&at);
                }
            }
        }
        let crossing_of_all = [0, 1].map(|k: usize| [crossing[k][0].all(), crossing[k][1].all()]);
        let before = before_all;
        Self { axes, plane, before, shear, inverse, crossing, crossing_of_all, rays }
    }

    /// The directions, as rays from nowhere.
    #[inline(always)]
    pub(super) fn rays(&self, directions: usize) -> &[Ray] {
        &self.rays[..directions]
    }

    /// Bounds of all rays in all directions.
    #[inline(always)]
    pub(super) fn bounds(&self, pad: f32) -> Bounds {
        let Self { axes, plane, before, shear, inverse, .. } = self;
        let across = [self.across(0), self.across(1)];
        let ([a, b], [low, high]) = (before.all(), inverse[axes[2]]);
        let ends = [a * low, a * high, b * low, b * high];
        let shift = [
            least(least(ends[0], ends[1]), least(ends[2], ends[3])),
            most(most(ends[0], ends[1]), most(ends[2], ends[3])),
        ];
        Bounds::of_ranges(*axes, *plane, shift, across, *shear, *inverse, pad)
    }

    /// Least and largest place where any ray crosses the plane on an axis of the shear.
    #[inline(always)]
    fn across(&self, k: usize) -> [f32; 2] {
        let [[a, b], [c, d]] = self.crossing_of_all[k];
        [least(a, c), most(b, d)]
    }

    /// Where the rays of each chunk and all rays cross the plane on an axis of the shear, in one
    /// direction.
    ///
    /// With the shear each ray's crossing grows or falls evenly, so the largest of several lies nowhere
    /// above the line between its ends, and the least nowhere below.
    #[inline(always)]
    fn crossing(&self, k: usize, shear: f32) -> (ChunkRange, [f32; 2]) {
        let [first, last] = &self.crossing[k];
        let span = self.shear[k][1] - self.shear[k][0];
        let share = if span > 0.0 { (shear - self.shear[k][0]) / span } else { 0.0 };
        let between = |a: f32, b: f32| a + share * (b - a);
        let mut range = ChunkRange::EMPTY;
        for chunk in 0..CHUNKS {
            range.low[chunk] = between(first.low[chunk], last.low[chunk]);
            range.high[chunk] = between(first.high[chunk], last.high[chunk]);
        }
        let [[a, b], [c, d]] = self.crossing_of_all[k];
        (range, [between(a, c), between(b, d)])
    }
}

/// Bounds of a fan's rays in one direction, of all and of each chunk.
///
/// A ray is known by the place where it crosses the plane, counted from the middle of all places.
pub(super) struct DirectionBounds {
    axes: [usize; 3],
    /// The plane's place on the last axis, and the inverse direction there.
    plane: f32,
    inverse: f32,
    direction: [f32; 3],
    shear: [f32; 2],
    slack: f32,
    /// Middle and half of where all rays cross the plane.
    middle: [f32; 2],
    half: [f32; 2],
    /// The same of each chunk.
    middles: [[f32; CHUNKS]; 2],
    halves: [[f32; CHUNKS]; 2],
    /// Beyond these no ray of a chunk passes.
    low: [[f32; CHUNKS]; 2],
    high: [[f32; CHUNKS]; 2],
    /// How far after the first ray of a chunk the plane lies, at least.
    start: [f32; CHUNKS],
    /// The farthest of the best distances, counted from the plane; −∞ where there are no rays.
    farthest: [f32; CHUNKS],
}

/// A block's triangles projected along one direction onto the plane of [`DirectionBounds`].
pub(super) struct ProjectedBlock {
    /// Least and largest coordinates.
    low: [[f32; WIDTH]; 2],
    high: [[f32; WIDTH]; 2],
    /// Edge functions, positive inside: the value for the middle ray, and the change for a step along
    /// either axis.
    value: [[f32; WIDTH]; 3],
    step: [[[f32; WIDTH]; 2]; 3],
    /// Largest error of an edge function; infinite where the triangle is seen so flat that rounding may
    /// turn it over.
    error: [f32; WIDTH],
    /// No ray meets it before this distance from the plane.
    nearest: [f32; WIDTH],
}

impl ProjectedBlock {
    pub(super) const NOTHING: Self = Self {
        low: [[0.0; WIDTH]; 2],
        high: [[0.0; WIDTH]; 2],
        value: [[0.0; WIDTH]; 3],
        step: [[[0.0; WIDTH]; 2]; 3],
        error: [0.0; WIDTH],
        nearest: [0.0; WIDTH],
    };
}

impl DirectionBounds {
    /// Bounds of the fan in one of its directions; `filled` chunks hold rays.
    #[inline(always)]
    pub(super) fn new(shaft: &Bounds, ranges: &FanRanges, ray: &Ray, filled: usize) -> Self {
        let (slack, inverse) = (shaft.slack, ray.inverse[ray.major]);
        let mut bounds = Self {
            axes: ranges.axes,
            plane: ranges.plane,
            inverse,
            direction: ray.direction.to_array(),
            shear: ray.shear,
            slack,
            middle: [0.0; 2],
            half: [0.0; 2],
            middles: [[0.0; CHUNKS]; 2],
            halves: [[0.0; CHUNKS]; 2],
            low: [[0.0; CHUNKS]; 2],
            high: [[0.0; CHUNKS]; 2],
            start: [0.0; CHUNKS],
            farthest: [f32::NEG_INFINITY; CHUNKS],
        };
        for k in 0..2 {
            let (crossing, [low, high]) = ranges.crossing(k, ray.shear[k]);
            let middle = 0.5 * (low + high);
            bounds.middle[k] = middle;
            bounds.half[k] = 0.5 * (high - low) + slack;
            for i in 0..CHUNKS {
                let (low, high) = (crossing.low[i] - middle, crossing.high[i] - middle);
                bounds.middles[k][i] = 0.5 * (low + high);
                bounds.halves[k][i] = 0.5 * (high - low) + slack;
                bounds.low[k][i] = low - 2.0 * slack;
                bounds.high[k][i] = high + 2.0 * slack;
            }
        }
        let ChunkRange { low, high } = &ranges.before;
        for chunk in 0..filled {
            let start = least(low[chunk] * inverse, high[chunk] * inverse) - slack;
            bounds.start[chunk] = start;
            bounds.farthest[chunk] = ray.t_max - start;
        }
        bounds
    }

    /// The farthest of the best distances of all rays.
    #[inline(always)]
    pub(super) fn farthest(&self) -> f32 {
        fold(&self.farthest, most)
    }

    /// Bits of a block's triangles that rays may hit, up to the distance `farthest`, and how they are
    /// projected.
    ///
    /// An edge function is affine in where a ray crosses the plane, so its spread over the rays is a sum
    /// of absolute values.
    #[inline(always)]
    pub(super) fn project(
        &self,
        block: &Block,
        farthest: f32,
        projected: &mut ProjectedBlock,
    ) -> u32 {
        let [x, y, z] = self.axes;
        let [a, b, c] = &block.corners;
        let back = self.slack * self.inverse.abs();
        let mut meets = [0; WIDTH];
        for i in 0..WIDTH {
            let (az, bz, cz) = (a[z][i] - self.plane, b[z][i] - self.plane, c[z][i] - self.plane);
            let ax = a[x][i] - self.middle[0] - self.shear[0] * az;
            let ay = a[y][i] - self.middle[1] - self.shear[1] * az;
            let bx = b[x][i] - self.middle[0] - self.shear[0] * bz;
            let by = b[y][i] - self.middle[1] - self.shear[1] * bz;
            let cx = c[x][i] - self.middle[0] - self.shear[0] * cz;
            let cy = c[y][i] - self.middle[1] - self.shear[1] * cz;
            let (low_x, high_x) = (least(least(ax, bx), cx), most(most(ax, bx), cx));
            let (low_y, high_y) = (least(least(ay, by), cy), most(most(ay, by), cy));
            let far = (low_x > self.half[0] + self.slack)
                | (high_x < -self.half[0] - self.slack)
                | (low_y > self.half[1] + self.slack)
                | (high_y < -self.half[1] - self.slack);
            let size = (ax.abs() + ay.abs()) + (bx.abs() + by.abs()) + (cx.abs() + cy.abs());
            let error = 2.0 * self.slack * (size + self.half[0] + self.half[1]);
            let (u, v, w) = (ax * by - ay * bx, bx * cy - by * cx, cx * ay - cy * ax);
            let area = u + v + w;
            let error = if area.abs() > 4.0 * error { error } else { f32::INFINITY };
            let side = 1.0_f32.copysign(area);
            let steps = [[ay - by, bx - ax], [by - cy, cx - bx], [cy - ay, ax - cx]];
            let mut beside = far;
            for (k, value) in [u, v, w].into_iter().enumerate() {
                let (value, [along, across]) = (side * value, steps[k]);
                let spread = along.abs() * self.half[0] + across.abs() * self.half[1] + error;
                beside |= value + spread < 0.0;
                projected.value[k][i] = value;
                projected.step[k][0][i] = side * along;
                projected.step[k][1][i] = side * across;
            }
            let nearest =
                least(least(az * self.inverse, bz * self.inverse), cz * self.inverse) - back;
            (projected.low[0][i], projected.high[0][i]) = (low_x, high_x);
            (projected.low[1][i], projected.high[1][i]) = (low_y, high_y);
            (projected.error[i], projected.nearest[i]) = (error, nearest);
            meets[i] = if beside | (nearest > farthest) { 0 } else { u32::MAX };
        }
        to_bits(meets) & ((1 << block.count) - 1)
    }

    /// Bits of the chunks whose rays may hit a projected triangle, and of those whose rays all surely
    /// pass between its edges.
    #[inline(always)]
    pub(super) fn chunks_that_hit(&self, projected: &ProjectedBlock, slot: usize) -> (u32, u32) {
        let (mut meets, mut sure) = ([0; CHUNKS], [0; CHUNKS]);
        let error = projected.error[slot];
        for i in 0..CHUNKS {
            let mut beside = projected.nearest[slot] > self.farthest[i];
            for k in 0..2 {
                beside |= (projected.low[k][slot] > self.high[k][i])
                    | (projected.high[k][slot] < self.low[k][i]);
            }
            let mut inside = true;
            for k in 0..3 {
                let (along, across) = (projected.step[k][0][slot], projected.step[k][1][slot]);
                let value = projected.value[k][slot]
                    + (along * self.middles[0][i] + across * self.middles[1][i]);
                let spread =
                    along.abs() * self.halves[0][i] + across.abs() * self.halves[1][i] + error;
                beside |= value + spread < 0.0;
                inside &= value - spread > 0.0;
            }
            meets[i] = if beside { 0 } else { u32::MAX };
            sure[i] = if inside { u32::MAX } else { 0 };
        }
        (to_bits(meets), to_bits(sure))
    }

    /// Lowers the farthest distance of each chunk of `sure` to that of a triangle which all its rays
    /// hit; bits of `sure` but for the chunks whose rays all have a closer hit already.
    ///
    /// The farthest distance stays an upper bound of the best ones only if no ray's t, as
    /// `Ray::intersect` rounds it, exceeds the plane's exact distance q by more than the margin of
    /// `spread`, 4·slack/|n·d|. Claim: |t − q| ≤ 3·slack/|n·d|, where `slack` bounds the error of a
    /// coordinate, so that of q' by slack/|n·d| and that of a crossing with a side of axis k by
    /// slack/|d_k|. Proof: t = min(max(q', enter), leave), so t ≤ max(q', enter).
    /// - q' ≤ q + slack/|n·d|.
    /// - Last axis: the ray passes inside the triangle, so its exact entry is at most q, and the
    ///   rounded one at most q + slack/|d_z|, where 1/|d_z| ≤ √3 < 2/|n·d|.
    /// - Other axes k: `sure` leaves edge functions above 2·slack·(length of the edge), so the hit P
    ///   lies more than 2·slack from each edge as seen along the ray. Then the triangle has a point
    ///   P' that is seen 2·slack beside P towards the side of the box where the ray enters; it lies
    ///   deeper or less deep by Δz = 2·slack·|n_k·d_z/(n·d)|, so P is at least 2·slack −
    ///   |Δz·d_k/d_z| from that side, and the ray enters at most at q − 2·slack/|d_k| + Δz/|d_z|.
    ///   Rounded, that is at most q − slack/|d_k| + 2·slack·|n_k|/|n·d| ≤ q + 2·slack/|n·d|.
    ///
    /// From below t ≥ min(q', leave), and the same holds for the side where the ray leaves. The fourth
    /// slack covers the rounding in this function.
    #[inline(always)]
    pub(super) fn take_sure_hits(&mut self, triangle: &Triangle, sure: u32) -> u32 {
        let [x, y, z] = self.axes;
        let (n, a, d) = (triangle.normal, triangle.a, self.direction);
        let inverse = 1.0 / (n[x] * d[x] + n[y] * d[y] + n[z] * d[z]);
        let above = n[x] * (a[x] - self.middle[0])
            + n[y] * (a[y] - self.middle[1])
            + n[z] * (a[z] - self.plane);
        let mut late = [0; CHUNKS];
        for (i, late) in late.iter_mut().enumerate() {
            let above = above - (n[x] * self.middles[0][i] + n[y] * self.middles[1][i]);
            let spread =
                n[x].abs() * self.halves[0][i] + n[y].abs() * self.halves[1][i] + 4.0 * self.slack;
            // Not numbers where the rays pass along the plane: then nothing follows.
            let (middle, half) = (above * inverse, spread * inverse.abs());
            let ahead = middle - half + self.start[i] > 0.0;
            let behind = middle - half > self.farthest[i];
            let farthest = least(middle + half, self.farthest[i]);
            let sure = sure & (1 << i) != 0;
            self.farthest[i] = if sure & ahead { farthest } else { self.farthest[i] };
            *late = if behind { u32::MAX } else { 0 };
        }
        sure & !to_bits(late)
    }

    /// Takes over the best distances of a chunk's rays, which start at these places on the last axis.
    #[inline(always)]
    pub(super) fn update_farthest(
        &mut self,
        chunk: usize,
        t: &[f32; CHUNK],
        origin: &[f32; CHUNK],
    ) {
        let mut halves = [f32::NEG_INFINITY; CHUNK / 2];
        for i in 0..CHUNK / 2 {
            let j = i + CHUNK / 2;
            let first = t[i] - (self.plane - origin[i]) * self.inverse;
            let second = t[j] - (self.plane - origin[j]) * self.inverse;
            halves[i] = most(first, second);
        }
        self.farthest[chunk] = fold(&halves, most) + self.slack;
    }
}
