//! Voxels in groups by how many poses cover them, as bitmaps a pose: the columns of a maximum coverage
//! problem.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use crate::search::atlases::Atlases;

/// Share of the overlaps of all pairs that the leading columns have, at least.
const LEAD: f64 = 0.96;
/// Rows of a matrix of overlaps that are filled together.
const ROWS: usize = 8;
/// Words of a bitmap that are read at once: those of all rows together fit into the smallest cache.
const WORDS: usize = 256;

/// Words of bitmaps that are compared between two questions whether to go on: less than a second's, and few in the tests of
/// this crate.
const WORDS_AT_ONCE: u64 = if cfg!(test) { 1 << 12 } else { 1 << 30 };

/// The columns of a maximum coverage problem: every voxel of every frame that some pose covers, in
/// groups by the share of some typical poses that cover it, and by worth within a group.
#[derive(Default)]
pub(in crate::search) struct Columns {
    pub poses: usize,
    pub words: usize,
    /// `[poses × words]`.
    bitmaps: Vec<u64>,
    /// Worth of each column, and the least and the most of each word: these differ little.
    worths: Vec<u32>,
    least: Vec<u32>,
    most: Vec<u32>,
    /// Columns that few typical poses cover first; the last group has those that more cover than any limit says.
    pub groups: Vec<Group>,
    /// First word of the columns that have most of the overlaps.
    lead: usize,
}

/// Columns that similar shares of the typical poses cover.
pub(in crate::search) struct Group {
    words: Range<usize>,
    /// Σ worth of the columns that each pose covers.
    pub singles: Vec<u64>,
    /// Σ worth of the columns.
    pub total: u64,
    /// Σ worth × (typical poses that cover the column)².
    shared: f64,
}

/// Group, worth and number of a column.
type SortedColumn = (usize, u32, usize);

/// Covered columns of some worth in the group of the first limit that is not below their count, or in one after all.
fn in_groups(covered: &[u64], counts: &[u32], worths: &[u32], limits: &[f64]) -> Vec<SortedColumn> {
    let mut columns = Vec::new();
    for (column, &count) in counts.iter().enumerate() {
        let worth = worths[column % worths.len()];
        if covered[column / 64] >> (column % 64) & 1 == 0 || worth == 0 {
            continue;
        }
        let group = limits.iter().position(|&limit| f64::from(count) <= limit);
        columns.push((group.unwrap_or(limits.len()), worth, column));
    }
    columns
}

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
    pub(crate) fn new(
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
        let mut sorted = in_groups(&covered, &counts, worths, &limits);
        if !go_on() {
            return None;
        }
        sorted.par_sort_unstable();
        if !go_on() {
            return None;
        }
        let poses = poses as usize;
        let mut columns = Self { poses, ..Self::default() };
        let places = columns.place(&sorted, &counts, shares.len() + 1);
        columns.lead = columns.lead_start();
        columns.bitmaps = vec![0; poses * columns.words];
        columns.fill(&pages, &places);
        Some(columns)
    }

    /// Lays the sorted columns out, each group from a word of its own on.
    fn place(&mut self, sorted: &[SortedColumn], counts: &[u32], groups: usize) -> ColumnPlaces {
        let mut places = ColumnPlaces::none(counts.len());
        let mut left = sorted;
        for number in 0..groups {
            let (group, after) = left.split_at(left.partition_point(|column| column.0 == number));
            left = after;
            let start = self.words;
            for (bit, &(_, worth, column)) in group.iter().enumerate() {
                let bit = (64 * start + bit) as u32;
                places.put(column, Place { bit, group: number as u32, worth });
            }
            self.words += group.len().div_ceil(64);
            self.worths.extend(group.iter().map(|column| column.1));
            self.worths.resize(64 * self.words, 0);
            self.least.extend(group.chunks(64).map(|word| word[0].1));
            self.most.extend(group.chunks(64).map(|word| word[word.len() - 1].1));
            let shared =
                |column: &SortedColumn| f64::from(column.1) * f64::from(counts[column.2]).powi(2);
            self.groups.push(Group {
                words: start..self.words,
                singles: vec![0; self.poses],
                total: group.iter().map(|column| u64::from(column.1)).sum(),
                shared: group.iter().map(shared).sum(),
            });
        }
        places
    }

    /// First word of the last groups that have [`LEAD`] of the overlaps.
    fn lead_start(&self) -> usize {
        let all: f64 = self.groups.iter().map(|group| group.shared).sum();
        let mut left = all;
        let leading = self.groups.iter().find(|group| {
            left -= group.shared;
            left < LEAD * all
        });
        leading.map_or(0, |group| group.words.start)
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
    pub(crate) fn group_words(&self, group: usize) -> u64 {
        self.groups[group].words.len() as u64
    }

    /// Words of the columns that many poses cover, which have most of the overlaps.
    pub(crate) fn lead(&self) -> Range<usize> {
        self.lead..self.words
    }

    fn map(&self, pose: u32) -> &[u64] {
        &self.bitmaps[pose as usize * self.words..][..self.words]
    }

    pub(crate) fn single(&self, pose: u32) -> u64 {
        self.groups.iter().map(|group| group.singles[pose as usize]).sum()
    }

    /// Columns that none of some poses covers.
    pub(crate) fn outside(&self, poses: &[u32]) -> Vec<u64> {
        let mut outside = vec![!0; self.words];
        for &pose in poses {
            outside.iter_mut().zip(self.map(pose)).for_each(|(left, word)| *left &= !word);
        }
        outside
    }

    /// Worth that a pose covers of some columns, or a little more: each counts as the most of its word.
    pub(crate) fn most(&self, pose: u32, columns: &[u64]) -> u64 {
        overlap(self.map(pose), columns, &self.most)
    }

    pub(crate) fn union(&self, poses: &[u32]) -> u64 {
        let outside = self.outside(poses);
        let words = outside.iter().zip(self.worths.chunks(64));
        let of = |(outside, worths): (&u64, &[u32])| -> u64 {
            let bits = worths.iter().enumerate();
            bits.map(|(bit, &worth)| u64::from(worth) * (!outside >> bit & 1)).sum()
        };
        words.map(of).sum()
    }

    /// Lower bounds, `[poses × poses]`, on the worth of the leading columns of `within` that two poses both cover; the
    /// diagonal is 0.
    pub(crate) fn lead_overlaps(&self, poses: &[u32], within: &[u64]) -> Vec<u64> {
        let (n, words) = (poses.len(), self.lead().len());
        let least = &self.least[self.lead()];
        let mut bitmaps = Vec::with_capacity(n * words);
        for &pose in poses {
            let bits = self.map(pose)[self.lead()].iter().zip(&within[self.lead()]);
            bitmaps.extend(bits.map(|(word, within)| word & within));
        }
        let map = |index: usize| &bitmaps[index * words..][..words];
        let mut overlaps = vec![0; n * n];
        for first in (0..n).step_by(ROWS) {
            for j in first + 1..n {
                for i in first..(first + ROWS).min(j) {
                    let both = overlap(map(i), map(j), least);
                    (overlaps[i * n + j], overlaps[j * n + i]) = (both, both);
                }
            }
        }
        overlaps
    }

    /// Adds to `[poses × poses]` a lower bound on the worth that two poses both cover in a group; the diagonal
    /// stays. False once `go_on`, which is asked after every [`WORDS_AT_ONCE`]
    /// words, says no: only some pairs are added then.
    pub(crate) fn add_overlaps(
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
        let words = self.groups[group].words.clone();
        let n = self.poses;
        rows.par_chunks_mut(ROWS * n).enumerate().for_each(|(block, rows)| {
            let first = start + block * ROWS;
            let last = first + rows.len() / n;
            let mut sums = vec![0u64; rows.len()];
            for from in words.clone().step_by(WORDS) {
                let some = from..(from + WORDS).min(words.end);
                let (map, least) =
                    (|pose: usize| &self.map(pose as u32)[some.clone()], &self.least[some.clone()]);
                for j in first + 1..n {
                    for i in first..last.min(j) {
                        sums[(i - first) * n + j] += overlap(map(i), map(j), least);
                    }
                }
            }
            for (to, sum) in rows.iter_mut().zip(sums) {
                *to += sum as f64;
            }
        });
    }
}

fn any(pages: &[&[u64]]) -> Vec<u64> {
    let mut any = vec![0; pages.first().map_or(0, |page| page.len())];
    any.par_chunks_mut(WORDS).enumerate().for_each(|(block, any)| {
        for page in pages {
            any.iter_mut().zip(&page[block * WORDS..]).for_each(|(or, word)| *or |= word);
        }
    });
    any
}

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

/// Σ popcount(a ∧ b) × worth of the word.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn overlap(a: &[u64], b: &[u64], worths: &[u32]) -> u64 {
    let words = a.iter().zip(b).zip(worths);
    words.map(|((a, b), &worth)| u64::from((a & b).count_ones()) * u64::from(worth)).sum()
}
