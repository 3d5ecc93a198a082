//! One walk a sensor: the beams that a box or triangle can meet are a rectangle of indices.
//!
//! `README.md` names the job of each file.

mod angles;
mod descent;
mod firing;
mod grid;
mod hits;
mod ops;
mod packet;
mod triangles;

pub(super) use ops::three;

use multiversion::multiversion;
use multiversion::target::match_target;
use rayon::prelude::*;

use crate::bvh::bvh16::Bvh16;
use crate::bvh::{Bvh, Hit};
use crate::memory::FreeList;
use crate::sensor::BeamTable;
use crate::task::DevicePose;
use angles::Eye;
use descent::{WalkMemory, WindowBeams};
use grid::{Directions, Grid, Window};
use hits::WalkInputs;

pub use firing::{FiringWalk, SweptPart};
pub use packet::{RAYS, Rays};

/// Largest coordinate in metres whose products stay far from the largest number.
const LARGEST: f32 = 1e7;
/// How far a pose's rotation may be from one.
const ROTATED: f32 = 1e-4;

/// Instructions that a walk may use; each gives the same bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Instructions {
    /// The best that the machine has.
    Best,
    /// AVX2 where the machine has it.
    Avx2,
    /// Instructions that every machine has.
    Plain,
}

/// The beams of a sensor model as a grid, for any number of sensors.
pub(super) struct Walk {
    grid: Grid,
    instructions: Instructions,
    /// Working memory that no walk uses at the moment.
    spare: FreeList<WalkMemory>,
}

impl Walk {
    pub(super) fn new(table: &BeamTable, instructions: Instructions) -> Option<Self> {
        Some(Self { grid: Grid::new(table)?, instructions, spare: FreeList::default() })
    }

    /// True if angles can be computed for a part: its pose turns, and no number is too large.
    pub(super) fn fits(part: &TreeView<'_>) -> bool {
        let rows = part.pose.rows;
        let axis = |k: usize| rows.map(|row| row[k]);
        let dot = |a: [f32; 3], b: [f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let turns = (0..3)
            .all(|i| (0..=i).all(|k| (dot(axis(i), axis(k)) - f32::from(i == k)).abs() < ROTATED));
        let small = axis(3).iter().all(|x| x.abs() < LARGEST);
        turns && small && part.bvh.bvh16.largest < LARGEST
    }

    /// Windows that the beams are cut into.
    pub(super) fn windows(&self) -> usize {
        self.grid.windows.len()
    }

    /// Replaces hits of a sensor by closer ones, and by equally close ones of a lower face. Windows go
    /// side by side where `parallel`.
    pub(super) fn cast(&self, parts: &[TreeView<'_>], parallel: bool, hits: &mut [Hit]) {
        if parallel && !parts.is_empty() && rayon::current_num_threads() > 1 {
            let before = &*hits;
            let windows = self.grid.windows.par_iter();
            let done: Vec<_> =
                windows.map(|window| (window.0, self.cast_window(window, parts, before))).collect();
            for (window, work) in done {
                self.write(window, work, hits);
            }
        } else {
            (0..self.windows()).for_each(|window| self.cast_in(window, parts, hits));
        }
    }

    /// Casts one window's beams on the calling thread: closer hits replace those in `hits`.
    pub(super) fn cast_in(&self, window: usize, parts: &[TreeView<'_>], hits: &mut [Hit]) {
        if !parts.is_empty() {
            let window = &self.grid.windows[window];
            let work = self.cast_window(window, parts, hits);
            self.write(window.0, work, hits);
        }
    }

    fn cast_window(
        &self,
        (window, local): &(Window, Box<Directions>),
        parts: &[TreeView<'_>],
        hits: &[Hit],
    ) -> WalkMemory {
        let mut work = self.spare.take();
        self.read(*window, hits, &mut work.beams);
        parts.iter().for_each(|part| self.descend(*window, local, part, &mut work));
        work
    }

    /// Closer hits of a window's beams in one tree.
    fn descend(
        &self,
        window: Window,
        local: &Directions,
        part: &TreeView<'_>,
        work: &mut WalkMemory,
    ) {
        let tree = &part.bvh.bvh16;
        if tree.nodes.is_empty() {
            return;
        }
        let eye = Eye::of(part);
        let (grid, blocks, first_prim) = (&self.grid, &tree.blocks, part.first_prim);
        let mut scene = WalkInputs { grid, window, local, eye, blocks, first_prim };
        match self.instructions {
            Instructions::Best => walk(&mut scene, tree, work),
            Instructions::Avx2 => walk_avx2(&mut scene, tree, work),
            Instructions::Plain => descent::plain::walk(&mut scene, tree, work),
        }
    }

    /// Takes the hits of a window.
    fn read(&self, window: Window, hits: &[Hit], beams: &mut WindowBeams) {
        let Window { from, columns } = window;
        if !self.grid.turn {
            // No hit is closer than that.
            beams.t[..self.grid.row_count() * columns].fill(f32::NEG_INFINITY);
        }
        for row in 0..self.grid.row_count() {
            for piece in self.grid.pieces(from, columns, row) {
                let at = row * columns + piece.column;
                let hits = &hits[piece.beam..piece.beam + piece.len];
                let t = beams.t[at..at + piece.len].iter_mut();
                for ((t, prim), hit) in t.zip(&mut beams.prim[at..]).zip(hits) {
                    (*t, *prim) = (hit.t, hit.prim as i32);
                }
            }
        }
    }

    /// Gives the hits of a window back.
    fn write(&self, window: Window, work: WalkMemory, hits: &mut [Hit]) {
        let Window { from, columns } = window;
        let beams = &work.beams;
        for row in 0..self.grid.row_count() {
            for piece in self.grid.pieces(from, columns, row) {
                let at = row * columns + piece.column;
                let hits = hits[piece.beam..piece.beam + piece.len].iter_mut();
                for ((hit, &t), &prim) in hits.zip(&beams.t[at..]).zip(&beams.prim[at..]) {
                    *hit = Hit { t, prim: prim as u32 };
                }
            }
        }
        self.spare.put_back(work);
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+fma+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt",
))]
fn walk(scene: &mut WalkInputs<'_>, tree: &Bvh16, work: &mut WalkMemory) {
    match_target! {
        "x86_64+avx+avx2+fma+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt" => {
            descent::avx512::walk(scene, tree, work)
        }
        "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt" => descent::avx2::walk(scene, tree, work),
        _ => descent::plain::walk(scene, tree, work),
    }
}

#[multiversion(targets("x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt"))]
fn walk_avx2(scene: &mut WalkInputs<'_>, tree: &Bvh16, work: &mut WalkMemory) {
    match_target! {
        "x86_64+avx+avx2+fma+bmi1+bmi2+popcnt+lzcnt" => descent::avx2::walk(scene, tree, work),
        _ => descent::plain::walk(scene, tree, work),
    }
}

/// A tree, and the sensor's pose in its frame.
#[derive(Clone, Copy)]
pub struct TreeView<'a> {
    /// The tree.
    pub bvh: &'a Bvh,
    /// From the sensor's frame to the tree's.
    pub pose: DevicePose,
    /// Added to the index of each face.
    pub first_prim: u32,
}
