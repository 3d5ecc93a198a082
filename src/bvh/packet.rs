use glam::Vec3;
use multiversion::multiversion;

use super::wide::{Child, WIDTH, WideNode};
use super::{Bvh, Hit, MAX_DEPTH, NO_HIT, Ray, Triangle};

/// Most rays of a packet.
pub const PACKET_RAYS: usize = 64;
/// Lanes are worked on in whole chunks of this many.
const CHUNK: usize = 16;
/// Entries of the traversal stack: each level leaves at most all children but one behind.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + 1;

type Lanes = [f32; PACKET_RAYS];

/// Rays that go roughly the same way, cast together.
///
/// Nodes are tested once for all rays: with bounds of the origins and of the inverse directions,
/// the slab test becomes one of intervals. Subtraction and multiplication never decrease when an
/// operand grows, also in rounded arithmetic, so the interval holds every ray's own result, and a
/// node that is skipped for the packet would be skipped for each of its rays. Triangles are tested
/// a lane a ray, with the operations of [`Ray::intersect`] in the same order: the same bits.
#[derive(Clone)]
pub struct Packet {
    len: usize,
    /// Axis of the largest component of every direction.
    major: usize,
    origin: [Lanes; 3],
    direction: [Lanes; 3],
    inverse: [Lanes; 3],
    shear: [Lanes; 2],
    t_max: f32,
    t: Lanes,
    prim: [u32; PACKET_RAYS],
}

/// What holds for every ray of a packet: planes are tested against these instead of each ray.
struct Bounds {
    /// Which side of a box is met first, by axis.
    near_side: [usize; 3],
    /// The origin for which the near plane is closest and that for which the far one is farthest.
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    /// Least and largest inverse direction.
    inverse: [[f32; 2]; 3],
}

impl Default for Packet {
    fn default() -> Self {
        Self {
            len: 0,
            major: 0,
            origin: [[0.0; PACKET_RAYS]; 3],
            direction: [[0.0; PACKET_RAYS]; 3],
            inverse: [[0.0; PACKET_RAYS]; 3],
            shear: [[0.0; PACKET_RAYS]; 2],
            t_max: 0.0,
            t: [0.0; PACKET_RAYS],
            prim: [NO_HIT; PACKET_RAYS],
        }
    }
}

impl Packet {
    /// A packet of rays from `origins` (at most [`PACKET_RAYS`]) without directions as yet.
    pub fn from_origins(origins: &[Vec3]) -> Self {
        let mut packet = Self { len: origins.len(), ..Self::default() };
        for lane in 0..PACKET_RAYS {
            // Lanes that are left over repeat the first ray.
            let origin = origins[if lane < origins.len() { lane } else { 0 }];
            for axis in 0..3 {
                packet.origin[axis][lane] = origin[axis];
            }
        }
        packet
    }

    /// Turns all rays into one direction, of unit length; hits count up to `t_max`.
    pub fn point(&mut self, direction: Vec3, t_max: f32) {
        let ray = Ray::new(Vec3::ZERO, direction, t_max);
        self.major = ray.major;
        self.t_max = t_max;
        for axis in 0..3 {
            self.direction[axis].fill(direction[axis]);
            self.inverse[axis].fill(ray.inverse[axis]);
        }
        for axis in 0..2 {
            self.shear[axis].fill(ray.shear[axis]);
        }
    }

    /// Closest hit of each ray after [`Bvh::closest_hits`], in order.
    pub fn hits(&self) -> impl Iterator<Item = Hit> {
        (0..self.len).map(|lane| Hit { t: self.t[lane], prim: self.prim[lane] })
    }

    fn lanes(&self) -> usize {
        self.len.next_multiple_of(CHUNK)
    }

    fn ray(&self, lane: usize) -> Ray {
        let at = |lanes: &[Lanes; 3]| Vec3::new(lanes[0][lane], lanes[1][lane], lanes[2][lane]);
        Ray {
            origin: at(&self.origin),
            direction: at(&self.direction),
            t_max: self.t_max,
            inverse: at(&self.inverse),
            major: self.major,
            shear: [self.shear[0][lane], self.shear[1][lane]],
        }
    }

    #[inline(always)]
    fn bounds(&self) -> Bounds {
        let lanes = self.lanes();
        let mut bounds = Bounds {
            near_side: [0; 3],
            near_origin: [f32::INFINITY; 3],
            far_origin: [f32::NEG_INFINITY; 3],
            inverse: [[1.0; 2]; 3],
        };
        for axis in 0..3 {
            let [low, high] = low_high(&self.origin[axis][..lanes]);
            let inverse = low_high(&self.inverse[axis][..lanes]);
            if inverse[0] > 0.0 {
                (bounds.near_origin[axis], bounds.far_origin[axis]) = (high, low);
                bounds.inverse[axis] = inverse;
            } else if inverse[1] < 0.0 {
                bounds.near_side[axis] = 1;
                (bounds.near_origin[axis], bounds.far_origin[axis]) = (low, high);
                bounds.inverse[axis] = inverse;
            }
            // Otherwise some rays go up and some down this axis: it bounds nothing.
        }
        bounds
    }
}

#[inline(always)]
fn low_high(lanes: &[f32]) -> [f32; 2] {
    let (mut low, mut high) = ([f32::INFINITY; CHUNK], [f32::NEG_INFINITY; CHUNK]);
    for chunk in lanes.chunks_exact(CHUNK) {
        for i in 0..CHUNK {
            low[i] = if chunk[i] < low[i] { chunk[i] } else { low[i] };
            high[i] = if chunk[i] > high[i] { chunk[i] } else { high[i] };
        }
    }
    [low.into_iter().fold(low[0], f32::min), high.into_iter().fold(high[0], f32::max)]
}

impl Bounds {
    /// Bounds of where the rays are inside boxes: no ray enters box `i` before `near[i]` or leaves
    /// it after `far[i]`.
    #[inline(always)]
    fn slabs<const N: usize>(&self, planes: &[[[f32; N]; 2]; 3]) -> ([f32; N], [f32; N]) {
        let (mut near, mut far) = ([0.0_f32; N], [f32::INFINITY; N]);
        for axis in 0..3 {
            let enter = &planes[axis][self.near_side[axis]];
            let leave = &planes[axis][1 - self.near_side[axis]];
            let [low, high] = self.inverse[axis];
            for i in 0..N {
                let x = enter[i] - self.near_origin[axis];
                let (a, b) = (x * low, x * high);
                let t = if a < b { a } else { b };
                near[i] = if t > near[i] { t } else { near[i] };
                let x = leave[i] - self.far_origin[axis];
                let (a, b) = (x * low, x * high);
                let t = if a > b { a } else { b };
                far[i] = if t < far[i] { t } else { far[i] };
            }
        }
        (near, far)
    }
}

impl Bvh {
    /// [`Self::closest_hit`] of every ray of a packet.
    pub fn closest_hits(&self, packet: &mut Packet) {
        packet.t.fill(packet.t_max);
        packet.prim.fill(NO_HIT);
        if !self.wide.is_empty() {
            traverse(&self.wide, &self.triangles, self.pad, packet);
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn traverse(wide: &[WideNode], triangles: &[Triangle], pad: f32, packet: &mut Packet) {
    let bounds = packet.bounds();
    let mut farthest = packet.t_max;
    let mut stack = [(0.0_f32, Child::ROOT); STACK];
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let (enter, child) = stack[depth];
        // Equal to the best distance is still visited: a tie may have a lower id.
        if enter > farthest {
            continue;
        }
        match child.get() {
            Ok(leaf) => {
                for triangle in &triangles[leaf] {
                    farthest = intersect(triangle, pad, &bounds, packet, farthest);
                }
            }
            Err(index) => {
                let node = &wide[index];
                let (near, far) = bounds.slabs(&node.planes);
                let bottom = depth;
                for slot in 0..WIDTH {
                    if near[slot] <= far[slot] && near[slot] <= farthest {
                        // Farthest first, so that the nearest is on top.
                        let mut at = depth;
                        while at > bottom && stack[at - 1].0 < near[slot] {
                            stack[at] = stack[at - 1];
                            at -= 1;
                        }
                        stack[at] = (near[slot], node.children[slot]);
                        depth += 1;
                    }
                }
            }
        }
    }
}

/// [`Ray::intersect`] for every lane; returns the farthest of the best distances.
#[inline(always)]
fn intersect(
    triangle: &Triangle,
    pad: f32,
    bounds: &Bounds,
    packet: &mut Packet,
    farthest: f32,
) -> f32 {
    let corners = [triangle.a, triangle.b, triangle.c];
    let low = [0, 1, 2].map(|k| least(least(corners[0][k], corners[1][k]), corners[2][k]));
    let high = [0, 1, 2].map(|k| most(most(corners[0][k], corners[1][k]), corners[2][k]));
    let padded = [0, 1, 2].map(|k| [[low[k] - pad], [high[k] + pad]]);
    let ([near], [far]) = bounds.slabs(&padded);
    if near > far || near > farthest {
        return farthest;
    }
    let mut inside = [0_u32; PACKET_RAYS];
    if !inside_edges(&corners, packet, &mut inside) {
        return farthest;
    }
    let beside = distances(triangle, low, high, packet, &inside);
    if beside {
        retry(triangle, pad, packet, &inside, low, high);
    }
    let [_, farthest] = low_high(&packet.t[..packet.lanes()]);
    farthest
}

/// Marks the lanes whose ray passes between the edges; whether there are any.
#[inline(always)]
fn inside_edges(corners: &[[f32; 3]; 3], packet: &Packet, inside: &mut [u32; PACKET_RAYS]) -> bool {
    let lanes = packet.lanes();
    let axes = [(packet.major + 1) % 3, (packet.major + 2) % 3, packet.major];
    let [a, b, c] = corners.map(|corner| axes.map(|axis| corner[axis]));
    let [ox, oy, oz] = axes.map(|axis| &packet.origin[axis][..lanes]);
    let [sx, sy] = [&packet.shear[0][..lanes], &packet.shear[1][..lanes]];
    let inside = &mut inside[..lanes];
    let mut any = 0;
    for i in 0..lanes {
        let (az, bz, cz) = (a[2] - oz[i], b[2] - oz[i], c[2] - oz[i]);
        let (ax, ay) = ((a[0] - ox[i]) - sx[i] * az, (a[1] - oy[i]) - sy[i] * az);
        let (bx, by) = ((b[0] - ox[i]) - sx[i] * bz, (b[1] - oy[i]) - sy[i] * bz);
        let (cx, cy) = ((c[0] - ox[i]) - sx[i] * cz, (c[1] - oy[i]) - sy[i] * cz);
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let outside = ((u < 0.0) | (v < 0.0) | (w < 0.0)) & ((u > 0.0) | (v > 0.0) | (w > 0.0));
        let det = u + v + w;
        let passes = u32::from(!outside & (det != 0.0));
        inside[i] = passes;
        any |= passes;
    }
    any != 0
}

/// Takes over the distances of marked lanes where they are best; whether a lane passes beside the
/// bare box, so that the padded one decides.
#[inline(always)]
fn distances(
    triangle: &Triangle,
    low: [f32; 3],
    high: [f32; 3],
    packet: &mut Packet,
    inside: &[u32; PACKET_RAYS],
) -> bool {
    let lanes = packet.lanes();
    let [ox, oy, oz] = [0, 1, 2].map(|axis| &packet.origin[axis][..lanes]);
    let [dx, dy, dz] = [0, 1, 2].map(|axis| &packet.direction[axis][..lanes]);
    let [ix, iy, iz] = [0, 1, 2].map(|axis| &packet.inverse[axis][..lanes]);
    let (best, prim) = (&mut packet.t[..lanes], &mut packet.prim[..lanes]);
    let inside = &inside[..lanes];
    let (n, a, id) = (triangle.normal, triangle.a, triangle.prim);
    let mut any_beside = 0;
    for i in 0..lanes {
        let (x0, x1) = ((low[0] - ox[i]) * ix[i], (high[0] - ox[i]) * ix[i]);
        let (y0, y1) = ((low[1] - oy[i]) * iy[i], (high[1] - oy[i]) * iy[i]);
        let (z0, z1) = ((low[2] - oz[i]) * iz[i], (high[2] - oz[i]) * iz[i]);
        let enter = most(most(most(least(x0, x1), least(y0, y1)), least(z0, z1)), 0.0);
        let leave = least(least(most(x0, x1), most(y0, y1)), most(z0, z1));
        let towards = n[0] * dx[i] + n[1] * dy[i] + n[2] * dz[i];
        let above = n[0] * (a[0] - ox[i]) + n[1] * (a[1] - oy[i]) + n[2] * (a[2] - oz[i]);
        let quotient = above / towards;
        let t = least(most(quotient, enter), leave);
        let closer = (t < best[i]) | ((t == best[i]) & (id < prim[i]));
        let met = (towards != 0.0) & !(quotient <= 0.0) & (t > 0.0) & (inside[i] != 0);
        let beside = enter > leave;
        let takes = met & closer & !beside;
        best[i] = if takes { t } else { best[i] };
        prim[i] = if takes { id } else { prim[i] };
        any_beside |= u32::from(beside) & inside[i];
    }
    any_beside != 0
}

/// Asks [`Ray::intersect`] itself for the marked lanes that pass beside the bare box.
#[cold]
#[inline(never)]
fn retry(
    triangle: &Triangle,
    pad: f32,
    packet: &mut Packet,
    inside: &[u32; PACKET_RAYS],
    low: [f32; 3],
    high: [f32; 3],
) {
    for lane in (0..packet.lanes()).filter(|&lane| inside[lane] != 0) {
        let ray = packet.ray(lane);
        let (enter, leave) = ray.slab(low.into(), high.into());
        if enter > leave {
            let mut best = Hit { t: packet.t[lane], prim: packet.prim[lane] };
            ray.intersect(triangle, pad, &mut best);
            (packet.t[lane], packet.prim[lane]) = (best.t, best.prim);
        }
    }
}

/// As the vector instruction has it: one compare and select, no care for NaN.
#[inline(always)]
fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
