//! Closest hits of any rays in a frame, for callers who bring their own instead of sensors.
//!
//! A [`Firing`] is a group of rays that leave one place at one moment: the batches that a device casts for scans.

use glam::DVec3;
use rayon::prelude::*;

use super::bundle::{BundleTree, TraversalStack, descend};
use crate::bvh::{Hit, Ray};
use crate::geom::Pose;
use crate::task::{Frame, beam_direction, beam_origin};

/// Rays of one parallel task.
const RAYS_A_TASK: usize = 1024;

/// Closest hit of every ray in a frame, in order; `[rays]`.
///
/// A ray is its origin and its direction in the ego frame, metres; a hit's `t` counts in lengths of the
/// direction, so that origin + t · direction is the point, and `range` bounds it in metres. Rays with an origin or a
/// direction that is not finite, or without a direction, hit nothing. Trees are built for hits up to a distance
/// (see [`crate::bvh::Bvh::build`]): from farther away rounding may let a ray slip through an edge.
pub fn cast_rays(frame: &Frame, rays: &[[f32; 6]], range: f32) -> Vec<Hit> {
    let from_ego: Vec<Pose> =
        frame.instances().iter().map(|instance| instance.ego_from_instance.inverse()).collect();
    let mut hits = vec![Hit::none(range); rays.len()];
    let tasks = hits.par_chunks_mut(RAYS_A_TASK).zip(rays.par_chunks(RAYS_A_TASK));
    tasks.for_each(|(hits, rays)| {
        let mut left = TraversalStack::new();
        for (hit, &[x, y, z, dx, dy, dz]) in hits.iter_mut().zip(rays) {
            let origin = DVec3::new(x.into(), y.into(), z.into());
            let direction = DVec3::new(dx.into(), dy.into(), dz.into());
            let length = direction.length();
            if !origin.is_finite() || !length.is_finite() || length == 0.0 {
                continue;
            }
            let unit = direction / length;
            for (instance, from_ego) in frame.instances().iter().zip(&from_ego) {
                let origin = from_ego.apply(origin).as_vec3();
                let ray = Ray::new(origin, (from_ego.rotation * unit).as_vec3(), hit.t);
                let (tree, first) = (&instance.tree, instance.first_prim);
                descend(tree, first, &[ray], 0.0, std::slice::from_mut(hit), &mut left);
            }
            if hit.is_hit() {
                hit.t = (f64::from(hit.t) / length) as f32;
            }
        }
    });
    hits
}

/// Rays that leave one place at the same moment, and the trees as that place sees them.
pub struct Firing<'a> {
    /// Trees that the rays may meet.
    pub targets: Vec<BundleTree<'a>>,
    /// Unit directions in the sensor's frame.
    pub rays: Vec<[f32; 3]>,
}

/// Casts firings.
pub trait FiringCaster: Send {
    /// Closest hit of every ray up to `range`, in order, with the bits of [`Firing::closest_hit`].
    ///
    /// # Errors
    /// What kept the device from it, as a sentence.
    fn closest_hits(&mut self, firings: &[Firing<'_>], range: f32) -> Result<Vec<Hit>, String>;
}

impl Firing<'_> {
    /// The closest hit of a ray of a direction, by the reference's way down each tree.
    ///
    /// CPU twin of `shaders/cast_closest.wgsl` where its sensors are firings.
    pub fn closest_hit(&self, direction: [f32; 3], range: f32) -> Hit {
        let mut hit = Hit::none(range);
        for target in &self.targets {
            let pose = target.standing.pose();
            let ray = Ray::new(beam_origin(pose), beam_direction(pose, direction), hit.t);
            target.tree.closer_hit(&ray, target.first_prim, &mut hit);
        }
        hit
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;
    use std::sync::Arc;

    use super::*;
    use crate::bvh::Bvh;
    use crate::geom::TriangleSoup;
    use crate::task::Instance;

    /// The plane x = 2, |y|, |z| ≤ 1, as two triangles, in a thing that is turned by 90° and moved.
    fn wall() -> Frame {
        let vertices = vec![[2.0, -1.0, -1.0], [2.0, 1.0, -1.0], [2.0, 1.0, 1.0], [2.0, -1.0, 1.0]];
        let faces = vec![[0, 1, 2], [0, 2, 3]];
        let soup = TriangleSoup { vertices, faces, face_class: vec![0, 0] };
        let tree = Arc::new(Bvh::build(&soup, 100.0));
        let turned = Pose::new(DVec3::new(0.0, 10.0, 0.0), 0.0, 0.0, FRAC_PI_2);
        let here =
            Instance { tree: tree.clone(), ego_from_instance: Pose::IDENTITY, first_prim: 0 };
        Frame::new([here, Instance { tree, ego_from_instance: turned, first_prim: 2 }])
    }

    #[test]
    fn a_ray_of_any_length_hits_what_stands_before_it() {
        let rays = [
            [0.0, 0.2, 0.1, 1.0, 0.0, 0.0],
            // Four metres a unit: the wall is half a unit away.
            [0.0, 0.2, 0.1, 4.0, 0.0, 0.0],
            // The turned wall is the plane y = 12.
            [0.1, 9.0, 0.5, 0.0, 2.0, 0.0],
            [0.0, 0.2, 0.1, -1.0, 0.0, 0.0],
            [f32::NAN, 0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        ];
        let hits = cast_rays(&wall(), &rays, 100.0);
        let close = |hit: &Hit, t: f32| hit.is_hit() && (hit.t - t).abs() < 1e-5;
        assert!(close(&hits[0], 2.0) && hits[0].prim < 2, "{hits:?}");
        assert!(close(&hits[1], 0.5) && hits[1].prim < 2, "{hits:?}");
        assert!(close(&hits[2], 1.5) && hits[2].prim >= 2, "{hits:?}");
        assert!(hits[3..].iter().all(|hit| !hit.is_hit()), "{hits:?}");
    }

    #[test]
    fn hits_beyond_the_range_do_not_count() {
        let ray = [0.0, 0.2, 0.1, 1.0, 0.0, 0.0];
        assert!(!cast_rays(&wall(), &[ray], 1.9)[0].is_hit());
    }
}
