//! Nodes and triangles of the binary tree.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Most nodes on a path from the root to a leaf; traversal stacks hold this many entries.
pub const MAX_DEPTH: usize = 64;

/// One node, 32 bytes: two to a cache line, so that a pair of siblings is one fetch.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Node {
    /// Lower corner of the padded box.
    pub min: [f32; 3],
    /// Leaf: first triangle. Inner node: left child; the right child is the next node.
    pub first: u32,
    /// Upper corner of the padded box.
    pub max: [f32; 3],
    /// Triangles of a leaf; 0 marks an inner node.
    pub count: u32,
}

/// One triangle in leaf order, 64 bytes; corners as read, so that neighbours share exact edges.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Triangle {
    /// First corner.
    pub a: [f32; 3],
    /// Index of the face in the soup.
    pub prim: u32,
    /// Second corner.
    pub b: [f32; 3],
    /// Zero.
    pub pad0: u32,
    /// Third corner.
    pub c: [f32; 3],
    /// Zero.
    pub pad1: u32,
    /// Unit normal, computed in `f64` and rounded once; zero where the triangle has no area.
    pub normal: [f32; 3],
    /// Zero.
    pub pad2: u32,
}

impl Triangle {
    /// A triangle from its corners in metres and its index in the soup.
    pub fn new([a, b, c]: [[f32; 3]; 3], prim: u32) -> Self {
        let corner = |v: [f32; 3]| Vec3::from(v).as_dvec3();
        let normal = (corner(b) - corner(a)).cross(corner(c) - corner(a)).normalize_or_zero();
        let normal = normal.as_vec3().to_array();
        Self { a, prim, b, pad0: 0, c, pad1: 0, normal, pad2: 0 }
    }
}
