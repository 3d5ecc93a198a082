//! `FiringWalk`: the beams of a sensor that moves while it turns, with their rims.
//!
//! Neighbouring azimuth steps, fired from places of their own, go down a tree together.

use std::ops::Range;

use bytemuck::{Zeroable, zeroed_box};
use multiversion::multiversion;
use multiversion::target::match_target;

use super::angles::{Eye, Rects};
use super::descent::{Entry, STACK, around, some};
use super::grid::{BEAMS, Grid, ROOM, Window};
use super::ops::{W, per_target, three};
use super::packet::{Packet, PacketFace, RAYS, Rays};
use super::triangles::TriangleView as Outlined;
use super::{Instructions, LARGEST, TreeView, Walk};
use crate::bvh::bvh16::{BLOCK, Bvh16};
use crate::bvh::{Bvh, Hit, Ray};
use crate::cast::bundle::descend;
use crate::memory::FreeList;
use crate::sensor::BeamTable;
use crate::task::{DevicePose, beam_direction, beam_origin};

/// Beams that go down a tree together, at most.
const TOGETHER: usize = 2048;
/// Azimuth steps that do.
const STEPS: usize = 16;

/// A tree, and the sensor's poses in its frame when the azimuth steps of a window fire.
pub struct SweptPart<'a> {
    /// The tree.
    pub bvh: &'a Bvh,
    /// Added to the index of each face.
    pub first_prim: u32,
    /// From the sensor's frame to the tree's; none of a step whose beams do not meet the tree.
    pub poses: Vec<Option<DevicePose>>,
}

/// The beams of a sensor that moves while it turns: neighbouring azimuth steps go down the trees together,
/// each fired from a place of its own, and each beam with seven more rays around it.
pub struct FiringWalk {
    grid: Grid,
    /// One for each row.
    channels: Vec<usize>,
    /// One for each window.
    middles: Vec<Middles>,
    steps: usize,
    /// Farthest that a ray lies beside the middle of its beam, in radians.
    width: f32,
    instructions: Instructions,
    /// Working memory that no walk uses at the moment.
    spare: FreeList<SweepMemory>,
}

impl FiringWalk {
    /// For sensors of a model with beams that wide; none of a list of directions, and of too many channels.
    pub fn new(table: &BeamTable, width: f32, instructions: Instructions) -> Option<Self> {
        let beams = table.grid()?;
        let grid = Grid::of_firings(beams)?;
        let channels: Vec<usize> = grid.channels().collect();
        let spare = FreeList::default();
        let mut walk = Self {
            grid,
            channels,
            middles: vec![],
            steps: beams.steps,
            width,
            instructions,
            spare,
        };
        let windows = (0..walk.steps).step_by(walk.together());
        walk.middles = windows.map(|from| walk.middles_from(table, from)).collect();
        Some(walk)
    }

    fn middles_from(&self, table: &BeamTable, from: usize) -> Middles {
        let steps = from..(from + self.together()).min(self.steps);
        [0, 1, 2].map(|axis: usize| {
            let row = |&channel: &usize| {
                let beams = steps.clone().map(move |step| channel * self.steps + step);
                beams.map(|beam| table.directions()[beam][axis])
            };
            self.channels.iter().flat_map(row).chain([0.0; W]).collect()
        })
    }

    /// Azimuth steps that go down the trees together, from the first on; the last ones may be fewer.
    pub fn together(&self) -> usize {
        (TOGETHER / self.channels.len()).clamp(1, STEPS.min(self.steps.div_ceil(2)))
    }

    /// The closest hits within `range` of the beams of neighbouring azimuth steps, step by step and channel by
    /// channel: those of lane 0 of their `rays`, and of its neighbours.
    pub fn closest_hits<const RIM: usize>(
        &self,
        steps: Range<usize>,
        parts: &[SweptPart<'_>],
        rays: &[Rays],
        range: f32,
        hits: &mut [Hit],
        rims: &mut [[Hit; RIM]],
    ) {
        const { assert!(RIM < RAYS) };
        let window = Window { from: steps.start, columns: steps.len() };
        let beams = window.columns * self.channels.len();
        assert!(beams <= BEAMS, "windows are as wide as `together` says");
        let mut work = self.spare.take();
        work.packets.resize(beams, Packet::NONE);
        work.packets.iter_mut().for_each(|packet| packet.begin(range));
        work.far[..beams].fill(range);
        for (number, part) in (0..).zip(parts) {
            self.descend(window, number, part, rays, &mut work, range);
        }
        for ((packet, found), rim) in work.packets.iter().zip(hits).zip(rims) {
            let hit = |lane: usize| Hit { t: packet.t[lane], prim: packet.prim[lane] };
            *found = hit(0);
            *rim = std::array::from_fn(|k| hit(k + 1));
        }
        self.spare.put_back(work);
    }

    fn descend(
        &self,
        window: Window,
        number: u32,
        part: &SweptPart<'_>,
        rays: &[Rays],
        work: &mut SweepMemory,
        range: f32,
    ) {
        let tree = &part.bvh.bvh16;
        let known = || part.poses.iter().flatten();
        let Some(middle) = known().nth(known().count() / 2).filter(|_| !tree.nodes.is_empty())
        else {
            return;
        };
        let Some(eye) = self.eye(middle, part, range) else {
            return self.alone(window, part, rays, work);
        };
        let (grid, poses, channels) = (&self.grid, &part.poses[..], &self.channels[..]);
        let (first_prim, middles) = (part.first_prim, &self.middles[window.from / self.together()]);
        let swept = SweptInputs {
            grid,
            window,
            eye,
            tree,
            poses,
            channels,
            rays,
            middles,
            first_prim,
            number,
        };
        match self.instructions {
            Instructions::Best => walk(&swept, work),
            Instructions::Avx2 => walk_avx2(&swept, work),
            Instructions::Plain => plain::walk(&swept, work),
        }
    }

    /// The sensor in the middle of a window, and how far it lies from there at other steps; none where angles cannot
    /// be computed.
    fn eye(&self, middle: &DevicePose, part: &SweptPart<'_>, range: f32) -> Option<Eye> {
        let (mut moved, mut turned) = (0.0_f32, 0.0_f32);
        for pose in part.poses.iter().flatten() {
            let (mut move_square, mut turn_square) = (0.0, 0.0);
            for (row, other) in pose.rows.iter().zip(&middle.rows) {
                let off = |k: usize| (row[k] - other[k]) * (row[k] - other[k]);
                turn_square += off(0) + off(1) + off(2);
                move_square += off(3);
            }
            (moved, turned) = (moved.max(move_square), turned.max(turn_square));
        }
        let whole = TreeView { bvh: part.bvh, pose: *middle, first_prim: part.first_prim };
        let (moved, turned) = (1.01 * moved.sqrt(), 1.01 * turned.sqrt() + self.width);
        (Walk::fits(&whole) && moved < LARGEST && turned < 0.5).then(|| Eye {
            moved,
            turned,
            farthest: range,
            ..Eye::of(&whole)
        })
    }

    /// Packet by packet.
    fn alone(&self, window: Window, part: &SweptPart<'_>, rays: &[Rays], work: &mut SweepMemory) {
        let mut left = Vec::new();
        for (row, &channel) in self.channels.iter().enumerate() {
            for (column, pose) in part.poses.iter().enumerate() {
                let Some(pose) = pose else { continue };
                let at = column * self.channels.len() + channel;
                let rays = &rays[at];
                let Packet { t, prim, .. } = &mut work.packets[at];
                let mut hits: [Hit; RAYS] =
                    std::array::from_fn(|lane| Hit { t: t[lane], prim: prim[lane] });
                let ray = |lane: usize| {
                    let direction =
                        beam_direction(pose, [rays[0][lane], rays[1][lane], rays[2][lane]]);
                    Ray::new(beam_origin(pose), direction, t[lane])
                };
                let rays: [Ray; RAYS] = std::array::from_fn(ray);
                descend(part.bvh, part.first_prim, &rays, self.width, &mut hits, &mut left);
                (*t, *prim) = (hits.map(|hit| hit.t), hits.map(|hit| hit.prim));
                work.far[row * window.columns + column] = work.packets[at].farthest();
            }
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+fma+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt",
))]
fn walk(swept: &SweptInputs<'_>, work: &mut SweepMemory) {
    match_target! {
        "x86_64+avx+avx2+fma+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt" => {
            avx512::walk(swept, work)
        }
        "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt" => avx2::walk(swept, work),
        _ => plain::walk(swept, work),
    }
}

#[multiversion(targets("x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt"))]
fn walk_avx2(swept: &SweptInputs<'_>, work: &mut SweepMemory) {
    match_target! {
        "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt" => avx2::walk(swept, work),
        _ => plain::walk(swept, work),
    }
}

/// Inputs shared by all tests of one tree in one window of a turning sensor.
pub(super) struct SweptInputs<'a> {
    pub(super) grid: &'a Grid,
    window: Window,
    /// Eye in the middle of the window.
    eye: Eye,
    tree: &'a Bvh16,
    /// One for each step; none for one whose beams do not meet the tree.
    poses: &'a [Option<DevicePose>],
    /// Channel of each row.
    channels: &'a [usize],
    /// Rays of the window's beams, step by step.
    rays: &'a [Rays],
    /// Directions of their middles, row by row.
    middles: &'a Middles,
    /// Added to the index of each face.
    first_prim: u32,
    /// Tells parts apart.
    number: u32,
}

/// Numbers of the beams of a window by axis, `[row × columns + column]`, with room for a vector that begins at the
/// last beam.
type Middles = [Vec<f32>; 3];

/// Rows of a triangle that are looked at together.
const ROWS: usize = 64;

/// Working memory: the beams of a window, and the stack of tree nodes still to visit.
pub(super) struct SweepMemory {
    /// Step by step and channel by channel, as their rays.
    packets: Vec<Packet>,
    /// The farthest best hit of each packet, row by row.
    far: Box<[f32; ROOM]>,
    stack: Box<[Entry; STACK]>,
    rects: Rects,
    outlined: Outlined,
}

impl Default for SweepMemory {
    fn default() -> Self {
        Self {
            packets: Vec::new(),
            far: zeroed_box(),
            stack: zeroed_box(),
            rects: Zeroable::zeroed(),
            outlined: Zeroable::zeroed(),
        }
    }
}

per_target! {
    use super::{angles, descent, packet, triangles};

    /// Closest hits of a window's beams, where they are closer than the known hits.
    fn walk(swept: &SweptInputs<'_>, work: &mut SweepMemory) {
        let SweptInputs { grid, window, eye, tree, .. } = swept;
        boxes(grid, window, eye, &tree.nodes[0], &mut work.rects);
        let Some(root) = around(&work.rects) else { return };
        let across = |[first, last]: [u16; 2]| usize::from(last - first) + 1;
        if across(root.columns) == window.columns && across(root.rows) == swept.channels.len() {
            // The tree fills the window, so most beams meet it: turn all rays at once, in memory order.
            aim_all(swept, work);
        }
        work.stack[0] = root;
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let entry = work.stack[depth % STACK];
            if !visible(&work.far, window.columns, &entry) {
                continue;
            }
            if entry.child & BLOCK == 0 {
                let node = &tree.nodes[entry.child as usize];
                boxes(grid, window, eye, node, &mut work.rects);
                depth += push(node, &work.rects, &mut work.stack, depth);
                continue;
            }
            let index = (entry.child ^ BLOCK) as usize;
            let block = &tree.blocks[index];
            outlines(grid, window, eye, block, &mut work.rects, &mut work.outlined);
            let mut left = work.rects.seen;
            while left != 0 {
                let slot = left.trailing_zeros() as usize % W;
                left &= left - 1;
                meet_all(swept, work, index, slot);
            }
        }
    }

    /// Tests a triangle with the beams of its rectangle that may hit it.
    fn meet_all(swept: &SweptInputs<'_>, work: &mut SweepMemory, block: usize, slot: usize) {
        let [first, last] = [work.rects.rows[0][slot] as usize, work.rects.rows[1][slot] as usize];
        let [from, to] =
            [work.rects.columns[0][slot] as usize, work.rects.columns[1][slot] as usize];
        for first in (first..=last).step_by(ROWS) {
            for from in (from..=to).step_by(W) {
                let rows = [first, last.min(first + ROWS - 1)];
                meet_some(swept, work, block, slot, rows, [from, to.min(from + W - 1)]);
            }
        }
    }

    /// Tests a triangle with one tile of the window: at most `ROWS` rows by sixteen columns.
    fn meet_some(
        swept: &SweptInputs<'_>, work: &mut SweepMemory, block: usize, slot: usize,
        [first, last]: [usize; 2], [from, to]: [usize; 2]
    ) {
        let (block, across) = (&swept.tree.blocks[block], swept.window.columns);
        let mut may = [0_u16; ROWS];
        let mut columns = 0;
        for row in first..=last {
            let at = row * across + from;
            may[(row - first) % ROWS] = may_hit(swept, work, slot, at, to - from);
            columns |= may[(row - first) % ROWS];
        }
        while columns != 0 {
            let lane = columns.trailing_zeros() as usize % W;
            columns &= columns - 1;
            let column = from + lane;
            let Some(pose) = &swept.poses[column] else { continue };
            let seen = PacketFace::new(block, slot, [pose.rows[0][3], pose.rows[1][3], pose.rows[2][3]]);
            let fired = column * swept.channels.len();
            for row in first..=last {
                if may[(row - first) % ROWS] >> lane & 1 == 0 {
                    continue;
                }
                let at = fired + swept.channels[row];
                let packet = &mut work.packets[at];
                if packet.aimed_at != swept.number {
                    aim(packet, &swept.rays[at], pose, swept.number);
                }
                if meet(packet, &seen, swept.eye.pad, swept.first_prim) {
                    work.far[row * across + column] = packet.farthest();
                }
            }
        }
    }

    /// Turns all beams of the window to the frame of the part.
    fn aim_all(swept: &SweptInputs<'_>, work: &mut SweepMemory) {
        let channels = swept.channels.len();
        let columns = work.packets.chunks_exact_mut(channels).zip(swept.rays.chunks_exact(channels));
        for ((packets, rays), pose) in columns.zip(swept.poses) {
            let Some(pose) = pose else { continue };
            for (packet, rays) in packets.iter_mut().zip(rays) {
                aim(packet, rays, pose, swept.number);
            }
        }
    }

    /// A bit for each of `more` + 1 beams side by side that may hit a triangle where it counts.
    fn may_hit(swept: &SweptInputs<'_>, work: &SweepMemory, slot: usize, at: usize, more: usize) -> u16 {
        let middles = swept.middles;
        let Some(x) = middles[0][at..].first_chunk() else { return 0 };
        let Some(y) = middles[1][at..].first_chunk() else { return 0 };
        let Some(z) = middles[2][at..].first_chunk() else { return 0 };
        let middle = [load(x), load(y), load(z)];
        let Outlined { edges, margin, .. } = &work.outlined;
        let [u, v, w] = three!(E => {
            add(dot(three!(K => splat(edges[E][K][slot])), middle), splat(margin[E][slot]))
        });
        let near = le(splat(work.rects.distance[slot]), load(some(&work.far, at)));
        let may = both(near, le(splat(0.0), min(min(u, v), w)));
        bits(may) & ((2_u32 << more) - 1) as u16
    }
}
