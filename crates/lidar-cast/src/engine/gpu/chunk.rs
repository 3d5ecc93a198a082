//! A batch of placements, the part of it that lies on the device at once, and the buffers there.
//!
//! Buffers of a task are made once, a chunk's again where a chunk is larger.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use rayon::prelude::*;

use super::device::{Device, WORK, readable};
use super::layout::{GpuInstance, ITEMS_PER_WORKGROUP, LONG_AXIS, PARTIAL_WORDS, Sensor, Uniforms};
use crate::bvh::{Bvh, Bvh4, Hit, QuantizedNode, Triangle};
use crate::cast::SightSphere;
use crate::cover::BitOrder;
use crate::engine::{self, Result};
use crate::geom::Pose;
use crate::grid::Roi;
use crate::sensor::{Placement, UnknownSensor};
use crate::task::{Content, DevicePose, Frame, OccupiedVoxel, SensorBatch, Task};

/// Sensors whose instances a thread looks for at once.
const SENSORS_AT_ONCE: usize = 64;

/// Placements in chunks, and the frames that they are evaluated in.
pub(super) struct GpuBatch<'a> {
    pub(super) placements: &'a [Placement],
    pub(super) chunks: Vec<engine::Chunk>,
    pub(super) frames: &'a [usize],
    /// Metres; none: each sensor model's own.
    pub(super) range: Option<f32>,
    /// True: run the reductions. False: read the bitmaps back.
    pub(super) sums: bool,
}

/// Placements that lie on the device together.
pub(super) struct GpuChunk<'a> {
    /// Where they stand in the batch.
    pub(super) cut: engine::Chunk,
    pub(super) batch: SensorBatch<'a>,
    /// First sensor in the chunk and number of sensors, by placement.
    pub(super) placements: Vec<[u32; 2]>,
}

pub(super) struct ChunkSensors {
    pub(super) ego_from_sensors: Vec<Pose>,
    /// Poses in the grid of voxels.
    pub(super) poses: Vec<DevicePose>,
    /// Sensors whose beams the host covers.
    pub(super) covered_by_host: Vec<usize>,
}

impl<'a> GpuChunk<'a> {
    /// The chunk of a batch.
    pub(super) fn new(
        task: &'a Task,
        batch: &GpuBatch<'_>,
        cut: &engine::Chunk,
    ) -> Result<Self, UnknownSensor> {
        let placements = &batch.placements[cut.placements.clone()];
        let lidars = placements.iter().flat_map(|p| &p.lidars);
        let of_chunk = SensorBatch::new(task, lidars, batch.range)?;
        let mut first = 0;
        let sensors_of = |placement: &Placement| {
            let sensors = [first, placement.lidars.len() as u32];
            first += sensors[1];
            sensors
        };
        let placements = placements.iter().map(sensors_of).collect();
        Ok(Self { cut: cut.clone(), batch: of_chunk, placements })
    }

    /// Where the sensors stand in a frame.
    pub(super) fn standing(&self, roi: &Roi, frame: usize) -> ChunkSensors {
        let ego_from_sensors = self.batch.ego_from_sensors(frame);
        let poses = self.batch.in_grid(&ego_from_sensors);
        let covered_by_host = (0..poses.len()).filter(|&s| !is_covered(&poses[s], roi)).collect();
        ChunkSensors { ego_from_sensors, poses, covered_by_host }
    }

    /// The instances of a frame within the range of each sensor, sensor after sensor, and the sensors; no
    /// instances without a frame. `roots` holds the root of each tree by its address, `first_directions`
    /// the first direction of each model.
    pub(super) fn sensors(
        &self,
        standing: &ChunkSensors,
        frame: Option<&Frame>,
        roots: &HashMap<usize, u32>,
        first_directions: &[u32],
    ) -> (Vec<GpuInstance>, Vec<Sensor>) {
        let in_reach = |index: usize| -> Vec<GpuInstance> {
            let (pose, range) = (&standing.ego_from_sensors[index], self.batch.range(index));
            let instances = frame.into_iter().flat_map(|frame| frame.instances());
            let seen = instances.filter_map(|instance| {
                let pose = instance.pose_of(pose);
                let sight = SightSphere::new(&pose, &instance.tree, range)?;
                let root = roots[&Arc::as_ptr(&instance.tree).addr()];
                Some(GpuInstance::new(&pose, &sight, &instance.tree, root, instance.first_prim))
            });
            seen.collect()
        };
        let by_sensor = (0..self.batch.len()).into_par_iter().with_min_len(SENSORS_AT_ONCE);
        let by_sensor: Vec<Vec<GpuInstance>> = by_sensor.map(in_reach).collect();
        let (mut all, mut sensors) = (Vec::new(), Vec::with_capacity(self.batch.len()));
        for (index, instances) in by_sensor.iter().enumerate() {
            let (first_instance, range) = (all.len() as u32, self.batch.range(index));
            all.extend_from_slice(instances);
            let beams = self.batch.beams_of(index);
            sensors.push(Sensor {
                first_instance,
                end_instance: all.len() as u32,
                first_direction: first_directions[self.batch.model(index)],
                direction_count: beams.len() as u32,
                first_beam: beams.start as u32,
                range,
                zero: 0,
                covered_by_host: standing.covered_by_host.contains(&index).into(),
            });
        }
        (all, sensors)
    }
}

/// Voxel edges in metres whose crossings are normal numbers for any beam in the grid: see the kernel.
const EDGES: RangeInclusive<f64> = 1.0 / (1_u64 << 60) as f64..=(1_u64 << 60) as f64;

/// True if `cover_voxels` may run for a sensor: it stands in the grid, no axis is long, and no voxel crossing overflows
/// or is denormal.
fn is_covered(pose: &DevicePose, roi: &Roi) -> bool {
    let mut axes = roi.shape().into_iter().zip(pose.in_grid);
    axes.all(|(n, p)| n < LONG_AXIS && (0.0..n as f32).contains(&p))
        && roi.voxel().iter().all(|edge| EDGES.contains(edge))
}

/// Bytes that a chunk needs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sizes {
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
    pub(super) trees: Trees,
    pub(super) occupied: wgpu::Buffer,
    pub(super) class_voxels: wgpu::Buffer,
    pub(super) class_runs: wgpu::Buffer,
    pub(super) class_run_count: u32,
}

impl SceneBuffers {
    pub(super) fn new(device: &Device, task: &Task) -> Result<Self> {
        let (mut directions, mut first_directions) = (Vec::new(), Vec::new());
        for model in task.sensors().models() {
            first_directions.push(directions.len() as u32);
            directions.extend(model.table.directions().iter().map(|&[x, y, z]| [x, y, z, 0.0]));
        }
        let content = in_bricks(task.content(), &BitOrder::bricks(task.roi()));
        let runs = class_runs(&content.class_starts);
        Ok(Self {
            directions: device.upload("beam directions", &directions)?,
            first_directions,
            trees: Trees::new(device, &task.world().trees())?,
            occupied: device.upload("occupied voxels", content.occupied())?,
            class_voxels: device.upload("voxels by class", &content.class_voxels)?,
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
    /// BVH nodes, tree after tree; see [`crate::bvh::Bvh4`].
    pub(super) nodes: wgpu::Buffer,
    pub(super) triangles: wgpu::Buffer,
    /// Number of each tree's root among the nodes, by the address of the tree.
    pub(super) roots: HashMap<usize, u32>,
}

impl Trees {
    /// Uploads trees, each of them once in the list.
    pub(super) fn new(device: &Device, trees: &[&Arc<Bvh>]) -> Result<Self> {
        let mut built: Vec<Bvh4> = trees.iter().map(|tree| Bvh4::new(tree)).collect();
        let of = |what, count: usize, each: usize| {
            let usage = readable(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST);
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
            device.queue.submit([]);
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
    ) -> Result<Self> {
        let (s, p) = (sensors as u64, placements as u64);
        let buffer = |what, bytes| device.buffer(what, bytes, WORK);
        let uniform = readable(wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
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
