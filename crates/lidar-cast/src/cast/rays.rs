//! Single rays of callers who bring their own instead of sensors: closest hits, occlusion and counts in a frame.
//!
//! A frame has a tree over the boxes of its instances, so that a ray goes down the trees of those few that it passes.
//! Sixteen boxes, or the edges of sixteen triangles, are tested at once; triangles whose edges a ray passes go to
//! `Ray::intersect`, so the bits are those of a loop over all triangles.

use std::sync::Arc;

use glam::DVec3;
use multiversion::multiversion;
use rayon::prelude::*;

use super::bundle::{RayBundle, SLACK, TraversalStack};
use crate::bvh::bvh16::{Block16, Node16, WIDTH};
use crate::bvh::{Bvh, Hit, Ray, axes_of};
use crate::geom::{Pose, TriangleSoup};
use crate::task::{Frame, Instance};

/// Rays of one parallel task.
const RAYS_A_TASK: usize = 1024;

/// A frame that single rays are cast into; made in microseconds.
#[derive(Debug, Clone)]
pub struct RayScene {
    things: Vec<RayInstance>,
    /// Tree over the instances' boxes in the ego frame. A box stands in it as a triangle with the same two corners.
    upper: Bvh,
    /// Boxes of the instances in each block of `upper`.
    leaves: Vec<Node16>,
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

/// Stacks that are kept from ray to ray.
#[derive(Default)]
struct Stacks {
    upper: TraversalStack,
    lower: TraversalStack,
    met: Vec<(f32, u32)>,
}

/// Hit and number of hits of one ray so far.
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
        let upper = Bvh::build(&boxes, 0.0);
        let leaves = upper.bvh16.blocks.iter().map(|block| block.boxes(upper.pad)).collect();
        Self { things, upper, leaves }
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
        self.all(rays, range, t_max, RayQuery::Closest, |found, length| {
            let mut hit = found.hit;
            if hit.is_hit() {
                hit.t = (f64::from(hit.t) / length) as f32;
            }
            hit
        })
    }

    /// True for each ray that hits anything within `range` metres and `t_max` lengths of its direction.
    pub fn occluded(&self, rays: &[[f32; 6]], range: f32, t_max: f32) -> Vec<bool> {
        self.all(rays, range, t_max, RayQuery::Any, |found, _| found.hit.is_hit())
    }

    /// Number of triangles that each ray hits within `range` metres and `t_max` lengths of its direction; a ray through an
    /// edge that triangles share hits each of them.
    pub fn counts(&self, rays: &[[f32; 6]], range: f32, t_max: f32) -> Vec<u32> {
        self.all(rays, range, t_max, RayQuery::Count, |found, _| found.count)
    }

    /// Casts all rays. `answer` makes the result of a ray from its hits and the length of its direction.
    fn all<T: Clone + Send>(
        &self,
        rays: &[[f32; 6]],
        range: f32,
        t_max: f32,
        wanted: RayQuery,
        answer: impl Fn(RayHits, f64) -> T + Sync,
    ) -> Vec<T> {
        let some = |rays: &[[f32; 6]]| {
            let mut stacks = Stacks::default();
            let one = |&[x, y, z, dx, dy, dz]: &[f32; 6]| {
                let origin = DVec3::new(x.into(), y.into(), z.into());
                let direction = DVec3::new(dx.into(), dy.into(), dz.into());
                let length = direction.length_squared().sqrt();
                let mut found = RayHits { hit: Hit::none(range), count: 0 };
                if origin.is_finite() && length.is_finite() && length > 0.0 {
                    found.hit.t = (f64::from(t_max) * length).min(f64::from(range)) as f32;
                    self.cast(origin, direction / length, wanted, &mut found, &mut stacks);
                }
                answer(found, length)
            };
            rays.iter().map(one).collect::<Vec<T>>()
        };
        let parts: Vec<Vec<T>> = rays.par_chunks(RAYS_A_TASK).map(some).collect();
        parts.concat()
    }

    fn cast(
        &self,
        origin: DVec3,
        unit: DVec3,
        wanted: RayQuery,
        found: &mut RayHits,
        stacks: &mut Stacks,
    ) {
        if let [thing] = &self.things[..] {
            return thing.cast(origin, unit, wanted, found, &mut stacks.lower);
        }
        let ray = Ray::new(origin.as_vec3(), unit.as_vec3(), found.hit.t);
        boxes_met(&self.upper, &self.leaves, &ray, &mut stacks.upper, &mut stacks.met);
        stacks.met.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        for &(begin, thing) in &stacks.met {
            if begin > found.hit.t || found.is_enough(wanted) {
                break;
            }
            self.things[thing as usize].cast(origin, unit, wanted, found, &mut stacks.lower);
        }
    }
}

impl RayInstance {
    fn cast(
        &self,
        origin: DVec3,
        unit: DVec3,
        wanted: RayQuery,
        found: &mut RayHits,
        left: &mut TraversalStack,
    ) {
        let origin = self.from_ego.apply(origin).as_vec3();
        let ray = Ray::new(origin, (self.from_ego.rotation * unit).as_vec3(), found.hit.t);
        triangles_hit(&self.tree, self.first_prim, &ray, wanted, found, left);
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

/// Boxes that a ray meets, with where they begin.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn boxes_met(
    upper: &Bvh,
    leaves: &[Node16],
    ray: &Ray,
    left: &mut TraversalStack,
    met: &mut Vec<(f32, u32)>,
) {
    met.clear();
    let single = RayBundle::new(ray, 0.0, upper);
    single.visit(&upper.bvh16, ray.t_max, left, |block, reach| {
        let mut begins = [0.0; WIDTH];
        let leaf = &leaves[block];
        let mut seen = single.children(leaf, *reach, &mut begins) & leaf.valid;
        while seen != 0 {
            let slot = seen.trailing_zeros() as usize % WIDTH;
            seen &= seen - 1;
            met.push((begins[slot], leaf.children[slot]));
        }
    });
}

/// Hits of a ray in a tree, whose faces are numbered from `first_prim` on.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn triangles_hit(
    bvh: &Bvh,
    first_prim: u32,
    ray: &Ray,
    wanted: RayQuery,
    found: &mut RayHits,
    left: &mut TraversalStack,
) {
    let single = RayBundle::new(ray, 0.0, bvh);
    single.visit(&bvh.bvh16, ray.t_max, left, |block, reach| {
        let block = &bvh.bvh16.blocks[block];
        let mut passed = edges_passed(block, ray) & block.valid;
        while passed != 0 {
            let slot = passed.trailing_zeros() as usize % WIDTH;
            passed &= passed - 1;
            let triangle = block.triangle(slot);
            if wanted == RayQuery::Count {
                let mut hit = Hit::none(ray.t_max);
                ray.intersect(&triangle, bvh.pad, first_prim, &mut hit);
                found.count += u32::from(hit.is_hit());
            } else {
                ray.intersect(&triangle, bvh.pad, first_prim, &mut found.hit);
            }
        }
        if wanted != RayQuery::Count {
            *reach = if found.is_enough(wanted) { -1.0 } else { found.hit.t };
        }
    });
}

/// A bit for each triangle of a block that `Ray::intersect` does not refuse for its edges: its sums, sixteen at once.
#[inline(always)]
fn edges_passed(block: &Block16, ray: &Ray) -> u16 {
    let [x, y, z] = axes_of(ray.major);
    let (origin, [along, across]) = (ray.origin.to_array(), ray.shear);
    let mut passed = 0;
    for slot in 0..WIDTH {
        let corner = |k: usize| {
            let at = &block.corners[k];
            let depth = at[z][slot] - origin[z];
            (at[x][slot] - origin[x] - along * depth, at[y][slot] - origin[y] - across * depth)
        };
        let [(ax, ay), (bx, by), (cx, cy)] = [corner(0), corner(1), corner(2)];
        let u = cx * by - cy * bx;
        let v = ax * cy - ay * cx;
        let w = bx * ay - by * ax;
        let below = (u < 0.0) | (v < 0.0) | (w < 0.0);
        let above = (u > 0.0) | (v > 0.0) | (w > 0.0);
        passed |= u16::from(!(below & above)) << slot;
    }
    passed
}

/// Closest hits in a frame that is cast into once; see [`RayScene::closest_hits`].
pub fn cast_rays(frame: &Frame, rays: &[[f32; 6]], range: f32) -> Vec<Hit> {
    RayScene::new(frame).closest_hits(rays, range, f32::INFINITY)
}

#[cfg(test)]
mod tests;
