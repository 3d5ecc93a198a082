//! The way down a tree of neighbouring azimuth steps that are fired from places of their own.

use super::angles::{Eye, Rects};
use super::descent::around;
use super::grid::{Grid, ROOM, Window};
use super::ops::{W, per_target, three};
use super::packet::{Packet, Rays, Seen};
use super::triangles::Seen as Outlined;
use super::work::{Entry, STACK, some};
use crate::bvh::bvh16::{BLOCK, Bvh16};
use crate::task::DevicePose;

/// Inputs shared by all tests of one tree in one window of a turning sensor.
pub(super) struct Swept<'a> {
    pub(super) grid: &'a Grid,
    pub(super) window: Window,
    /// Eye in the middle of the window.
    pub(super) eye: Eye,
    pub(super) tree: &'a Bvh16,
    /// One for each step; none for one whose beams do not meet the tree.
    pub(super) poses: &'a [Option<DevicePose>],
    /// Channel of each row.
    pub(super) channels: &'a [usize],
    /// Rays of the window's beams, step by step.
    pub(super) rays: &'a [Rays],
    /// Directions of their middles, row by row.
    pub(super) middles: &'a Middles,
    /// Added to the index of each face.
    pub(super) first_prim: u32,
    /// Tells parts apart.
    pub(super) number: u32,
}

/// Numbers of the beams of a window by axis, `[row × columns + column]`, with room for a vector that begins at the
/// last beam.
pub(super) type Middles = [Vec<f32>; 3];

/// Rows of a triangle that are looked at together.
const ROWS: usize = 64;

/// Working memory: the beams of a window, and the stack of tree nodes still to visit.
pub(super) struct Sweeping {
    /// Step by step and channel by channel, as their rays.
    pub(super) packets: Vec<Packet>,
    /// The farthest best hit of each packet, row by row.
    pub(super) far: Box<[f32; ROOM]>,
    stack: Box<[Entry; STACK]>,
    rects: Rects,
    outlined: Outlined,
}

impl Default for Sweeping {
    fn default() -> Self {
        Self {
            packets: Vec::new(),
            far: bytemuck::zeroed_box(),
            stack: Box::new([Entry::default(); STACK]),
            rects: Rects::NOTHING,
            outlined: Outlined::NOTHING,
        }
    }
}

per_target! {
    use super::{angles, boxes, descent, packet, triangles};

    /// Closest hits of a window's beams, where they are closer than those known.
    fn walk(swept: &Swept<'_>, work: &mut Sweeping) {
        let Swept { grid, window, eye, tree, .. } = swept;
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

    /// Tests a triangle with those beams of its rectangle that may hit it.
    fn meet_all(swept: &Swept<'_>, work: &mut Sweeping, block: usize, slot: usize) {
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
        swept: &Swept<'_>, work: &mut Sweeping, block: usize, slot: usize,
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
            let seen = Seen::new(block, slot, [pose.rows[0][3], pose.rows[1][3], pose.rows[2][3]]);
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
    fn aim_all(swept: &Swept<'_>, work: &mut Sweeping) {
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
    fn may_hit(swept: &Swept<'_>, work: &Sweeping, slot: usize, at: usize, more: usize) -> u16 {
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
