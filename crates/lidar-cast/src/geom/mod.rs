//! Rigid transforms, boxes, outlines and triangle soups.
//!
//! Frame of every coordinate: ISO 8855 (x forward, y left, z up), right-handed, in metres; angles in
//! radians. Transforms are `f64`; triangles are `f32`, in the ego frame or in that of a rigid part whose
//! origin is near, so that world coordinates of any size have been rebased before they are rounded.

mod aabb;
mod outline;
mod pose;
mod soup;

pub use aabb::Aabb;
pub use outline::{crossing, turn};
pub use pose::Glide;
pub use pose::Pose;
pub use soup::TriangleSoup;
