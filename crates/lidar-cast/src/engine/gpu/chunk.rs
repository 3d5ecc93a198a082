//! A batch of placements, and a part of it that lies on the device at once.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use super::layout::{GpuInstance, LONG_AXIS, Sensor};
use crate::cast::SightSphere;
use crate::engine;
use crate::geom::Pose;
use crate::grid::Roi;
use crate::sensor::{Placement, UnknownSensor};
use crate::task::{DevicePose, Frame, SensorBatch, Task};

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

/// The sensors of a chunk in a frame.
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
        let (mut all, mut sensors) = (Vec::new(), Vec::with_capacity(self.batch.len()));
        for (index, ego_from_sensor) in standing.ego_from_sensors.iter().enumerate() {
            let (first_instance, range) = (all.len() as u32, self.batch.range(index));
            let instances = frame.into_iter().flat_map(|frame| frame.instances());
            all.extend(instances.filter_map(|instance| {
                let pose = instance.pose_of(ego_from_sensor);
                let sight = SightSphere::new(&pose, &instance.tree, range)?;
                let root = roots[&Arc::as_ptr(&instance.tree).addr()];
                Some(GpuInstance::new(&pose, &sight, &instance.tree, root, instance.first_prim))
            }));
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
