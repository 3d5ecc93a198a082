use rayon::prelude::*;

use super::device::Device;
use super::kernels::{Kernels, dispatch};
use super::packets::{Fans, Plan};
use super::resources::ChunkBuffers;
use crate::backend::layout::{NO_SLOT, PACKET_FOURS, WORKGROUP_SIZE};
use crate::backend::{BackendError, DevicePose};

/// How closest hits are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Each beam goes down a binary tree: an invocation is a beam.
    Tree,
    /// Beams that lie close go down a tree of four children a node together: an invocation is a
    /// packet. A device whose lanes are those of a host's vector unit loads each lane's part of the
    /// tree one by one, and so for many beams at once.
    Packets,
}

/// Slots of a packet or fan.
const RAYS: usize = 4 * PACKET_FOURS as usize;

/// What an invocation says of its beams: which hit, and which are left to the host.
type Marks = [u32; 4];

/// Casts a chunk in packets; its buffers are kept from chunk to chunk.
pub(super) struct PacketCaster {
    fans: Fans,
    plan: Plan,
    buffers: Vec<wgpu::Buffer>,
}

/// Places of the buffers.
const BLOCKS: usize = 0;
const SLOTS: usize = 1;
const ORIGINS: usize = 2;
const ALONE: usize = 3;
const PACKET_MARKS: usize = 4;
const FAN_MARKS: usize = 5;
const NAMES: [&str; 6] = [
    "blocks of directions",
    "slots of packets",
    "origins of packets",
    "sensors of fans",
    "marks of packets",
    "marks of fans",
];

/// A beam that the host is to cast: sensor and direction.
pub(super) type Left = (u32, u32);

impl PacketCaster {
    pub(super) fn new(device: &Device, directions: &[[f32; 3]]) -> Result<Self, BackendError> {
        let fans = Fans::new(device, directions)?;
        Ok(Self { fans, plan: Plan::default(), buffers: Vec::new() })
    }

    /// Puts the beams of a chunk's sensors together and uploads how.
    pub(super) fn load(
        &mut self,
        device: &Device,
        poses: &[DevicePose],
        directions: &[[f32; 3]],
    ) -> Result<(), BackendError> {
        self.plan = Plan::new(poses, directions);
        let plan = &self.plan;
        let blocks = directions.len().div_ceil(WORKGROUP_SIZE as usize) as u64;
        let packets = u64::from(plan.packets) * blocks * u64::from(WORKGROUP_SIZE);
        let fans = (plan.alone.len() * self.fans.count()) as u64;
        let mark = size_of::<Marks>() as u64;
        let bytes = [
            size_of_val(plan.blocks.as_slice()) as u64,
            size_of_val(plan.slots.as_slice()) as u64,
            size_of_val(plan.origins.as_slice()) as u64,
            size_of_val(plan.alone.as_slice()) as u64,
            packets * mark,
            fans * mark,
        ];
        let held = self.buffers.iter().map(wgpu::Buffer::size).zip(bytes);
        if self.buffers.is_empty() || held.into_iter().any(|(held, need)| held < need) {
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
        device.write(&self.buffers[ALONE], &plan.alone);
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
                &self.buffers[PACKET_MARKS],
            ];
            let groups = [plan.packets, plan.blocks.len() as u32, 1];
            dispatch(device, encoder, &kernels.cast_packets, &buffers, Some(tree), groups);
        }
        if !plan.alone.is_empty() {
            let buffers = [
                &chunk.uniforms,
                &chunk.poses,
                &self.buffers[ALONE],
                &self.fans.slot_buffer,
                &self.fans.directions,
                &chunk.hits,
                &self.buffers[FAN_MARKS],
            ];
            let groups = (self.fans.count() as u32).div_ceil(WORKGROUP_SIZE);
            let groups = [groups, plan.alone.len() as u32, 1];
            dispatch(device, encoder, &kernels.cast_fans, &buffers, Some(tree), groups);
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
        let lanes = WORKGROUP_SIZE as usize;
        let marks = plan.packets as usize * plan.blocks.len() * lanes;
        let bytes = (marks * size_of::<Marks>()) as u64;
        let packets: Vec<Marks> =
            device.read("cast_packets", &self.buffers[PACKET_MARKS], bytes)?;
        let groups = packets.par_chunks(lanes).enumerate().map(|(group, marks)| {
            let block = group / plan.packets as usize;
            let first = 4 * plan.blocks[block] as usize + group % plan.packets as usize * RAYS;
            let valid = lanes.min(directions - block * lanes);
            let mut counts = [0; RAYS];
            let mut left = Vec::new();
            for (lane, mark) in marks[..valid].iter().enumerate() {
                count(mark, &mut counts);
                each_left(mark, |slot| {
                    left.push((plan.slots[first + slot], (block * lanes + lane) as u32));
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
        let bytes = (plan.alone.len() * self.fans.count() * size_of::<Marks>()) as u64;
        let fans: Vec<Marks> = device.read("cast_fans", &self.buffers[FAN_MARKS], bytes)?;
        for (&sensor, marks) in plan.alone.iter().zip(fans.chunks(self.fans.count().max(1))) {
            for (fan, mark) in marks.iter().enumerate() {
                hits[sensor as usize] += mark[0].count_ones() + mark[1].count_ones();
                each_left(mark, |slot| left.push((sensor, self.fans.slots[fan * RAYS + slot])));
            }
        }
        Ok((hits, left))
    }
}

/// Adds the hits of a packet, slot by slot.
fn count(mark: &Marks, counts: &mut [u32; RAYS]) {
    for (counts, word) in counts.chunks_mut(32).zip(mark) {
        for (bit, count) in counts.iter_mut().enumerate() {
            *count += word >> bit & 1;
        }
    }
}

fn each_left(mark: &Marks, mut take: impl FnMut(usize)) {
    for word in 0..2 {
        let mut bits = mark[2 + word];
        while bits != 0 {
            take(32 * word + bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}
