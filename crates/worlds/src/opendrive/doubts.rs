//! Doubts about a map: reference lines, records, objects and marks that are most likely not meant as they stand; and warnings of
//! the OpenDRIVE library, which become errors or notes, or are passed over.

use std::collections::BTreeMap;
use std::mem::discriminant;

use roxmltree::{Document, Node};
use xodr::Warning;

use super::attributes::miswritten;
use super::curves::{begin, end, is_by_length, kinked, length_of};
use super::document::{number_or_0 as number, shown};
use crate::world::WorldError;
use lidar_cast::maths;
use sightline_files::Note;

/// Largest gap between two geometries that rounding leaves, in metres.
const GAP: f64 = 0.1;
/// Smallest whole number of radians that is more likely degrees, and smallest number of any digits.
const WHOLE: f64 = 2.0;
const TURNS: f64 = 30.0;

/// A doubt of each kind, for the first place that it holds for.
pub(super) fn doubts(xml: &Document, file: &str) -> Vec<Note> {
    let roads = || xml.descendants().filter(|node| node.has_tag_name("planView"));
    let lines = [gap, uneven, in_degrees, stretched, kinked];
    let lines = lines.map(|doubt| roads().find_map(doubt));
    let records = [late, steep, tilted, step, turned, high, far, broad, miswritten];
    let records = records.map(|doubt| xml.descendants().find_map(doubt));
    lines
        .into_iter()
        .chain(records)
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

/// A geometry that does not begin where the one before it ends.
fn gap(plan: Node) -> Option<String> {
    gap_above(plan, GAP)
        .map(|words| format!("{}: {words}; the road is taken with that gap", road(plan)))
}

/// The first gap of more than so many metres between two geometries, in words.
pub(super) fn gap_above(plan: Node, most: f64) -> Option<String> {
    let mut all: Vec<Node> = geometries(plan).collect();
    all.sort_by(|a, b| number(*a, "s").total_cmp(&number(*b, "s")));
    all.windows(2).find_map(|pair| {
        let ([x, y], [u, v]) = (end(pair[0])?, begin(pair[1]));
        let (by, s) = (maths::hypot(u - x, v - y), number(pair[1], "s"));
        (by > most).then(|| {
            format!("the <geometry> at s = {s} begins {by:.2} m from the end of the one before it")
        })
    })
}

/// A geometry that is not as long as the way to the next one's `s`.
fn uneven(plan: Node) -> Option<String> {
    let mut all: Vec<[f64; 2]> =
        geometries(plan).map(|node| ["s", "length"].map(|name| number(node, name))).collect();
    all.sort_by(|a, b| a[0].total_cmp(&b[0]));
    all.windows(2).find_map(|pair| {
        let ([s, length], next) = (pair[0], pair[1][0]);
        ((s + length - next).abs() > GAP).then(|| {
            format!(
                "{}: the <geometry> at s = {s} is {length} m long, and the next one begins at s = {next}; which of the two is \
                 right?",
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
        "lanes" => ("laneSection", "s"),
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

/// Largest share by which a curve may be longer or shorter than its `length`.
const STRETCH: f64 = 0.1;
/// A polynomial whose curve is not as long as its geometry: most likely its parameter runs over another range.
fn stretched(plan: Node) -> Option<String> {
    geometries(plan).find_map(|geometry| {
        let shape = geometry.first_element_child().filter(|n| n.has_tag_name("paramPoly3"))?;
        let length = Some(number(geometry, "length")).filter(|length| *length > GAP)?;
        let found = length_of(shape, length);
        ((found - length).abs() > STRETCH * length).then(|| {
            let range = if is_by_length(shape) { "arcLength" } else { "normalized" };
            format!(
                "{}: the <paramPoly3> at s = {} is {found:.2} m long and its `length` is {length} m; is its `pRange`, read as \
                 {range}, right?",
                road(plan),
                number(geometry, "s")
            )
        })
    })
}

/// Metres a metre from which on a road is steeper than streets are: the steepest rise by 0.38.
const STEEPEST: f64 = 0.6;
/// Radians from which on a road is tilted more than banked tracks are, 0.86.
const MOST_TILT: f64 = 1.0;
/// Metres of height that rounding leaves between two elevations.
const STEP: f64 = 0.2;

/// Records of a profile by their place: where each begins and ends, and its cubic.
fn cubics(profile: Node, record: &'static str) -> Vec<([f64; 2], [f64; 4])> {
    let length = profile.parent_element().map_or(0.0, |road| number(road, "length"));
    let records = profile.children().filter(|child| child.has_tag_name(record));
    let terms = |node: Node| (number(node, "s"), ["a", "b", "c", "d"].map(|key| number(node, key)));
    let mut all: Vec<(f64, [f64; 4])> = records.map(terms).collect();
    all.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ends: Vec<f64> = all.iter().skip(1).map(|next| next.0).chain([length]).collect();
    all.into_iter().zip(ends).map(|((from, terms), to)| ([from, to.min(length)], terms)).collect()
}

/// An elevation that rises or falls more than a street: a slope in percent, most likely.
fn steep(profile: Node) -> Option<String> {
    let profile = Some(profile).filter(|node| node.has_tag_name("elevationProfile"))?;
    cubics(profile, "elevation").into_iter().find_map(|([from, to], [_, b, c, d])| {
        let slope = |x: f64| b + x * (2.0 * c + x * 3.0 * d);
        let most = [0.0, to - from].map(slope).into_iter().max_by(|p, q| p.abs().total_cmp(&q.abs()))?;
        // Programs end a road by a stretch of a centimetre, whose polynomial is any.
        (to - from > GAP && most.abs() > STEEPEST).then(|| {
            format!(
                "{}: the <elevation> at s = {from} {} by {:.2} m a metre; percent? `b` is metres of height a metre",
                road(profile),
                if most > 0.0 { "rises" } else { "falls" },
                most.abs()
            )
        })
    })
}

/// A tilt that is most likely one in degrees.
fn tilted(profile: Node) -> Option<String> {
    let profile = Some(profile).filter(|node| node.has_tag_name("lateralProfile"))?;
    ["superelevation", "crossfall"].into_iter().find_map(|record| {
        cubics(profile, record).into_iter().find_map(|([from, to], [a, b, c, d])| {
            let tilt = |x: f64| a + x * (b + x * (c + x * d));
            let most = [0.0, to - from].map(tilt).into_iter().max_by(|p, q| p.abs().total_cmp(&q.abs()))?;
            (to - from > GAP && most.abs() > MOST_TILT).then(|| {
                format!(
                    "{}: the <{record}> at s = {from} tilts the road by {most:.3} rad; degrees? {most:.3}° are {:.4} rad",
                    road(profile),
                    most.to_radians()
                )
            })
        })
    })
}

/// An elevation that does not begin where the one before it ends.
fn step(profile: Node) -> Option<String> {
    let profile = Some(profile).filter(|node| node.has_tag_name("elevationProfile"))?;
    cubics(profile, "elevation").windows(2).find_map(|pair| {
        let ([from, to], [a, b, c, d]) = pair[0];
        let ([start, end], [next, ..]) = pair[1];
        let x = to - from;
        let up = next - (a + x * (b + x * (c + x * d)));
        // A record behind the end of the road holds nowhere.
        (x > GAP && end - start > GAP && up.abs() > STEP).then(|| {
            format!(
                "{}: the <elevation> at s = {to} begins {:.2} m {} the end of the one before it; the road has that step: \
                 correct `a`?",
                road(profile),
                up.abs(),
                if up > 0.0 { "above" } else { "below" }
            )
        })
    })
}

/// True for radians that are most likely degrees: a whole number, or many turns. Maps of CARLA add up a few.
fn is_of_degrees(angle: &f64) -> bool {
    angle.abs() >= TURNS || (angle.abs() >= WHOLE && angle.fract() == 0.0)
}

/// A heading that is most likely one in degrees.
fn in_degrees(plan: Node) -> Option<String> {
    let heading = geometries(plan).map(|node| number(node, "hdg")).find(is_of_degrees)?;
    Some(format!(
        "{}: `hdg` is {heading} rad; degrees? {heading}° are {:.4} rad",
        road(plan),
        heading.to_radians()
    ))
}

/// An angle of an object or a signal that is most likely one in degrees.
fn turned(node: Node) -> Option<String> {
    let keys = match node.tag_name().name() {
        "object" => ["hdg", "pitch", "roll"],
        "signal" => ["hOffset", "pitch", "roll"],
        _ => return None,
    };
    let key = keys.into_iter().find(|key| is_of_degrees(&number(node, key)))?;
    let angle = number(node, key);
    let of_road = node.ancestors().find(|n| n.has_tag_name("road"))?;
    Some(format!(
        "road {:?}: `{key}` of the <{}> {} is {angle} rad; degrees? {angle}° are {:.4} rad",
        shown(of_road.attribute("id").unwrap_or("without an id")),
        node.tag_name().name(),
        shown(node.attribute("id").unwrap_or("without an id")),
        angle.to_radians()
    ))
}

/// An object that is higher than any of its kind.
fn high(node: Node) -> Option<String> {
    const MOST: [f64; 2] = [100.0, 1000.0];
    let object = node.ancestors().find(|n| n.has_tag_name("object"))?;
    let height = ["height", "heightStart", "heightEnd"].map(|key| number(node, key));
    let height = height.into_iter().fold(0.0, f64::max);
    let is_building = object.attribute("type") == Some("building");
    (height > MOST[usize::from(is_building)]).then(|| {
        let id = shown(object.attribute("id").unwrap_or("without an id"));
        format!("the <object> {id} is {height} m high; heights are in metres: centimetres, or millimetres?")
    })
}

/// An object or a signal that stands farther from its road than any map of streets leads.
fn far(node: Node) -> Option<String> {
    const MOST: f64 = 1000.0;
    let keys: &[&str] = match node.tag_name().name() {
        "object" | "signal" => &["t", "zOffset"],
        "repeat" => &["tStart", "tEnd", "zOffsetStart", "zOffsetEnd"],
        _ => return None,
    };
    let key = keys.iter().find(|key| number(node, key).abs() > MOST)?;
    let line = node.document().text_pos_at(node.range().start).row;
    let (metres, name) = (number(node, key), node.tag_name().name());
    Some(format!(
        "line {line}: `{key}` of the <{name}> is {metres} m; lengths are in metres: millimetres?"
    ))
}

/// A line on the road that is broader than any.
fn broad(node: Node) -> Option<String> {
    const MOST: f64 = 2.0;
    let width = Some(number(node, "width")).filter(|_| node.has_tag_name("roadMark"))?;
    let line = node.document().text_pos_at(node.range().start).row;
    (width > MOST).then(|| {
        format!(
            "line {line}: `width` of the <roadMark> is {width} m; widths are in metres: centimetres, or millimetres?"
        )
    })
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

    /// Doubts about a road of 100 m with this content.
    fn of_road(inner: &str) -> String {
        let text = format!("<OpenDRIVE><road id='7' length='100'>{inner}</road></OpenDRIVE>");
        let notes = doubts(&Document::parse(&text).unwrap(), "m");
        assert!(notes.iter().all(Note::is_doubt));
        notes.iter().map(Note::text).collect::<Vec<_>>().join("\n")
    }

    fn told(geometries: &str) -> String {
        of_road(&format!("<planView>{geometries}</planView>"))
    }

    fn line(s: f64, x: f64, heading: f64) -> String {
        format!("<geometry s='{s}' x='{x}' y='0' hdg='{heading}' length='50'><line/></geometry>")
    }

    #[test]
    fn gaps_are_told_whatever_the_order() {
        assert_eq!(told(&(line(50.0, 50.0, 0.0) + &line(0.0, 0.0, 0.0))), "");
        for (next, words) in [
            (
                line(60.0, 50.0, 0.0),
                "at s = 0 is 50 m long, and the next one begins at s = 60; which of the two is right?",
            ),
            (
                line(50.0, 80.0, 0.0),
                "at s = 50 begins 30.00 m from the end of the one before it; the road is taken with that gap",
            ),
        ] {
            let told = told(&(line(0.0, 0.0, 0.0) + &next));
            assert_eq!(told, format!("m: road \"7\": the <geometry> {words}"));
        }
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

    /// A spiral of 100 m that turns by 1 rad: its series in the angle gives 90.4524 m along and 31.0268 m across.
    #[test]
    fn gaps_behind_curves_are_told() {
        let follows = |shape: &str, [x, y]: [f64; 2], next: &str| {
            told(&format!(
                "<geometry s='0' x='7' y='0' hdg='0' length='100'>{shape}</geometry>\
                 <geometry s='100' x='{}' y='{y}' hdg='0.5' length='5'>{next}</geometry>",
                7.0 + x
            ))
        };
        let line = "<line/>";
        let spiral = "<spiral curvStart='0' curvEnd='0.02'/>";
        let cubics = "<paramPoly3 aU='0' bU='100' cU='0' dU='0' aV='0' bV='0' cV='8' dV='-3'/>";
        // v = 0.75 u up to u = 80: a triangle of 3, 4 and 5.
        let slope = "<poly3 a='0' b='0.75' c='0' d='0'/>";
        let ends = [(spiral, [90.4524, 31.0268]), (cubics, [100.0, 5.0]), (slope, [80.0, 60.0])];
        for (shape, [x, y]) in ends {
            assert_eq!(follows(shape, [x, y], line), "", "{shape}");
            let gap = follows(shape, [x, 0.0 - y], line);
            assert!(gap.contains(&format!("begins {:.2} m from the end", 2.0 * y)), "{gap}");
        }
        let beside = "<paramPoly3 aU='0' bU='5' cU='0' dU='0' aV='3' bV='0' cV='0' dV='0'/>";
        assert!(follows(line, [100.0, 0.0], beside).contains("begins 3.00 m from the end"));
    }

    #[test]
    fn records_that_begin_late_are_doubted() {
        let late = told(&line(20.0, 0.0, 0.0));
        assert_holds!(late, "road \"7\": the first <geometry> begins at s = 20");
        let heights = |s: f64| {
            of_road(&format!("<elevationProfile><elevation s='{s}' a='9'/></elevationProfile>"))
        };
        assert_eq!(heights(0.0), "");
        assert_holds!(heights(5.0), "the first <elevation> begins at s = 5; the map");
        let widths = |s: f64| {
            of_road(&format!("<lane id='1'><width sOffset='9'/><width sOffset='{s}'/></lane>"))
        };
        assert_eq!(widths(0.0), "");
        let first = "road \"7\", lane 1: the first <width> begins at sOffset = 3; the map";
        assert_holds!(widths(3.0), first);
        let sections = of_road("<lanes><laneSection s='30'/></lanes>");
        assert_holds!(sections, "the first <laneSection> begins at s = 30;");
    }

    fn records(record: &str, rows: &[[f64; 3]]) -> String {
        let row = |[s, a, b]: &[f64; 3]| format!("<{record} s='{s}' a='{a}' b='{b}' c='0' d='0'/>");
        rows.iter().map(row).collect()
    }

    #[test]
    fn slopes_tilts_and_steps_that_no_road_has_are_doubted() {
        let heights = |rows: &[[f64; 3]]| {
            of_road(&format!("<elevationProfile>{}</elevationProfile>", records("elevation", rows)))
        };
        // 50 m at 0.38, then level; the record behind the end of the road is none of it.
        assert_eq!(heights(&[[50.0, 19.0, 0.0], [0.0, 0.0, 0.38], [100.0, 0.0, 9.0]]), "");
        for (slope, word) in [(4.0, "rises"), (-4.0, "falls")] {
            let words = format!("road \"7\": the <elevation> at s = 0 {word} by 4.00 m a metre;");
            assert_holds!(heights(&[[0.0, 0.0, slope]]), &words);
        }
        for (height, word) in [(6.0, "above"), (-4.0, "below")] {
            let step = heights(&[[0.0, 0.0, 0.02], [50.0, height, 0.0]]);
            let words = format!("the <elevation> at s = 50 begins 5.00 m {word} the end of the");
            assert!(step.contains(&words) && step.ends_with("step: correct `a`?"), "{step}");
        }
        let tilt = |record: &str, a: f64| {
            let records = records(record, &[[0.0, a, 0.0]]);
            of_road(&format!("<lateralProfile>{records}</lateralProfile>"))
        };
        assert_eq!(tilt("superelevation", -0.86), "");
        let words = "at s = 0 tilts the road by 4.000 rad; degrees? 4.000° are 0.0698";
        assert_holds!(tilt("superelevation", 4.0), "the <superelevation>", words);
        assert_holds!(tilt("crossfall", -2.0), "the <crossfall> at s = 0 tilts");
    }

    #[test]
    fn curves_that_are_not_as_long_as_they_say_are_doubted() {
        let curve = |range: &str, u: f64| {
            of_road(&format!(
                "<planView><geometry s='0' x='0' y='0' hdg='0' length='100'><paramPoly3 aU='0' bU='{u}' cU='0' dU='0' aV='0' \
                 bV='0' cV='0' dV='0' {range}/></geometry></planView>"
            ))
        };
        for (range, u) in [("pRange='arcLength'", 1.0), ("pRange='normalized'", 100.0), ("", 100.0)]
        {
            assert_eq!(curve(range, u), "");
        }
        let long = curve("pRange='arcLength'", 100.0);
        assert_holds!(long, "is 10000.00 m long and its `length` is 100 m;", "read as arcLength");
        let short = curve("", 1.0);
        assert_holds!(short, "is 1.00 m long and its `length` is 100 m;", "read as normalized");
    }

    #[test]
    fn headings_in_degrees_are_doubted() {
        let heading = told(&line(0.0, 0.0, 90.0));
        assert_holds!(heading, "`hdg` is 90 rad; degrees? 90° are 1.5708 rad");
        assert_eq!(told(&line(0.0, 0.0, 9.42)), "");
        assert!(told(&line(0.0, 0.0, 45.5)).contains("degrees? 45.5° are"));
        let object = |words: &str| of_road(&format!("<objects><object id='3' {words}/></objects>"));
        assert!(object("type='pole' height='600'").contains("the <object> 3 is 600 m high"));
        assert_eq!(object("type='building' height='600'"), "");
        assert!(object("zoffset='1'").contains("OpenDRIVE calls it `zOffset`"));
        assert_holds!(object("s='5' t='-8000'"), "`t` of the <object> is -8000 m;");
        assert_holds!(object("t='8' zOffset='2500'"), "`zOffset` of the <object> is 2500 m;");
        assert_eq!(object("t='-900' zOffset='90'"), "");
        let objects =
            |angle: f64| of_road(&format!("<objects><object id='3' hdg='{angle}'/></objects>"));
        assert_eq!([objects(1.0), objects(2.5)], ["", ""]);
        let words = "`hdg` of the <object> 3 is 90 rad; degrees? 90° are 1.5708 rad";
        assert_holds!(objects(90.0), words);
        let board = of_road("<signals><signal id='8' hOffset='-180'/></signals>");
        assert_holds!(board, "`hOffset` of the <signal> 8 is -180 rad; degrees? -180° are -3.1416");
    }
}
