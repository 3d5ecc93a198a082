use std::collections::BTreeMap;
use std::ops::Range;

use multiversion::multiversion;

use crate::problem::{Content, Tally};
use crate::psog::Roi;

/// Voxels of equal worth from which on they get words of their own. Fewer would waste most of a word.
const LEAST_LEVEL: usize = 24;

/// An order of the occupied voxels in which those of equal worth stand together.
///
/// A sum of entropies over a bitmap in this order is Σ popcount(level) × worth of the level.
#[derive(Debug)]
pub(super) struct LevelOrder {
    /// Occupied voxels, a bit for each voxel of the grid.
    mask: Vec<u64>,
    /// Occupied voxels before each word of `mask`.
    rank: Vec<u32>,
    /// Bit in the level order of each occupied voxel.
    bit_of: Vec<u32>,
    levels: Vec<Level>,
    /// Words from which on every bit has a worth of its own.
    mixed: usize,
    /// Worths of the bits from word `mixed` on.
    mixed_worths: Vec<[u32; 3]>,
    words: usize,
}

#[derive(Debug)]
struct Level {
    words: Range<usize>,
    worth: [u64; 3],
}

impl LevelOrder {
    pub fn new(roi: &Roi, content: &Content) -> Self {
        let mut mask = vec![0u64; roi.voxel_count().div_ceil(64) as usize];
        let mut by_worth: BTreeMap<[u32; 3], Vec<usize>> = BTreeMap::new();
        for (rank, voxel) in content.occupied().iter().enumerate() {
            mask[voxel.index as usize / 64] |= 1 << (voxel.index % 64);
            by_worth.entry(voxel.entropy).or_default().push(rank);
        }
        let mut before = 0;
        let rank = mask.iter().map(|word| {
            before += word.count_ones();
            before - word.count_ones()
        });
        let rank = rank.collect();
        let (large, small): (Vec<_>, Vec<_>) =
            by_worth.into_iter().partition(|(_, voxels)| voxels.len() >= LEAST_LEVEL);
        let mut bit_of = vec![0; content.occupied().len()];
        let mut levels = Vec::new();
        let mut words = 0;
        for (worth, voxels) in large {
            for (bit, rank) in voxels.iter().enumerate() {
                bit_of[*rank] = (64 * words + bit) as u32;
            }
            let end = words + voxels.len().div_ceil(64);
            levels.push(Level { words: words..end, worth: worth.map(u64::from) });
            words = end;
        }
        let mixed = words;
        let mut mixed_worths = Vec::new();
        for (worth, voxels) in small {
            for rank in voxels {
                bit_of[rank] = (64 * mixed + mixed_worths.len()) as u32;
                mixed_worths.push(worth);
            }
        }
        words += mixed_worths.len().div_ceil(64);
        Self { mask, rank, bit_of, levels, mixed, mixed_worths, words }
    }

    /// Words of a bitmap in this order.
    pub fn words(&self) -> usize {
        self.words
    }

    /// Worth of each bit; zero for bits without a voxel.
    pub fn worths(&self, content: &Content) -> Vec<[u32; 3]> {
        let mut worths = vec![[0; 3]; 64 * self.words];
        for (voxel, &bit) in content.occupied().iter().zip(&self.bit_of) {
            worths[bit as usize] = voxel.entropy;
        }
        worths
    }

    /// Brings a bitmap of all voxels into this order; `ordered` starts empty of bits.
    pub fn reorder(&self, bitmap: &[u64], ordered: &mut [u64]) {
        reorder(&self.mask, &self.rank, &self.bit_of, bitmap, ordered);
    }

    /// Adds the sums over the bits set in `a` or in `b`, both in this order, to a tally.
    #[inline(always)]
    pub fn add_union(&self, a: &[u64], b: &[u64], tally: &mut Tally) {
        for level in &self.levels {
            let (a, b) = (&a[level.words.clone()], &b[level.words.clone()]);
            let count = count_union(a, b);
            tally.covered_nonzero += count;
            for (sum, worth) in tally.entropy.iter_mut().zip(level.worth) {
                *sum += count * worth;
            }
        }
        let (a, b) = (&a[self.mixed..], &b[self.mixed..]);
        for ((a, b), worths) in a.iter().zip(b).zip(self.mixed_worths.chunks(64)) {
            let mut left = a | b;
            tally.covered_nonzero += u64::from(left.count_ones());
            while left != 0 {
                let worth = worths[left.trailing_zeros() as usize];
                for (sum, worth) in tally.entropy.iter_mut().zip(worth) {
                    *sum += u64::from(worth);
                }
                left &= left - 1;
            }
        }
    }
}

/// [`LevelOrder::reorder`], compiled for processors that count bits in one instruction, too.
#[multiversion(targets("x86_64+bmi1+bmi2+popcnt"))]
fn reorder(mask: &[u64], rank: &[u32], bit_of: &[u32], bitmap: &[u64], ordered: &mut [u64]) {
    for ((&word, &mask), &rank) in bitmap.iter().zip(mask).zip(rank) {
        let mut left = word & mask;
        while left != 0 {
            let below = (left & left.wrapping_neg()) - 1;
            let bit = bit_of[(rank + (mask & below).count_ones()) as usize];
            ordered[bit as usize / 64] |= 1 << (bit % 64);
            left &= left - 1;
        }
    }
}

/// Bits set in `a` or in `b`.
#[inline(always)]
pub(super) fn count_union(a: &[u64], b: &[u64]) -> u64 {
    a.iter().zip(b).map(|(a, b)| u64::from((a | b).count_ones())).sum()
}
