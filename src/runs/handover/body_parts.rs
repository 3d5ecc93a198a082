//! Boxes around the parts of the own body: triangles that share corners are one part.

use std::collections::HashMap;
use std::ops::Range;

/// Lower and upper corner, metres.
pub(super) type BoxCorners = [[f64; 3]; 2];

/// Boxes of parts, at most: a pipeline has a node for each.
const MOST_BOXES: usize = 16;

/// The box around some corners; `None` of none.
pub(super) fn around<'a>(corners: impl IntoIterator<Item = &'a [f32; 3]>) -> Option<BoxCorners> {
    let each = corners.into_iter().map(|corner| [corner.map(f64::from); 2]);
    each.reduce(joined)
}

fn joined([low, high]: BoxCorners, [from, to]: BoxCorners) -> BoxCorners {
    [[0, 1, 2].map(|k| low[k].min(from[k])), [0, 1, 2].map(|k| high[k].max(to[k]))]
}

/// A box around each part of each shape, without those inside another; a box a shape where there would be more than 16.
pub(super) fn boxes_of(
    body: &[[[f32; 3]; 3]],
    shapes: impl IntoIterator<Item = Range<usize>>,
) -> Vec<BoxCorners> {
    let shapes: Vec<_> = shapes.into_iter().map(|shape| &body[shape]).collect();
    let parts: Vec<BoxCorners> = shapes.iter().flat_map(|shape| parts(shape)).collect();
    let parts = outermost(&parts);
    match parts.len() > MOST_BOXES {
        true => shapes.iter().filter_map(|shape| around(shape.iter().flatten())).collect(),
        false => parts,
    }
}

/// Boxes that lie in no other; of equal ones the first.
fn outermost(all: &[BoxCorners]) -> Vec<BoxCorners> {
    let is_inside = |one: &BoxCorners, other: &BoxCorners| joined(*one, *other) == *other;
    let is_kept = |(k, one): &(usize, &BoxCorners)| {
        let others = all.iter().enumerate().filter(|(other, _)| other != k);
        !others.into_iter().any(|(at, other)| is_inside(one, other) && (*one != other || at < *k))
    };
    all.iter().enumerate().filter(is_kept).map(|(_, one)| *one).collect()
}

/// A box around each part, in the order of their first triangles.
fn parts(triangles: &[[[f32; 3]; 3]]) -> Vec<BoxCorners> {
    // Corners by position: STL files have no common vertices. Each points towards the first of its part.
    let (mut number, mut first) = (HashMap::new(), Vec::new());
    let mut corners = Vec::with_capacity(triangles.len());
    for triangle in triangles {
        let at = triangle.map(|corner| {
            // −0 is 0.
            let at = *number.entry(corner.map(|v| (v + 0.0).to_bits())).or_insert(first.len());
            first.extend((at == first.len()).then_some(at));
            at
        });
        let root = at.map(|at| root_of(&mut first, at)).into_iter().min().unwrap_or(at[0]);
        for corner in at {
            let other = root_of(&mut first, corner);
            first[other] = root;
        }
        corners.push(at[0]);
    }
    let (mut place, mut boxes) = (HashMap::new(), Vec::<BoxCorners>::new());
    for (triangle, corner) in triangles.iter().zip(corners) {
        let Some(own) = around(triangle) else { continue };
        let at = *place.entry(root_of(&mut first, corner)).or_insert(boxes.len());
        match boxes.get_mut(at) {
            Some(known) => *known = joined(*known, own),
            None => boxes.push(own),
        }
    }
    boxes
}

/// The corner that stands for a part; the way to it is shortened.
fn root_of(first: &mut [usize], mut at: usize) -> usize {
    while first[at] != at {
        first[at] = first[first[at]];
        at = first[at];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Four faces of a box, whose triangles share corners; the last ones join the first.
    fn tube([low, high]: BoxCorners) -> Vec<[[f32; 3]; 3]> {
        let corner = |k: usize| {
            let at = |axis: usize| if k >> axis & 1 == 0 { low[axis] } else { high[axis] };
            [at(0), at(1), at(2)].map(|v| v as f32)
        };
        let faces = [[0, 1, 5], [0, 5, 4], [2, 3, 7], [2, 7, 6], [0, 2, 6], [1, 3, 7]];
        faces.map(|face| face.map(corner)).to_vec()
    }

    const BUS: BoxCorners = [[-6.0, -1.25, 0.0], [6.0, 1.25, 3.0]];
    const MIRROR: BoxCorners = [[5.5, 1.25, 1.5], [5.75, 1.5, 2.0]];
    const SEAT: BoxCorners = [[0.0, -0.5, 0.5], [0.5, 0.5, 1.5]];

    #[test]
    fn each_part_of_a_mesh_has_a_box_and_parts_inside_have_none() {
        let mesh = [tube(SEAT), tube(BUS), tube(MIRROR)].concat();
        // The mirror touches the side of the bus, but shares no corner with it.
        assert_eq!(boxes_of(&mesh, std::iter::once(0..mesh.len())), [BUS, MIRROR]);
        let mut turned = mesh.clone();
        turned.reverse();
        assert_eq!(boxes_of(&turned, [0..6, 6..18]), [MIRROR, BUS]);
        assert_eq!(boxes_of(&[mesh.clone(), mesh].concat(), [0..18, 18..36]), [BUS, MIRROR]);
    }

    #[test]
    fn a_mesh_of_many_parts_has_one_box() {
        let part = |k: usize| {
            let x = k as f64;
            tube([[x, 0.0, 0.0], [x + 0.5, 1.0, 1.0]])
        };
        let mesh: Vec<_> = (0..17).flat_map(part).collect();
        assert_eq!(boxes_of(&mesh, std::iter::once(0..mesh.len())), [[[0.0; 3], [16.5, 1.0, 1.0]]]);
        assert_eq!(boxes_of(&mesh, std::iter::once(0..6 * 16)).len(), 16);
    }
}
