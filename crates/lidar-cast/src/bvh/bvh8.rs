//! The eight-wide tree that single rays go down, collapsed from the binary one when the first ray comes.
//!
//! Boxes keep both sides, so that a ray reads the side that it enters by and the one that it leaves by without a comparison.

use super::bvh16::{BLOCK, TreeCuts, TriangleBlock};
use super::{BvhNode, Triangle};

/// Children of a node, and most triangles of a block.
pub(crate) const WIDTH: usize = 8;
/// Row of [`Node8`] with the children.
const CHILDREN: usize = 6;
/// Row of [`Node8`] whose first place has their number.
const COUNT: usize = 7;

/// The binary tree with its nodes merged eight by eight, and its lowest subtrees made blocks of triangles.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bvh8 {
    /// Index of a node, or of a block with bit 31 set; none without triangles.
    pub root: Option<u32>,
    /// Inner nodes.
    pub nodes: Vec<Node8>,
    /// Leaves.
    pub blocks: Vec<Block8>,
    /// Largest coordinate of all boxes, without its sign.
    pub largest: f32,
}

/// Eight descendants of a binary node side by side, in eight rows of 32 bytes: 256 bytes.
///
/// Six rows hold lower x, y, z and upper x, y, z. The seventh holds the bits of the children, and the last fills the
/// cache line. No ray meets the box of an unused slot.
#[repr(C, align(64))]
#[derive(Debug, Clone)]
pub(crate) struct Node8 {
    /// Lower sides by axis, upper sides by axis, children.
    pub rows: [[f32; WIDTH]; 8],
}

/// Block of the eight-wide tree.
pub(crate) type Block8 = TriangleBlock<WIDTH>;

impl Bvh8 {
    /// Merges the binary tree's nodes where [`TreeCuts`] says. A subtree of at most eight triangles becomes a block.
    pub(crate) fn collapse(nodes: &[BvhNode], triangles: &[Triangle]) -> Self {
        let (mut tree, cuts) = (Self::default(), TreeCuts::new(nodes));
        if let Some(root) = nodes.first() {
            let sides = root.min.iter().chain(&root.max);
            tree.largest = sides.fold(0.0, |largest, side| largest.max(side.abs()));
            tree.root = Some(tree.child(&cuts, triangles, 0));
        }
        tree
    }

    /// Bytes of nodes and blocks.
    pub(crate) fn bytes(&self) -> u64 {
        (size_of_val(self.nodes.as_slice()) + size_of_val(self.blocks.as_slice())) as u64
    }

    /// Adds the subtree of a binary node; returns its index, of a block with bit 31 set.
    fn child(&mut self, cuts: &TreeCuts<'_, WIDTH>, triangles: &[Triangle], from: usize) -> u32 {
        let below = cuts.triangles(from);
        if below.len() <= WIDTH {
            self.blocks.push(Block8::new(&triangles[below]));
            return BLOCK | (self.blocks.len() - 1) as u32;
        }
        let at = self.nodes.len();
        self.nodes.push(Node8::EMPTY);
        for (slot, index) in cuts.children(from).into_iter().enumerate() {
            let child = self.child(cuts, triangles, index);
            self.nodes[at].set(slot, cuts.node(index), child);
        }
        at as u32
    }
}

impl Node8 {
    pub(crate) const EMPTY: Self = {
        let (low, high) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        Self { rows: [low, low, low, high, high, high, [0.0; WIDTH], [0.0; WIDTH]] }
    };

    /// Puts a child with its box into a slot.
    pub(crate) fn set(&mut self, slot: usize, node: &BvhNode, child: u32) {
        for axis in 0..3 {
            self.rows[axis][slot] = node.min[axis];
            self.rows[axis + 3][slot] = node.max[axis];
        }
        self.rows[CHILDREN][slot] = f32::from_bits(child);
        self.rows[COUNT][0] = f32::from_bits(slot as u32 + 1);
    }

    /// Number of children, which lie in the first slots.
    #[inline(always)]
    pub(crate) fn count(&self) -> usize {
        self.rows[COUNT][0].to_bits() as usize % (WIDTH + 1)
    }

    /// Replaces the children.
    pub(crate) fn map_children(&mut self, new: impl Fn(u32) -> u32) {
        for child in &mut self.rows[CHILDREN] {
            *child = f32::from_bits(new(child.to_bits()));
        }
    }

    #[inline(always)]
    pub(crate) fn child(&self, slot: usize) -> u32 {
        self.rows[CHILDREN][slot % WIDTH].to_bits()
    }
}
