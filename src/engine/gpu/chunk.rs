//! A batch of placements, and a part of it that lies on the device at once.

use std::collections::HashMap;
use std::sync::Arc;

use super::layout::{Instance, LONG_AXIS};
use crate::cast::Sight;
use crate::engine;
use crate::geom::Pose;
use crate::problem::{DevicePose, Frame, Problem};
use crate::psog::Roi;
use crate::vehicle::{Placement, SensorPose};

/// Placements in chunks, and the frames that they are evaluated in.
pub(super) struct Batch<'a> {
    pub(super) placements: &'a [Placement],
    pub(super) chunks: Vec<engine::Chunk>,
    pub(super) frames: &'a [usize],
    /// Metres.
    pub(super) range: f32,
    /// Whether the reductions run, or bitmaps are read.
    pub(super) sums: bool,
}

/// Placements that lie on the device together.
pub(super) struct Chunk {
    /// Where they stand in the batch.
    pub(super) cut: engine::Chunk,
    pub(super) poses: Vec<DevicePose>,
    /// The same in `f64`.
    pub(super) ego_from_sensors: Vec<Pose>,
    /// First sensor in the chunk and number of sensors, by placement.
    pub(super) sensors: Vec<[u32; 2]>,
    /// Sensors whose beams the host covers.
    pub(super) covered_by_host: Vec<usize>,
}

impl Chunk {
    /// The chunk of a batch.
    pub(super) fn new(problem: &Problem, batch: &[Placement], cut: &engine::Chunk) -> Self {
        let (roi, placements) = (problem.roi(), &batch[cut.placements.clone()]);
        let lidars = || placements.iter().flat_map(|p| &p.lidars);
        let poses: Vec<DevicePose> = lidars().map(|l| DevicePose::new(l, roi)).collect();
        let ego_from_sensors = lidars().map(SensorPose::ego_from_sensor).collect();
        let mut first = 0;
        let sensors_of = |placement: &Placement| {
            let sensors = [first, placement.lidars.len() as u32];
            first += sensors[1];
            sensors
        };
        let sensors = placements.iter().map(sensors_of).collect();
        let covered_by_host = (0..poses.len()).filter(|&s| !is_covered(&poses[s], roi)).collect();
        Self { cut: cut.clone(), poses, ego_from_sensors, sensors, covered_by_host }
    }

    /// The instances of a frame within `range` metres of each sensor, sensor after sensor, and the first
    /// and the end of those of each; `roots` holds the root of each tree by its address.
    pub(super) fn instances(
        &self,
        frame: &Frame,
        roots: &HashMap<usize, u32>,
        range: f32,
    ) -> (Vec<Instance>, Vec<[u32; 2]>) {
        let (mut all, mut spans) = (Vec::new(), Vec::with_capacity(self.poses.len()));
        for sensor in &self.ego_from_sensors {
            let first = all.len() as u32;
            all.extend(frame.instances().iter().filter_map(|instance| {
                let pose = instance.pose_of(sensor);
                let sight = Sight::new(&pose, &instance.tree, range)?;
                Some(Instance {
                    rows: pose.rows,
                    center: sight.center,
                    radius: sight.radius,
                    least_square: sight.least_square,
                    pad: instance.tree.pad,
                    root: roots[&Arc::as_ptr(&instance.tree).addr()],
                    first_prim: instance.first_prim,
                })
            }));
            spans.push([first, all.len() as u32]);
        }
        (all, spans)
    }
}

/// Whether `cover_voxels` covers the beams of a sensor: one in the grid, and no axis is long.
fn is_covered(pose: &DevicePose, roi: &Roi) -> bool {
    let mut axes = roi.shape().into_iter().zip(pose.in_grid);
    axes.all(|(n, p)| n < LONG_AXIS && (0.0..n as f32).contains(&p))
}
