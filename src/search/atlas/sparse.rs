//! Bitmaps of which most words are zero: a pose covers words in one of six of a scene's empty voxels.

use multiversion::multiversion;

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
