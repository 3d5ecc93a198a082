//! The eight-wide tree of the CPU's vector instructions, collapsed from the binary one.

use super::collapse::{Below, Cuts};
use super::{Node, Triangle};

/// Children of a node, and most triangles of a block.
pub(crate) const WIDTH: usize = 8;
/// Bit of a child that marks a block of triangles.
const LEAF: u32 = 1 << 31;

/// The binary tree with its nodes merged eight by eight, and its lowest subtrees made blocks of
/// triangles (Wald, Benthin, Boulos: "Getting rid of packets", 2008, for the shape).
#[derive(Debug, Clone, Default)]
pub(crate) struct Bvh8 {
    /// The root comes first; none without triangles.
    pub(crate) nodes: Vec<Node8>,
    /// Leaves.
    pub(crate) blocks: Vec<Block>,
}

/// Eight descendants of a binary node side by side, 224 bytes: 192 of planes and 32 of children.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Node8 {
    /// Lower and upper corners by axis, side and child; unused slots hold the empty box.
    pub(crate) planes: [[[f32; WIDTH]; 2]; 3],
    pub(crate) children: [Child; WIDTH],
}

/// Up to eight triangles side by side, 296 bytes: 288 of corners, 4 of `first`, 4 of `count`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Block {
    /// Corners by corner, axis and triangle; unused slots repeat the first triangle.
    pub(crate) corners: [[[f32; WIDTH]; 3]; 3],
    /// First triangle in leaf order.
    pub(crate) first: u32,
    /// Triangles.
    pub(crate) count: u32,
}

/// A child of a [`Node8`], 32 bits: bit 31 marks a block, bits 0 to 30 are the index of the block or
/// of the node, e.g. 0x8000_0005 is block 5 and 0x0000_0005 node 5.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Child(u32);

impl Child {
    /// The root of a tree.
    pub(crate) const ROOT: Self = Self(0);

    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    pub(crate) fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// Index of a block, or of a node as the error.
    pub(crate) fn get(self) -> Result<usize, usize> {
        if self.0 & LEAF != 0 { Ok((self.0 ^ LEAF) as usize) } else { Err(self.0 as usize) }
    }
}

struct Collapse<'a> {
    nodes: &'a [Node],
    triangles: &'a [Triangle],
    cuts: Cuts<'a, WIDTH>,
    bvh8: Bvh8,
}

impl Bvh8 {
    /// Merges the binary tree's nodes where [`Cuts`] says. A subtree of at most eight triangles becomes a block.
    /// Boxes are the binary tree's own.
    pub(crate) fn collapse(nodes: &[Node], triangles: &[Triangle]) -> Self {
        let cuts = Cuts::new(nodes);
        let mut collapse = Collapse { nodes, triangles, cuts, bvh8: Self::default() };
        if !nodes.is_empty() {
            collapse.bvh8.nodes.push(Node8::EMPTY);
            collapse.fill(0, 0);
        }
        collapse.bvh8
    }

    /// Bytes of nodes and blocks.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of_val(self.nodes.as_slice()) + size_of_val(self.blocks.as_slice())) as u64
    }
}

impl Collapse<'_> {
    /// Fills node `at` with the descendants of binary node `from`.
    fn fill(&mut self, from: usize, at: usize) {
        for (slot, index) in self.cuts.children(from).into_iter().enumerate() {
            let node = &self.nodes[index];
            for axis in 0..3 {
                self.bvh8.nodes[at].planes[axis][0][slot] = node.min[axis];
                self.bvh8.nodes[at].planes[axis][1][slot] = node.max[axis];
            }
            let child = if self.cuts.below[index].count as usize <= WIDTH {
                self.bvh8.blocks.push(Block::new(self.triangles, self.cuts.below[index]));
                LEAF | (self.bvh8.blocks.len() - 1) as u32
            } else {
                self.bvh8.nodes.push(Node8::EMPTY);
                let child = self.bvh8.nodes.len() - 1;
                self.fill(index, child);
                child as u32
            };
            self.bvh8.nodes[at].children[slot] = Child(child);
        }
    }
}

impl Block {
    pub(crate) const EMPTY: Self = Self { corners: [[[0.0; WIDTH]; 3]; 3], first: 0, count: 0 };

    fn new(triangles: &[Triangle], Below { first, count }: Below) -> Self {
        let mut block = Self { first, count, ..Self::EMPTY };
        for slot in 0..WIDTH {
            let triangle = first as usize + if slot < count as usize { slot } else { 0 };
            block.set(slot, &triangles[triangle]);
        }
        block
    }

    #[inline(always)]
    pub(crate) fn set(&mut self, slot: usize, triangle: &Triangle) {
        for (k, corner) in [triangle.a, triangle.b, triangle.c].into_iter().enumerate() {
            for (axis, coordinate) in corner.into_iter().enumerate() {
                self.corners[k][axis][slot] = coordinate;
            }
        }
    }
}

impl Node8 {
    const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
        children: [Child::ROOT; WIDTH],
    };
}
