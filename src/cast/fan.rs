//! Origins that share their directions: one list of triangles for all, in order of distance.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use bytemuck::Zeroable;
use glam::Vec3;
use multiversion::multiversion;

use super::bounds::Bounds;
use super::fan_bounds::{DirectionBounds, FanRanges, ProjectedBlock};
use super::intersect::{ALL_INSIDE, Inside, PermutedTriangle, Rays};
use super::lanes::{Across, CHUNK, CHUNKS, Lanes, NOTHING, PACKET_RAYS, PacketHits};
use crate::bvh::bvh8::{Block, Bvh8, Child, WIDTH};
use crate::bvh::{Bvh, NO_HIT, Triangle};

/// Up to [`PACKET_RAYS`] origins that lie side by side, with all rays from them in a few directions.
///
/// All these rays go down the tree once: the triangles that they may hit make a list, nearest first,
/// as long as a direction asks for. Then each direction goes through the list. Triangles are skipped only
/// where all rays of a chunk miss them, or have a hit before them, by more than rounding could change
/// (`Bounds::slack`); all others are tested a lane a ray, with the operations of `Ray::intersect` in the
/// same order. No hit depends on which triangles were tested before, so the bits are the same.
#[derive(Clone)]
pub struct Fan {
    len: usize,
    origin: [Lanes; 3],
    /// The origins again.
    across: [Across; 3],
    list: HitList,
    /// Working memory of the tests.
    inside: Inside,
}

/// The triangles that the rays of a fan may hit, in groups, nearest first.
#[derive(Clone, Default)]
struct HitList {
    groups: Vec<HitGroup>,
    /// Groups of the list; the next one is being filled.
    len: usize,
    /// Parts of the tree that are not in the list yet, by where rays enter them at the earliest.
    queue: BinaryHeap<Reverse<u64>>,
    /// Number of the tree's first triangle.
    first_prim: u32,
}

/// Up to eight triangles that the rays of a fan may hit.
#[derive(Clone)]
struct HitGroup {
    block: Block,
    triangles: [PermutedTriangle; WIDTH],
    /// Lower bound of the distance at which rays meet the triangles of this or a later group.
    enter: f32,
}

impl Default for HitGroup {
    fn default() -> Self {
        Self {
            block: Block::EMPTY,
            triangles: [PermutedTriangle::new(&Triangle::zeroed(), [0; 3], 0); WIDTH],
            enter: 0.0,
        }
    }
}

impl Fan {
    /// Rays from `origins` (1 to [`PACKET_RAYS`]).
    pub fn new(origins: &[Vec3]) -> Self {
        let mut fan = Self {
            len: 0,
            origin: [NOTHING; 3],
            across: [[[0.0; CHUNKS]; CHUNK]; 3],
            list: HitList::default(),
            inside: ALL_INSIDE,
        };
        fan.set_origins(origins);
        fan
    }

    /// Rays from other origins (1 to [`PACKET_RAYS`]).
    pub fn set_origins(&mut self, origins: &[Vec3]) {
        self.len = origins.len();
        for lane in 0..PACKET_RAYS {
            // Lanes that are left over repeat the last ray.
            let origin = origins[lane.min(origins.len() - 1)];
            let (chunk, i) = (lane / CHUNK, lane % CHUNK);
            for axis in 0..3 {
                self.origin[axis][chunk][i] = origin[axis];
                self.across[axis][i][chunk] = origin[axis];
            }
        }
    }
}

impl Bvh {
    /// [`Self::closest_hit`] from every origin of a fan in each of some directions, 1 to
    /// [`FAN_DIRECTIONS`](super::FAN_DIRECTIONS) unit vectors whose [`super::major_axis`] is the same; hits count up to `t_max`.
    /// Those of each direction go to `hits`, which holds as many.
    ///
    /// Fast where no component changes its sign, and where the directions are neighbours.
    pub fn closest_hits_of_fan(
        &self,
        fan: &mut Fan,
        directions: &[Vec3],
        t_max: f32,
        hits: &mut [PacketHits],
    ) {
        for hits in &mut hits[..directions.len()] {
            hits.t = [[t_max; CHUNK]; CHUNKS];
            hits.prim = [[NO_HIT; CHUNK]; CHUNKS];
        }
        self.closer_hits_of_fan(fan, directions, 0, t_max, hits);
    }

    /// Replaces the hits by closer ones, as [`Self::closer_hit`] does; none of them lies beyond `t_max`.
    pub(crate) fn closer_hits_of_fan(
        &self,
        fan: &mut Fan,
        directions: &[Vec3],
        first_prim: u32,
        t_max: f32,
        hits: &mut [PacketHits],
    ) {
        if !directions.is_empty() && !self.bvh8.nodes.is_empty() {
            fan.list.first_prim = first_prim;
            cast(&self.bvh8, &self.triangles, self.pad, fan, directions, t_max, hits);
        }
    }

    /// Whether a ray of a fan may meet the tree at all.
    pub(crate) fn fan_meets(&self, fan: &Fan, directions: &[Vec3], t_max: f32) -> bool {
        self.bvh8.nodes.first().is_some_and(|root| {
            let shaft = FanRanges::new(&fan.across, directions, t_max).bounds(self.pad);
            let (near, far) = shaft.slabs(&root.planes);
            near.iter().zip(far).any(|(near, far)| *near <= far)
        })
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn cast(
    bvh8: &Bvh8,
    triangles: &[Triangle],
    pad: f32,
    fan: &mut Fan,
    directions: &[Vec3],
    t_max: f32,
    hits: &mut [PacketHits],
) {
    let Fan { len, origin, across, list, inside } = fan;
    let ranges = FanRanges::new(across, directions, t_max);
    let shaft = ranges.bounds(pad);
    list.restart();
    let filled = len.div_ceil(CHUNK);
    let mut projected = ProjectedBlock::NOTHING;
    for (ray, hits) in ranges.rays(directions.len()).iter().zip(hits) {
        let mut bounds = DirectionBounds::new(&shaft, &ranges, ray, filled);
        let enters = [0, 1, 2].map(|axis| usize::from(ray.inverse[axis] < 0.0));
        let rays = Rays { axes: ranges.axes, enters, origin, ray };
        // Hits that were there before end what has to be looked at.
        let held = hits.t.iter().zip(&origin[ranges.axes[2]]).take(filled);
        for (chunk, (t, origin)) in held.enumerate() {
            bounds.update_farthest(chunk, t, origin);
        }
        let mut farthest = bounds.farthest();
        let mut at = 0;
        loop {
            if at == list.len && !list.extend(bvh8, triangles, &shaft, farthest) {
                break;
            }
            let group = &list.groups[at];
            at += 1;
            // Equal to the best distance is still visited: a tie may have a lower id.
            if group.enter > farthest {
                break;
            }
            let mut left = bounds.project(&group.block, farthest, &mut projected);
            let (mut meets, mut sure) = (0, 0);
            while left != 0 {
                let slot = left.trailing_zeros() as usize;
                left &= left - 1;
                let (mut meet, mut sure_here) = bounds.chunks_that_hit(&projected, slot);
                sure_here &= meet;
                if sure_here != 0 {
                    meet ^= sure_here;
                    sure_here = bounds.take_sure_hits(&group.triangles[slot].triangle, sure_here);
                    meet |= sure_here;
                }
                meets |= u64::from(meet) << (slot * CHUNKS);
                sure |= u64::from(sure_here) << (slot * CHUNKS);
            }
            let mut hit = rays.intersect(&group.triangles, pad, meets, sure, inside, hits);
            while hit != 0 {
                let chunk = hit.trailing_zeros() as usize;
                hit &= hit - 1;
                bounds.update_farthest(chunk, &hits.t[chunk], &origin[ranges.axes[2]][chunk]);
            }
            farthest = bounds.farthest();
        }
    }
}

impl HitList {
    /// Starts over with the whole tree.
    #[inline(always)]
    fn restart(&mut self) {
        self.len = 0;
        self.open();
        self.queue.clear();
        self.queue.push(Reverse(key(f32::NEG_INFINITY, Child::ROOT)));
    }

    /// Adds the next groups, unless they begin farther away; whether it did.
    #[inline(always)]
    fn extend(
        &mut self,
        bvh8: &Bvh8,
        triangles: &[Triangle],
        shaft: &Bounds,
        farthest: f32,
    ) -> bool {
        let before = self.len;
        while self.len == before {
            let Some(&Reverse(top)) = self.queue.peek() else { break };
            let enter = from_key(top);
            if enter > farthest {
                break;
            }
            self.queue.pop();
            match Child::from_bits(top as u32).get() {
                Ok(block) => {
                    let block = &bvh8.blocks[block];
                    let mut left = shaft.meets(block, f32::INFINITY);
                    while left != 0 {
                        let slot = left.trailing_zeros();
                        left &= left - 1;
                        self.add(&triangles[(block.first + slot) as usize], enter, shaft);
                    }
                }
                Err(index) => {
                    let node = &bvh8.nodes[index];
                    let (near, far) = shaft.slabs(&node.planes);
                    for slot in 0..WIDTH {
                        if near[slot] <= far[slot] {
                            self.queue.push(Reverse(key(near[slot], node.children[slot])));
                        }
                    }
                }
            }
        }
        let open = &self.groups[self.len];
        if self.len == before && open.block.count > 0 && open.enter <= farthest {
            self.len += 1;
            self.open();
        }
        self.len > before
    }

    #[inline(always)]
    fn add(&mut self, triangle: &Triangle, enter: f32, shaft: &Bounds) {
        let open = &mut self.groups[self.len];
        let slot = open.block.count as usize % WIDTH;
        if slot == 0 {
            open.enter = enter;
        }
        open.triangles[slot] = PermutedTriangle::new(triangle, shaft.axes, self.first_prim);
        open.block.set(slot, triangle);
        open.block.count += 1;
        if slot + 1 == WIDTH {
            self.len += 1;
            self.open();
        }
    }

    /// Begins the group after the list.
    #[inline(always)]
    fn open(&mut self) {
        if self.len == self.groups.len() {
            self.groups.push(HitGroup::default());
        }
        self.groups[self.len].block.count = 0;
    }
}

/// Key that orders parts of the tree by distance, 64 bits: the upper half is the float's bits, with
/// all inverted where it is negative and the sign bit set where it is not, so that they rise with
/// the float; the lower half is the [`Child`]. E.g. 1.0 and child 7: 0xbf80_0000_0000_0007.
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
