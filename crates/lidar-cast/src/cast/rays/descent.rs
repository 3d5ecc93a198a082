//! The way of one ray down the trees of a frame, compiled once for each set of instructions.

use super::lanes;
use super::{FrameRays, RayHits, RayInstance, RayQuery};
use crate::bvh::bvh8::{Block8, Node8};
use crate::bvh::bvh16::BLOCK;
use crate::bvh::{Bvh, FAR_INVERSE, Hit, Ray, axes_of};

/// Rounding of a box's side, as a share of the largest coordinate: 2⁻²³ of side and origin, with room.
const SLACK: f32 = 1e-6;

/// Entries of a stack, a power of two: seven siblings on each of 64 levels in a tree, and in the tree of instances.
pub(super) const STACK: usize = 1024;

/// Parts of trees that are left to visit: where they begin, as the bits of a number that is not negative, and below them 32 bits
/// of the child; so that the least entry is the nearest.
pub(super) type Stack = [u64; STACK];

macro_rules! per_target {
    ($($(#[$meta:meta])* fn $name:ident $args:tt $(-> $result:ty)? $body:block)*) => {
        #[cfg(target_arch = "x86_64")]
        pub(super) mod avx2 {
            use super::lanes::avx2::*;
            use super::*;
            /// A ray as boxes see it.
            pub struct RayLanes { pub inverse: [V; 3], pub enter: [V; 3], pub leave: [V; 3], pub near: [usize; 3] }
            $($(#[$meta])*
            #[inline]
            #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
            pub fn $name $args $(-> $result)? $body)*
        }
        pub(super) mod plain {
            use super::lanes::plain::*;
            use super::*;
            /// A ray as boxes see it.
            pub struct RayLanes { pub inverse: [V; 3], pub enter: [V; 3], pub leave: [V; 3], pub near: [usize; 3] }
            $($(#[$meta])*
            #[inline]
            pub fn $name $args $(-> $result)? $body)*
        }
    };
}

per_target! {
    /// A ray on its way down a tree whose largest coordinate is given.
    fn lanes(ray: &Ray, largest: f32) -> RayLanes {
        let slack = SLACK * (largest + ray.origin.abs().max_element());
        let (origin, inverse) = (ray.origin.to_array(), ray.inverse.to_array());
        let zero = splat(0.0);
        let mut lanes = RayLanes { inverse: [zero; 3], enter: [zero; 3], leave: [zero; 3], near: [0; 3] };
        for axis in 0..3 {
            let inverse = inverse[axis].clamp(-FAR_INVERSE, FAR_INVERSE);
            let (at, wide) = (-origin[axis] * inverse, slack * inverse.abs());
            lanes.inverse[axis] = splat(inverse);
            lanes.enter[axis] = splat(at - wide);
            lanes.leave[axis] = splat(at + wide);
            lanes.near[axis] = if inverse < 0.0 { axis + 3 } else { axis };
        }
        lanes
    }

    /// Visits a node: the nearest child that begins within `reach` comes back, the others go on the stack, nearest on top.
    fn children(node: &Node8, ray: &RayLanes, reach: f32, stack: &mut Stack, top: &mut usize) -> Option<u32> {
        let side = |row: usize| load(&node.rows[row % 8]);
        let [nx, ny, nz] = ray.near;
        let (fx, fy, fz) = ((nx + 3) % 6, (ny + 3) % 6, (nz + 3) % 6);
        let [x, y, z] = ray.inverse;
        let near = max(
            max(fma(side(nx), x, ray.enter[0]), fma(side(ny), y, ray.enter[1])),
            max(fma(side(nz), z, ray.enter[2]), splat(0.0)),
        );
        let far = min(
            min(fma(side(fx), x, ray.leave[0]), fma(side(fy), y, ray.leave[1])),
            min(fma(side(fz), z, ray.leave[2]), splat(reach)),
        );
        let mut seen = at_most(near, far);
        if seen == 0 {
            return None;
        }
        let first = seen.trailing_zeros() as usize;
        seen &= seen - 1;
        if seen == 0 {
            return Some(node.child(first));
        }
        let begins = store(near);
        let entry = |slot: usize| u64::from(begins[slot % 8].to_bits()) << 32 | u64::from(node.child(slot));
        let (from, mut nearest) = (*top, entry(first));
        while seen != 0 {
            let entry = entry(seen.trailing_zeros() as usize);
            seen &= seen - 1;
            let other = entry.max(nearest);
            nearest = entry.min(nearest);
            let mut at = *top;
            while at > from && stack[(at - 1) % STACK] < other {
                stack[at % STACK] = stack[(at - 1) % STACK];
                at -= 1;
            }
            stack[at % STACK] = other;
            *top += 1;
        }
        Some(nearest as u32)
    }

    /// A bit for each triangle of a block that `Ray::intersect` does not refuse for its edges: its sums, eight at once.
    fn edges_passed(block: &Block8, ray: &Ray) -> u32 {
        let [x, y, z] = axes_of(ray.major);
        let at = [x, y, z].map(|axis| splat(ray.origin[axis]));
        let (along, across) = (splat(ray.shear[0]), splat(ray.shear[1]));
        let corner = |k: usize| {
            let corner = &block.corners[k];
            let depth = sub(load(&corner[z]), at[2]);
            (
                sub(sub(load(&corner[x]), at[0]), mul(along, depth)),
                sub(sub(load(&corner[y]), at[1]), mul(across, depth)),
            )
        };
        let ((ax, ay), (bx, by), (cx, cy)) = (corner(0), corner(1), corner(2));
        let u = sub(mul(cx, by), mul(cy, bx));
        let v = sub(mul(ax, cy), mul(ay, cx));
        let w = sub(mul(bx, ay), mul(by, ax));
        let zero = splat(0.0);
        let (least, most) = (min(u, min(v, w)), max(u, max(v, w)));
        let refused = (below(least, zero) & below(zero, most)) | same(add(add(u, v), w), zero);
        !refused & 0xff
    }

    /// Hits of a ray in a tree, whose faces are numbered from `first_prim` on. The stack is empty again at the end.
    fn triangles_hit(
        bvh: &Bvh,
        first_prim: u32,
        ray: &Ray,
        wanted: RayQuery,
        found: &mut RayHits,
        stack: &mut Stack,
        base: usize,
    ) -> () {
        let tree = bvh.bvh8();
        let Some(mut child) = tree.root else { return };
        let (lanes, mut top, mut reach) = (lanes(ray, tree.largest), base, found.hit.t);
        loop {
            if child & BLOCK == 0 {
                if let Some(nearest) = children(&tree.nodes[child as usize], &lanes, reach, stack, &mut top) {
                    child = nearest;
                    continue;
                }
            } else {
                let block = &tree.blocks[(child ^ BLOCK) as usize];
                let mut passed = edges_passed(block, ray);
                while passed != 0 {
                    let triangle = block.triangle(passed.trailing_zeros() as usize);
                    passed &= passed - 1;
                    if wanted == RayQuery::Count {
                        let mut hit = Hit::none(ray.t_max);
                        ray.intersect(&triangle, bvh.pad, first_prim, &mut hit);
                        found.count += u32::from(hit.is_hit());
                    } else {
                        ray.intersect(&triangle, bvh.pad, first_prim, &mut found.hit);
                        reach = found.hit.t;
                    }
                }
                if found.is_enough(wanted) {
                    return;
                }
            }
            loop {
                if top == base {
                    return;
                }
                top -= 1;
                let entry = stack[top % STACK];
                if f32::from_bits((entry >> 32) as u32) <= reach {
                    child = entry as u32;
                    break;
                }
            }
        }
    }

    /// Hits of a ray in a frame of several instances.
    fn instances_hit(
        frame: &FrameRays<'_>,
        ray: &Ray,
        found: &mut RayHits,
        stack: &mut Stack,
    ) -> () {
        let Some(mut child) = frame.upper.root else { return };
        let (lanes, mut top) = (lanes(ray, frame.upper.largest), 0);
        loop {
            if child & BLOCK == 0 {
                let node = &frame.upper.nodes[child as usize];
                if let Some(nearest) = children(node, &lanes, found.hit.t, stack, &mut top) {
                    child = nearest;
                    continue;
                }
            } else {
                let thing: &RayInstance = &frame.things[(child ^ BLOCK) as usize];
                let ray = thing.ray(frame.origin, frame.unit, found.hit.t);
                triangles_hit(&thing.tree, thing.first_prim, &ray, frame.wanted, found, stack, top);
                if found.is_enough(frame.wanted) {
                    return;
                }
            }
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let entry = stack[top % STACK];
                if f32::from_bits((entry >> 32) as u32) <= found.hit.t {
                    child = entry as u32;
                    break;
                }
            }
        }
    }
}
