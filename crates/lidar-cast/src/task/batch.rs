//! The sensors of a batch: their models, where each one's beams lie in it, and where they stand in a frame.

use std::ops::Range;

use super::{DevicePose, Task};
use crate::geom::Pose;
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
