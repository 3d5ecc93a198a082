//! Bitmaps as an atlas keeps them: occupied voxels of equal entropy side by side, empty voxels without their zero words.

use std::collections::BTreeMap;

use multiversion::multiversion;
use rayon::prelude::*;

use crate::cover::{BitOrder, Ranks};
use crate::problem::{Content, Entropy, KINDS, Tally};

/// Voxels of equal entropy from which on they get words of their own. Fewer would waste most of a word.
const LEAST_LEVEL: usize = 24;

/// An order of the occupied voxels in which those of equal entropy stand together, in words of their own.
///
/// A sum of entropies over a bitmap in this order is Σ popcount(word) × entropy of the word.
#[derive(Debug)]
pub(super) struct LevelOrder {
    /// Bit of each occupied voxel, in the order of [`Content::occupied`].
    bit_of: Vec<u32>,
    /// Entropies of each word whose bits have the same, by kind.
    entropies: [Vec<u32>; KINDS],
    /// Entropies of the bits of the words after those.
    mixed_entropies: Vec<[u32; KINDS]>,
}

/// Map of bits from an engine's order to the level order.
#[derive(Debug)]
pub(super) struct ToLevels {
    pub(super) from: BitOrder,
    /// Occupied voxels, a bit for each bit of the engine's order.
    mask: Vec<u64>,
    /// Occupied voxels before each word of `mask`.
    rank: Vec<u32>,
    /// Bit in the level order of each occupied voxel, by rank.
    bit_of: Vec<u32>,
}

impl ToLevels {
    pub(crate) fn new(levels: &LevelOrder, content: &Content, from: BitOrder) -> Self {
        let ranks = Ranks::new(&from, content.occupied().par_iter().map(|voxel| voxel.index));
        let mut bit_of = vec![0; content.occupied().len()];
        for (&bit, rank) in levels.bit_of.iter().zip(ranks.of) {
            bit_of[rank as usize] = bit;
        }
        Self { from, mask: ranks.bitmap, rank: ranks.before, bit_of }
    }

    /// The words of a bitmap of all voxels, without those that are occupied.
    pub(crate) fn empty(&self, bitmap: &[u64]) -> impl Iterator<Item = u64> + Clone {
        bitmap.iter().zip(&self.mask).map(|(word, occupied)| word & !occupied)
    }

    /// Brings a bitmap of all voxels into the level order; `ordered` is zero.
    pub(crate) fn reorder(&self, bitmap: &[u64], ordered: &mut [u64]) {
        reorder(&self.mask, &self.rank, &self.bit_of, bitmap, ordered);
    }
}

impl LevelOrder {
    /// The order by the entropies of some kinds; sums of the others are 0.
    pub(crate) fn new(content: &Content, kinds: [bool; KINDS]) -> Self {
        let mut by_entropy: BTreeMap<[u32; KINDS], Vec<usize>> = BTreeMap::new();
        for (rank, voxel) in content.occupied().iter().enumerate() {
            let counted = std::array::from_fn(|kind| voxel.entropy[kind] * u32::from(kinds[kind]));
            by_entropy.entry(counted).or_default().push(rank);
        }
        let (large, small): (Vec<_>, Vec<_>) =
            by_entropy.into_iter().partition(|(_, voxels)| voxels.len() >= LEAST_LEVEL);
        let mut bit_of = vec![0; content.occupied().len()];
        let mut entropies = [const { Vec::new() }; KINDS];
        for (entropy, voxels) in large {
            let words = entropies[0].len();
            for (bit, rank) in voxels.iter().enumerate() {
                bit_of[*rank] = (64 * words + bit) as u32;
            }
            for (of_words, entropy) in entropies.iter_mut().zip(entropy) {
                of_words.resize(words + voxels.len().div_ceil(64), entropy);
            }
        }
        let mixed = entropies[0].len();
        let mut mixed_entropies = Vec::new();
        for (entropy, voxels) in small {
            for rank in voxels {
                bit_of[rank] = (64 * mixed + mixed_entropies.len()) as u32;
                mixed_entropies.push(entropy);
            }
        }
        Self { bit_of, entropies, mixed_entropies }
    }

    pub(crate) fn words(&self) -> usize {
        self.entropies[0].len() + self.mixed_entropies.len().div_ceil(64)
    }

    /// Entropies of each bit; zero for bits without a voxel.
    pub(crate) fn entropies(&self, content: &Content) -> Vec<[u32; KINDS]> {
        let mut entropies = vec![[0; KINDS]; 64 * self.words()];
        for (voxel, &bit) in content.occupied().iter().zip(&self.bit_of) {
            entropies[bit as usize] = voxel.entropy;
        }
        entropies
    }

    /// Near information of the bits set in `own`, or both in `below` and `page`, all in this order.
    pub(crate) fn near_of(&self, own: &[u64], below: &[u64], page: &[u64]) -> u64 {
        let near = Entropy::Near.of(&self.entropies.each_ref());
        let mut sum = near_of_words(near, own, below, page);
        let (own, below, page) = (&own[near.len()..], &below[near.len()..], &page[near.len()..]);
        let words = own.iter().zip(below).zip(page).zip(self.mixed_entropies.chunks(64));
        for (((own, below), page), entropies) in words {
            let mut left = own | (below & page);
            while left != 0 {
                sum += u64::from(Entropy::Near.of(&entropies[left.trailing_zeros() as usize]));
                left &= left - 1;
            }
        }
        sum
    }

    /// Adds the sums over the bits set in `a` or in `b`, both in this order, to a tally.
    pub(crate) fn add_union(&self, a: &[u64], b: &[u64], tally: &mut Tally) {
        add_words(&self.entropies, a, b, tally);
        let mixed = self.entropies[0].len();
        let (a, b, mut sums) = (&a[mixed..], &b[mixed..], [0; KINDS]);
        for ((a, b), entropies) in a.iter().zip(b).zip(self.mixed_entropies.chunks(64)) {
            let mut left = a | b;
            tally.covered_nonzero += u64::from(left.count_ones());
            while left != 0 {
                let entropy = entropies[left.trailing_zeros() as usize];
                for (sum, entropy) in sums.iter_mut().zip(entropy) {
                    *sum += u64::from(entropy);
                }
                left &= left - 1;
            }
        }
        tally.entropy.iter_mut().zip(sums).for_each(|(to, sum)| *to += sum);
    }
}

/// Σ popcount(own ∨ (below ∧ page)) × near entropy over the words that have one.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn near_of_words(near: &[u32], own: &[u64], below: &[u64], page: &[u64]) -> u64 {
    let words = near.len();
    let (own, below, page) = (&own[..words], &below[..words], &page[..words]);
    let mut sum = 0;
    for word in 0..words {
        let bits = own[word] | (below[word] & page[word]);
        sum += u64::from(bits.count_ones()) * u64::from(near[word]);
    }
    sum
}

/// Adds Σ popcount(a ∨ b) × entropy over the words that have one.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+avx512vpopcntdq+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn add_words(entropies: &[Vec<u32>; KINDS], a: &[u64], b: &[u64], tally: &mut Tally) {
    let words = entropies[0].len();
    let (a, b) = (&a[..words], &b[..words]);
    let [first, second, third, fourth] = [0, 1, 2, 3].map(|kind: usize| &entropies[kind][..words]);
    let (mut covered, mut sums) = (0, [0; KINDS]);
    for word in 0..words {
        let count = u64::from((a[word] | b[word]).count_ones());
        covered += count;
        sums[0] += count * u64::from(first[word]);
        sums[1] += count * u64::from(second[word]);
        sums[2] += count * u64::from(third[word]);
        sums[3] += count * u64::from(fourth[word]);
    }
    tally.covered_nonzero += covered;
    tally.entropy.iter_mut().zip(sums).for_each(|(to, sum)| *to += sum);
}

/// [`ToLevels::reorder`], compiled for processors that count bits in one instruction, too.
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

/// A bitmap without its zero words.
#[derive(Debug, Default)]
pub(super) struct Sparse {
    /// A bit for each word of the bitmap, set where it is not zero.
    places: Box<[u64]>,
    /// Words that are not zero, in order.
    words: Box<[u64]>,
}

impl Sparse {
    pub(crate) fn new(bitmap: impl Iterator<Item = u64> + Clone) -> Self {
        // Counted first: lists that grow and shrink leave holes between one another.
        let mut words = Vec::with_capacity(bitmap.clone().filter(|&word| word != 0).count());
        let mut places = Vec::with_capacity(bitmap.size_hint().0.div_ceil(64));
        for (at, word) in bitmap.enumerate() {
            if at % 64 == 0 {
                places.push(0);
            }
            if word != 0 {
                places[at / 64] |= 1 << (at % 64);
                words.push(word);
            }
        }
        Self { places: places.into(), words: words.into() }
    }

    pub(crate) fn bytes(&self) -> u64 {
        (size_of_val(&self.places[..]) + size_of_val(&self.words[..])) as u64
    }

    pub(crate) fn add_to(&self, bitmap: &mut [u64]) {
        self.visit(|at, word| bitmap[at] |= word);
    }

    /// Number of its bits that are not set in `bitmap`.
    pub(crate) fn count_beyond(&self, bitmap: &[u64]) -> u64 {
        count_beyond(self, bitmap)
    }

    /// Calls `see` with the place of each word that is not zero, and the word.
    #[inline(always)]
    fn visit(&self, mut see: impl FnMut(usize, u64)) {
        let mut words = self.words.iter();
        for (block, &places) in self.places.iter().enumerate() {
            let mut left = places;
            for &word in words.by_ref().take(places.count_ones() as usize) {
                see(64 * block + left.trailing_zeros() as usize, word);
                left &= left - 1;
            }
        }
    }
}

/// [`Sparse::count_beyond`], compiled for processors that count bits in one instruction, too.
#[multiversion(targets("x86_64+bmi1+bmi2+popcnt"))]
fn count_beyond(sparse: &Sparse, bitmap: &[u64]) -> u64 {
    let mut count = 0;
    sparse.visit(|at, word| count += u64::from((word & !bitmap[at]).count_ones()));
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_bitmap_that_it_was_made_of() {
        for len in [0, 1, 63, 64, 65, 300] {
            let mixed = |at: u64| at.wrapping_mul(0x9e37_79b9_7f4a_7c15);
            let word = |at: u64| if at % 5 == 2 || at > 250 { mixed(at) } else { 0 };
            let bitmap: Vec<u64> = (0..len).map(word).collect();
            let sparse = Sparse::new(bitmap.iter().copied());
            let mut back = vec![0; bitmap.len()];
            sparse.add_to(&mut back);
            assert_eq!(back, bitmap);
            let other: Vec<u64> =
                (0..len).map(|at: u64| at.wrapping_mul(0x1234_5678_9abc_def1)).collect();
            let beyond = bitmap.iter().zip(&other).map(|(a, b)| u64::from((a & !b).count_ones()));
            assert_eq!(sparse.count_beyond(&other), beyond.sum::<u64>());
        }
    }
}
