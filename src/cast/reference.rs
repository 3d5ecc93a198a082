//! Closest hits, a beam at a time through the binary tree: the specification.

use glam::Vec3;
use rayon::prelude::*;

use crate::bvh::{Bvh, Hit, MAX_DEPTH, NO_HIT, Ray};
use crate::problem::{DevicePose, beam_direction, beam_origin};
use crate::vehicle::BeamTable;

/// Beams of one parallel task.
const BEAMS_PER_TASK: usize = 1024;

/// Closest hit of every beam, ordered by sensor, then direction; `[poses × directions]`.
///
/// CPU twin of `shaders/cast_closest.wgsl`.
pub fn cast_closest(poses: &[DevicePose], table: &BeamTable, bvh: &Bvh, range: f32) -> Vec<Hit> {
    let directions = table.directions();
    let mut hits = vec![Hit { t: range, prim: NO_HIT }; poses.len() * directions.len()];
    let rows = hits.par_chunks_mut(directions.len());
    poses.par_iter().zip(rows).for_each(|(pose, row)| {
        let origin = beam_origin(pose);
        let tasks = row.par_chunks_mut(BEAMS_PER_TASK).zip(directions.par_chunks(BEAMS_PER_TASK));
        tasks.for_each(|(row, directions)| {
            for (hit, &direction) in row.iter_mut().zip(directions) {
                let ray = Ray::new(origin, beam_direction(pose, direction), range);
                *hit = bvh.closest_hit(&ray);
            }
        });
    });
    hits
}

impl Bvh {
    /// The closest hit with 0 < t ≤ `t_max`; equal distances go to the lowest face index.
    ///
    /// CPU twin of `shaders/cast_closest.wgsl`.
    pub fn closest_hit(&self, ray: &Ray) -> Hit {
        let mut best = Hit { t: ray.t_max, prim: NO_HIT };
        if self.nodes.is_empty() {
            return best;
        }
        let mut stack = [0_u32; MAX_DEPTH];
        let mut depth = 0;
        let mut index = 0_usize;
        loop {
            let node = &self.nodes[index];
            if node.count > 0 {
                let first = node.first as usize;
                for triangle in &self.triangles[first..first + node.count as usize] {
                    ray.intersect(triangle, self.pad, &mut best);
                }
            } else {
                let left = node.first as usize;
                let (left_near, left_far) = self.enter(left, ray);
                let (right_near, right_far) = self.enter(left + 1, ray);
                // Equal to the best distance is still visited: a tie may have a lower id.
                let visit_left = left_near <= left_far && left_near <= best.t;
                let visit_right = right_near <= right_far && right_near <= best.t;
                if visit_left && visit_right {
                    let (near, far) =
                        if left_near <= right_near { (left, left + 1) } else { (left + 1, left) };
                    stack[depth] = far as u32;
                    depth += 1;
                    index = near;
                    continue;
                }
                if visit_left || visit_right {
                    index = if visit_left { left } else { left + 1 };
                    continue;
                }
            }
            if depth == 0 {
                return best;
            }
            depth -= 1;
            index = stack[depth] as usize;
        }
    }

    /// [`Self::closest_hit`] by testing every triangle: the definition that the tree must meet.
    pub fn closest_hit_brute_force(&self, ray: &Ray) -> Hit {
        let mut best = Hit { t: ray.t_max, prim: NO_HIT };
        for triangle in &self.triangles {
            ray.intersect(triangle, self.pad, &mut best);
        }
        best
    }

    fn enter(&self, node: usize, ray: &Ray) -> (f32, f32) {
        let node = &self.nodes[node];
        ray.slab(Vec3::from(node.min), Vec3::from(node.max))
    }
}
