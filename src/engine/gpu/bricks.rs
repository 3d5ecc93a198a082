//! The order of bits in a device's bitmaps: bricks of 4 × 4 × 2 voxels, a 32-bit word each.

use super::layout::LONG_AXIS;
use crate::problem::{Content, DevicePose, OccupiedVoxel};
use crate::psog::Roi;

/// Voxels along each axis of a brick, as powers of two: 4 × 4 × 2.
const SHIFT: [u32; 3] = [2, 2, 1];

/// Bit number = 32 · brick + 8 · (x mod 4) + 2 · (y mod 4) + (z mod 2), bricks in the order of the grid.
///
/// A beam crosses several voxels of a brick and writes its word once; in rows of voxels it would
/// write a word a voxel. Example: in a grid of 8 × 8 × 4 voxels, 2 × 2 × 2 bricks, voxel (5, 2, 3) lies in
/// brick (1, 0, 1), number 5, at bit 8 · 1 + 2 · 2 + 1 = 13, so its bit number is 173.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bricks {
    shape: [u32; 3],
    count: [u32; 3],
}

impl Bricks {
    pub(super) fn new(roi: &Roi) -> Self {
        let shape = roi.shape();
        let count = [0, 1, 2].map(|axis| shape[axis].div_ceil(1 << SHIFT[axis]));
        Self { shape, count }
    }

    /// 32-bit words of a bitmap; an even number, so that it is also one of 64-bit words.
    pub(super) fn words(&self) -> u64 {
        self.count.iter().map(|&n| u64::from(n)).product::<u64>().next_multiple_of(2)
    }

    /// Whether the kernel covers the beams of a sensor: one in the grid, and no axis is long.
    pub(super) fn on_device(&self, pose: &DevicePose) -> bool {
        let axes = self.shape.iter().zip(pose.in_grid);
        axes.into_iter().all(|(&n, p)| n < LONG_AXIS && (0.0..n as f32).contains(&p))
    }

    /// Bit number of a voxel, from its linear index.
    pub(super) fn bit(&self, voxel: u32) -> u32 {
        let [_, ny, nz] = self.shape;
        let at = [voxel / nz / ny, voxel / nz % ny, voxel % nz];
        let brick = [0, 1, 2].map(|axis| at[axis] >> SHIFT[axis]);
        let within = [0, 1, 2].map(|axis| at[axis] & ((1 << SHIFT[axis]) - 1));
        let word = (brick[0] * self.count[1] + brick[1]) * self.count[2] + brick[2];
        let bit = (within[0] << SHIFT[1] | within[1]) << SHIFT[2] | within[2];
        word << 5 | bit
    }

    /// The same content with bit numbers in place of linear indices, rising.
    pub(super) fn content(&self, content: &Content) -> Content {
        let mut occupied: Vec<OccupiedVoxel> = content
            .occupied()
            .iter()
            .map(|voxel| OccupiedVoxel { index: self.bit(voxel.index), ..*voxel })
            .collect();
        occupied.sort_unstable_by_key(|voxel| voxel.index);
        let by_class: Vec<Vec<u32>> = (0..content.classes().len())
            .map(|class| {
                let mut voxels: Vec<u32> =
                    content.voxels_of_class(class).iter().map(|&voxel| self.bit(voxel)).collect();
                voxels.sort_unstable();
                voxels
            })
            .collect();
        let classes = content.classes().to_vec();
        Content::new(classes, occupied, &by_class, content.has_detection())
    }

    /// A bitmap in the order of linear indices turned into one in bricks.
    pub(super) fn from_linear(&self, linear: &[u64]) -> Vec<u32> {
        let mut bitmap = vec![0; self.words() as usize];
        for (word, &bits) in (0_u32..).zip(linear).filter(|(_, bits)| **bits != 0) {
            let mut rest = bits;
            while rest != 0 {
                let bit = self.bit(word << 6 | rest.trailing_zeros());
                bitmap[bit as usize >> 5] |= 1 << (bit & 31);
                rest &= rest - 1;
            }
        }
        bitmap
    }

    /// Sets the bits of a device's bitmap in one of linear order.
    pub(super) fn add_in_order(&self, bitmap: &[u32], linear: &mut [u64]) {
        let [_, ny, nz] = self.shape;
        for (word, &bits) in bitmap.iter().enumerate().filter(|(_, bits)| **bits != 0) {
            let [by, bz] = [self.count[1], self.count[2]].map(|n| n as usize);
            let corner = [word / bz / by, word / bz % by, word % bz];
            let [x, y, z] = [0, 1, 2].map(|axis| (corner[axis] as u32) << SHIFT[axis]);
            let mut rest = bits;
            while rest != 0 {
                let bit = rest.trailing_zeros();
                rest &= rest - 1;
                let (z, row) = (z + (bit & ((1 << SHIFT[2]) - 1)), bit >> SHIFT[2]);
                let (y, x) = (y + (row & ((1 << SHIFT[1]) - 1)), x + (row >> SHIFT[1]));
                let voxel = ((x * ny + y) * nz + z) as usize;
                linear[voxel >> 6] |= 1 << (voxel & 63);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_has_its_number() {
        let roi = Roi::new([0.0; 3], [1.0; 3], [8, 8, 4]).unwrap();
        assert_eq!(Bricks::new(&roi).bit(roi.linear([5, 2, 3]) as u32), 173);
    }

    #[test]
    fn every_voxel_has_a_bit_of_its_own() {
        for shape in [[5, 6, 3], [1, 1, 1], [9, 1, 2], [4, 4, 2]] {
            let roi = Roi::new([0.0; 3], [1.0; 3], shape).unwrap();
            let bricks = Bricks::new(&roi);
            let voxels = roi.voxel_count() as u32;
            let mut bitmap = vec![0_u32; bricks.words() as usize];
            for voxel in 0..voxels {
                let bit = bricks.bit(voxel);
                assert_eq!(bitmap[bit as usize >> 5] >> (bit & 31) & 1, 0, "{shape:?} {voxel}");
                bitmap[bit as usize >> 5] |= 1 << (bit & 31);
                let mut linear = vec![0; voxels.div_ceil(64) as usize];
                let mut single = vec![0; bitmap.len()];
                single[bit as usize >> 5] = 1 << (bit & 31);
                bricks.add_in_order(&single, &mut linear);
                assert_eq!(linear[voxel as usize >> 6], 1 << (voxel & 63), "{shape:?} {voxel}");
                assert_eq!(bricks.from_linear(&linear), single, "{shape:?} {voxel}");
            }
        }
    }
}
