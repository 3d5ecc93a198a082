//! Buffers on the device: a task's are made once, a chunk's again where a chunk is larger.

use std::collections::HashMap;
use std::sync::Arc;

use super::device::Device;
use super::layout::{GpuInstance, ITEMS_PER_WORKGROUP, PARTIAL_WORDS, Sensor, Uniforms};
use crate::bvh::{Bvh, Bvh4, Hit, QuantizedNode, Triangle};
use crate::cover::BitOrder;
use crate::engine::BackendError;
use crate::task::{Content, DevicePose, OccupiedVoxel, Task};

/// Bytes that a chunk needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
    /// One bitmap.
    pub(super) bitmap: u64,
    /// Hits of one sensor of the model with most beams.
    pub(super) hits: u64,
    /// Instances of one sensor, all of the frame that has most.
    pub(super) instances: u64,
    /// Partial sums of one placement.
    pub(super) partials: u64,
    /// Totals of one placement: covered voxels, then covered voxels by class.
    pub(super) totals: u64,
}

impl Sizes {
    pub(super) fn of(task: &Task) -> Self {
        let directions = task.sensors().most_beams() as u64;
        let has_geometry = task.geometry_frame_count() > 0;
        let instances = task.world().frames().iter().map(|frame| frame.instances().len());
        let instances = instances.max().unwrap_or(0).max(1) * size_of::<GpuInstance>();
        Self {
            bitmap: 4 * u64::from(bitmap_words(task)),
            hits: if has_geometry { size_of::<Hit>() as u64 * directions } else { 0 },
            instances: instances as u64,
            partials: 4 * u64::from(occupied_workgroups(task) * PARTIAL_WORDS),
            totals: 4 * (1 + task.content().set_count() as u64),
        }
    }
}

/// 32-bit words of a bitmap, a brick each: an even number, two a word of [`BitOrder::bricks`].
pub(super) fn bitmap_words(task: &Task) -> u32 {
    2 * BitOrder::bricks(task.roi()).words() as u32
}

/// Workgroups of `reduce_occupied` for one placement.
pub(super) fn occupied_workgroups(task: &Task) -> u32 {
    (task.content().occupied().len() as u32).div_ceil(ITEMS_PER_WORKGROUP)
}

/// The task on the device.
pub(super) struct SceneBuffers {
    /// Beam directions of all sensor models, model after model.
    pub(super) directions: wgpu::Buffer,
    /// First direction of each model.
    pub(super) first_directions: Vec<u32>,
    /// BVH nodes of all trees, tree after tree; see [`crate::bvh::Bvh4`].
    pub(super) nodes: wgpu::Buffer,
    pub(super) triangles: wgpu::Buffer,
    /// Number of each tree's root among the nodes, by the address of the tree.
    pub(super) roots: HashMap<usize, u32>,
    pub(super) occupied: wgpu::Buffer,
    pub(super) class_voxels: wgpu::Buffer,
    pub(super) class_runs: wgpu::Buffer,
    pub(super) class_run_count: u32,
}

impl SceneBuffers {
    pub(super) fn new(device: &Device, task: &Task) -> Result<Self, BackendError> {
        let (mut directions, mut first_directions) = (Vec::new(), Vec::new());
        for model in task.sensors().models() {
            first_directions.push(directions.len() as u32);
            directions.extend(model.table.directions().iter().map(|&[x, y, z]| [x, y, z, 0.0]));
        }
        let content = in_bricks(task.content(), &BitOrder::bricks(task.roi()));
        let runs = class_runs(content.class_starts());
        let Trees { nodes, triangles, roots } = Trees::new(device, &task.world().trees())?;
        Ok(Self {
            directions: device.upload("beam directions", &directions)?,
            first_directions,
            nodes,
            triangles,
            roots,
            occupied: device.upload("occupied voxels", content.occupied())?,
            class_voxels: device.upload("voxels by class", content.class_voxels())?,
            class_runs: device.upload("class runs", &runs)?,
            class_run_count: runs.len() as u32,
        })
    }
}

/// Content with brick-order bit numbers in place of linear voxel indices, sorted.
fn in_bricks(content: &Content, order: &BitOrder) -> Content {
    let moved =
        |voxel: &OccupiedVoxel| OccupiedVoxel { index: order.bit_of(voxel.index), ..*voxel };
    let mut occupied: Vec<OccupiedVoxel> = content.occupied().iter().map(moved).collect();
    occupied.sort_unstable_by_key(|voxel| voxel.index);
    let of_class = |class: usize| {
        let voxels = content.voxels_of_class(class).iter();
        let mut bits: Vec<u32> = voxels.map(|&voxel| order.bit_of(voxel)).collect();
        bits.sort_unstable();
        bits
    };
    let by_class: Vec<Vec<u32>> = (0..content.set_count()).map(of_class).collect();
    let classes = content.classes().to_vec();
    Content::new(classes, occupied, &by_class, content.has_detection())
}

/// Trees on the device, one behind the other.
pub(super) struct Trees {
    pub(super) nodes: wgpu::Buffer,
    pub(super) triangles: wgpu::Buffer,
    /// Number of each tree's root among the nodes, by the address of the tree.
    pub(super) roots: HashMap<usize, u32>,
}

impl Trees {
    /// Uploads trees, each of them once in the list.
    pub(super) fn new(device: &Device, trees: &[&Arc<Bvh>]) -> Result<Self, BackendError> {
        let mut built: Vec<Bvh4> = trees.iter().map(|tree| Bvh4::new(tree)).collect();
        let of = |what, count: usize, each: usize| {
            let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
            device.buffer(what, count as u64 * each as u64, usage)
        };
        let node_count = built.iter().map(|tree| tree.nodes.len()).sum();
        let nodes = of("trees", node_count, size_of::<QuantizedNode>())?;
        let triangle_count = trees.iter().map(|tree| tree.triangles.len()).sum();
        let triangles = of("triangles", triangle_count, size_of::<Triangle>())?;
        let mut roots = HashMap::new();
        let (mut first_node, mut first_triangle) = (0, 0);
        for (&tree, wide) in trees.iter().zip(&mut built) {
            wide.move_to(first_node, first_triangle);
            device.write_at(&nodes, u64::from(first_node), &wide.nodes);
            device.write_at(&triangles, u64::from(first_triangle), &tree.triangles);
            // Submits each tree alone: staging memory of several large ones would add up.
            device.queue().submit([]);
            roots.insert(Arc::as_ptr(tree).addr(), first_node);
            first_node += wide.nodes.len() as u32;
            first_triangle += tree.triangles.len() as u32;
        }
        Ok(Self { nodes, triangles, roots })
    }
}

/// Cuts each class's voxels into runs of one workgroup: [class, first, end, 0].
fn class_runs(starts: &[u32]) -> Vec<[u32; 4]> {
    let mut runs = Vec::new();
    for (class, ends) in starts.windows(2).enumerate() {
        for first in (ends[0]..ends[1]).step_by(ITEMS_PER_WORKGROUP as usize) {
            runs.push([class as u32, first, (first + ITEMS_PER_WORKGROUP).min(ends[1]), 0]);
        }
    }
    runs
}

/// Buffers of one chunk.
///
/// The device runs commands and writes one after the other, so the next chunk may be written while
/// commands of the last one wait: results were copied to other buffers before.
pub(super) struct WorkBuffers {
    sensors: usize,
    placements: usize,
    pub(super) uniforms: wgpu::Buffer,
    pub(super) poses: wgpu::Buffer,
    pub(super) hits: wgpu::Buffer,
    /// Instances in reach of each sensor, sensor after sensor.
    pub(super) instances: wgpu::Buffer,
    /// Beams of each sensor and where its instances are.
    pub(super) sensor_beams: wgpu::Buffer,
    /// Unfinished beams, then hits by sensor.
    pub(super) counters: wgpu::Buffer,
    pub(super) bitmaps: wgpu::Buffer,
    /// First sensor and number of sensors by placement.
    pub(super) placement_sensors: wgpu::Buffer,
    pub(super) totals: wgpu::Buffer,
    pub(super) partials: wgpu::Buffer,
}

impl WorkBuffers {
    /// Buffers for `sensors` sensors and `placements` placements.
    pub(super) fn new(
        device: &Device,
        sizes: &Sizes,
        sensors: usize,
        placements: usize,
    ) -> Result<Self, BackendError> {
        let (s, p) = (sensors as u64, placements as u64);
        let usage = wgpu::BufferUsages::STORAGE
            | wgpu::BufferUsages::COPY_DST
            | wgpu::BufferUsages::COPY_SRC;
        let buffer = |what, bytes| device.buffer(what, bytes, usage);
        let uniform = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            sensors,
            placements,
            uniforms: device.buffer("uniforms", size_of::<Uniforms>() as u64, uniform)?,
            poses: buffer("poses", s * size_of::<DevicePose>() as u64)?,
            hits: buffer("hits", s * sizes.hits)?,
            instances: buffer("instances", s * sizes.instances)?,
            sensor_beams: buffer("sensors", s * size_of::<Sensor>() as u64)?,
            counters: buffer("hit counters", 4 * (1 + s))?,
            bitmaps: buffer("coverage bitmaps", s * sizes.bitmap)?,
            placement_sensors: buffer("placements", 8 * p)?,
            totals: buffer("totals", p * sizes.totals)?,
            partials: buffer("partial sums", p * sizes.partials)?,
        })
    }

    /// True if the buffers hold a chunk of `sensors` sensors and `placements` placements.
    pub(super) fn hold(&self, sensors: usize, placements: usize) -> bool {
        sensors <= self.sensors && placements <= self.placements
    }
}
