//! Single rays of callers who bring their own instead of sensors: closest hits, occlusion and counts in a frame.
//!
//! A frame has a tree over the boxes of its instances, so that a ray goes down the trees of those few that it passes.
//! Eight boxes, or the edges of eight triangles, are tested at once; triangles whose edges a ray passes go to
//! `Ray::intersect`, so the bits are those of a loop over all triangles.

mod descent;
mod lanes;

use std::sync::Arc;

use glam::DVec3;
use multiversion::multiversion;
use multiversion::target::match_target;
use rayon::prelude::*;

use super::bundle::SLACK;
use crate::bvh::bvh8::{Bvh8, Node8};
use crate::bvh::bvh16::BLOCK;
use crate::bvh::{Bvh, BvhNode, Hit, Ray};
use crate::geom::{Aabb, Pose, TriangleSoup};
use crate::task::{Frame, Instance};
use descent::{STACK, Stack};

/// Rays of one parallel task.
const RAYS_A_TASK: usize = 1024;

/// Largest coordinate in metres whose products with inverses of directions stay far from the largest number.
const LARGEST: f32 = 1e17;

/// A frame that single rays are cast into; made in microseconds, but for trees that no ray has gone down before.
#[derive(Debug, Clone)]
pub struct RayScene {
    things: Vec<RayInstance>,
    upper: UpperTree,
}

/// Tree over the instances' boxes in the ego frame; blocks stand for instances.
#[derive(Debug, Clone, Default)]
struct UpperTree {
    root: Option<u32>,
    nodes: Vec<Node8>,
    largest: f32,
}

/// An instance as rays see it.
#[derive(Debug, Clone)]
struct RayInstance {
    tree: Arc<Bvh>,
    from_ego: Pose,
    first_prim: u32,
}

/// Question of a ray, which decides how far it is followed.
#[derive(Clone, Copy, PartialEq)]
enum RayQuery {
    Closest,
    Any,
    Count,
}

/// A ray in a frame of several instances.
struct FrameRays<'a> {
    upper: &'a UpperTree,
    things: &'a [RayInstance],
    origin: DVec3,
    unit: DVec3,
    wanted: RayQuery,
}

/// Hit and number of hits of one ray so far.
#[derive(Clone, Copy)]
struct RayHits {
    hit: Hit,
    count: u32,
}

impl RayHits {
    fn is_enough(&self, wanted: RayQuery) -> bool {
        wanted == RayQuery::Any && self.hit.is_hit()
    }
}

impl RayScene {
    /// Prepares a frame.
    pub fn new(frame: &Frame) -> Self {
        let mut boxes = TriangleSoup::default();
        let thing = |instance: &Instance| RayInstance {
            tree: instance.tree.clone(),
            from_ego: instance.ego_from_instance.inverse(),
            first_prim: instance.first_prim,
        };
        let things: Vec<RayInstance> = frame.instances().iter().map(thing).collect();
        for instance in frame.instances() {
            let [low, high] = box_of(instance);
            let first = boxes.vertices.len() as u32;
            boxes.vertices.extend([low, high]);
            boxes.faces.push([first, first + 1, first]);
            boxes.face_class.push(0);
        }
        Self { things, upper: UpperTree::new(&Bvh::build(&boxes, 0.0)) }
    }

    /// Triangles of all instances.
    pub fn triangle_count(&self) -> usize {
        self.things.iter().map(|thing| thing.tree.triangles.len()).sum()
    }

    /// Closest hit of every ray, in order; `[rays]`.
    ///
    /// A ray is its origin and its direction in the ego frame, metres. A hit's `t` counts in lengths of the direction, so
    /// that origin + t · direction is the point; `t_max` bounds it, and `range` bounds it in metres. Rays with an origin or
    /// a direction that is not finite, or without a direction, hit nothing. Trees are built for hits up to a distance (see
    /// [`Bvh::build`]): from farther away rounding may let a ray slip through an edge.
    pub fn closest_hits(&self, rays: &[[f32; 6]], range: f32, t_max: f32) -> Vec<Hit> {
        self.all(rays, range, t_max, RayQuery::Closest, |found| found.hit)
    }

    /// True for each ray that hits anything within `range` metres and `t_max` lengths of its direction.
    pub fn occluded(&self, rays: &[[f32; 6]], range: f32, t_max: f32) -> Vec<bool> {
        self.all(rays, range, t_max, RayQuery::Any, |found| found.hit.is_hit())
    }

    /// Number of triangles that each ray hits within `range` metres and `t_max` lengths of its direction; a ray through an
    /// edge that triangles share hits each of them.
    pub fn counts(&self, rays: &[[f32; 6]], range: f32, t_max: f32) -> Vec<u32> {
        self.all(rays, range, t_max, RayQuery::Count, |found| found.count)
    }

    /// Casts all rays. `answer` makes the result of a ray from its hits.
    fn all<T: Clone + Default + Send>(
        &self,
        rays: &[[f32; 6]],
        range: f32,
        t_max: f32,
        wanted: RayQuery,
        answer: impl Fn(RayHits) -> T + Sync,
    ) -> Vec<T> {
        let mut answers = vec![T::default(); rays.len()];
        let parts = answers.par_chunks_mut(RAYS_A_TASK).zip(rays.par_chunks(RAYS_A_TASK));
        let none = RayHits { hit: Hit::none(range), count: 0 };
        let memory = || ([none; RAYS_A_TASK], [0; STACK]);
        parts.for_each_init(memory, |(hits, stack), (answers, rays)| {
            let hits = &mut hits[..rays.len()];
            hits.fill(none);
            cast_all(self, rays, t_max, wanted, hits, stack);
            for (to, found) in answers.iter_mut().zip(hits) {
                *to = answer(*found);
            }
        });
        answers
    }
}

impl UpperTree {
    /// From a tree in which each box is a triangle with the same two corners.
    fn new(boxes: &Bvh) -> Self {
        let Bvh8 { root, nodes, blocks, largest } = boxes.bvh8();
        let node = |child: u32| match child & BLOCK {
            0 => child,
            _ => nodes.len() as u32 + (child ^ BLOCK),
        };
        let mut own = nodes.clone();
        own.iter_mut().for_each(|node_8| node_8.map_children(node));
        own.extend(blocks.iter().map(|block| {
            let mut leaf = Node8::EMPTY;
            for slot in 0..block.count {
                let triangle = block.triangle(slot as usize);
                let Aabb { min, max } = Bvh::padded_box(&triangle, boxes.pad);
                let node = BvhNode { min: min.into(), first: 0, max: max.into(), count: 1 };
                leaf.set(slot as usize, &node, BLOCK | triangle.prim);
            }
            leaf
        }));
        Self { root: root.map(node), nodes: own, largest: *largest }
    }
}

/// Closest hits, or numbers of hits, of rays within the distances that `hits` begin with.
#[multiversion(targets("x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt"))]
fn cast_all(
    scene: &RayScene,
    rays: &[[f32; 6]],
    t_max: f32,
    wanted: RayQuery,
    hits: &mut [RayHits],
    stack: &mut Stack,
) {
    for (&[x, y, z, dx, dy, dz], found) in rays.iter().zip(hits) {
        let origin = DVec3::new(x.into(), y.into(), z.into());
        let direction = DVec3::new(dx.into(), dy.into(), dz.into());
        let length = direction.length_squared().sqrt();
        if !(origin.is_finite() && length.is_finite() && length > 0.0) {
            continue;
        }
        found.hit.t = (f64::from(t_max) * length).min(f64::from(found.hit.t)) as f32;
        let unit = direction / length;
        if let [thing] = &scene.things[..] {
            let ray = thing.ray(origin, unit, found.hit.t);
            match_target! {
                "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt" => {
                    descent::avx2::triangles_hit(&thing.tree, thing.first_prim, &ray, wanted, found, stack, 0)
                }
                _ => descent::plain::triangles_hit(&thing.tree, thing.first_prim, &ray, wanted, found, stack, 0),
            }
        } else {
            let ray = Ray::new(origin.as_vec3(), unit.as_vec3(), found.hit.t);
            let frame =
                FrameRays { upper: &scene.upper, things: &scene.things, origin, unit, wanted };
            match_target! {
                "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt" => {
                    descent::avx2::instances_hit(&frame, &ray, found, stack)
                }
                _ => descent::plain::instances_hit(&frame, &ray, found, stack),
            }
        }
        if found.hit.is_hit() {
            found.hit.t = (f64::from(found.hit.t) / length) as f32;
        }
    }
}

impl RayInstance {
    /// A ray of the ego frame in the tree's.
    #[inline(always)]
    fn ray(&self, origin: DVec3, unit: DVec3, t_max: f32) -> Ray {
        let origin = self.from_ego.apply(origin).as_vec3();
        Ray::new(origin, (self.from_ego.rotation * unit).as_vec3(), t_max)
    }
}

/// Corners of an instance's box in the ego frame, grown by the rounding of rays that are taken to its tree.
fn box_of(instance: &Instance) -> [[f32; 3]; 2] {
    let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
    if let Some(bounds) = instance.tree.bounds() {
        let sides = [bounds.min.as_dvec3(), bounds.max.as_dvec3()];
        for corner in 0..8 {
            let of = |axis: usize| sides[corner >> axis & 1][axis];
            let at = instance.ego_from_instance.apply(DVec3::new(of(0), of(1), of(2)));
            (low, high) = (low.min(at), high.max(at));
        }
        let own = sides[0].abs().max(sides[1].abs()).max_element();
        let largest = own + low.abs().max(high.abs()).max_element();
        let slack = f64::from(instance.tree.pad) + 4.0 * f64::from(SLACK) * largest;
        (low, high) = (low - slack, high + slack);
    }
    [low.as_vec3().to_array(), high.as_vec3().to_array()]
}

/// Closest hits in a frame that is cast into once; see [`RayScene::closest_hits`].
pub fn cast_rays(frame: &Frame, rays: &[[f32; 6]], range: f32) -> Vec<Hit> {
    RayScene::new(frame).closest_hits(rays, range, f32::INFINITY)
}

#[cfg(test)]
mod tests;
