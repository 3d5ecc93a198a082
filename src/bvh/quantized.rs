use bytemuck::{Pod, Zeroable};

use super::Bvh;
use super::quads::{FourNode, Sides, TRIANGLE, WIDTH, collapse};

/// Steps between the lower side of the children's common box and its upper one, at most.
const STEPS: u32 = 255;

/// A node of four children on a device that casts beam by beam, 64 bytes: half of what their boxes
/// take in `f32`, and what such a device loads is what it waits for.
///
/// Sides are whole numbers of steps from the lower corner of the children's common box (Ylitie, Karras,
/// Laine: "Efficient incoherent ray traversal on GPUs through compressed wide BVHs", HPG 2017). A step
/// is a power of two, so that `corner + steps · step` is rounded once, also where it is contracted, and
/// the host, which computes the same, can choose each side such that nothing sticks out of its box.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct QuantizedNode {
    /// Lower corner of the common box in metres.
    pub corner: [f32; 3],
    /// Lower sides along x in steps, a byte a child, the first child in the lowest.
    pub low_x: u32,
    /// Metres a step along each axis.
    pub step: [f32; 3],
    /// Lower sides along y.
    pub low_y: u32,
    /// Upper sides along x, y and z.
    pub high: [u32; 3],
    /// Lower sides along z.
    pub low_z: u32,
    /// The children: index of a node, index of a triangle with [`TRIANGLE`], or 0,
    /// which is the root and nobody's child, where there is none.
    pub children: [u32; WIDTH],
}

impl QuantizedNode {
    /// The binary tree with its nodes merged into nodes of four, the root first; triangles stay where
    /// they are.
    pub fn tree(bvh: &Bvh) -> Vec<Self> {
        collapse(bvh).iter().map(Self::new).collect()
    }

    /// Entries that a traversal stack needs for such a tree: of each node on a path, all children but
    /// one.
    pub fn stack(tree: &[Self]) -> usize {
        let mut depth = vec![1; tree.len()];
        // Children come after their parents.
        for (at, node) in tree.iter().enumerate() {
            for &child in node.children.iter().filter(|&&child| child != 0 && child < TRIANGLE) {
                depth[child as usize] = depth[at] + 1;
            }
        }
        (WIDTH - 1) * depth.into_iter().max().unwrap_or(1)
    }

    fn new(node: &FourNode) -> Self {
        let mut low = [0; 3];
        let mut high = [0; 3];
        let mut corner = [0.0; 3];
        let mut step = [1.0; 3];
        for axis in 0..3 {
            let sides = || node.iter().flatten().map(|(_, sides)| sides);
            let lowest = sides().map(|s: &Sides| s[2 * axis]).fold(f32::INFINITY, f32::min);
            let highest = sides().map(|s| s[2 * axis + 1]).fold(f32::NEG_INFINITY, f32::max);
            if lowest > highest {
                continue;
            }
            corner[axis] = lowest;
            step[axis] = step_over(lowest, highest);
            for (slot, (_, sides)) in node.iter().enumerate().filter_map(|(k, c)| Some((k, (*c)?)))
            {
                let [below, above] = [sides[2 * axis], sides[2 * axis + 1]];
                let steps = |to: f32| (f64::from(to) - f64::from(lowest)) / f64::from(step[axis]);
                let mut first = steps(below).floor() as u32;
                while plane(lowest, first, step[axis]) > below {
                    first -= 1;
                }
                // The last side may reach all by being rounded up.
                let mut last = (steps(above).ceil() as u32).min(STEPS);
                while plane(lowest, last, step[axis]) < above {
                    last += 1;
                }
                low[axis] |= first << (8 * slot);
                high[axis] |= last << (8 * slot);
            }
        }
        let children = node.map(|child| child.map_or(0, |(item, _)| item));
        let [low_x, low_y, low_z] = low;
        Self { corner, low_x, step, low_y, high, low_z, children }
    }
}

/// A side as the kernel computes it.
fn plane(corner: f32, steps: u32, step: f32) -> f32 {
    corner + steps as f32 * step
}

/// The smallest power of two of which [`STEPS`] reach from one side to the other.
fn step_over(low: f32, high: f32) -> f32 {
    let mut step = ((high - low) / STEPS as f32).max(f32::MIN_POSITIVE);
    // The power of two at or below.
    step = f32::from_bits(step.to_bits() & 0x7f80_0000);
    while plane(low, STEPS, step) < high {
        step *= 2.0;
    }
    step
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::TriangleSoup;

    /// Lower and upper sides of a child's box, as the kernel finds them.
    fn sides(node: &QuantizedNode, slot: usize) -> Sides {
        let low = [node.low_x, node.low_y, node.low_z];
        let mut sides = [0.0; 6];
        for axis in 0..3 {
            for (side, word) in [low[axis], node.high[axis]].into_iter().enumerate() {
                let steps = word >> (8 * slot) & 0xff;
                sides[2 * axis + side] = plane(node.corner[axis], steps, node.step[axis]);
            }
        }
        sides
    }

    /// A soup of triangles of many sizes, `offset` metres from the origin.
    fn soup(faces: u32, offset: f32) -> TriangleSoup {
        let mut soup = TriangleSoup::default();
        for face in 0..faces {
            let x = offset + if face % 3 == 0 { 1.0 } else { 0.37 * face as f32 };
            let size = 0.001 * 3_f32.powi(face as i32 % 10);
            soup.vertices.extend([
                [x, offset, 0.0],
                [x + size, offset + 0.7 * size, 0.0],
                [x, offset, 0.3 * size],
            ]);
            soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
            soup.face_class.push(0);
        }
        soup
    }

    #[test]
    fn no_child_sticks_out_of_its_box_and_boxes_are_at_most_two_steps_larger() {
        for (faces, offset) in [(0, 0.0), (1, 0.0), (5, -3.0), (300, 0.0), (300, 4e5), (300, -1e4)]
        {
            let bvh = Bvh::build(&soup(faces, offset), 50.0);
            let exact = collapse(&bvh);
            let nodes = QuantizedNode::tree(&bvh);
            assert_eq!(exact.len(), nodes.len());
            let mut triangles = 0;
            for (exact, node) in exact.iter().zip(&nodes) {
                for (slot, child) in exact.iter().enumerate() {
                    let Some((item, want)) = child else {
                        assert_eq!(node.children[slot], 0);
                        continue;
                    };
                    triangles += usize::from(item & TRIANGLE != 0);
                    assert_eq!(node.children[slot], *item);
                    let got = sides(node, slot);
                    for axis in 0..3 {
                        let [low, high] = [2 * axis, 2 * axis + 1];
                        assert!(got[low] <= want[low] && want[high] <= got[high]);
                        let spare = want[low] - got[low] + got[high] - want[high];
                        let rounding = 4.0 * f32::EPSILON * want[high].abs();
                        assert!(spare <= 2.0 * node.step[axis] + rounding);
                    }
                }
                for axis in 0..3 {
                    assert_eq!(node.step[axis].to_bits() & 0x007f_ffff, 0, "not a power of two");
                }
            }
            assert_eq!(triangles, faces as usize);
        }
    }
}
