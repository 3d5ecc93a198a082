//! Voxels in groups by how many poses cover them, as bitmaps a pose: the columns of a maximum coverage
//! problem.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

use crate::search::atlas::Atlas;

/// Largest worth of a level as a multiple of its least one: overlaps of pairs count at the least worth,
/// so that a bound from them stays one.
const WORTH_SPREAD: f64 = 1.05;
/// Rows of a matrix of overlaps that are filled together.
const ROWS: usize = 8;
/// Words of a bitmap that are read at once: those of all rows together fit into the smallest cache.
const WORDS: usize = 256;

/// The columns of a maximum coverage problem: every voxel of every frame that some pose covers, in
/// groups by the share of some typical poses that cover it.
pub(in crate::search) struct Columns {
    poses: usize,
    words: usize,
    /// `[poses × words]`.
    bitmaps: Vec<u64>,
    groups: Vec<Group>,
    /// Σ worth of the columns that more typical poses cover than those of any group.
    pub rest: u64,
}

/// Columns that similar shares of the typical poses cover.
pub(in crate::search) struct Group {
    levels: Vec<Level>,
    /// Σ worth of the columns that each pose covers.
    pub singles: Vec<u64>,
    /// Σ worth of the columns.
    pub total: u64,
}

/// Columns of about equal worth.
struct Level {
    words: Range<usize>,
    least: u64,
}

impl Columns {
    /// The columns of held poses `0..poses`. `worths` holds the worth of each bit of a frame; a column
    /// joins the first group whose entry of `shares`, rising, is not below the share of the `typical`
    /// poses that cover it.
    pub fn new(atlas: &Atlas, poses: u32, worths: &[u32], shares: &[f64], typical: &[u32]) -> Self {
        let words = worths.len() / 64;
        let frames = atlas.problem().frame_count();
        let pages: Vec<Vec<&[u64]>> = (0..poses).map(|p| atlas.frames_of(p).collect()).collect();
        let covered = counts(&pages, frames, words);
        let some: Vec<Vec<&[u64]>> =
            typical.iter().map(|&pose| pages[pose as usize].clone()).collect();
        let counts = counts(&some, frames, words);
        let limits: Vec<f64> = shares.iter().map(|share| share * typical.len() as f64).collect();
        let mut rest = 0;
        let mut sorted = Vec::new();
        for (column, &count) in counts.iter().enumerate() {
            let worth = worths[column % worths.len()];
            if covered[column] == 0 || worth == 0 {
                continue;
            }
            match limits.iter().position(|&limit| f64::from(count) <= limit) {
                Some(group) => sorted.push((group, worth, column)),
                None => rest += u64::from(worth),
            }
        }
        sorted.par_sort_unstable();
        let mut bit_of = vec![u32::MAX; counts.len()];
        let none = || Group { levels: vec![], singles: vec![0; poses as usize], total: 0 };
        let mut groups: Vec<Group> = shares.iter().map(|_| none()).collect();
        let mut end = 0;
        let alike = |a: &(usize, u32, usize), b: &(usize, u32, usize)| {
            a.0 == b.0 && f64::from(b.1) <= WORTH_SPREAD * f64::from(a.1)
        };
        let mut left = sorted.as_slice();
        while let Some(first) = left.first() {
            let (level, after) = left.split_at(left.partition_point(|column| alike(first, column)));
            left = after;
            for (bit, column) in level.iter().enumerate() {
                bit_of[column.2] = (64 * end + bit) as u32;
            }
            let start = end;
            end += level.len().div_ceil(64);
            let group = &mut groups[first.0];
            group.total += level.iter().map(|column| u64::from(column.1)).sum::<u64>();
            group.levels.push(Level { words: start..end, least: u64::from(first.1) });
        }
        let mut columns = Self {
            poses: poses as usize,
            words: end,
            bitmaps: vec![0; poses as usize * end],
            groups,
            rest,
        };
        columns.fill(&pages, &bit_of, worths);
        columns
    }

    /// Sets the bits of the poses, and sums up what each covers alone.
    fn fill(&mut self, pages: &[Vec<&[u64]>], bit_of: &[u32], worths: &[u32]) {
        let ends: Vec<usize> =
            self.groups.iter().map(|g| g.levels.last().map_or(0, |l| l.words.end)).collect();
        let bitmaps = self.bitmaps.par_chunks_mut(self.words.max(1)).zip(pages);
        let singles = bitmaps.map(|(bitmap, frames)| {
            let mut singles = vec![0u64; ends.len()];
            for (frame, bits) in frames.iter().enumerate() {
                for (word, &bits) in bits.iter().enumerate() {
                    let mut left = bits;
                    while left != 0 {
                        let place = 64 * word + left.trailing_zeros() as usize;
                        left &= left - 1;
                        let bit = bit_of[frame * worths.len() + place] as usize;
                        if bit == u32::MAX as usize {
                            continue;
                        }
                        bitmap[bit / 64] |= 1 << (bit % 64);
                        let group = ends.iter().position(|&end| bit / 64 < end);
                        singles[group.expect("the bit is one of a group")] +=
                            u64::from(worths[place]);
                    }
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

    /// Columns that few typical poses cover first.
    pub fn groups(&self) -> &[Group] {
        &self.groups
    }

    /// Words that [`Self::add_overlaps`] reads of each pair.
    pub fn group_words(&self, group: usize) -> u64 {
        self.groups[group].levels.iter().map(|level| level.words.len() as u64).sum()
    }

    /// Adds to `[poses × poses]` at most what both poses of each pair cover in a group, and at least
    /// that less the spread of the worths; the diagonal stays.
    pub fn add_overlaps(&self, group: usize, overlaps: &mut [f64]) {
        let levels = &self.groups[group].levels;
        let n = self.poses;
        let map = |pose: usize| &self.bitmaps[pose * self.words..(pose + 1) * self.words];
        overlaps.par_chunks_mut(ROWS * n).enumerate().for_each(|(block, rows)| {
            let first = block * ROWS;
            let last = first + rows.len() / n;
            let mut sums = vec![0u64; rows.len()];
            let alike = |a: &Level, b: &Level| b.words.end - a.words.start <= WORDS;
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
        for i in 0..n {
            for j in 0..i {
                overlaps[i * n + j] = overlaps[j * n + i];
            }
        }
    }
}

/// Poses that cover each column, `[frames × 64 words]`.
fn counts(pages: &[Vec<&[u64]>], frames: usize, words: usize) -> Vec<u32> {
    let of_word = |at: usize| {
        // Counters of 64 columns at once, a bit plane each.
        let mut planes = [0u64; 32];
        for page in pages {
            let mut carry = page[at / words][at % words];
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
    (0..frames * words).into_par_iter().flat_map_iter(of_word).collect()
}

/// Σ popcount(a ∧ b) × worth over levels.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn overlap(a: &[u64], b: &[u64], levels: &[Level]) -> u64 {
    let mut sum = 0;
    for level in levels {
        let (a, b) = (&a[level.words.clone()], &b[level.words.clone()]);
        let both = a.iter().zip(b).map(|(a, b)| u64::from((a & b).count_ones()));
        sum += level.least * both.sum::<u64>();
    }
    sum
}
