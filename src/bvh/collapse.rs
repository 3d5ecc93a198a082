//! Which nodes of the binary tree become the children of a wide node.

use super::Node;

/// Triangles below a binary node: they are neighbours in leaf order.
#[derive(Clone, Copy, Default)]
pub(super) struct Below {
    pub(super) first: u32,
    pub(super) count: u32,
}

impl Below {
    /// Of each node.
    pub(super) fn all(nodes: &[Node]) -> Vec<Self> {
        let mut below = vec![Self::default(); nodes.len()];
        // Children come after their parents.
        for (index, node) in nodes.iter().enumerate().rev() {
            below[index] = if node.count > 0 {
                Self { first: node.first, count: node.count }
            } else {
                let left = node.first as usize;
                let count = below[left].count + below[left + 1].count;
                Self { first: below[left].first, count }
            };
        }
        below
    }
}

/// At most `width` nodes below `from`: the largest is replaced by its two children until they are as many.
/// A node of at most `width` triangles stays, as a block.
pub(super) fn wide_children(
    nodes: &[Node],
    below: &[Below],
    from: usize,
    width: usize,
) -> Vec<usize> {
    let area = |node: usize| half_area(&nodes[node]);
    let mut children = vec![from];
    while children.len() < width {
        let inner = children.iter().enumerate();
        let inner = inner.filter(|&(_, &node)| below[node].count as usize > width);
        let largest = inner.max_by(|a, b| area(*a.1).total_cmp(&area(*b.1)));
        let Some((slot, &node)) = largest else { break };
        children[slot] = nodes[node].first as usize;
        children.push(nodes[node].first as usize + 1);
    }
    children
}

fn half_area(node: &Node) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|axis| node.max[axis] - node.min[axis]);
    x * y + y * z + z * x
}
