//! A thing as one sensor sees it: a sphere around it that most beams are known to miss.

use glam::{DMat3, DVec3, Vec3};

use crate::bvh::{Bvh, PAD_SHARE};
use crate::task::{DevicePose, beam_origin};

/// Rounding of a hit test in units of 2⁻²⁰ of the largest number that enters it, with room: each of the
/// roundings of a pose, a direction, a plane's distance and a quotient is 2⁻²⁴ of such a number.
const SLACK: f64 = 8.0;
/// Rounding of (c·d)², as a share of c².
const SQUARE_SLACK: f64 = 1.0 / (1 << 18) as f64;

/// A sphere around all triangles of a tree, in the frame of a sensor.
///
/// # Why no hit is lost
/// `Ray::intersect` accepts a triangle only where the ray passes through the triangle's padded box, and
/// its t lies between entry and exit, all in rounded numbers. The root's box contains that box, so the
/// point at t lies in the root's box but for rounding of:
///
/// - pose and direction: 2⁻²⁴ of 1 a component, which moves the point by at most 2⁻²² t;
/// - origin o and bound b: 2⁻²⁴ of each;
/// - their difference and its product with the inverse: 2⁻²³ of |o| + |b|.
///
/// Together that is less than 2⁻¹⁹ (|o| + |b| + t), and the sphere is grown by four times as much,
/// 8 · 2⁻²⁰. A point at t along the unit direction d lies in the sphere (c, r) only if
/// |c|² − (c·d)² ≤ r² and c·d − r ≤ t ≤ c·d + r. A beam that violates either skips the sphere. It also
/// skips one that begins behind its best hit, where no triangle can be as close.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SightSphere {
    /// c in metres.
    pub center: [f32; 3],
    /// r in metres.
    pub radius: f32,
    /// |c|² − r² less the rounding of (c·d)²: beams of a smaller (c·d)² miss. Below 0 in the sphere.
    pub least_square: f32,
}

impl SightSphere {
    /// The tree as seen by a sensor whose `pose` takes it to the tree's frame; `None` where the tree is
    /// empty or more than `range` metres away.
    pub(crate) fn new(pose: &DevicePose, bvh: &Bvh, range: f32) -> Option<Self> {
        let bounds = bvh.bounds()?;
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let origin = beam_origin(pose).as_dvec3();
        let row = |k: usize| Vec3::from_slice(&pose.rows[k]).as_dvec3();
        // The rows of the rotation are the columns of its inverse.
        let center = DMat3::from_cols(row(0), row(1), row(2)) * (0.5 * (low + high) - origin);
        let largest =
            low.abs().max(high.abs()).max_element() + origin.abs().max_element() + f64::from(range);
        let radius = 0.5 * (high - low).length() + SLACK * f64::from(PAD_SHARE) * largest;
        if center.length() - radius > f64::from(range) {
            return None;
        }
        let square = center.length_squared();
        let least_square = square - radius * radius - SQUARE_SLACK * square;
        Some(Self {
            center: center.as_vec3().to_array(),
            radius: radius as f32,
            least_square: least_square as f32,
        })
    }

    /// True if a beam surely hits nothing here up to `t` metres; `direction` is the table's.
    #[inline(always)]
    pub(crate) fn misses(&self, direction: [f32; 3], t: f32) -> bool {
        let ([x, y, z], [dx, dy, dz]) = (self.center, direction);
        let along = x * dx + y * dy + z * dz;
        along < -self.radius || along - self.radius > t || along * along < self.least_square
    }

    /// Sphere for rays within `angle` radians around a beam (a small angle): the radius grows by the
    /// arc at its far side.
    pub(crate) fn widened(&self, angle: f32) -> Self {
        let center = DVec3::from(self.center.map(f64::from));
        let (far, radius) = (center.length(), f64::from(self.radius));
        let radius = radius + 1.01 * f64::from(angle) * (far + radius);
        let square = far * far;
        let least_square = square - radius * radius - SQUARE_SLACK * square;
        Self { radius: radius as f32, least_square: least_square as f32, ..*self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::{Hit, Ray};
    use crate::geom::{Pose, TriangleSoup};
    use crate::task::beam_direction;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A triangle of a few metres around a point.
    fn triangle(rng: &mut ChaCha8Rng, at: DVec3) -> TriangleSoup {
        let mut corner = || {
            let off = DVec3::from([0; 3].map(|_| rng.random_range(-1.5..1.5)));
            (at + off).as_vec3().to_array()
        };
        TriangleSoup {
            vertices: vec![corner(), corner(), corner()],
            faces: vec![[0, 1, 2]],
            face_class: vec![0],
        }
    }

    #[test]
    fn what_a_beam_misses_it_does_not_hit_and_most_is_missed() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mut hits, mut kept, mut beams) = (0, 0, 0);
        for far in [2.0, 20.0, 80.0, 5e4] {
            for _ in 0..100 {
                let at = DVec3::from([0; 3].map(|_| rng.random_range(-far..far)));
                let bvh = Bvh::build(&triangle(&mut rng, at), 100.0);
                let turn = [0; 3].map(|_| rng.random_range(-3.0..3.0));
                let off = DVec3::from([0; 3].map(|_| rng.random_range(-30.0..30.0)));
                let pose = DevicePose::from(&Pose::new(at + off, turn[0], turn[1], turn[2]));
                let range = rng.random_range(5.0..100.0);
                let sight = SightSphere::new(&pose, &bvh, range);
                for _ in 0..200 {
                    // Towards the triangle, and past it.
                    let rotation = DMat3::from_cols_array_2d(
                        &pose.rows.map(|r| [r[0], r[1], r[2]].map(f64::from)),
                    );
                    let miss = DVec3::from([0; 3].map(|_| rng.random_range(-2.5..2.5)));
                    let direction = (rotation * (miss - off)).normalize().as_vec3().to_array();
                    let ray = Ray::new(beam_origin(&pose), beam_direction(&pose, direction), range);
                    let hit = bvh.closest_hit_brute_force(&ray);
                    let misses = sight.is_none_or(|sight| sight.misses(direction, range));
                    assert!(!(hit.is_hit() && misses), "{far} m: {hit:?}");
                    if let (Some(sight), true) = (sight, hit.is_hit()) {
                        assert!(!sight.misses(direction, hit.t));
                    }
                    hits += u32::from(hit.is_hit());
                    kept += u32::from(!misses);
                    beams += 1;
                }
            }
        }
        assert!(hits > 1000 && kept < beams / 2, "{hits} hits, {kept} of {beams} kept");
        assert_eq!(Hit::none(3.0).t, 3.0);
    }
}
