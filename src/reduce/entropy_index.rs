use multiversion::multiversion;
use rayon::prelude::*;

use crate::cover::BitOrder;
use crate::problem::{Content, Tally};

/// Words that are put together at a time: they stay in the first-level cache for all sums.
const BLOCK: usize = 512;
/// Tasks that the sums of one placement are cut into when threads share them, about.
const PARTS: usize = 16;

/// Voxels of one 64-bit word of a bitmap.
struct Word {
    index: u32,
    /// First of the voxels in the list of all.
    first: u32,
    mask: u64,
}

/// Words in rising order, by blocks.
struct Words {
    words: Vec<Word>,
    /// Number of words before each block.
    before: Vec<usize>,
}

impl Words {
    /// The words that hold some voxels, whose bits' numbers rise.
    fn new(voxels: impl Iterator<Item = u32>) -> Self {
        let (mut words, mut before): (Vec<Word>, Vec<usize>) = (Vec::new(), vec![0]);
        for (position, voxel) in voxels.enumerate() {
            let (index, bit) = (voxel >> 6, 1 << (voxel & 63));
            match words.last_mut() {
                Some(word) if word.index == index => word.mask |= bit,
                _ => {
                    while before.len() <= index as usize / BLOCK {
                        before.push(words.len());
                    }
                    words.push(Word { index, first: position as u32, mask: bit });
                }
            }
        }
        Self { words, before }
    }

    fn of_block(&self, block: usize) -> &[Word] {
        let before = |block: usize| self.before.get(block).copied().unwrap_or(self.words.len());
        &self.words[before(block)..before(block + 1)]
    }
}

/// A [`Content`] by words of the bitmaps: what [`super::reduce()`] looks up a voxel at a time.
pub(crate) struct Worth {
    occupied: Words,
    entropy: Vec<[u32; 3]>,
    classes: Vec<Words>,
}

impl Worth {
    /// For bitmaps of an order.
    pub(crate) fn new(content: &Content, order: &BitOrder) -> Self {
        let bit = |voxel| order.bit_of(voxel);
        let occupied = content.occupied().par_iter();
        let mut occupied: Vec<_> = occupied.map(|v| (bit(v.index), v.entropy)).collect();
        occupied.par_sort_unstable_by_key(|&(bit, _)| bit);
        let of_class = |class: usize| {
            let mut voxels: Vec<u32> =
                content.voxels_of_class(class).par_iter().map(|&voxel| bit(voxel)).collect();
            voxels.par_sort_unstable();
            Words::new(voxels.into_iter())
        };
        Self {
            occupied: Words::new(occupied.iter().map(|&(bit, _)| bit)),
            entropy: occupied.iter().map(|&(_, entropy)| entropy).collect(),
            classes: (0..content.classes().len()).into_par_iter().map(of_class).collect(),
        }
    }
}

/// Adds the sums over the voxels that the sensors of one placement cover, and clears their bitmaps.
///
/// `bitmaps` is `[sensors × words]`. The same sums as [`super::reduce()`].
pub(crate) fn take_sums(bitmaps: &mut [u64], words: usize, worth: &Worth, tally: &mut Tally) {
    let mut maps: Vec<&mut [u64]> = bitmaps.chunks_exact_mut(words).collect();
    take_blocks(&mut maps, 0, worth, tally);
}

/// [`take_sums`] that leaves the bitmaps as they are.
pub(crate) fn add_sums(bitmaps: &[u64], words: usize, worth: &Worth, tally: &mut Tally) {
    for (block, first) in (0..words).step_by(BLOCK).enumerate() {
        let range = first..words.min(first + BLOCK);
        let maps = bitmaps.chunks_exact(words).map(|map| &map[range.clone()]);
        let maps: Vec<&[u64]> = maps.collect();
        add_block(&maps, block, worth, tally);
    }
}

/// [`take_sums`] by all threads.
pub(crate) fn take_sums_spread(
    bitmaps: &mut [u64],
    words: usize,
    worth: &Worth,
    tally: &mut Tally,
) {
    let blocks = words.div_ceil(BLOCK * PARTS).max(1);
    let mut parts: Vec<Vec<&mut [u64]>> = Vec::new();
    for map in bitmaps.chunks_exact_mut(words) {
        parts.resize_with(words.div_ceil(blocks * BLOCK), Vec::new);
        parts.iter_mut().zip(map.chunks_mut(blocks * BLOCK)).for_each(|(part, m)| part.push(m));
    }
    let zero = || Tally::zero(tally.by_class.len(), tally.unique.len());
    let sums = parts.into_par_iter().enumerate().map(|(index, mut maps)| {
        let mut sums = zero();
        take_blocks(&mut maps, index * blocks, worth, &mut sums);
        sums
    });
    for sums in sums.collect::<Vec<_>>() {
        *tally += &sums;
    }
}

/// [`take_sums`] over some of the words of each sensor, the first of which begins `first_block`.
fn take_blocks(maps: &mut [&mut [u64]], first_block: usize, worth: &Worth, tally: &mut Tally) {
    let words = maps.first().map_or(0, |map| map.len());
    for (block, first) in (first_block..).zip((0..words).step_by(BLOCK)) {
        let range = first..words.min(first + BLOCK);
        let parts: Vec<&[u64]> = maps.iter().map(|map| &map[range.clone()]).collect();
        add_block(&parts, block, worth, tally);
        maps.iter_mut().for_each(|map| map[range.clone()].fill(0));
    }
}

/// Adds the sums over one block of words; `maps` holds those words of each sensor.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn add_block(maps: &[&[u64]], block: usize, worth: &Worth, tally: &mut Tally) {
    let len = maps.first().map_or(0, |map| map.len().min(BLOCK));
    let (mut any, mut twice) = ([0_u64; BLOCK], [0_u64; BLOCK]);
    for map in maps {
        let map = &map[..len];
        for i in 0..len {
            twice[i] |= any[i] & map[i];
            any[i] |= map[i];
        }
    }
    tally.covered += any[..len].iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
    for word in worth.occupied.of_block(block) {
        let at = word.index as usize % BLOCK;
        let mut bits = any[at] & word.mask;
        tally.covered_nonzero += u64::from(bits.count_ones());
        while bits != 0 {
            for (sum, entropy) in tally.entropy.iter_mut().zip(worth.entropy[rank(word, bits)]) {
                *sum += u64::from(entropy);
            }
            bits &= bits - 1;
        }
        let once = any[at] & !twice[at] & word.mask;
        if once != 0 {
            for (map, sum) in maps.iter().zip(&mut tally.unique) {
                let mut bits = map[at] & once;
                while bits != 0 {
                    *sum += u64::from(worth.entropy[rank(word, bits)][0]);
                    bits &= bits - 1;
                }
            }
        }
    }
    for (class, count) in worth.classes.iter().zip(&mut tally.by_class) {
        for word in class.of_block(block) {
            let covered = any[word.index as usize % BLOCK] & word.mask;
            *count += u64::from(covered.count_ones());
        }
    }
}

/// Position in the list of all voxels of the lowest set bit.
#[inline(always)]
fn rank(word: &Word, bits: u64) -> usize {
    let below = bits & bits.wrapping_neg();
    word.first as usize + (word.mask & (below - 1)).count_ones() as usize
}
