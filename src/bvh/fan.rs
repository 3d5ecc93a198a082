use std::cmp::Reverse;
use std::collections::BinaryHeap;

use bytemuck::Zeroable;
use glam::Vec3;
use multiversion::multiversion;

use super::bounds::Bounds;
use super::lanes::{ALL_INSIDE, Inside, Prepared, Rays};
use super::packet::{Across, CHUNK, CHUNKS, Lanes, NOTHING, PACKET_RAYS, PacketHits};
use super::ranges::FanRanges;
use super::wide::{Block, Child, WIDTH, Wide};
use super::{Bvh, NO_HIT, Ray, Triangle};

/// Most directions of a fan.
pub const FAN_DIRECTIONS: usize = 16;

/// Up to [`PACKET_RAYS`] origins that lie side by side, with all rays from them in a few directions.
///
/// All these rays go down the tree once: the triangles that they may hit make a list, nearest first,
/// as long as a direction asks for. Then each direction goes through the list. What is skipped on
/// the way, and why the bits are the same, is as with [`super::Packet`].
#[derive(Clone)]
pub struct Fan {
    pub(super) len: usize,
    pub(super) origin: [Lanes; 3],
    /// The origins again.
    pub(super) across: [Across; 3],
    near: Near,
    inside: Inside,
}

/// What the rays of a fan may hit.
#[derive(Clone, Default)]
struct Near {
    groups: Vec<Group>,
    /// Is being filled.
    open: Group,
    /// Parts of the tree that are not in the list yet, by where rays enter them at the earliest.
    queue: BinaryHeap<Reverse<u64>>,
}

/// Up to eight triangles that the rays of a fan may hit.
#[derive(Clone)]
struct Group {
    block: Block,
    triangles: [Prepared; WIDTH],
    /// No ray meets them, or those of later groups, before.
    enter: f32,
}

impl Default for Group {
    fn default() -> Self {
        Self {
            block: Block::EMPTY,
            triangles: [Prepared::new(&Triangle::zeroed(), [0; 3]); WIDTH],
            enter: 0.0,
        }
    }
}

impl Fan {
    /// Rays from `origins` (1 to [`PACKET_RAYS`]).
    pub fn new(origins: &[Vec3]) -> Self {
        let mut fan = Self {
            len: origins.len(),
            origin: [NOTHING; 3],
            across: [[[0.0; CHUNKS]; CHUNK]; 3],
            near: Near::default(),
            inside: ALL_INSIDE,
        };
        for lane in 0..PACKET_RAYS {
            // Lanes that are left over repeat the last ray.
            let origin = origins[lane.min(origins.len() - 1)];
            let (chunk, i) = (lane / CHUNK, lane % CHUNK);
            for axis in 0..3 {
                fan.origin[axis][chunk][i] = origin[axis];
                fan.across[axis][i][chunk] = origin[axis];
            }
        }
        fan
    }
}

impl Bvh {
    /// [`Self::closest_hit`] from every origin of a fan in each of some directions, 1 to
    /// [`FAN_DIRECTIONS`] unit vectors whose [`super::major_axis`] is the same; hits count up to `t_max`.
    ///
    /// Fast where no component changes its sign, and where the directions are neighbours.
    pub fn closest_hits_of_fan(
        &self,
        fan: &mut Fan,
        directions: &[Vec3],
        t_max: f32,
        hits: &mut [PacketHits],
    ) {
        if directions.is_empty() {
            return;
        }
        for hits in &mut hits[..directions.len()] {
            hits.t = [[t_max; CHUNK]; CHUNKS];
            hits.prim = [[NO_HIT; CHUNK]; CHUNKS];
        }
        if !self.wide.nodes.is_empty() {
            cast(&self.wide, &self.triangles, self.pad, fan, directions, t_max, hits);
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn cast(
    wide: &Wide,
    triangles: &[Triangle],
    pad: f32,
    fan: &mut Fan,
    directions: &[Vec3],
    t_max: f32,
    hits: &mut [PacketHits],
) {
    let Fan { len, origin, across, near, inside } = fan;
    let ranges = FanRanges::new(across, directions);
    let shaft = Bounds::of_fan(&ranges, pad);
    near.restart();
    let filled = len.div_ceil(CHUNK);
    for (&direction, hits) in directions.iter().zip(hits) {
        let ray = Ray::new(Vec3::ZERO, direction, t_max);
        let (bounds, mut chunks) = Bounds::of_direction(&shaft, &ranges, &ray, filled);
        let splat = |x: f32| [[x; CHUNK]];
        let turned = [direction.x, direction.y, direction.z].map(splat);
        let inverse = [ray.inverse.x, ray.inverse.y, ray.inverse.z].map(splat);
        let shear = ray.shear.map(splat);
        let rays = Rays::<true> {
            axes: bounds.axes,
            enters: [0, 1, 2].map(|axis| usize::from(ray.inverse[axis] < 0.0)),
            origin,
            direction: [&turned[0], &turned[1], &turned[2]],
            inverse: [&inverse[0], &inverse[1], &inverse[2]],
            shear: [&shear[0], &shear[1]],
        };
        let mut farthest = chunks.farthest();
        let mut at = 0;
        loop {
            if at == near.groups.len() && !near.extend(wide, triangles, &shaft, farthest) {
                break;
            }
            let group = &near.groups[at];
            at += 1;
            // Equal to the best distance is still visited: a tie may have a lower id.
            if group.enter > farthest {
                break;
            }
            let block = &group.block;
            let mut left = bounds.meets::<true>(block, farthest);
            let (mut meets, mut sure) = (0, 0);
            while left != 0 {
                let slot = left.trailing_zeros() as usize;
                left &= left - 1;
                let (mut meet, mut settled) = chunks.meet::<true>(&bounds, block, slot);
                settled &= meet;
                if settled != 0 {
                    meet ^= settled;
                    settled = chunks.settle(
                        &bounds,
                        &group.triangles[slot].triangle,
                        direction.to_array(),
                        settled,
                    );
                    meet |= settled;
                }
                meets |= u64::from(meet) << (slot * CHUNKS);
                sure |= u64::from(settled) << (slot * CHUNKS);
            }
            let mut hit = rays.intersect(&group.triangles, pad, meets, sure, inside, hits);
            while hit != 0 {
                let chunk = hit.trailing_zeros() as usize;
                hit &= hit - 1;
                chunks.look_again::<true>(
                    &hits.t[chunk],
                    &origin[bounds.axes[2]][chunk],
                    &[ray.inverse[ray.major]; CHUNK],
                    chunk,
                    &bounds,
                );
            }
            farthest = chunks.farthest();
        }
    }
}

impl Near {
    /// Starts over with the whole tree.
    #[inline(always)]
    fn restart(&mut self) {
        self.groups.clear();
        self.open.block.count = 0;
        self.queue.clear();
        self.queue.push(Reverse(key(f32::NEG_INFINITY, Child::ROOT)));
    }

    /// Adds the next groups, unless they begin farther away; whether it did.
    #[inline(always)]
    fn extend(
        &mut self,
        wide: &Wide,
        triangles: &[Triangle],
        shaft: &Bounds,
        farthest: f32,
    ) -> bool {
        let before = self.groups.len();
        while self.groups.len() == before {
            let Some(&Reverse(top)) = self.queue.peek() else { break };
            let enter = from_key(top);
            if enter > farthest {
                break;
            }
            self.queue.pop();
            match Child::from_bits(top as u32).get() {
                Ok(block) => {
                    let block = &wide.blocks[block];
                    let mut left = shaft.meets::<false>(block, f32::INFINITY);
                    while left != 0 {
                        let slot = left.trailing_zeros();
                        left &= left - 1;
                        self.add(triangles[(block.first + slot) as usize], enter, shaft);
                    }
                }
                Err(index) => {
                    let node = &wide.nodes[index];
                    let (near, far) = shaft.slabs(&node.planes);
                    for slot in 0..WIDTH {
                        if near[slot] <= far[slot] {
                            self.queue.push(Reverse(key(near[slot], node.children[slot])));
                        }
                    }
                }
            }
        }
        if self.groups.len() == before && self.open.block.count > 0 && self.open.enter <= farthest {
            self.seal();
        }
        self.groups.len() > before
    }

    #[inline(always)]
    fn add(&mut self, triangle: Triangle, enter: f32, shaft: &Bounds) {
        let slot = self.open.block.count as usize;
        if slot == 0 {
            self.open.enter = enter;
        }
        self.open.triangles[slot] = Prepared::new(&triangle, shaft.axes);
        self.open.block.set(slot, &triangle);
        self.open.block.count += 1;
        if slot + 1 == WIDTH {
            self.seal();
        }
    }

    fn seal(&mut self) {
        self.groups.push(self.open.clone());
        self.open.block.count = 0;
    }
}

/// Orders parts of the tree by distance: the bits of a float, so turned that they grow with it, above
/// those of the part.
fn key(enter: f32, child: Child) -> u64 {
    let bits = enter.to_bits();
    let turn = if bits >> 31 != 0 { u32::MAX } else { 1 << 31 };
    u64::from(bits ^ turn) << 32 | u64::from(child.bits())
}

/// The distance in a [`key`].
fn from_key(key: u64) -> f32 {
    let bits = (key >> 32) as u32;
    f32::from_bits(bits ^ if bits >> 31 != 0 { 1 << 31 } else { u32::MAX })
}
