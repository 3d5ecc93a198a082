use bytemuck::{Pod, Zeroable};
use rayon::prelude::*;

use super::kernels::workgroups;
use crate::backend::DevicePose;
use crate::backend::cpu::beam_direction;
use crate::backend::layout::{MAJOR_BITS, NO_SLOT, SHAFT_LANES, WORKGROUP_SIZE};
use crate::bvh::{Ray, Shafts};

/// Beams of one invocation of `cast_shafts`.
const BEAMS: usize = 8;
/// Beams of a block: neighbouring invocations that follow the same list.
const BLOCK: usize = SHAFT_LANES as usize * BEAMS;

/// Four beams as the kernel reads them, 96 bytes: x, y and z of the origins, then of the directions.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
pub(super) struct Four([[f32; 4]; 6]);

/// The beams of a chunk by shaft, in blocks; kept from chunk to chunk.
#[derive(Default)]
pub(super) struct Bundles {
    shafts: Vec<u32>,
    ends: Vec<usize>,
    /// Shaft and major axis of each block.
    pub(super) blocks: Vec<u32>,
    /// What `cast_shafts` is dispatched with.
    pub(super) workgroups: [u32; 3],
    pub(super) beams: Vec<Four>,
    /// Where each beam's hit goes: sensor × directions + direction.
    pub(super) slots: Vec<u32>,
}

impl Bundles {
    /// Slots of a block.
    pub(super) const BLOCK: u64 = BLOCK as u64;

    /// Bytes of the beams of one sensor on the device, and what the last blocks of all shafts may
    /// add.
    pub(super) fn bytes(directions: u64, shafts: usize) -> [u64; 2] {
        let slot = size_of::<Four>() as u64 / 4 + 8;
        [directions * slot, shafts as u64 * BLOCK as u64 * slot]
    }

    /// Bytes of the blocks of so many slots; a dispatch is a rectangle, which at worst doubles them.
    pub(super) fn block_bytes(slots: u64) -> u64 {
        8 * slots / BLOCK as u64 + u64::from(4 * WORKGROUP_SIZE)
    }

    /// Slots of so many beams at most: the last block of a shaft may hold a single beam.
    pub(super) fn most_slots(beams: u64, shafts: usize) -> u64 {
        let blocks = beams.div_ceil(BLOCK as u64) + beams.min(shafts as u64);
        blocks * BLOCK as u64
    }

    /// Sorts the beams of `poses` by shaft, where the faces of the cube of directions are cut into
    /// `edge` × `edge`.
    pub(super) fn sort(&mut self, poses: &[DevicePose], directions: &[[f32; 3]], edge: u32) {
        let ray = |pose: &DevicePose, direction: [f32; 3]| {
            let origin = pose.rows.map(|row| row[3]).into();
            Ray::new(origin, beam_direction(pose, direction), 0.0)
        };
        self.shafts.resize(poses.len() * directions.len(), 0);
        let rows = self.shafts.par_chunks_mut(directions.len()).zip(poses);
        rows.for_each(|(row, pose)| {
            for (shaft, &direction) in row.iter_mut().zip(directions) {
                *shaft = Shafts::of(&ray(pose, direction), edge);
            }
        });
        self.ends.clear();
        self.ends.resize(Shafts::count(edge), 0);
        for &shaft in &self.shafts {
            self.ends[shaft as usize] += 1;
        }
        self.blocks.clear();
        for (shaft, end) in self.ends.iter_mut().enumerate() {
            let first = self.blocks.len();
            let major = shaft as u32 / (2 * edge * edge);
            let block = (shaft as u32) << MAJOR_BITS | major;
            self.blocks.resize(first + end.div_ceil(BLOCK), block);
            *end = first * BLOCK;
        }
        self.slots.clear();
        self.slots.resize(self.blocks.len() * BLOCK, NO_SLOT);
        let in_workgroup = WORKGROUP_SIZE / SHAFT_LANES;
        self.workgroups = workgroups((self.blocks.len() as u32).div_ceil(in_workgroup));
        let [x, y, z] = self.workgroups;
        self.blocks.resize((x * y * z * in_workgroup) as usize, NO_SLOT);
        // Beams that are left over in a block point along z, and their hits go nowhere.
        let idle = Four([[0.0; 4], [0.0; 4], [0.0; 4], [1.0; 4], [1.0; 4], [1.0; 4]]);
        self.beams.clear();
        self.beams.resize(self.slots.len() / 4, idle);
        for (slot, &shaft) in self.shafts.iter().enumerate() {
            let end = &mut self.ends[shaft as usize];
            let at = *end;
            *end += 1;
            self.slots[at] = slot as u32;
            let (sensor, direction) = (slot / directions.len(), slot % directions.len());
            let pose = &poses[sensor];
            let to = beam_direction(pose, directions[direction]);
            let four = &mut self.beams[at / 4].0;
            for axis in 0..3 {
                four[axis][at % 4] = pose.rows[axis][3];
                four[3 + axis][at % 4] = to[axis];
            }
        }
    }
}
