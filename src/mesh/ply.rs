//! Stanford PLY, ascii and binary, with an optional whole-number `label` on each face.

use std::io::Cursor;

use glam::DVec3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};

use super::raw::{Fault, RawMesh};

/// Vertex or face; other elements set nothing.
#[derive(Default)]
struct Element {
    position: [Option<f64>; 3],
    corners: Option<Vec<u32>>,
    label: Option<i64>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        match name {
            "x" => self.position[0] = number(&value),
            "y" => self.position[1] = number(&value),
            "z" => self.position[2] = number(&value),
            "vertex_indices" | "vertex_index" => self.corners = value.to_u32_list(),
            "label" => self.label = whole(&value),
            _ => return PropertyAccessResult::Ignored,
        }
        PropertyAccessResult::Set
    }
}

fn whole(value: &Property) -> Option<i64> {
    Some(match *value {
        Property::Char(v) => v.into(),
        Property::UChar(v) => v.into(),
        Property::Short(v) => v.into(),
        Property::UShort(v) => v.into(),
        Property::Int(v) => v.into(),
        Property::UInt(v) => v.into(),
        _ => return None,
    })
}

fn number(value: &Property) -> Option<f64> {
    match *value {
        Property::Float(v) => Some(v.into()),
        Property::Double(v) => Some(v),
        _ => whole(value).map(|v| v as f64),
    }
}

/// Reads a PLY; polygons become fans.
pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, Fault> {
    let parser = Parser::<Element>::new();
    let mut reader = Reader::new(Cursor::new(bytes));
    let header = parser.read_header(&mut reader).map_err(|e| Fault::new("header", one_line(&e)))?;
    let left = bytes.len() as u64 - reader.get_ref().position();
    for element in header.elements.values() {
        check_count(element, header.encoding, left)?;
    }
    let mut mesh = RawMesh::default();
    for element in header.elements.values() {
        let name = element.name.as_str();
        let list = parser
            .read_payload_for_element(&mut reader, element, &header)
            .map_err(|e| Fault::new(format!("element {name}"), one_line(&e)))?;
        match name {
            "vertex" => mesh.vertices = vertices(&list)?,
            "face" => faces(&mut mesh, &list)?,
            _ => {}
        }
    }
    Ok(mesh)
}

fn one_line(error: &ply_rs_bw::parser::ParseError) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Refuses a count that the rest of the file cannot hold, before memory is taken for it.
fn check_count(element: &ElementDef, encoding: Encoding, left: u64) -> Result<(), Fault> {
    let smallest = |p: &PropertyType| match (encoding, p) {
        // One digit and one blank.
        (Encoding::Ascii, _) => 2,
        (_, PropertyType::Scalar(s) | PropertyType::List(s, _)) => match s {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        },
    };
    let bytes: u64 = element.properties.values().map(|p| smallest(&p.data_type)).sum();
    // + 1: the last line may lack its line feed.
    let need = (element.count as u64).saturating_mul(bytes.max(1));
    if need <= left + 1 {
        return Ok(());
    }
    let problem = format!(
        "{} announced, which take {need} bytes or more, and {left} follow; is the file cut off?",
        element.count
    );
    Err(Fault::new(format!("element {}", element.name), problem))
}

fn vertices(list: &[Element]) -> Result<Vec<DVec3>, Fault> {
    let position = |(i, e): (usize, &Element)| match e.position {
        [Some(x), Some(y), Some(z)] => Ok(DVec3::new(x, y, z)),
        _ => Err(Fault::new(format!("vertex {i}"), "lacks one of the numbers x, y, z")),
    };
    list.iter().enumerate().map(position).collect()
}

fn faces(mesh: &mut RawMesh, list: &[Element]) -> Result<(), Fault> {
    let mut last: Option<(Option<i64>, u32)> = None;
    for (i, face) in list.iter().enumerate() {
        let Some(corners) = &face.corners else {
            let problem = "has no list `vertex_indices` of whole numbers";
            return Err(Fault::new(format!("face {i}"), problem));
        };
        let [first, rest @ ..] = corners.as_slice() else { continue };
        let material = match last {
            Some((label, material)) if label == face.label => material,
            _ => mesh.material(face.label.map(|l| l.to_string()).as_deref()),
        };
        last = Some((face.label, material));
        for pair in rest.windows(2) {
            mesh.faces.push([*first, pair[0], pair[1]]);
            mesh.face_material.push(material);
        }
    }
    Ok(())
}
