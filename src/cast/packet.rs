use glam::Vec3;
use multiversion::multiversion;

use super::FAN_DIRECTIONS;
use super::bounds::Bounds;
use super::lanes::{ALL_INSIDE, Inside, Prepared, Rays};
use crate::bvh::safe_inverse;
use crate::bvh::wide::{Child, WIDTH, Wide};
use crate::bvh::{Bvh, Hit, MAX_DEPTH, NO_HIT, Triangle, axes_of, major_axis};

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
pub(super) const NOTHING: Lanes = [[0.0; CHUNK]; CHUNKS];

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

    /// Hits of a chunk's rays in [`FAN_DIRECTIONS`] directions, those of each ray side by side.
    pub fn by_ray(hits: &[Self], chunk: usize, by_ray: &mut [[Hit; FAN_DIRECTIONS]; CHUNK]) {
        transpose(hits, chunk, by_ray);
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn transpose(hits: &[PacketHits], chunk: usize, by_ray: &mut [[Hit; FAN_DIRECTIONS]; CHUNK]) {
    let (mut t, mut prim) = ([[0.0; CHUNK]; FAN_DIRECTIONS], [[0; CHUNK]; FAN_DIRECTIONS]);
    for (direction, hits) in hits.iter().enumerate() {
        (t[direction], prim[direction]) = (hits.t[chunk], hits.prim[chunk]);
    }
    let mut pairs = [0_u64; CHUNK * FAN_DIRECTIONS];
    for (i, (t, prim)) in t.as_flattened().iter().zip(prim.as_flattened()).enumerate() {
        pairs[i] = u64::from(t.to_bits()) | u64::from(*prim) << 32;
    }
    // Both halves in turn: as many times as a row's number has bits, that swaps rows and columns. Moving
    // each to its place instead is compiled to scattered stores, which are slower.
    let mut other = [0_u64; CHUNK * FAN_DIRECTIONS];
    shuffle(&pairs, &mut other);
    shuffle(&other, &mut pairs);
    shuffle(&pairs, &mut other);
    shuffle(&other, bytemuck::cast_mut(by_ray));
}

#[inline(always)]
fn shuffle<const N: usize>(from: &[u64; N], to: &mut [u64; N]) {
    for i in 0..N / 2 {
        to[2 * i] = from[i];
        to[2 * i + 1] = from[i + N / 2];
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
}

/// Working memory of [`Bvh::closest_hits`], to be used again.
pub struct Scratch {
    stack: Stack,
    inside: Inside,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { stack: [(0.0, Child::ROOT); STACK], inside: ALL_INSIDE }
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
        }
    }
}

impl Packet {
    /// Takes `rays` (1 to [`PACKET_RAYS`]) of any origins and unit directions whose [`major_axis`] is
    /// the same, asking for each by its number; hits count up to `t_max`.
    ///
    /// The packet is fast where no component changes its sign from ray to ray.
    pub fn gather(&mut self, rays: usize, t_max: f32, ray: impl Fn(usize) -> (Vec3, Vec3)) {
        self.len = rays;
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

    /// [`Self::gather`] for the first `rays` of rays from one origin, their directions given axis by axis.
    /// Those that are left over are cast too, and must have the same [`major_axis`].
    pub fn gather_from(
        &mut self,
        origin: Vec3,
        directions: &[[f32; PACKET_RAYS]; 3],
        rays: usize,
        t_max: f32,
    ) {
        self.len = rays;
        self.t_max = t_max;
        for axis in 0..3 {
            self.origin[axis] = [[origin[axis]; CHUNK]; CHUNKS];
            self.direction[axis].as_flattened_mut().copy_from_slice(&directions[axis]);
        }
        self.major = major_axis(Vec3::from(directions.map(|components| components[0])));
        prepare(self);
    }

    /// Closest hit of each ray after [`Bvh::closest_hits`], in order.
    pub fn hits(&self) -> impl Iterator<Item = Hit> {
        (0..self.len).map(|lane| self.hits.get(lane))
    }

    /// The two axes of the shear, and the one of the largest component.
    pub(super) fn axes(&self) -> [usize; 3] {
        axes_of(self.major)
    }

    /// Chunks that hold rays.
    pub(super) fn chunks(&self) -> usize {
        self.len.div_ceil(CHUNK)
    }
}

impl Bvh {
    /// [`Self::closest_hit`] of every ray of a packet.
    pub fn closest_hits(&self, packet: &mut Packet, scratch: &mut Scratch) {
        packet.hits.t = [[packet.t_max; CHUNK]; CHUNKS];
        packet.hits.prim = [[NO_HIT; CHUNK]; CHUNKS];
        if !self.wide.nodes.is_empty() {
            traverse(&self.wide, &self.triangles, self.pad, packet, scratch);
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
fn traverse(
    wide: &Wide,
    triangles: &[Triangle],
    pad: f32,
    packet: &mut Packet,
    scratch: &mut Scratch,
) {
    let (bounds, mut chunks) = Bounds::new(packet, pad);
    let mut farthest = chunks.farthest();
    let Scratch { stack, inside } = scratch;
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
                let mut left = bounds.meets(block, farthest);
                let Packet { origin, direction, inverse, shear, hits, .. } = &mut *packet;
                let rays = Rays::<false> {
                    axes: bounds.axes,
                    enters: [0; 3],
                    origin,
                    direction: [&direction[0], &direction[1], &direction[2]],
                    inverse: [&inverse[0], &inverse[1], &inverse[2]],
                    shear: [&shear[0], &shear[1]],
                };
                let mut hit = 0;
                while left != 0 {
                    let slot = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let meets = chunks.meet(&bounds, block, slot);
                    let triangle = &triangles[block.first as usize + slot];
                    let triangle = [Prepared::new(triangle, bounds.axes)];
                    hit |= rays.intersect(&triangle, pad, meets.into(), 0, inside, hits);
                }
                while hit != 0 {
                    let chunk = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    chunks.look_again(
                        &packet.hits.t[chunk],
                        &packet.origin[bounds.axes[2]][chunk],
                        &packet.inverse[bounds.axes[2]][chunk],
                        chunk,
                        &bounds,
                    );
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
