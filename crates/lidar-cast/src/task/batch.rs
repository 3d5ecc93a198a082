//! The sensors of a batch: their models, where each one's beams lie in it, and where they stand in a frame.
//!
//! Poses, beams and voxels are as every engine reads them, rounded to `f32` once.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::Task;
use crate::geom::Pose;
use crate::grid::Roi;
use crate::sensor::{BeamTable, SensorModel, SensorPose, UnknownSensor};

/// Sensors whose beams lie one sensor after the other.
pub struct SensorBatch<'a> {
    task: &'a Task,
    sensors: Vec<SensorPose>,
    models: Vec<usize>,
    /// Where the beams of each sensor begin, and the end.
    starts: Vec<usize>,
    range: Option<f32>,
}

impl<'a> SensorBatch<'a> {
    /// Beams of `range` metres, or of each model's own range.
    ///
    /// # Errors
    /// A sensor of a model that the vehicle does not have.
    pub fn new<'p>(
        task: &'a Task,
        sensors: impl IntoIterator<Item = &'p SensorPose>,
        range: Option<f32>,
    ) -> Result<Self, UnknownSensor> {
        let sensors: Vec<SensorPose> = sensors.into_iter().copied().collect();
        let models = sensors.iter().map(|sensor| task.sensors().number(sensor));
        let models: Vec<usize> = models.collect::<Result<_, _>>()?;
        let mut starts = vec![0];
        for &model in &models {
            let beams = task.sensors().table(model).directions().len();
            starts.push(starts[starts.len() - 1] + beams);
        }
        Ok(Self { task, sensors, models, starts, range })
    }

    /// Number of sensors.
    pub fn len(&self) -> usize {
        self.sensors.len()
    }

    /// True if there is no sensor.
    pub fn is_empty(&self) -> bool {
        self.sensors.is_empty()
    }

    /// Number of beams of all sensors.
    pub fn beams(&self) -> usize {
        self.starts[self.len()]
    }

    /// Range of a sensor's beams in the batch.
    pub fn beams_of(&self, sensor: usize) -> Range<usize> {
        self.starts[sensor]..self.starts[sensor + 1]
    }

    /// The sensor that a beam is of.
    pub fn sensor_of(&self, beam: usize) -> usize {
        self.starts.partition_point(|&start| start <= beam) - 1
    }

    /// Seed of random draws.
    pub fn seed(&self) -> u64 {
        self.task.sensors().seed()
    }

    /// Number of a sensor's model.
    pub fn model(&self, sensor: usize) -> usize {
        self.models[sensor]
    }

    /// Model of a sensor.
    pub fn sensor_model(&self, sensor: usize) -> &'a SensorModel {
        &self.task.sensors().models()[self.models[sensor]]
    }

    /// Beam table of a sensor.
    pub fn table(&self, sensor: usize) -> &'a BeamTable {
        self.task.sensors().table(self.models[sensor])
    }

    /// Range of a sensor's beams in metres.
    pub fn range(&self, sensor: usize) -> f32 {
        self.range.unwrap_or_else(|| self.table(sensor).range())
    }

    /// Sensor-to-ego transforms in a frame.
    pub fn ego_from_sensors(&self, frame: usize) -> Vec<Pose> {
        let (sensors, number) = (self.task.sensors(), self.task.number_of(frame));
        let pose = |(&model, pose)| sensors.ego_from_sensor(model, pose, number);
        self.models.iter().zip(&self.sensors).map(pose).collect()
    }

    /// Converts sensor-to-ego poses to `f32` device poses with their places in the voxel grid.
    pub fn in_grid(&self, ego_from_sensors: &[Pose]) -> Vec<DevicePose> {
        let roi = self.task.roi();
        ego_from_sensors.iter().map(|pose| DevicePose::new(pose, roi)).collect()
    }
}

/// Metres by which a hit is pushed along the beam before its voxel is looked up.
pub const HIT_PUSH: f32 = crate::grid::HIT_PUSH as f32;
/// Direction components smaller than this count as zero: below a micrometre in a kilometre.
pub const TINY_COMPONENT: f32 = 1e-9;
/// Stands for 1/0 in planes a beam never reaches; finite, as shaders may assume.
pub const NO_CROSSING: f32 = 1e20;
/// Grid coordinates closer to zero than this are zero, so that `NO_CROSSING` keeps its meaning.
const TINY_COORDINATE: f64 = 1e-12;
/// Grid coordinates stay convertible to `i32`.
const MAX_COORDINATE: f64 = 1e9;
/// One sensor as the kernels read it, 64 bytes: in the ego frame, or in an instance's frame.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct DevicePose {
    /// Rows of the rotation that turns sensor coordinates, each followed by that coordinate of the position (m).
    pub rows: [[f32; 4]; 3],
    /// Position in voxels from the grid's lower corner, and zero; zeros in the frame of an instance.
    pub in_grid: [f32; 4],
}

impl DevicePose {
    /// Rounds each number of a sensor-to-ego transform once.
    pub fn new(pose: &Pose, roi: &Roi) -> Self {
        let (min, voxel) = (roi.min(), roi.voxel());
        let p = [0, 1, 2].map(|k| {
            let p = (pose.translation[k] - min[k]) / voxel[k];
            let p = if p.abs() < TINY_COORDINATE { 0.0 } else { p };
            p.clamp(-MAX_COORDINATE, MAX_COORDINATE) as f32
        });
        Self { in_grid: [p[0], p[1], p[2], 0.0], ..Self::from(pose) }
    }
}

impl From<&Pose> for DevicePose {
    /// Rounds each number once; the sensor is in no grid.
    fn from(Pose { rotation, translation }: &Pose) -> Self {
        let rows = [0, 1, 2].map(|k| {
            let row = rotation.row(k);
            [row.x as f32, row.y as f32, row.z as f32, translation[k] as f32]
        });
        Self { rows, in_grid: [0.0; 4] }
    }
}

/// Ways in which the information of a voxel is counted: the variants of [`Entropy`].
pub const KINDS: usize = 4;

/// Levels of repeated coverage that a tally counts: voxels that at least two, and at least three, LiDARs cover.
pub const REPEATS: usize = 2;

/// Way in which the information of a voxel is counted: the order of every list of [`KINDS`] sums.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Entropy {
    /// All classes told apart.
    Classes,
    /// Detection target against the rest.
    Detection,
    /// Occupied or not.
    Occupancy,
    /// Share that counts for more near the vehicle, for the near gain.
    Near,
}

impl Entropy {
    /// The sum of this kind.
    pub fn of<T: Copy>(self, sums: &[T; KINDS]) -> T {
        sums[self as usize]
    }
}

/// One voxel that is occupied in some frame, 20 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
pub struct OccupiedVoxel {
    /// Linear index in the grid.
    pub index: u32,
    /// Fixed-point information by [`Entropy`]: nats, and of the last kind shares of all in a unit of the content's own.
    pub entropy: [u32; KINDS],
}

/// Direction of a beam in the ego frame: the table's direction turned by the pose.
///
/// Products are added from left to right, as the shader does; components that move a beam by less
/// than a micrometre in a kilometre become zero, so that a level beam stays level.
pub fn beam_direction(pose: &DevicePose, direction: [f32; 3]) -> Vec3 {
    let [x, y, z] = direction;
    Vec3::from(pose.rows.map(|row| {
        let d = row[0] * x + row[1] * y + row[2] * z;
        if d.abs() < TINY_COMPONENT { 0.0 } else { d }
    }))
}

/// Position of the sensor in metres.
pub fn beam_origin(pose: &DevicePose) -> Vec3 {
    Vec3::from(pose.rows.map(|row| row[3]))
}
