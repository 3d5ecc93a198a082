//! The engine of the plain reference functions.

use std::sync::Arc;
use std::time::Instant;

use super::{Backend, BackendError, check_frame, ego_from};
use crate::bvh::Hit;
use crate::cast::cast_frame_closest;
use crate::cover::{BitOrder, Bitmaps, cover_voxels};
use crate::problem::{DevicePose, Problem, StageTimes, Tally};
use crate::reduce::reduce;
use crate::vehicle::{Placement, SensorPose};

/// The CPU reference as a backend: the plain functions, one placement at a time.
///
/// [`super::CpuBackend`] and the GPU give the same bits sooner and are compared with these.
pub struct ReferenceBackend {
    problem: Arc<Problem>,
    times: StageTimes,
}

impl ReferenceBackend {
    /// The reference of a problem.
    pub fn new(problem: Arc<Problem>) -> Self {
        Self { problem, times: StageTimes::default() }
    }

    fn cast(&mut self, sensors: &[SensorPose], frame: usize, range: f32) -> Option<Vec<Hit>> {
        let start = Instant::now();
        let frame = self.problem.ends(frame)?;
        let hits = cast_frame_closest(&ego_from(sensors), self.problem.table(), frame, range);
        self.times.cast += start.elapsed();
        Some(hits)
    }

    fn cover(&mut self, poses: &[DevicePose], hits: Option<&[Hit]>, range: f32) -> Vec<u64> {
        let start = Instant::now();
        let mut bitmaps = Vec::new();
        let problem = &*self.problem;
        cover_voxels(poses, problem.table(), problem.roi(), hits, range, &mut bitmaps);
        self.times.cover += start.elapsed();
        bitmaps
    }

    fn poses(&self, poses: &[SensorPose]) -> Vec<DevicePose> {
        poses.iter().map(|pose| DevicePose::new(pose, self.problem.roi())).collect()
    }
}

impl Backend for ReferenceBackend {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn adapter(&self) -> &str {
        "CPU reference, plain functions"
    }

    fn tally(&mut self, placements: &[Placement], range: f32) -> Result<Vec<Tally>, BackendError> {
        let classes = self.problem.content().classes().len();
        let mut tallies = Vec::with_capacity(placements.len());
        for placement in placements {
            let poses = self.poses(&placement.lidars);
            let mut tally = Tally::zero(classes, poses.len());
            for frame in 0..self.problem.frame_count() {
                let hits = self.cast(&placement.lidars, frame, range);
                let bitmaps = self.cover(&poses, hits.as_deref(), range);
                let start = Instant::now();
                let one = std::slice::from_ref(placement);
                let directions = self.problem.table().directions().len();
                let content = self.problem.content();
                tally += &reduce(one, content, &bitmaps, hits.as_deref(), directions)[0];
                self.times.reduce += start.elapsed();
            }
            tallies.push(tally);
        }
        Ok(tallies)
    }

    fn hits(&mut self, poses: &[SensorPose], frame: usize) -> Result<Vec<Hit>, BackendError> {
        let frames = self.problem.geometry_frame_count();
        let frame = self.problem.geometry(frame).ok_or(BackendError::NoFrame { frame, frames })?;
        let table = self.problem.table();
        Ok(cast_frame_closest(&ego_from(poses), table, frame, table.range()))
    }

    fn bitmaps(&mut self, poses: &[SensorPose], frame: usize) -> Result<Bitmaps, BackendError> {
        check_frame(&self.problem, frame)?;
        let range = self.problem.table().range();
        let hits = self.cast(poses, frame, range);
        let poses = self.poses(poses);
        let words = self.cover(&poses, hits.as_deref(), range);
        Ok(Bitmaps { order: BitOrder::linear(self.problem.roi()), words })
    }

    fn times(&self) -> StageTimes {
        self.times
    }
}
