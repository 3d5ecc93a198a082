//! A packet's way down the eight-wide tree.

use multiversion::multiversion;

use super::bounds::Bounds;
use super::intersect::{ALL_INSIDE, Inside, PermutedTriangle, Rays};
use super::lanes::{CHUNK, CHUNKS};
use super::packet::Packet;
use crate::bvh::bvh8::{Bvh8, Child, WIDTH};
use crate::bvh::{Bvh, MAX_DEPTH, NO_HIT, Triangle};

/// Entries of the traversal stack: each level leaves at most all children but one behind.
const STACK: usize = MAX_DEPTH * (WIDTH - 1) + 1;

/// Parts of the tree to visit: where the rays enter each at the earliest, and which it is.
type Stack = [(f32, Child); STACK];

/// Working memory of [`Bvh::closest_hits`], kept from packet to packet.
pub struct Scratch {
    stack: Stack,
    inside: Inside,
}

impl Default for Scratch {
    fn default() -> Self {
        Self { stack: [(0.0, Child::ROOT); STACK], inside: ALL_INSIDE }
    }
}

impl Bvh {
    /// [`Self::closest_hit`] of every ray of a packet.
    pub fn closest_hits(&self, packet: &mut Packet, scratch: &mut Scratch) {
        packet.hits.t = [[packet.t_max; CHUNK]; CHUNKS];
        packet.hits.prim = [[NO_HIT; CHUNK]; CHUNKS];
        self.closer_hits(packet, 0, scratch);
    }

    /// Replaces the hits that a packet holds, as [`Self::closer_hit`] does; none of them lies beyond its
    /// `t_max`.
    pub(crate) fn closer_hits(&self, packet: &mut Packet, first_prim: u32, scratch: &mut Scratch) {
        if !self.bvh8.nodes.is_empty() {
            traverse(&self.bvh8, &self.triangles, self.pad, first_prim, packet, scratch);
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn traverse(
    bvh8: &Bvh8,
    triangles: &[Triangle],
    pad: f32,
    first_prim: u32,
    packet: &mut Packet,
    scratch: &mut Scratch,
) {
    let (bounds, mut chunks) = Bounds::new(packet, pad);
    let mut farthest = chunks.farthest();
    let Scratch { stack, inside } = scratch;
    stack[0] = (f32::NEG_INFINITY, Child::ROOT);
    let mut depth = 1;
    while depth > 0 {
        depth -= 1;
        let (enter, child) = stack[depth];
        // Equal to the best distance is still visited: a tie may have a lower id.
        if enter > farthest {
            continue;
        }
        match child.get() {
            Ok(block) => {
                let block = &bvh8.blocks[block];
                let mut left = bounds.meets(block, farthest);
                let Packet { origin, direction, inverse, shear, hits, .. } = &mut *packet;
                let rays = Rays::<false> {
                    axes: bounds.axes,
                    enters: [0; 3],
                    origin,
                    direction: [&direction[0], &direction[1], &direction[2]],
                    inverse: [&inverse[0], &inverse[1], &inverse[2]],
                    shear: [&shear[0], &shear[1]],
                };
                let mut hit = 0;
                while left != 0 {
                    let slot = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let meets = chunks.chunks_that_hit(&bounds, block, slot);
                    let triangle = &triangles[block.first as usize + slot];
                    let triangle = [PermutedTriangle::new(triangle, bounds.axes, first_prim)];
                    hit |= rays.intersect(&triangle, pad, meets.into(), 0, inside, hits);
                }
                while hit != 0 {
                    let chunk = hit.trailing_zeros() as usize;
                    hit &= hit - 1;
                    chunks.update_farthest(
                        &packet.hits.t[chunk],
                        &packet.origin[bounds.axes[2]][chunk],
                        &packet.inverse[bounds.axes[2]][chunk],
                        chunk,
                        &bounds,
                    );
                }
                farthest = chunks.farthest();
            }
            Err(index) => {
                let node = &bvh8.nodes[index];
                let (near, far) = bounds.slabs(&node.planes);
                let bottom = depth;
                for slot in 0..WIDTH {
                    if near[slot] <= far[slot] && near[slot] <= farthest {
                        // Farthest first, so that the nearest is on top.
                        let mut at = depth;
                        while at > bottom && stack[at - 1].0 < near[slot] {
                            stack[at] = stack[at - 1];
                            at -= 1;
                        }
                        stack[at] = (near[slot], node.children[slot]);
                        depth += 1;
                    }
                }
            }
        }
    }
}
