use super::{Bvh, MAX_DEPTH, Triangle};

/// Children of a node.
pub(super) const WIDTH: usize = 4;
/// Vectors of an item's unit of address: a triangle is one, a node two.
pub const UNIT: usize = 4;
const NODE_UNITS: u32 = 2;
/// Bit of an item that marks a triangle.
pub const TRIANGLE: u32 = 1 << 31;
/// Entries of a traversal stack: each level leaves at most all children but one behind, and a leaf of
/// the binary tree may become a level more.
pub const STACK: usize = (WIDTH - 1) * (MAX_DEPTH + 1);
/// Corners of an empty box: outside of all scenes, and finite even when divided by a direction.
const OUTSIDE: f32 = 1e15;

/// The tree for packets on a device, in vectors of four numbers: nodes, then triangles.
///
/// A node is eight vectors: for each axis the lower sides of its children's boxes and the upper ones,
/// the children, and nothing. A triangle is four, which hold [`Triangle`] as it is. An item is the
/// address of a node or, with [`TRIANGLE`], of a triangle, in units of four vectors; the root is item
/// 0. Boxes are padded as the binary tree's, and every triangle has one of its own.
#[derive(Debug, Clone)]
pub struct Quads {
    /// Nodes and triangles.
    pub texels: Vec<[f32; 4]>,
}

#[derive(Clone, Copy)]
enum Child {
    Inner { node: usize, count: usize },
    Triangle(usize),
}

/// Lower and upper side by axis.
pub(super) type Sides = [f32; 6];
const EMPTY: Sides = [OUTSIDE, -OUTSIDE, OUTSIDE, -OUTSIDE, OUTSIDE, -OUTSIDE];

/// Boxes and items of a node's children: a triangle's index with [`TRIANGLE`], or a node's index.
pub(super) type FourNode = [Option<(u32, Sides)>; WIDTH];

impl Quads {
    /// Writes the binary tree, its nodes merged into nodes of four.
    pub fn new(bvh: &Bvh) -> Self {
        let nodes = collapse(bvh);
        let texel = |node: &FourNode, side: usize| {
            node.map(|child| child.map_or(EMPTY[side], |(_, sides)| sides[side]))
        };
        // Triangles come after the nodes.
        let first = nodes.len() as u32 * NODE_UNITS;
        let mut texels = Vec::with_capacity(UNIT * (first as usize + bvh.triangles.len()));
        for node in &nodes {
            texels.extend((0..6).map(|side| texel(node, side)));
            texels.push(node.map(|child| {
                let item = child.map_or(0, |(item, _)| item);
                f32::from_bits(if item & TRIANGLE != 0 { item + first } else { item * NODE_UNITS })
            }));
            texels.push([0.0; 4]);
        }
        texels.extend_from_slice(bytemuck::cast_slice::<Triangle, [f32; 4]>(&bvh.triangles));
        Self { texels }
    }
}

/// Merges the binary tree's nodes into nodes of four: each takes over the grandchildren of its largest
/// child for as long as there is room, and the triangles of leaves. The root comes first, also of a tree
/// without triangles.
pub(super) fn collapse(bvh: &Bvh) -> Vec<FourNode> {
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

    /// Triangles below an item, each inside the boxes above it; and how deep it is.
    fn below(quads: &Quads, item: u32, found: &mut Vec<Triangle>, outer: Option<Sides>) -> usize {
        let at = (item & !TRIANGLE) as usize * UNIT;
        if item & TRIANGLE != 0 {
            let triangle: Triangle = bytemuck::cast_slice(&quads.texels[at..at + UNIT])[0];
            for corner in [triangle.a, triangle.b, triangle.c] {
                for axis in 0..3 {
                    let sides = outer.unwrap();
                    assert!((sides[2 * axis]..=sides[2 * axis + 1]).contains(&corner[axis]));
                }
            }
            found.push(triangle);
            return 0;
        }
        let node = &quads.texels[at..at + 8];
        let mut depth = 0;
        let child = |slot: usize| -> (Sides, f32) {
            (std::array::from_fn(|side| node[side][slot]), node[6][slot])
        };
        for (own, item) in (0..WIDTH).map(child) {
            if own[0] > own[1] {
                continue;
            }
            for axis in 0..3 {
                let outer =
                    outer.unwrap_or([-OUTSIDE, OUTSIDE, -OUTSIDE, OUTSIDE, -OUTSIDE, OUTSIDE]);
                assert!(
                    outer[2 * axis] <= own[2 * axis] && own[2 * axis + 1] <= outer[2 * axis + 1]
                );
            }
            depth = depth.max(below(quads, item.to_bits(), found, Some(own)));
        }
        depth + 1
    }

    #[test]
    fn every_triangle_is_below_one_item_inside_all_boxes_above() {
        // From none over a single leaf to many, with a heap of equal ones that no plane separates.
        for faces in [0, 1, 3, 4, 5, 200] {
            let mut soup = TriangleSoup::default();
            for face in 0..faces {
                let x = if face % 3 == 0 { 1.0 } else { face as f32 };
                soup.vertices.extend([[x, 0.0, 0.0], [x + 1.0, 2.0, 0.0], [x, 1.0, 3.0]]);
                soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
                soup.face_class.push(0);
            }
            let bvh = Bvh::build(&soup, 50.0);
            let quads = Quads::new(&bvh);
            let mut found = Vec::new();
            let depth = below(&quads, 0, &mut found, None);
            assert!((WIDTH - 1) * depth <= STACK);
            found.sort_by_key(|triangle| triangle.prim);
            let mut all = bvh.triangles.clone();
            all.sort_by_key(|triangle| triangle.prim);
            assert_eq!(found, all);
        }
    }
}
