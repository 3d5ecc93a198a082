//! Bitmaps of words along y, turned into the rows along x of [`BitOrder::rows`](super::BitOrder::rows).

use multiversion::multiversion;

use super::bit_order::ROW as WORD;

/// Distances at which bits are exchanged, and the lower bits of each pair.
const HALVES: [(u32, u32); 5] =
    [(16, 0x0000_ffff), (8, 0x00ff_00ff), (4, 0x0f0f_0f0f), (2, 0x3333_3333), (1, 0x5555_5555)];

/// Adds a bitmap of words along y, which it clears, to one of words along x.
#[multiversion(targets(
    "x86_64+avx+avx2+avx512f+avx512bw+avx512dq+avx512vl+bmi1+bmi2+popcnt+lzcnt",
    "x86_64+avx+avx2+bmi1+bmi2+popcnt+lzcnt",
))]
pub(super) fn add_transposed(shape: [u32; 3], along_y: &mut [u32], along_x: &mut [u32]) {
    let [nx, ny, _] = shape.map(|n| n as usize);
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

/// Up to 32 words, filled up with zeros; all 32 are copied as vectors of fixed length.
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
    use crate::cover::BitOrder;
    use crate::cover::bit_order::row_words;
    use crate::grid::Roi;

    #[test]
    fn words_along_y_end_as_the_same_voxels() {
        for shape in [[5, 6, 3], [33, 40, 2], [64, 1, 35], [1, 33, 33], [70, 45, 67], [3, 5, 130]] {
            let roi = Roi::new([0.0; 3], [1.0; 3], shape).unwrap();
            let rows = BitOrder::rows(&roi);
            let [nx, ny, nz] = shape.map(|n| n as usize);
            let (mut along_x, mut along_y) =
                (vec![0_u64; rows.words()], vec![0; row_words(shape, 1)]);
            let mut want = along_x.clone();
            for voxel in (0..nx * ny * nz).filter(|voxel| voxel * voxel % 7 < 2) {
                let bit = rows.bit_of(voxel as u32) as usize;
                want[bit / 64] |= 1 << (bit % 64);
                let [x, y, z] = [voxel / nz / ny, voxel / nz % ny, voxel % nz];
                if voxel % 3 == 0 {
                    along_x[bit / 64] |= 1 << (bit % 64);
                } else {
                    along_y[(z * ny.div_ceil(32) + y / 32) * nx + x] |= 1 << (y % 32);
                }
            }
            assert!(along_x != want, "{shape:?}");
            add_transposed(shape, &mut along_y, bytemuck::cast_slice_mut(&mut along_x));
            assert!(along_x == want, "{shape:?}");
            assert!(along_y.iter().all(|&word| word == 0), "{shape:?}");
        }
    }
}
