//! The JSON of a glTF, reduced to its meshes before it is checked: looks, motion and cameras have no surface.

use std::collections::BTreeSet;

use glam::{DMat4, DQuat, DVec3};
use gltf::json::Root;
use gltf::json::validation::{Error, Validate};
use serde_json::{Map, Value};
use sightline_files::Note;
use sightline_files::json::{UniqueKeys, is_utf_16, nearest};

use super::{MeshFault, Parsed};

/// The JSON of a file, its binary part, and how many animations are left out.
pub(super) struct Parts {
    pub root: Root,
    pub blob: Option<Vec<u8>>,
    pub animations: usize,
    /// Matrix from each node's frame to its parent's. The crate rounds its numbers to `f32`, by decimetres in
    /// national coordinates.
    pub frames: Vec<DMat4>,
    /// A word on keys that glTF does not know.
    pub strange: Option<Note>,
    /// Names of the extensions of nodes, meshes and primitives, also where the file does not list them.
    pub extensions: BTreeSet<String>,
}

/// Keys of the objects in each list, beside `name`, `extensions` and `extras`.
const KEYS: [(&str, &str); 7] = [
    ("scenes", "nodes"),
    ("nodes", "camera children skin matrix mesh rotation scale translation weights"),
    ("meshes", "primitives weights"),
    ("skins", "inverseBindMatrices skeleton joints"),
    ("accessors", "bufferView byteOffset componentType normalized count type max min sparse"),
    ("bufferViews", "buffer byteOffset byteLength byteStride target"),
    ("buffers", "uri byteLength"),
];
const OF_PRIMITIVE: &str = "attributes indices material mode targets";
/// Keys that every object may have.
const OF_ALL: &str = "name extensions extras";

/// The first key that glTF does not know.
fn strange(json: &Value) -> Option<Note> {
    fn list<'a>(value: &'a Value, key: &str) -> impl Iterator<Item = (usize, &'a Value)> {
        value[key].as_array().into_iter().flatten().enumerate()
    }
    let of_lists = KEYS.into_iter().find_map(|(key, keys)| {
        list(json, key).find_map(|(i, object)| unknown_key(&format!("{key}[{i}]"), object, keys))
    });
    let of_mesh = |(i, mesh)| {
        list(mesh, "primitives").find_map(|(k, one)| {
            unknown_key(&format!("meshes[{i}].primitives[{k}]"), one, OF_PRIMITIVE)
        })
    };
    of_lists.or_else(|| list(json, "meshes").find_map(of_mesh))
}

/// Names of the extensions that nodes, meshes and primitives have.
fn extensions(json: &Value) -> BTreeSet<String> {
    fn all<'a>(value: &'a Value, key: &str) -> impl Iterator<Item = &'a Value> {
        value[key].as_array().into_iter().flatten()
    }
    let meshes = || all(json, "meshes");
    let objects =
        all(json, "nodes").chain(meshes()).chain(meshes().flat_map(|mesh| all(mesh, "primitives")));
    let names = objects.filter_map(|object| object["extensions"].as_object());
    names.flat_map(|extensions| extensions.keys().cloned()).collect()
}

/// A word on the first key of an object that is neither one of `keys` nor one of all objects: a doubt where it is nearly one that
/// is absent.
fn unknown_key(place: &str, object: &Value, keys: &str) -> Option<Note> {
    let odd = |key: &&String| !keys.split(' ').chain(OF_ALL.split(' ')).any(|k| k == *key);
    let key = object.as_object()?.keys().find(odd)?;
    let absent = keys.split(' ').filter(|known| object.get(known).is_none());
    let shown: String = key.chars().take(40).collect();
    let text = format!("{place}: the key `{shown}` is not known here, and not read");
    Some(match nearest(key, absent) {
        Some(meant) => Note::doubt(format!("{text}; did you mean `{meant}`?")),
        None => Note::fact(text),
    })
}

/// Lists that no mesh depends on.
const PASSED: [&str; 5] = ["animations", "cameras", "images", "samplers", "textures"];

pub(super) fn read(bytes: &[u8]) -> Parsed<Parts> {
    let fault = |problem: String| MeshFault::new("file", problem);
    let (text, blob) = if bytes.starts_with(b"glTF") {
        let glb = gltf::Glb::from_slice(bytes);
        let glb =
            glb.map_err(|error| fault(format!("is no whole GLB: {error}; export it again")))?;
        (glb.json, glb.bin.map(|bin| bin.into_owned()))
    } else {
        (bytes.into(), None)
    };
    let no_json = |error| fault(format!("is no glTF: {error}; export it again"));
    if is_utf_16(&text) {
        return Err(fault("is UTF-16; save it as UTF-8".to_owned()));
    }
    // Some writers fill up the JSON of a GLB with zeros in place of spaces.
    let end = text.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let UniqueKeys(mut json) = serde_json::from_slice(&text[..end]).map_err(no_json)?;
    whole(&mut json);
    let (strange, extensions) = (strange(&json), extensions(&json));
    let animations = json["animations"].as_array().map_or(0, Vec::len);
    if let Some(json) = json.as_object_mut() {
        reduce(json);
    }
    // Extras are kept as they are written, which only a text gives.
    let text = json.to_string();
    let root = serde_json::from_str(&text).map_err(no_json)?;
    // The crate has checked the shape of every node by now.
    let nodes = json["nodes"].as_array();
    let frames = nodes.into_iter().flatten().enumerate().map(|(i, node)| frame(i, node));
    let frames = frames.collect::<Parsed<_>>()?;
    Ok(Parts { root, blob, animations, frames, strange, extensions })
}

/// `N` numbers of a list; `None` where there is no such list.
fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let numbers: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    numbers?.try_into().ok()
}

/// Farthest that the last row of a matrix may be from 0, 0, 0, 1.
const LAST_ROW: f64 = 1e-6;

/// A node's matrix, or the matrix of its translation, rotation and scale.
///
/// # Errors
/// A matrix whose last row is not 0, 0, 0, 1: most likely it is written row by row.
fn frame(i: usize, node: &Value) -> Parsed<DMat4> {
    if let Some(matrix) = numbers::<16>(&node["matrix"]) {
        let last = [3, 7, 11, 15].map(|k| matrix[k]);
        let is_off = |(have, want): (&f64, f64)| (have - want).abs() > LAST_ROW;
        if last.iter().zip([0.0, 0.0, 0.0, 1.0]).any(is_off) {
            let [a, b, c, d] = last;
            let problem = format!(
                "matrix: elements 3, 7, 11 and 15 are {a}, {b}, {c}, {d} in place of 0, 0, 0, 1: it is row by row; \
                 glTF stores it column by column, with the translation in elements 12, 13 and 14"
            );
            return Err(MeshFault::new(format!("node {i}"), problem));
        }
        return Ok(DMat4::from_cols_array(&matrix));
    }
    let three = |key: &str, other: DVec3| numbers(&node[key]).map_or(other, DVec3::from_array);
    let turn = numbers(&node["rotation"]).map_or(DQuat::IDENTITY, DQuat::from_array);
    Ok(DMat4::from_scale_rotation_translation(
        three("scale", DVec3::ONE),
        turn,
        three("translation", DVec3::ZERO),
    ))
}

/// Writes whole numbers as integers: 3.0 is one in JSON.
fn whole(value: &mut Value) {
    /// Below it an `f64` holds every integer.
    const MOST: f64 = 9e15;
    match value {
        Value::Array(list) => list.iter_mut().for_each(whole),
        Value::Object(map) => map.values_mut().for_each(whole),
        Value::Number(number) if number.is_f64() => {
            let is_whole = |v: &f64| v.fract() == 0.0 && v.is_sign_positive() && *v < MOST;
            if let Some(v) = number.as_f64().filter(is_whole) {
                *number = (v as u64).into();
            }
        }
        _ => {}
    }
}

/// The objects in a list of an object.
fn each<'a>(
    map: &'a mut Map<String, Value>,
    list: &str,
) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    let list = map.get_mut(list).and_then(Value::as_array_mut);
    list.into_iter().flatten().filter_map(Value::as_object_mut)
}

/// Leaves out all that no mesh depends on, so that no fault in it, and no extension of it, matters.
fn reduce(json: &mut Map<String, Value>) {
    for list in PASSED {
        json.remove(list);
    }
    each(json, "materials").for_each(|material| material.retain(|key, _| key == "name"));
    for node in each(json, "nodes") {
        node.remove("camera");
    }
    for scene in each(json, "scenes") {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    }
    for mesh in each(json, "meshes") {
        for primitive in each(mesh, "primitives") {
            if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut)
            {
                attributes.retain(|name, _| {
                    let of_skin = name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_");
                    of_skin || name == "POSITION"
                });
            }
            each(primitive, "targets").for_each(|target| target.retain(|key, _| key == "POSITION"));
        }
    }
}

/// Refuses extensions that the file requires and that are not read: without them it has other surfaces.
pub(super) fn check_required(root: &Root) -> Parsed<()> {
    let Some(name) = root.extensions_required.first() else { return Ok(()) };
    let mend = match &**name {
        "KHR_draco_mesh_compression" => "Draco compression: export without compression",
        "EXT_meshopt_compression" | "KHR_meshopt_compression" => {
            "meshopt compression: export without compression"
        }
        _ => "export the model without it",
    };
    Err(MeshFault::new("file", format!("requires the extension {name}, which is not read; {mend}")))
}

/// Checks indices and kinds of everything that is left.
///
/// An accessor may be without a buffer view: its numbers are zeros then. The crate's own check refuses it.
pub(super) fn check(root: &Root) -> Parsed<()> {
    let mut faults: Vec<String> = Vec::new();
    root.validate(root, gltf::json::Path::new, &mut |path, error| {
        let path = path();
        let zeros = path.as_str().starts_with("accessors[")
            && path.as_str().ends_with("].bufferView")
            && matches!(error, Error::Missing);
        if !zeros {
            faults.push(format!("{path}: {error};"));
        }
    });
    match faults.is_empty() {
        true => Ok(()),
        false => {
            let told = faults.join(" ");
            Err(MeshFault::new("file", format!("invalid glTF: {told} export it again")))
        }
    }
}
