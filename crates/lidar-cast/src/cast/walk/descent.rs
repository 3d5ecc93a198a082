//! A window's way down the tree, and the working memory of a walk: a window's beams, nodes still to visit, and listed hit
//! tests.

use bytemuck::{Zeroable, zeroed_box};

use super::angles::Rects;
use super::grid::{BEAMS, Directions, ROOM};
use super::hits::WalkInputs;
use super::ops::{W, per_target};
use super::triangles::TriangleView;
use crate::bvh::MAX_DEPTH;
use crate::bvh::bvh16::{BLOCK, Bvh16, Node16};

/// Entries of the stack: each level leaves at most all children but one behind.
pub(super) const STACK: usize = (MAX_DEPTH * (W - 1) + 1).next_power_of_two();
/// Blocks whose triangles are tested together.
const BLOCKS: usize = 2;
/// Tests that are listed before they are done.
pub(super) const TESTS: usize = 2048;

/// A part of the tree to visit: the beams that may meet it, and where it begins.
#[derive(Clone, Copy, Zeroable)]
pub(super) struct Entry {
    pub(super) child: u32,
    distance: f32,
    /// First and last row and column.
    pub(super) rows: [u16; 2],
    pub(super) columns: [u16; 2],
}

/// A triangle with up to sixteen beams of a row, 24 bits: 0–14 first beam, 15–18 beams less one, 19–22
/// slot in the block, 23 block. E.g. beams 5 to 7 with the triangle in slot 2 of block 1:
/// `5 | 2 << 15 | 2 << 19 | 1 << 23`.
#[derive(Clone, Copy)]
pub(super) struct Test {
    pub(super) at: usize,
    pub(super) lanes: u16,
    pub(super) slot: usize,
    pub(super) block: usize,
}

pub(super) const LENGTH_SHIFT: i32 = 1 << 15;
pub(super) const SLOT_SHIFT: i32 = 1 << 19;
pub(super) const BLOCK_SHIFT: i32 = 1 << 23;

impl Test {
    #[inline(always)]
    pub(super) fn of(word: i32) -> Self {
        let word = word as usize;
        Self {
            at: word & (BEAMS - 1),
            lanes: ((2_u32 << (word >> 15 & 15)) - 1) as u16,
            slot: word >> 19 & (W - 1),
            block: word >> 23 & (BLOCKS - 1),
        }
    }
}

/// World directions, their inverses and the best hits of a window's beams.
#[repr(C)]
#[derive(Clone, Copy, Zeroable)]
pub(super) struct WindowBeams {
    pub(super) direction: Directions,
    pub(super) inverse: Directions,
    pub(super) t: [f32; ROOM],
    pub(super) prim: [i32; ROOM],
}

/// Listed tests; `inside` keeps the ones in which a beam passes between the edges: the test, then a bit for
/// each beam that may and each that surely does.
#[derive(Zeroable)]
pub(super) struct Tests {
    pub(super) words: [i32; TESTS],
    pub(super) len: usize,
    pub(super) inside: [(i32, u16, u16); TESTS],
}

/// All of it, kept from sensor to sensor.
pub(super) struct WalkMemory {
    pub(super) beams: Box<WindowBeams>,
    stack: Box<[Entry; STACK]>,
    pub(super) tests: Box<Tests>,
    pub(super) rects: [Rects; BLOCKS],
    pub(super) seen: [TriangleView; BLOCKS],
    /// The blocks' indices.
    pub(super) blocks: [usize; BLOCKS],
}

impl Default for WalkMemory {
    fn default() -> Self {
        let (beams, stack, tests) = (zeroed_box(), zeroed_box(), zeroed_box());
        let (rects, seen) = (Zeroable::zeroed(), Zeroable::zeroed());
        Self { beams, stack, tests, rects, seen, blocks: [0; BLOCKS] }
    }
}

/// Sixteen numbers from a place on.
#[inline(always)]
pub(super) fn some<T>(numbers: &[T; ROOM], at: usize) -> &[T; W] {
    numbers[at & (BEAMS - 1)..].first_chunk().expect("there is room behind the last beam")
}

#[inline(always)]
pub(super) fn some_mut<T>(numbers: &mut [T; ROOM], at: usize) -> &mut [T; W] {
    numbers[at & (BEAMS - 1)..].first_chunk_mut().expect("there is room behind the last beam")
}

/// Vectors of a rectangle that are searched for a beam which sees far enough; larger ones have one.
const SEARCHED: usize = 48;

per_target! {
    use super::{angles, triangles, hits};

    /// Closest hits of a window's beams, where they are closer than those that `work` holds.
    ///
    /// Directions are computed for the rectangle in which the tree is seen alone.
    fn walk(scene: &mut WalkInputs<'_>, tree: &Bvh16, work: &mut WalkMemory) {
        let columns = scene.window.columns;
        boxes(scene.grid, &scene.window, &scene.eye, &tree.nodes[0], &mut work.rects[0]);
        let Some(root) = around(&work.rects[0]) else { return };
        let mut farthest = f32::NEG_INFINITY;
        let [from, to] = root.columns.map(usize::from);
        for row in root.rows[0]..=root.rows[1] {
            let row = usize::from(row) * columns;
            let axes = &scene.eye.axes;
            farthest = farthest.max(turn(scene.local, axes, &mut work.beams, row + from, row + to));
        }
        scene.eye.farthest = farthest;
        work.stack[0] = root;
        let mut depth = 1;
        while depth > 0 {
            depth -= 1;
            let entry = work.stack[depth % STACK];
            if !visible(&work.beams.t, columns, &entry) {
                continue;
            }
            if entry.child & BLOCK == 0 {
                let node = &tree.nodes[entry.child as usize];
                boxes(scene.grid, &scene.window, &scene.eye, node, &mut work.rects[0]);
                depth += push(node, &work.rects[0], &mut work.stack, depth);
                continue;
            }
            work.blocks[0] = (entry.child ^ BLOCK) as usize;
            let mut blocks = 1;
            while blocks < BLOCKS && depth > 0 && work.stack[(depth - 1) % STACK].child & BLOCK != 0 {
                depth -= 1;
                let entry = work.stack[depth % STACK];
                work.blocks[blocks] = (entry.child ^ BLOCK) as usize;
                blocks += usize::from(visible(&work.beams.t, columns, &entry));
            }
            for k in 0..blocks {
                let block = &scene.blocks[work.blocks[k]];
                let (rects, seen) = (&mut work.rects[k], &mut work.seen[k]);
                triangles(scene.grid, &scene.window, &scene.eye, block, rects, seen);
            }
            for k in 0..blocks {
                list(scene, work, k);
            }
            test(scene, work);
        }
    }

    /// True if a beam of the rectangle sees as far as where it begins: equal distances may go to a lower
    /// face.
    fn visible(t: &[f32; ROOM], columns: usize, entry: &Entry) -> bool {
        let [from, to] = entry.columns.map(usize::from);
        let [first, last] = entry.rows.map(usize::from);
        if ((to - from) / W + 1) * (last - first + 1) > SEARCHED {
            return true;
        }
        let distance = splat(entry.distance);
        for row in first..=last {
            for column in (from..=to).step_by(W) {
                let lanes = ((2_u32 << (to - column).min(W - 1)) - 1) as u16;
                let sees = bits(le(distance, load(some(t, row * columns + column))));
                if sees & lanes != 0 {
                    return true;
                }
            }
        }
        false
    }

    /// Puts the children that are seen on the stack, the nearest on top; how many they are.
    fn push(node: &Node16, rects: &Rects, stack: &mut [Entry; STACK], depth: usize) -> usize {
        // Distances sort as integers; the last bits tell children apart.
        let mut keys = [-1; W];
        for i in 0..W {
            let key = rects.distance[i].max(0.0).to_bits() as i32 & !15 | i as i32;
            keys[i] = if rects.seen >> i & 1 != 0 { key } else { -1 };
        }
        let own = load_i(&keys);
        let (mut farther, one) = (splat_i(0), splat_i(1));
        for key in keys {
            let near_or_same = le_i(splat_i(key), own);
            farther = add_i(farther, select_i(near_or_same, splat_i(0), one));
        }
        let farther = store_i(farther);
        let mut left = rects.seen;
        while left != 0 {
            let i = left.trailing_zeros() as usize % W;
            left &= left - 1;
            stack[(depth + farther[i] as usize) % STACK] = Entry {
                child: node.children[i],
                distance: rects.distance[i],
                rows: [rects.rows[0][i] as u16, rects.rows[1][i] as u16],
                columns: [rects.columns[0][i] as u16, rects.columns[1][i] as u16],
            };
        }
        rects.seen.count_ones() as usize
    }
}

/// Root entry: the rectangle around its children's rectangles; `None` if no child is seen.
pub(super) fn around(rects: &Rects) -> Option<Entry> {
    let seen = || (0..W).filter(|i| rects.seen >> i & 1 != 0);
    let least = |all: &[i32; W]| seen().map(|i| all[i] as u16).min();
    let most = |all: &[i32; W]| seen().map(|i| all[i] as u16).max();
    let rows = [least(&rects.rows[0])?, most(&rects.rows[1])?];
    let columns = [least(&rects.columns[0])?, most(&rects.columns[1])?];
    Some(Entry { child: 0, distance: f32::NEG_INFINITY, rows, columns })
}
