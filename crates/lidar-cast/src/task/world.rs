//! The world in two levels: one tree for each rigid thing, and frames that say where each stands.
//!
//! A tree lies in the frame of its thing and is built once. A frame lists instances: a tree, the pose
//! that takes it to the ego frame, and the number of its first triangle. To cast a sensor's beams into
//! an instance, instance_from_sensor = ego_from_instance⁻¹ ∘ ego_from_sensor is evaluated in `f64` and
//! rounded once to a [`DevicePose`], which takes the beams into the tree's frame. The closest hit over all
//! instances counts; ties go to the lowest triangle index of the frame.

use std::collections::HashSet;
use std::ops::Range;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

use super::Task;
use crate::bvh::Bvh;
use crate::geom::Pose;
use crate::grid::Roi;
use crate::sensor::{BeamTable, SensorModel, SensorPose, UnknownSensor};

/// A rigid thing where it stands in a frame.
#[derive(Debug, Clone)]
pub struct Instance {
    /// Its triangles in its own frame.
    pub tree: Arc<Bvh>,
    /// Takes its frame to the ego frame.
    pub ego_from_instance: Pose,
    /// Number of its first triangle in the frame.
    pub first_prim: u32,
}

impl Instance {
    /// The pose by which a sensor's beams are cast into the tree.
    pub fn pose_of(&self, ego_from_sensor: &Pose) -> DevicePose {
        DevicePose::from(&self.pose_from(ego_from_sensor))
    }

    /// Sensor-to-tree pose in `f64`, before rounding.
    pub fn pose_from(&self, ego_from_sensor: &Pose) -> Pose {
        self.ego_from_instance.inverse().compose(ego_from_sensor)
    }
}

impl PartialEq for Instance {
    /// Trees are compared by pointer: an equal copy counts as different.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.tree, &other.tree)
            && (self.first_prim, self.ego_from_instance)
                == (other.first_prim, other.ego_from_instance)
    }
}

/// Rigid things that beams hit in one frame, in the order of their triangles.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Frame {
    instances: Vec<Instance>,
}

impl Frame {
    /// Instances by rising `first_prim`; those without triangles are left out.
    pub fn new(instances: impl IntoIterator<Item = Instance>) -> Self {
        let filled = |instance: &Instance| !instance.tree.triangles.is_empty();
        Self { instances: instances.into_iter().filter(filled).collect() }
    }

    /// Instances in the order of their triangles.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Corners of all triangles in the ego frame, metres.
    pub fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        self.instances.iter().flat_map(|instance| {
            let corners = instance.tree.triangles.iter().flat_map(|t| [t.a, t.b, t.c]);
            corners.map(|at| instance.ego_from_instance.apply(DVec3::from(at.map(f64::from))))
        })
    }

    /// Triangles of all instances.
    pub fn triangle_count(&self) -> u64 {
        self.instances.iter().map(|instance| instance.tree.triangles.len() as u64).sum()
    }
}

impl From<Arc<Bvh>> for Frame {
    /// A frame with one tree, in the ego frame.
    fn from(tree: Arc<Bvh>) -> Self {
        Self::new([Instance { tree, ego_from_instance: Pose::IDENTITY, first_prim: 0 }])
    }
}

/// The frames of a task; those in which the same things stand at the same places are equal.
#[derive(Debug, Clone, Default)]
pub struct World {
    frames: Vec<Arc<Frame>>,
    /// One for each frame, the first that is equal.
    first_equal: Vec<usize>,
}

impl World {
    /// Puts frames in a row.
    pub fn new(frames: Vec<Arc<Frame>>) -> Self {
        let mut distinct: Vec<(Vec<u64>, usize)> = Vec::with_capacity(frames.len());
        distinct.extend(frames.iter().map(|frame| key(frame)).zip(0..));
        distinct.sort();
        let mut first_equal = vec![0; frames.len()];
        for equal in distinct.chunk_by(|a, b| a.0 == b.0) {
            equal.iter().for_each(|&(_, frame)| first_equal[frame] = equal[0].1);
        }
        Self { frames, first_equal }
    }

    /// Some of the frames, with the same trees.
    ///
    /// # Panics
    /// A frame that does not exist.
    pub fn over(&self, frames: &[usize]) -> Self {
        Self::new(frames.iter().map(|&frame| self.frames[frame].clone()).collect())
    }

    /// Frames in their order.
    pub fn frames(&self) -> &[Arc<Frame>] {
        &self.frames
    }

    /// The first frame that is equal to `frame`.
    pub(super) fn first_equal(&self, frame: usize) -> usize {
        self.first_equal[frame]
    }

    /// Each tree once.
    pub fn trees(&self) -> Vec<&Arc<Bvh>> {
        let mut seen = HashSet::new();
        let all = self.frames.iter().flat_map(|frame| &frame.instances);
        let all = all.map(|instance| &instance.tree);
        all.filter(|tree| seen.insert(Arc::as_ptr(tree))).collect()
    }

    /// Bytes of the trees and of the lists of instances.
    pub(super) fn bytes(&self) -> u64 {
        let trees: u64 = self.trees().iter().map(|tree| tree.bytes()).sum();
        let own = self.frames.iter().enumerate().filter(|&(t, _)| self.first_equal[t] == t);
        trees + own.map(|(_, frame)| size_of_val(&frame.instances[..]) as u64).sum::<u64>()
    }
}

impl From<Vec<Arc<Bvh>>> for World {
    /// A tree a frame, in the ego frame.
    fn from(trees: Vec<Arc<Bvh>>) -> Self {
        Self::new(trees.into_iter().map(|tree| Arc::new(Frame::from(tree))).collect())
    }
}

/// All that a frame is: trees, numbers of triangles and the bits of poses.
fn key(frame: &Frame) -> Vec<u64> {
    let mut key = Vec::with_capacity(14 * frame.instances.len());
    for Instance { tree, ego_from_instance: pose, first_prim } in &frame.instances {
        key.extend([Arc::as_ptr(tree) as u64, u64::from(*first_prim)]);
        // 0 and −0 are the same place.
        let numbers = pose.rotation.to_cols_array().into_iter().chain(pose.translation.to_array());
        key.extend(numbers.map(|number| (number + 0.0).to_bits()));
    }
    key
}

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
    #[cfg(feature = "gpu")]
    pub(crate) fn sensor_of(&self, beam: usize) -> usize {
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
pub(crate) const TINY_COMPONENT: f32 = 1e-9;
/// Stands for 1/0 in planes a beam never reaches; finite, as shaders may assume.
pub(crate) const NO_CROSSING: f32 = 1e20;
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

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::geom::TriangleSoup;

    fn tree() -> Arc<Bvh> {
        let soup = TriangleSoup {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            faces: vec![[0, 1, 2]],
            face_class: vec![0],
        };
        Arc::new(Bvh::build(&soup, 10.0))
    }

    #[test]
    fn frames_are_equal_where_the_same_things_stand_at_the_same_places() {
        let (tree, other) = (tree(), tree());
        let at = |tree: &Arc<Bvh>, x: f64| {
            let ego_from_instance = Pose::new(DVec3::X * x, 0.0, 0.0, 0.0);
            let instance = Instance { tree: tree.clone(), ego_from_instance, first_prim: 0 };
            Arc::new(Frame::new([instance]))
        };
        let frames = vec![
            at(&tree, 1.0),
            at(&other, 1.0),
            at(&tree, 2.0),
            at(&tree, 1.0),
            at(&tree, 0.0),
            at(&tree, -0.0),
        ];
        let world = World::new(frames);
        assert_eq!(world.first_equal, [0, 1, 2, 0, 4, 4]);
        assert_eq!(world.over(&[3, 2, 0]).first_equal, [0, 1, 0]);
        assert_eq!(world.trees().len(), 2);
        assert!(world.bytes() >= 2 * tree.bytes());
    }

    #[test]
    fn things_without_triangles_are_no_instances() {
        let empty = Arc::new(Bvh::build(&TriangleSoup::default(), 10.0));
        let world = World::from(vec![empty]);
        assert_eq!((world.frames().len(), world.trees().len()), (1, 0));
        assert!(world.frames()[0].instances().is_empty());
    }
}
