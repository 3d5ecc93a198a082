//! Values of an OpenDRIVE document that the library would read with a silent default: words, records that stand twice,
//! widths below 0, places beyond a road, links to nothing.

use std::collections::{BTreeSet, HashMap};
use std::f64::consts::TAU;

use roxmltree::{Document, Node};
use sightline_files::Note;

use super::attributes::unknown_ones;
use super::document::{number_or_0 as number, shown};
use super::doubts::gap_above;

/// Words of a truth value.
const TRUTH: &[&str] = &["true", "false", "1", "0"];
const ENDS: &[&str] = &["start", "end"];
const KINDS: &[&str] = &["road", "junction"];
/// Words that an attribute of an element may have. An empty text counts as none.
pub(super) const WORDS: &[(&str, &str, &[&str])] = &[
    ("paramPoly3", "pRange", &["arcLength", "normalized"]),
    ("predecessor", "contactPoint", ENDS),
    ("successor", "contactPoint", ENDS),
    ("connection", "contactPoint", ENDS),
    ("predecessor", "elementType", KINDS),
    ("successor", "elementType", KINDS),
    ("junction", "type", &["default", "common", "direct", "virtual", "crossing"]),
    ("connection", "type", &["default", "virtual"]),
    ("lanes", "layer", &["permanent", "temporary"]),
    ("laneSection", "singleSide", TRUTH),
    ("lane", "level", TRUTH),
    ("crossfall", "side", &["left", "right", "both"]),
    ("object", "perpToRoad", TRUTH),
    ("repeat", "detachFromReferenceLine", TRUTH),
    ("outline", "closed", TRUTH),
    ("outline", "outer", TRUTH),
    ("signal", "orientation", &["+", "-", "none"]),
    ("signal", "dynamic", &["yes", "no"]),
];

/// Records that each begin at a place of their own: the parent, the record, the attributes of the place.
const RECORDS: &[(&str, &str, &[&str])] = &[
    ("planView", "geometry", &["s"]),
    ("elevationProfile", "elevation", &["s"]),
    ("lateralProfile", "superelevation", &["s"]),
    ("lateralProfile", "crossfall", &["s", "side"]),
    ("lateralProfile", "shape", &["s", "t"]),
    ("lanes", "laneOffset", &["s"]),
    ("lane", "width", &["sOffset"]),
    ("lane", "border", &["sOffset"]),
    ("lane", "height", &["sOffset"]),
];

/// Metres beyond the end of a road that rounding leaves.
const BEYOND: f64 = 1e-3;
/// Most metres of a road behind the end of its reference line, and between two geometries.
const MOST_BEHIND: f64 = 1000.0;
/// Most corners of an outline: the time to fill it grows with their square.
const MOST_CORNERS: usize = 10_000;
/// Most turns of an arc or a spiral; a ramp of a car park has ten.
const MOST_TURNS: f64 = 100.0;
/// Highest place and largest edge of a sign's board, in metres.
const MOST_OF_A_BOARD: f64 = 100.0;
/// Types of objects that lie flat on the ground without a word.
const FLAT: &[&str] = &["crosswalk", "roadMark", "parkingSpace", "patch", "roadSurface"];

/// Checks an element for values that change geometry or ways.
///
/// # Errors
/// The value, and a remedy, in words that follow the element's place.
pub(super) fn check(node: Node<'_, '_>, name: &str) -> Result<(), String> {
    for (_, attribute, words) in WORDS.iter().filter(|(known, ..)| *known == name) {
        let value = node.attribute(*attribute).filter(|value| !value.trim().is_empty());
        let Some(value) = value else { continue };
        // The library takes any other spelling for none: `TRUE` would be false. It reads a `pRange` in any case.
        let in_any_case = |word: &str| *attribute == "pRange" && word.eq_ignore_ascii_case(value);
        if !words.iter().any(|word| *word == value || in_any_case(word)) {
            let words = words.join(", ");
            return Err(format!("`{attribute}` is `{}`; write one of {words}", shown(value)));
        }
    }
    repeated(node, name)?;
    match name {
        "road" => as_long_as_its_line(node),
        // Lanes would be drawn across the gap.
        "planView" => gap_above(node, MOST_BEHIND)
            .map_or(Ok(()), |words| Err(format!("has a gap: {words}; correct x and y"))),
        "roadMark" => {
            let width = number(node, "width");
            let wanted = "write metres, 0.12 for a line, or none";
            if width < 0.0 { Err(format!("`width` is {width}; {wanted}")) } else { Ok(()) }
        }
        "object" | "objectReference" => on_its_road(node, BEYOND),
        "arc" => turns(node, &["curvature"]),
        "spiral" => turns(node, &["curvStart", "curvEnd"]),
        "signal" => {
            // The library leaves out signals beyond the ends of their road, by however little.
            on_its_road(node, 0.0)?;
            let large = |key: &&str| number(node, key).abs() > MOST_OF_A_BOARD;
            ["zOffset", "height", "width"].iter().find(|key| large(key)).map_or(Ok(()), |key| {
                let metres = number(node, key);
                Err(format!("`{key}` is {metres} m; write at most {MOST_OF_A_BOARD} m, the height and size of a board"))
            })
        }
        "outline" | "polyline" => {
            let corners = node.children().filter(Node::is_element).count();
            if corners > MOST_CORNERS {
                return Err(format!(
                    "has {corners} corners, at most {MOST_CORNERS} are read; thin them out"
                ));
            }
            Ok(())
        }
        _ => Ok(()),
    }
}

/// Refuses a road that goes on for long behind its reference line: points there lie on one another, or are invented.
fn as_long_as_its_line(road: Node<'_, '_>) -> Result<(), String> {
    let plan = road.children().filter(|node| node.has_tag_name("planView"));
    let geometries = plan.flat_map(|plan| plan.children()).filter(|n| n.has_tag_name("geometry"));
    let ends = geometries.map(|node| number(node, "s") + number(node, "length"));
    // A geometry of no length is told for itself.
    let ends = ends.filter(|end| *end >= 0.0);
    let (length, end) = (number(road, "length"), ends.fold(f64::NEG_INFINITY, f64::max));
    if end.is_finite() && length > end + MOST_BEHIND {
        return Err(format!(
            "`length` is {length} m, and its <planView> ends at {end} m; correct one of the two"
        ));
    }
    Ok(())
}

/// Refuses an arc or a spiral that turns round and round: a curvature of another unit, most likely.
fn turns(node: Node<'_, '_>, curvatures: &[&str]) -> Result<(), String> {
    let ends: Vec<f64> = curvatures.iter().map(|key| number(node, key)).collect();
    let (from, to) = (ends[0], ends[ends.len() - 1]);
    // Curvature is linear along the way: a trapezium, or a triangle on each side of where it changes its sign.
    let sum = from.abs() + to.abs();
    let twice = if from * to < 0.0 { (from * from + to * to) / sum } else { sum };
    let length = node.parent_element().map_or(0.0, |parent| number(parent, "length"));
    let turns = 0.5 * twice * length / TAU;
    if turns <= MOST_TURNS {
        return Ok(());
    }
    Err(format!(
        "`{}` of {} over {length} m are {turns:.0} turns, at most {MOST_TURNS} are read; write 1/radius, 0.1 for 10 m",
        curvatures.join("`, `"),
        ends.iter().map(f64::to_string).collect::<Vec<_>>().join(", ")
    ))
}

/// Refuses a record at the place of another one, with other values.
fn repeated(node: Node<'_, '_>, name: &str) -> Result<(), String> {
    for (_, record, keys) in RECORDS.iter().filter(|(parent, ..)| *parent == name) {
        let mut seen: HashMap<Vec<String>, Node<'_, '_>> = HashMap::new();
        for here in node.children().filter(|child| child.has_tag_name(*record)) {
            let place = |key: &'static str| match here.attribute(key) {
                Some(text) => {
                    text.trim().parse().map_or(text.to_owned(), |v: f64| format!("{v:?}"))
                }
                None => String::new(),
            };
            let Some(before) = seen.insert(keys.iter().copied().map(place).collect(), here) else {
                continue;
            };
            let is_same = before.attributes().len() == here.attributes().len()
                && here.attributes().all(|a| before.attribute(a.name()) == Some(a.value()))
                && *record != "geometry";
            if !is_same {
                let key = keys[0];
                let value = shown(here.attribute(key).unwrap_or_default());
                return Err(format!(
                    "has two <{record}> with {key} = {value} and other values; leave one out"
                ));
            }
        }
    }
    Ok(())
}

/// Length of the road that an element stands on, in metres.
fn road_length(node: Node<'_, '_>) -> Option<f64> {
    let road = node.ancestors().find(|n| n.has_tag_name("road"))?;
    Some(number(road, "length"))
}

/// Stretches of an object along its road: its repeats, else its own place.
fn stretches<'a, 'i: 'a>(object: Node<'a, 'i>) -> impl Iterator<Item = [f64; 2]> + 'a {
    let repeats = object.children().filter(|n| n.has_tag_name("repeat"));
    let stretch = |n: Node<'_, '_>| [number(n, "s"), number(n, "s") + number(n, "length")];
    let own = object.children().all(|n| !n.has_tag_name("repeat"));
    let own = own.then(|| [number(object, "s"); 2]);
    own.into_iter().chain(repeats.map(stretch))
}

/// Refuses an object or a signal that stands more than `beyond` metres beyond the ends of its road.
fn on_its_road(object: Node<'_, '_>, beyond: f64) -> Result<(), String> {
    let Some(length) = road_length(object) else { return Ok(()) };
    let is_off = |[from, to]: &[f64; 2]| *to < -beyond || *from > length + beyond;
    match stretches(object).find(is_off) {
        Some([from, _]) => Err(format!(
            "stands at s = {from}, off its road of {length} m; write an s of 0 to {length}"
        )),
        None => Ok(()),
    }
}

/// Parts of objects that are passed over, and links that lead nowhere, each counted in a note.
pub(super) fn notes(xml: &Document<'_>, file: &str) -> Vec<Note> {
    let objects: Vec<Node<'_, '_>> =
        xml.descendants().filter(|node| node.has_tag_name("object")).collect();
    let past = objects.iter().filter(|object| reaches_past(**object));
    let low = objects.iter().filter(|object| has_no_height(**object));
    let what = |found: Vec<&Node<'_, '_>>, words: &str| {
        let first = shown(found.first()?.attribute("id").unwrap_or("without an id"));
        let text = format!("{file}: {} objects {words}, first object {first}", found.len());
        Some(Note::fact(text))
    };
    let past = what(past.collect(), "reach beyond the ends of their roads and are cut there");
    let low = what(low.collect(), "have no `height` and lie flat on the ground");
    let roads = [loose_links(xml, file), loose_junctions(xml, file), gaps_of_lanes(xml, file)];
    let others = [without_lanes(xml, file), versions(xml, file), unknown_ones(xml, file)];
    [past, low].into_iter().chain(roads).chain(others).flatten().collect()
}

/// True if a part of an object is beyond an end of its road.
fn reaches_past(object: Node<'_, '_>) -> bool {
    let Some(length) = road_length(object) else { return false };
    stretches(object).any(|[from, to]| from < -BEYOND || to > length + BEYOND)
}

/// True for an object with a footprint that should stand up, and nothing that says how high.
fn has_no_height(object: Node<'_, '_>) -> bool {
    let above_0 = |node: Node<'_, '_>, name: &str| number(node, name) > 0.0;
    let flat = object.attribute("type").is_some_and(|kind| FLAT.contains(&kind));
    let footprint =
        above_0(object, "radius") || (above_0(object, "length") && above_0(object, "width"));
    let has =
        |tags: &[&str]| object.descendants().any(|n| tags.iter().any(|tag| n.has_tag_name(*tag)));
    let raised = |n: Node<'_, '_>| above_0(n, "heightStart") || above_0(n, "heightEnd");
    // The corners of an outline have heights of their own, and the object's counts for none of them.
    let corner = |n: Node<'_, '_>| n.tag_name().name().starts_with('c') && above_0(n, "height");
    let stands = match has(&["outline"]) {
        true => !above_0(object, "height") || object.descendants().any(corner),
        false => above_0(object, "height") || has(&["skeleton"]),
    };
    !flat && (footprint || has(&["outline"])) && !stands && !object.children().any(raised)
}

/// A note of roads that have no lane beside the line in their middle.
fn without_lanes(xml: &Document<'_>, file: &str) -> Option<Note> {
    let has_none = |road: &Node<'_, '_>| {
        let mut lanes = road.descendants().filter(|n| n.has_tag_name("lane"));
        road.has_tag_name("road") && lanes.all(|lane| number(lane, "id") == 0.0)
    };
    let found: Vec<Node<'_, '_>> = xml.root_element().children().filter(has_none).collect();
    let first = shown(found.first()?.attribute("id").unwrap_or("without an id"));
    let count = found.len();
    Some(Note::fact(format!(
        "{file}: {count} roads have no lane beside their middle, and so no surface, first road {first}"
    )))
}

/// A note of links of roads and junctions whose goal is not in the document.
fn loose_links(xml: &Document<'_>, file: &str) -> Option<Note> {
    let top = || xml.root_element().children();
    let ids = |tag: &'static str| -> BTreeSet<&str> {
        top().filter(|n| n.has_tag_name(tag)).filter_map(|n| n.attribute("id")).collect()
    };
    let (roads, junctions) = (ids("road"), ids("junction"));
    let links = top().flat_map(|n| n.children()).flat_map(|n| match n.tag_name().name() {
        "link" => n.children().filter(|way| !way.has_tag_name("neighbor")).collect(),
        "connection" => vec![n],
        _ => Vec::new(),
    });
    let goals = links.flat_map(|link| {
        let is_junction = link.attribute("elementType") == Some("junction");
        let known = if is_junction { &junctions } else { &roads };
        let goal = link.attribute("elementId").map(|id| (known, id));
        let others = ["incomingRoad", "connectingRoad", "linkedRoad"];
        let others = others.into_iter().filter_map(|name| link.attribute(name));
        goal.into_iter().chain(others.map(|id| (&roads, id))).collect::<Vec<_>>()
    });
    let mut loose = goals.filter(|(known, id)| !known.contains(id)).map(|(_, id)| id);
    let first = loose.next()?;
    Some(Note::fact(format!(
        "{file}: {} links lead to roads or junctions that are not in the file, first to {}; ways end there",
        1 + loose.count(),
        shown(first)
    )))
}

/// A note of roads whose junction is not in the document. OpenDRIVE writes -1 for none.
fn loose_junctions(xml: &Document<'_>, file: &str) -> Option<Note> {
    let top = || xml.root_element().children();
    let known: BTreeSet<&str> =
        top().filter(|n| n.has_tag_name("junction")).filter_map(|n| n.attribute("id")).collect();
    let junction = |road: &Node<'_, '_>| {
        let id = road.attribute("junction").map(str::trim).filter(|id| !["-1", ""].contains(id))?;
        (!known.contains(id))
            .then(|| (shown(road.attribute("id").unwrap_or("without an id")), id.to_owned()))
    };
    let roads: Vec<Node<'_, '_>> = top().filter(|n| n.has_tag_name("road")).collect();
    let mut loose = roads.iter().filter_map(junction);
    let (road, id) = loose.next()?;
    Some(Note::doubt(format!(
        "{file}: {} roads belong to junctions that are not in the file, first road {road} to junction {}; they are taken as \
         ways inside a junction, so write -1 if there is none",
        1 + loose.count(),
        shown(&id)
    )))
}

/// A doubt about sides of sections whose lanes are not numbered 1, 2, 3, … from the middle: a lane may be missing, and the
/// others stand side by side without it.
fn gaps_of_lanes(xml: &Document<'_>, file: &str) -> Option<Note> {
    let sides =
        xml.descendants().filter(|n| ["left", "right"].iter().any(|tag| n.has_tag_name(*tag)));
    let mut gaps = sides.filter_map(|side| {
        let lanes = side.children().filter(|n| n.has_tag_name("lane"));
        let ids = lanes.filter_map(|n| n.attribute("id")?.trim().parse::<i64>().ok());
        // Lane 0 is the middle, which is on no side.
        let mut ids: Vec<i64> = ids.filter(|id| *id != 0).collect();
        ids.sort_unstable_by_key(|id| id.unsigned_abs());
        let (&id, place) = ids
            .iter()
            .zip(1_i64..)
            .find(|(id, place)| id.unsigned_abs() != place.unsigned_abs())?;
        let road = side.ancestors().find(|n| n.has_tag_name("road"))?;
        let road = shown(road.attribute("id").unwrap_or("without an id"));
        Some(format!(
            "first road {road}, where lane {id} stands in place of lane {}",
            place * id.signum()
        ))
    });
    let first = gaps.next()?;
    Some(Note::doubt(format!(
        "{file}: {} sides of lane sections lack a lane number, {first}; lanes lie side by side without the missing one, so \
         number them without gaps",
        1 + gaps.count()
    )))
}

/// Revisions of OpenDRIVE 1 that are read.
const REVISIONS: std::ops::RangeInclusive<u32> = 4..=9;

/// A doubt about a document whose revision is not one of those read here.
fn versions(xml: &Document<'_>, file: &str) -> Option<Note> {
    let header = xml.root_element().children().find(|n| n.has_tag_name("header"));
    let Some(header) = header else {
        return Some(Note::doubt(format!(
            "{file}: has no <header>; the document is read as OpenDRIVE 1.4 to 1.9, so add one with revMajor and revMinor"
        )));
    };
    let stated = |name: &str| header.attribute(name).map(str::trim);
    let (major, minor) = (stated("revMajor"), stated("revMinor"));
    let known = |minor: &str| minor.parse().is_ok_and(|minor: u32| REVISIONS.contains(&minor));
    let is_known = major.is_none_or(|major| major == "1") && minor.is_none_or(known);
    let words = |value: Option<&str>| shown(value.unwrap_or("?"));
    (!is_known).then(|| {
        Note::doubt(format!(
            "{file}: <header> states revMajor {}, revMinor {}; the document is read as OpenDRIVE 1.4 to 1.9, check the version",
            words(major),
            words(minor)
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The library reads `TRUE` as false and ` + ` as none; points behind a `paramPoly3` lie on one another.
    #[test]
    fn values_that_the_library_reads_otherwise_are_refused() {
        let told = |text: &str| {
            let xml = Document::parse(text).unwrap();
            let node = xml.root_element();
            check(node, node.tag_name().name()).err().unwrap_or_default()
        };
        for right in [
            "<lane id='1' level='true'/>",
            "<lane id='1' level=''/>",
            "<paramPoly3 pRange='arclength'/>",
            "<roadMark sOffset='0' width='0'/>",
            "<road length='1119'><planView><geometry s='20' length='100'/></planView></road>",
        ] {
            assert_eq!(told(right), "", "{right}");
        }
        for (text, words) in [
            (
                "<planView><geometry s='0' x='0' length='9'><line/></geometry><geometry s='9' x='1010' length='9'>\
                 <line/></geometry></planView>",
                "has a gap: the <geometry> at s = 9 begins 1001.00 m from the end of the one before it; correct",
            ),
            ("<lane id='1' level='TRUE'/>", "`level` is `TRUE`; write one of true, false, 1, 0"),
            ("<signal orientation=' + '/>", "`orientation` is ` + `; write one of +, -, none"),
            ("<roadMark sOffset='0' width='-0.12'/>", "`width` is -0.12; write metres"),
            (
                "<road length='1121'><planView><geometry s='20' length='100'/></planView></road>",
                "`length` is 1121 m, and its <planView> ends at 120 m; correct one of the two",
            ),
        ] {
            assert_holds!(told(text), words);
        }
    }

    /// The least number has no opposite of its own size.
    #[test]
    fn lanes_of_any_number_are_compared() {
        let told = |ids: &[i64]| {
            let lanes: String = ids.iter().map(|id| format!("<lane id='{id}'/>")).collect();
            let text = format!("<OpenDRIVE><road id='7'><left>{lanes}</left></road></OpenDRIVE>");
            gaps_of_lanes(&Document::parse(&text).unwrap(), "m").map(|note| note.text().to_owned())
        };
        let least = told(&[-1, i64::MIN]).unwrap();
        assert!(least.contains("lane -9223372036854775808 stands in place of lane -2;"), "{least}");
        assert_eq!([told(&[0]), told(&[0, 1, 2]), told(&[])], [None, None, None]);
        assert_holds!(told(&[0, 2]).unwrap(), "lane 2 stands in place of lane 1;");
    }

    #[test]
    fn turns_of_a_spiral_are_those_of_its_mean_curvature() {
        let told = |[from, to]: [f64; 2], turns: f64| {
            let (length, ends) = (turns * TAU, format!("curvStart='{from}' curvEnd='{to}'"));
            let text = format!("<geometry length='{length}'><spiral {ends}/></geometry>");
            let xml = Document::parse(&text).unwrap();
            let spiral = xml.root_element().first_child().unwrap();
            check(spiral, "spiral").err().unwrap_or_default()
        };
        for ends in [[0.0, 2.0], [2.0, 0.0], [1.0, 1.0], [-1.5, -0.5], [-2.0, 2.0]] {
            assert_eq!(told(ends, 99.9), "", "{ends:?}");
            assert!(told(ends, 110.0).contains("are 110 turns"), "{ends:?}");
        }
        // Triangles of a quarter and three quarters of the way: 0.125 + 1.125 a metre.
        assert!(told([-1.0, 3.0], 88.0).contains("`curvEnd` of -1, 3 over"));
        assert!(told([-1.0, 3.0], 88.0).contains("are 110 turns"));
    }
}
