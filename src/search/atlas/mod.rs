//! Coverage of sensor poses on a grid: each pose is cast once, a placement is the union of its
//! sensors' bitmaps.
//!
//! The sums over a union are those that a [`Backend`] gives for the placement, to the bit.

mod areas;
mod casting;
mod order;

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use rayon::prelude::*;

use crate::cover::BitOrder;
use crate::engine::{Backend, BackendError};
use crate::problem::{KINDS, Problem, REPEATS, Tally};
use crate::score::Needed;
use crate::vehicle::PoseGrid;
pub(crate) use areas::AreaBits;
use casting::Pace;
use order::{LevelOrder, Sparse, ToLevels};

/// Poses cast at once: enough to keep every core busy, few enough for their bitmaps to fit anywhere.
pub(crate) const POSES_AT_ONCE: usize = 32;
/// Casts, of a pose in a frame, between two calls of `go_on`.
pub(crate) const CASTS_AT_ONCE: usize = 2048;
/// Words of a union that are put together at a time: they stay in the first-level cache for all poses.
const UNION_WORDS: usize = 2048;

/// Bitmaps of poses of a [`PoseGrid`], within a bound of memory.
pub struct Atlas {
    problem: Arc<Problem>,
    grid: PoseGrid,
    order: LevelOrder,
    /// Levels of repeated coverage that unions keep, see [`Needed::repeats`].
    repeats: usize,
    areas: AreaBits,
    /// Map to level order from the bit order of the engine that cast last.
    to_levels: Option<ToLevels>,
    /// Bit order in which empty voxels are kept: that of the engine that cast first.
    empty_order: Option<BitOrder>,
    /// Words of a bitmap of all voxels in any engine's order, 0 where their number does not matter.
    empty_words: usize,
    pages: HashMap<u32, Page>,
    pub(super) capacity: usize,
    /// Limits of pages and bytes; beyond both, pages used longest ago are dropped.
    ample: Option<(usize, u64)>,
    /// Counts requests; pages remember the last one that asked for them.
    clock: u64,
    cast: HashSet<u32>,
    /// True if the problem is a mirror image, in which poses stand mirrored.
    mirrored: bool,
}

/// Voxels that one pose covers, as bitmaps.
struct Page {
    /// Occupied voxels in level order, frame after frame.
    occupied: Box<[u64]>,
    /// Empty voxels, one bitmap a frame; no bitmap where their number does not matter.
    empty: Vec<Arc<Sparse>>,
    /// Voxels of required areas, frame after frame.
    areas: Box<[u64]>,
    used: u64,
}

impl Page {
    fn bytes(&self) -> u64 {
        let empty: u64 = self.empty.iter().map(|empty| empty.bytes()).sum();
        size_of_val(&self.occupied[..]) as u64 + size_of_val(&self.areas[..]) as u64 + empty
    }
}

/// The union of some sensors' coverage, to which others are added.
#[derive(Debug, Clone, Default)]
pub struct Union {
    /// Occupied voxels that at least one pose covers, then those that two and three do where that counts; each laid out as
    /// in a `Page`.
    occupied: [Vec<u64>; 1 + REPEATS],
    empty: Vec<u64>,
    empty_count: u64,
    areas: Vec<u64>,
}

impl Atlas {
    /// An empty atlas of a problem that holds at most about `bytes` of bitmaps, but always enough for
    /// one placement.
    ///
    /// Only the sums that are `needed` are kept: entropies of other kinds stay 0, and [`Tally::covered`] stays 1
    /// where anything is covered if empty voxels, ten times as many bits as the others, do not count.
    pub fn new(problem: Arc<Problem>, grid: PoseGrid, needed: Needed, bytes: u64) -> Self {
        let order = LevelOrder::new(problem.content(), needed.entropies);
        let areas = AreaBits::new(problem.content());
        let empty_words = if needed.empty { BitOrder::most_words(problem.roi()) } else { 0 };
        let page = 8
            * (problem.frame_count() * (order.words() + empty_words + areas.words())).max(1) as u64;
        let capacity = (bytes / page).max(crate::vehicle::MAX_LIDARS as u64) as usize;
        Self {
            problem,
            grid,
            order,
            repeats: needed.repeats,
            areas,
            to_levels: None,
            empty_order: None,
            empty_words,
            pages: HashMap::new(),
            capacity,
            ample: None,
            clock: 0,
            cast: HashSet::new(),
            mirrored: false,
        }
    }

    /// Makes this the atlas of a mirror image, in which poses stand mirrored; see [`Problem::mirrored`].
    #[must_use]
    pub(crate) fn of_mirror_image(mut self, mirrored: bool) -> Self {
        self.mirrored = mirrored;
        self
    }

    /// Drops poses used longest ago once there are more than `poses` and more than about `bytes` bytes of them. Fits a
    /// search that looks at a few poses at a time and seldom comes back to old ones.
    pub fn forget_beyond(&mut self, poses: usize, bytes: u64) {
        self.ample = Some((poses, bytes));
    }

    /// Poses held.
    pub fn held(&self) -> usize {
        self.pages.len()
    }

    /// The grid of its poses.
    pub fn grid(&self) -> &PoseGrid {
        &self.grid
    }

    /// The problem in which the poses are cast.
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// Poses that fit at once.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Bytes of one pose, at most.
    pub fn page_bytes(&self) -> usize {
        let words = self.order.words() + self.empty_words + self.areas.words();
        8 * self.problem.frame_count() * words
    }

    /// Distinct poses cast so far. A pose that is dropped and cast again counts once, so that a limit of casts does not
    /// depend on memory.
    pub fn poses_cast(&self) -> u64 {
        self.cast.len() as u64
    }

    /// Makes sure that `poses` are held; drops those used longest ago where room is needed.
    ///
    /// # Errors
    /// More poses than [`Self::capacity`], or from the backend.
    pub fn hold(&mut self, backend: &mut dyn Backend, poses: &[u32]) -> Result<(), BackendError> {
        self.hold_while(backend, poses, &mut |_| true).map(drop)
    }

    /// Like [`Self::hold`], and asks `go_on` after every [`CASTS_AT_ONCE`] casts, with [`Self::poses_cast`]. False once
    /// it says no: poses that were being cast are then not held.
    pub(crate) fn hold_while(
        &mut self,
        backend: &mut dyn Backend,
        poses: &[u32],
        go_on: &mut dyn FnMut(u64) -> bool,
    ) -> Result<bool, BackendError> {
        self.clock += 1;
        let mut missing = Vec::new();
        for &pose in poses {
            match self.pages.get_mut(&pose) {
                Some(page) => page.used = self.clock,
                None => missing.push(pose),
            }
        }
        missing.sort_unstable();
        missing.dedup();
        self.make_room(missing.len())?;
        let mut pace = Pace::new(go_on);
        for some in missing.chunks(POSES_AT_ONCE) {
            let Some(pages) = self.cast(backend, some, &mut pace)? else { return Ok(false) };
            self.cast.extend(some);
            self.pages.extend(some.iter().copied().zip(pages));
        }
        if let Some((poses, bytes)) = self.ample.filter(|_| !missing.is_empty()) {
            self.forget(poses, bytes);
        }
        Ok(true)
    }

    /// Drops idle pages, those used longest ago first, until the pages or the bytes left are few enough.
    fn forget(&mut self, enough_pages: usize, enough_bytes: u64) {
        let mut bytes: u64 = self.pages.values().map(Page::bytes).sum();
        let now = self.clock;
        let idle = self.pages.iter().filter(|(_, page)| page.used < now);
        let mut idle: Vec<(u64, u32)> = idle.map(|(&pose, page)| (page.used, pose)).collect();
        idle.sort_unstable();
        for (_, pose) in idle {
            if bytes <= enough_bytes || self.pages.len() <= enough_pages {
                break;
            }
            bytes -= self.pages.remove(&pose).map_or(0, |page| page.bytes());
        }
    }

    fn make_room(&mut self, wanted: usize) -> Result<(), BackendError> {
        let surplus = (self.pages.len() + wanted).saturating_sub(self.capacity);
        if surplus == 0 {
            return Ok(());
        }
        let now = self.clock;
        let idle = self.pages.iter().filter(|(_, page)| page.used < now);
        let mut idle: Vec<(u64, u32)> = idle.map(|(&pose, page)| (page.used, pose)).collect();
        if idle.len() < surplus {
            let page = self.page_bytes() as u64;
            let need = page * (self.pages.len() - idle.len() + wanted) as u64;
            let limit = page * self.capacity as u64;
            return Err(BackendError::TooLarge { what: "the pose atlas", need, limit });
        }
        idle.sort_unstable();
        for (_, pose) in &idle[..surplus] {
            self.pages.remove(pose);
        }
        Ok(())
    }

    /// Occupied voxels that a held pose covers, a bit each: frame after frame, in the order of [`Self::worths`].
    pub(crate) fn occupied_of(&self, pose: u32) -> &[u64] {
        &self.page(pose).occupied
    }

    /// The fixed-point entropies of each bit of a frame; zero for bits without a voxel.
    pub(crate) fn worths(&self) -> Vec<[u32; KINDS]> {
        self.order.entropies(self.problem.content())
    }

    fn page(&self, pose: u32) -> &Page {
        self.pages.get(&pose).expect("callers hold the poses they ask about")
    }

    /// The union of held poses.
    ///
    /// # Panics
    /// A pose is not held.
    pub fn union(&self, poses: &[u32], union: &mut Union) {
        let pages: Vec<&Page> = poses.iter().map(|&pose| self.page(pose)).collect();
        let frames = self.problem.frame_count();
        let mut blocks: Vec<Vec<&mut [u64]>> = Vec::new();
        blocks.resize_with((frames * self.order.words()).div_ceil(UNION_WORDS), Vec::new);
        for level in &mut union.occupied[..=self.repeats] {
            level.resize(frames * self.order.words(), 0);
            let parts = level.chunks_mut(UNION_WORDS);
            blocks.iter_mut().zip(parts).for_each(|(block, part)| block.push(part));
        }
        blocks.par_iter_mut().enumerate().for_each(|(block, levels)| {
            levels.iter_mut().for_each(|level| level.fill(0));
            let first = block * UNION_WORDS;
            pages.iter().for_each(|page| add_page(levels, &page.occupied[first..]));
        });
        union.areas.clear();
        union.areas.resize(frames * self.areas.words(), 0);
        for page in &pages {
            union.areas.iter_mut().zip(&page.areas).for_each(|(or, word)| *or |= word);
        }
        union.empty.clear();
        union.empty.resize(frames * self.empty_words, 0);
        union.empty_count = 0;
        for (frame, words) in union.empty.chunks_mut(self.empty_words.max(1)).enumerate() {
            for page in &pages {
                union.empty_count += page.empty[frame].count_beyond(words);
                page.empty[frame].add_to(words);
            }
        }
    }

    /// Share that a union, and one more held pose if any, miss of required areas, summed over areas.
    pub(crate) fn missing_with(&self, union: &Union, pose: Option<u32>) -> f64 {
        let Some(pose) = pose else { return self.areas.missing(&union.areas) };
        let both = union.areas.iter().zip(&self.page(pose).areas).map(|(a, b)| a | b);
        self.areas.missing(&both.collect::<Vec<u64>>())
    }

    /// Share of each required area that some held poses see together, over all frames.
    pub(crate) fn area_shares(&self, poses: &[u32]) -> Vec<f64> {
        let mut all = vec![0; self.problem.frame_count() * self.areas.words()];
        for page in poses.iter().map(|&pose| self.page(pose)) {
            all.iter_mut().zip(&page.areas).for_each(|(or, word)| *or |= word);
        }
        self.areas.shares(&all)
    }

    pub(crate) fn has_areas(&self) -> bool {
        self.areas.words() > 0
    }

    /// Sums over the voxels of the union and of one more held pose, added up over frames.
    ///
    /// Only the sums of an objective are filled in: entropies, `covered_nonzero` and `covered`.
    ///
    /// # Panics
    /// The pose is not held.
    pub fn tally_with(&self, union: &Union, pose: u32) -> Tally {
        // No words at all where no voxel is ever occupied.
        let each = self.order.words().max(1);
        let mut tally = Tally::default();
        let page = self.page(pose);
        for (a, b) in union.occupied[0].chunks(each).zip(page.occupied.chunks(each)) {
            self.order.add_union(a, b, &mut tally);
        }
        for (level, sum) in tally.near_repeated[..self.repeats].iter_mut().enumerate() {
            let [below, own] = [0, 1].map(|above| union.occupied[level + above].chunks(each));
            for ((own, below), page) in own.zip(below).zip(page.occupied.chunks(each)) {
                *sum += self.order.near_of(own, below, page);
            }
        }
        if self.empty_words == 0 {
            tally.covered = u64::from(tally.covered_nonzero > 0);
            return tally;
        }
        tally.covered = tally.covered_nonzero + union.empty_count;
        for (a, b) in union.empty.chunks(self.empty_words).zip(&page.empty) {
            tally.covered += b.count_beyond(a);
        }
        tally
    }
}

/// Adds a pose's words to those of unions: the lowest level holds what any pose covers, each other one what covers the
/// level below once more.
fn add_page(levels: &mut [&mut [u64]], page: &[u64]) {
    for level in (1..levels.len()).rev() {
        let (below, own) = levels.split_at_mut(level);
        let both = below[level - 1].iter().zip(page).map(|(below, word)| below & word);
        own[0].iter_mut().zip(both).for_each(|(or, word)| *or |= word);
    }
    for (or, word) in levels[0].iter_mut().zip(page) {
        *or |= word;
    }
}

impl Drop for Atlas {
    /// Frees pages on all threads: there are gigabytes of them.
    fn drop(&mut self) {
        std::mem::take(&mut self.pages).into_par_iter().for_each(drop);
    }
}
