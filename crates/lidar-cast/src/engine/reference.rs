//! The engine of the plain reference functions.

use std::sync::Arc;
use std::time::Instant;

use super::{Backend, BackendError, Result, TakeBitmap, check_frame};
use crate::bvh::Hit;
use crate::cast::cast_frame_closest;
use crate::cover::{BitOrder, cover_voxels};
use crate::reduce::reduce;
use crate::sensor::{Placement, SensorPose};
use crate::task::{Frame, SensorBatch, StageTimes, Tally, Task};

/// The CPU reference as a backend: the plain functions, one placement at a time.
///
/// [`super::CpuBackend`] and the GPU give the same bits sooner and are compared with these.
pub struct ReferenceBackend {
    task: Arc<Task>,
    times: StageTimes,
}

impl ReferenceBackend {
    /// The reference of a task.
    pub fn new(task: Arc<Task>) -> Self {
        Self { task, times: StageTimes::default() }
    }

    /// Hits of a batch in a frame that ends beams; `None` in one that does not.
    fn cast(&mut self, batch: &SensorBatch<'_>, frame: usize) -> Option<Vec<Hit>> {
        let start = Instant::now();
        let geometry = self.task.ends(frame)?;
        let mut hits = cast(batch, frame, geometry);
        if let Some(air) = self.task.air() {
            let sensors = batch.ego_from_sensors(frame);
            air.dim(batch, &sensors, geometry, self.task.number_of(frame), &mut hits);
        }
        self.times.cast += start.elapsed();
        Some(hits)
    }

    fn cover(&mut self, batch: &SensorBatch<'_>, frame: usize, hits: Option<&[Hit]>) -> Vec<u64> {
        let start = Instant::now();
        let (roi, mut bitmaps) = (self.task.roi(), Vec::new());
        let poses = batch.in_grid(&batch.ego_from_sensors(frame));
        for (sensor, pose) in poses.iter().enumerate() {
            let hits = hits.map(|hits| &hits[batch.beams_of(sensor)]);
            let mut bitmap = Vec::new();
            let (table, range) = (batch.table(sensor), batch.range(sensor));
            cover_voxels(std::slice::from_ref(pose), table, roi, hits, range, &mut bitmap);
            bitmaps.append(&mut bitmap);
        }
        self.times.cover += start.elapsed();
        bitmaps
    }
}

/// Hits of a batch in a frame, beam by beam.
fn cast(batch: &SensorBatch<'_>, number: usize, frame: &Frame) -> Vec<Hit> {
    let sensors = batch.ego_from_sensors(number);
    let hits = sensors.iter().enumerate().flat_map(|(sensor, pose)| {
        let (table, range) = (batch.table(sensor), batch.range(sensor));
        cast_frame_closest(std::slice::from_ref(pose), table, frame, range)
    });
    hits.collect()
}

impl Backend for ReferenceBackend {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn adapter(&self) -> &str {
        "CPU reference, plain functions"
    }

    fn tally(&mut self, placements: &[Placement], range: Option<f32>) -> Result<Vec<Tally>> {
        let (task, mut tallies) = (self.task.clone(), Vec::with_capacity(placements.len()));
        for placement in placements {
            let batch = SensorBatch::new(&task, &placement.lidars, range)?;
            let mut tally = Tally::zero(task.content().set_count(), batch.len());
            for frame in 0..task.frame_count() {
                let hits = self.cast(&batch, frame);
                let bitmaps = self.cover(&batch, frame, hits.as_deref());
                let start = Instant::now();
                let mut sum = reduce(batch.len(), task.content(), &bitmaps);
                sum.beams = batch.beams() as u64;
                sum.hits = hits.iter().flatten().filter(|hit| hit.is_hit()).count() as u64;
                tally += &sum;
                self.times.reduce += start.elapsed();
            }
            tallies.push(tally);
        }
        Ok(tallies)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>> {
        let frames = self.task.geometry_frame_count();
        let ends = self.task.geometry(frame).ok_or(BackendError::NoFrame { frame, frames })?;
        Ok(cast(&SensorBatch::new(&self.task, poses, None)?, frame, ends))
    }

    fn order(&self) -> BitOrder {
        BitOrder::linear(self.task.roi())
    }

    fn each_bitmap(
        &mut self,
        poses: &[SensorPose],
        frame: usize,
        take: &TakeBitmap<'_>,
    ) -> Result<()> {
        check_frame(&self.task, frame)?;
        let task = self.task.clone();
        let batch = SensorBatch::new(&task, poses, None)?;
        let hits = self.cast(&batch, frame);
        let words = self.cover(&batch, frame, hits.as_deref());
        let order = self.order();
        let bitmaps = words.chunks(order.words().max(1)).enumerate();
        bitmaps.for_each(|(pose, bitmap)| take(pose, &order, bitmap));
        Ok(())
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}
