//! Elements and numbers of an OpenDRIVE document, checked before its geometry is computed.
//!
//! Points of its lanes are estimated, too: the library's search trees grow with the square of points that lie on one another.

use std::collections::{BTreeMap, BTreeSet};

use lidar_cast::maths;
use roxmltree::{Document, Node};
use sightline_files::Note;
use sightline_files::json::check_xml;

use super::stations::{Profile, RoadStations};
use super::{MAX_LENGTH, MAX_POINTS, doubts, objects, stations, values};
use crate::world::WorldError;

/// Elements that are read: their numbers decide a surface, a shape or a way.
const READ: &[&str] = &[
    "OpenDRIVE", "header", "road", "link", "predecessor", "successor", "planView", "geometry",
    "line", "spiral", "arc", "poly3", "paramPoly3", "elevationProfile", "elevation",
    "lateralProfile", "superelevation", "crossfall", "shape", "crossSectionSurface", "tOffset",
    "surfaceStrips", "strip", "mode", "constant", "linear", "quadratic", "cubic", "coefficients",
    "lanes", "laneOffset", "laneSection", "left", "center", "right", "lane", "width", "border",
    "height", "roadMark", "type", "sway", "explicit", "objects", "object", "repeat", "outlines",
    "outline", "cornerRoad", "cornerLocal", "curveLocal", "skeleton", "polyline", "vertexRoad",
    "vertexLocal", "surface", "markings", "marking", "cornerReference", "borders",
    "objectReference", "signals", "signal", "staticBoard", "vmsBoard", "sign", "positionInertial",
    "positionRoad", "junction", "connection", "laneLink",
];

/// Elements that are passed over on purpose, and why nothing of a world depends on them.
const PASSED: &[(&str, &[&str])] = &[
    ("coordinates stay those of the document", &["geoReference", "offset"]),
    ("rights and data about the document", &["license", "dataQuality", "error", "rawData"]),
    ("data of other programs", &["userData"]),
    (
        "speeds and rules come from the seed",
        &[
            "speed", "access", "restriction", "rule", "defaultRegulations", "roadRegulations",
            "signalRegulations", "semantics", "priority", "validity", "visibility", "layers",
            "layer", "connectedTo",
        ],
    ),
    ("weight and friction are no geometry", &["material"]),
    (
        "lights are not obeyed",
        &[
            "controller", "control", "signalReference", "dependency", "reference", "vmsGroup",
            "vmsBoardReference", "displayArea",
        ],
    ),
    (
        "ways follow links and connections",
        &[
            "neighbor", "laneLinks", "junctionGroup", "junctionReference", "crossPath",
            "startLaneLink", "endLaneLink", "trafficIsland",
        ],
    ),
    ("parking follows lanes of the type `parking`", &["parkingSpace"]),
    (
        "areas of junctions are paved by gaps between lanes",
        &["boundary", "segment", "elevationGrid"],
    ),
];

/// Elements that change the geometry of a real road and are counted in a note.
const COUNTED: &[(&str, &str)] = &[
    ("bridge", "their lanes are drawn, without piers, walls and railings"),
    ("tunnel", "their lanes are drawn, without walls and a ceiling"),
    ("CRG", "the fine surface is left out, the road is smooth"),
    ("railroad", "switches are left out"),
    ("station", "platforms are left out"),
];

/// Numbers of each element: those that it must have, then those that it may have.
pub(super) const NUMBERS: &[(&str, &[&str], &[&str])] = &[
    ("road", &["length"], &[]),
    ("geometry", &["s", "x", "y", "hdg", "length"], &[]),
    ("spiral", &["curvStart", "curvEnd"], &[]),
    ("arc", &["curvature"], &[]),
    ("poly3", &["a", "b", "c", "d"], &[]),
    ("paramPoly3", &["aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV"], &[]),
    ("elevation", &["s", "a", "b", "c", "d"], &[]),
    ("superelevation", &["s", "a", "b", "c", "d"], &[]),
    ("crossfall", &["s", "a", "b", "c", "d"], &[]),
    ("shape", &["s", "t", "a", "b", "c", "d"], &[]),
    ("laneOffset", &["s", "a", "b", "c", "d"], &[]),
    ("laneSection", &["s"], &[]),
    ("lane", &["id"], &[]),
    ("width", &["sOffset", "a", "b", "c", "d"], &[]),
    ("border", &["sOffset", "a", "b", "c", "d"], &[]),
    ("height", &["sOffset", "inner", "outer"], &[]),
    ("roadMark", &["sOffset"], &["width", "height"]),
    ("line", &[], &["length", "space", "tOffset", "sOffset", "width"]),
    ("object", &["s", "t"], OBJECT),
    ("objectReference", &["s", "t"], &["zOffset", "validLength"]),
    ("repeat", &["s", "length", "distance"], REPEAT),
    ("cornerRoad", &["s", "t"], &["dz", "height"]),
    ("cornerLocal", &["u", "v"], &["z", "height"]),
    ("curveLocal", &["u", "v"], &["z", "height", "hdg", "length"]),
    ("coefficients", &["s"], &["a", "b", "c", "d"]),
    ("sway", &["ds"], &["a", "b", "c", "d"]),
    ("marking", &[], MARKING),
    ("positionRoad", &["s", "t"], &["zOffset", "hOffset", "pitch", "roll"]),
    ("positionInertial", &["x", "y"], &["z", "hdg", "pitch", "roll"]),
    ("vertexRoad", &["s", "t"], &["dz", "radius"]),
    ("vertexLocal", &["u", "v"], &["z", "radius"]),
    ("signal", &["s", "t"], &["zOffset", "hOffset", "pitch", "roll", "height", "width", "length"]),
    ("bridge", &["s", "length"], &[]),
    ("tunnel", &["s", "length"], &[]),
    ("laneLink", &["from", "to"], &[]),
];
const OBJECT: &[&str] =
    &["zOffset", "hdg", "pitch", "roll", "length", "width", "height", "radius", "validLength"];
const MARKING: &[&str] =
    &["width", "zOffset", "lineLength", "spaceLength", "startOffset", "stopOffset"];
const REPEAT: &[&str] = &[
    "bT", "cT", "dT", "tStart", "tEnd", "widthStart", "widthEnd", "heightStart", "heightEnd",
    "zOffsetStart", "zOffsetEnd", "lengthStart", "lengthEnd", "radiusStart", "radiusEnd",
];
const SHAPES: &[&str] = &["line", "spiral", "arc", "poly3", "paramPoly3"];
/// Longest part of a value that an error repeats, in characters.
const SHOWN: usize = 40;

/// Facts of a document that its lanes need beside their geometry.
#[derive(Debug, Default)]
pub(super) struct RoadFacts {
    /// Lanes with a height of their own: road, section by `s`, lane.
    pub raised: BTreeSet<(String, usize, i32)>,
    /// Roads on which one drives on the left.
    pub left_hand: BTreeSet<String>,
    /// Heights across the roads that have them, by identifier.
    pub profiles: BTreeMap<String, Profile>,
    /// Identifiers of the roads.
    pub roads: BTreeSet<String>,
    /// Classes of vehicles and persons among the objects, by road or junction and identifier.
    pub movers: BTreeMap<(String, String), u16>,
    /// The document with more points along its roads, where they need any.
    pub text: Option<String>,
    pub notes: Vec<Note>,
}

/// An error at an element: its road or junction, its name, its place along the road.
fn refused(file: &str, node: Node<'_, '_>, what: String) -> WorldError {
    let owner =
        node.ancestors().find(|n| n.has_tag_name("road") || n.has_tag_name("junction")).map(|n| {
            let id = n.attribute("id").unwrap_or("without an id");
            format!("{} {}, ", n.tag_name().name(), shown(id))
        });
    let along = ["s", "sOffset", "id"].iter().find_map(|name| {
        let value = node.attribute(*name).filter(|_| !node.has_tag_name("road"))?;
        Some(format!(" with {name} = {}", shown(value)))
    });
    let place = format!(
        "line {}: {}<{}>{}",
        node.document().text_pos_at(node.range().start).row,
        owner.unwrap_or_default(),
        node.tag_name().name(),
        along.unwrap_or_default()
    );
    WorldError::Refused(format!("{file}: {place} {what}"))
}

/// A value as an error repeats it.
pub(super) fn shown(value: &str) -> String {
    let start: String = value.chars().take(SHOWN).collect();
    if start.len() < value.len() { format!("{start}…") } else { start }
}

/// Checks every element and every number that is used.
///
/// # Errors
/// A number that is missing, none or not finite; a geometry or another element that cannot be read.
pub(super) fn checked(text: &str, file: &str) -> Result<RoadFacts, WorldError> {
    check_xml(text).map_err(|what| WorldError::Refused(format!("{file}: {what}")))?;
    let xml = Document::parse(text).map_err(|source| WorldError::OpenDrive {
        file: file.to_owned(),
        source: Box::new(source.into()),
    })?;
    let mut document = RoadFacts::default();
    let (mut counted, mut unknown) = (BTreeMap::new(), BTreeMap::new());
    let mut next = Some(xml.root_element());
    while let Some(node) = next {
        let name = node.tag_name().name();
        let passed = PASSED.iter().any(|(_, names)| names.contains(&name));
        if let Some(how) = COUNTED.iter().find(|(known, _)| *known == name) {
            *counted.entry(*how).or_insert(0_usize) += 1;
        } else if !passed && !READ.contains(&name) {
            *unknown.entry(shown(name)).or_insert(0_usize) += 1;
        }
        let entered = READ.contains(&name) || COUNTED.iter().any(|(known, _)| *known == name);
        if entered {
            check(node, name, file)?;
            values::check(node, name).map_err(|what| refused(file, node, what))?;
            document.take(node, name, file)?;
        }
        if name == "include" {
            return Err(refused(
                file,
                node,
                "is not followed; write the map as one file".to_owned(),
            ));
        }
        next = following(node, entered);
    }
    let roads = stations::of(&xml);
    check_density(&xml, &roads, file)?;
    if let Some(cut) = roads.iter().find(|stations| stations.is_cut) {
        document.notes.push(Note::doubt(format!(
            "{file}: road {} bends at more places than are followed; its surface is coarser towards its end, split it",
            shown(cut.road.attribute("id").unwrap_or("without an id"))
        )));
    }
    document.text = (!roads.is_empty()).then(|| stations::write(text, &roads));
    for ((name, how), count) in counted {
        document.notes.push(Note::fact(format!("{file}: <{name}> {count} times: {how}")));
    }
    if !unknown.is_empty() {
        let list: Vec<String> = unknown
            .iter()
            .take(12)
            .map(|(name, count)| format!("<{name}> {count} times"))
            .collect();
        document.notes.push(Note::fact(format!(
            "{file}: unknown elements are left out: {}",
            list.join(", ")
        )));
    }
    document.notes.extend(doubts::doubts(&xml, file));
    document.notes.extend(values::notes(&xml, file));
    document.notes.extend(objects::of_unknown_types(&xml, file));
    Ok(document)
}

/// The next element in the order of the document; `inside`: children are visited.
fn following<'a>(node: Node<'a, 'a>, inside: bool) -> Option<Node<'a, 'a>> {
    if let Some(child) = node.first_element_child().filter(|_| inside) {
        return Some(child);
    }
    node.ancestors().find_map(|n| n.next_sibling_element())
}

/// Checks the numbers of an element, and the shape of a geometry.
fn check(node: Node<'_, '_>, name: &str, file: &str) -> Result<(), WorldError> {
    let Some((_, must, may)) = NUMBERS.iter().find(|(known, ..)| *known == name) else {
        return Ok(());
    };
    // Lines of a road mark and of a reference line share a name, as do borders of objects and lanes.
    let stands_in = |tag| node.parent_element().is_some_and(|parent| parent.has_tag_name(tag));
    if (name == "border" && stands_in("borders")) || (name == "width" && stands_in("strip")) {
        return Ok(());
    }
    for (attribute, required) in
        must.iter().map(|a| (a, true)).chain(may.iter().map(|a| (a, false)))
    {
        match node.attribute(*attribute) {
            None if required => {
                return Err(refused(file, node, format!("has no `{attribute}`; add the number")));
            }
            None => {}
            Some(value) => {
                number(value).map_err(|why| {
                    let value = shown(value);
                    refused(file, node, format!("`{attribute}` is `{value}`, {why}"))
                })?;
            }
        }
    }
    let numbers: Vec<&str> = must.iter().chain(*may).copied().collect();
    objects::check(node, name, &numbers).map_err(|what| refused(file, node, what))?;
    if name == "geometry" {
        let shapes: Vec<&str> = node
            .children()
            .filter(|n| n.is_element())
            .map(|n| n.tag_name().name())
            .filter(|name| *name != "userData")
            .collect();
        if shapes.len() != 1 || !SHAPES.contains(&shapes[0]) {
            let found = match shapes.as_slice() {
                [] => "no shape".to_owned(),
                [one] => format!("the unknown shape <{}>", shown(one)),
                several => format!("{} shapes", several.len()),
            };
            let what =
                format!("has {found}; give one of <line>, <spiral>, <arc>, <poly3>, <paramPoly3>");
            return Err(refused(file, node, what));
        }
    }
    Ok(())
}

/// A number of an element, 0 where the attribute is missing; texts that are no numbers were refused before.
pub(super) fn number_or_0(node: Node<'_, '_>, name: &str) -> f64 {
    node.attribute(name).and_then(|text| text.trim().parse().ok()).unwrap_or(0.0)
}

fn number(value: &str) -> Result<f64, &'static str> {
    let point = "not a number; write it as 1.5";
    let number: f64 = value.trim().parse().map_err(|_| match value.contains(',') {
        true => "a number with a comma; write a point in its place",
        false => point,
    })?;
    if number.is_finite() { Ok(number) } else { Err("not finite; write a finite number") }
}

impl RoadFacts {
    /// Notes lanes with heights, the side of the road, and objects that are vehicles or persons.
    fn take(&mut self, node: Node<'_, '_>, name: &str, file: &str) -> Result<(), WorldError> {
        if name == "object"
            && let Some(class) = objects::class_of_mover(node.attribute("type").unwrap_or_default())
        {
            let id = |node: Option<Node<'_, '_>>| node?.attribute("id").map(str::to_owned);
            let owner = node
                .ancestors()
                .find(|n| ["road", "junction"].iter().any(|tag| n.has_tag_name(*tag)));
            self.movers.extend(id(owner).zip(id(Some(node))).map(|key| (key, class)));
        }
        if name != "road" {
            return Ok(());
        }
        let rule = node.attribute("rule").map(str::trim);
        match rule {
            Some("LHT") => {
                self.left_hand.extend(node.attribute("id").map(str::to_owned));
            }
            None | Some("RHT") => {}
            Some(other) => {
                let what = format!("`rule` is `{}`; write RHT or LHT", shown(other));
                return Err(refused(file, node, what));
            }
        }
        if let Some(id) = node.attribute("id")
            && !self.roads.insert(id.to_owned())
        {
            let what = "has the id of a road before it; give each an id of its own";
            return Err(refused(file, node, what.to_owned()));
        }
        let lanes = node.children().filter(|n| n.has_tag_name("lanes")).count();
        if lanes > 2 {
            let what = format!("has {lanes} <lanes>; write one, or one a layer");
            return Err(refused(file, node, what));
        }
        if let Some((id, profile)) = node.attribute("id").zip(Profile::of(node)) {
            self.profiles.insert(id.to_owned(), profile);
        }
        self.raised(node);
        Ok(())
    }

    /// Lanes of a road with a <height>, 0 as well: the file decides, and not the height of our kerb.
    fn raised(&mut self, road: Node<'_, '_>) {
        let start = |n: &Node<'_, '_>| number(n.attribute("s").unwrap_or("0")).unwrap_or(0.0);
        let lanes = road
            .children()
            .filter(|n| n.has_tag_name("lanes") && n.attribute("layer") != Some("temporary"));
        let mut sections: Vec<Node<'_, '_>> =
            lanes.flat_map(|n| n.children()).filter(|n| n.has_tag_name("laneSection")).collect();
        sections.sort_by(|a, b| start(a).total_cmp(&start(b)));
        let id = road.attribute("id").unwrap_or_default();
        for (k, section) in sections.iter().enumerate() {
            let lanes = section.children().flat_map(|side| side.children());
            let high = |n: &Node<'_, '_>| n.children().any(|c| c.has_tag_name("height"));
            for lane in lanes.filter(|n| n.has_tag_name("lane") && high(n)) {
                if let Some(lane) = lane.attribute("id").and_then(|v| v.trim().parse().ok()) {
                    self.raised.insert((id.to_owned(), k, lane));
                }
            }
        }
    }
}

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
fn check_density(
    xml: &Document<'_>,
    stations: &[RoadStations<'_, '_>],
    file: &str,
) -> Result<(), WorldError> {
    let mut cells: BTreeMap<[i64; 2], f64> = BTreeMap::new();
    let (mut points, mut metres) = (0.0, 0.0);
    for road in xml.root_element().children().filter(|node| node.has_tag_name("road")) {
        let lanes = most_lanes(road);
        let length = number_or_0(road, "length");
        let own = stations.iter().find(|stations| stations.road == road);
        let places = own.map_or(&[][..], |stations| &stations.places);
        let plan = road.children().filter(|node| node.has_tag_name("planView"));
        for geometry in plan.flat_map(|plan| plan.children()).filter(Node::is_element) {
            let (start, length) =
                (number_or_0(geometry, "s"), number_or_0(geometry, "length").min(length));
            metres += length;
            if metres > 2.0 * MAX_LENGTH {
                continue;
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
    // Before the library skips a road that is too long.
    if metres > 2.0 * MAX_LENGTH {
        return Err(WorldError::too_large(file, "metres of its roads", metres.round(), MAX_LENGTH));
    }
    if points > MAX_POINTS as f64 {
        let (what, most) = ("points of its lanes", MAX_POINTS as f64);
        return Err(WorldError::too_large(file, what, points.round(), most));
    }
    match cells.into_iter().find(|(_, count)| *count > MOST_IN_CELL) {
        Some((cell, count)) => {
            let ([x, y], count) = (cell.map(|v| (v as f64 + 0.5) * CELL), count.round());
            Err(WorldError::Refused(format!(
                "{file}: {count} points of its lanes lie within 4 m of x = {x}, y = {y}, at most {MOST_IN_CELL} are read; \
                 correct the curvature of the road that turns there, or take roads out that lie on one another"
            )))
        }
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
    let [mut x, mut y, mut heading] = ["x", "y", "hdg"].map(|name| number_or_0(geometry, name));
    let shape = geometry.first_element_child();
    let curvatures = shape.map_or([0.0; 2], |shape| match shape.tag_name().name() {
        "arc" => [number_or_0(shape, "curvature"); 2],
        "spiral" => ["curvStart", "curvEnd"].map(|name| number_or_0(shape, name)),
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
        check_density(&xml, &[], "m").map_err(|error| error.to_string())
    }

    /// 2 lanes with a point every 0.25 m: 2501 m of a circle of 1 mm are 20 008 points, 2499 m are 19 992.
    #[test]
    fn points_on_one_spot_are_counted() {
        let arc = "<arc curvature='1000'/>";
        assert_eq!(document(1, 2499.0, arc), Ok(()));
        assert_holds!(document(1, 2501.0, arc).unwrap_err(), "20008 points", "x = 4, y = 4");
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
