use super::{Bvh, MAX_DEPTH, Triangle};

/// Children of a node.
pub(crate) const WIDTH: usize = 4;
/// Vectors of an item.
pub const UNIT: usize = 4;
/// The root.
pub const ROOT: u32 = 1;
/// Steps from the lower corner of the scene to the upper one, at most.
const STEPS: f64 = 65_535.0;
/// Bit of an item that marks a triangle.
pub const TRIANGLE: u32 = 1 << 31;
/// Bit of a node's word from which on each of its children has one that says whether it is a triangle.
pub const KINDS: u32 = 28;
/// Entries of a traversal stack: each level leaves at most one for its children, and a leaf of the binary
/// tree may become a level more.
pub const STACK: usize = MAX_DEPTH + 1;

/// The tree for packets on a device, in items of four vectors of four words: a header, then nodes and
/// triangles.
///
/// Sides of boxes are whole numbers of steps from the lower corner of the scene, 16 bits each; a step is a
/// power of two, and boxes are those of the binary tree rounded outwards. The header holds that corner and
/// the steps. A triangle lies there as [`Triangle`] does, and has a box of its own. A node's children lie
/// side by side, so that all of them that are still to be visited fit in two words. It holds for each axis
/// their sides, the lower one in the lower half of a word; then the item of the first child, with the
/// kinds of all from bit [`KINDS`] on, and how many there are.
#[derive(Debug, Clone)]
pub struct Quads {
    /// Four to an item.
    pub texels: Vec<[u32; 4]>,
}

#[derive(Clone, Copy)]
enum Child {
    Inner { node: usize, count: usize },
    Triangle(usize),
}

/// Lower and upper side by axis.
pub(crate) type Sides = [f32; 6];
/// Sides of no box: the lower one is the last step, the upper one the first.
const EMPTY: u32 = 0xffff;

/// Boxes and items of a node's children: a triangle's index with [`TRIANGLE`], or a node's index.
pub(crate) type FourNode = [Option<(u32, Sides)>; WIDTH];

impl Quads {
    /// Writes the binary tree, its nodes merged into nodes of four.
    pub fn new(bvh: &Bvh) -> Self {
        let nodes = collapse(bvh);
        let grid: [Grid; 3] = std::array::from_fn(|axis| Grid::new(&nodes[0], axis));
        let header = |of: fn(&Grid) -> f32| {
            let [x, y, z] = [0, 1, 2].map(|axis| of(&grid[axis]).to_bits());
            [x, y, z, 0]
        };
        let items = ROOT as usize + nodes.len() + bvh.triangles.len();
        let mut texels = Vec::with_capacity(UNIT * items);
        texels.extend([header(|grid| grid.corner), header(|grid| grid.step), [0; 4], [0; 4]]);
        texels.resize(UNIT * (ROOT as usize + 1), [0; 4]);
        let mut work = vec![(0, ROOT)];
        while let Some((node, item)) = work.pop() {
            let first = (texels.len() / UNIT) as u32;
            let (mut kinds, mut count) = (0, 0);
            let mut sides = [[EMPTY; WIDTH]; 3];
            let inner = work.len();
            for &(child, own) in nodes[node].iter().flatten() {
                for (sides, grid) in sides.iter_mut().zip(&grid) {
                    sides[count] = grid.sides(&own);
                }
                if child & TRIANGLE == 0 {
                    work.push((child as usize, first + count as u32));
                    texels.extend([[0; 4]; UNIT]);
                } else {
                    kinds |= 1 << count;
                    let triangle = bvh.triangles[(child ^ TRIANGLE) as usize];
                    texels.extend(bytemuck::cast::<Triangle, [[u32; 4]; UNIT]>(triangle));
                }
                count += 1;
            }
            // What is below the first child follows at once.
            work[inner..].reverse();
            let at = UNIT * item as usize;
            texels[at..at + 3].copy_from_slice(&sides);
            texels[at + 3] = [first | kinds << KINDS, count as u32, 0, 0];
        }
        Self { texels }
    }
}

/// The steps along an axis.
struct Grid {
    axis: usize,
    corner: f32,
    step: f32,
}

impl Grid {
    /// Steps over the boxes of the root's children.
    fn new(root: &FourNode, axis: usize) -> Self {
        let sides = || root.iter().flatten().map(|(_, sides)| sides);
        let low = sides().map(|sides| sides[2 * axis]).fold(f32::INFINITY, f32::min);
        let high = sides().map(|sides| sides[2 * axis + 1]).fold(f32::NEG_INFINITY, f32::max);
        if low > high {
            return Self { axis, corner: 0.0, step: 1.0 };
        }
        let step = ((f64::from(high) - f64::from(low)) / STEPS).max(f64::from(f32::MIN_POSITIVE));
        Self { axis, corner: low, step: step.log2().ceil().exp2() as f32 }
    }

    /// Both sides of a box in steps, rounded outwards: differences and quotients are exact enough in
    /// `f64`, since the corner is an `f32` and the step a power of two.
    fn sides(&self, sides: &Sides) -> u32 {
        let steps = |side: f32| (f64::from(side) - f64::from(self.corner)) / f64::from(self.step);
        let low = steps(sides[2 * self.axis]).floor().clamp(0.0, STEPS) as u32;
        let high = steps(sides[2 * self.axis + 1]).ceil().clamp(0.0, STEPS) as u32;
        low | high << 16
    }
}

/// Merges the binary tree's nodes into nodes of four: each takes over the grandchildren of its largest
/// child for as long as there is room, and the triangles of leaves. The root comes first, also of a tree
/// without triangles.
pub(crate) fn collapse(bvh: &Bvh) -> Vec<FourNode> {
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

/// Up to four descendants of a binary node that together hold all below it.
fn children(bvh: &Bvh, from: usize) -> Vec<(Child, Sides)> {
    let inner = |node: usize| {
        let own = &bvh.nodes[node];
        let count = if own.count > 0 { own.count as usize } else { 2 };
        (Child::Inner { node, count }, sides(own.min, own.max))
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
                (Child::Triangle(triangle), sides(bounds.min.into(), bounds.max.into()))
            }));
        }
    }
}

fn sides(min: [f32; 3], max: [f32; 3]) -> Sides {
    [min[0], max[0], min[1], max[1], min[2], max[2]]
}

fn half_area(sides: &Sides) -> f32 {
    let [x, y, z] = [0, 2, 4].map(|side| sides[side + 1] - sides[side]);
    x * y + y * z + z * x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::TriangleSoup;

    /// Lower and upper side by axis in metres, as the steps say.
    fn sides(quads: &Quads, at: usize, slot: usize) -> [f64; 6] {
        let mut sides = [0.0; 6];
        for axis in 0..3 {
            let word = quads.texels[at + axis][slot];
            let [corner, step] =
                [0, 1].map(|row| f64::from(f32::from_bits(quads.texels[row][axis])));
            sides[2 * axis] = corner + f64::from(word & 0xffff) * step;
            sides[2 * axis + 1] = corner + f64::from(word >> 16) * step;
        }
        sides
    }

    /// Triangles below an item, each inside the boxes above it; and how deep it is.
    fn below(
        quads: &Quads,
        item: u32,
        found: &mut Vec<Triangle>,
        outer: Option<[f64; 6]>,
    ) -> usize {
        let at = (item & !TRIANGLE) as usize * UNIT;
        if item & TRIANGLE != 0 {
            let triangle: Triangle = bytemuck::cast_slice(&quads.texels[at..at + UNIT])[0];
            for corner in [triangle.a, triangle.b, triangle.c] {
                for axis in 0..3 {
                    let sides = outer.unwrap();
                    let within = sides[2 * axis]..=sides[2 * axis + 1];
                    assert!(within.contains(&f64::from(corner[axis])));
                }
            }
            found.push(triangle);
            return 0;
        }
        let mut depth = 0;
        let [word, count, ..] = quads.texels[at + 3];
        for slot in 0..count as usize {
            let own = sides(quads, at, slot);
            for axis in 0..3 {
                let [low, high] = [2 * axis, 2 * axis + 1];
                assert!(outer.is_none_or(|o| o[low] <= own[low] && own[high] <= o[high]));
            }
            let kind = word >> (KINDS as usize + slot) & 1;
            let item = (word & ((1 << KINDS) - 1)) + slot as u32 + kind * TRIANGLE;
            depth = depth.max(below(quads, item, found, Some(own)));
        }
        depth + 1
    }

    #[test]
    fn every_triangle_is_below_one_item_inside_all_boxes_above() {
        // From none over a single leaf to many, with a heap of equal ones that no plane separates, near
        // the origin and far from it.
        for (faces, far) in
            [(0, 0.0), (1, 0.0), (3, 0.0), (4, -3e4), (5, 0.0), (200, 0.0), (200, 4e5)]
        {
            let mut soup = TriangleSoup::default();
            for face in 0..faces {
                let x = far + if face % 3 == 0 { 1.0 } else { face as f32 };
                soup.vertices.extend([
                    [x, far, 0.0],
                    [x + 1.0, far + 2.0, 0.0],
                    [x, far + 1.0, 3.0],
                ]);
                soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
                soup.face_class.push(0);
            }
            let bvh = Bvh::build(&soup, 50.0);
            let quads = Quads::new(&bvh);
            let mut found = Vec::new();
            let depth = below(&quads, ROOT, &mut found, None);
            assert!(depth <= STACK);
            assert_eq!(quads.texels.len(), quads.texels.capacity());
            found.sort_by_key(|triangle| triangle.prim);
            let mut all = bvh.triangles.clone();
            all.sort_by_key(|triangle| triangle.prim);
            assert_eq!(found, all);
        }
    }
}
