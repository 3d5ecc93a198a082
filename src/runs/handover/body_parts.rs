//! Boxes around the parts of the own body: triangles that share corners are one part.

use std::collections::HashMap;
use std::ops::Range;

use crate::near_field::Footprint;

/// Lower and upper corner, metres.
pub(super) type BoxCorners = [[f64; 3]; 2];

/// Boxes of parts, at most: a pipeline has a node for each.
const MOST_BOXES: usize = 16;
/// Boxes of one part, at most; a part has one while that is at most so many times its area from above, or little larger.
const MOST_SLICES: usize = 8;
const WIDER: f64 = 1.3;
/// Square metres by which a box may always be larger than its part.
const LITTLE: f64 = 0.5;

/// The box around some corners; `None` of none.
pub(super) fn around<'a>(corners: impl IntoIterator<Item = &'a [f32; 3]>) -> Option<BoxCorners> {
    let each = corners.into_iter().map(|corner| [corner.map(f64::from); 2]);
    each.reduce(joined)
}

fn joined([low, high]: BoxCorners, [from, to]: BoxCorners) -> BoxCorners {
    [[0, 1, 2].map(|k| low[k].min(from[k])), [0, 1, 2].map(|k| high[k].max(to[k]))]
}

/// A box around each part of each shape, without those inside another; a box a shape where there would be more than 16. Parts
/// are cut into slices one after the other, as long as there are no more than 16 boxes in all.
pub(super) fn boxes_of(
    body: &[[[f32; 3]; 3]],
    shapes: impl IntoIterator<Item = Range<usize>>,
) -> Vec<BoxCorners> {
    let shapes: Vec<_> = shapes.into_iter().map(|shape| &body[shape]).collect();
    let parts: Vec<_> = shapes.iter().flat_map(|shape| parts(shape)).collect();
    let whole = |part: &Vec<[[f32; 3]; 3]>| around(part.iter().flatten()).into_iter().collect();
    let mut boxes: Vec<Vec<BoxCorners>> = parts.iter().map(whole).collect();
    let mut outer = outermost(&boxes.concat());
    if outer.len() > MOST_BOXES {
        return shapes.iter().filter_map(|shape| around(shape.iter().flatten())).collect();
    }
    for (k, part) in parts.iter().enumerate() {
        if !boxes[k].iter().all(|whole| outer.contains(whole)) {
            continue;
        }
        let cut = slices(part, MOST_SLICES.min(1 + MOST_BOXES - outer.len()));
        if cut.len() < 2 {
            continue;
        }
        let whole = std::mem::replace(&mut boxes[k], cut);
        // Smaller parts beside the slices may have been in the whole box.
        let with_slices = outermost(&boxes.concat());
        if with_slices.len() <= MOST_BOXES {
            outer = with_slices;
        } else {
            boxes[k] = whole;
        }
    }
    outer
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

/// Boxes around a part: one, or for a part that is turned in plan as few slices of equal length along its longer side as come
/// near its area from above, `most` at most.
fn slices(part: &[[[f32; 3]; 3]], most: usize) -> Vec<BoxCorners> {
    let Some(whole) = around(part.iter().flatten()) else { return Vec::new() };
    let flat = |&[x, y, _]: &[f32; 3]| [f64::from(x), f64::from(y)];
    let hull = Footprint::of(part.iter().flatten().map(flat));
    let own = hull.map_or(0.0, |hull| hull.area());
    let area = |boxes: &[BoxCorners]| -> f64 {
        boxes.iter().map(|[low, high]| (high[0] - low[0]) * (high[1] - low[1])).sum()
    };
    let is_close = |boxes: &[BoxCorners]| area(boxes) <= (WIDER * own).max(own + LITTLE);
    let axis = usize::from(whole[1][1] - whole[0][1] > whole[1][0] - whole[0][0]);
    let cut = |count: usize| -> Vec<BoxCorners> {
        let end = |k: usize| {
            let share = k as f64 / count as f64;
            whole[0][axis] + share * (whole[1][axis] - whole[0][axis])
        };
        (0..count).filter_map(|k| slice(part, axis, [end(k), end(k + 1)])).collect()
    };
    let mut boxes = vec![whole];
    let mut count = 1;
    while count < most && !is_close(&boxes) {
        count += 1;
        boxes = cut(count);
    }
    boxes
}

/// The box around the part of some triangles between two places along an axis; `None` where none reaches in.
fn slice(triangles: &[[[f32; 3]; 3]], axis: usize, [from, to]: [f64; 2]) -> Option<BoxCorners> {
    let within = |triangle: &[[f32; 3]; 3]| -> Option<BoxCorners> {
        let corners = triangle.map(|corner| corner.map(f64::from));
        let edges = [(0, 1), (1, 2), (2, 0)].map(|(a, b)| (corners[a], corners[b]));
        let inside = corners.into_iter().filter(|at| (from..=to).contains(&at[axis]));
        let crossings = edges.into_iter().flat_map(|(a, b)| {
            let crosses = move |end: &f64| (a[axis] < *end) != (b[axis] < *end);
            let crossing = move |end: f64| {
                let share = (end - a[axis]) / (b[axis] - a[axis]);
                [0, 1, 2].map(|k| a[k] + share * (b[k] - a[k]))
            };
            [from, to].into_iter().filter(crosses).map(crossing)
        });
        inside.chain(crossings).map(|at| [at; 2]).reduce(joined)
    };
    triangles.iter().filter_map(within).reduce(joined)
}

/// Triangles of each part, in the order of their first ones.
fn parts(triangles: &[[[f32; 3]; 3]]) -> Vec<Vec<[[f32; 3]; 3]>> {
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
    let (mut place, mut parts) = (HashMap::new(), Vec::<Vec<_>>::new());
    for (triangle, corner) in triangles.iter().zip(corners) {
        let at = *place.entry(root_of(&mut first, corner)).or_insert(parts.len());
        if at == parts.len() {
            parts.push(Vec::new());
        }
        parts[at].push(*triangle);
    }
    parts
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
    fn a_turned_trailer_has_slices_that_hold_it_and_little_else() {
        // Turned about its hitch by 0.6 rad, 3.8 m long and 1.5 m wide.
        let (sin, cos) = crate::maths::sin_cos(-0.6);
        let turned = |[x, y, z]: [f32; 3]| {
            let [x, y] = [f64::from(x), f64::from(y)];
            [(cos * x - sin * y) as f32, (sin * x + cos * y) as f32, z]
        };
        let trailer = tube([[-4.2, -0.75, 0.4], [-0.4, 0.75, 1.5]]);
        let trailer: Vec<_> = trailer.iter().map(|triangle| triangle.map(turned)).collect();
        let boxes = boxes_of(&trailer, std::iter::once(0..trailer.len()));
        assert!((2..=MOST_SLICES).contains(&boxes.len()), "{boxes:?}");
        let area = |[low, high]: &BoxCorners| (high[0] - low[0]) * (high[1] - low[1]);
        let sum: f64 = boxes.iter().map(area).sum();
        assert!(sum <= 1.35 * 3.8 * 1.5, "{sum}");
        for (k, l) in (0..=20).flat_map(|k| (0..=20).map(move |l| (k, l))) {
            let [x, y] = [-4.2 + 0.19 * k as f32, -0.75 + 0.075 * l as f32];
            let [x, y, _] = turned([x, y, 1.0]).map(f64::from);
            let holds = |[low, high]: &BoxCorners| {
                let is_in = |v: f64, axis: usize| v > low[axis] - 1e-5 && v < high[axis] + 1e-5;
                is_in(x, 0) && is_in(y, 1)
            };
            assert!(boxes.iter().any(holds), "{x} {y}: {boxes:?}");
        }
        let along = tube([[-4.2, -0.75, 0.4], [-0.4, 0.75, 1.5]]);
        assert_eq!(boxes_of(&along, std::iter::once(0..along.len())).len(), 1);
    }

    /// A part of half a metre, each a metre on along x.
    fn part(k: usize) -> Vec<[[f32; 3]; 3]> {
        let x = k as f64;
        tube([[x, 0.0, 0.0], [x + 0.5, 1.0, 1.0]])
    }

    #[test]
    fn many_parts_leave_a_turned_one_fewer_slices() {
        let (sin, cos) = crate::maths::sin_cos(0.6);
        let turned = |[x, y, z]: [f32; 3]| {
            let [x, y] = [f64::from(x), f64::from(y)];
            [(cos * x - sin * y) as f32, (sin * x + cos * y) as f32, z]
        };
        let trailer = tube([[-9.0, -0.75, 0.4], [-3.0, 0.75, 1.5]]);
        let trailer: Vec<_> = trailer.iter().map(|triangle| triangle.map(turned)).collect();
        let all = |parts: &[[[f32; 3]; 3]]| boxes_of(parts, std::iter::once(0..parts.len()));
        for (straight, most) in [(2, MOST_SLICES), (12, 4), (15, 1)] {
            let parts: Vec<_> = (0..straight).flat_map(part).chain(trailer.clone()).collect();
            let boxes = all(&parts);
            assert_eq!(boxes.len(), straight + most, "{straight}: {boxes:?}");
            assert!((0..straight).all(|k| boxes[k][0][0] == k as f64), "{boxes:?}");
        }
        // A mirror lies in the box around the trailer, and in none of its slices.
        let mirror = tube([[-7.5, -2.0, 0.75], [-7.25, -1.5, 1.25]]);
        let boxes = all(&[&trailer[..], &mirror[..]].concat());
        assert_eq!(boxes.len(), MOST_SLICES + 1);
        assert_eq!(boxes.last(), around(mirror.iter().flatten()).as_ref());
        // Two slices would leave no room for it: the trailer stays whole.
        let tight = [trailer, mirror, (0..14).flat_map(part).collect()].concat();
        assert_eq!(all(&tight).len(), 15);
    }

    #[test]
    fn a_mesh_of_many_parts_has_one_box() {
        let mesh: Vec<_> = (0..17).flat_map(part).collect();
        assert_eq!(boxes_of(&mesh, std::iter::once(0..mesh.len())), [[[0.0; 3], [16.5, 1.0, 1.0]]]);
        assert_eq!(boxes_of(&mesh, std::iter::once(0..6 * 16)).len(), 16);
    }
}
