//! Which nodes of the binary tree become wide nodes, and their children.

use super::Node;

/// Triangles below a binary node: they are neighbours in leaf order.
#[derive(Clone, Copy, Default)]
pub(super) struct Below {
    pub(super) first: u32,
    pub(super) count: u32,
}

impl Below {
    /// One for each node.
    fn all(nodes: &[Node]) -> Vec<Self> {
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
pub(super) struct Cuts<'a, const WIDTH: usize> {
    nodes: &'a [Node],
    /// One for each binary node.
    pub(super) below: Vec<Below>,
    /// Row of each binary node in `places`; [`BLOCK`] for those that are blocks or lie in one.
    rows: Vec<u32>,
    /// `places[k]`: slots for the left child if the subtree gets k + 1 slots; 0 keeps the subtree as one child.
    /// The last entry splits the slots of its own wide node.
    places: Vec<[u8; WIDTH]>,
}

/// Row of a binary node that is a block or lies in one.
const BLOCK: u32 = u32::MAX;

impl<'a, const WIDTH: usize> Cuts<'a, WIDTH> {
    pub(super) fn new(nodes: &'a [Node]) -> Self {
        let (below, rows) = (Below::all(nodes), vec![BLOCK; nodes.len()]);
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

    /// The children of a wide node that begins at a binary one, at most `WIDTH`; a block is its own only child.
    pub(super) fn children(&self, from: usize) -> Vec<usize> {
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

fn half_area(node: &Node) -> f32 {
    let [x, y, z] = [0, 1, 2].map(|axis| node.max[axis] - node.min[axis]);
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests {
    use super::{BLOCK, Below, Cuts, half_area};
    use crate::bvh::{Bvh, Node};
    use crate::chance::mixed;
    use crate::geom::TriangleSoup;

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
    fn walked(cuts: &Cuts<'_, WIDTH>, from: usize, blocks: &mut Vec<usize>) -> f64 {
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
    fn least(nodes: &[Node], below: &[Below]) -> f64 {
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
            let cuts = Cuts::<WIDTH>::new(&bvh.nodes);
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
        let cuts = Cuts::<WIDTH>::new(&bvh.nodes);
        assert_eq!(cuts.children(0), [0]);
        assert!(cuts.rows.iter().all(|&row| row == BLOCK));
    }

    #[test]
    fn areas_beyond_all_numbers_are_cut_somewhere() {
        let bvh = tree(60, 3, 1e30);
        let cuts = Cuts::<WIDTH>::new(&bvh.nodes);
        let mut blocks = Vec::new();
        walked(&cuts, 0, &mut blocks);
        assert_eq!(blocks.iter().map(|&node| cuts.below[node].count).sum::<u32>(), 60);
    }
}
