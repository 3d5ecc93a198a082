//! The world in two levels: one tree for each rigid thing, and frames that say where each stands.
//!
//! A tree lies in the frame of its thing and is built once. A frame lists instances: a tree, the pose
//! that takes it to the ego frame, and the number of its first triangle. To cast a sensor's beams into
//! an instance, instance_from_sensor = ego_from_instance⁻¹ ∘ ego_from_sensor is evaluated in `f64` and
//! rounded once to a [`DevicePose`], which takes the beams into the tree's frame. The closest hit over all
//! instances counts; ties go to the lowest triangle index of the frame.

use std::collections::HashSet;
use std::sync::Arc;

use glam::DVec3;

use super::DevicePose;
use crate::bvh::Bvh;
use crate::geom::Pose;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::TriangleSoup;
    use glam::DVec3;

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
