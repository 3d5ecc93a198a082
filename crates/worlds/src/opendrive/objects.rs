//! Objects of a map as shapes with a class, or counted in a note.

use std::collections::BTreeMap;

use glam::DVec3;
use roxmltree::{Document, Node};
use sightline_files::Note;
use xodr::{Mesh, Object, ObjectType, Point, Provenance, RoadNetwork};

use super::document::{RoadFacts, number_or_0 as number, shown};
use super::widths;
use crate::network::{MARK, MapShape, Network, class};
use crate::world::WorldError;

/// Farthest coordinate: beyond it the reader's `f32` is coarser than a centimetre.
pub(super) const MAX_FAR: f64 = 1e5;

pub(super) fn point(p: Point) -> DVec3 {
    DVec3::from(p.to_array().map(f64::from))
}

/// Most square metres of the boxes in plan around the faces of objects: their ground is kept free in cells.
const MAX_AREA: f64 = 4e6;

/// Words in the name and the subtype of an object, and the class that they mean.
#[rustfmt::skip] // Words of a list stand side by side.
const WORDS: &[(&str, u16)] = &[
    ("hedge", class::VEGETATION), ("tree", class::VEGETATION), ("bush", class::VEGETATION),
    ("vegetation", class::VEGETATION), ("pole", class::POLE), ("post", class::POLE), ("lamp", class::POLE),
    ("bollard", class::POLE), ("trafficlight", class::TRAFFIC_LIGHT), ("traffic_light", class::TRAFFIC_LIGHT),
    ("traffic light", class::TRAFFIC_LIGHT), ("signal", class::TRAFFIC_LIGHT), ("sign", class::TRAFFIC_SIGN),
    ("guard", class::GUARD_RAIL), ("jersey", class::WALL), ("wall", class::WALL), ("noise", class::WALL),
    ("fence", class::FENCE), ("railing", class::FENCE), ("barrier", class::GUARD_RAIL), ("bridge", class::BRIDGE),
    ("building", class::BUILDING), ("house", class::BUILDING), ("light", class::POLE),
];

/// Class of an object: by its type, where that leaves a choice by the words of its subtype and name.
fn class_of(object: &Object) -> u16 {
    // A street holds the letters of a tree.
    let words = format!("{} {}", object.subtype, object.name).to_lowercase().replace("street", " ");
    let word = WORDS.iter().find(|(word, _)| words.contains(word)).map(|(_, class)| *class);
    match object.kind {
        ObjectType::Pole | ObjectType::StreetLamp | ObjectType::Gantry => class::POLE,
        ObjectType::Tree | ObjectType::Vegetation => class::VEGETATION,
        ObjectType::Building => class::BUILDING,
        ObjectType::Railing => class::FENCE,
        ObjectType::SoundBarrier => class::WALL,
        ObjectType::TrafficIsland => class::SIDEWALK,
        ObjectType::Patch | ObjectType::RoadSurface => class::ROAD,
        _ if is_painted(object) => class::ROAD_LINE,
        ObjectType::Barrier => word.unwrap_or(class::GUARD_RAIL),
        _ => word.unwrap_or(class::STATIC),
    }
}

/// Class of a vehicle or a person by the type of its object, as OpenDRIVE 1.4 has them; the library knows later types alone.
pub(super) fn class_of_mover(kind: &str) -> Option<u16> {
    match kind.trim() {
        "bike" | "bus" | "car" | "motorbike" | "trailer" | "train" | "tram" | "van" => {
            Some(class::VEHICLE)
        }
        "pedestrian" => Some(class::PEDESTRIAN),
        _ => None,
    }
}

/// Types of objects beside vehicles and persons, as the library knows them, and words for none.
const TYPES: &[&str] = &[
    "", "-1", "none", "obstacle", "pole", "tree", "vegetation", "barrier", "building",
    "parkingSpace", "patch", "railing", "trafficIsland", "crosswalk", "streetLamp", "gantry",
    "soundBarrier", "roadMark", "roadSurface", "wind",
];

/// A note of objects whose type nobody knows; a doubt where capitals alone tell it from a known one.
pub(super) fn of_unknown_types(xml: &Document<'_>, file: &str) -> Option<Note> {
    let types = xml.descendants().filter(|n| n.has_tag_name("object"));
    // The library knows no type with blanks around it.
    let types = types.map(|n| n.attribute("type").unwrap_or_default());
    let unknown: Vec<&str> =
        types.filter(|kind| !TYPES.contains(kind) && class_of_mover(kind).is_none()).collect();
    let meant = |kind: &str| TYPES.iter().find(|known| known.eq_ignore_ascii_case(kind.trim()));
    let slip = unknown.iter().find_map(|kind| Some((*kind, *meant(kind)?)));
    let (first, known) = slip.or(unknown.first().map(|kind| (*kind, "")))?;
    let (count, first) = (unknown.len(), shown(first));
    let text = format!(
        "{file}: {count} objects are of unknown types, `{first}` among them, and take their class from `subtype` and `name`"
    );
    Some(match known {
        "" => Note::fact(text),
        known => Note::doubt(format!("{text}; did you mean `{known}`?")),
    })
}

/// Beginnings of names of paint in maps of CARLA, whose type is none.
const PAINT: &[&str] = &["stencil", "chevronregion"];

/// True if an object is paint on the road, whatever its height says.
fn is_painted(object: &Object) -> bool {
    let name = object.name.to_lowercase();
    match object.kind {
        ObjectType::Crosswalk | ObjectType::RoadMark | ObjectType::ParkingSpace => true,
        ObjectType::None | ObjectType::Unknown => PAINT.iter().any(|paint| name.starts_with(paint)),
        _ => false,
    }
}

/// Adds all objects to a network, with a note for those that have no size.
///
/// # Errors
/// Objects that are larger, or farther away, than a world can hold.
pub(super) fn add(
    map: &RoadNetwork,
    origins: &Provenance,
    facts: &RoadFacts,
    network: &mut Network,
    file: &str,
) -> Result<(), WorldError> {
    let mesh = map.object_mesh();
    let movers = movers(origins, facts);
    let mut without_size: BTreeMap<&str, usize> = BTreeMap::new();
    let (mut bays, mut area) = (0, 0.0);
    let mut spans = mesh.objects.iter().peekable();
    for object in map.objects() {
        let paint = object.markings.iter().flat_map(|m| &m.pieces);
        let paint = paint.chain(object.borders.iter().flat_map(|b| &b.pieces));
        let marks: Vec<[DVec3; 4]> = paint.map(|q| q.map(|p| point(p) + DVec3::Z * MARK)).collect();
        let marked = !marks.is_empty();
        network.marks.extend(marks);
        let Some(span) = spans.next_if(|span| span.object == object.id) else {
            if !marked {
                *without_size.entry(object.kind.as_str()).or_default() += 1;
            }
            continue;
        };
        // A bay is the area inside its lines, and no paint itself.
        if is_painted(object) && (marked || object.kind == ObjectType::ParkingSpace) {
            bays += usize::from(!marked);
            continue;
        }
        let lift = if is_painted(object) { MARK } else { 0.0 };
        let range = span.indices.start as usize..span.indices.end as usize;
        let faces = faces(&mesh, &mesh.indices[range], lift);
        area += faces.iter().map(around).sum::<f64>();
        if !area.is_finite() || area > MAX_AREA {
            let what = "square metres of its objects";
            return Err(WorldError::too_large(file, what, area, MAX_AREA));
        }
        let class = movers.get(&object.id.0).copied().unwrap_or_else(|| class_of(object));
        let solid = !is_painted(object) && class != class::ROAD;
        network.shapes.push(MapShape { class, faces, solid });
    }
    if !without_size.is_empty() {
        let list: Vec<String> = without_size
            .iter()
            .map(|(kind, count)| format!("{count} of the type {kind}"))
            .collect();
        network.notes.push(Note::fact(format!(
            "{file}: objects without length and width, or a radius, are left out: {}",
            list.join(", ")
        )));
    }
    if bays > 0 {
        network.notes.push(Note::fact(format!(
            "{file}: {bays} parking spaces have no markings, and no lines are drawn for them"
        )));
    }
    Ok(())
}

/// Classes of vehicles and persons, by the numbers of their objects in the network.
fn movers(origins: &Provenance, facts: &RoadFacts) -> BTreeMap<usize, u16> {
    let class = |of: &xodr::ObjectProvenance| {
        let own = if of.road_id.is_empty() { &of.junction_id } else { &of.road_id };
        let owner = of.referenced_from.as_ref().unwrap_or(own);
        facts.movers.get(&(owner.clone(), of.od_id.clone())).copied()
    };
    origins.objects.iter().filter_map(|of| Some((of.object.0, class(of)?))).collect()
}

/// Square metres of the box in plan around a face; infinite where it is too far from 0.
fn around(face: &[DVec3; 3]) -> f64 {
    let [a, b, c] = *face;
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let far = low.abs().max_element().max(high.abs().max_element());
    if far > MAX_FAR { f64::INFINITY } else { (high - low).truncate().element_product() }
}

fn faces(mesh: &Mesh, indices: &[u32], lift: f64) -> Vec<[DVec3; 3]> {
    let corner = |k: u32| point(mesh.vertices[k as usize]) + DVec3::Z * lift;
    let faces = indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]].map(corner));
    faces.filter(|face| face.iter().all(|p| p.is_finite())).collect()
}

/// Largest number of an element, and farthest that a polynomial leads along it: far beyond any map, whose limit tells
/// of roads that are large.
const MOST: f64 = 1e9;
/// Largest second derivative of a polynomial, which steps along a road are computed from.
const MOST_BEND: f64 = 1e15;

const ABCD: [&str; 4] = ["a", "b", "c", "d"];
/// Coefficients of the polynomials of each element.
const POLYNOMIALS: &[(&str, &[[&str; 4]])] = &[
    ("poly3", &[ABCD]),
    ("paramPoly3", &[["aU", "bU", "cU", "dU"], ["aV", "bV", "cV", "dV"]]),
    ("elevation", &[ABCD]),
    ("superelevation", &[ABCD]),
    ("crossfall", &[ABCD]),
    ("shape", &[ABCD]),
    ("laneOffset", &[ABCD]),
    ("width", &[ABCD]),
    ("border", &[ABCD]),
];
/// Most siblings behind a record among which the next one is searched.
const FOLLOWED: usize = 1000;
/// Metres across a road that the polynomial of a `shape` is followed.
const ACROSS: f64 = 10.0;

/// Checks that the numbers of an element, and its polynomials where they hold, stay within any map.
///
/// # Errors
/// The attribute or the coefficients, and a remedy, in words that follow the element's place.
pub(super) fn check(node: Node<'_, '_>, name: &str, attributes: &[&str]) -> Result<(), String> {
    let polynomials = POLYNOMIALS.iter().find(|(known, _)| *known == name);
    let polynomials = polynomials.map_or(&[][..], |(_, all)| all);
    let mut plain = attributes.iter().filter(|a| !polynomials.iter().flatten().any(|c| c == *a));
    if let Some(far) = plain.find(|a| number(node, a).abs() > MOST) {
        let value = number(node, far);
        return Err(format!(
            "`{far}` is {value:e}, beyond ±1e9; write a number that a map may have"
        ));
    }
    let is_way = name == "road" || name == "geometry";
    if is_way && number(node, "length") < 0.0 {
        let length = number(node, "length");
        return Err(format!("`length` is {length}; write metres, 0 or more"));
    }
    // The search for the next record is none of elements without polynomials.
    let along = if polynomials.is_empty() { 0.0 } else { along(node, name) };
    match name {
        "width" => widths::wide(node, along)?,
        "laneOffset" => widths::aside(node, along)?,
        _ => {}
    }
    for coefficients in polynomials {
        let [a, b, c, d] = coefficients.map(|name| number(node, name).abs());
        let reach = a + along * (b + along * (c + along * d));
        let slope = b + along * (2.0 * c + along * 3.0 * d);
        let bend = 2.0 * c + along * 6.0 * d;
        // Not a number counts as too far.
        if !(reach <= MOST && slope <= MOST && bend <= MOST_BEND) {
            return Err(format!(
                "`{}` lead farther than 1e9 over its {along} m; write the coefficients of a road",
                coefficients.join("`, `")
            ));
        }
    }
    Ok(())
}

/// Largest value of the parameter that the polynomials of an element are evaluated at.
fn along(node: Node<'_, '_>, name: &str) -> f64 {
    let parent = |tag| node.ancestors().find(|n| n.has_tag_name(tag));
    let length = |node: Option<Node<'_, '_>>| node.map_or(0.0, |n| number(n, "length"));
    match name {
        "paramPoly3" => {
            let range = node.attribute("pRange").unwrap_or_default();
            let is_arc = range.eq_ignore_ascii_case("arcLength");
            if is_arc { length(parent("geometry")) } else { 1.0 }
        }
        "poly3" => length(parent("geometry")),
        "shape" => ACROSS,
        _ => {
            let ends = |node: Node<'_, '_>, key| {
                let start = number(node, key);
                // Bounded: records that all begin at one place would be searched to the end by each.
                let later = node.next_siblings().skip(1).take(FOLLOWED);
                let later = later.filter(|n| n.tag_name() == node.tag_name());
                let next = later.map(|n| number(n, key)).find(|next| *next > start);
                (start, next)
            };
            let road = length(parent("road"));
            let (start, end) = match node.attribute("sOffset") {
                Some(_) => {
                    let section = parent("laneSection").map(|section| ends(section, "s"));
                    let (from, to) = section.unwrap_or((0.0, None));
                    let (start, next) = ends(node, "sOffset");
                    (start, next.unwrap_or(to.unwrap_or(road) - from))
                }
                None => {
                    let (start, next) = ends(node, "s");
                    (start, next.unwrap_or(road))
                }
            };
            (end - start).max(0.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(element: &str, name: &str) -> Option<String> {
        let text = format!(
            "<road length='5000'><planView><geometry length='100'>{element}</geometry></planView><lanes>\
             <laneSection s='10'><right><lane>{element}</lane></right></laneSection><laneSection s='10.01'/></lanes></road>"
        );
        let xml = roxmltree::Document::parse(&text).unwrap();
        let inside = if name == "paramPoly3" { "geometry" } else { "lane" };
        let node = |n: &Node<'_, '_>| {
            n.has_tag_name(name) && n.parent_element().is_some_and(|p| p.has_tag_name(inside))
        };
        check(xml.descendants().find(node).unwrap(), name, &["sOffset", "a", "b", "c", "d"]).err()
    }

    #[test]
    fn coefficients_are_taken_for_as_far_as_they_hold() {
        // The last centimetre before the next section, as programs write it.
        let width = |d: f64| format!("<width sOffset='0' a='3.5' b='0' c='0' d='{d}'/>");
        assert_eq!(told(&width(-7e6), "width"), None);
        assert!(told(&width(1e17), "width").unwrap().contains("`a`, `b`, `c`, `d` lead farther"));
        let poly = |range: &str, c: f64| format!("<paramPoly3 pRange='{range}' bU='1' cV='{c}'/>");
        for (range, c) in [("arcLength", 1e4), ("normalized", 1e8), ("", 1e8)] {
            assert_eq!(told(&poly(range, c), "paramPoly3"), None, "{range}");
            assert!(told(&poly(range, 100.0 * c), "paramPoly3").is_some(), "{range}");
        }
        for huge in [1e20, -1e308] {
            assert!(told(&poly("arcLength", huge), "paramPoly3").unwrap().contains("`cV`, `dV`"));
        }
    }
}
