//! Constants and structures that the host shares with the shaders.
//!
//! Constants stand here once and are printed into every shader by [`prelude`]; a test compares the
//! offset of every struct field with the one that the shader compiler finds.

use bytemuck::{Pod, Zeroable};

use crate::bvh::{KINDS, NO_HIT, PAD_SHARE, ROOT, STACK, TRIANGLE, UNIT};
use crate::cast::BOUNDS_SLACK;
use crate::problem::{FAR, PUSH, TINY_COMPONENT};
use crate::vehicle::MAX_LIDARS;

/// Invocations of a workgroup.
pub(crate) const WORKGROUP_SIZE: u32 = 64;
/// Workgroups along one dimension of a dispatch that every Vulkan device allows.
pub(crate) const MAX_WORKGROUPS: u32 = 65_535;
/// Loop steps that one invocation may take: some drivers end loops silently after 65 535.
pub(crate) const STEP_BUDGET: u32 = 60_000;
/// Triangle id of a beam whose traversal ran out of [`STEP_BUDGET`].
pub(crate) const UNFINISHED: u32 = NO_HIT - 1;
/// Beams of a packet by four: what a software device loads of a tree serves so many at once.
pub(crate) const PACKET_FOURS: u32 = 16;
/// Loop steps that an invocation with loops in loops may take: where invocations run side by side, each
/// inner loop takes as long as the longest, so that their steps may add up, of sixteen on the widest
/// vector units.
pub(crate) const NESTED_STEPS: u32 = STEP_BUDGET / 16;
/// Vectors in a row of the texture that holds a tree for packets.
pub(crate) const TREE_ROW: u32 = 1 << 12;
/// Slot of a packet without a beam.
pub(crate) const NO_SLOT: u32 = u32::MAX;
/// State of a beam whose walk has ended.
pub(crate) const WALK_DONE: u32 = u32::MAX;
/// Voxels or words that one invocation of a reduction looks at: a workgroup's sums of 16-bit halves
/// stay below 2³².
pub(crate) const ITEMS_PER_INVOCATION: u32 = 64;
/// Items of a workgroup of a reduction.
pub(crate) const ITEMS_PER_WORKGROUP: u32 = WORKGROUP_SIZE * ITEMS_PER_INVOCATION;
/// Sums that `reduce_occupied` keeps in low and high 16-bit halves: three entropies, then one unique
/// entropy a LiDAR.
pub(crate) const HALVED_SUMS: u32 = 3 + MAX_LIDARS as u32;
/// Words of one partial result of `reduce_occupied`: the count, then low and high halves.
pub(crate) const PARTIAL_WORDS: u32 = 1 + 2 * HALVED_SUMS;

/// Uniforms of one dispatch, 64 bytes.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(crate) struct Uniforms {
    /// Voxels along each axis.
    pub shape: [u32; 3],
    /// Directions of the beam table.
    pub direction_count: u32,
    /// Voxel size in metres.
    pub voxel: [f32; 3],
    /// Farthest return in metres.
    pub range: f32,
    /// 32-bit words of one bitmap.
    pub bitmap_words: u32,
    /// Nodes of the tree; 0 when there is no geometry to end a beam.
    pub node_count: u32,
    /// Metres by which triangle boxes are grown.
    pub pad: f32,
    /// Occupied voxels.
    pub occupied_count: u32,
    /// Classes.
    pub class_count: u32,
    /// Which pass of walks that need several and keep their state, from 1; 0 where one is enough.
    pub walk_pass: u32,
    /// Sensor of the chunk whose bitmap is the first.
    pub first_sensor: u32,
    /// 1 when beams end at their hits.
    pub ends_at_hits: u32,
}

/// Constants as WGSL, put before every shader.
pub(crate) fn prelude() -> String {
    let words = [
        ("WORKGROUP_SIZE", WORKGROUP_SIZE),
        ("MAX_LIDARS", MAX_LIDARS as u32),
        ("NO_HIT", NO_HIT),
        ("UNFINISHED", UNFINISHED),
        ("PACKET_FOURS", PACKET_FOURS),
        ("NESTED_STEPS", NESTED_STEPS),
        ("QUAD_STACK", STACK as u32),
        ("ROOT_ITEM", ROOT),
        ("TRIANGLE_ITEM", TRIANGLE),
        ("CHILD_ITEM", (1 << KINDS) - 1),
        ("ITEM_TEXELS", UNIT as u32),
        ("TREE_ROW", TREE_ROW),
        ("NO_SLOT", NO_SLOT),
        ("WALK_DONE", WALK_DONE),
        ("STEP_BUDGET", STEP_BUDGET),
        ("ITEMS_PER_INVOCATION", ITEMS_PER_INVOCATION),
        ("ITEMS_PER_WORKGROUP", ITEMS_PER_WORKGROUP),
        ("HALVED_SUMS", HALVED_SUMS),
        ("PARTIAL_WORDS", PARTIAL_WORDS),
    ];
    let floats = [
        ("PUSH", PUSH),
        ("TINY_COMPONENT", TINY_COMPONENT),
        ("FAR", FAR),
        ("BOUNDS_SLACK", BOUNDS_SLACK),
        ("PAD_SHARE", PAD_SHARE),
    ];
    let mut text = String::new();
    for (name, value) in words {
        text += &format!("const {name}: u32 = {value}u;\n");
    }
    for (name, value) in floats {
        text += &format!("const {name}: f32 = {value:e}f;\n");
    }
    text
}
