//! Voxels in groups by how many poses cover them, as bitmaps a pose: the columns of a maximum coverage
//! problem.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use crate::search::atlases::Atlases;

/// Largest worth of a level as a multiple of its least one. Overlaps of pairs count at the least worth, so that the bound
/// stays valid.
const WORTH_SPREAD: f64 = 1.05;
/// Rows of a matrix of overlaps that are filled together.
const ROWS: usize = 8;
/// Words of a bitmap that are read at once: those of all rows together fit into the smallest cache.
const WORDS: usize = 256;

/// Words of bitmaps that are compared between two questions whether to go on: less than a second's, and few in the tests of
/// this crate.
const WORDS_AT_ONCE: u64 = if cfg!(test) { 1 << 12 } else { 1 << 30 };

/// The columns of a maximum coverage problem: every voxel of every frame that some pose covers, in
/// groups by the share of some typical poses that cover it.
pub(in crate::search) struct Columns {
    poses: usize,
    words: usize,
    /// `[poses × words]`.
    bitmaps: Vec<u64>,
    /// Columns that few typical poses cover first.
    pub groups: Vec<Group>,
    /// Σ worth of the columns that more typical poses cover than those of any group.
    pub rest: u64,
}

/// Columns that similar shares of the typical poses cover.
pub(in crate::search) struct Group {
    levels: Vec<WorthLevel>,
    /// Σ worth of the columns that each pose covers.
    pub singles: Vec<u64>,
    /// Σ worth of the columns.
    pub total: u64,
}

impl Group {
    fn none(poses: usize) -> Self {
        Self { levels: vec![], singles: vec![0; poses], total: 0 }
    }
}

/// Group, worth and number of a column.
type SortedColumn = (usize, u32, usize);

/// Covered columns of some worth in the group of the first limit that is not below their count, and Σ worth of those
/// above every limit.
fn in_groups(
    covered: &[u64],
    counts: &[u32],
    worths: &[u32],
    limits: &[f64],
) -> (Vec<SortedColumn>, u64) {
    let (mut columns, mut rest) = (Vec::new(), 0);
    for (column, &count) in counts.iter().enumerate() {
        let worth = worths[column % worths.len()];
        if covered[column / 64] >> (column % 64) & 1 == 0 || worth == 0 {
            continue;
        }
        match limits.iter().position(|&limit| f64::from(count) <= limit) {
            Some(group) => columns.push((group, worth, column)),
            None => rest += u64::from(worth),
        }
    }
    (columns, rest)
}

/// Columns of about equal worth.
struct WorthLevel {
    words: Range<usize>,
    least: u64,
}

/// Bit, group and worth of a column of the atlas.
#[derive(Clone, Copy, Default)]
struct Place {
    bit: u32,
    group: u32,
    worth: u32,
}

/// Bits, groups and worths of the columns that are in a group.
struct ColumnPlaces {
    /// A bit for each column of the atlas.
    grouped: Vec<u64>,
    of: Vec<Place>,
}

impl ColumnPlaces {
    fn none(columns: usize) -> Self {
        Self { grouped: vec![0; columns / 64], of: vec![Place::default(); columns] }
    }

    fn put(&mut self, column: usize, place: Place) {
        self.grouped[column / 64] |= 1 << (column % 64);
        self.of[column] = place;
    }
}

impl Columns {
    /// The columns of held poses `0..poses`. `worths` holds the worth of each bit, of one frame where all frames are
    /// alike. A column joins the first group whose entry of `shares`, rising, is not below the share of the `typical`
    /// poses that cover it. `None` once `go_on`, which is asked after each pass over the columns, says no.
    pub fn new(
        atlas: &Atlases,
        poses: u32,
        worths: &[u32],
        shares: &[f64],
        typical: &[u32],
        go_on: &dyn Fn() -> bool,
    ) -> Option<Self> {
        let pages: Vec<_> = (0..poses).map(|pose| atlas.occupied_of(pose)).collect();
        let pages: Vec<&[u64]> = pages.iter().map(|page| &**page).collect();
        let covered = any(&pages);
        let some: Vec<&[u64]> = typical.iter().map(|&pose| pages[pose as usize]).collect();
        let counts = counts(&some);
        let limits: Vec<f64> = shares.iter().map(|share| share * typical.len() as f64).collect();
        let (mut sorted, rest) = in_groups(&covered, &counts, worths, &limits);
        if !go_on() {
            return None;
        }
        sorted.par_sort_unstable();
        if !go_on() {
            return None;
        }
        let mut columns = Self {
            poses: poses as usize,
            words: 0,
            bitmaps: Vec::new(),
            groups: shares.iter().map(|_| Group::none(poses as usize)).collect(),
            rest,
        };
        let places = columns.place(&sorted, counts.len());
        columns.bitmaps = vec![0; columns.poses * columns.words];
        columns.fill(&pages, &places);
        Some(columns)
    }

    /// Lays the sorted columns out in levels of about equal worth, each from a word of its own on.
    fn place(&mut self, sorted: &[SortedColumn], count: usize) -> ColumnPlaces {
        let mut places = ColumnPlaces::none(count);
        let alike = |a: &SortedColumn, b: &SortedColumn| {
            a.0 == b.0 && f64::from(b.1) <= WORTH_SPREAD * f64::from(a.1)
        };
        let mut left = sorted;
        while let Some(first) = left.first() {
            let (level, after) = left.split_at(left.partition_point(|column| alike(first, column)));
            left = after;
            let start = self.words;
            for (bit, column) in level.iter().enumerate() {
                let bit = (64 * start + bit) as u32;
                places.put(column.2, Place { bit, group: first.0 as u32, worth: column.1 });
            }
            self.words += level.len().div_ceil(64);
            let group = &mut self.groups[first.0];
            group.total += level.iter().map(|column| u64::from(column.1)).sum::<u64>();
            let (words, least) = (start..self.words, u64::from(first.1));
            group.levels.push(WorthLevel { words, least });
        }
        places
    }

    /// Sets the bits of the poses, and sums up the worth of the columns that each covers alone.
    fn fill(&mut self, pages: &[&[u64]], places: &ColumnPlaces) {
        let groups = self.groups.len();
        let bitmaps = self.bitmaps.par_chunks_mut(self.words.max(1)).zip(pages);
        let singles = bitmaps.map(|(bitmap, page)| {
            let mut singles = vec![0u64; groups];
            for ((bits, grouped), places) in
                page.iter().zip(&places.grouped).zip(places.of.chunks(64))
            {
                let mut left = bits & grouped;
                while left != 0 {
                    let place = places[left.trailing_zeros() as usize];
                    left &= left - 1;
                    bitmap[place.bit as usize / 64] |= 1 << (place.bit % 64);
                    singles[place.group as usize] += u64::from(place.worth);
                }
            }
            singles
        });
        let singles: Vec<Vec<u64>> = singles.collect();
        for (pose, singles) in singles.iter().enumerate() {
            for (group, &single) in self.groups.iter_mut().zip(singles) {
                group.singles[pose] = single;
            }
        }
    }

    /// Words that [`Self::add_overlaps`] reads of each pair.
    pub fn group_words(&self, group: usize) -> u64 {
        self.groups[group].levels.iter().map(|level| level.words.len() as u64).sum()
    }

    /// Adds to `[poses × poses]` a lower bound on the worth that two poses both cover in a group, too low by at most
    /// the spread of the worths; the diagonal stays. False once `go_on`, which is asked after every [`WORDS_AT_ONCE`]
    /// words, says no: only some pairs are added then.
    pub fn add_overlaps(
        &self,
        group: usize,
        overlaps: &mut [f64],
        go_on: &dyn Fn() -> bool,
    ) -> bool {
        let n = self.poses;
        let block_words = self.group_words(group).saturating_mul((ROWS * n) as u64).max(1);
        let blocks = (WORDS_AT_ONCE / block_words).max(rayon::current_num_threads() as u64);
        for (some, rows) in overlaps.chunks_mut(blocks as usize * ROWS * n).enumerate() {
            if some > 0 && !go_on() {
                return false;
            }
            self.add_rows(group, some * blocks as usize * ROWS, rows);
        }
        for i in 0..n {
            for j in 0..i {
                overlaps[i * n + j] = overlaps[j * n + i];
            }
        }
        true
    }

    /// Adds to the rows of a matrix of overlaps from `start` on, right of the diagonal.
    fn add_rows(&self, group: usize, start: usize, rows: &mut [f64]) {
        let levels = &self.groups[group].levels;
        let n = self.poses;
        let map = |pose: usize| &self.bitmaps[pose * self.words..(pose + 1) * self.words];
        rows.par_chunks_mut(ROWS * n).enumerate().for_each(|(block, rows)| {
            let first = start + block * ROWS;
            let last = first + rows.len() / n;
            let mut sums = vec![0u64; rows.len()];
            let alike = |a: &WorthLevel, b: &WorthLevel| b.words.end - a.words.start <= WORDS;
            let mut left = levels.as_slice();
            while let Some(start) = left.first() {
                let some = left.partition_point(|level| alike(start, level)).max(1);
                for j in first + 1..n {
                    for i in first..last.min(j) {
                        sums[(i - first) * n + j] += overlap(map(i), map(j), &left[..some]);
                    }
                }
                left = &left[some..];
            }
            for (to, sum) in rows.iter_mut().zip(sums) {
                *to += sum as f64;
            }
        });
    }
}

/// Columns that any pose covers, a bit each.
fn any(pages: &[&[u64]]) -> Vec<u64> {
    let mut any = vec![0; pages.first().map_or(0, |page| page.len())];
    any.par_chunks_mut(WORDS).enumerate().for_each(|(block, any)| {
        for page in pages {
            any.iter_mut().zip(&page[block * WORDS..]).for_each(|(or, word)| *or |= word);
        }
    });
    any
}

/// Poses that cover each column.
fn counts(pages: &[&[u64]]) -> Vec<u32> {
    let of_word = |at: usize| {
        // Counters of 64 columns at once, a bit plane each.
        let mut planes = [0u64; 32];
        for page in pages {
            let mut carry = page[at];
            for plane in &mut planes {
                (*plane, carry) = (*plane ^ carry, *plane & carry);
                if carry == 0 {
                    break;
                }
            }
        }
        let count = move |bit: usize| {
            let bits = planes.iter().enumerate().map(|(k, plane)| ((plane >> bit & 1) as u32) << k);
            bits.sum()
        };
        (0..64).map(count).collect::<Vec<u32>>()
    };
    let words = pages.first().map_or(0, |page| page.len());
    (0..words).into_par_iter().flat_map_iter(of_word).collect()
}

/// Σ popcount(a ∧ b) × worth over levels.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn overlap(a: &[u64], b: &[u64], levels: &[WorthLevel]) -> u64 {
    let mut sum = 0;
    for level in levels {
        let (a, b) = (&a[level.words.clone()], &b[level.words.clone()]);
        let both = a.iter().zip(b).map(|(a, b)| u64::from((a & b).count_ones()));
        sum += level.least * both.sum::<u64>();
    }
    sum
}
