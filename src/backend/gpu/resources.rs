use std::ops::Range;

use super::bricks::Bricks;
use super::casting::Casting;
use super::device::Device;
use crate::backend::layout::{ITEMS_PER_WORKGROUP, PARTIAL_WORDS, STEP_BUDGET, TREE_ROW, Uniforms};
use crate::backend::{BackendError, ChunkLimits, DevicePose, Problem, split};
use crate::bvh::{Bvh, Hit, Quads, QuantizedNode};

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
            Casting::Packets => {
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
    /// Entries that a traversal stack needs for every frame's tree.
    pub(super) stack: usize,
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
            stack,
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

/// Placements of a chunk whose bitmaps are made at a time.
pub(super) struct Slice {
    pub(super) placements: Range<usize>,
    pub(super) first_sensor: u32,
    pub(super) sensors: u32,
    /// Whether all beams go from brick to brick, or some voxel by voxel.
    pub(super) in_bricks: bool,
}

/// Work buffers of one chunk.
pub(super) struct ChunkBuffers {
    capacity: [usize; 3],
    pub(super) slices: Vec<Slice>,
    pub(super) sensors: u32,
    pub(super) placements: Vec<[u32; 2]>,
    pub(super) uniforms: wgpu::Buffer,
    pub(super) poses: wgpu::Buffer,
    pub(super) hits: wgpu::Buffer,
    pub(super) counters: wgpu::Buffer,
    /// One for all slices in turn, two where a slice is read while the next is made.
    pub(super) bitmaps: Vec<wgpu::Buffer>,
    pub(super) walk_state: wgpu::Buffer,
    pub(super) placement_sensors: wgpu::Buffer,
    pub(super) totals: wgpu::Buffer,
    pub(super) partials: wgpu::Buffer,
}

impl ChunkBuffers {
    pub(super) fn new(
        device: &Device,
        sizes: &Sizes,
        sensors: usize,
        placements: usize,
        in_slice: usize,
    ) -> Result<Self, BackendError> {
        let (s, p) = (sensors as u64, placements as u64);
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let buffer = |what, bytes| device.buffer(what, bytes, usage);
        let mapped = if device.maps() { usage | wgpu::BufferUsages::MAP_READ } else { usage };
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            capacity: [sensors, placements, in_slice],
            slices: Vec::new(),
            sensors: 0,
            placements: Vec::new(),
            uniforms: device.buffer("uniforms", size_of::<Uniforms>() as u64, uniform)?,
            poses: buffer("poses", s * size_of::<DevicePose>() as u64)?,
            hits: buffer("hits", s * sizes.hits)?,
            counters: buffer("hit counters", 4 * (1 + s))?,
            bitmaps: (0..if in_slice < sensors { 2 } else { 1 })
                .map(|_| device.buffer("coverage bitmaps", in_slice as u64 * sizes.bitmap, mapped))
                .collect::<Result<_, BackendError>>()?,
            walk_state: buffer("walk states", s * sizes.walk_state)?,
            placement_sensors: buffer("placements", 8 * p)?,
            totals: buffer("totals", p * sizes.totals)?,
            partials: buffer("partial sums", p * sizes.partials)?,
        })
    }

    pub(super) fn holds(&self, sensors: usize, placements: usize, in_slice: usize) -> bool {
        let need = [sensors, placements, in_slice];
        // A slice that is mapped must not be the one that is made.
        let in_turn = in_slice >= sensors || self.bitmaps.len() > 1;
        in_turn && need.iter().zip(self.capacity).all(|(&need, held)| need <= held)
    }

    pub(super) fn load(
        &mut self,
        device: &Device,
        bricks: &Bricks,
        poses: &[DevicePose],
        lidars: impl Iterator<Item = u32>,
        in_slice: usize,
    ) {
        self.sensors = poses.len() as u32;
        self.placements = lidars
            .scan(0, |first, count| {
                let entry = [*first, count];
                *first += count;
                Some(entry)
            })
            .collect();
        let lidars: Vec<usize> = self.placements.iter().map(|[_, count]| *count as usize).collect();
        let limits = ChunkLimits { sensors: in_slice, placements: usize::MAX };
        self.slices = split(&lidars, limits)
            .into_iter()
            .map(|chunk| Slice {
                placements: chunk.placements,
                first_sensor: chunk.sensors.start as u32,
                sensors: chunk.sensors.len() as u32,
                in_bricks: poses[chunk.sensors].iter().all(|pose| bricks.lead_from(pose)),
            })
            .collect();
        device.write(&self.poses, poses);
        device.write(&self.placement_sensors, &self.placements);
    }
}
