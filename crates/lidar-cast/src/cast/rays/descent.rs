//! The way of one ray down the trees of a frame, compiled once for each set of instructions.

use super::super::walk::three;
use super::lanes::{self, W};
use super::{FrameRays, RayHits, RayInstance, RayQuery};
use crate::bvh::bvh8::{Block8, Node8};
use crate::bvh::bvh16::BLOCK;
use crate::bvh::{FAR_INVERSE, Hit, Ray, axes_of};

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
            pub(crate) struct RayLanes { pub inverse: [V; 3], pub enter: [V; 3], pub leave: [V; 3], pub near: [usize; 3] }
            $($(#[$meta])*
            #[allow(clippy::too_many_arguments)]
            #[inline]
            #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
            pub(crate) fn $name $args $(-> $result)? $body)*
        }
        pub(super) mod plain {
            use super::lanes::plain::*;
            use super::*;
            /// A ray as boxes see it.
            pub(crate) struct RayLanes { pub inverse: [V; 3], pub enter: [V; 3], pub leave: [V; 3], pub near: [usize; 3] }
            $($(#[$meta])*
            #[allow(clippy::too_many_arguments)]
            #[inline]
            pub(crate) fn $name $args $(-> $result)? $body)*
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
        // From an array: a vector is indexed by branches, which rays of random directions would mispredict.
        let origin = ray.origin.to_array();
        let at = three!(K => splat(origin[[x, y, z][K] % 3]));
        let (along, across) = (splat(ray.shear[0]), splat(ray.shear[1]));
        let corner = |k: usize| {
            let corner = &block.corners[k];
            let depth = sub(load(&corner[z]), at[2]);
            (
                sub(sub(load(&corner[x]), at[0]), mul(along, depth)),
                sub(sub(load(&corner[y]), at[1]), mul(across, depth)),
            )
        };
        let [(ax, ay), (bx, by), (cx, cy)] = three!(K => corner(K));
        let u = sub(mul(cx, by), mul(cy, bx));
        let v = sub(mul(ax, cy), mul(ay, cx));
        let w = sub(mul(bx, ay), mul(by, ax));
        let zero = splat(0.0);
        let (least, most) = (min(u, min(v, w)), max(u, max(v, w)));
        let refused = (below(least, zero) & below(zero, most)) | same(add(add(u, v), w), zero);
        !refused & 0xff
    }

    /// Distances of a block's triangles along a ray, and a bit for each that `Ray::intersect` does not refuse for its box or its
    /// plane: its operations in its order. Sides may be no numbers where an inverse is not finite.
    fn distances(block: &Block8, ray: &Ray, pad: f32, passed: u32) -> (V, u32) {
        let zero = splat(0.0);
        let origin = three!(AXIS => splat(ray.origin[AXIS]));
        let inverse = three!(AXIS => splat(ray.inverse[AXIS]));
        let side = |axis: usize| {
            let [a, b, c] = three!(K => load(&block.corners[K][axis]));
            (min(min(a, b), c), max(max(a, b), c))
        };
        let sides = three!(AXIS => side(AXIS));
        let slab = |pad: V| {
            let part = |axis: usize| {
                let t0 = mul(sub(sub(sides[axis].0, pad), origin[axis]), inverse[axis]);
                let t1 = mul(sub(add(sides[axis].1, pad), origin[axis]), inverse[axis]);
                (min(t0, t1), max(t0, t1))
            };
            let [x, y, z] = three!(AXIS => part(AXIS));
            (max(max(max(x.0, y.0), z.0), zero), min(min(x.1, y.1), z.1))
        };
        let (mut enter, mut leave) = slab(zero);
        if !at_most(enter, leave) & passed != 0 {
            let (bare, padded) = ((enter, leave), slab(splat(pad)));
            enter = if_above(bare.0, bare.1, padded.0, bare.0);
            leave = if_above(bare.0, bare.1, padded.1, bare.1);
        }
        let normal = three!(AXIS => load(&block.normal[AXIS]));
        let dot = |a: [V; 3]| add(add(mul(normal[0], a[0]), mul(normal[1], a[1])), mul(normal[2], a[2]));
        let towards = dot(three!(AXIS => splat(ray.direction[AXIS])));
        let quotient = div(dot(three!(AXIS => sub(load(&block.corners[0][AXIS]), origin[AXIS]))), towards);
        let t = min(max(quotient, enter), leave);
        // Where `towards` is 0, quotients are infinite or no numbers.
        let is_ahead = below(zero, quotient) & below(zero, t);
        (t, at_most(enter, leave) & !same(towards, zero) & is_ahead)
    }

    /// Hits of a ray among the triangles of a block, whose faces are numbered from the first one of `thing` on.
    fn block_hits(thing: &RayInstance, block: &Block8, ray: &Ray, wanted: RayQuery, found: &mut RayHits) {
        let mut passed = edges_passed(block, ray);
        if passed == 0 {
            return;
        }
        if !ray.inverse.is_finite() {
            return block_hits_one_by_one(thing, block, passed, ray, wanted, found);
        }
        let (t, ahead) = distances(block, ray, thing.tree.pad, passed);
        let reach = if wanted == RayQuery::Count { ray.t_max } else { found.hit.t };
        passed &= ahead & at_most(t, splat(reach));
        let t = store(t);
        while passed != 0 {
            let slot = passed.trailing_zeros() as usize % W;
            passed &= passed - 1;
            let (t, prim) = (t[slot], thing.first_prim + block.prim[slot]);
            if wanted == RayQuery::Count {
                found.count += 1;
            } else if t < found.hit.t || (t == found.hit.t && prim < found.hit.prim) {
                found.hit = Hit { t, prim };
            }
        }
    }

    /// The nearest entry of the stack above `base` that begins within `reach`.
    fn next(stack: &Stack, top: &mut usize, base: usize, reach: f32) -> Option<u64> {
        while *top > base {
            *top -= 1;
            let entry = stack[*top % STACK];
            if f32::from_bits((entry >> 32) as u32) <= reach {
                return Some(entry);
            }
        }
        None
    }

    /// Hits of a ray below a node or block of a tree. The stack is as before at the end.
    fn triangles_hit(
        thing: &RayInstance,
        mut child: u32,
        ray: &Ray,
        wanted: RayQuery,
        found: &mut RayHits,
        stack: &mut Stack,
        base: usize,
    ) {
        let tree = thing.tree.bvh8();
        let (lanes, mut top) = (lanes(ray, tree.largest), base);
        loop {
            if child & BLOCK == 0 {
                let node = &tree.nodes[child as usize];
                if let Some(nearest) = children(node, &lanes, found.hit.t, stack, &mut top) {
                    child = nearest;
                    continue;
                }
            } else {
                let block = &tree.blocks[(child ^ BLOCK) as usize];
                block_hits(thing, block, ray, wanted, found);
                if found.is_enough(wanted) {
                    return;
                }
            }
            let Some(entry) = next(stack, &mut top, base, found.hit.t) else { return };
            child = entry as u32;
        }
    }

    /// Hits of a ray below a node of the tree of instances, or in one of them.
    fn instances_hit(
        frame: &FrameRays<'_>,
        mut child: u32,
        lane: usize,
        found: &mut RayHits,
        stack: &mut Stack,
        base: usize,
    ) {
        let (lanes, mut top) = (lanes(&frame.rays[lane], frame.upper.largest), base);
        loop {
            if child & BLOCK == 0 {
                let node = &frame.upper.nodes[child as usize];
                if let Some(nearest) = children(node, &lanes, found.hit.t, stack, &mut top) {
                    child = nearest;
                    continue;
                }
            } else {
                let thing: &RayInstance = &frame.things[(child ^ BLOCK) as usize];
                let ray = thing.ray(frame.origins[lane], frame.units[lane], found.hit.t);
                if let Some(root) = thing.tree.bvh8().root {
                    triangles_hit(thing, root, &ray, frame.wanted, found, stack, top);
                }
                if found.is_enough(frame.wanted) {
                    return;
                }
            }
            let Some(entry) = next(stack, &mut top, base, found.hit.t) else { return };
            child = entry as u32;
        }
    }

    /// Rays that go down a tree together, a lane each; `None` where two rays of `mask` differ in the sign of an axis.
    fn packet(rays: &[Ray; W], mask: u32, largest: f32) -> Option<RayLanes> {
        let mut numbers = [[[0.0; W]; 3]; 3];
        let mut negative = [0; 3];
        for (lane, ray) in rays.iter().enumerate() {
            let slack = SLACK * (largest + ray.origin.abs().max_element());
            for axis in 0..3 {
                let inverse = ray.inverse[axis].clamp(-FAR_INVERSE, FAR_INVERSE);
                let (at, wide) = (-ray.origin[axis] * inverse, slack * inverse.abs());
                numbers[0][axis][lane] = inverse;
                numbers[1][axis][lane] = at - wide;
                numbers[2][axis][lane] = at + wide;
                negative[axis] |= u32::from(inverse < 0.0) << lane;
            }
        }
        let mut near = [0, 1, 2];
        for axis in 0..3 {
            match negative[axis] & mask {
                0 => {}
                all if all == mask => near[axis] += 3,
                _ => return None,
            }
        }
        let lanes = |numbers: &[[f32; W]; 3]| [load(&numbers[0]), load(&numbers[1]), load(&numbers[2])];
        let [inverse, enter, leave] = [lanes(&numbers[0]), lanes(&numbers[1]), lanes(&numbers[2])];
        Some(RayLanes { inverse, enter, leave, near })
    }

    /// Puts the children of a node that rays of a packet meet on the stack, the nearest on top. An entry has the upper bits of
    /// where the first ray begins, a bit for each ray, and the child.
    fn children_of_packet(node: &Node8, rays: &RayLanes, reach: &[f32; W], stack: &mut Stack, top: &mut usize) {
        let from = *top;
        let reach = load(reach);
        let [nx, ny, nz] = rays.near;
        let (fx, fy, fz) = ((nx + 3) % 6, (ny + 3) % 6, (nz + 3) % 6);
        let [x, y, z] = rays.inverse;
        for slot in 0..node.count() {
            let side = |row: usize| splat(node.rows[row % 8][slot % 8]);
            let near = max(
                max(fma(side(nx), x, rays.enter[0]), fma(side(ny), y, rays.enter[1])),
                max(fma(side(nz), z, rays.enter[2]), splat(0.0)),
            );
            let far = min(
                min(fma(side(fx), x, rays.leave[0]), fma(side(fy), y, rays.leave[1])),
                min(fma(side(fz), z, rays.leave[2]), reach),
            );
            let (seen, begin) = first_of(near, far);
            if seen == 0 {
                continue;
            }
            let entry = u64::from(begin.to_bits() & !0xff | seen) << 32 | u64::from(node.child(slot));
            let mut at = *top;
            while at > from && stack[(at - 1) % STACK] < entry {
                stack[at % STACK] = stack[(at - 1) % STACK];
                at -= 1;
            }
            stack[at % STACK] = entry;
            *top += 1;
        }
    }

    /// Hits of the rays of `mask` below a node or block: in the block together, below all else one by one if they are `alone`.
    fn below_packet(
        frame: &FrameRays<'_>,
        thing: Option<(&RayInstance, &[Ray; W])>,
        child: u32,
        mask: u32,
        alone: bool,
        hits: &mut [RayHits; W],
        stack: &mut Stack,
        top: usize,
    ) {
        match thing {
            Some((thing, rays)) if !alone => {
                let block = &thing.tree.bvh8().blocks[(child ^ BLOCK) as usize];
                for lane in lanes_of(mask) {
                    block_hits(thing, block, &rays[lane], frame.wanted, &mut hits[lane]);
                }
            }
            Some((thing, rays)) => {
                for lane in lanes_of(mask) {
                    triangles_hit(thing, child, &rays[lane], frame.wanted, &mut hits[lane], stack, top);
                }
            }
            None if alone => {
                for lane in lanes_of(mask) {
                    instances_hit(frame, child, lane, &mut hits[lane], stack, top);
                }
            }
            None => {
                let thing = &frame.things[(child ^ BLOCK) as usize];
                let mut rays = frame.rays;
                for lane in lanes_of(mask) {
                    rays[lane] = thing.ray(frame.origins[lane], frame.units[lane], hits[lane].hit.t);
                }
                packet_hits(frame, Some((thing, &rays)), mask, true, hits, stack, top);
            }
        }
    }

    /// Hits of the rays of `mask` in an instance, or in all instances of the frame.
    fn packet_hits(
        frame: &FrameRays<'_>,
        thing: Option<(&RayInstance, &[Ray; W])>,
        mask: u32,
        together: bool,
        hits: &mut [RayHits; W],
        stack: &mut Stack,
        base: usize,
    ) {
        let (root, largest, rays) = match thing {
            Some((thing, rays)) => {
                let tree = thing.tree.bvh8();
                (tree.root, tree.largest, rays)
            }
            None => (frame.upper.root, frame.upper.largest, &frame.rays),
        };
        let Some(root) = root else { return };
        let packet = if !together || mask.count_ones() < TOGETHER { None } else { packet(rays, mask, largest) };
        let mut top = base;
        let mut reach = [-1.0; W];
        for (lane, reach) in reach.iter_mut().enumerate() {
            if mask >> lane & 1 == 1 {
                *reach = hits[lane].reach(frame.wanted);
            }
        }
        let mut entry = u64::from(mask) << 32 | u64::from(root);
        loop {
            let (begin, mask, child) = ((entry >> 32) as u32 & !0xff, (entry >> 32) as u32 & 0xff, entry as u32);
            let alone = packet.is_none() || mask.count_ones() < TOGETHER;
            if let Some(packet) = packet.as_ref().filter(|_| !alone && child & BLOCK == 0) {
                let node = match thing {
                    Some((thing, _)) => &thing.tree.bvh8().nodes[child as usize],
                    None => &frame.upper.nodes[child as usize],
                };
                children_of_packet(node, packet, &reach, stack, &mut top);
            } else {
                let begin = f32::from_bits(begin);
                let left = lanes_of(mask).filter(|&lane| begin <= reach[lane]);
                let left = left.fold(0, |left, lane| left | 1 << lane);
                below_packet(frame, thing, child, left, alone, hits, stack, top);
                for lane in lanes_of(left) {
                    reach[lane] = hits[lane].reach(frame.wanted);
                }
            }
            let farthest = reach.iter().fold(-1.0, |far: f32, &reach| if reach > far { reach } else { far });
            // The low eight bits of an entry's distance name its rays.
            let farthest = f32::from_bits(farthest.to_bits() | 0xff);
            let Some(next) = next(stack, &mut top, base, farthest) else { return };
            entry = next;
        }
    }
}

/// Hits of a ray among some triangles of a block, by `Ray::intersect` itself.
#[cold]
fn block_hits_one_by_one(
    thing: &RayInstance,
    block: &Block8,
    passed: u32,
    ray: &Ray,
    wanted: RayQuery,
    found: &mut RayHits,
) {
    for slot in lanes_of(passed) {
        let (triangle, mut own) = (block.triangle(slot), found.hit);
        if wanted == RayQuery::Count {
            own = Hit::none(ray.t_max);
        }
        ray.intersect(&triangle, thing.tree.pad, thing.first_prim, &mut own);
        if wanted == RayQuery::Count {
            found.count += u32::from(own.is_hit());
        } else {
            found.hit = own;
        }
    }
}

/// Fewest rays that go down together.
const TOGETHER: u32 = 3;

/// Lanes whose bits are set.
#[inline(always)]
fn lanes_of(mut mask: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lane = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        (lane < lanes::W).then_some(lane)
    })
}
