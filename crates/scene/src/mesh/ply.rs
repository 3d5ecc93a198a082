//! Stanford PLY, ascii and binary: faces and strips, with an optional whole-number `label` on each face or vertex.

use glam::DVec3;

use super::ply_file::{PlyBody, PlyElement, PlyHeader, Property};
use super::polygon::Cutter;
use super::{MOST_TOLD, MeshFault, Parsed, RawMesh};
use sightline_files::Note;

/// Properties of vertices and faces that are skipped without a note: looks, normals, measurements of scanners.
const PASSED: [&str; 40] = [
    "nx", "ny", "nz", "normal_x", "normal_y", "normal_z", "red", "green", "blue", "alpha", "r",
    "g", "b", "a", "diffuse_red", "diffuse_green", "diffuse_blue", "ambient_red", "ambient_green",
    "ambient_blue", "specular_red", "specular_green", "specular_blue", "u", "v", "s", "t",
    "texture_u", "texture_v", "texcoord", "texnumber", "quality", "confidence", "intensity",
    "value", "radius", "curvature", "flags", "material_index", "w",
];
/// Elements without a surface: lines, cameras, points of scans, looks.
const NO_SURFACE: [&str; 6] =
    ["edge", "camera", "range_grid", "material", "point", "multi_texture_face"];
/// Parts of a name that may mean classes.
const CLASS_WORDS: [&str; 5] = ["label", "class", "semantic", "category", "segment"];

const NO_CORNERS: &str =
    "has no list `vertex_indices` or `vertex_index`; rename the list of its corners";

pub(super) fn read(bytes: &[u8]) -> Parsed<RawMesh> {
    let (header, body) = PlyHeader::read(bytes)?;
    let mut reader = PlyReader::default();
    reader.check(&header)?;
    // Faces may come before their vertices, and a polygon is cut by where its corners are.
    for vertices in [true, false] {
        let mut body = body.clone();
        for element in &header.elements {
            match (element.name.as_str(), vertices) {
                ("vertex", true) => reader.vertices(&mut body, element)?,
                (name, false) if FaceLayout::of(name).is_some() => {
                    reader.faces(&mut body, element)?
                }
                _ => body.skip(element)?,
            }
        }
        body.end()?;
    }
    reader.cutter.notes(&mut reader.mesh);
    if reader.mixed > 0 {
        reader.mesh.notes.push(Note::fact(format!(
            "{} faces have corners of different labels and take the label that most corners have, the first one's \
             where none has more; give each face a `label` to decide otherwise",
            reader.mixed
        )));
    }
    Ok(reader.mesh)
}

/// Use of the corners that an element lists.
#[derive(Clone, Copy, PartialEq)]
enum FaceLayout {
    Polygon,
    Strip,
    Fan,
}

impl FaceLayout {
    fn of(element: &str) -> Option<Self> {
        match element {
            "face" | "faces" => Some(Self::Polygon),
            "tristrips" | "tristrip" => Some(Self::Strip),
            "trifans" | "trifan" => Some(Self::Fan),
            _ => None,
        }
    }
}

fn is_corners(property: &Property) -> bool {
    matches!(property.name.as_str(), "vertex_indices" | "vertex_index")
}

/// A whole number in a file.
fn whole(value: f64, what: &str) -> Result<i64, String> {
    if value.fract() == 0.0 && value.abs() < 9e15 {
        return Ok(value as i64);
    }
    Err(format!("has the {what} {value}, which is not a whole number"))
}

#[derive(Default)]
struct PlyReader {
    mesh: RawMesh,
    cutter: Cutter,
    /// Labels of vertices, where the file has them.
    labels: Vec<i64>,
    /// Faces whose corners have different labels.
    mixed: usize,
    corners: Vec<i64>,
    polygon: Vec<u32>,
    /// Label of the last face and its material.
    last: Option<(Option<i64>, u32)>,
}

impl PlyReader {
    /// Refuses headers whose geometry is not read; notes elements and properties that are passed over.
    fn check(&mut self, header: &PlyHeader) -> Parsed<()> {
        let mut unread = Vec::new();
        for (i, element) in header.elements.iter().enumerate() {
            let fault =
                |problem: &str| Err(MeshFault::new(format!("element {}", element.name), problem));
            let name = element.name.as_str();
            let shape = FaceLayout::of(name);
            if name == "vertex" && header.elements[..i].iter().any(|e| e.name == name) {
                return fault("comes twice; keep one");
            }
            if name != "vertex" && shape.is_none() {
                let lists_corners = element.properties.iter().any(is_corners);
                if NO_SURFACE.contains(&name) {
                } else if lists_corners && element.count > 0 {
                    return fault(
                        "lists vertices, but this kind of surface is not read; export it as `face`",
                    );
                } else {
                    unread.push((format!("element {name}"), false));
                }
                continue;
            }
            if shape.is_some()
                && element.count > 0
                && !element.properties.iter().any(|p| is_corners(p) && p.list.is_some())
            {
                return fault(NO_CORNERS);
            }
            let corners = element.properties.iter().filter(|p| is_corners(p));
            let corners: Vec<&str> = corners.map(|property| property.name.as_str()).collect();
            if let [first, second, ..] = corners[..]
                && shape.is_some()
            {
                return fault(&format!(
                    "has `{first}` and `{second}`, two properties for one thing; leave one out"
                ));
            }
            for property in &element.properties {
                if property.name == "label" && property.list.is_some() {
                    return fault("has a list `label`; write one number a row");
                }
                let known = match shape {
                    None => matches!(property.name.as_str(), "x" | "y" | "z" | "label"),
                    Some(_) => is_corners(property) || property.name == "label",
                };
                if !known && !PASSED.contains(&property.name.as_str()) {
                    let class =
                        CLASS_WORDS.iter().any(|word| property.name.to_lowercase().contains(word));
                    unread.push((format!("{name} property {}", property.name), class));
                }
            }
        }
        self.note_unread(&unread);
        Ok(())
    }

    /// Notes elements and properties that are not read, a doubt where one may mean a class.
    fn note_unread(&mut self, unread: &[(String, bool)]) {
        if unread.is_empty() {
            return;
        }
        let told: Vec<&str> =
            unread.iter().take(MOST_TOLD).map(|(name, _)| name.as_str()).collect();
        let more = if unread.len() > MOST_TOLD { " and others" } else { "" };
        let text = format!("passed over: {}{more}", told.join(", "));
        self.mesh.notes.push(match unread.iter().any(|(_, class)| *class) {
            true => Note::doubt(format!(
                "{text}; classes are read from `label` alone: rename the property that holds them"
            )),
            false => Note::fact(text),
        });
    }

    fn vertices(&mut self, body: &mut PlyBody<'_>, element: &PlyElement) -> Parsed<()> {
        let places = ["x", "y", "z"].map(|name| element.scalar(name));
        let label = element.scalar("label");
        if element.count > 0 && places.contains(&None) {
            return Err(MeshFault::new(
                "element vertex",
                "lacks one of the numbers x, y, z; name them so, in small letters",
            ));
        }
        for row in 0..element.count {
            let fault = |problem| MeshFault::new(format!("vertex {row}"), problem);
            let mut position = DVec3::ZERO;
            body.row(element, |body, i, property| {
                if let Some(axis) = places.iter().position(|place| *place == Some(i)) {
                    position[axis] = body.number(property.kind)?;
                } else if label == Some(i) {
                    let value = body.number(property.kind)?;
                    self.labels.push(whole(value, "label")?);
                } else {
                    body.pass(property)?;
                }
                Ok(())
            })
            .map_err(fault)?;
            self.mesh.vertices.push(position);
        }
        Ok(())
    }

    fn faces(&mut self, body: &mut PlyBody<'_>, element: &PlyElement) -> Parsed<()> {
        let shape = FaceLayout::of(&element.name).unwrap_or(FaceLayout::Polygon);
        let place = element.scalar("label");
        for row in 0..element.count {
            let fault = |problem| MeshFault::new(format!("{} {row}", element.name), problem);
            let mut label = None;
            self.corners.clear();
            body.row(element, |body, i, property| match property.list {
                Some(count) if is_corners(property) => {
                    for _ in 0..body.count(count)? {
                        let corner = body.number(property.kind)?;
                        self.corners.push(whole(corner, "vertex")?);
                    }
                    Ok(())
                }
                None if place == Some(i) => {
                    label = Some(whole(body.number(property.kind)?, "label")?);
                    Ok(())
                }
                _ => body.pass(property),
            })
            .map_err(fault)?;
            self.shape(shape, label).map_err(fault)?;
        }
        Ok(())
    }

    /// Adds the surface of the present corners.
    fn shape(&mut self, shape: FaceLayout, label: Option<i64>) -> Result<(), String> {
        let corners = std::mem::take(&mut self.corners);
        let restart = |corner: &i64| {
            shape != FaceLayout::Polygon && (*corner == -1 || *corner == i64::from(u32::MAX))
        };
        let mut result = Ok(());
        for run in corners.split(restart) {
            let mut add = |list: &[i64]| self.face(list, label);
            result = match shape {
                FaceLayout::Polygon => add(run),
                FaceLayout::Strip => {
                    run.windows(3).enumerate().try_for_each(|(i, t)| match i % 2 {
                        0 => add(t),
                        _ => add(&[t[1], t[0], t[2]]),
                    })
                }
                FaceLayout::Fan => {
                    let mut pairs = run.get(1..).unwrap_or_default().windows(2);
                    pairs.try_for_each(|pair| add(&[run[0], pair[0], pair[1]]))
                }
            };
            if result.is_err() {
                break;
            }
        }
        self.corners = corners;
        result
    }

    fn face(&mut self, corners: &[i64], label: Option<i64>) -> Result<(), String> {
        let count = self.mesh.vertices.len();
        self.polygon.clear();
        for &corner in corners {
            let known = usize::try_from(corner).is_ok_and(|corner| corner < count);
            if !known {
                let mend = if count == 0 { "; name the element of points `vertex`" } else { "" };
                return Err(format!("refers to vertex {corner}, there are {count}{mend}"));
            }
            self.polygon.push(corner as u32);
        }
        let label = label.or_else(|| self.label_of_corners());
        let material = match self.last {
            Some((last, material)) if last == label => material,
            // Faces without an area make no class.
            _ if corners.len() < 3 => 0,
            _ => {
                let material = self.mesh.material(label.map(|label| label.to_string()).as_deref());
                self.last = Some((label, material));
                material
            }
        };
        self.cutter.add(&mut self.mesh, &self.polygon, material)
    }

    /// Label of most corners of the present polygon.
    fn label_of_corners(&mut self) -> Option<i64> {
        let labels: Vec<i64> = self
            .polygon
            .iter()
            .map(|&v| self.labels.get(v as usize).copied())
            .collect::<Option<_>>()?;
        let first = *labels.first()?;
        if labels.iter().all(|label| *label == first) {
            return Some(first);
        }
        self.mixed += 1;
        let mut sorted = labels.clone();
        sorted.sort_unstable();
        let count = |label: i64| {
            sorted.partition_point(|l| *l <= label) - sorted.partition_point(|l| *l < label)
        };
        labels.iter().rev().copied().max_by_key(|label| count(*label))
    }
}
