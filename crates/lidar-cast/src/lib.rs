//! Every beam of many LiDAR placements, cast into triangle scenes; the voxels that the beams cover; integer sums
//! over those voxels. On the CPU and on Vulkan devices, to the same bits.
//!
//! One direction of data flow, top to bottom; a module imports only those above it:
//!
//! | module | holds |
//! |---|---|
//! | [`maths`], [`memory`] | functions of one number, free memory |
//! | [`geom`] | rigid transforms, boxes, triangle soups |
//! | [`grid`] | the region of interest and its voxels |
//! | [`sensor`] | beam tables, sensor models, poses, placements |
//! | [`bvh`] | bounding volume hierarchies, flat and wide |
//! | [`task`] | frames, voxels and their worth, sensor models: fixed while placements vary |
//! | [`cast`] | closest hits of all beams |
//! | [`cover`] | voxels that beams cover |
//! | [`reduce`] | integer sums over covered voxels |
//! | [`engine`] | the three stages on the CPU and on a GPU behind one trait |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod bvh;
pub mod cast;
pub mod cover;
pub mod engine;
pub mod geom;
pub mod grid;
pub mod maths;
pub mod memory;
pub mod reduce;
pub mod sensor;
pub mod task;

/// Compiles the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
