//! Constants and structures that the host shares with the shaders.
//!
//! Constants stand here once and are printed into every shader by [`prelude`]; a test compares the
//! offset of every struct field with that of the shader compiler.

use bytemuck::{Pod, Zeroable};

use crate::bvh::{Bvh, NO_HIT, TRIANGLE};
use crate::cast::SightSphere;
use crate::sensor::MAX_LIDARS;
use crate::task::{DevicePose, HIT_PUSH, KINDS, NO_CROSSING, REPEATS, TINY_COMPONENT, beam_origin};

/// Invocations of a workgroup.
pub(super) const WORKGROUP_SIZE: u32 = 64;
/// Workgroups along one dimension of a dispatch that every Vulkan device allows.
pub(super) const MAX_WORKGROUPS: u32 = 65_535;
/// Loop steps of one invocation of `cast_closest`, in all loops over instances and nodes together.
///
/// lavapipe silently ends the loops of an invocation after 65 535 iterations. It counts those of all
/// lanes of a vector, which run each loop as long as the slowest lane, as one: with 16 lanes
/// 16 · 3 750 = 60 000 iterations at most.
const STEP_BUDGET: u32 = 60_000 / 16;
/// Entries of an invocation's stack in `cast_closest`. A step down a tree pushes up to three: the host casts beams that need
/// more.
const STACK_ENTRIES: u32 = 24;
/// Triangle id of a beam whose traversal ran out of [`STEP_BUDGET`] or [`STACK_ENTRIES`].
pub(super) const UNFINISHED: u32 = NO_HIT - 1;
/// Root of a tree that the kernel leaves to the host.
const NO_ROOT: u32 = u32::MAX;
/// Largest coordinate in metres that the kernel casts at, 2⁴⁰: larger ones may overflow, and lift numbers that a device
/// flushes to zero over those that decide.
const MOST_COORDINATE: f32 = (1_u64 << 40) as f32;
/// Least padding of boxes in metres that the kernel casts at, 2⁻¹⁰⁰: see `keeps_bits` in the kernel.
const LEAST_PAD: f32 = f32::from_bits((127 - 100) << 23);
/// Voxels along an axis from which on the host covers the beams: below, planes have different crossings
/// in `f32`, and a walk of at most n/4 + n/4 + n/2 = n bricks ends below 65 535 loop steps.
pub(super) const LONG_AXIS: u32 = 1 << 15;
/// Voxels or words that one invocation of a reduction reads: a workgroup's sums of 16-bit halves,
/// 64 · 64 · (2¹⁶ − 1), stay below 2³².
const ITEMS_PER_INVOCATION: u32 = 64;
/// Items of a workgroup of a reduction.
pub(super) const ITEMS_PER_WORKGROUP: u32 = WORKGROUP_SIZE * ITEMS_PER_INVOCATION;
/// First sum of `reduce_occupied` that is of one LiDAR alone.
pub(super) const UNIQUE_SUMS: u32 = (KINDS + REPEATS) as u32;
/// Sums of `reduce_occupied` in low and high 16-bit halves: one a kind of information, one a level of repeated coverage,
/// then one unique entropy a LiDAR.
pub(super) const HALVED_SUMS: u32 = UNIQUE_SUMS + MAX_LIDARS as u32;
/// Words of one partial result of `reduce_occupied`: word 0 the count, words 1 + 2k and 2 + 2k the low and
/// high halves of sum k.
pub(super) const PARTIAL_WORDS: u32 = 1 + 2 * HALVED_SUMS;

/// Uniforms of a chunk, 48 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct Uniforms {
    /// Voxels along each axis.
    pub(super) shape: [u32; 3],
    pub(super) bitmap_words: u32,
    /// Voxel size in metres.
    pub(super) voxel: [f32; 3],
    pub(super) occupied_count: u32,
    pub(super) class_count: u32,
    /// 1 when beams end at their hits.
    pub(super) ends_at_hits: u32,
    /// Zero.
    pub(super) spare: [u32; 2],
}

/// The beams of a sensor, and its instances, 32 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct Sensor {
    /// Its first instance, and the end of its instances.
    pub(super) first_instance: u32,
    pub(super) end_instance: u32,
    /// First of its model's directions in the table of all models, and their number.
    pub(super) first_direction: u32,
    pub(super) direction_count: u32,
    /// Its first beam in the chunk.
    pub(super) first_beam: u32,
    /// Farthest return in metres.
    pub(super) range: f32,
    /// Zero, which no compiler can know: see `shaders/common/exact.wgsl`.
    pub(super) zero: u32,
    /// 1 when the host covers its beams.
    pub(super) covered_by_host: u32,
}

/// An instance as one sensor sees it, 80 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(super) struct GpuInstance {
    /// Rows of the rotation that turns sensor coordinates into the instance's, each followed by that
    /// coordinate of the sensor (m).
    pub(super) rows: [[f32; 4]; 3],
    /// Centre of a sphere around it in the sensor's frame, and its radius, in metres.
    pub(super) center: [f32; 3],
    pub(super) radius: f32,
    /// Beams miss it whose (centre · direction)² is less.
    pub(super) least_square: f32,
    /// Metres by which triangle boxes are grown.
    pub(super) pad: f32,
    /// Root of its tree among all nodes, or [`NO_ROOT`].
    pub(super) root: u32,
    /// Number of its first triangle in the frame.
    pub(super) first_prim: u32,
}

impl GpuInstance {
    /// A tree, its root among all nodes, as the sensor with a pose in its frame sees it; without a root where
    /// numbers are outside the kernel's range.
    pub(super) fn new(
        pose: &DevicePose,
        sight: &SightSphere,
        tree: &Bvh,
        root: u32,
        first_prim: u32,
    ) -> Self {
        let in_range = tree.pad >= LEAST_PAD
            && tree.bounds().is_none_or(|bounds| {
                let size = bounds.min.abs().max(bounds.max.abs()).max(beam_origin(pose).abs());
                size.max_element() <= MOST_COORDINATE
            });
        let root = if in_range { root } else { NO_ROOT };
        Self {
            rows: pose.rows,
            center: sight.center,
            radius: sight.radius,
            least_square: sight.least_square,
            pad: tree.pad,
            root,
            first_prim,
        }
    }
}

/// Constants as WGSL, put before every shader.
pub(super) fn prelude() -> String {
    let words = [
        ("WORKGROUP_SIZE", WORKGROUP_SIZE),
        ("STACK_ENTRIES", STACK_ENTRIES),
        ("MAX_LIDARS", MAX_LIDARS as u32),
        ("NO_HIT", NO_HIT),
        ("UNFINISHED", UNFINISHED),
        ("STEP_BUDGET", STEP_BUDGET),
        ("TRIANGLE_ITEM", TRIANGLE),
        ("NO_ROOT", NO_ROOT),
        ("ITEMS_PER_INVOCATION", ITEMS_PER_INVOCATION),
        ("ITEMS_PER_WORKGROUP", ITEMS_PER_WORKGROUP),
        ("PARTIAL_WORDS", PARTIAL_WORDS),
    ];
    let floats =
        [("HIT_PUSH", HIT_PUSH), ("TINY_COMPONENT", TINY_COMPONENT), ("NO_CROSSING", NO_CROSSING)];
    let mut text = String::new();
    for (name, value) in words {
        text += &format!("const {name}: u32 = {value}u;\n");
    }
    for (name, value) in floats {
        text += &format!("const {name}: f32 = {value:e}f;\n");
    }
    text
}
