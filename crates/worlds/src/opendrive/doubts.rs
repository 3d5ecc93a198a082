//! Doubts about a map: reference lines that are most likely not meant as they stand, and warnings of the OpenDRIVE library.
//!
//! Lines have gaps between geometries, or headings in degrees; records begin behind the start of their road or section. Warnings become errors or notes, or are passed over.

use std::collections::BTreeMap;
use std::mem::discriminant;

use roxmltree::{Document, Node};
use xodr::Warning;

use super::document::{number_or_0 as number, shown};
use crate::world::WorldError;
use lidar_cast::maths;
use sightline_files::Note;

/// Largest gap between two geometries that rounding leaves, in metres.
const GAP: f64 = 0.1;
/// Smallest whole number of radians that is more likely degrees.
const WHOLE: f64 = 2.0;

/// A doubt of each kind, for the first place that it holds for.
pub(super) fn doubts(xml: &Document, file: &str) -> Vec<Note> {
    let roads = || xml.descendants().filter(|node| node.has_tag_name("planView"));
    let late = xml.descendants().find_map(late);
    [roads().find_map(gap), roads().find_map(in_degrees), late]
        .into_iter()
        .flatten()
        .map(|words| Note::doubt(format!("{file}: {words}")))
        .collect()
}

fn geometries<'a, 'i>(plan: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    plan.children().filter(|node| node.has_tag_name("geometry"))
}

fn road(plan: Node) -> String {
    let id = plan.parent_element().and_then(|road| road.attribute("id")).unwrap_or("without an id");
    format!("road {:?}", id.chars().take(40).collect::<String>())
}

/// Where a line or an arc ends; other shapes are not followed here.
fn end(geometry: Node) -> Option<[f64; 2]> {
    let [x, y, heading, length] = ["x", "y", "hdg", "length"].map(|name| number(geometry, name));
    let shape = geometry.first_element_child()?;
    let curvature = match shape.tag_name().name() {
        "line" => 0.0,
        "arc" => number(shape, "curvature"),
        _ => return None,
    };
    // Chord of the arc: its length, and half of its turn.
    let half = 0.5 * curvature * length;
    let chord = if half.abs() < 1e-9 { length } else { length * maths::sin(half) / half };
    let way = heading + half;
    Some([x + chord * maths::cos(way), y + chord * maths::sin(way)])
}

/// A geometry that does not begin where the one before it ends.
fn gap(plan: Node) -> Option<String> {
    let mut all: Vec<Node> = geometries(plan).collect();
    all.sort_by(|a, b| number(*a, "s").total_cmp(&number(*b, "s")));
    all.windows(2).find_map(|pair| {
        let [x, y] = end(pair[0])?;
        let by = maths::hypot(number(pair[1], "x") - x, number(pair[1], "y") - y);
        let s = number(pair[1], "s");
        (by > GAP).then(|| {
            format!(
                "{}: the <geometry> at s = {s} begins {by:.2} m from the end of the one before it; the road is taken \
                 with that gap",
                road(plan)
            )
        })
    })
}

/// A list of records whose first one begins late: nothing says what holds before it.
fn late(node: Node) -> Option<String> {
    let (record, key) = match node.tag_name().name() {
        "planView" => ("geometry", "s"),
        "elevationProfile" => ("elevation", "s"),
        "lane" => ("width", "sOffset"),
        _ => return None,
    };
    let records = node.children().filter(|child| child.has_tag_name(record));
    let first = records.map(|child| number(child, key)).min_by(f64::total_cmp)?;
    let road = node.ancestors().find(|node| node.has_tag_name("road"))?;
    (first > GAP).then(|| {
        let id: String = road.attribute("id").unwrap_or("without an id").chars().take(40).collect();
        let lane = node.attribute("id").filter(|_| node.has_tag_name("lane"));
        let lane = lane.map(|lane| format!(", lane {}", shown(lane))).unwrap_or_default();
        format!(
            "road {id:?}{lane}: the first <{record}> begins at {key} = {first}; the map does not say what holds before it"
        )
    })
}

/// A heading that is most likely one in degrees: a whole number. Maps of CARLA add up turns, so more than one is none.
fn in_degrees(plan: Node) -> Option<String> {
    let is_whole = |hdg: &f64| hdg.abs() >= WHOLE && hdg.fract() == 0.0;
    let heading = geometries(plan).map(|node| number(node, "hdg")).find(is_whole)?;
    Some(format!(
        "{}: `hdg` is {heading} rad; degrees? {heading}° are {:.4} rad",
        road(plan),
        heading.to_radians()
    ))
}

enum Severity {
    /// Part of the map would be missing.
    Error,
    /// The map contradicts itself; the library says how it is read.
    Told,
    /// Nothing of a world depends on it: speeds, rules, signals that belong together, versions.
    Passed,
}

#[rustfmt::skip] // Words of a list stand side by side.
fn taken(warning: &Warning) -> Severity {
    use Warning as W;
    match warning {
        W::RoadSkipped { .. } | W::GeometryDropped { .. } | W::LaneIdUnreadable { .. } | W::LaneOnWrongSide { .. }
        | W::LaneIdRepeated { .. } | W::LaneDropped { .. } | W::LaneSectionDropped { .. } | W::RecordDropped { .. }
        | W::RecordValueUnreadable { .. } | W::StripDropped { .. } | W::UnknownStripMode { .. }
        | W::UnknownTrafficRule { .. } | W::UnknownLaneDirection { .. } | W::JunctionIdRepeated { .. }
        | W::LaneLinkDropped { .. } | W::IncludeDropped { .. } | W::TooManyCopies { .. } | W::OutlineDropped { .. }
        | W::SkeletonDropped { .. } | W::JunctionObjectsDropped { .. } | W::ObjectDropped { .. }
        | W::RepeatDropped { .. } | W::SignalDropped { .. } | W::RoadMarkLineDropped { .. } => Severity::Error,
        W::NewerThanDeclared { .. } | W::SpeedLimitDropped { .. } | W::SpeedLimitDisagrees { .. }
        | W::AccessDropped { .. } | W::VisibilityDropped { .. } | W::NeighborDropped { .. }
        | W::PriorityDropped { .. } | W::SignalLinkDropped { .. } | W::JunctionReferenceDropped { .. }
        | W::UnknownJunctionGroupType { .. } | W::CrossPathDropped { .. } | W::BoundarySegmentDropped { .. }
        | W::BoundaryNotClosed { .. } | W::BoundaryClockwise { .. } | W::ElevationGridDropped { .. }
        | W::TransitionDropped { .. } | W::RoadSectionDropped { .. } | W::RailwayDropped { .. }
        | W::StructureDropped { .. } | W::ObjectSurfaceDropped { .. } | W::CrgHideIgnored { .. }
        | W::CrgDropped { .. } => Severity::Passed,
        _ => Severity::Told,
    }
}

/// One note for each kind of warning, with the first and the number of all.
///
/// # Errors
/// The first warning of a part that would be missing.
pub(super) fn notes(warnings: &[Warning], file: &str) -> Result<Vec<Note>, WorldError> {
    let mut kinds: BTreeMap<usize, (&Warning, usize)> = BTreeMap::new();
    let mut seen = Vec::new();
    for warning in warnings {
        match taken(warning) {
            Severity::Error => {
                let mend = "correct it, or take it out of the map";
                return Err(WorldError::Refused(format!("{file}: {warning}; {mend}")));
            }
            Severity::Passed => continue,
            Severity::Told => {}
        }
        let kind = discriminant(warning);
        let place = seen.iter().position(|known| *known == kind).unwrap_or_else(|| {
            seen.push(kind);
            seen.len() - 1
        });
        kinds.entry(place).or_insert((warning, 0)).1 += 1;
    }
    let told = |(first, count): &(&Warning, usize)| match count {
        1 => Note::fact(format!("{file}: {first}")),
        _ => Note::fact(format!("{file}: {first}; {} more are of the kind", count - 1)),
    };
    Ok(kinds.values().map(told).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(geometries: &str) -> String {
        let text =
            format!("<OpenDRIVE><road id='7'><planView>{geometries}</planView></road></OpenDRIVE>");
        let notes = doubts(&Document::parse(&text).unwrap(), "m");
        assert!(notes.iter().all(Note::is_doubt));
        notes.iter().map(Note::text).collect::<Vec<_>>().join("\n")
    }

    fn line(s: f64, x: f64, heading: f64) -> String {
        format!("<geometry s='{s}' x='{x}' y='0' hdg='{heading}' length='50'><line/></geometry>")
    }

    #[test]
    fn gaps_are_told_whatever_the_order() {
        assert_eq!(told(&(line(50.0, 50.0, 0.0) + &line(0.0, 0.0, 0.0))), "");
        let gap = told(&(line(0.0, 0.0, 0.0) + &line(50.0, 80.0, 0.0)));
        assert_eq!(
            gap,
            "m: road \"7\": the <geometry> at s = 50 begins 30.00 m from the end of the one before it; the road is \
         taken with that gap"
        );
    }

    #[test]
    fn arcs_end_where_the_circle_does() {
        // A quarter of a circle of 20 m around (0, 20).
        let arc = "<geometry s='0' x='0' y='0' hdg='0' length='31.41592653589793'><arc curvature='0.05'/></geometry>";
        let next = |y: f64| {
            format!("<geometry s='31.4' x='20' y='{y}' hdg='1.57' length='5'><line/></geometry>")
        };
        assert_eq!(told(&format!("{arc}{}", next(20.0))), "");
        assert!(told(&format!("{arc}{}", next(21.0))).contains("begins 1.00 m"));
    }

    #[test]
    fn records_that_begin_late_are_doubted() {
        let late = told(&line(20.0, 0.0, 0.0));
        assert!(late.contains("road \"7\": the first <geometry> begins at s = 20"), "{late}");
        let of = |inner: &str| {
            let text = format!("<OpenDRIVE><road id='7'>{inner}</road></OpenDRIVE>");
            let notes = doubts(&Document::parse(&text).unwrap(), "m");
            notes.iter().map(Note::text).collect::<String>()
        };
        let heights = |s: f64| {
            of(&format!("<elevationProfile><elevation s='{s}' a='9'/></elevationProfile>"))
        };
        assert_eq!(heights(0.0), "");
        assert!(heights(5.0).contains("the first <elevation> begins at s = 5; the map"));
        let widths =
            |s: f64| of(&format!("<lane id='1'><width sOffset='9'/><width sOffset='{s}'/></lane>"));
        assert_eq!(widths(0.0), "");
        assert!(
            widths(3.0)
                .contains("road \"7\", lane 1: the first <width> begins at sOffset = 3; the map")
        );
    }

    #[test]
    fn headings_in_degrees_are_doubted() {
        assert!(
            told(&line(0.0, 0.0, 90.0)).ends_with("`hdg` is 90 rad; degrees? 90° are 1.5708 rad")
        );
        assert_eq!(told(&line(0.0, 0.0, 9.42)), "");
    }
}
