//! Working memory of a walk: a window's beams, nodes still to visit, and listed hit tests.

use bytemuck::{Zeroable, zeroed_box};

use super::angles::Rects;
use super::grid::{BEAMS, Directions, ROOM};
use super::ops::W;
use super::triangles::TriangleView;
use crate::bvh::MAX_DEPTH;

/// Entries of the stack: each level leaves at most all children but one behind.
pub(super) const STACK: usize = (MAX_DEPTH * (W - 1) + 1).next_power_of_two();
/// Blocks whose triangles are tested together.
pub(super) const BLOCKS: usize = 2;
/// Tests that are listed before they are done.
pub(super) const TESTS: usize = 2048;

/// A part of the tree to visit: the beams that may meet it, and where it begins.
#[derive(Clone, Copy, Default)]
pub(super) struct Entry {
    pub(super) child: u32,
    pub(super) distance: f32,
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
pub(super) struct Tests {
    pub(super) words: [i32; TESTS],
    pub(super) len: usize,
    pub(super) inside: [(i32, u16, u16); TESTS],
}

/// All of it, kept from sensor to sensor.
pub(super) struct WalkMemory {
    pub(super) beams: Box<WindowBeams>,
    pub(super) stack: Box<[Entry; STACK]>,
    pub(super) tests: Box<Tests>,
    pub(super) rects: [Rects; BLOCKS],
    pub(super) seen: [TriangleView; BLOCKS],
    /// The blocks' indices.
    pub(super) blocks: [usize; BLOCKS],
}

impl Default for WalkMemory {
    fn default() -> Self {
        let tests = Tests { words: [0; TESTS], len: 0, inside: [(0, 0, 0); TESTS] };
        Self {
            beams: zeroed_box(),
            stack: Box::new([Entry::default(); STACK]),
            tests: Box::new(tests),
            rects: [Rects::NOTHING; BLOCKS],
            seen: [TriangleView::NOTHING; BLOCKS],
            blocks: [0; BLOCKS],
        }
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
