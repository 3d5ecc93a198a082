//! Neighbouring rays of a virtual scan, turned and cast together.

use glam::{DMat3, DVec3};
use multiversion::multiversion;

use crate::bvh::major_axis;
use crate::cast::{PACKET_RAYS, Packet, Sight};
use crate::psog::Roi;

/// A number of each ray.
pub(super) type Lanes = [f64; PACKET_RAYS];

/// No voxel: no grid has as many, see [`crate::psog::VOXEL_LIMIT`].
pub(super) const OUTSIDE: u32 = u32::MAX;

/// Unit directions of rays that go down the tree together: at most [`PACKET_RAYS`] neighbours.
///
/// Axis by axis, so that vector instructions take several rays at once.
#[derive(Clone)]
pub(super) struct Bundle {
    len: usize,
    /// Lanes that are left over repeat the last ray.
    direction: [Lanes; 3],
    /// A unit vector and the sine and cosine of an angle: all rays lie within that angle of it.
    cone: Option<(DVec3, [f64; 2])>,
}

impl Bundle {
    /// Rays in some directions, 1 to [`PACKET_RAYS`].
    pub(super) fn new(directions: impl IntoIterator<Item = DVec3>) -> Self {
        let mut bundle = Self { len: 0, direction: [[0.0; PACKET_RAYS]; 3], cone: None };
        for direction in directions {
            (0..3).for_each(|axis| bundle.direction[axis][bundle.len..].fill(direction[axis]));
            bundle.len += 1;
        }
        bundle
    }

    /// The same with the cone around its rays, for [`Self::misses`].
    pub(super) fn with_cone(mut self) -> Self {
        let sum: DVec3 = (0..self.len).map(|lane| self.direction(lane)).sum();
        let axis = sum.normalize_or(DVec3::X);
        let cos = (0..self.len).map(|lane| self.direction(lane).dot(axis)).fold(1.0, f64::min);
        // The margin is many times the rounding.
        let cos = cos - 1e-6;
        self.cone = (cos > 0.5).then(|| (axis, [(1.0 - cos * cos).sqrt(), cos]));
        self
    }

    /// Direction of a ray.
    fn direction(&self, lane: usize) -> DVec3 {
        DVec3::from_array([0, 1, 2].map(|axis| self.direction[axis][lane]))
    }

    /// Direction of each ray.
    #[cfg(test)]
    pub(super) fn directions(&self) -> impl Iterator<Item = DVec3> {
        (0..self.len).map(|lane| self.direction(lane))
    }

    /// Becomes the rays of another bundle turned, as `rotation * direction` turns one.
    pub(super) fn turn(&mut self, other: &Self, rotation: &DMat3) {
        self.len = other.len;
        turn(&other.direction, rotation, &mut self.direction);
    }

    /// The rays in bundles whose rays agree in the signs of their components and in the largest one:
    /// as a fast packet needs, each with the lanes of its rays. Nearly always that is the bundle as it is.
    pub(super) fn each_way(&self, mut done: impl FnMut(&Self, &[usize])) {
        let way = |lane: &usize| {
            let direction = self.direction(*lane).as_vec3();
            (major_axis(direction), direction.signum().to_array().map(f32::to_bits))
        };
        let mut lanes: [usize; PACKET_RAYS] = std::array::from_fn(|lane| lane);
        let lanes = &mut lanes[..self.len];
        if agree(&self.direction) {
            return done(self, lanes);
        }
        lanes.sort_by_key(way);
        for lanes in lanes.chunk_by(|a, b| way(a) == way(b)) {
            done(&Self::new(lanes.iter().map(|&lane| self.direction(lane))), lanes);
        }
    }

    /// How far rays from `origin` reach until the last of them has left the grid, in metres.
    pub(super) fn reach(&self, origin: DVec3, roi: &Roi) -> f64 {
        let mut leave = [0.0; PACKET_RAYS];
        leave_box(origin, &self.direction, roi, &mut leave);
        leave.into_iter().fold(0.0, f64::max)
    }

    /// [`Roi::voxel_of_hit`] of the points at distances `t` from `origin`; [`OUTSIDE`] for `None`.
    pub(super) fn voxels_of_hits(
        &self,
        origin: DVec3,
        t: &Lanes,
        roi: &Roi,
        voxels: &mut [u32; PACKET_RAYS],
    ) {
        voxels_of_hits(origin, &self.direction, t, roi, voxels);
    }

    /// Number of rays.
    pub(super) fn len(&self) -> usize {
        self.len
    }

    /// Whether all rays surely miss what is seen from where they start.
    pub(super) fn misses(&self, sight: &Sight) -> bool {
        self.cone.is_some_and(|(axis, angle)| sight.misses_cone(axis, angle))
    }

    /// Makes the rays from `origin` a packet; hits count up to `t_max`.
    pub(super) fn gather(&self, origin: DVec3, t_max: f32, packet: &mut Packet) {
        let mut direction = [[0.0; PACKET_RAYS]; 3];
        for (single, double) in direction.iter_mut().zip(&self.direction) {
            for (single, double) in single.iter_mut().zip(double) {
                *single = *double as f32;
            }
        }
        packet.gather_from(origin.as_vec3(), &direction, self.len, t_max);
    }
}

/// Whether rays agree in the signs of their components and in which of two is the larger one, in `f32`.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn agree([x, y, z]: &[Lanes; 3]) -> bool {
    let (mut any, mut all) = (0, u32::MAX);
    for lane in 0..PACKET_RAYS {
        let [x, y, z] = [x[lane] as f32, y[lane] as f32, z[lane] as f32];
        let mut way = 0;
        for (bit, c) in [x, y, z].into_iter().enumerate() {
            way |= (c.to_bits() >> 31) << bit;
        }
        for (bit, (a, b)) in [(x, y), (x, z), (y, z)].into_iter().enumerate() {
            way |= u32::from(a.abs() > b.abs()) << (3 + bit);
        }
        any |= way;
        all &= way;
    }
    any == all
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn turn([x, y, z]: &[Lanes; 3], rotation: &DMat3, turned: &mut [Lanes; 3]) {
    for (axis, turned) in turned.iter_mut().enumerate() {
        let row = rotation.row(axis);
        for lane in 0..PACKET_RAYS {
            turned[lane] = row.x * x[lane] + row.y * y[lane] + row.z * z[lane];
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn leave_box(origin: DVec3, direction: &[Lanes; 3], roi: &Roi, leave: &mut Lanes) {
    *leave = [f64::INFINITY; PACKET_RAYS];
    let (min, max) = (roi.min(), roi.max());
    for axis in 0..3 {
        let (below, above) = (min[axis] - origin[axis], max[axis] - origin[axis]);
        for lane in 0..PACKET_RAYS {
            let d = direction[axis][lane];
            leave[lane] = leave[lane].min((below / d).max(above / d));
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn voxels_of_hits(
    origin: DVec3,
    direction: &[Lanes; 3],
    t: &Lanes,
    roi: &Roi,
    voxels: &mut [u32; PACKET_RAYS],
) {
    let mut point = [[0.0; PACKET_RAYS]; 3];
    for axis in 0..3 {
        for lane in 0..PACKET_RAYS {
            point[axis][lane] = origin[axis] + direction[axis][lane] * t[lane];
        }
    }
    let mut push = [0.0; PACKET_RAYS];
    let [x, y, z] = &point;
    for lane in 0..PACKET_RAYS {
        let [x, y, z] = [x[lane] - origin.x, y[lane] - origin.y, z[lane] - origin.z];
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        push[lane] = if inverse < f64::INFINITY && inverse > 0.0 { inverse } else { 0.0 };
    }
    for axis in 0..3 {
        for lane in 0..PACKET_RAYS {
            let along = (point[axis][lane] - origin[axis]) * push[lane];
            point[axis][lane] += along * crate::psog::PUSH;
        }
    }
    roi.voxels_of(&point, voxels);
}
