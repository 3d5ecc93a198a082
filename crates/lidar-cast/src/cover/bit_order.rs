//! The order in which the bits of a coverage bitmap stand, by name.

use std::borrow::Cow;

use rayon::prelude::*;

use crate::grid::Roi;

/// Voxels along x in a 32-bit word of [`BitOrder::rows`].
pub(crate) const ROW: usize = 32;
/// Bits up to which the rows of a grid may be mostly padding.
const FEW_BITS: u64 = 1 << 23;
/// Voxels along each axis of a brick, as powers of two: 4 × 4 × 2 voxels are 32 bits.
const BRICK: [u32; 3] = [2, 2, 1];
/// Rows are marked through 32-bit halves of 64-bit words; a big-endian machine keeps the high half
/// first, so that bit 5 of a bit's number is inverted there.
const SWAP: u32 = if cfg!(target_endian = "big") { ROW as u32 } else { 0 };

/// The order in which the bits of a bitmap stand: which bit is which voxel's.
///
/// Each engine hands out its bitmaps in the order that it marks fastest; whoever needs another one
/// asks the order. Bit b of a bitmap is bit `b % 64` of word `b / 64`. Orders whose rows or bricks
/// jut out of the grid hold padding bits, which are never set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BitOrder {
    layout: BitLayout,
    shape: [u32; 3],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum BitLayout {
    Linear,
    Rows,
    Bricks,
}

impl BitOrder {
    /// C order: the bit of voxel (x, y, z) is its linear index (x·ny + y)·nz + z.
    pub fn linear(roi: &Roi) -> Self {
        Self { layout: BitLayout::Linear, shape: roi.shape() }
    }

    /// Rows along x, as the CPU marks them: a 32-bit word holds 32 voxels along x.
    ///
    /// Words follow one another along y, then x, then z. Voxel (x, y, z) has the bit
    /// 32·((z·⌈nx / 32⌉ + x / 32)·ny + y) + x % 32. A beam that passes several voxels of a word one after another marks
    /// them at once. A grid whose rows would be mostly padding keeps the linear order.
    pub fn rows(roi: &Roi) -> Self {
        let words = row_words(roi.shape(), 0).max(row_words(roi.shape(), 1)) as u64;
        let most = (2 * roi.voxel_count()).clamp(FEW_BITS, 1 << 32);
        let layout = if ROW as u64 * words <= most { BitLayout::Rows } else { BitLayout::Linear };
        Self { layout, shape: roi.shape() }
    }

    /// Bricks of 4 × 4 × 2 voxels, as devices mark them: a 32-bit word a brick, bricks and the voxels
    /// in a brick in C order. The bit of (x, y, z) in its brick is 8·(x % 4) + 2·(y % 4) + z % 2.
    pub(crate) fn bricks(roi: &Roi) -> Self {
        Self { layout: BitLayout::Bricks, shape: roi.shape() }
    }

    /// 64-bit words of a bitmap.
    pub fn words(&self) -> usize {
        match self.layout {
            BitLayout::Linear => {
                self.shape.iter().map(|&n| u64::from(n)).product::<u64>().div_ceil(64) as usize
            }
            BitLayout::Rows => row_words(self.shape, 0).div_ceil(2),
            BitLayout::Bricks => {
                self.bricks_along().iter().map(|&n| n as usize).product::<usize>().div_ceil(2)
            }
        }
    }

    /// Words of the largest bitmap that any engine makes of a grid.
    pub fn most_words(roi: &Roi) -> usize {
        Self::rows(roi).words().max(Self::bricks(roi).words())
    }

    /// True if 32-bit words hold voxels along x.
    pub(crate) fn has_rows(&self) -> bool {
        self.layout == BitLayout::Rows
    }

    /// Number of the bit of a voxel, which is given by its linear index.
    pub fn bit_of(&self, voxel: u32) -> u32 {
        let [_, ny, nz] = self.shape;
        let [x, y, z] = [voxel / nz / ny, voxel / nz % ny, voxel % nz];
        match self.layout {
            BitLayout::Linear => voxel,
            BitLayout::Rows => {
                let word = (z * self.words_along_x() + x / ROW as u32) * ny + y;
                (word * ROW as u32 + x % ROW as u32) ^ SWAP
            }
            BitLayout::Bricks => {
                let [_, by, bz] = self.bricks_along();
                let [i, j, k] = BRICK;
                let word = ((x >> i) * by + (y >> j)) * bz + (z >> k);
                let [x, y, z] = [x & ((1 << i) - 1), y & ((1 << j) - 1), z & ((1 << k) - 1)];
                word << 5 | (x << j | y) << k | z
            }
        }
    }

    /// Linear index of the voxel of a bit, or `None` for padding.
    pub fn voxel_of(&self, bit: u32) -> Option<u32> {
        let [nx, ny, nz] = self.shape;
        let [x, y, z] = match self.layout {
            BitLayout::Linear => {
                let inside = u64::from(bit) < [nx, ny, nz].map(u64::from).iter().product();
                return inside.then_some(bit);
            }
            BitLayout::Rows => {
                let (word, x) = ((bit ^ SWAP) / ROW as u32, bit % ROW as u32);
                let (row, y) = (word / ny, word % ny);
                let along = self.words_along_x();
                [row % along * ROW as u32 + x, y, row / along]
            }
            BitLayout::Bricks => {
                let [_, by, bz] = self.bricks_along();
                let [i, j, k] = BRICK;
                let brick = bit >> 5;
                let [x, y, z] = [brick / bz / by, brick / bz % by, brick % bz];
                let (row, in_z) = (bit >> k, bit & ((1 << k) - 1));
                let (in_x, in_y) = (row >> j & ((1 << i) - 1), row & ((1 << j) - 1));
                [x << i | in_x, y << j | in_y, z << k | in_z]
            }
        };
        (x < nx && y < ny && z < nz).then(|| (x * ny + y) * nz + z)
    }

    /// A bitmap of this order in another one.
    pub fn convert<'a>(&self, bitmap: &'a [u64], to: &Self) -> Cow<'a, [u64]> {
        if self == to {
            return Cow::Borrowed(bitmap);
        }
        let mut converted = vec![0; to.words()];
        for voxel in bits(bitmap).filter_map(|bit| self.voxel_of(bit)) {
            let bit = to.bit_of(voxel) as usize;
            converted[bit / 64] |= 1 << (bit % 64);
        }
        Cow::Owned(converted)
    }

    /// The bitmap in which some bits are set.
    pub fn bitmap(&self, bits: impl Iterator<Item = u32>) -> Vec<u64> {
        let mut bitmap = vec![0; self.words()];
        bits.for_each(|bit| bitmap[bit as usize / 64] |= 1 << (bit % 64));
        bitmap
    }

    fn words_along_x(&self) -> u32 {
        self.shape[0].div_ceil(ROW as u32)
    }

    fn bricks_along(&self) -> [u32; 3] {
        [0, 1, 2].map(|axis| self.shape[axis].div_ceil(1 << BRICK[axis]))
    }
}

/// Where some voxels come among one another in an order.
pub struct Ranks {
    /// Their bits.
    pub bitmap: Vec<u64>,
    /// Voxels before each word of the bitmap.
    pub before: Vec<u32>,
    /// Rank of each voxel: how many of the others have lower bits.
    pub of: Vec<u32>,
}

impl Ranks {
    /// Ranks `voxels`: linear indices, each listed once.
    pub fn new(order: &BitOrder, voxels: impl IndexedParallelIterator<Item = u32>) -> Self {
        let bits: Vec<u32> = voxels.map(|voxel| order.bit_of(voxel)).collect();
        let bitmap = order.bitmap(bits.iter().copied());
        let mut sum = 0;
        let words = bitmap.iter().map(|word| {
            sum += word.count_ones();
            sum - word.count_ones()
        });
        let before: Vec<u32> = words.collect();
        let rank = |bit: u32| {
            let word = bit as usize / 64;
            before[word] + (bitmap[word] & ((1 << (bit % 64)) - 1)).count_ones()
        };
        let of = bits.into_par_iter().map(rank).collect();
        Self { bitmap, before, of }
    }
}

/// 32-bit words of a bitmap of rows along x (`axis` 0), or along y with x and y exchanged (1).
pub(super) fn row_words(shape: [u32; 3], axis: usize) -> usize {
    let [nx, ny, nz] = [shape[axis], shape[1 - axis], shape[2]].map(|n| n as usize);
    nx.div_ceil(ROW) * ny * nz
}

/// Numbers of the bits that are set, rising.
fn bits(words: &[u64]) -> impl Iterator<Item = u32> {
    words.iter().enumerate().flat_map(|(index, &word)| {
        std::iter::successors(Some(word), |left| Some(left & left.wrapping_sub(1)))
            .take_while(|left| *left != 0)
            .map(move |left| (64 * index) as u32 + left.trailing_zeros())
    })
}

/// Coverage bitmaps of some sensors, one after another, in the order of the engine that made them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Bitmaps {
    /// The order of each bitmap.
    pub order: BitOrder,
    /// `[sensors × order.words()]`.
    pub words: Vec<u64>,
}

impl Bitmaps {
    /// The bitmap of each sensor.
    pub fn sensors(&self) -> std::slice::Chunks<'_, u64> {
        self.words.chunks(self.order.words())
    }

    /// Linear indices of the voxels that any of the sensors covers, rising.
    pub fn union(&self) -> Vec<u64> {
        let mut union = vec![0; self.order.words()];
        for bitmap in self.sensors() {
            union.iter_mut().zip(bitmap).for_each(|(or, word)| *or |= word);
        }
        let voxels = bits(&union).filter_map(|bit| self.order.voxel_of(bit));
        let mut voxels: Vec<u64> = voxels.map(u64::from).collect();
        voxels.sort_unstable();
        voxels
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHAPES: [[u32; 3]; 8] = [
        [5, 6, 3],
        [33, 40, 2],
        [64, 1, 35],
        [1, 33, 33],
        [1, 1, 300_000],
        [1, 1, 1],
        [9, 1, 2],
        [4, 4, 2],
    ];

    fn orders(roi: &Roi) -> [BitOrder; 3] {
        [BitOrder::linear(roi), BitOrder::rows(roi), BitOrder::bricks(roi)]
    }

    #[test]
    fn every_voxel_has_a_bit_of_its_own_and_all_other_bits_are_padding() {
        for shape in SHAPES {
            let roi = Roi::new([0.0; 3], [1.0; 3], shape).unwrap();
            assert_eq!(BitOrder::rows(&roi).has_rows(), shape[2] < 1000);
            for order in orders(&roi) {
                let voxels = roi.voxel_count() as u32;
                let mut voxel_of = vec![None; 64 * order.words()];
                for voxel in 0..voxels {
                    let slot = &mut voxel_of[order.bit_of(voxel) as usize];
                    assert!(slot.replace(voxel).is_none(), "{order:?} {voxel}");
                }
                for (bit, want) in voxel_of.into_iter().enumerate() {
                    assert_eq!(order.voxel_of(bit as u32), want, "{order:?} {bit}");
                }
            }
        }
    }

    #[test]
    fn bits_stand_where_the_formulas_say() {
        let roi = Roi::new([0.0; 3], [1.0; 3], [70, 5, 7]).unwrap();
        let voxel = roi.linear([37, 3, 6]) as u32;
        let [linear, rows, bricks] = orders(&roi).map(|order| order.bit_of(voxel));
        assert_eq!(linear, (37 * 5 + 3) * 7 + 6);
        assert_eq!(rows ^ SWAP, 32 * ((6 * 3 + 1) * 5 + 3) + 5);
        assert_eq!(bricks, 32 * ((9 * 2) * 4 + 3) + 8 + 2 * 3);
    }

    #[test]
    fn a_bitmap_is_the_same_voxels_in_every_order() {
        for shape in SHAPES {
            let roi = Roi::new([0.0; 3], [1.0; 3], shape).unwrap();
            let some: Vec<u64> =
                (0..roi.voxel_count()).filter(|voxel| voxel * voxel % 7 < 2).collect();
            let [linear, ..] = orders(&roi);
            let mut words = vec![0; linear.words()];
            some.iter().for_each(|voxel| words[*voxel as usize / 64] |= 1 << (voxel % 64));
            for from in orders(&roi) {
                let converted = linear.convert(&words, &from);
                for to in orders(&roi) {
                    let words = from.convert(&converted, &to);
                    assert_eq!(
                        Bitmaps { order: to, words: words.to_vec() }.union(),
                        some,
                        "{from:?} {to:?}"
                    );
                }
            }
        }
    }
}
