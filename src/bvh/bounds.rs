//! What holds for all rays of a packet or of a chunk, so that most of a scene is sorted out at once.

use super::build::PAD_SHARE;
use super::packet::{CHUNK, CHUNKS, Packet, least, most};
use super::ranges::{Range, Ranges, fold, middle_of_origins, narrowest_plane};
use super::wide::{Block, WIDTH};

/// Farther than any plane, and finite, so that an empty box stays empty.
const UNBOUNDED: f32 = 1e30;
/// Slack of bounds, in units of 2⁻²⁰ of the largest number that enters a test. An origin moved along
/// its ray, a plane's distance and `Ray::slab`'s own result are each off by a few roundings, that is
/// by a few 2⁻²⁴ of that number: together less than one unit.
pub(crate) const SLACK: f32 = 8.0;

/// What holds for every ray of a packet.
///
/// Origins are moved along their rays into one plane, so that a packet is as narrow as its rays are
/// close, however far apart they start; distances count from that plane.
pub(super) struct Bounds {
    /// Which side of a box is met first, by axis.
    near_side: [usize; 3],
    /// The origin for which the near plane is closest and that for which the far one is farthest.
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    /// Least and largest inverse direction.
    inverse: [[f32; 2]; 3],
    /// The two sheared axes and the one along which the rays go.
    axes: [usize; 3],
    /// The plane's place on the last axis.
    plane: f32,
    all: Spread,
    /// Metres by which everything may be off through rounding.
    slack: f32,
    /// Where the first ray starts, counted from the plane.
    start: f32,
}

/// Where some rays cross the plane and how they are sheared: middle and half of the range, on both axes.
#[derive(Clone, Copy, Default)]
struct Spread {
    middle: [f32; 2],
    half: [f32; 2],
    shear: [f32; 2],
    turn: [f32; 2],
}

/// What holds for every ray of a chunk, for all chunks side by side.
pub(super) struct Chunks {
    middle: [[f32; CHUNKS]; 2],
    half: [[f32; CHUNKS]; 2],
    shear: [[f32; CHUNKS]; 2],
    turn: [[f32; CHUNKS]; 2],
    /// The farthest of the best distances, counted from the plane; −∞ where there are no rays.
    farthest: [f32; CHUNKS],
}

impl Bounds {
    #[inline(always)]
    pub(super) fn new<const PARALLEL: bool>(packet: &Packet, pad: f32) -> (Self, Chunks) {
        let axes = packet.axes();
        let plane = if PARALLEL { middle_of_origins(packet) } else { narrowest_plane(packet) };
        let mut bounds = Self {
            near_side: [0; 3],
            near_origin: [UNBOUNDED; 3],
            far_origin: [-UNBOUNDED; 3],
            inverse: [[1.0; 2]; 3],
            axes,
            plane,
            all: Spread::default(),
            slack: 0.0,
            start: 0.0,
        };
        let Ranges { shift, crossing, shear } =
            if PARALLEL { Ranges::parallel(packet, plane) } else { Ranges::any(packet, plane) };
        let mut crossed = [[plane; 2]; 3];
        let mut chunks = Chunks {
            middle: [[0.0; CHUNKS]; 2],
            half: [[0.0; CHUNKS]; 2],
            shear: [[0.0; CHUNKS]; 2],
            turn: [[0.0; CHUNKS]; 2],
            farthest: [f32::NEG_INFINITY; CHUNKS],
        };
        let [first, last] = shift.all();
        let mut largest = plane.abs() + first.abs().max(last.abs());
        for (k, &axis) in axes[..2].iter().enumerate() {
            crossed[axis] = crossing[k].all();
            largest = largest.max(crossed[axis][0].abs()).max(crossed[axis][1].abs());
            (chunks.middle[k], chunks.half[k]) = crossing[k].middle_and_half();
            bounds.all.shear[k] = packet.shear[k][0][0];
            chunks.shear[k] = [packet.shear[k][0][0]; CHUNKS];
            if !PARALLEL {
                let [low, high] = shear[k].all();
                bounds.all.shear[k] = 0.5 * (low + high);
                bounds.all.turn[k] = 0.5 * (high - low);
                (chunks.shear[k], chunks.turn[k]) = shear[k].middle_and_half();
            }
        }
        bounds.slack = SLACK * (pad + largest * PAD_SHARE);
        bounds.start = -last - bounds.slack;
        for (axis, &[low, high]) in crossed.iter().enumerate() {
            let inverse = if PARALLEL {
                [packet.inverse[axis][0][0]; 2]
            } else {
                Range::of(&packet.inverse[axis][..packet.chunks()]).all()
            };
            if inverse[0] > 0.0 {
                bounds.near_origin[axis] = high + bounds.slack;
                bounds.far_origin[axis] = low - bounds.slack;
                bounds.inverse[axis] = inverse;
            } else if inverse[1] < 0.0 {
                bounds.near_side[axis] = 1;
                bounds.near_origin[axis] = low - bounds.slack;
                bounds.far_origin[axis] = high + bounds.slack;
                bounds.inverse[axis] = inverse;
            }
            // Otherwise some rays go up and some down this axis: it bounds nothing.
        }
        for (k, &axis) in axes[..2].iter().enumerate() {
            let [low, high] = crossed[axis];
            bounds.all.middle[k] = 0.5 * (low + high);
            bounds.all.half[k] = 0.5 * (high - low) + bounds.slack;
            for half in &mut chunks.half[k] {
                *half += bounds.slack;
            }
        }
        for chunk in 0..packet.chunks() {
            chunks.farthest[chunk] = packet.t_max - shift.low[chunk] + bounds.slack;
        }
        (bounds, chunks)
    }

    /// Bounds of where the rays are inside boxes: no ray enters box `i` before `near[i]` or leaves
    /// it after `far[i]`.
    #[inline(always)]
    pub(super) fn slabs<const N: usize>(
        &self,
        planes: &[[[f32; N]; 2]; 3],
    ) -> ([f32; N], [f32; N]) {
        let (mut near, mut far) = ([self.start; N], [f32::INFINITY; N]);
        for axis in 0..3 {
            let enter = &planes[axis][self.near_side[axis]];
            let leave = &planes[axis][1 - self.near_side[axis]];
            let [low, high] = self.inverse[axis];
            for i in 0..N {
                let x = enter[i] - self.near_origin[axis];
                near[i] = most(least(x * low, x * high), near[i]);
                let x = leave[i] - self.far_origin[axis];
                far[i] = least(most(x * low, x * high), far[i]);
            }
        }
        (near, far)
    }

    /// Bits of a block's triangles that rays may hit, up to the distance `farthest`.
    #[inline(always)]
    pub(super) fn meets<const PARALLEL: bool>(&self, block: &Block, farthest: f32) -> u32 {
        let [x, y, z] = self.axes;
        let [a, b, c] = &block.corners;
        let mut meets = [0; WIDTH];
        for i in 0..WIDTH {
            let triangle = [
                [a[x][i], a[y][i], a[z][i]],
                [b[x][i], b[y][i], b[z][i]],
                [c[x][i], c[y][i], c[z][i]],
            ];
            let behind = self.nearest(triangle) > farthest;
            let beside = passes_beside::<PARALLEL>(triangle, self.plane, &self.all, self.slack);
            meets[i] = if behind | beside { 0 } else { u32::MAX };
        }
        to_bits(meets) & ((1 << block.count) - 1)
    }

    /// No ray meets a triangle before this distance, counted from the plane.
    #[inline(always)]
    fn nearest(&self, corners: [[f32; 3]; 3]) -> f32 {
        let [low, high] = self.inverse[self.axes[2]];
        let origin = self.near_origin[self.axes[2]];
        let along = |corner: [f32; 3]| {
            let x = corner[2] - origin;
            least(x * low, x * high)
        };
        least(least(along(corners[0]), along(corners[1])), along(corners[2]))
    }
}

impl Chunks {
    /// The farthest of the best distances of all rays.
    #[inline(always)]
    pub(super) fn farthest(&self) -> f32 {
        fold(&self.farthest, most)
    }

    /// Takes over the best distances of a chunk's rays.
    #[inline(always)]
    pub(super) fn look_again<const PARALLEL: bool>(
        &mut self,
        packet: &Packet,
        chunk: usize,
        bounds: &Bounds,
    ) {
        let origin = &packet.origin[bounds.axes[2]][chunk];
        let inverse = &packet.inverse[bounds.axes[2]];
        let t = &packet.hits.t[chunk];
        let mut farthest = [0.0; CHUNK];
        for i in 0..CHUNK {
            let inverse = if PARALLEL { inverse[0][0] } else { inverse[chunk][i] };
            farthest[i] = t[i] - (bounds.plane - origin[i]) * inverse;
        }
        let mut halves = [0.0; CHUNK / 2];
        for i in 0..CHUNK / 2 {
            halves[i] = most(farthest[i], farthest[i + CHUNK / 2]);
        }
        self.farthest[chunk] = fold(&halves, most) + bounds.slack;
    }

    /// Bits of the chunks whose rays may hit a triangle of a block.
    #[inline(always)]
    pub(super) fn meet<const PARALLEL: bool>(
        &self,
        bounds: &Bounds,
        block: &Block,
        slot: usize,
    ) -> u32 {
        let [x, y, z] = bounds.axes;
        let at = |corner: &[[f32; WIDTH]; 3]| [corner[x][slot], corner[y][slot], corner[z][slot]];
        let [a, b, c] = &block.corners;
        let triangle = [at(a), at(b), at(c)];
        let nearest = bounds.nearest(triangle);
        let mut meets = [0; CHUNKS];
        for i in 0..CHUNKS {
            let at = |both: &[[f32; CHUNKS]; 2]| [both[0][i], both[1][i]];
            let spread = Spread {
                middle: at(&self.middle),
                half: at(&self.half),
                shear: at(&self.shear),
                turn: at(&self.turn),
            };
            let behind = nearest > self.farthest[i];
            let beside = passes_beside::<PARALLEL>(triangle, bounds.plane, &spread, bounds.slack);
            meets[i] = if behind | beside { 0 } else { u32::MAX };
        }
        to_bits(meets)
    }
}

/// Whether all rays surely miss a triangle: beside its corners, or on the outer side of one of its
/// edges.
///
/// Seen along a ray, a corner lies at its coordinates less shear times depth. An edge function is
/// affine in the origin and in the shear but for their product, so its spread over the rays is a
/// sum of absolute values.
#[inline(always)]
fn passes_beside<const PARALLEL: bool>(
    corners: [[f32; 3]; 3],
    plane: f32,
    rays: &Spread,
    slack: f32,
) -> bool {
    let Spread { middle, half, shear, turn } = *rays;
    let seen = |corner: [f32; 3]| {
        let z = corner[2] - plane;
        [corner[0] - middle[0] - shear[0] * z, corner[1] - middle[1] - shear[1] * z, z]
    };
    let (a, b, c) = (seen(corners[0]), seen(corners[1]), seen(corners[2]));
    // Beside the rectangle that the rays fill, at the depth of each corner.
    let mut apart = false;
    for k in 0..2 {
        let reach = |p: [f32; 3]| if PARALLEL { 0.0 } else { turn[k] * p[2].abs() };
        let low = least(least(a[k] - reach(a), b[k] - reach(b)), c[k] - reach(c));
        let high = most(most(a[k] + reach(a), b[k] + reach(b)), c[k] + reach(c));
        apart |= (low > half[k] + slack) | (high < -half[k] - slack);
    }
    let size = |p: [f32; 3]| p[0].abs() + p[1].abs();
    let mut widest = half[0] + half[1];
    if !PARALLEL {
        let deepest = most(most(a[2].abs(), b[2].abs()), c[2].abs());
        widest += deepest * (turn[0] + turn[1]);
    }
    let error = 2.0 * slack * (size(a) + size(b) + size(c) + widest);
    // Value in the middle, spread of the area's share, spread.
    let edge = |from: [f32; 3], to: [f32; 3]| {
        let value = from[0] * to[1] - from[1] * to[0];
        let moved = (to[1] - from[1]).abs() * half[0] + (to[0] - from[0]).abs() * half[1];
        if PARALLEL {
            return (value, 0.0, moved + error);
        }
        let turned = turn[0] * (from[2] * to[1] - to[2] * from[1]).abs()
            + turn[1] * (to[2] * from[0] - from[2] * to[0]).abs();
        let both = (turn[0] * half[1] + turn[1] * half[0]) * (to[2] - from[2]).abs();
        (value, turned, turned + moved + both + error)
    };
    let (u, v, w) = (edge(a, b), edge(b, c), edge(c, a));
    let area = u.0 + v.0 + w.0;
    let doubt = u.1 + v.1 + w.1 + 4.0 * error;
    let left = (u.0 + u.2 < 0.0) | (v.0 + v.2 < 0.0) | (w.0 + w.2 < 0.0);
    let right = (u.0 - u.2 > 0.0) | (v.0 - v.2 > 0.0) | (w.0 - w.2 > 0.0);
    apart | ((area > doubt) & left) | ((area < -doubt) & right)
}

/// A bit for each flag; flags are all ones or zero.
#[inline(always)]
fn to_bits(flags: [u32; 8]) -> u32 {
    let mut bits = [0; 8];
    for i in 0..8 {
        bits[i] = flags[i] & (1 << i);
    }
    for i in 0..4 {
        bits[i] |= bits[i + 4];
    }
    (bits[0] | bits[1]) | (bits[2] | bits[3])
}
