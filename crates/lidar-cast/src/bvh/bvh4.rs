//! The tree that devices walk: four children a node of 64 bytes, their boxes in steps of one byte.
//!
//! Boxes take half their size in `f32`: a GPU waits for memory, not for arithmetic.
//! (Ylitie, Karras, Laine: "Efficient incoherent ray traversal on GPUs through compressed wide BVHs",
//! HPG 2017; departures: four children instead of eight, triangles as children instead of ranges.)
//!
//! | bytes | field | holds |
//! |---|---|---|
//! | 0–11 | `corner` | lower corner of the common box of all children, x y z in metres |
//! | 12–15 | `low_x` | lower sides along x: child k in bits 8k to 8k + 7, in steps from the corner |
//! | 16–27 | `step` | metres a step along x y z, powers of two |
//! | 28–31 | `low_y` | lower sides along y |
//! | 32–43 | `high` | upper sides along x y z, as the lower ones |
//! | 44–47 | `low_z` | lower sides along z |
//! | 48–63 | `children` | bit 31 set: triangle of the index in bits 0 to 30; clear: node; 0: no child |
//!
//! Example: `corner.x` 10, `step.x` 0.25, `low_x` 0x0000_0804, `high[0]` 0x0000_ff08: child 0 reaches from
//! 10 + 4 · 0.25 = 11 m to 10 + 8 · 0.25 = 12 m, child 1 from 12 m to 73.75 m. `children`
//! [0x8000_0007, 3, 0, 0]: child 0 is triangle 7, child 1 is node 3, and there are no more. The root is
//! node 0, which is nobody's child.
//!
//! # Why no triangle is missed
//! A device finds the distance to a side as (corner − origin) · inverse + steps · (step · inverse), merged and rounded
//! as its driver likes. Times the direction's component, that is wrong by at most u (3 |corner − origin| + 2 steps ·
//! step) metres, with u = 2⁻²⁴. A step is a power of two, so that its product with the inverse is exact. The distance
//! to a triangle's own box, which `intersect` clamps a hit to, is wrong by 2 u |side − origin|.
//!
//! Let L be the largest coordinate. No sensor is farther than the range R from the sphere around a tree, so that
//! |corner − origin| ≤ 3.8 L + R. All errors together are less than 24 u (L + R), and with the roundings of the host
//! less than 27 u (L + R). Boxes are grown by twice the tree's pad, which is 16 u (L + R). Flushed denormals move a
//! side by less than 2⁻¹¹⁷ m, and pads are at least 2⁻¹⁰⁰ m, or the host casts.

use bytemuck::{Pod, Zeroable};

use super::Bvh;

/// Children of a node.
const WIDTH: usize = 4;
/// Steps across the common box of a node's children, at most: a byte.
const STEPS: u32 = 255;
/// Pads of a tree by which boxes are grown beyond its own, see the module.
const ROOM: f32 = 2.0;
/// Bit of a child that marks a triangle.
pub(crate) const TRIANGLE: u32 = 1 << 31;

/// Lower and upper side by axis with room: x low, x high, y low, y high, z low, z high.
type Sides = [f32; 6];

/// The children of a node with their boxes.
type ExactNode = [Option<(u32, Sides)>; WIDTH];

/// One node, 64 bytes; see the module for each bit.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub(crate) struct QuantizedNode {
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
    /// Children: index of a node, index of a triangle with bit 31 set, or 0 for none.
    pub children: [u32; WIDTH],
}

/// A tree of nodes with four children; triangles stay in the order of the binary tree's leaves.
#[derive(Debug, Clone)]
pub(crate) struct Bvh4 {
    /// The root first, also of a tree without triangles; children after their parents.
    pub nodes: Vec<QuantizedNode>,
}

impl Bvh4 {
    /// Merges the nodes of a binary tree into nodes of four.
    pub(crate) fn new(bvh: &Bvh) -> Self {
        Self { nodes: collapse(bvh).iter().map(QuantizedNode::new).collect() }
    }

    /// Counts nodes and triangles from others on: where several trees lie in one buffer.
    pub(crate) fn move_to(&mut self, first_node: u32, first_triangle: u32) {
        for child in self.nodes.iter_mut().flat_map(|node| &mut node.children) {
            if *child != 0 {
                *child += if *child < TRIANGLE { first_node } else { first_triangle };
            }
        }
    }
}

impl QuantizedNode {
    fn new(node: &ExactNode) -> Self {
        let children = node.map(|child| child.map_or(0, |(item, _)| item));
        let (mut low, mut high) = ([0; 3], [0; 3]);
        let (mut corner, mut step) = ([0.0; 3], [1.0; 3]);
        for axis in 0..3 {
            let sides = || node.iter().flatten().map(|(_, sides)| sides);
            let lowest = sides().map(|s: &Sides| s[2 * axis]).fold(f32::INFINITY, f32::min);
            let highest = sides().map(|s| s[2 * axis + 1]).fold(f32::NEG_INFINITY, f32::max);
            if lowest > highest {
                continue;
            }
            (corner[axis], step[axis]) = (lowest, step_over(lowest, highest));
            for (slot, child) in node.iter().enumerate() {
                let Some((_, sides)) = child else { continue };
                let side = [sides[2 * axis], sides[2 * axis + 1]];
                let [first, last] = steps_of(side, lowest, step[axis]);
                low[axis] |= first << (8 * slot);
                high[axis] |= last << (8 * slot);
            }
        }
        let [low_x, low_y, low_z] = low;
        Self { corner, low_x, step, low_y, high, low_z, children }
    }
}

/// A side as the kernel computes it.
fn plane(corner: f32, steps: u32, step: f32) -> f32 {
    corner + steps as f32 * step
}

/// Steps from the corner to a lower and an upper side, rounded outwards.
fn steps_of([low, high]: [f32; 2], corner: f32, step: f32) -> [u32; 2] {
    let steps = |to: f32| (f64::from(to) - f64::from(corner)) / f64::from(step);
    let mut first = steps(low).floor() as u32;
    while plane(corner, first, step) > low {
        first -= 1;
    }
    // The last step may reach the side only because its plane is rounded up.
    let mut last = (steps(high).ceil() as u32).min(STEPS);
    while plane(corner, last, step) < high {
        last += 1;
    }
    [first, last]
}

/// Smallest power of two, [`STEPS`] times which reaches from one side to the other.
fn step_over(low: f32, high: f32) -> f32 {
    let step = ((high - low) / STEPS as f32).max(f32::MIN_POSITIVE);
    // Without its fraction bits a number is the power of two at or below.
    let mut step = f32::from_bits(step.to_bits() & 0x7f80_0000);
    while plane(low, STEPS, step) < high {
        step *= 2.0;
    }
    step
}

#[derive(Clone, Copy)]
enum Child {
    /// Binary node, and the children that replace it.
    Inner {
        node: usize,
        count: usize,
    },
    Triangle(usize),
}

/// Merges the binary tree's nodes into nodes of four: a node replaces its largest child by that child's
/// children, or by the triangles of a leaf, until no replacement fits.
fn collapse(bvh: &Bvh) -> Vec<ExactNode> {
    let mut nodes = vec![[None; WIDTH]];
    let mut work: Vec<(usize, usize)> = if bvh.nodes.is_empty() { vec![] } else { vec![(0, 0)] };
    while let Some((from, at)) = work.pop() {
        for (slot, (child, sides)) in children(bvh, from).into_iter().enumerate() {
            let item = match child {
                Child::Triangle(triangle) => TRIANGLE | triangle as u32,
                Child::Inner { node, .. } => {
                    work.push((node, nodes.len()));
                    nodes.push([None; WIDTH]);
                    nodes.len() as u32 - 1
                }
            };
            nodes[at][slot] = Some((item, sides));
        }
    }
    nodes
}

/// Up to four descendants of a binary node that together hold every triangle below it.
fn children(bvh: &Bvh, from: usize) -> Vec<(Child, Sides)> {
    let room = ROOM * bvh.pad;
    let inner = |node: usize| {
        let own = &bvh.nodes[node];
        let count = if own.count > 0 { own.count as usize } else { 2 };
        (Child::Inner { node, count }, sides(own.min, own.max, room))
    };
    let mut children = vec![inner(from)];
    loop {
        let fits = |child: &Child| match child {
            Child::Inner { count, .. } => children.len() + count - 1 <= WIDTH,
            Child::Triangle(_) => false,
        };
        let open = children.iter().enumerate().filter(|(_, (child, _))| fits(child));
        let largest = open.max_by(|a, b| half_area(&a.1.1).total_cmp(&half_area(&b.1.1)));
        let Some((slot, &(Child::Inner { node, .. }, _))) = largest else { return children };
        children.remove(slot);
        let node = &bvh.nodes[node];
        let first = node.first as usize;
        if node.count == 0 {
            children.extend([inner(first), inner(first + 1)]);
        } else {
            children.extend((first..first + node.count as usize).map(|triangle| {
                let bounds = Bvh::padded_box(&bvh.triangles[triangle], bvh.pad);
                (Child::Triangle(triangle), sides(bounds.min.into(), bounds.max.into(), room))
            }));
        }
    }
}

/// Sides of a box, moved outwards by `room`.
fn sides(min: [f32; 3], max: [f32; 3], room: f32) -> Sides {
    let (min, max) = (min.map(|side| side - room), max.map(|side| side + room));
    [min[0], max[0], min[1], max[1], min[2], max[2]]
}

fn half_area(sides: &Sides) -> f32 {
    let [x, y, z] = [0, 2, 4].map(|side| sides[side + 1] - sides[side]);
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::Ray;
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
            let nodes = Bvh4::new(&bvh).nodes;
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
    /// Where a ray is inside a child's box, as a device finds it that fuses or one that does not.
    fn interval(ray: &Ray, node: &QuantizedNode, slot: usize, fuses: bool) -> [f32; 2] {
        let low = [node.low_x, node.low_y, node.low_z];
        let (mut enter, mut leave) = (0.0_f32, ray.t_max);
        for (axis, low) in low.into_iter().enumerate() {
            let (inverse, origin) = (ray.inverse[axis], ray.origin[axis]);
            let (begin, step) = ((node.corner[axis] - origin) * inverse, node.step[axis] * inverse);
            let side = |word: u32| {
                let steps = (word >> (8 * slot) & 0xff) as f32;
                if fuses { steps.mul_add(step, begin) } else { steps * step + begin }
            };
            let (t0, t1) = (side(low), side(node.high[axis]));
            enter = enter.max(t0.min(t1));
            leave = leave.min(t0.max(t1));
        }
        [enter, leave]
    }

    /// Triangles in whose boxes a ray is, among those that a device reaches.
    fn reached(ray: &Ray, bvh: &Bvh, nodes: &[QuantizedNode], fuses: bool) -> usize {
        let (mut count, mut stack) = (0, vec![0]);
        while let Some(at) = stack.pop() {
            let node: &QuantizedNode = &nodes[at];
            for (slot, &child) in node.children.iter().enumerate() {
                let [enter, leave] = interval(ray, node, slot, fuses);
                if child == 0 || enter > leave {
                    continue;
                }
                if child < TRIANGLE {
                    stack.push(child as usize);
                } else {
                    count += usize::from(is_in_box(ray, bvh, (child ^ TRIANGLE) as usize));
                }
            }
        }
        count
    }

    fn is_in_box(ray: &Ray, bvh: &Bvh, triangle: usize) -> bool {
        let bounds = Bvh::padded_box(&bvh.triangles[triangle], bvh.pad);
        let (enter, leave) = ray.slab(bounds.min, bounds.max);
        enter <= leave.min(ray.t_max)
    }

    #[test]
    fn a_device_reaches_every_triangle_in_whose_box_a_ray_is() {
        let mut inside = 0;
        for offset in [0.0, 4e5, -1e4] {
            let range = 200.0;
            let bvh = Bvh::build(&soup(150, offset), range);
            let nodes = Bvh4::new(&bvh).nodes;
            for number in 0..4000 {
                let share = |salt: u64| {
                    let bits = crate::maths::mixed(number << 8 | salt) >> 40;
                    bits as f32 / (1 << 24) as f32 - 0.5
                };
                // Towards a corner of some box, level or along an axis now and then.
                let triangle = &bvh.triangles[number as usize % 150];
                let corner = Vec3::from(if number % 2 == 0 { triangle.a } else { triangle.c });
                let mut direction = Vec3::new(share(1), share(2), share(3));
                for axis in 0..3 {
                    if (number >> axis) % 3 == 0 && number % 5 != axis {
                        direction[axis as usize] = 0.0;
                    }
                }
                if direction == Vec3::ZERO {
                    direction = Vec3::X;
                }
                let direction = direction.normalize();
                let beside = bvh.pad * [0.0, 1.0, -1.0, 0.999_999][number as usize % 4];
                let origin = corner - 100.0 * (share(4) + 0.5) * direction + Vec3::splat(beside);
                let ray = Ray::new(origin, direction, range);
                let want = (0..150).filter(|&t| is_in_box(&ray, &bvh, t)).count();
                inside += want;
                for fuses in [true, false] {
                    assert_eq!(reached(&ray, &bvh, &nodes, fuses), want, "ray {number}, {ray:?}");
                }
            }
        }
        assert!(inside > 20_000, "{inside} boxes: trivial rays");
    }
}
