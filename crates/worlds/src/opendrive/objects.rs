//! Objects of a map as shapes with a class, or counted in a note.

use std::collections::BTreeMap;

use glam::DVec3;
use xodr::{Mesh, Object, ObjectType, Point, RoadNetwork};

use crate::model::class;
use crate::network::{MARK, MapShape, Network};
use crate::world::WorldError;
use sightline_files::Note;

/// Farthest coordinate: beyond it the reader's `f32` is coarser than a centimetre.
pub(super) const MAX_FAR: f64 = 1e5;

pub(super) fn point(p: Point) -> DVec3 {
    DVec3::from(p.to_array().map(f64::from))
}

/// Most square metres of the boxes in plan around the faces of objects: their ground is kept free in cells.
const MAX_AREA: f64 = 4e6;

/// Words in the name and the subtype of an object, and the class that they mean.
const WORDS: &[(&str, u16)] = &[
    ("hedge", class::VEGETATION),
    ("tree", class::VEGETATION),
    ("bush", class::VEGETATION),
    ("vegetation", class::VEGETATION),
    ("pole", class::POLE),
    ("post", class::POLE),
    ("lamp", class::POLE),
    ("bollard", class::POLE),
    ("trafficlight", class::TRAFFIC_LIGHT),
    ("sign", class::TRAFFIC_SIGN),
    ("guard", class::GUARD_RAIL),
    ("jersey", class::WALL),
    ("wall", class::WALL),
    ("noise", class::WALL),
    ("fence", class::FENCE),
    ("railing", class::FENCE),
    ("barrier", class::GUARD_RAIL),
    ("bridge", class::BRIDGE),
    ("building", class::BUILDING),
    ("house", class::BUILDING),
];

/// Class of an object: by its type, where that leaves a choice by the words of its subtype and name.
fn class_of(object: &Object) -> u16 {
    let words = format!("{} {}", object.subtype, object.name).to_lowercase();
    let word = WORDS.iter().find(|(word, _)| words.contains(word)).map(|(_, class)| *class);
    match object.kind {
        ObjectType::Pole | ObjectType::StreetLamp | ObjectType::Gantry => class::POLE,
        ObjectType::Tree | ObjectType::Vegetation => class::VEGETATION,
        ObjectType::Building => class::BUILDING,
        ObjectType::Railing => class::FENCE,
        ObjectType::SoundBarrier => class::WALL,
        ObjectType::TrafficIsland => class::SIDEWALK,
        ObjectType::Patch | ObjectType::RoadSurface => class::ROAD,
        ObjectType::Crosswalk | ObjectType::RoadMark | ObjectType::ParkingSpace => class::ROAD_LINE,
        ObjectType::Barrier => word.unwrap_or(class::GUARD_RAIL),
        _ => word.unwrap_or(class::STATIC),
    }
}

/// True if an object is paint on the road, whatever its height says.
fn painted(kind: ObjectType) -> bool {
    matches!(kind, ObjectType::Crosswalk | ObjectType::RoadMark | ObjectType::ParkingSpace)
}

/// Adds all objects to a network, with a note for those that have no size.
///
/// # Errors
/// Objects that are larger, or farther away, than a world can hold.
pub(super) fn add(
    roads: &RoadNetwork,
    network: &mut Network,
    file: &str,
) -> Result<(), WorldError> {
    let mesh = roads.object_mesh();
    let mut without_size: BTreeMap<&str, usize> = BTreeMap::new();
    let (mut bays, mut area) = (0, 0.0);
    let mut spans = mesh.objects.iter().peekable();
    for object in roads.objects() {
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
        if painted(object.kind) && (marked || object.kind == ObjectType::ParkingSpace) {
            bays += usize::from(!marked);
            continue;
        }
        let lift = if painted(object.kind) { MARK } else { 0.0 };
        let range = span.indices.start as usize..span.indices.end as usize;
        let faces = faces(&mesh, &mesh.indices[range], lift);
        area += faces.iter().map(around).sum::<f64>();
        if !area.is_finite() || area > MAX_AREA {
            let name = file.to_owned();
            let what = "square metres of its objects";
            return Err(WorldError::TooLarge { file: name, what, value: area, most: MAX_AREA });
        }
        network.shapes.push(MapShape {
            class: class_of(object),
            faces,
            solid: !painted(object.kind) && class_of(object) != class::ROAD,
        });
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
