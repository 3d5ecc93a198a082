use std::cell::Cell;

use super::bricks::Bricks;
use super::casting::{Casting, PacketBuffers};
use super::device::Device;
use super::kernels::Kernels;
use super::kernels::SceneConstants;
use super::prepared::Prepared;
use crate::bvh::{Bvh, Hit, Quads, QuantizedNode};
use crate::engine::BackendError;
use crate::engine::gpu::layout::{
    ITEMS_PER_WORKGROUP, PARTIAL_WORDS, STEP_BUDGET, TREE_ROW, Uniforms,
};
use crate::problem::{DevicePose, Problem};

/// Bytes that the buffers of a chunk need.
pub(super) struct Sizes {
    /// One bitmap.
    pub(super) bitmap: u64,
    /// Hits of one sensor.
    pub(super) hits: u64,
    /// Walk states of one sensor; 0 where every walk ends in one pass.
    walk_state: u64,
    /// Partial sums of one placement.
    pub(super) partials: u64,
    /// Totals of one placement.
    pub(super) totals: u64,
}

impl Sizes {
    pub(super) fn of(problem: &Problem) -> Self {
        let words = Bricks::new(problem.roi()).words();
        let directions = problem.table().directions().len() as u64;
        let groups = occupied_workgroups(problem);
        Self {
            bitmap: 4 * words,
            hits: if problem.geometry_frame_count() > 0 {
                size_of::<Hit>() as u64 * directions
            } else {
                0
            },
            walk_state: if walk_passes(problem) > 1 { 4 * directions } else { 0 },
            partials: 4 * u64::from(groups * PARTIAL_WORDS),
            totals: 4 * (1 + problem.content().classes().len() as u64),
        }
    }

    /// Bytes of one sensor beside its bitmap.
    pub(super) fn per_sensor(&self) -> u64 {
        self.hits + self.walk_state
    }
}

/// Passes that the longest walk through the grid needs: at most two loop steps a voxel.
pub(super) fn walk_passes(problem: &Problem) -> u32 {
    let steps: u64 = problem.roi().shape().iter().map(|&n| u64::from(n) + 1).sum();
    (2 * steps).div_ceil(u64::from(STEP_BUDGET)) as u32
}

pub(super) fn occupied_workgroups(problem: &Problem) -> u32 {
    (problem.content().occupied().len() as u32).div_ceil(ITEMS_PER_WORKGROUP)
}

/// A frame's tree on the device.
pub(super) enum FrameTree {
    /// For beams that are cast one by one; see [`QuantizedNode`].
    Quantized { nodes: wgpu::Buffer, triangles: wgpu::Buffer },
    /// For packets; see [`Quads`].
    Quads(wgpu::TextureView),
}

impl FrameTree {
    /// Uploads a tree; `stack` grows to the entries that a traversal of it needs.
    fn new(
        device: &Device,
        bvh: &Bvh,
        casting: Casting,
        stack: &mut usize,
    ) -> Result<Self, BackendError> {
        match casting {
            Casting::Tree => {
                let nodes = QuantizedNode::tree(bvh);
                *stack = QuantizedNode::stack(&nodes).max(*stack);
                let triangles = device.upload("triangles", &bvh.triangles)?;
                Ok(Self::Quantized { nodes: device.upload("tree", &nodes)?, triangles })
            }
            Casting::Packets | Casting::Sifted => {
                let texels = Quads::new(bvh).texels;
                Ok(Self::Quads(device.upload_texels("tree", texels, TREE_ROW)?))
            }
        }
    }
}

/// What does not change between batches.
pub(super) struct SceneBuffers {
    pub(super) directions: wgpu::Buffer,
    pub(super) frames: Vec<FrameTree>,
    pub(super) occupied: wgpu::Buffer,
    pub(super) class_voxels: wgpu::Buffer,
    pub(super) class_runs: wgpu::Buffer,
    pub(super) class_run_count: u32,
    /// What the kernels have to know of it.
    pub(super) constants: SceneConstants,
}

impl SceneBuffers {
    pub(super) fn new(
        device: &Device,
        problem: &Problem,
        casting: Casting,
    ) -> Result<Self, BackendError> {
        let directions: Vec<[f32; 4]> =
            problem.table().directions().iter().map(|&[x, y, z]| [x, y, z, 0.0]).collect();
        let frames = (0..problem.geometry_frame_count()).filter_map(|t| problem.geometry(t));
        let content = Bricks::new(problem.roi()).content(problem.content());
        let runs = class_runs(content.class_starts());
        let mut stack = 1;
        Ok(Self {
            directions: device.upload("beam directions", &directions)?,
            frames: frames
                .map(|bvh| FrameTree::new(device, bvh, casting, &mut stack))
                .collect::<Result<_, BackendError>>()?,
            occupied: device.upload("occupied voxels", content.occupied())?,
            class_voxels: device.upload("voxels by class", content.class_voxels())?,
            class_runs: device.upload("class runs", &runs)?,
            class_run_count: runs.len() as u32,
            constants: SceneConstants { stack, sifted: casting == Casting::Sifted },
        })
    }
}

/// Cuts each class's voxels into runs of one workgroup: (class, first, end, 0).
fn class_runs(starts: &[u32]) -> Vec<[u32; 4]> {
    let mut runs = Vec::new();
    for (class, ends) in starts.windows(2).enumerate() {
        let firsts = (ends[0]..ends[1]).step_by(ITEMS_PER_WORKGROUP as usize);
        runs.extend(
            firsts
                .map(|first| [class as u32, first, (first + ITEMS_PER_WORKGROUP).min(ends[1]), 0]),
        );
    }
    runs
}

/// What work buffers have room for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Room {
    pub(super) sensors: usize,
    pub(super) placements: usize,
    /// Sensors whose bitmaps are made at a time.
    pub(super) in_slice: usize,
    /// Whether the host reads bitmaps where they lie while the next are made.
    pub(super) in_turn: bool,
}

/// Work buffers of one chunk. The device runs what it is handed one after the other, so that one chunk's
/// may be written while another's commands wait: what the host reads of it was copied before.
pub(super) struct WorkBuffers {
    room: Room,
    pub(super) uniforms: wgpu::Buffer,
    /// What they hold.
    pub(super) written: Cell<Option<Uniforms>>,
    pub(super) poses: wgpu::Buffer,
    pub(super) hits: wgpu::Buffer,
    pub(super) counters: wgpu::Buffer,
    /// One for all slices in turn, two where a slice is read while the next is made.
    pub(super) bitmaps: Vec<wgpu::Buffer>,
    pub(super) walk_state: wgpu::Buffer,
    pub(super) placement_sensors: wgpu::Buffer,
    pub(super) totals: wgpu::Buffer,
    pub(super) partials: wgpu::Buffer,
    pub(super) packets: PacketBuffers,
}

impl WorkBuffers {
    /// The host reads bitmaps where they lie if it `sums` them and the device allows that.
    pub(super) fn new(
        device: &Device,
        sizes: &Sizes,
        room: Room,
        sums: bool,
    ) -> Result<Self, BackendError> {
        let Room { sensors, placements, in_slice, in_turn } = room;
        let (s, p) = (sensors as u64, placements as u64);
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let buffer = |what, bytes| device.buffer(what, bytes, usage);
        let mapped = sums && device.maps();
        let for_bitmaps = if mapped { usage | wgpu::BufferUsages::MAP_READ } else { usage };
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        let bitmaps = in_slice as u64 * sizes.bitmap;
        Ok(Self {
            room,
            uniforms: device.buffer("uniforms", size_of::<Uniforms>() as u64, uniform)?,
            written: Cell::new(None),
            poses: buffer("poses", s * size_of::<DevicePose>() as u64)?,
            hits: buffer("hits", s * sizes.hits)?,
            counters: buffer("hit counters", 4 * (1 + s))?,
            bitmaps: (0..if in_turn && mapped { 2 } else { 1 })
                .map(|_| device.buffer("coverage bitmaps", bitmaps, for_bitmaps))
                .collect::<Result<_, BackendError>>()?,
            walk_state: buffer("walk states", s * sizes.walk_state)?,
            placement_sensors: buffer("placements", 8 * p)?,
            totals: buffer("totals", p * sizes.totals)?,
            partials: buffer("partial sums", p * sizes.partials)?,
            packets: PacketBuffers::default(),
        })
    }

    pub(super) fn hold(&self, room: &Room) -> bool {
        let [need, held] = [room, &self.room].map(|r| [r.sensors, r.placements, r.in_slice]);
        self.room.in_turn >= room.in_turn && need.iter().zip(held).all(|(&need, held)| need <= held)
    }

    /// Uploads a chunk's packets, for all that is cast from now on.
    pub(super) fn upload_packets(
        &mut self,
        device: &Device,
        kernels: &Kernels,
        chunk: &mut Prepared,
    ) -> Result<(), BackendError> {
        if let Some(packing) = &mut chunk.packing {
            if !self.packets.hold(packing) {
                device.idle("casting")?;
                kernels.unbind();
                self.packets.grow(device, packing)?;
            }
            self.packets.upload(device, packing);
        }
        device.check("uploading packets")
    }

    /// Uploads the rest of a chunk, for all that is handed to the device from now on.
    pub(super) fn upload(&self, device: &Device, chunk: &Prepared) -> Result<(), BackendError> {
        device.write(&self.poses, &chunk.poses);
        device.write(&self.placement_sensors, &chunk.placements);
        device.check("uploading placements")
    }
}
