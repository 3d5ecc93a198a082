use glam::Vec3;
use multiversion::multiversion;

use super::bounds::Bounds;
use super::intersect::safe_inverse;
use super::lanes::intersect;
use super::wide::{Child, WIDTH, Wide};
use super::{Bvh, Hit, MAX_DEPTH, NO_HIT, Ray, Triangle, major_axis};

/// Most rays of a packet.
pub const PACKET_RAYS: usize = 128;
/// Rays that are tested against a triangle together: those of a chunk should lie side by side.
pub const CHUNK: usize = 16;
/// Chunks of a full packet.
pub(super) const CHUNKS: usize = PACKET_RAYS / CHUNK;
/// Entries of the traversal stack: each level leaves at most all children but one behind.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + 1;

/// A number of each ray, by chunk.
pub(super) type Lanes = [[f32; CHUNK]; CHUNKS];
const NOTHING: Lanes = [[0.0; CHUNK]; CHUNKS];

/// Closest hits of a packet's rays.
#[derive(Debug, Clone, Copy)]
pub struct PacketHits {
    pub(super) t: Lanes,
    pub(super) prim: [[u32; CHUNK]; CHUNKS],
}

impl Default for PacketHits {
    fn default() -> Self {
        Self { t: NOTHING, prim: [[NO_HIT; CHUNK]; CHUNKS] }
    }
}

impl PacketHits {
    /// The hit of the ray with this number.
    #[inline]
    pub fn get(&self, lane: usize) -> Hit {
        Hit { t: self.t.as_flattened()[lane], prim: self.prim.as_flattened()[lane] }
    }
}

/// A number of each ray, the same lane of all chunks side by side.
pub(super) type Across = [[f32; CHUNKS]; CHUNK];

/// What is still to be visited: where the rays enter it at the earliest, and what it is.
type Stack = [(f32, Child); STACK];

/// Rays that go roughly the same way, cast together.
///
/// A node and a block of triangles are tested once for all rays, a triangle that is left once for
/// each chunk, with bounds that hold for every ray: they are skipped only where all rays miss them,
/// or have a hit before them, by more than rounding could change (`Bounds::slack`). What is left is
/// tested a lane a ray, with the operations of `Ray::intersect` in the same order. Since no hit
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
    pub(super) hits: PacketHits,
    /// Whether all directions are the same; only the first lane of what depends on them is then set.
    pub(super) parallel: bool,
    /// The origins again, which stay while directions change; only set for parallel rays.
    pub(super) across: [Across; 3],
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
            origin: [NOTHING; 3],
            direction: [NOTHING; 3],
            inverse: [NOTHING; 3],
            shear: [NOTHING; 2],
            t_max: 0.0,
            hits: PacketHits::default(),
            parallel: true,
            across: [[[0.0; CHUNKS]; CHUNK]; 3],
        }
    }
}

impl Packet {
    /// A packet of rays from `origins` (1 to [`PACKET_RAYS`]) without directions as yet.
    pub fn from_origins(origins: &[Vec3]) -> Self {
        let mut packet = Self { len: origins.len(), ..Self::default() };
        for lane in 0..PACKET_RAYS {
            // Lanes that are left over repeat the last ray.
            let origin = origins[lane.min(origins.len() - 1)];
            let (chunk, i) = (lane / CHUNK, lane % CHUNK);
            for axis in 0..3 {
                packet.origin[axis][chunk][i] = origin[axis];
                packet.across[axis][i][chunk] = origin[axis];
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
            self.direction[axis][0][0] = direction[axis];
            self.inverse[axis][0][0] = ray.inverse[axis];
        }
        for axis in 0..2 {
            self.shear[axis][0][0] = ray.shear[axis];
        }
    }

    /// Takes `rays` (1 to [`PACKET_RAYS`]) of any origins and unit directions whose [`major_axis`] is
    /// the same, asking for each by its number; hits count up to `t_max`.
    ///
    /// The packet is fast where no component changes its sign from ray to ray.
    pub fn gather(&mut self, rays: usize, t_max: f32, ray: impl Fn(usize) -> (Vec3, Vec3)) {
        self.len = rays;
        self.parallel = false;
        self.t_max = t_max;
        for lane in 0..CHUNK * self.chunks() {
            let (chunk, i) = (lane / CHUNK, lane % CHUNK);
            let (origin, direction) = ray(lane.min(rays - 1));
            for axis in 0..3 {
                self.origin[axis][chunk][i] = origin[axis];
                self.direction[axis][chunk][i] = direction[axis];
            }
        }
        let [x, y, z] = &self.direction;
        self.major = major_axis(Vec3::new(x[0][0], y[0][0], z[0][0]));
        prepare(self);
    }

    /// Closest hit of each ray after [`Bvh::closest_hits`], in order.
    pub fn hits(&self) -> impl Iterator<Item = Hit> {
        (0..self.len).map(|lane| self.hits.get(lane))
    }

    /// The same, as they lie.
    pub fn found(&self) -> &PacketHits {
        &self.hits
    }

    /// The two axes of the shear, and the one of the largest component.
    pub(super) fn axes(&self) -> [usize; 3] {
        [(self.major + 1) % 3, (self.major + 2) % 3, self.major]
    }

    /// Chunks that hold rays.
    pub(super) fn chunks(&self) -> usize {
        self.len.div_ceil(CHUNK)
    }

    pub(super) fn ray(&self, chunk: usize, i: usize) -> Ray {
        let at = |[x, y, z]: &[Lanes; 3], chunk: usize, i: usize| {
            Vec3::new(x[chunk][i], y[chunk][i], z[chunk][i])
        };
        let (turned, j) = if self.parallel { (0, 0) } else { (chunk, i) };
        Ray {
            origin: at(&self.origin, chunk, i),
            direction: at(&self.direction, turned, j),
            t_max: self.t_max,
            inverse: at(&self.inverse, turned, j),
            major: self.major,
            shear: [self.shear[0][turned][j], self.shear[1][turned][j]],
        }
    }
}

impl Bvh {
    /// [`Self::closest_hit`] of every ray of a packet.
    pub fn closest_hits(&self, packet: &mut Packet, scratch: &mut Scratch) {
        packet.hits.t = [[packet.t_max; CHUNK]; CHUNKS];
        packet.hits.prim = [[NO_HIT; CHUNK]; CHUNKS];
        if !self.wide.nodes.is_empty() {
            traverse(&self.wide, &self.triangles, self.pad, packet, &mut scratch.0);
        }
    }
}

/// What `Ray::new` computes, for every lane.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn prepare(packet: &mut Packet) {
    let axes = packet.axes();
    for chunk in 0..packet.chunks() {
        for axis in 0..3 {
            for i in 0..CHUNK {
                packet.inverse[axis][chunk][i] = safe_inverse(packet.direction[axis][chunk][i]);
            }
        }
        for k in 0..2 {
            for i in 0..CHUNK {
                packet.shear[k][chunk][i] =
                    packet.direction[axes[k]][chunk][i] / packet.direction[axes[2]][chunk][i];
            }
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn traverse(wide: &Wide, triangles: &[Triangle], pad: f32, packet: &mut Packet, stack: &mut Stack) {
    if packet.parallel {
        visit::<true>(wide, triangles, pad, packet, stack);
    } else {
        visit::<false>(wide, triangles, pad, packet, stack);
    }
}

#[inline(always)]
fn visit<const PARALLEL: bool>(
    wide: &Wide,
    triangles: &[Triangle],
    pad: f32,
    packet: &mut Packet,
    stack: &mut Stack,
) {
    let (bounds, mut chunks) = Bounds::new::<PARALLEL>(packet, pad);
    let mut farthest = chunks.farthest();
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
            Ok(block) => {
                let block = &wide.blocks[block];
                let mut left = bounds.meets::<PARALLEL>(block, farthest);
                let mut hit = 0_u32;
                while left != 0 {
                    let slot = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let triangle = &triangles[block.first as usize + slot];
                    let mut meets = chunks.meet::<PARALLEL>(&bounds, block, slot);
                    while meets != 0 {
                        let chunk = meets.trailing_zeros() as usize;
                        meets &= meets - 1;
                        let any = intersect::<PARALLEL>(triangle, pad, packet, chunk);
                        hit |= u32::from(any) << chunk;
                    }
                }
                while hit != 0 {
                    let chunk = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    chunks.look_again::<PARALLEL>(packet, chunk, &bounds);
                }
                farthest = chunks.farthest();
            }
            Err(index) => {
                let node = &wide.nodes[index];
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
