use glam::Vec3;
use multiversion::multiversion;

use super::build::PAD_SHARE;
use super::lanes::intersect;
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
/// Slack of bounds, in units of 2⁻²⁰ of the largest number that enters a test. An origin moved along
/// its ray, a plane's distance and [`Ray::slab`]'s own result are each off by a few roundings, that is
/// by a few 2⁻²⁴ of that number: together less than one unit.
const SLACK: f32 = 8.0;

type Lanes = [f32; PACKET_RAYS];
/// What is still to be visited: where the rays enter it at the earliest, and what it is.
type Stack = [(f32, Child); STACK];

/// Rays that go roughly the same way, cast together.
///
/// A node is tested once for all rays, with bounds that hold for each: it is skipped only where every
/// ray misses it, or has a hit before it, by more than rounding could change (`SLACK`). A triangle
/// is tested a lane a ray, with the operations of `Ray::intersect` in the same order. Since no hit
/// depends on which triangles were tested before, the answer has the same bits.
#[derive(Clone)]
pub struct Packet {
    pub(super) len: usize,
    /// Axis of the largest component of every direction.
    pub(super) major: usize,
    pub(super) origin: [Lanes; 3],
    pub(super) direction: [Lanes; 3],
    pub(super) inverse: [Lanes; 3],
    pub(super) shear: [Lanes; 2],
    pub(super) t_max: f32,
    pub(super) t: Lanes,
    pub(super) prim: [u32; PACKET_RAYS],
    /// Whether all directions are the same.
    parallel: bool,
    /// How far along its ray each origin lies before the plane that bounds are taken in.
    shift: Lanes,
}

/// What holds for every ray of a packet: planes are tested against these instead of each ray.
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
    /// Middle and half of the spread of the moved origins, in the order of the sheared axes.
    pub(super) middle: [f32; 3],
    pub(super) half: [f32; 2],
    /// Middle and half of the spread of the shears.
    pub(super) shear: [f32; 2],
    pub(super) turn: [f32; 2],
    /// Metres by which everything may be off through rounding.
    pub(super) slack: f32,
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

    pub(super) fn lanes(&self) -> usize {
        self.len.next_multiple_of(CHUNK)
    }

    pub(super) fn ray(&self, lane: usize) -> Ray {
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
    pub(super) fn farthest(&self, bounds: &Bounds) -> f32 {
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

/// As the vector instruction has it: one compare and select, no care for NaN.
#[inline(always)]
pub(super) fn least(a: f32, b: f32) -> f32 {
    if a < b { a } else { b }
}

#[inline(always)]
pub(super) fn most(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}
