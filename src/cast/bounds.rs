//! Bounds that hold for all rays of a fan, so that most of a scene is skipped at once.

use super::lanes::{least, most, to_bits};
use crate::bvh::PAD_SHARE;
use crate::bvh::bvh8::{Block, WIDTH};

/// Farther than any plane, and finite, so that an empty box stays empty.
const UNBOUNDED: f32 = 1e30;
/// Slack of bounds, in units of 2⁻²⁰ of the largest number that enters a test. An origin moved along
/// its ray, a plane's distance and `Ray::slab`'s own result are each off by a few roundings, that is
/// by a few 2⁻²⁴ of that number: together less than one unit.
pub(crate) const SLACK: f32 = 8.0;

/// Bounds of every ray of a fan.
///
/// Origins are moved along their rays into one plane, so that a fan is as narrow as its rays are
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
    pub(super) axes: [usize; 3],
    /// The plane's place on the last axis.
    pub(super) plane: f32,
    all: Spread,
    /// Largest error of a coordinate or distance through rounding, in metres; see [`SLACK`].
    pub(super) slack: f32,
    /// Where the first ray starts, counted from the plane.
    start: f32,
}

/// Crossings of the plane and shears of some rays: middle and half width of their ranges, on both axes.
#[derive(Clone, Copy, Default)]
struct Spread {
    middle: [f32; 2],
    half: [f32; 2],
    shear: [f32; 2],
    turn: [f32; 2],
}

impl Bounds {
    /// From least and largest: how far before the plane rays start, where they cross it, and how they
    /// go.
    #[inline(always)]
    pub(super) fn of_ranges(
        axes: [usize; 3],
        plane: f32,
        [first, last]: [f32; 2],
        across: [[f32; 2]; 2],
        shear: [[f32; 2]; 2],
        inverse: [[f32; 2]; 3],
        pad: f32,
    ) -> Self {
        let mut crossed = [[plane; 2]; 3];
        let mut largest = plane.abs() + first.abs().max(last.abs());
        for (&axis, [low, high]) in axes.iter().zip(across) {
            crossed[axis] = [low, high];
            largest = largest.max(low.abs()).max(high.abs());
        }
        let slack = SLACK * (pad + largest * PAD_SHARE);
        let mut bounds = Self {
            near_side: [0; 3],
            near_origin: [UNBOUNDED; 3],
            far_origin: [-UNBOUNDED; 3],
            inverse: [[1.0; 2]; 3],
            axes,
            plane,
            all: Spread::default(),
            slack,
            start: -last - slack,
        };
        for k in 0..2 {
            bounds.all.spread(k, across[k], shear[k], slack);
        }
        for (axis, &[low, high]) in crossed.iter().enumerate() {
            if inverse[axis][0] > 0.0 {
                bounds.near_origin[axis] = high + slack;
                bounds.far_origin[axis] = low - slack;
                bounds.inverse[axis] = inverse[axis];
            } else if inverse[axis][1] < 0.0 {
                bounds.near_side[axis] = 1;
                bounds.near_origin[axis] = low - slack;
                bounds.far_origin[axis] = high + slack;
                bounds.inverse[axis] = inverse[axis];
            }
            // Otherwise some rays go up and some down this axis: it bounds nothing.
        }
        bounds
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
    pub(super) fn meets(&self, block: &Block, farthest: f32) -> u32 {
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
            let beside = all_miss(triangle, self.plane, &self.all, self.slack);
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

impl Spread {
    #[inline(always)]
    fn spread(&mut self, k: usize, crossing: [f32; 2], shear: [f32; 2], slack: f32) {
        self.middle[k] = 0.5 * (crossing[0] + crossing[1]);
        self.half[k] = 0.5 * (crossing[1] - crossing[0]) + slack;
        self.shear[k] = 0.5 * (shear[0] + shear[1]);
        self.turn[k] = 0.5 * (shear[1] - shear[0]);
    }
}

/// Whether all rays surely miss a triangle: beside its corners, or on the outer side of one of its
/// edges.
///
/// Seen along a ray, a corner lies at its coordinates less shear times depth. An edge function is
/// affine in the origin and in the shear but for their product, so its spread over the rays is a
/// sum of absolute values.
#[inline(always)]
fn all_miss(corners: [[f32; 3]; 3], plane: f32, rays: &Spread, slack: f32) -> bool {
    let Spread { middle, half, shear, turn } = *rays;
    let seen = |corner: [f32; 3]| {
        let z = corner[2] - plane;
        [corner[0] - middle[0] - shear[0] * z, corner[1] - middle[1] - shear[1] * z, z]
    };
    let (a, b, c) = (seen(corners[0]), seen(corners[1]), seen(corners[2]));
    // Beside the rectangle that the rays fill, at the depth of each corner.
    let mut apart = false;
    for k in 0..2 {
        let reach = |p: [f32; 3]| turn[k] * p[2].abs();
        let low = least(least(a[k] - reach(a), b[k] - reach(b)), c[k] - reach(c));
        let high = most(most(a[k] + reach(a), b[k] + reach(b)), c[k] + reach(c));
        apart |= (low > half[k] + slack) | (high < -half[k] - slack);
    }
    let size = |p: [f32; 3]| p[0].abs() + p[1].abs();
    let deepest = most(most(a[2].abs(), b[2].abs()), c[2].abs());
    let widest = half[0] + half[1] + deepest * (turn[0] + turn[1]);
    let error = 2.0 * slack * (size(a) + size(b) + size(c) + widest);
    // Value in the middle, spread of the area's share, spread.
    let edge = |from: [f32; 3], to: [f32; 3]| {
        let value = from[0] * to[1] - from[1] * to[0];
        let moved = (to[1] - from[1]).abs() * half[0] + (to[0] - from[0]).abs() * half[1];
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
