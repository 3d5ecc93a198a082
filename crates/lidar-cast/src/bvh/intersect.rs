//! Rays and hits: the ray-box and the ray-triangle test that decide every bit.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::Triangle;

/// Triangle id of a ray that hits nothing.
pub const NO_HIT: u32 = u32::MAX;

/// Triangle id of a beam that ends somewhere without a hit: nothing of it comes back.
const ENDED: u32 = NO_HIT - 1;

/// Stands for 1/0: larger than any quotient a scene can give, and still finite when multiplied by a
/// distance, because shaders may assume that no infinity occurs.
pub(crate) const FAR_INVERSE: f32 = 1e20;

/// Closest hit of a ray.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Hit {
    /// Metres along the unit direction; the ray's `t_max` when nothing was hit.
    pub t: f32,
    /// Face index in the frame, or [`NO_HIT`].
    pub prim: u32,
}

impl Hit {
    /// Nothing within `t_max` metres.
    pub fn none(t_max: f32) -> Self {
        Self { t: t_max, prim: NO_HIT }
    }

    /// A beam that does not return; its known part ends after `t` metres.
    pub fn ended(t: f32) -> Self {
        Self { t, prim: ENDED }
    }

    /// True if a triangle was hit.
    pub fn is_hit(&self) -> bool {
        self.prim < ENDED
    }
}

/// Origin and unit direction with all that is computed once a ray.
///
/// Hits count for 0 < t ≤ `t_max`: a ray that starts exactly on a triangle does not hit it.
#[derive(Debug, Clone, Copy)]
pub struct Ray {
    /// Origin in metres.
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
    /// Farthest hit that counts, in metres.
    pub t_max: f32,
    /// 1 / direction by component, `FAR_INVERSE` for a component of 0.
    pub inverse: Vec3,
    /// Axis of the largest component; the other two follow cyclically, swapped for a negative one.
    pub major: usize,
    /// x and y over z, in the permuted axes.
    pub shear: [f32; 2],
}

impl Ray {
    /// Prepares a ray; `direction` is of unit length.
    #[inline]
    pub fn new(origin: Vec3, direction: Vec3, t_max: f32) -> Self {
        let major = major_axis(direction);
        let d = permute(direction, major);
        let inverse = Vec3::new(
            safe_inverse(direction.x),
            safe_inverse(direction.y),
            safe_inverse(direction.z),
        );
        Self { origin, direction, t_max, inverse, major, shear: [d.x / d.z, d.y / d.z] }
    }

    /// Where the ray is inside a box, clipped to t ≥ 0: (enter, leave), empty when enter > leave.
    pub(crate) fn slab(&self, min: Vec3, max: Vec3) -> (f32, f32) {
        let t0 = (min - self.origin) * self.inverse;
        let t1 = (max - self.origin) * self.inverse;
        let near = t0.min(t1);
        let far = t0.max(t1);
        (near.x.max(near.y).max(near.z).max(0.0), far.x.min(far.y).min(far.z))
    }

    /// Replaces `best` if the triangle is hit closer, or equally close with a lower id; the triangles of
    /// the tree are numbered from `first_prim` on.
    ///
    /// Woop, Benthin, Wald: "Watertight ray/triangle intersection", JCGT 2013: the edge function of
    /// a shared edge is the same number for both neighbours but for its sign, so no ray passes
    /// between them. Departure: the distance comes from the triangle's plane, clamped to its box (see the module).
    pub(crate) fn intersect(&self, triangle: &Triangle, pad: f32, first_prim: u32, best: &mut Hit) {
        let a = permute(Vec3::from(triangle.a) - self.origin, self.major);
        let b = permute(Vec3::from(triangle.b) - self.origin, self.major);
        let c = permute(Vec3::from(triangle.c) - self.origin, self.major);
        let (ax, ay) = (a.x - self.shear[0] * a.z, a.y - self.shear[1] * a.z);
        let (bx, by) = (b.x - self.shear[0] * b.z, b.y - self.shear[1] * b.z);
        let (cx, cy) = (c.x - self.shear[0] * c.z, c.y - self.shear[1] * c.z);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        if (u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0) {
            return;
        }
        let det = u + v + w;
        if det == 0.0 {
            return;
        }
        let low = Vec3::from(triangle.a).min(triangle.b.into()).min(triangle.c.into());
        let high = Vec3::from(triangle.a).max(triangle.b.into()).max(triangle.c.into());
        // The bare box makes distances to axis-parallel faces exact, so that coplanar triangles tie;
        // the padded one is for rays that rounding puts just beside the bare one.
        let (mut enter, mut leave) = self.slab(low, high);
        if enter > leave {
            (enter, leave) = self.slab(low - pad, high + pad);
        }
        if enter > leave {
            return;
        }
        // From the plane and not from u, v and w: in a long thin triangle these are small differences
        // of large products, and their quotient is wrong by millimetres.
        let normal = Vec3::from(triangle.normal);
        let towards = dot(normal, self.direction);
        if towards == 0.0 {
            return;
        }
        let quotient = dot(normal, Vec3::from(triangle.a) - self.origin) / towards;
        if quotient <= 0.0 {
            return;
        }
        let t = quotient.max(enter).min(leave);
        let prim = first_prim + triangle.prim;
        if t > 0.0 && (t < best.t || (t == best.t && prim < best.prim)) {
            *best = Hit { t, prim };
        }
    }
}

/// Axis of the largest component.
#[inline]
fn major_axis(direction: Vec3) -> usize {
    let size = direction.abs();
    // Without branches, which rays of random directions would mispredict.
    let (x_over_y, x_over_z, y_over_z) = (size.x > size.y, size.x > size.z, size.y > size.z);
    let y = usize::from(!x_over_y & y_over_z);
    let z = usize::from(x_over_y & !x_over_z) | usize::from(!x_over_y & !y_over_z);
    y + 2 * z
}

/// The two axes of the shear, and the one of the largest component.
#[inline(always)]
pub(crate) fn axes_of(major: usize) -> [usize; 3] {
    [(major + 1) % 3, (major + 2) % 3, major]
}

/// Products added from left to right, as the shader does.
fn dot(a: Vec3, b: Vec3) -> f32 {
    a.x * b.x + a.y * b.y + a.z * b.z
}

/// Moves the major axis to z, keeping the handedness.
#[inline(always)]
fn permute(v: Vec3, major: usize) -> Vec3 {
    let ([x, y, z], v) = (axes_of(major), v.to_array());
    Vec3::new(v[x], v[y], v[z])
}

#[inline(always)]
fn safe_inverse(d: f32) -> f32 {
    if d == 0.0 { FAR_INVERSE } else { 1.0 / d }
}
