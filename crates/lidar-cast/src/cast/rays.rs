//! Single rays of callers who bring their own instead of sensors: closest hits, occlusion and counts in a frame.
//!
//! A frame has a tree over the boxes of its instances, so that a ray goes down the trees of those few that it passes.
//! Eight boxes, or the edges of eight triangles, are tested at once; triangles whose edges a ray passes go to
//! `Ray::intersect`, so the bits are those of a loop over all triangles.

mod descent;
mod lanes;
mod order;

use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};
use multiversion::multiversion;
use multiversion::target::match_target;
use rayon::prelude::*;

use super::bundle::SLACK;
use super::walk::Instructions;
use crate::bvh::bvh8::{Bvh8, Node8};
use crate::bvh::bvh16::BLOCK;
use crate::bvh::{Bvh, BvhNode, Hit, Ray};
use crate::geom::{Aabb, Pose, TriangleSoup};
use crate::task::{Frame, Instance};
use descent::STACK;
use lanes::W;

const RAYS_A_TASK: usize = 1024;
/// Least cosine between rays that go down together.
const ALIKE: f64 = 0.97;
/// How far from each other rays that go down together may begin, as a share of the scene's extent.
const NEAR: f64 = 0.05;
/// Largest coordinate in metres whose products with inverses of directions stay far from the largest number.
const LARGEST: f32 = 1e16;

/// A frame that single rays are cast into; made in microseconds, but for trees that no ray has gone down before.
#[derive(Debug, Clone)]
pub struct RayScene {
    things: Vec<RayInstance>,
    upper: UpperTree,
    /// Box of all in the ego frame.
    bounds: Aabb,
    /// Largest coordinate, without its sign, of boxes in any frame.
    largest: f32,
    instructions: Instructions,
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
    /// True if the axes are turned against those of the ego frame.
    is_turned: bool,
    first_prim: u32,
}

/// Question of a ray, which decides how far it is followed.
#[derive(Clone, Copy, PartialEq)]
enum RayQuery {
    Closest,
    Any,
    Count,
}

struct FrameRays<'a> {
    upper: &'a UpperTree,
    things: &'a [RayInstance],
    origins: [DVec3; W],
    units: [DVec3; W],
    /// In the ego frame.
    rays: [Ray; W],
    wanted: RayQuery,
}

impl FrameRays<'_> {
    /// Tells whether the rays of `mask` begin within `near` metres of the first and point where it does.
    #[inline(always)]
    fn are_alike(&self, mask: u32, near: f64) -> bool {
        let first = mask.trailing_zeros() as usize % W;
        let (origin, unit) = (self.origins[first], self.units[first]);
        let mut alike = true;
        for lane in 0..W {
            let is_near = (self.origins[lane] - origin).abs().max_element() <= near;
            alike &= mask >> lane & 1 == 0 || is_near && self.units[lane].dot(unit) > ALIKE;
        }
        alike
    }
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

    /// Metres within which a ray still looks; below 0 it does not.
    #[inline(always)]
    fn reach(&self, wanted: RayQuery) -> f32 {
        if self.is_enough(wanted) { -1.0 } else { self.hit.t }
    }
}

impl RayScene {
    /// Prepares a frame.
    pub fn new(frame: &Frame) -> Self {
        let mut boxes = TriangleSoup::default();
        let thing = |instance: &Instance| RayInstance {
            tree: instance.tree.clone(),
            from_ego: instance.ego_from_instance.inverse(),
            is_turned: instance.ego_from_instance.rotation != DMat3::IDENTITY,
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
        let upper = Bvh::build(&boxes, 0.0);
        let all = things.iter().filter_map(|thing| thing.tree.bounds()).chain(upper.bounds());
        let of = |bounds: Aabb| bounds.min.abs().max(bounds.max.abs()).max_element();
        let largest = all.map(of).fold(0.0, f32::max);
        let bounds = upper.bounds().unwrap_or(Aabb::EMPTY);
        Self {
            things,
            upper: UpperTree::new(&upper),
            bounds,
            largest,
            instructions: Instructions::Best,
        }
    }

    /// A copy that uses other instructions than the best; AVX-512 is not used.
    #[cfg(test)]
    fn with_instructions(self, instructions: Instructions) -> Self {
        Self { instructions, ..self }
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
        let cast = |rays: &[[f32; 6]], answers: &mut [T]| {
            let inputs = RayInputs { rays, range, t_max, wanted };
            cast_all(self, &inputs, |ray, found| answers[ray] = answer(found));
        };
        let parts = answers.par_chunks_mut(RAYS_A_TASK);
        let Some(order) = order::order_of(rays, self) else {
            parts.zip(rays.par_chunks(RAYS_A_TASK)).for_each(|(answers, rays)| cast(rays, answers));
            return answers;
        };
        parts.zip(order.par_chunks(RAYS_A_TASK)).for_each(|(answers, order)| {
            let rays: Vec<[f32; 6]> = order.iter().map(|&ray| rays[ray as usize]).collect();
            cast(&rays, answers);
        });
        let mut in_order = vec![T::default(); rays.len()];
        for (ray, answer) in order.into_iter().zip(answers) {
            in_order[ray as usize] = answer;
        }
        in_order
    }

    /// Hits of one ray, by the reference: where products of coordinates may be no numbers.
    #[cold]
    fn by_reference(&self, origin: DVec3, unit: DVec3, wanted: RayQuery, found: &mut RayHits) {
        for thing in &self.things {
            let ray = thing.ray(origin, unit, found.hit.t);
            if wanted == RayQuery::Count {
                for triangle in &thing.tree.triangles {
                    let mut hit = Hit::none(ray.t_max);
                    ray.intersect(triangle, thing.tree.pad, thing.first_prim, &mut hit);
                    found.count += u32::from(hit.is_hit());
                }
            } else {
                thing.tree.closer_hit(&ray, thing.first_prim, &mut found.hit);
            }
        }
    }
}

/// Rays and the question that is asked of them.
struct RayInputs<'a> {
    rays: &'a [[f32; 6]],
    range: f32,
    t_max: f32,
    wanted: RayQuery,
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
            for slot in 0..block.valid.count_ones() as usize {
                let triangle = block.triangle(slot);
                let Aabb { min, max } = Bvh::padded_box(&triangle, boxes.pad);
                let node = BvhNode { min: min.into(), first: 0, max: max.into(), count: 1 };
                leaf.set(slot, &node, BLOCK | triangle.prim);
            }
            leaf
        }));
        Self { root: root.map(node), nodes: own, largest: *largest }
    }
}

/// Hits of rays, each given to `answer` with the number of the ray.
#[multiversion(targets("x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt"))]
fn cast_all(scene: &RayScene, inputs: &RayInputs<'_>, mut answer: impl FnMut(usize, RayHits)) {
    let RayInputs { rays, range, t_max, wanted } = *inputs;
    let mut stack = [0; STACK];
    let near = NEAR * f64::from((scene.bounds.max - scene.bounds.min).max_element());
    let mut frame = FrameRays {
        upper: &scene.upper,
        things: &scene.things,
        origins: [DVec3::ZERO; W],
        units: [DVec3::X; W],
        rays: [Ray::new(Vec3::ZERO, Vec3::X, 0.0); W],
        wanted,
    };
    for (first, rays) in (0..).step_by(W).zip(rays.chunks(W)) {
        let (mut lengths, mut mask) = ([1.0; W], 0);
        let mut found = [RayHits { hit: Hit::none(range), count: 0 }; W];
        for (lane, &[x, y, z, dx, dy, dz]) in rays.iter().enumerate() {
            let origin = DVec3::new(x.into(), y.into(), z.into());
            let direction = DVec3::new(dx.into(), dy.into(), dz.into());
            let length = direction.length_squared().sqrt();
            if origin.is_finite() && length.is_finite() && length > 0.0 {
                let t_max = (f64::from(t_max) * length).min(f64::from(range)) as f32;
                found[lane].hit.t = t_max;
                let unit = direction / length;
                lengths[lane] = length;
                if scene.largest + origin.as_vec3().abs().max_element() > LARGEST {
                    scene.by_reference(origin, unit, wanted, &mut found[lane]);
                    continue;
                }
                (frame.origins[lane], frame.units[lane]) = (origin, unit);
                frame.rays[lane] = match &scene.things[..] {
                    [thing] => thing.ray(origin, unit, t_max),
                    _ => Ray::new(origin.as_vec3(), unit.as_vec3(), t_max),
                };
                mask |= 1 << lane;
            }
        }
        let thing = match &scene.things[..] {
            [thing] => Some((thing, &frame.rays)),
            _ => None,
        };
        let together = frame.are_alike(mask, near);
        let found = &mut found;
        match_target! {
            "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt" => {
                if scene.instructions == Instructions::Plain {
                    descent::plain::packet_hits(&frame, thing, mask, together, found, &mut stack, 0)
                } else {
                    descent::avx2::packet_hits(&frame, thing, mask, together, found, &mut stack, 0)
                }
            }
            _ => descent::plain::packet_hits(&frame, thing, mask, together, found, &mut stack, 0),
        }
        for (lane, found) in found.iter_mut().enumerate().take(rays.len()) {
            if found.hit.is_hit() {
                found.hit.t = (f64::from(found.hit.t) / lengths[lane]) as f32;
            }
            answer(first + lane, *found);
        }
    }
}

impl RayInstance {
    /// A ray of the ego frame in the tree's.
    #[inline(always)]
    fn ray(&self, origin: DVec3, unit: DVec3, t_max: f32) -> Ray {
        // A product with the unit matrix gives the same numbers.
        let (origin, unit) = if self.is_turned {
            (self.from_ego.apply(origin), self.from_ego.rotation * unit)
        } else {
            (origin + self.from_ego.translation, unit)
        };
        Ray::new(origin.as_vec3(), unit.as_vec3(), t_max)
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
