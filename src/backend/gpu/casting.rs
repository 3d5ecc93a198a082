use rayon::prelude::*;

use super::device::Device;
use super::kernels::{Kernels, dispatch};
use super::packets::{Mixed, Plan, RAYS, scattered};
use super::resources::ChunkBuffers;
use crate::backend::layout::{MAX_WORKGROUPS, NO_SLOT, WORKGROUP_SIZE};
use crate::backend::{BackendError, DevicePose, Problem};

/// How closest hits are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Each beam goes down a tree of quantized nodes: an invocation is a beam.
    Tree,
    /// Beams that lie close go down a tree of four children a node together: an invocation is a
    /// packet. A device whose lanes are those of a host's vector unit loads each lane's part of the
    /// tree one by one, and so for many beams at once.
    Packets,
}

/// Invocations of a workgroup.
const LANES: usize = WORKGROUP_SIZE as usize;

/// What an invocation says of its beams: which hit, and which are left to the host.
type Marks = [u32; 4];

/// Casts a chunk in packets; its buffers are kept from chunk to chunk.
#[derive(Default)]
pub(super) struct PacketCaster {
    plan: Plan,
    /// Where the hits of the mixed packets go.
    slots: Vec<u32>,
    /// Dispatch of the mixed packets.
    workgroups: [u32; 3],
    buffers: Vec<wgpu::Buffer>,
}

/// Places of the buffers.
const BLOCKS: usize = 0;
const SLOTS: usize = 1;
const ORIGINS: usize = 2;
const MARKS: usize = 3;
const MIXED_SLOTS: usize = 4;
const MIXED_BEAMS: usize = 5;
const MIXED_MARKS: usize = 6;
const MIXED_ORDER: usize = 7;
const NAMES: [&str; 8] = [
    "blocks of directions",
    "slots of packets",
    "origins of packets",
    "marks of packets",
    "slots of mixed packets",
    "beams of mixed packets",
    "marks of mixed packets",
    "order of mixed packets",
];

/// A beam that the host is to cast: sensor × directions + direction.
pub(super) type Left = u32;

impl PacketCaster {
    /// Puts the beams of a chunk's sensors together and uploads how.
    pub(super) fn load(
        &mut self,
        device: &Device,
        poses: &[DevicePose],
        problem: &Problem,
    ) -> Result<(), BackendError> {
        let directions = problem.table().directions();
        self.plan = Plan::new(poses, problem);
        let plan = &self.plan;
        let mixed = Mixed::of(&plan.alone, poses, directions);
        self.slots.clear();
        mixed.iter().for_each(|part| self.slots.extend_from_slice(&part.slots));
        let groups = self.slots.len().div_ceil(RAYS * LANES) as u32;
        let rows = groups.div_ceil(MAX_WORKGROUPS).max(1);
        self.workgroups = [groups.div_ceil(rows), rows, 1];
        let mixed_packets = (groups.div_ceil(rows) * rows) as usize * LANES;
        self.slots.resize(mixed_packets * RAYS, NO_SLOT);
        let order = scattered(mixed_packets / LANES);

        let packets = plan.packets as usize * plan.blocks.len() * LANES;
        let bytes = [
            size_of_val(plan.blocks.as_slice()) as u64,
            size_of_val(plan.slots.as_slice()) as u64,
            size_of_val(plan.origins.as_slice()) as u64,
            (packets * size_of::<Marks>()) as u64,
            size_of_val(self.slots.as_slice()) as u64,
            self.slots.len() as u64 * Mixed::BEAM,
            (mixed_packets * size_of::<Marks>()) as u64,
            size_of_val(order.as_slice()) as u64,
        ];
        let held = self.buffers.iter().map(wgpu::Buffer::size);
        if self.buffers.is_empty() || held.zip(bytes).any(|(held, need)| held < need) {
            self.buffers.clear();
            let usage = wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::COPY_SRC;
            for (name, bytes) in NAMES.into_iter().zip(bytes) {
                self.buffers.push(device.buffer(name, bytes, usage)?);
            }
        }
        device.write(&self.buffers[BLOCKS], &plan.blocks);
        device.write(&self.buffers[SLOTS], &plan.slots);
        device.write(&self.buffers[ORIGINS], &plan.origins);
        device.write(&self.buffers[MIXED_ORDER], &order);
        device.write(&self.buffers[MIXED_SLOTS], &self.slots);
        let mut first = 0;
        for part in &mixed {
            device.write_at(&self.buffers[MIXED_BEAMS], first, &part.beams);
            first += part.beams.len() as u64;
        }
        Ok(())
    }

    /// Records the casting of the loaded chunk.
    pub(super) fn record(
        &self,
        device: &Device,
        kernels: &Kernels,
        encoder: &mut wgpu::CommandEncoder,
        chunk: &ChunkBuffers,
        directions: &wgpu::Buffer,
        tree: &wgpu::TextureView,
    ) {
        let plan = &self.plan;
        if plan.packets > 0 {
            let buffers = [
                &chunk.uniforms,
                &chunk.poses,
                directions,
                &self.buffers[BLOCKS],
                &self.buffers[SLOTS],
                &self.buffers[ORIGINS],
                &chunk.hits,
                &self.buffers[MARKS],
            ];
            let groups = [plan.packets, plan.blocks.len() as u32, 1];
            dispatch(device, encoder, kernels, "cast_packets", &buffers, Some(tree), groups);
        }
        if !self.slots.is_empty() {
            let buffers = [
                &chunk.uniforms,
                &self.buffers[MIXED_ORDER],
                &self.buffers[MIXED_SLOTS],
                &self.buffers[MIXED_BEAMS],
                &chunk.hits,
                &self.buffers[MIXED_MARKS],
            ];
            let groups = self.workgroups;
            dispatch(device, encoder, kernels, "cast_mixed", &buffers, Some(tree), groups);
        }
    }

    /// Hits of each sensor in the chunk that was cast, and the beams that are left to the host.
    pub(super) fn read(
        &self,
        device: &Device,
        sensors: usize,
        directions: usize,
    ) -> Result<(Vec<u32>, Vec<Left>), BackendError> {
        let mut hits = vec![0; sensors];
        let mut left = Vec::new();
        let plan = &self.plan;
        let marks = plan.packets as usize * plan.blocks.len() * LANES;
        let bytes = (marks * size_of::<Marks>()) as u64;
        let marks: Vec<Marks> = device.read("cast_packets", &self.buffers[MARKS], bytes)?;
        let groups = marks.par_chunks(LANES).enumerate().map(|(group, marks)| {
            let [first, block] = plan.blocks[group / plan.packets as usize].map(|at| at as usize);
            let first = 4 * first + group % plan.packets as usize * RAYS;
            let valid = LANES.min(directions - block * LANES);
            let mut counts = [0; RAYS];
            let mut left = Vec::new();
            for (lane, mark) in marks[..valid].iter().enumerate() {
                for (counts, word) in counts.chunks_mut(32).zip(mark) {
                    for (bit, count) in counts.iter_mut().enumerate() {
                        *count += word >> bit & 1;
                    }
                }
                each_bit(&mark[2..], |slot| {
                    let row = plan.slots[first + slot] as usize * directions;
                    left.push((row + block * LANES + lane) as Left);
                });
            }
            (first, counts, left)
        });
        for (first, counts, mut some) in groups.collect::<Vec<_>>() {
            let slots = plan.slots[first..first + RAYS].iter().zip(counts);
            for (&sensor, count) in slots.filter(|(sensor, _)| **sensor != NO_SLOT) {
                hits[sensor as usize] += count;
            }
            left.append(&mut some);
        }
        let bytes = (self.slots.len() / RAYS * size_of::<Marks>()) as u64;
        let marks: Vec<Marks> = device.read("cast_mixed", &self.buffers[MIXED_MARKS], bytes)?;
        for (mark, slots) in marks.iter().zip(self.slots.chunks(RAYS)) {
            if slots[0] != NO_SLOT {
                each_bit(&mark[..2], |slot| hits[slots[slot] as usize / directions] += 1);
                each_bit(&mark[2..], |slot| left.push(slots[slot]));
            }
        }
        Ok((hits, left))
    }
}

/// Numbers of the bits that are set.
fn each_bit(words: &[u32], mut take: impl FnMut(usize)) {
    for (word, &bits) in words.iter().enumerate() {
        let mut bits = bits;
        while bits != 0 {
            take(32 * word + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}
