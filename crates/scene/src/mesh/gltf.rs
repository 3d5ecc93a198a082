//! glTF 2.0, `.gltf` and `.glb`: the triangles of the default scene, node transforms applied.

use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::PAD;
use base64::engine::{DecodePaddingMode, GeneralPurpose};

use super::gltf_data::Data;
use super::gltf_walk::Walk;
use super::raw::Axes;
use super::raw::{Fault, MAX_FILE, RawMesh};
use sightline_files::Note;
use sightline_files::files::stays_inside;
use sightline_files::json::read_limited;

/// Extensions that are read.
const READ: [&str; 3] = ["KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "KHR_node_visibility"];
/// Starts of the names of extensions that change no surface: looks, lights, metadata, sound, motion. Draco's comes
/// with plain data beside it where it is not required.
const PASSED: [&str; 19] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "ADOBE_materials_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
    "KHR_animation_",
    "KHR_audio",
    "KHR_physics_",
    "EXT_structural_metadata",
    "EXT_mesh_features",
    "EXT_instance_features",
    "EXT_feature_metadata",
    "CESIUM_primitive_outline",
    "FB_ngon_encoding",
    "VRM",
    "KHR_draco_mesh_compression",
];
/// Names that a note tells.
const MOST_TOLD: usize = 8;

/// Data in a reference: some exporters leave the padding at its end out.
const DATA_URI: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    PAD.with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Reads a glTF; buffers beside it are looked up in `dir`. Points, lines, cameras, lights and textures are passed
/// over: they have no surface.
pub(super) fn read(bytes: &[u8], dir: &Path) -> Result<RawMesh, Fault> {
    let whole = |e: gltf::Error| Fault::new("file", e.to_string());
    // The crate subtracts the 12 bytes of the header from this length unchecked.
    if let Some([b'g', b'l', b'T', b'F', _, _, _, _, length @ ..]) = bytes.first_chunk::<12>()
        && u32::from_le_bytes(*length) < 12
    {
        return Err(Fault::new("header", "announces a file shorter than itself; export it again"));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let gltf::Gltf { document, blob } =
        gltf::Gltf::from_slice_without_validation(bytes).map_err(whole)?;
    let mut json = document.into_json();
    check_attributes(&json)?;
    check_nodes(&json)?;
    let passed = |name: &str| PASSED.iter().any(|start| name.starts_with(start));
    let mut mesh = RawMesh::default();
    let unknown = json.extensions_used.iter().map(String::as_str);
    let unknown: Vec<&str> = unknown.filter(|name| !READ.contains(name) && !passed(name)).collect();
    if !unknown.is_empty() {
        let told = unknown[..unknown.len().min(MOST_TOLD)].join(", ");
        mesh.notes.push(Note::doubt(format!(
            "extensions that are not read: {told}; what they add is missing, so export the model without them"
        )));
    }
    // The crate refuses by name whatever is left.
    json.extensions_required.retain(|name| {
        let harmless = passed(name) && name != "KHR_draco_mesh_compression";
        !READ.contains(&name.as_str()) && !harmless
    });
    let extras =
        json.asset.extras.as_ref().and_then(|extras| serde_json::from_str(extras.get()).ok());
    mesh.axes =
        extras.as_ref().and_then(|extras: &serde_json::Value| Axes::of(extras["axes"].as_str()?));
    if !json.animations.is_empty() {
        let text = format!(
            "{} animations are not played; nodes stand where the file puts them",
            json.animations.len()
        );
        mesh.notes.push(Note::fact(text));
    }
    let document = gltf::Document::from_json(json).map_err(whole)?;
    let buffers = read_buffers(&document, dir, blob, &mut mesh.files)?;
    let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
        return Err(Fault::new("file", "holds no scene"));
    };
    Walk::new(&document, Data::new(buffers), mesh).run(&scene)
}

/// Farthest that the length of a quaternion may be from 1.
const UNIT: f32 = 1e-3;

/// Checks accessor indices, since the crate's validation indexes with them unchecked.
fn check_attributes(json: &gltf::json::Root) -> Result<(), Fault> {
    let accessors = json.accessors.len();
    for (i, mesh) in json.meshes.iter().enumerate() {
        let mut used = mesh.primitives.iter().flat_map(|p| p.attributes.values());
        if let Some(index) = used.find(|index| index.value() >= accessors) {
            let problem = format!("uses accessor {}, there are {accessors}", index.value());
            return Err(Fault::new(format!("mesh {i}"), problem));
        }
    }
    Ok(())
}

/// Refuses another version, and nodes whose place is not one: a matrix beside its parts, a rotation that is none.
fn check_nodes(json: &gltf::json::Root) -> Result<(), Fault> {
    let version = &json.asset.version;
    if !version.starts_with("2.") {
        return Err(Fault::new("asset", format!("is of version {version:?}; export glTF 2.0")));
    }
    for (i, node) in json.nodes.iter().enumerate() {
        let fault = |problem: &str| Err(Fault::new(format!("node {i}"), problem.to_owned()));
        let parts = node.translation.is_some() || node.rotation.is_some() || node.scale.is_some();
        if node.matrix.is_some() && parts {
            return fault(
                "has a matrix beside translation, rotation or scale; leave one of them out",
            );
        }
        let length = |r: &gltf::json::scene::UnitQuaternion| r.0.iter().map(|v| v * v).sum::<f32>();
        if node.rotation.as_ref().is_some_and(|r| (length(r).sqrt() - 1.0).abs() > UNIT) {
            return fault("has a rotation that is no unit quaternion x, y, z, w; normalize it");
        }
    }
    Ok(())
}

/// Bytes of each buffer; opened files are added to `files`.
///
/// The crate's own import opens any path, devices included, panics on names that are not UTF-8, and brings
/// decoders of images.
fn read_buffers(
    document: &gltf::Document,
    dir: &Path,
    mut blob: Option<Vec<u8>>,
    files: &mut Vec<PathBuf>,
) -> Result<Vec<Vec<u8>>, Fault> {
    let mut buffers: Vec<Vec<u8>> = Vec::new();
    let mut left = MAX_FILE;
    for buffer in document.buffers() {
        let fault = |problem: String| Fault::new(format!("buffer {}", buffer.index()), problem);
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => {
                blob.take().ok_or_else(|| fault("has no data and no name of a file".to_owned()))?
            }
            gltf::buffer::Source::Uri(uri) if uri.starts_with("data:") => {
                let data = uri.split_once(";base64,").map_or("", |(_, data)| data);
                DATA_URI.decode(data).map_err(|e| fault(format!("is not base64: {e}")))?
            }
            gltf::buffer::Source::Uri(uri) => {
                let path = uri.strip_prefix("file:").unwrap_or(uri);
                let path = path.strip_prefix("//").unwrap_or(path);
                let path = urlencoding::decode(path)
                    .map_err(|_| fault(format!("names {uri:?}, which is not UTF-8")))?;
                let path = stays_inside(dir, &path).map_err(|e| fault(e.to_string()))?;
                files.push(path.clone());
                read_limited(&path, left).map_err(|e| fault(e.to_string()))?
            }
        };
        left = left.saturating_sub(bytes.len() as u64);
        if bytes.len() < buffer.length() {
            let (have, need) = (bytes.len(), buffer.length());
            return Err(fault(format!("holds {have} bytes, {need} are announced")));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}
