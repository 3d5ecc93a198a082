//! Rays that go down the tree together, with the numbers that their tests share.

use glam::Vec3;
use multiversion::multiversion;

use super::lanes::{CHUNK, CHUNKS, Lanes, NOTHING, PACKET_RAYS, PacketHits};
use crate::bvh::{Hit, axes_of, major_axis, safe_inverse};

/// Rays that go roughly the same way, cast together.
///
/// A node and a block of triangles are tested once for all rays, each remaining triangle once for a
/// chunk, with bounds that hold for every ray: they are skipped only where all rays miss them, or
/// have a hit before them, by more than rounding could change (`Bounds::slack`). All others are
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

    /// The hits that are to be replaced by closer ones, in order; as many as rays.
    pub(crate) fn set_hits(&mut self, hits: impl IntoIterator<Item = Hit>) {
        let mut last = Hit::none(0.0);
        let mut hits = hits.into_iter();
        for lane in 0..CHUNK * self.chunks() {
            // Lanes that are left over repeat the last ray.
            last = hits.next().unwrap_or(last);
            let (chunk, i) = (lane / CHUNK, lane % CHUNK);
            (self.hits.t[chunk][i], self.hits.prim[chunk][i]) = (last.t, last.prim);
        }
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
