//! Points of lanes that a document asks for, estimated before they are made: the library's search trees grow with the
//! square of points that lie on one another.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};

use super::document::number_or_0 as number;
use super::stations::RoadStations;
use super::{MAX_LENGTH, MAX_POINTS};
use crate::world::WorldError;
use lidar_cast::maths;

/// Edge of a cell of the plan, in metres.
const CELL: f64 = 8.0;
/// Most points of lanes in a cell. A dense junction has some thousands.
const MOST_IN_CELL: f64 = 20_000.0;
/// Farthest and closest points of the library along a lane in metres, and its turn from one to the next in radians.
const STEPS: [f64; 2] = [0.25, 2.0];
const TURN: f64 = 0.05;

/// Refuses roads that turn on the spot, or lie on one another, until their points are too many to be searched.
///
/// # Errors
/// The place, and how many points there would be.
pub(super) fn check(
    xml: &Document<'_>,
    stations: &[RoadStations<'_, '_>],
    file: &str,
) -> Result<(), WorldError> {
    let mut cells: BTreeMap<[i64; 2], f64> = BTreeMap::new();
    let (mut points, mut metres) = (0.0, 0.0);
    for road in xml.root_element().children().filter(|node| node.has_tag_name("road")) {
        let lanes = most_lanes(road);
        let length = number(road, "length");
        let own = stations.iter().find(|stations| stations.road == road);
        let places = own.map_or(&[][..], |stations| &stations.places);
        let plan = road.children().filter(|node| node.has_tag_name("planView"));
        for geometry in plan.flat_map(|plan| plan.children()).filter(Node::is_element) {
            let (start, length) = (number(geometry, "s"), number(geometry, "length").min(length));
            metres += length;
            // Longer roads are refused by the limit on the length of all roads.
            if metres > 2.0 * MAX_LENGTH {
                return Ok(());
            }
            walk(geometry, length, |place, along, made| {
                // The library's places, and further ones for the road's records.
                let before = |s: f64| places.partition_point(|place| *place < start + s);
                let made = made + (before(along[1]) - before(along[0])) as f64;
                points += made * lanes;
                let cell = place.map(|v| (v / CELL).floor() as i64);
                *cells.entry(cell).or_insert(0.0) += made * lanes;
            });
        }
    }
    if points > MAX_POINTS as f64 {
        let (what, most) = ("points of its lanes", MAX_POINTS as f64);
        return Err(WorldError::too_large(file, what, points.round(), most));
    }
    match cells.into_iter().find(|(_, count)| *count > MOST_IN_CELL) {
        Some((cell, count)) => Err(WorldError::TooDense {
            file: file.to_owned(),
            count: count.round(),
            place: cell.map(|v| (v as f64 + 0.5) * CELL),
            most: MOST_IN_CELL,
        }),
        None => Ok(()),
    }
}

/// Number of lanes of the widest section of a road, at least 1.
fn most_lanes(road: Node<'_, '_>) -> f64 {
    let all = road.children().filter(|node| node.has_tag_name("lanes"));
    let sections = all.flat_map(|lanes| lanes.children());
    let lanes = |section: Node<'_, '_>| {
        let sides = section.children().filter(|side| !side.has_tag_name("center"));
        sides.flat_map(|side| side.children()).filter(|n| n.has_tag_name("lane")).count()
    };
    sections.map(lanes).max().unwrap_or(0).max(1) as f64
}

/// Follows a reference line in steps of at most 2 m: the place of each, its ends along the line, and the points of a lane there. Polynomials are
/// followed straight ahead, which tells the place of their start.
fn walk(geometry: Node<'_, '_>, length: f64, mut visit: impl FnMut([f64; 2], [f64; 2], f64)) {
    let [mut x, mut y, mut heading] = ["x", "y", "hdg"].map(|name| number(geometry, name));
    let shape = geometry.first_element_child();
    let curvatures = shape.map_or([0.0; 2], |shape| match shape.tag_name().name() {
        "arc" => [number(shape, "curvature"); 2],
        "spiral" => ["curvStart", "curvEnd"].map(|name| number(shape, name)),
        _ => [0.0; 2],
    });
    let steps = (length / STEPS[1]).ceil().max(1.0);
    let step = length / steps;
    for k in 0..steps as usize {
        let along = (k as f64 + 0.5) / steps;
        let curvature = curvatures[0] + (curvatures[1] - curvatures[0]) * along;
        let half = 0.5 * curvature * step;
        // Chord of an arc of this step.
        let chord = if half.abs() < 1e-9 { step } else { step * maths::sin(half) / half };
        let (sin, cos) = maths::sin_cos(heading + half);
        (x, y, heading) = (x + chord * cos, y + chord * sin, heading + 2.0 * half);
        let ends = [k as f64 * step, (k + 1) as f64 * step];
        visit([x, y], ends, step / (TURN / curvature.abs()).clamp(STEPS[0], STEPS[1]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn document(count: usize, length: f64, shape: &str) -> Result<(), String> {
        let lane = "<lane id='1'/>";
        let road = format!(
            "<road length='{length}'><planView><geometry s='0' x='1' y='4' hdg='0' length='{length}'>{shape}</geometry>\
             </planView><lanes><laneSection s='0'><left>{lane}{lane}</left><center>{lane}</center></laneSection></lanes></road>"
        );
        let text = format!("<OpenDRIVE>{}</OpenDRIVE>", road.repeat(count));
        let xml = Document::parse(&text).unwrap();
        check(&xml, &[], "m").map_err(|error| error.to_string())
    }

    /// 2 lanes with a point every 0.25 m: 2501 m of a circle of 1 mm are 20 008 points, 2499 m are 19 992.
    #[test]
    fn points_on_one_spot_are_counted() {
        let arc = "<arc curvature='1000'/>";
        assert_eq!(document(1, 2499.0, arc), Ok(()));
        let told = document(1, 2501.0, arc).unwrap_err();
        assert!(told.contains("20008 points") && told.contains("x = 4, y = 4"), "{told}");
        assert!(document(1, 50_000.0, "<spiral curvStart='0' curvEnd='1000'/>").is_err());
        // A straight road of equal length, and a helix of ten turns with a radius of 10 m.
        assert_eq!(document(1, 50_000.0, "<line/>"), Ok(()));
        assert_eq!(document(1, 628.0, "<arc curvature='0.1'/>"), Ok(()));
        // 3000 roads ahead from x = 1: 2 lanes with points at x = 9, 11, 13 and 15.
        let told = document(3000, 16.0, "<line/>").unwrap_err();
        assert!(told.contains("24000 points") && told.contains("x = 12, y = 4"), "{told}");
        assert_eq!(document(2400, 16.0, "<line/>"), Ok(()));
    }
}
