use multiversion::multiversion;

use crate::backend::{Content, Tally};

/// Words that are put together at a time: they stay in the first-level cache for all sums.
const BLOCK: usize = 512;

/// Voxels of one 64-bit word of a bitmap.
struct Word {
    index: u32,
    /// First of the voxels in the list of all.
    first: u32,
    mask: u64,
}

/// A [`Content`] by words of the bitmaps: what [`super::reduce()`] looks up a voxel at a time.
pub(in crate::backend) struct Worth {
    occupied: Vec<Word>,
    entropy: Vec<[u32; 3]>,
    classes: Vec<Vec<Word>>,
}

/// The words that hold some voxels of rising linear index.
fn words(voxels: impl Iterator<Item = u32>) -> Vec<Word> {
    let mut words: Vec<Word> = Vec::new();
    for (position, voxel) in voxels.enumerate() {
        let (index, bit) = (voxel >> 6, 1 << (voxel & 63));
        match words.last_mut() {
            Some(word) if word.index == index => word.mask |= bit,
            _ => words.push(Word { index, first: position as u32, mask: bit }),
        }
    }
    words
}

impl Worth {
    pub(in crate::backend) fn new(content: &Content) -> Self {
        let classes = (0..content.classes().len())
            .map(|class| words(content.voxels_of_class(class).iter().copied()));
        Self {
            occupied: words(content.occupied().iter().map(|voxel| voxel.index)),
            entropy: content.occupied().iter().map(|voxel| voxel.entropy).collect(),
            classes: classes.collect(),
        }
    }
}

/// Adds the sums over the voxels that the sensors of one placement cover, and clears their bitmaps.
///
/// `bitmaps` is `[sensors × words]`. The same sums as [`super::reduce()`].
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
pub(in crate::backend) fn take_sums(
    bitmaps: &mut [u64],
    words: usize,
    worth: &Worth,
    tally: &mut Tally,
) {
    let mut occupied = worth.occupied.as_slice();
    let mut classes: Vec<&[Word]> = worth.classes.iter().map(Vec::as_slice).collect();
    for first in (0..words).step_by(BLOCK) {
        let len = BLOCK.min(words - first);
        let (mut any, mut twice) = ([0_u64; BLOCK], [0_u64; BLOCK]);
        for map in bitmaps.chunks_exact(words) {
            let map = &map[first..first + len];
            for i in 0..len {
                twice[i] |= any[i] & map[i];
                any[i] |= map[i];
            }
        }
        tally.covered += any[..len].iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
        let block = take_below(&mut occupied, first + len);
        for word in block {
            let at = word.index as usize - first;
            let mut bits = any[at] & word.mask;
            tally.covered_nonzero += u64::from(bits.count_ones());
            while bits != 0 {
                for (sum, entropy) in tally.entropy.iter_mut().zip(worth.entropy[rank(word, bits)])
                {
                    *sum += u64::from(entropy);
                }
                bits &= bits - 1;
            }
            let once = any[at] & !twice[at] & word.mask;
            if once != 0 {
                for (map, sum) in bitmaps.chunks_exact(words).zip(&mut tally.unique) {
                    let mut bits = map[first + at] & once;
                    while bits != 0 {
                        *sum += u64::from(worth.entropy[rank(word, bits)][0]);
                        bits &= bits - 1;
                    }
                }
            }
        }
        for (class, count) in classes.iter_mut().zip(&mut tally.by_class) {
            for word in take_below(class, first + len) {
                let covered = any[word.index as usize - first] & word.mask;
                *count += u64::from(covered.count_ones());
            }
        }
        for map in bitmaps.chunks_exact_mut(words) {
            map[first..first + len].fill(0);
        }
    }
}

/// Splits off the words before `end`.
#[inline(always)]
fn take_below<'a>(words: &mut &'a [Word], end: usize) -> &'a [Word] {
    let count = words.partition_point(|word| (word.index as usize) < end);
    let (below, rest) = words.split_at(count);
    *words = rest;
    below
}

/// Position in the list of all voxels of the lowest set bit.
#[inline(always)]
fn rank(word: &Word, bits: u64) -> usize {
    let below = bits & bits.wrapping_neg();
    word.first as usize + (word.mask & (below - 1)).count_ones() as usize
}
