//! Input of a walk: a tree, and the sensor's pose in the tree's frame.

use crate::bvh::Bvh;
use crate::task::DevicePose;

/// A tree, and the sensor's pose in its frame.
#[derive(Clone, Copy)]
pub struct Part<'a> {
    /// The tree.
    pub bvh: &'a Bvh,
    /// From the sensor's frame to the tree's.
    pub pose: DevicePose,
    /// Added to the index of each face.
    pub first_prim: u32,
}
