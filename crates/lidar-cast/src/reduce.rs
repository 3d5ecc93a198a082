//! Integer sums over covered voxels: the plain reference and the fast copy that gives its bits.
//!
//! [`reduce`] takes a voxel at a time and is the specification; `take_sums` takes a word of 64 voxels at a time, by an
//! `EntropyIndex`. `README.md` in the folder of this name tells how.

use multiversion::multiversion;
use rayon::prelude::*;

use crate::cover::{BitOrder, Ranks};
use crate::task::{Content, Entropy, KINDS, Tally};

/// Sums over the voxels that one placement of `lidars` sensors covers in one frame; `bitmaps` is
/// `[lidars × words]`. Beams and hits are left at 0.
///
/// CPU twin of `shaders/reduce_words.wgsl`, `reduce_occupied.wgsl` and `reduce_classes.wgsl`.
pub fn reduce(lidars: usize, content: &Content, bitmaps: &[u64]) -> Tally {
    let maps: Vec<&[u64]> = bitmaps.chunks(bitmaps.len() / lidars.max(1)).collect();
    let mut tally = Tally::zero(content.set_count(), lidars);
    reduce_words(&maps, &mut tally);
    reduce_occupied(&maps, content, &mut tally);
    reduce_classes(&maps, content, &mut tally);
    tally
}

fn reduce_words(maps: &[&[u64]], tally: &mut Tally) {
    for word in 0..maps[0].len() {
        let union = maps.iter().fold(0, |or, map| or | map[word]);
        tally.covered += u64::from(union.count_ones());
    }
}

fn reduce_occupied(maps: &[&[u64]], content: &Content, tally: &mut Tally) {
    for voxel in content.occupied() {
        let (mut times, mut last) = (0, 0);
        for (lidar, map) in maps.iter().enumerate() {
            if is_set(map, voxel.index) {
                times += 1;
                last = lidar;
            }
        }
        if times == 0 {
            continue;
        }
        tally.covered_nonzero += 1;
        for (sum, entropy) in tally.entropy.iter_mut().zip(voxel.entropy) {
            *sum += u64::from(entropy);
        }
        let near = u64::from(Entropy::Near.of(&voxel.entropy));
        for (sum, _) in tally.near_repeated.iter_mut().zip(2..=times) {
            *sum += near;
        }
        if times == 1 {
            tally.unique[last] += u64::from(Entropy::Classes.of(&voxel.entropy));
        }
    }
}

fn reduce_classes(maps: &[&[u64]], content: &Content, tally: &mut Tally) {
    for (class, count) in tally.by_class.iter_mut().enumerate() {
        let voxels = content.voxels_of_class(class).iter();
        *count = voxels.filter(|&&v| maps.iter().any(|map| is_set(map, v))).count() as u64;
    }
}

fn is_set(map: &[u64], voxel: u32) -> bool {
    map[voxel as usize >> 6] >> (voxel & 63) & 1 == 1
}

/// Words of a block, 4 KiB a sensor: its union stays in the first-level cache for all sums.
const BLOCK: usize = 512;

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
    /// The words that are not zero, of a bitmap that holds the bit of each voxel.
    fn new(bitmap: &[u64]) -> Self {
        let (mut words, mut before) = (Vec::new(), Vec::new());
        let mut first = 0;
        for (index, &mask) in bitmap.iter().enumerate() {
            if index % BLOCK == 0 {
                before.push(words.len());
            }
            if mask != 0 {
                words.push(Word { index: index as u32, first, mask });
                first += mask.count_ones();
            }
        }
        Self { words, before }
    }

    fn of_block(&self, block: usize) -> &[Word] {
        let before = |block: usize| self.before.get(block).copied().unwrap_or(self.words.len());
        &self.words[before(block)..before(block + 1)]
    }
}

/// A [`Content`] by words of the bitmaps: entropies and classes are looked up for the covered voxels
/// of a word at once, where [`reduce()`] asks for one voxel after another.
pub(crate) struct EntropyIndex {
    occupied: Words,
    entropy: Vec<[u32; KINDS]>,
    classes: Vec<Words>,
}

impl EntropyIndex {
    /// For bitmaps of an order.
    pub(crate) fn new(content: &Content, order: &BitOrder) -> Self {
        let of_class = |class: usize| {
            let voxels = content.voxels_of_class(class).iter();
            Words::new(&order.bitmap(voxels.map(|&voxel| order.bit_of(voxel))))
        };
        let ranks = Ranks::new(order, content.occupied().par_iter().map(|voxel| voxel.index));
        let mut entropy = vec![[0; KINDS]; content.occupied().len()];
        for (voxel, rank) in content.occupied().iter().zip(ranks.of) {
            entropy[rank as usize] = voxel.entropy;
        }
        Self {
            occupied: Words::new(&ranks.bitmap),
            entropy,
            classes: (0..content.set_count()).into_par_iter().map(of_class).collect(),
        }
    }
}

/// Adds the sums over the voxels that the sensors of one placement cover, and clears their bitmaps.
///
/// `bitmaps` is `[sensors × words]`. The sums equal the sums of [`reduce()`] bit for bit.
pub(crate) fn take_sums(
    bitmaps: &mut [u64],
    words: usize,
    index: &EntropyIndex,
    tally: &mut Tally,
) {
    let mut maps: Vec<&mut [u64]> = bitmaps.chunks_exact_mut(words).collect();
    for (block, first) in (0..words).step_by(BLOCK).enumerate() {
        let range = first..words.min(first + BLOCK);
        let parts: Vec<&[u64]> = maps.iter().map(|map| &map[range.clone()]).collect();
        add_block(&parts, block, index, tally);
        // While the block is in the first-level cache.
        maps.iter_mut().for_each(|map| map[range.clone()].fill(0));
    }
}

/// Adds the sums over one block of words; `maps` holds those words of each sensor.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn add_block(maps: &[&[u64]], block: usize, index: &EntropyIndex, tally: &mut Tally) {
    let len = maps.first().map_or(0, |map| map.len().min(BLOCK));
    let (mut any, mut twice, mut thrice) = ([0_u64; BLOCK], [0_u64; BLOCK], [0_u64; BLOCK]);
    for map in maps {
        let map = &map[..len];
        for i in 0..len {
            thrice[i] |= twice[i] & map[i];
            twice[i] |= any[i] & map[i];
            any[i] |= map[i];
        }
    }
    tally.covered += any[..len].iter().map(|word| u64::from(word.count_ones())).sum::<u64>();
    // Near information of the voxels that one sensor covers, and exactly two.
    let (mut entropy, mut near_once, mut near_twice) = ([0_u64; KINDS], 0, 0);
    for word in index.occupied.of_block(block) {
        let at = word.index as usize % BLOCK;
        let (mut bits, two) = (any[at] & word.mask, twice[at] & !thrice[at]);
        tally.covered_nonzero += u64::from(bits.count_ones());
        while bits != 0 {
            let of_voxel = index.entropy[rank(word, bits)];
            for kind in 0..KINDS {
                entropy[kind] += u64::from(of_voxel[kind]);
            }
            let is_two = two >> bits.trailing_zeros() & 1;
            near_twice += u64::from(Entropy::Near.of(&of_voxel)) & is_two.wrapping_neg();
            bits &= bits - 1;
        }
        let once = any[at] & !twice[at] & word.mask;
        if once != 0 {
            for (map, sum) in maps.iter().zip(&mut tally.unique) {
                let (mut bits, mut unique) = (map[at] & once, 0);
                while bits != 0 {
                    let of_voxel = &index.entropy[rank(word, bits)];
                    unique += u64::from(Entropy::Classes.of(of_voxel));
                    near_once += u64::from(Entropy::Near.of(of_voxel));
                    bits &= bits - 1;
                }
                *sum += unique;
            }
        }
    }
    tally.entropy.iter_mut().zip(entropy).for_each(|(sum, entropy)| *sum += entropy);
    let several = Entropy::Near.of(&entropy) - near_once;
    tally.near_repeated[0] += several;
    tally.near_repeated[1] += several - near_twice;
    for (class, count) in index.classes.iter().zip(&mut tally.by_class) {
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
