use super::Node;

/// Children of a wide node.
pub(super) const WIDTH: usize = 8;
/// Bit of a child that marks a leaf: the other bits are its triangles' count and first index.
const LEAF: u32 = 1 << 31;
const COUNT_BITS: u32 = 3;
const FIRST_BITS: u32 = 31 - COUNT_BITS;

/// Eight children of the binary tree side by side, 224 bytes: one visit tests all of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct WideNode {
    /// Lower and upper corners by axis, side and child; unused slots hold the empty box.
    pub(super) planes: [[[f32; WIDTH]; 2]; 3],
    pub(super) children: [Child; WIDTH],
}

/// A wide node's child: another wide node or a range of triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Child(u32);

impl Child {
    /// The root of a tree.
    pub(super) const ROOT: Self = Self(0);

    /// Triangles of a leaf, or the index of a wide node.
    pub(super) fn get(self) -> Result<std::ops::Range<usize>, usize> {
        if self.0 & LEAF == 0 {
            return Err(self.0 as usize);
        }
        let first = (self.0 & ((1 << FIRST_BITS) - 1)) as usize;
        let count = (self.0 >> FIRST_BITS & ((1 << COUNT_BITS) - 1)) as usize;
        Ok(first..first + count)
    }
}

/// Merges the binary tree's nodes into wide ones: each takes over the grandchildren of its largest
/// children until eight are together. Boxes are the binary tree's own.
pub(super) fn collapse(nodes: &[Node]) -> Vec<WideNode> {
    let mut wide = Vec::new();
    if !nodes.is_empty() {
        wide.push(WideNode::EMPTY);
        fill(nodes, 0, 0, &mut wide);
    }
    wide
}

/// Fills wide node `at` with the descendants of binary node `from`.
fn fill(nodes: &[Node], from: usize, at: usize, wide: &mut Vec<WideNode>) {
    let mut below = vec![from];
    while below.len() < WIDTH {
        let inner = below.iter().enumerate().filter(|&(_, &node)| nodes[node].count == 0);
        let largest =
            inner.max_by(|a, b| half_area(&nodes[*a.1]).total_cmp(&half_area(&nodes[*b.1])));
        let Some((slot, &node)) = largest else { break };
        below[slot] = nodes[node].first as usize;
        below.push(nodes[node].first as usize + 1);
    }
    for (slot, node) in below.into_iter().enumerate() {
        let (index, node) = (node, &nodes[node]);
        for axis in 0..3 {
            wide[at].planes[axis][0][slot] = node.min[axis];
            wide[at].planes[axis][1][slot] = node.max[axis];
        }
        wide[at].children[slot] = if node.count > 0 {
            Child(LEAF | node.count << FIRST_BITS | node.first)
        } else {
            let child = wide.len();
            wide.push(WideNode::EMPTY);
            fill(nodes, index, child, wide);
            Child(child as u32)
        };
    }
}

fn half_area(node: &Node) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|axis| node.max[axis] - node.min[axis]);
    x * y + y * z + z * x
}

impl WideNode {
    const EMPTY: Self = Self {
        planes: [[[f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]]; 3],
        children: [Child::ROOT; WIDTH],
    };
}
