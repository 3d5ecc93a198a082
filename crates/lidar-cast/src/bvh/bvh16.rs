//! The sixteen-wide tree that a sensor's grid of beams walks, collapsed from the binary one.
//!
//! [`TreeCuts`] tells which nodes of the binary tree become wide nodes, and their children.

use super::{BvhNode, Triangle};

/// Children of a node, and most triangles of a block.
pub(crate) const WIDTH: usize = 16;
/// Bit of a child that marks a block of triangles.
pub(crate) const BLOCK: u32 = 1 << 31;

/// The binary tree with its nodes merged sixteen by sixteen, and its lowest subtrees made blocks of
/// triangles. Boxes are middle and half extents, since they are bounded around their middle.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bvh16 {
    /// The root comes first; none without triangles.
    pub nodes: Vec<Node16>,
    /// Leaves.
    pub blocks: Vec<Block16>,
    /// Largest coordinate of all boxes, without its sign.
    pub largest: f32,
}

/// Sixteen descendants of a binary node side by side, 512 bytes: 192 of middles, 192 of half extents,
/// 64 of children, 4 of `valid`, and 60 that fill the last cache line.
#[repr(C, align(64))]
#[derive(Debug, Clone)]
pub(crate) struct Node16 {
    /// Middles by axis and child.
    pub middle: [[f32; WIDTH]; 3],
    /// Half extents by axis and child, rounded up.
    pub half: [[f32; WIDTH]; 3],
    /// Index of a node, or of a block with bit 31 set.
    pub children: [u32; WIDTH],
    /// A bit for each child that there is, the first in the lowest.
    pub valid: u16,
}

/// Up to `W` triangles side by side, to the end of a cache line: 896 bytes of sixteen, 448 of eight.
#[repr(C, align(64))]
#[derive(Debug, Clone)]
pub(crate) struct TriangleBlock<const W: usize> {
    /// Corners by corner, axis and triangle; an unused slot is a point, which no ray hits.
    pub corners: [[[f32; W]; 3]; 3],
    /// Normals by axis and triangle.
    pub normal: [[f32; W]; 3],
    /// Indices of the faces.
    pub prim: [u32; W],
    /// A bit for each triangle that there is.
    pub valid: u16,
}

/// Block of the sixteen-wide tree.
pub(crate) type Block16 = TriangleBlock<WIDTH>;

struct Collapse<'a> {
    nodes: &'a [BvhNode],
    triangles: &'a [Triangle],
    cuts: TreeCuts<'a, WIDTH>,
    tree: Bvh16,
}

impl Bvh16 {
    /// Merges the binary tree's nodes where [`TreeCuts`] says. A subtree of at most sixteen triangles becomes a block.
    pub(crate) fn collapse(nodes: &[BvhNode], triangles: &[Triangle]) -> Self {
        let cuts = TreeCuts::new(nodes);
        let mut collapse = Collapse { nodes, triangles, cuts, tree: Self::default() };
        if let Some(root) = nodes.first() {
            let sides = root.min.iter().chain(&root.max);
            collapse.tree.largest = sides.fold(0.0, |largest, side| largest.max(side.abs()));
            collapse.tree.nodes.push(Node16::EMPTY);
            collapse.fill(0, 0);
        }
        collapse.tree
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
            self.tree.nodes[at].set_box(slot, &self.nodes[index]);
            let child = if self.cuts.below[index].count as usize <= WIDTH {
                let LeafRange { first, count } = self.cuts.below[index];
                let (first, count) = (first as usize, count as usize);
                self.tree.blocks.push(Block16::new(&self.triangles[first..first + count]));
                BLOCK | (self.tree.blocks.len() - 1) as u32
            } else {
                self.tree.nodes.push(Node16::EMPTY);
                let child = self.tree.nodes.len() - 1;
                self.fill(index, child);
                child as u32
            };
            self.tree.nodes[at].children[slot] = child;
        }
    }
}

impl Node16 {
    const EMPTY: Self =
        Self { middle: [[0.0; WIDTH]; 3], half: [[0.0; WIDTH]; 3], children: [0; WIDTH], valid: 0 };

    fn set_box(&mut self, slot: usize, node: &BvhNode) {
        for axis in 0..3 {
            let (low, high) = (node.min[axis], node.max[axis]);
            let middle = 0.5 * low + 0.5 * high;
            self.middle[axis][slot] = middle;
            // Both differences are rounded once, by less than 2⁻²³ of themselves.
            self.half[axis][slot] = (high - middle).max(middle - low) * (1.0 + 1e-6);
        }
        self.valid |= 1 << slot;
    }
}

impl<const W: usize> TriangleBlock<W> {
    pub(super) fn new(triangles: &[Triangle]) -> Self {
        let at = triangles[0].a;
        let point = Triangle { b: at, c: at, ..triangles[0] };
        let valid = ((1_u32 << triangles.len()) - 1) as u16;
        let mut block =
            Self { corners: [[[0.0; W]; 3]; 3], normal: [[0.0; W]; 3], prim: [0; W], valid };
        for slot in 0..W {
            let Triangle { a, b, c, normal, prim, .. } = *triangles.get(slot).unwrap_or(&point);
            for axis in 0..3 {
                for (k, corner) in [a, b, c].iter().enumerate() {
                    block.corners[k][axis][slot] = corner[axis];
                }
                block.normal[axis][slot] = normal[axis];
            }
            block.prim[slot] = prim;
        }
        block
    }

    /// The triangle of a slot as it was built.
    #[inline(always)]
    pub(crate) fn triangle(&self, slot: usize) -> Triangle {
        let at = |numbers: &[[f32; W]; 3]| [0, 1, 2].map(|axis: usize| numbers[axis][slot % W]);
        let [a, b, c] = &self.corners;
        let (normal, prim) = (at(&self.normal), self.prim[slot % W]);
        Triangle { a: at(a), prim, b: at(b), pad0: 0, c: at(c), pad1: 0, normal, pad2: 0 }
    }
}

/// Triangles below a binary node: they are neighbours in leaf order.
#[derive(Clone, Copy, Default)]
struct LeafRange {
    first: u32,
    count: u32,
}

impl LeafRange {
    /// One for each node.
    fn all(nodes: &[BvhNode]) -> Vec<Self> {
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

/// Where wide nodes of a binary tree begin: the cuts whose wide nodes have the least sum of areas, as a ray meets a
/// box about as often as it is large.
///
/// The least sum is found for each subtree and each number of places that it may take in the node above. A subtree of at
/// most `WIDTH` triangles is a block, which takes one place. (Ylitie, Karras, Laine: "Efficient incoherent ray traversal on
/// GPUs through compressed wide BVHs", HPG 2017; departure: blocks are as large as they can be, so that they cost the same
/// however the tree is cut.)
pub(super) struct TreeCuts<'a, const WIDTH: usize> {
    nodes: &'a [BvhNode],
    /// One for each binary node.
    below: Vec<LeafRange>,
    /// Row of each binary node in `places`; [`NO_WIDE_NODE`] for a node that is a block or lies in one.
    rows: Vec<u32>,
    /// `places[k]`: slots for the left child if the subtree gets k + 1 slots; 0 keeps the subtree as one child.
    /// The last entry splits the slots of its own wide node.
    places: Vec<[u8; WIDTH]>,
}

/// Row of a binary node that is a block or lies in one.
const NO_WIDE_NODE: u32 = u32::MAX;

impl<'a, const WIDTH: usize> TreeCuts<'a, WIDTH> {
    pub(crate) fn new(nodes: &'a [BvhNode]) -> Self {
        let (below, rows) = (LeafRange::all(nodes), vec![NO_WIDE_NODE; nodes.len()]);
        let mut cuts = Self { nodes, below, rows, places: Vec::new() };
        // Row by row: least sum of areas for k + 1 places.
        let mut least: Vec<[f32; WIDTH]> = Vec::new();
        // Children come after their parents.
        for (index, node) in nodes.iter().enumerate().rev() {
            if cuts.below[index].count as usize <= WIDTH {
                continue;
            }
            let half = |k: usize| least.get(cuts.rows[node.first as usize + k] as usize);
            let [left, right] = [half(0), half(1)].map(|sums| sums.unwrap_or(&[0.0; WIDTH]));
            let (mut sums, mut places) = ([f32::INFINITY; WIDTH], [0; WIDTH]);
            for all in 1..WIDTH {
                for k in 0..all {
                    let sum = left[k] + right[all - 1 - k];
                    // Also where areas are no numbers the first half gets a place.
                    if k == 0 || sum < sums[all] {
                        (sums[all], places[all]) = (sum, k as u8 + 1);
                    }
                }
            }
            let own = half_area(node) + sums[WIDTH - 1];
            for (sum, places) in sums.iter_mut().zip(&mut places).take(WIDTH - 1) {
                if own <= *sum {
                    (*sum, *places) = (own, 0);
                }
            }
            cuts.rows[index] = least.len() as u32;
            least.push(sums);
            cuts.places.push(places);
        }
        cuts
    }

    /// A binary node.
    pub(crate) fn node(&self, index: usize) -> &'a BvhNode {
        &self.nodes[index]
    }

    /// Triangles below a binary node, in leaf order.
    pub(crate) fn triangles(&self, index: usize) -> std::ops::Range<usize> {
        let LeafRange { first, count } = self.below[index];
        first as usize..(first + count) as usize
    }

    /// The children of a wide node that begins at a binary one, at most `WIDTH`; a block is its own only child.
    pub(crate) fn children(&self, from: usize) -> Vec<usize> {
        let mut children = Vec::with_capacity(WIDTH);
        self.gather(from, WIDTH, &mut children);
        children
    }

    fn gather(&self, node: usize, all: usize, children: &mut Vec<usize>) {
        let places = self.places.get(self.rows[node] as usize);
        match places.map_or(0, |places| usize::from(places[all - 1])) {
            0 => children.push(node),
            left => {
                let first = self.nodes[node].first as usize;
                self.gather(first, left, children);
                self.gather(first + 1, all - left, children);
            }
        }
    }
}

fn half_area(node: &BvhNode) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|axis| node.max[axis] - node.min[axis]);
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests {
    use super::super::{Bvh, BvhNode};
    use super::{Bvh16, LeafRange, NO_WIDE_NODE, TreeCuts, half_area};
    use crate::geom::TriangleSoup;
    use crate::maths::mixed;

    /// A hilly floor of `side` by `side` squares.
    fn floor(side: u32) -> TriangleSoup {
        let mut soup = TriangleSoup::default();
        let corner = |k: u32| {
            let (x, y) = ((k % (side + 1)) as f32, (k / (side + 1)) as f32);
            [x, y, 3.0 * (0.1 * x).sin() * (0.13 * y).cos()]
        };
        soup.vertices.extend((0..(side + 1) * (side + 1)).map(corner));
        for at in 0..side * side {
            let k = at % side + at / side * (side + 1);
            soup.faces.extend([[k, k + 1, k + side + 1], [k + 1, k + side + 2, k + side + 1]]);
        }
        soup.face_class.resize(soup.faces.len(), 0);
        soup
    }

    #[test]
    fn blocks_and_nodes_are_well_filled() {
        let soup = floor(150);
        let Bvh16 { nodes, blocks, .. } = Bvh::build(&soup, 100.0).bvh16;
        let triangles: u32 = blocks.iter().map(|block| block.valid.count_ones()).sum();
        assert_eq!(triangles as usize, soup.faces.len());
        let children: u32 = nodes.iter().map(|node| node.valid.count_ones()).sum();
        let share = |count: u32, of: usize| f64::from(count) / (of * WIDTH) as f64;
        // 0.93 and 0.71; 0.66 and 0.66 where halves count their triangles one by one.
        assert!(share(triangles, blocks.len()) > 0.85);
        assert!(share(children, nodes.len()) > 0.6);
    }

    const WIDTH: usize = 4;

    /// Small triangles here and there, some of them large.
    fn tree(count: u32, seed: u64, largest: f32) -> Bvh {
        let mut state = seed;
        let mut next = || {
            state = mixed(state.wrapping_add(0x9e37_79b9_7f4a_7c15));
            (state >> 40) as f32 / (1_u64 << 24) as f32
        };
        let mut soup = TriangleSoup::default();
        for k in 0..count {
            let middle = [next(), next(), next()].map(|x| (x - 0.5) * largest);
            let size = largest * if k % 7 == 0 { 0.3 } else { 0.02 };
            soup.vertices.extend([(); 3].map(|()| middle.map(|x| x + size * (next() - 0.5))));
            soup.faces.push([3 * k, 3 * k + 1, 3 * k + 2]);
            soup.face_class.push(0);
        }
        Bvh::build(&soup, 1.0)
    }

    /// Sum of the areas of the wide nodes; collects the blocks among their children.
    fn walked(cuts: &TreeCuts<'_, WIDTH>, from: usize, blocks: &mut Vec<usize>) -> f64 {
        let children = cuts.children(from);
        assert!(children.len() <= WIDTH);
        let mut sum = f64::from(half_area(&cuts.nodes[from]));
        for child in children {
            if cuts.below[child].count as usize <= WIDTH {
                blocks.push(child);
            } else {
                assert_ne!(child, from);
                sum += walked(cuts, child, blocks);
            }
        }
        sum
    }

    /// The least sum of all ways to say of each binary node whether a wide one begins there.
    fn least(nodes: &[BvhNode], below: &[LeafRange]) -> f64 {
        let wide: Vec<usize> =
            (1..nodes.len()).filter(|&node| below[node].count as usize > WIDTH).collect();
        assert!(wide.len() < 16);
        let mut least = f64::INFINITY;
        for chosen in 0_u32..1 << wide.len() {
            let begins = |node: usize| {
                wide.iter().position(|&w| w == node).is_none_or(|k| chosen >> k & 1 == 1)
            };
            let children = |from: usize| {
                let mut open = vec![from];
                let mut count = 0;
                while let Some(node) = open.pop() {
                    if node == from || !begins(node) {
                        open.extend([0, 1].map(|k| nodes[node].first as usize + k));
                    } else {
                        count += 1;
                    }
                }
                count
            };
            let mut roots = vec![0];
            roots.extend(wide.iter().copied().filter(|&node| begins(node)));
            if roots.iter().all(|&root| children(root) <= WIDTH) {
                least =
                    least.min(roots.iter().map(|&root| f64::from(half_area(&nodes[root]))).sum());
            }
        }
        least
    }

    #[test]
    fn wide_nodes_have_the_least_sum_of_areas() {
        for seed in 0..20 {
            let bvh = tree(24, seed, 10.0);
            let cuts = TreeCuts::<WIDTH>::new(&bvh.nodes);
            let below = &cuts.below;
            let mut blocks = Vec::new();
            let found = walked(&cuts, 0, &mut blocks);
            let expected = least(&bvh.nodes, below);
            assert!((found - expected).abs() < 1e-3 * expected, "seed {seed}: {found}, {expected}");
            // Every triangle is in one block.
            let mut ranges: Vec<_> =
                blocks.iter().map(|&node| (below[node].first, below[node].count)).collect();
            ranges.sort_unstable();
            let end = ranges.iter().fold(0, |next, &(first, count)| {
                assert_eq!(first, next);
                next + count
            });
            assert_eq!(end, 24);
        }
    }

    #[test]
    fn a_tree_of_one_block_is_its_own_child() {
        let bvh = tree(WIDTH as u32, 1, 10.0);
        let cuts = TreeCuts::<WIDTH>::new(&bvh.nodes);
        assert_eq!(cuts.children(0), [0]);
        assert!(cuts.rows.iter().all(|&row| row == NO_WIDE_NODE));
    }

    #[test]
    fn areas_beyond_all_numbers_are_cut_somewhere() {
        let bvh = tree(60, 3, 1e30);
        let cuts = TreeCuts::<WIDTH>::new(&bvh.nodes);
        let mut blocks = Vec::new();
        walked(&cuts, 0, &mut blocks);
        assert_eq!(blocks.iter().map(|&node| cuts.below[node].count).sum::<u32>(), 60);
    }
}
