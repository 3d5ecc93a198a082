use multiversion::multiversion;

use crate::psog::Roi;

/// Voxels of a word, and rows of a block that is transposed at a time.
const WORD: usize = 32;
/// A bitmap of 64-bit words is marked by halves; this finds them on machines that store the high
/// half first.
const SWAP: u32 = cfg!(target_endian = "big") as u32;
/// Distances at which bits are exchanged, and the lower bits of each pair.
const HALVES: [(u32, u32); 5] =
    [(16, 0x0000_ffff), (8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)];
/// Bits up to which a grid's rows may be mostly empty.
const FEW_BITS: u64 = 1 << 23;

/// Order of the voxels in the bitmaps of the CPU: 32 voxels along x a word, words in rows along y,
/// those in order of x, then of z.
///
/// A beam that passes several voxels of a word one after another marks them at once. Grids that
/// would waste most of such words keep the order of their indices.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Rows {
    shape: [usize; 3],
    wide: bool,
}

impl Rows {
    pub(crate) fn new(roi: &Roi) -> Self {
        let shape = roi.shape().map(|n| n as usize);
        let rows = Self { shape, wide: true };
        let words = rows.words_along(0).max(rows.words_along(1)) as u64;
        let wide = WORD as u64 * words <= (2 * roi.voxel_count()).max(FEW_BITS);
        Self { shape, wide }
    }

    /// Whether words hold voxels along an axis.
    pub(crate) fn are_wide(&self) -> bool {
        self.wide
    }

    /// 64-bit words of a bitmap.
    pub(crate) fn words(&self) -> usize {
        let [nx, ny, nz] = self.shape;
        if self.wide { self.words_along(0).div_ceil(2) } else { (nx * ny * nz).div_ceil(64) }
    }

    /// 32-bit words of a bitmap of words along x (0), or of the same with x and y exchanged (1).
    pub(crate) fn words_along(&self, axis: usize) -> usize {
        self.shape[axis].div_ceil(WORD) * self.shape[1 - axis] * self.shape[2]
    }

    /// Number of a voxel's bit in 32-bit words, from its linear index.
    pub(crate) fn bit(&self, voxel: usize) -> usize {
        if !self.wide {
            return voxel;
        }
        let [nx, ny, nz] = self.shape;
        let [x, y, z] = [voxel / nz / ny, voxel / nz % ny, voxel % nz];
        (((z * nx.div_ceil(WORD) + x / WORD) * ny + y) * WORD) | (x % WORD)
    }

    /// The same in 64-bit words.
    pub(crate) fn bit_of_64(&self, voxel: u32) -> u32 {
        self.bit(voxel as usize) as u32 ^ (SWAP << 5)
    }

    /// Adds a bitmap of words along y, which it clears, to one of words along x.
    pub(crate) fn add_along_y(&self, along_y: &mut [u32], bitmap: &mut [u32]) {
        add_transposed(self.shape, along_y, bitmap);
    }

    /// Moves the bits of a bitmap, which it clears, to one in the order of the grid.
    pub(crate) fn move_in_order(&self, bitmap: &mut [u32], linear: &mut [u64]) {
        move_in_order(self.shape, bitmap, linear);
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn add_transposed([nx, ny, _]: [usize; 3], along_y: &mut [u32], along_x: &mut [u32]) {
    let (from, to) = (ny.div_ceil(WORD) * nx, nx.div_ceil(WORD) * ny);
    for (from, to) in along_y.chunks_exact_mut(from).zip(along_x.chunks_exact_mut(to)) {
        for (block_y, from) in from.chunks_exact_mut(nx).enumerate() {
            for (block_x, from) in from.chunks_mut(WORD).enumerate() {
                let mut block = load(from);
                if or_of(&block) == 0 {
                    continue;
                }
                from.fill(0);
                transpose(&mut block);
                let first = block_x * ny + block_y * WORD;
                let to = &mut to[first..first + WORD.min(ny - block_y * WORD)];
                for (to, word) in to.iter_mut().zip(block) {
                    *to |= word;
                }
            }
        }
    }
}

#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
fn move_in_order([nx, ny, nz]: [usize; 3], bitmap: &mut [u32], linear: &mut [u64]) {
    let layer = nx.div_ceil(WORD) * ny;
    // Layers that hold bits, by blocks along y.
    let mut filled = vec![0_u64; ny.div_ceil(WORD)];
    for (group, layers) in bitmap.chunks_mut(2 * WORD * layer).enumerate() {
        let first_z = group * 2 * WORD;
        for first_x in (0..nx).step_by(WORD) {
            // Layer by layer, since they lie far apart; what is empty is not looked at again.
            let first = first_x / WORD * ny;
            filled.fill(0);
            for (z, layer) in layers.chunks_exact(layer).enumerate() {
                for (filled, words) in filled.iter_mut().zip(layer[first..first + ny].chunks(WORD))
                {
                    *filled |= u64::from(or_of(&load(words)) != 0) << z;
                }
            }
            for (first_y, &filled) in (0..ny).step_by(WORD).zip(&filled) {
                if filled == 0 {
                    continue;
                }
                let len = WORD.min(ny - first_y);
                let first = first + first_y;
                // Rows are layers, then voxels along x; a lane is a voxel along y.
                let mut halves = [[[0; WORD]; WORD]; 2];
                let mut left = filled;
                while left != 0 {
                    let z = left.trailing_zeros() as usize;
                    left &= left - 1;
                    let words = &mut layers[z * layer + first..z * layer + first + len];
                    halves[z / WORD % 2][z % WORD] = load(words);
                    words.fill(0);
                }
                for (half, rows) in halves.iter_mut().enumerate() {
                    if (filled >> (half * WORD)) as u32 != 0 {
                        transpose_lanes(rows);
                    }
                }
                let [low, high] = &halves;
                for (x, (low, high)) in (first_x..nx).zip(low.iter().zip(high)) {
                    let (columns, any) = join(low, high);
                    if any == 0 {
                        continue;
                    }
                    let bit = (x * ny + first_y) * nz + first_z;
                    if nz <= 2 * WORD {
                        put(&columns[..len], nz, bit, linear);
                    } else {
                        for (y, &column) in columns[..len].iter().enumerate() {
                            put(&[column], nz, bit + y * nz, linear);
                        }
                    }
                }
            }
        }
    }
}

/// The lower and the upper halves of some columns together, and the bits that any of them has.
#[inline(always)]
fn join(low: &[u32; WORD], high: &[u32; WORD]) -> ([u64; WORD], u64) {
    let (mut columns, mut any) = ([0; WORD], 0);
    for i in 0..WORD {
        columns[i] = u64::from(low[i]) | u64::from(high[i]) << WORD;
        any |= columns[i];
    }
    (columns, any)
}

/// Adds the lowest bits of some columns, `height` (up to 64) each, one after another from bit `first` on.
#[inline(always)]
fn put(columns: &[u64], height: usize, first: usize, linear: &mut [u64]) {
    let (mut at, mut fill, mut bits) = (first >> 6, first & 63, 0);
    for &column in columns {
        bits |= column << fill;
        let rest = (column >> 1) >> (63 - fill);
        fill += height;
        if fill > 63 {
            // In one go: a page that is read before it is first written faults twice.
            linear[at] |= bits;
            (at, fill, bits) = (at + 1, fill - 64, rest);
        }
    }
    if bits != 0 {
        linear[at] |= bits;
    }
}

/// Up to 32 words and zeros: whole vectors where there are all, which the usual copy is not.
#[inline(always)]
fn load(words: &[u32]) -> [u32; WORD] {
    words.first_chunk().copied().unwrap_or_else(|| {
        let mut some = [0; WORD];
        some[..words.len()].copy_from_slice(words);
        some
    })
}

#[inline(always)]
fn or_of(words: &[u32; WORD]) -> u32 {
    words.iter().fold(0, |or, word| or | word)
}

/// [`transpose`] of 32 blocks side by side.
#[inline(always)]
#[allow(clippy::needless_range_loop)]
fn transpose_lanes(rows: &mut [[u32; WORD]; WORD]) {
    for (shift, low) in HALVES {
        for at in (0..WORD).filter(|at| at & shift as usize == 0) {
            let (mut a, mut b) = (rows[at], rows[at + shift as usize]);
            for i in 0..WORD {
                let exchange = ((a[i] >> shift) ^ b[i]) & low;
                a[i] ^= exchange << shift;
                b[i] ^= exchange;
            }
            (rows[at], rows[at + shift as usize]) = (a, b);
        }
    }
}

/// Exchanges rows and columns of 32 × 32 bits.
///
/// Each pass exchanges the highest bit of a row's number with one of a column's, and turns the row's
/// number round by a bit: all passes do the same to the same places, so that a compiler sees vectors.
/// (The halving of Warren, Hacker's Delight, 7-3.)
#[inline(always)]
fn transpose(rows: &mut [u32; WORD]) {
    for (shift, low) in HALVES {
        let before = *rows;
        for i in 0..WORD / 2 {
            let (a, b) = (before[i], before[i + WORD / 2]);
            rows[2 * i] = (a & low) | ((b & low) << shift);
            rows[2 * i + 1] = ((a >> shift) & low) | (b & !low);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_voxel_has_a_bit_of_its_own() {
        for shape in [[5, 6, 3], [33, 40, 2], [64, 1, 35], [1, 33, 33], [1, 1, 300_000]] {
            let roi = Roi::new([0.0; 3], [1.0; 3], shape).unwrap();
            let rows = Rows::new(&roi);
            assert_eq!(rows.are_wide(), shape[2] < 1000);
            let voxels = roi.voxel_count() as usize;
            let mut seen = vec![false; 64 * rows.words()];
            for voxel in 0..voxels {
                assert!(!std::mem::replace(&mut seen[rows.bit_of_64(voxel as u32) as usize], true));
            }
        }
    }

    #[test]
    fn bits_are_moved_to_the_same_voxels() {
        for shape in [[5, 6, 3], [33, 40, 2], [64, 1, 35], [1, 33, 33], [70, 45, 67], [3, 5, 130]] {
            let roi = Roi::new([0.0; 3], [1.0; 3], shape).unwrap();
            let rows = Rows::new(&roi);
            let [nx, ny, nz] = rows.shape;
            let (mut along_x, mut along_y) =
                (vec![0; 2 * rows.words()], vec![0; rows.words_along(1)]);
            let mut want = vec![0_u64; (nx * ny * nz).div_ceil(64)];
            for voxel in (0..nx * ny * nz).filter(|voxel| voxel * voxel % 7 < 2) {
                want[voxel >> 6] |= 1 << (voxel & 63);
                let [x, y, z] = [voxel / nz / ny, voxel / nz % ny, voxel % nz];
                if voxel % 3 == 0 {
                    let bit = rows.bit(voxel);
                    along_x[bit >> 5] |= 1 << (bit & 31);
                } else {
                    along_y[(z * ny.div_ceil(32) + y / 32) * nx + x] |= 1 << (y % 32);
                }
            }
            let mut linear = vec![0; want.len()];
            rows.add_along_y(&mut along_y, &mut along_x);
            rows.move_in_order(&mut along_x, &mut linear);
            assert!(linear == want, "{shape:?}");
            assert!(along_x.iter().chain(&along_y).all(|&word| word == 0), "{shape:?}");
        }
    }
}
