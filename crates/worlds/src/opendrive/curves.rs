//! Ends and lengths of the geometries of a reference line, for doubts about it.

use std::f64::consts::TAU;

use lidar_cast::maths;
use roxmltree::Node;

use super::document::{number_or_0 as number, shown};

/// Pieces in which a curve is measured.
const PIECES: u32 = 200;

/// A place in the frame of a geometry's start, in metres of the plan.
fn placed(geometry: Node, [u, v]: [f64; 2]) -> [f64; 2] {
    let [x, y, heading] = ["x", "y", "hdg"].map(|name| number(geometry, name));
    let (sin, cos) = maths::sin_cos(heading);
    [x + u * cos - v * sin, y + u * sin + v * cos]
}

/// A cubic polynomial of an element.
fn cubic(shape: Node, keys: [&str; 4]) -> impl Fn(f64) -> f64 {
    let [a, b, c, d] = keys.map(|key| number(shape, key));
    move |x| a + x * (b + x * (c + x * d))
}

/// Places of a `<paramPoly3>` by their share of its parameter's range, in the frame of its geometry.
fn on_cubics(shape: Node, length: f64) -> impl Fn(f64) -> [f64; 2] {
    let range = if is_by_length(shape) { length } else { 1.0 };
    let u = cubic(shape, ["aU", "bU", "cU", "dU"]);
    let v = cubic(shape, ["aV", "bV", "cV", "dV"]);
    move |share| [u(range * share), v(range * share)]
}

/// True if the parameter of a `<paramPoly3>` is a length; else it goes from 0 to 1.
pub(super) fn is_by_length(shape: Node) -> bool {
    let range = shape.attribute("pRange").map(str::trim);
    range.is_some_and(|range| range.eq_ignore_ascii_case("arcLength"))
}

/// Where a geometry begins: polynomials may begin beside its own place.
pub(super) fn begin(geometry: Node) -> [f64; 2] {
    let shape = geometry.first_element_child();
    let moved = shape.and_then(|shape| match shape.tag_name().name() {
        "poly3" => Some([0.0, number(shape, "a")]),
        "paramPoly3" => Some(on_cubics(shape, 0.0)(0.0)),
        _ => None,
    });
    placed(geometry, moved.unwrap_or_default())
}

/// Where a geometry ends.
pub(super) fn end(geometry: Node) -> Option<[f64; 2]> {
    let length = number(geometry, "length");
    let shape = geometry.first_element_child()?;
    let step = length / f64::from(PIECES);
    let end = match shape.tag_name().name() {
        "line" => [length, 0.0],
        "arc" => {
            // Chord of the arc: its length, and half of its turn.
            let half = 0.5 * number(shape, "curvature") * length;
            let chord = if half.abs() < 1e-9 { length } else { length * maths::sin(half) / half };
            [chord * maths::cos(half), chord * maths::sin(half)]
        }
        "spiral" => {
            let [from, to] = ["curvStart", "curvEnd"].map(|name| number(shape, name));
            (0..PIECES).fold([0.0; 2], |[u, v], k| {
                let s = (f64::from(k) + 0.5) * step;
                let (sin, cos) = maths::sin_cos(s * (from + 0.5 * (to - from) * s / length));
                [u + step * cos, v + step * sin]
            })
        }
        "poly3" => {
            let [b, c, d] = ["b", "c", "d"].map(|name| number(shape, name));
            let slope = |u: f64| b + u * (2.0 * c + u * 3.0 * d);
            let u = (0..PIECES).fold(0.0, |u, _| {
                let middle = u + 0.5 * step / maths::hypot(1.0, slope(u));
                u + step / maths::hypot(1.0, slope(middle))
            });
            [u, cubic(shape, ["a", "b", "c", "d"])(u)]
        }
        "paramPoly3" => on_cubics(shape, length)(1.0),
        _ => return None,
    };
    Some(placed(geometry, end))
}

/// Length of a `<paramPoly3>` in metres; `length` is the one that its geometry states.
pub(super) fn length_of(shape: Node, length: f64) -> f64 {
    let place = on_cubics(shape, length);
    let mut from = place(0.0);
    let pieces = (1..=PIECES).map(|k| {
        let [x, y] = from;
        from = place(f64::from(k) / f64::from(PIECES));
        maths::hypot(from[0] - x, from[1] - y)
    });
    pieces.sum()
}

/// Headings at both ends of a geometry, in radians.
fn headings(geometry: Node) -> Option<[f64; 2]> {
    let [heading, length] = ["hdg", "length"].map(|name| number(geometry, name));
    let shape = geometry.first_element_child()?;
    let of_shape = |name| number(shape, name);
    let turned = match shape.tag_name().name() {
        "line" => [0.0; 2],
        "arc" => [0.0, of_shape("curvature") * length],
        "spiral" => [0.0, 0.5 * (of_shape("curvStart") + of_shape("curvEnd")) * length],
        "paramPoly3" => {
            /// Share of a curve over which its direction is taken.
            const SHARE: f64 = 1e-4;
            let place = on_cubics(shape, length);
            [[0.0, SHARE], [1.0 - SHARE, 1.0]].map(|ends| {
                let [[u, v], [x, y]] = ends.map(&place);
                maths::atan2(y - v, x - u)
            })
        }
        _ => return None,
    };
    Some(turned.map(|turned| heading + turned))
}

/// Largest turn between two geometries of one line, in radians, and shortest one that is looked at, in metres.
const KINK: f64 = 0.5;
const SHORTEST: f64 = 0.1;

/// A geometry that does not go on in the direction of the one before it.
pub(super) fn kinked(plan: Node) -> Option<String> {
    let all = plan.children().filter(|node| node.has_tag_name("geometry"));
    let mut all: Vec<Node> = all.filter(|node| number(*node, "length") > SHORTEST).collect();
    all.sort_by(|a, b| number(*a, "s").total_cmp(&number(*b, "s")));
    all.windows(2).find_map(|pair| {
        let by = headings(pair[1])?[0] - headings(pair[0])?[1];
        let by = by - TAU * (by / TAU).round();
        let id = plan.parent_element().and_then(|road| road.attribute("id"));
        (by.abs() > KINK).then(|| {
            format!(
                "road {:?}: the <geometry> at s = {} begins with a turn of {by:.2} rad from the one before it; the road is \
                 taken with that kink: is `hdg` in radians?",
                shown(id.unwrap_or("without an id")),
                number(pair[1], "s")
            )
        })
    })
}
