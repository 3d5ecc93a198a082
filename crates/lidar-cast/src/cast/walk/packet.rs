//! A beam and its rim: eight rays from one place, a lane each, and the test of `Ray::intersect` for all of them.

use glam::Vec3;

use super::ops::per_target;
use crate::bvh::bvh16::Block16;
use crate::bvh::{FAR_INVERSE, Hit, NO_HIT, Ray, axes_of};
use crate::task::{DevicePose, TINY_COMPONENT};

/// Rays of a packet.
pub const RAYS: usize = 8;
type PacketNumbers = [f32; RAYS];
/// Unit directions of a packet's rays in the sensor's frame, by axis.
pub type Rays = [PacketNumbers; 3];

/// Stands for the part of a packet that was aimed at none.
const NOWHERE: u32 = u32::MAX;
/// Stands for the axis along which rays go farthest where they differ.
const MIXED: usize = 3;

/// Rays of a beam with their best hits.
#[repr(align(64))]
#[derive(Clone)]
pub(super) struct Packet {
    pub(super) t: PacketNumbers,
    pub(super) prim: [u32; RAYS],
    /// Directions and shears in the frame of the part that the packet is aimed at.
    direction: [PacketNumbers; 3],
    shear: [PacketNumbers; 2],
    /// Axis along which all rays go farthest, or [`MIXED`].
    major: usize,
    /// Number of the part.
    pub(super) aimed_at: u32,
}

impl Packet {
    pub(super) const NONE: Self = Self {
        t: [0.0; RAYS],
        prim: [NO_HIT; RAYS],
        direction: [[0.0; RAYS]; 3],
        shear: [[0.0; RAYS]; 2],
        major: MIXED,
        aimed_at: NOWHERE,
    };

    /// Forgets all hits within `range` metres.
    pub(super) fn begin(&mut self, range: f32) {
        (self.t, self.prim, self.aimed_at) = ([range; RAYS], [NO_HIT; RAYS], NOWHERE);
    }

    pub(super) fn farthest(&self) -> f32 {
        let [a, b, c, d, e, f, g, h] = self.t;
        let (a, b, c, d) = (most(a, e), most(b, f), most(c, g), most(d, h));
        most(most(a, c), most(b, d))
    }

    /// The ray of a lane, as far as its best hit.
    fn ray(&self, lane: usize, origin: Vec3) -> Ray {
        let direction = Vec3::from([0, 1, 2].map(|axis| self.direction[axis][lane]));
        Ray::new(origin, direction, self.t[lane])
    }

    /// Asks `Ray::intersect` itself, for the rays of some lanes.
    #[cold]
    #[inline(never)]
    fn ask(&mut self, triangle: &PacketFace<'_>, lanes: u32, pad: f32, first_prim: u32) {
        let origin = Vec3::from(triangle.origin);
        for lane in (0..RAYS).filter(|lane| lanes >> lane & 1 != 0) {
            let mut best = Hit { t: self.t[lane], prim: self.prim[lane] };
            let own = triangle.block.triangle(triangle.slot);
            self.ray(lane, origin).intersect(&own, pad, first_prim, &mut best);
            (self.t[lane], self.prim[lane]) = (best.t, best.prim);
        }
    }
}

/// A triangle of a block as seen from the place that rays leave.
pub(super) struct PacketFace<'a> {
    block: &'a Block16,
    slot: usize,
    origin: [f32; 3],
    /// From the origin.
    corners: [[f32; 3]; 3],
    /// Lower and upper corner of the bare box, from the origin.
    low: [f32; 3],
    high: [f32; 3],
    /// Distance of the plane from the origin along the normal.
    above: f32,
    normal: [f32; 3],
}

impl<'a> PacketFace<'a> {
    #[inline(always)]
    pub(super) fn new(block: &'a Block16, slot: usize, origin: [f32; 3]) -> Self {
        let slot = slot % super::ops::W;
        let mut corners = [[0.0; 3]; 3];
        let (mut low, mut high, mut normal) = ([0.0; 3], [0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            for (k, corner) in corners.iter_mut().enumerate() {
                corner[axis] = block.corners[k][axis][slot] - origin[axis];
            }
            // Less the same number, the order of three stays as it is.
            let [a, b, c] = [corners[0][axis], corners[1][axis], corners[2][axis]];
            (low[axis], high[axis]) = (least(least(a, b), c), most(most(a, b), c));
            normal[axis] = block.normal[axis][slot];
        }
        let a = corners[0];
        let above = normal[0] * a[0] + normal[1] * a[1] + normal[2] * a[2];
        Self { block, slot, origin, corners, low, high, above, normal }
    }
}

/// Smaller number, by one compare and select as the vector instruction does it; NaN is not expected.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

/// Larger number, likewise.
#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

per_target! {
    use super::{};

    /// Turns a packet's rays to the frame of a part; as `beam_direction` does.
    fn aim(packet: &mut Packet, rays: &Rays, pose: &DevicePose, part: u32) {
        let (mut by_x, mut by_y) = (0_u32, 0_u32);
        let [r, s, t] = &pose.rows;
        for i in 0..RAYS {
            let (x, y, z) = (rays[0][i], rays[1][i], rays[2][i]);
            let x_y_z = [
                r[0] * x + r[1] * y + r[2] * z,
                s[0] * x + s[1] * y + s[2] * z,
                t[0] * x + t[1] * y + t[2] * z,
            ];
            for axis in 0..3 {
                let d = x_y_z[axis];
                packet.direction[axis][i] = if d.abs() < TINY_COMPONENT { 0.0 } else { d };
            }
        }
        for i in 0..RAYS {
            let [x, y, z] = &packet.direction;
            let (x, y, z) = (x[i].abs(), y[i].abs(), z[i].abs());
            by_x += u32::from((x > y) & (x > z));
            by_y += u32::from((y >= x) & (y > z));
        }
        const ALL: u32 = RAYS as u32;
        packet.major = match (by_x, by_y) {
            (ALL, _) => 0,
            (_, ALL) => 1,
            (0, 0) => 2,
            _ => MIXED,
        };
        let [x, y, z] = axes_of(packet.major % 3);
        for i in 0..RAYS {
            packet.shear[0][i] = packet.direction[x][i] / packet.direction[z][i];
            packet.shear[1][i] = packet.direction[y][i] / packet.direction[z][i];
        }
        packet.aimed_at = part;
    }

    /// `Ray::intersect` for all rays of a packet; whether a hit was taken over.
    fn meet(packet: &mut Packet, seen: &PacketFace<'_>, pad: f32, first_prim: u32) -> bool {
        if packet.major == MIXED {
            packet.ask(seen, u32::MAX, pad, first_prim);
            return true;
        }
        let mut passes = [0_u32; RAYS];
        if !between(packet, seen, &mut passes) {
            return false;
        }
        let (mut takes, mut besides) = (0, 0);
        let id = first_prim + seen.block.prim[seen.slot];
        let (n, low, high) = (&seen.normal, &seen.low, &seen.high);
        let [dx, dy, dz] = &packet.direction;
        for i in 0..RAYS {
            // Rounded where `Ray::new` rounds; most tests end before they are needed.
            let ix = if dx[i] == 0.0 { FAR_INVERSE } else { 1.0 / dx[i] };
            let iy = if dy[i] == 0.0 { FAR_INVERSE } else { 1.0 / dy[i] };
            let iz = if dz[i] == 0.0 { FAR_INVERSE } else { 1.0 / dz[i] };
            let (x0, x1) = (low[0] * ix, high[0] * ix);
            let (y0, y1) = (low[1] * iy, high[1] * iy);
            let (z0, z1) = (low[2] * iz, high[2] * iz);
            let enter = most(most(most(least(x0, x1), least(y0, y1)), least(z0, z1)), 0.0);
            let leave = least(least(most(x0, x1), most(y0, y1)), most(z0, z1));
            let towards = n[0] * dx[i] + n[1] * dy[i] + n[2] * dz[i];
            let quotient = seen.above / towards;
            let t = least(most(quotient, enter), leave);
            let (before, other) = (packet.t[i], packet.prim[i]);
            let closer = (t < before) | ((t == before) & (id < other));
            let ahead =
                (towards != 0.0) & ((quotient > 0.0) | quotient.is_nan()) & (passes[i] != 0);
            let beside = enter > leave;
            let takes_it = ahead & (t > 0.0) & closer & !beside;
            packet.t[i] = if takes_it { t } else { before };
            packet.prim[i] = if takes_it { id } else { other };
            takes |= u32::from(takes_it);
            besides |= u32::from(beside & ahead) << i;
        }
        if besides != 0 {
            packet.ask(seen, besides, pad, first_prim);
        }
        (takes | besides) != 0
    }

    /// Marks the rays that pass between the edges of a triangle; whether there are any.
    fn between(packet: &Packet, seen: &PacketFace<'_>, passes: &mut [u32; RAYS]) -> bool {
        let [x, y, z] = axes_of(packet.major % 3);
        let [a, b, c] = &seen.corners;
        let (a, b, c) = ([a[x], a[y], a[z]], [b[x], b[y], b[z]], [c[x], c[y], c[z]]);
        let [sx, sy] = &packet.shear;
        let mut any = 0;
        for i in 0..RAYS {
            let (ax, ay) = (a[0] - sx[i] * a[2], a[1] - sy[i] * a[2]);
            let (bx, by) = (b[0] - sx[i] * b[2], b[1] - sy[i] * b[2]);
            let (cx, cy) = (c[0] - sx[i] * c[2], c[1] - sy[i] * c[2]);
            let u = cx * by - cy * bx;
            let v = ax * cy - ay * cx;
            let w = bx * ay - by * ax;
            let outside =
                ((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0));
            let inside = !outside & (u + v + w != 0.0);
            passes[i] = if inside { u32::MAX } else { 0 };
            any |= passes[i];
        }
        any != 0
    }
}
