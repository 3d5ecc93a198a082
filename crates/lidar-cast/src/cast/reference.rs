//! Closest hits, a beam at a time through the binary tree of each instance: the specification.

use glam::Vec3;
use rayon::prelude::*;

use super::sight::SightSphere;
use crate::bvh::{Bvh, Hit, MAX_DEPTH, Ray};
use crate::geom::Pose;
use crate::sensor::BeamTable;
use crate::task::{DevicePose, Frame, beam_direction, beam_origin};

const BEAMS_PER_TASK: usize = 1024;

/// Closest hit of every beam in a frame, ordered by sensor, then direction; `[sensors × directions]`.
///
/// Each instance is cast into in its own frame, and of all hits the closest counts; of equal distances,
/// the lowest face index of the frame. `sensors` take sensor coordinates to the ego frame.
///
/// CPU twin of `shaders/cast_closest.wgsl`.
pub fn cast_frame_closest(
    sensors: &[Pose],
    table: &BeamTable,
    frame: &Frame,
    range: f32,
) -> Vec<Hit> {
    let mut hits = vec![Hit::none(range); sensors.len() * table.directions().len()];
    for instance in frame.instances() {
        let poses: Vec<DevicePose> = sensors.iter().map(|s| instance.pose_of(s)).collect();
        let rows = poses.iter().zip(hits.chunks_mut(table.directions().len())).collect();
        cast_rows(rows, table.directions(), &instance.tree, instance.first_prim, range);
    }
    hits
}

/// [`cast_frame_closest`] of one beam.
pub fn closest_hit_in(frame: &Frame, sensor: &Pose, direction: [f32; 3], range: f32) -> Hit {
    let mut hit = Hit::none(range);
    for instance in frame.instances() {
        let pose = instance.pose_of(sensor);
        let ray = Ray::new(beam_origin(&pose), beam_direction(&pose, direction), range);
        instance.tree.closer_hit(&ray, instance.first_prim, &mut hit);
    }
    hit
}

/// Closest hit of every beam among the triangles of one tree; `poses` lead to its frame.
pub fn cast_closest(poses: &[DevicePose], table: &BeamTable, bvh: &Bvh, range: f32) -> Vec<Hit> {
    let directions = table.directions();
    let mut hits = vec![Hit::none(range); poses.len() * directions.len()];
    let rows = poses.iter().zip(hits.chunks_mut(directions.len())).collect();
    cast_rows(rows, directions, bvh, 0, range);
    hits
}

/// Replaces the hits of sensors by closer ones among the triangles of a tree, numbered from `first_prim`
/// on; no hit lies beyond `range`.
pub(super) fn cast_rows(
    sensors: Vec<(&DevicePose, &mut [Hit])>,
    directions: &[[f32; 3]],
    bvh: &Bvh,
    first_prim: u32,
    range: f32,
) {
    sensors.into_par_iter().for_each(|(pose, row)| {
        let Some(sight) = SightSphere::new(pose, bvh, range) else { return };
        let origin = beam_origin(pose);
        let tasks = row.par_chunks_mut(BEAMS_PER_TASK).zip(directions.par_chunks(BEAMS_PER_TASK));
        tasks.for_each(|(row, directions)| {
            for (hit, &direction) in row.iter_mut().zip(directions) {
                if !sight.misses(direction, hit.t) {
                    let ray = Ray::new(origin, beam_direction(pose, direction), hit.t);
                    bvh.closer_hit(&ray, first_prim, hit);
                }
            }
        });
    });
}

impl Bvh {
    /// The closest hit with 0 < t ≤ `t_max`; equal distances go to the lowest face index.
    pub fn closest_hit(&self, ray: &Ray) -> Hit {
        let mut best = Hit::none(ray.t_max);
        self.closer_hit(ray, 0, &mut best);
        best
    }

    /// Replaces `best` by the closest hit, if that is closer, or equally close with a lower face index;
    /// faces are numbered from `first_prim` on.
    ///
    /// CPU twin of `closer_hit` in `shaders/cast_closest.wgsl`.
    pub fn closer_hit(&self, ray: &Ray, first_prim: u32, best: &mut Hit) {
        if self.nodes.is_empty() {
            return;
        }
        let mut stack = [0_u32; MAX_DEPTH];
        let mut depth = 0;
        let mut index = 0_usize;
        loop {
            let node = &self.nodes[index];
            if node.count > 0 {
                let first = node.first as usize;
                for triangle in &self.triangles[first..first + node.count as usize] {
                    ray.intersect(triangle, self.pad, first_prim, best);
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
                return;
            }
            depth -= 1;
            index = stack[depth] as usize;
        }
    }

    /// [`Self::closest_hit`] by testing every triangle: the definition that the tree must meet.
    pub fn closest_hit_brute_force(&self, ray: &Ray) -> Hit {
        let mut best = Hit::none(ray.t_max);
        for triangle in &self.triangles {
            ray.intersect(triangle, self.pad, 0, &mut best);
        }
        best
    }

    fn enter(&self, node: usize, ray: &Ray) -> (f32, f32) {
        let node = &self.nodes[node];
        ray.slab(Vec3::from(node.min), Vec3::from(node.max))
    }
}
