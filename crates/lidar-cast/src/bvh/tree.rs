//! A rigid thing's triangles under their trees, nodes and triangles of the binary one, and the check that it is sound.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use super::bvh16::Bvh16;
use crate::geom::Aabb;

/// Triangles of one rigid thing under a flat binary tree; node 0 is the root.
#[derive(Debug, Clone)]
pub struct Bvh {
    /// Nodes, siblings adjacent; empty when there are no triangles.
    pub nodes: Vec<BvhNode>,
    /// Triangles in leaf order.
    pub triangles: Vec<Triangle>,
    /// Metres by which each triangle's box is grown; see [`Bvh::build`].
    pub pad: f32,
    /// The triangles again in a tree of sixteen-wide nodes, for packets of beams.
    pub bvh16: Bvh16,
}

/// Defect found by [`Bvh::validate`].
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum BvhError {
    /// A child index or a leaf range points outside the arrays.
    #[error("node {node} points outside the tree")]
    OutOfRange {
        /// Index of the node.
        node: usize,
    },
    /// A box does not hold the boxes below it.
    #[error("the box of node {node} does not hold its children")]
    BoxTooSmall {
        /// Index of the node.
        node: usize,
    },
    /// A triangle is in no leaf, or in two.
    #[error("triangle {prim} is in {times} leaves, not in one")]
    NotOnce {
        /// Index of the face in the soup.
        prim: usize,
        /// Leaves that hold it.
        times: u32,
    },
    /// A path is longer than a traversal stack.
    #[error("node {node} lies {depth} deep, traversal stacks hold {MAX_DEPTH}")]
    TooDeep {
        /// Index of the node.
        node: usize,
        /// Nodes above it.
        depth: usize,
    },
}

impl Bvh {
    /// The padded box of a triangle, which its leaf and all nodes above contain.
    pub fn padded_box(triangle: &Triangle, pad: f32) -> Aabb {
        let mut bounds = Aabb::EMPTY;
        for corner in [triangle.a, triangle.b, triangle.c] {
            bounds.grow(corner.into());
        }
        Aabb { min: bounds.min - pad, max: bounds.max + pad }
    }

    /// The padded box of all triangles; none where there are none.
    pub fn bounds(&self) -> Option<Aabb> {
        self.nodes.first().map(|root| Aabb { min: root.min.into(), max: root.max.into() })
    }

    /// Bytes of the triangles, the binary and the wide trees.
    pub fn bytes(&self) -> u64 {
        let own = size_of_val(self.nodes.as_slice()) + size_of_val(self.triangles.as_slice());
        own as u64 + self.bvh16.bytes()
    }

    /// Checks that every triangle is in one leaf, boxes nest exactly, and no path is too deep.
    ///
    /// # Errors
    /// The first violation found.
    pub fn validate(&self) -> Result<(), BvhError> {
        let mut times = vec![0_u32; self.triangles.len()];
        let mut stack = if self.nodes.is_empty() { vec![] } else { vec![(0_usize, 1_usize)] };
        while let Some((index, depth)) = stack.pop() {
            let node = self.nodes.get(index).ok_or(BvhError::OutOfRange { node: index })?;
            if depth > MAX_DEPTH {
                return Err(BvhError::TooDeep { node: index, depth });
            }
            let outer = Aabb { min: node.min.into(), max: node.max.into() };
            let mut inner = Aabb::EMPTY;
            if node.count > 0 {
                let range = node.first as usize..node.first as usize + node.count as usize;
                let leaf = self.triangles.get(range).ok_or(BvhError::OutOfRange { node: index })?;
                for triangle in leaf {
                    inner.merge(&Self::padded_box(triangle, self.pad));
                    let slot = times
                        .get_mut(triangle.prim as usize)
                        .ok_or(BvhError::OutOfRange { node: index })?;
                    *slot += 1;
                }
            } else {
                for child in [node.first as usize, node.first as usize + 1] {
                    let below =
                        self.nodes.get(child).ok_or(BvhError::OutOfRange { node: index })?;
                    inner.merge(&Aabb { min: below.min.into(), max: below.max.into() });
                    stack.push((child, depth + 1));
                }
            }
            if inner.min.cmplt(outer.min).any() || inner.max.cmpgt(outer.max).any() {
                return Err(BvhError::BoxTooSmall { node: index });
            }
        }
        match times.iter().position(|&t| t != 1) {
            Some(prim) => Err(BvhError::NotOnce { prim, times: times[prim] }),
            None => Ok(()),
        }
    }
}

/// Most nodes on a path from the root to a leaf; traversal stacks hold this many entries.
pub const MAX_DEPTH: usize = 64;

/// One node, 32 bytes: two to a cache line, so that a pair of siblings is one fetch.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct BvhNode {
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
