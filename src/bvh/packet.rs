use glam::Vec3;
use multiversion::multiversion;

use super::build::PAD_SHARE;
use super::wide::{Child, WIDTH, WideNode};
use super::{Bvh, Hit, MAX_DEPTH, NO_HIT, Ray, Triangle};

/// Most rays of a packet.
pub const PACKET_RAYS: usize = 128;
/// Lanes are worked on in whole chunks of this many.
const CHUNK: usize = 16;
/// Entries of the traversal stack: each level leaves at most all children but one behind.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + 1;
/// Farther than any plane, and finite, so that an empty box stays empty.
const UNBOUNDED: f32 = 1e30;
/// Slack of bounds in units of a box's pad, which itself is several roundings of the largest number.
const SLACK: f32 = 8.0;

type Lanes = [f32; PACKET_RAYS];
/// What is still to be visited: where the rays enter it at the earliest, and what it is.
type Stack = [(f32, Child); STACK];

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
    /// Whether all directions are the same.
    parallel: bool,
    /// How far along its ray each origin lies before the plane that bounds are taken in.
    shift: Lanes,
}

/// What holds for every ray of a packet: planes are tested against these instead of each ray.
///
/// Origins are moved along their rays into one plane, so that a packet is as narrow as its rays are
/// close, however far apart they start; distances count from that plane.
struct Bounds {
    /// Which side of a box is met first, by axis.
    near_side: [usize; 3],
    /// The origin for which the near plane is closest and that for which the far one is farthest.
    near_origin: [f32; 3],
    far_origin: [f32; 3],
    /// Least and largest inverse direction.
    inverse: [[f32; 2]; 3],
    /// Middle and half of the spread of the moved origins, in the order of the sheared axes.
    middle: [f32; 3],
    half: [f32; 2],
    /// Middle and half of the spread of the shears.
    shear: [f32; 2],
    turn: [f32; 2],
    /// Metres by which everything may be off through rounding.
    slack: f32,
    /// Where the first ray starts, counted from the plane.
    start: f32,
}

/// Working memory of [`Bvh::closest_hits`], to be used again.
pub struct Scratch(Stack);

impl Default for Scratch {
    fn default() -> Self {
        Self([(0.0, Child::ROOT); STACK])
    }
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
            parallel: true,
            shift: [0.0; PACKET_RAYS],
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
        self.parallel = true;
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

    /// Takes rays of any origins and unit directions, at most [`PACKET_RAYS`], whose
    /// [`super::major_axis`] is the same; hits count up to `t_max`.
    ///
    /// The packet is fast where no component changes its sign from ray to ray.
    pub fn gather(&mut self, rays: &[(Vec3, Vec3)], t_max: f32) {
        self.len = rays.len();
        self.parallel = false;
        self.t_max = t_max;
        for lane in 0..self.lanes() {
            let (origin, direction) = rays[if lane < rays.len() { lane } else { 0 }];
            let ray = Ray::new(origin, direction, t_max);
            self.major = ray.major;
            for axis in 0..3 {
                self.origin[axis][lane] = origin[axis];
                self.direction[axis][lane] = direction[axis];
                self.inverse[axis][lane] = ray.inverse[axis];
            }
            for axis in 0..2 {
                self.shear[axis][lane] = ray.shear[axis];
            }
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
    fn bounds(&mut self, pad: f32) -> Bounds {
        let lanes = self.lanes();
        let major = self.major;
        let [low, high] = low_high(&self.origin[major][..lanes]);
        let middle = 0.5 * (low + high);
        let mut largest = low.abs().max(high.abs());
        for i in 0..lanes {
            self.shift[i] = (middle - self.origin[major][i]) * self.inverse[major][i];
        }
        let mut bounds = Bounds {
            near_side: [0; 3],
            near_origin: [UNBOUNDED; 3],
            far_origin: [-UNBOUNDED; 3],
            inverse: [[1.0; 2]; 3],
            middle: [0.0; 3],
            half: [0.0; 2],
            shear: [0.0; 2],
            turn: [0.0; 2],
            slack: 0.0,
            start: 0.0,
        };
        let mut moved = [0.0; PACKET_RAYS];
        let (mut moved_low, mut moved_high) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let (origin, direction) = (&self.origin[axis][..lanes], &self.direction[axis][..lanes]);
            for i in 0..lanes {
                moved[i] = origin[i] + self.shift[i] * direction[i];
            }
            let [low, high] = low_high(&moved[..lanes]);
            (moved_low[axis], moved_high[axis]) = (low, high);
            largest = largest.max(low.abs()).max(high.abs());
            let inverse = if self.parallel {
                [self.inverse[axis][0]; 2]
            } else {
                low_high(&self.inverse[axis][..lanes])
            };
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
        bounds.slack = SLACK * (pad + largest * PAD_SHARE);
        bounds.start = -low_high(&self.shift[..lanes])[1] - bounds.slack;
        for axis in 0..3 {
            let outwards = if bounds.near_side[axis] == 0 { bounds.slack } else { -bounds.slack };
            bounds.near_origin[axis] += outwards;
            bounds.far_origin[axis] -= outwards;
        }
        bounds.middle[2] = middle;
        for (k, axis) in [(major + 1) % 3, (major + 2) % 3].into_iter().enumerate() {
            bounds.middle[k] = 0.5 * (moved_low[axis] + moved_high[axis]);
            bounds.half[k] = 0.5 * (moved_high[axis] - moved_low[axis]) + bounds.slack;
            bounds.shear[k] = self.shear[k][0];
            if !self.parallel {
                let [low, high] = low_high(&self.shear[k][..lanes]);
                bounds.shear[k] = 0.5 * (low + high);
                bounds.turn[k] = 0.5 * (high - low);
            }
        }
        bounds
    }

    /// The farthest of the best distances, counted from the plane of the bounds.
    #[inline(always)]
    fn farthest(&self, bounds: &Bounds) -> f32 {
        let mut farthest = [f32::NEG_INFINITY; CHUNK];
        let lanes = self.lanes();
        for (t, shift) in
            self.t[..lanes].chunks_exact(CHUNK).zip(self.shift[..lanes].chunks_exact(CHUNK))
        {
            for i in 0..CHUNK {
                farthest[i] = most(t[i] - shift[i], farthest[i]);
            }
        }
        fold(farthest, most) + bounds.slack
    }
}

#[inline(always)]
fn low_high(lanes: &[f32]) -> [f32; 2] {
    let (mut low, mut high) = ([f32::INFINITY; CHUNK], [f32::NEG_INFINITY; CHUNK]);
    for chunk in lanes.chunks_exact(CHUNK) {
        for i in 0..CHUNK {
            low[i] = least(chunk[i], low[i]);
            high[i] = most(chunk[i], high[i]);
        }
    }
    [fold(low, least), fold(high, most)]
}

/// Puts a chunk together, halving it: the lanes of a half are independent of each other.
#[inline(always)]
fn fold(mut chunk: [f32; CHUNK], join: impl Fn(f32, f32) -> f32) -> f32 {
    for half in [8, 4, 2, 1] {
        for i in 0..half {
            chunk[i] = join(chunk[i], chunk[i + half]);
        }
    }
    chunk[0]
}

impl Bounds {
    /// Bounds of where the rays are inside boxes: no ray enters box `i` before `near[i]` or leaves
    /// it after `far[i]`.
    #[inline(always)]
    fn slabs<const N: usize>(&self, planes: &[[[f32; N]; 2]; 3]) -> ([f32; N], [f32; N]) {
        let (mut near, mut far) = ([self.start; N], [f32::INFINITY; N]);
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
    pub fn closest_hits(&self, packet: &mut Packet, scratch: &mut Scratch) {
        packet.t.fill(packet.t_max);
        packet.prim.fill(NO_HIT);
        if !self.wide.is_empty() {
            traverse(&self.wide, &self.triangles, self.pad, packet, &mut scratch.0);
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn traverse(
    wide: &[WideNode],
    triangles: &[Triangle],
    pad: f32,
    packet: &mut Packet,
    stack: &mut Stack,
) {
    let bounds = packet.bounds(pad);
    let mut farthest = packet.farthest(&bounds);
    stack[0] = (f32::NEG_INFINITY, Child::ROOT);
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
    if passes_beside(&corners, packet, bounds) {
        return farthest;
    }
    let mut inside = [0_u32; PACKET_RAYS];
    if !inside_edges(&corners, packet, &mut inside) {
        return farthest;
    }
    let (mut low, mut high) = (triangle.a, triangle.a);
    for k in 0..3 {
        low[k] = least(least(low[k], triangle.b[k]), triangle.c[k]);
        high[k] = most(most(high[k], triangle.b[k]), triangle.c[k]);
    }
    let beside = distances(triangle, low, high, packet, &inside);
    if beside {
        retry(triangle, pad, packet, &inside, low, high);
    }
    packet.farthest(bounds)
}

/// Whether all rays surely miss a triangle, on the outer side of one of its edges.
///
/// Seen along a ray, a corner lies at its coordinates less shear times depth. An edge function is
/// affine in the origin and in the shear but for their product, so its spread over the packet is a
/// sum of absolute values.
#[inline(always)]
fn passes_beside(corners: &[[f32; 3]; 3], packet: &Packet, bounds: &Bounds) -> bool {
    let axes = [(packet.major + 1) % 3, (packet.major + 2) % 3, packet.major];
    let (middle, half, shear, turn) = (bounds.middle, bounds.half, bounds.shear, bounds.turn);
    let seen = |corner: &[f32; 3]| {
        let z = corner[axes[2]] - middle[2];
        let x = corner[axes[0]] - middle[0] - shear[0] * z;
        let y = corner[axes[1]] - middle[1] - shear[1] * z;
        [x, y, z]
    };
    let (a, b, c) = (seen(&corners[0]), seen(&corners[1]), seen(&corners[2]));
    let deepest = most(most(a[2].abs(), b[2].abs()), c[2].abs());
    let size = |p: [f32; 3]| p[0].abs() + p[1].abs();
    let widest = half[0] + half[1] + deepest * (turn[0] + turn[1]);
    let error = 2.0 * bounds.slack * (size(a) + size(b) + size(c) + widest);
    let edge = |from: [f32; 3], to: [f32; 3]| {
        let turned = turn[0] * (from[2] * to[1] - to[2] * from[1]).abs()
            + turn[1] * (to[2] * from[0] - from[2] * to[0]).abs();
        let moved = (to[1] - from[1]).abs() * half[0] + (to[0] - from[0]).abs() * half[1];
        let both = (turn[0] * half[1] + turn[1] * half[0]) * (to[2] - from[2]).abs();
        (from[0] * to[1] - from[1] * to[0], turned, turned + moved + both + error)
    };
    let (u, v, w) = (edge(a, b), edge(b, c), edge(c, a));
    let area = u.0 + v.0 + w.0;
    let doubt = u.1 + v.1 + w.1 + 4.0 * error;
    if area > doubt {
        (u.0 + u.2 < 0.0) | (v.0 + v.2 < 0.0) | (w.0 + w.2 < 0.0)
    } else if area < -doubt {
        (u.0 - u.2 > 0.0) | (v.0 - v.2 > 0.0) | (w.0 - w.2 > 0.0)
    } else {
        false
    }
}

/// Marks the lanes whose ray passes between the edges; whether there are any.
#[inline(always)]
fn inside_edges(corners: &[[f32; 3]; 3], packet: &Packet, inside: &mut [u32; PACKET_RAYS]) -> bool {
    let lanes = packet.lanes();
    let axes = [(packet.major + 1) % 3, (packet.major + 2) % 3, packet.major];
    let at = |corner: &[f32; 3]| [corner[axes[0]], corner[axes[1]], corner[axes[2]]];
    let (a, b, c) = (at(&corners[0]), at(&corners[1]), at(&corners[2]));
    let ox = &packet.origin[axes[0]][..lanes];
    let oy = &packet.origin[axes[1]][..lanes];
    let oz = &packet.origin[axes[2]][..lanes];
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
    let ox = &packet.origin[0][..lanes];
    let oy = &packet.origin[1][..lanes];
    let oz = &packet.origin[2][..lanes];
    let dx = &packet.direction[0][..lanes];
    let dy = &packet.direction[1][..lanes];
    let dz = &packet.direction[2][..lanes];
    let ix = &packet.inverse[0][..lanes];
    let iy = &packet.inverse[1][..lanes];
    let iz = &packet.inverse[2][..lanes];
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
        let ahead = (towards != 0.0) & ((quotient > 0.0) | quotient.is_nan()) & (inside[i] != 0);
        let beside = enter > leave;
        let takes = ahead & (t > 0.0) & closer & !beside;
        best[i] = if takes { t } else { best[i] };
        prim[i] = if takes { id } else { prim[i] };
        any_beside |= u32::from(beside & ahead);
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
