use rayon::prelude::*;

use super::device::Device;
use super::kernels::Kernels;
use super::packets::{Mixed, Plan, RAYS, scattered};
use crate::engine::BackendError;
use crate::engine::gpu::layout::{MAX_WORKGROUPS, NO_SLOT, WORKGROUP_SIZE};
use crate::problem::{DevicePose, Problem};

/// How closest hits are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Casting {
    /// Each beam goes down a tree of quantized nodes: an invocation is a beam.
    Tree,
    /// Beams that lie close go down a tree of four children a node together: an invocation is a
    /// packet. A device whose lanes are those of a host's vector unit loads each lane's part of the
    /// tree one by one, and so for many beams at once.
    Packets,
    /// As packets, but a triangle is tested only for those beams of one direction that pass on the
    /// inner side of its edges, up to rounding.
    Sifted,
}

/// Triangles of a frame from which on sifting is faster: they are then smaller than a packet is wide.
/// Measured on lavapipe with the street scene of the benchmarks, 256 placements: with 200 000 triangles it
/// takes 1.25 of the time, with 400 000 and 800 000 as long, with 2 million 0.69.
const SIFTED_FROM: usize = 600_000;

impl Casting {
    /// The faster way on a device that is a program on the host, for frames of so many triangles.
    pub(super) fn on_software(triangles: usize) -> Self {
        if triangles < SIFTED_FROM { Self::Packets } else { Self::Sifted }
    }

    pub(super) fn is_in_packets(self) -> bool {
        self != Self::Tree
    }
}

/// Invocations of a workgroup.
const LANES: usize = WORKGROUP_SIZE as usize;

/// What an invocation says of its beams: which hit, and which are left to the host.
type Marks = [u32; 4];

/// A beam that the host is to cast: sensor × directions + direction.
pub(super) type Left = u32;

/// How the beams of a chunk are put together.
pub(super) struct Packing {
    plan: Plan,
    /// The beams of mixed packets, until they are uploaded.
    mixed: Vec<Mixed>,
    /// Where their hits go.
    slots: Vec<u32>,
    /// Which packets each workgroup casts.
    order: Vec<u32>,
    /// Dispatch of the mixed packets.
    workgroups: [u32; 3],
    directions: usize,
    sensors: usize,
}

impl Packing {
    pub(super) fn new(poses: &[DevicePose], problem: &Problem) -> Self {
        let directions = problem.table().directions();
        let plan = Plan::new(poses, problem);
        let mixed = Mixed::of(&plan.alone, poses, directions);
        let count = mixed.iter().map(|part| part.slots.len()).sum::<usize>();
        let groups = count.div_ceil(RAYS * LANES) as u32;
        let rows = groups.div_ceil(MAX_WORKGROUPS).max(1);
        let workgroups = [groups.div_ceil(rows), rows, 1];
        let packets = (groups.div_ceil(rows) * rows) as usize * LANES;
        let mut slots = Vec::with_capacity(packets * RAYS);
        mixed.iter().for_each(|part| slots.extend_from_slice(&part.slots));
        slots.resize(packets * RAYS, NO_SLOT);
        let order = scattered(packets / LANES);
        let (directions, sensors) = (directions.len(), poses.len());
        Self { plan, mixed, slots, order, workgroups, directions, sensors }
    }

    /// Kernels that cast them.
    pub(super) fn kernels(&self) -> impl Iterator<Item = &'static str> {
        let parallel = (self.plan.packets > 0).then_some("cast_packets");
        parallel.into_iter().chain((!self.slots.is_empty()).then_some("cast_mixed"))
    }

    /// Bytes of each buffer.
    fn bytes(&self) -> [u64; NAMES.len()] {
        let plan = &self.plan;
        let packets = plan.packets as usize * plan.blocks.len() * LANES;
        let mixed_packets = self.slots.len() / RAYS;
        [
            size_of_val(plan.blocks.as_slice()) as u64,
            size_of_val(plan.slots.as_slice()) as u64,
            size_of_val(plan.origins.as_slice()) as u64,
            (packets * size_of::<Marks>()) as u64,
            size_of_val(self.slots.as_slice()) as u64,
            self.slots.len() as u64 * Mixed::BEAM,
            (mixed_packets * size_of::<Marks>()) as u64,
            size_of_val(self.order.as_slice()) as u64,
        ]
    }

    /// Hits of each sensor, and the beams that are left to the host, from the marks of both kinds of
    /// packets.
    pub(super) fn read(&self, marks: &[u8], mixed: &[u8]) -> (Vec<u32>, Vec<Left>) {
        let mut hits = vec![0; self.sensors];
        let mut left = Vec::new();
        let (plan, directions) = (&self.plan, self.directions);
        let marks: &[Marks] = bytemuck::cast_slice(marks);
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
        let marks: &[Marks] = bytemuck::cast_slice(mixed);
        for (mark, slots) in marks.iter().zip(self.slots.chunks(RAYS)) {
            if slots[0] != NO_SLOT {
                each_bit(&mark[..2], |slot| hits[slots[slot] as usize / directions] += 1);
                each_bit(&mark[2..], |slot| left.push(slots[slot]));
            }
        }
        (hits, left)
    }
}

/// Device side of a [`Packing`]; the buffers are kept from chunk to chunk.
#[derive(Default)]
pub(super) struct PacketBuffers(Vec<wgpu::Buffer>);

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

impl PacketBuffers {
    pub(super) fn hold(&self, packing: &Packing) -> bool {
        let held = self.0.iter().map(wgpu::Buffer::size);
        !self.0.is_empty() && held.zip(packing.bytes()).all(|(held, need)| held >= need)
    }

    /// Makes room for a chunk's packets.
    pub(super) fn grow(&mut self, device: &Device, packing: &Packing) -> Result<(), BackendError> {
        // The old buffers go first, so that both never exist at once.
        self.0.clear();
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        for (name, bytes) in NAMES.into_iter().zip(packing.bytes()) {
            self.0.push(device.buffer(name, bytes, usage)?);
        }
        Ok(())
    }

    /// Uploads a chunk's packets; what only the device needs of them goes.
    pub(super) fn upload(&self, device: &Device, packing: &mut Packing) {
        let plan = &mut packing.plan;
        device.write(&self.0[BLOCKS], &plan.blocks);
        device.write(&self.0[SLOTS], &plan.slots);
        device.write(&self.0[ORIGINS], &std::mem::take(&mut plan.origins));
        device.write(&self.0[MIXED_ORDER], &packing.order);
        device.write(&self.0[MIXED_SLOTS], &packing.slots);
        let mut first = 0;
        for part in std::mem::take(&mut packing.mixed) {
            device.write_at(&self.0[MIXED_BEAMS], first, &part.beams);
            first += part.beams.len() as u64;
        }
    }

    /// Records the casting of the chunk that was uploaded.
    pub(super) fn record(
        &self,
        packing: &Packing,
        kernels: &Kernels,
        device: &Device,
        encoder: &mut wgpu::CommandEncoder,
        [uniforms, poses, directions, hits]: [&wgpu::Buffer; 4],
        tree: &wgpu::TextureView,
    ) {
        let plan = &packing.plan;
        if plan.packets > 0 {
            let [blocks, slots, origins] = [BLOCKS, SLOTS, ORIGINS].map(|place| &self.0[place]);
            let marks = &self.0[MARKS];
            let buffers = [uniforms, poses, directions, blocks, slots, origins, hits, marks];
            let groups = [plan.packets, plan.blocks.len() as u32, 1];
            kernels.dispatch(device, encoder, "cast_packets", &buffers, Some(tree), groups);
        }
        if !packing.slots.is_empty() {
            let [order, slots, beams] =
                [MIXED_ORDER, MIXED_SLOTS, MIXED_BEAMS].map(|place| &self.0[place]);
            let buffers = [uniforms, order, slots, beams, hits, &self.0[MIXED_MARKS]];
            let groups = packing.workgroups;
            kernels.dispatch(device, encoder, "cast_mixed", &buffers, Some(tree), groups);
        }
    }

    /// The marks of both kinds of packets, and their bytes.
    pub(super) fn marks(&self, packing: &Packing) -> [(&wgpu::Buffer, u64); 2] {
        let bytes = packing.bytes();
        [MARKS, MIXED_MARKS].map(|place| (&self.0[place], bytes[place]))
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
