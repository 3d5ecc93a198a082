use crate::cover::BitOrder;
use crate::problem::{Content, DevicePose, OccupiedVoxel};
use crate::psog::Roi;

/// Voxels along an axis below which crossings of different planes are different numbers, and a walk from
/// brick to brick ends within [`STEP_BUDGET`](crate::engine::gpu::layout::STEP_BUDGET).
const PLAIN: f32 = (1 << 15) as f32;

/// Order of the voxels in a device's bitmaps: bricks of 4 × 4 × 2 voxels, a 32-bit word each.
///
/// A beam stays in a brick for several voxels, and writes its word once; in rows of voxels it would
/// write a word a voxel. Bits of a brick are in the order of the grid, and so are the bricks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bricks {
    shape: [u32; 3],
    order: BitOrder,
}

impl Bricks {
    pub(super) fn new(roi: &Roi) -> Self {
        Self { shape: roi.shape(), order: BitOrder::bricks(roi) }
    }

    /// 32-bit words of a bitmap: an even number, two a word of 64 bits.
    pub(super) fn words(&self) -> u64 {
        2 * self.order.words() as u64
    }

    /// Whether beams may go from brick to brick: those of a sensor in the grid, and that a plain one.
    pub(super) fn lead_from(&self, pose: &DevicePose) -> bool {
        self.shape.iter().zip(pose.in_grid).all(|(&n, p)| {
            let n = n as f32;
            n < PLAIN && (0.0..n).contains(&p)
        })
    }

    /// The same content with the bits' numbers for indices, rising.
    pub(super) fn content(&self, content: &Content) -> Content {
        let mut occupied: Vec<OccupiedVoxel> = content
            .occupied()
            .iter()
            .map(|voxel| OccupiedVoxel { index: self.order.bit_of(voxel.index), ..*voxel })
            .collect();
        occupied.sort_unstable_by_key(|voxel| voxel.index);
        let by_class: Vec<Vec<u32>> = (0..content.classes().len())
            .map(|class| {
                let mut voxels: Vec<u32> = content
                    .voxels_of_class(class)
                    .iter()
                    .map(|&voxel| self.order.bit_of(voxel))
                    .collect();
                voxels.sort_unstable();
                voxels
            })
            .collect();
        let classes = content.classes().to_vec();
        Content::new(classes, occupied, &by_class, content.has_detection())
    }
}
