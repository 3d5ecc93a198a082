//! glTF 2.0, `.gltf` and `.glb`: the triangles of the default scene, node transforms applied.
//!
//! Numbers of accessors are plain, sparse, normalized or quantized, and checked against their buffers.

use std::cell::Cell;
use std::path::{Path, PathBuf};

use base64::Engine;
use base64::engine::general_purpose::PAD;
use base64::engine::{DecodePaddingMode, GeneralPurpose};
use gltf::accessor::sparse::IndexType;
use gltf::accessor::{Accessor, DataType, Dimensions};
use gltf::buffer::View;

use super::gltf_json::{self, Parts};
use super::gltf_walk::NodeWalk;
use super::{MAX_FILE, MOST_TOLD, MeshAxes, MeshFault, Parsed, RawMesh};
use sightline_files::Note;
use sightline_files::files::stays_inside;
use sightline_files::json::read_limited;

const READ: [&str; 3] = ["KHR_mesh_quantization", "EXT_mesh_gpu_instancing", "KHR_node_visibility"];
/// Starts of the names of extensions that change no surface: looks, lights, metadata, sound, motion. Draco's comes
/// with plain data beside it where it is not required.
const PASSED: &str = "KHR_materials_ KHR_texture_ EXT_texture_ MSFT_texture_ ADOBE_materials_ KHR_lights_ EXT_lights_ \
    KHR_xmp KHR_animation_ KHR_audio KHR_physics_ EXT_structural_metadata EXT_mesh_features EXT_instance_features \
    EXT_feature_metadata CESIUM_primitive_outline FB_ngon_encoding VRM KHR_draco_mesh_compression";

/// Data in a reference: some exporters leave the padding at its end out.
const DATA_URI: GeneralPurpose = GeneralPurpose::new(
    &base64::alphabet::STANDARD,
    PAD.with_decode_padding_mode(DecodePaddingMode::Indifferent),
);

/// Reads a glTF; buffers beside it are looked up in `dir`. Points, lines, cameras, lights and textures are passed
/// over: they have no surface.
pub(super) fn read(bytes: &[u8], dir: &Path) -> Parsed<RawMesh> {
    // The crate subtracts the 12 bytes of the header from this length unchecked.
    if let Some([b'g', b'l', b'T', b'F', _, _, _, _, length @ ..]) = bytes.first_chunk::<12>()
        && u32::from_le_bytes(*length) < 12
    {
        return Err(MeshFault::new(
            "header",
            "announces a file shorter than itself; export it again",
        ));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let Parts { root: mut json, blob, animations, frames, strange, extensions } =
        gltf_json::read(bytes)?;
    check_attributes(&json)?;
    check_nodes(&json)?;
    let passed = |name: &str| PASSED.split(' ').any(|start| name.starts_with(start));
    let mut mesh = RawMesh::default();
    mesh.notes.extend(strange);
    let used = || json.extensions_used.iter();
    // Files may use what they do not list.
    let unlisted = extensions.iter().filter(|name| !used().any(|used| used == *name));
    let unknown = used().chain(unlisted).map(String::as_str);
    let unknown: Vec<&str> = unknown.filter(|name| !READ.contains(name) && !passed(name)).collect();
    if !unknown.is_empty() {
        let told = unknown[..unknown.len().min(MOST_TOLD)].join(", ");
        mesh.notes.push(Note::doubt(format!(
            "extensions that are not read: {told}; what they add is missing, so export the model without them"
        )));
    }
    // Whatever is left is refused by name.
    json.extensions_required.retain(|name| {
        let harmless = passed(name) && name != "KHR_draco_mesh_compression";
        !READ.contains(&name.as_str()) && !harmless
    });
    let extras =
        json.asset.extras.as_ref().and_then(|extras| serde_json::from_str(extras.get()).ok());
    mesh.axes = extras
        .as_ref()
        .and_then(|extras: &serde_json::Value| MeshAxes::of(extras["axes"].as_str()?));
    if animations > 0 {
        let text =
            format!("{animations} animations are not played; nodes stand where the file puts them");
        mesh.notes.push(Note::fact(text));
    }
    gltf_json::check_required(&json)?;
    gltf_json::check(&json)?;
    let document = gltf::Document::from_json_without_validation(json);
    let buffers = read_buffers(&document, dir, blob, &mut mesh.files)?;
    let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
        return Err(MeshFault::new("file", "holds no scene; export it with its objects in one"));
    };
    let data = Data { buffers, left: Cell::new(MOST_NUMBERS) };
    NodeWalk::new(&document, frames, data, mesh).run(&scene)
}

/// Farthest that the length of a quaternion may be from 1.
const UNIT: f32 = 1e-3;

/// Checks accessor indices, since the crate's validation indexes with them unchecked.
fn check_attributes(json: &gltf::json::Root) -> Parsed<()> {
    let accessors = json.accessors.len();
    for (i, mesh) in json.meshes.iter().enumerate() {
        let mut used = mesh.primitives.iter().flat_map(|p| p.attributes.values());
        if let Some(index) = used.find(|index| index.value() >= accessors) {
            let problem =
                format!("uses accessor {}, there are {accessors}; export it again", index.value());
            return Err(MeshFault::new(format!("mesh {i}"), problem));
        }
    }
    Ok(())
}

/// Refuses another version, and nodes whose place is not one: a matrix beside its parts, a rotation that is none.
fn check_nodes(json: &gltf::json::Root) -> Parsed<()> {
    let version = &json.asset.version;
    let needed = json.asset.min_version.as_ref().filter(|needed| *needed != "2.0");
    if let Some(needed) = needed {
        let problem = format!("needs version {needed:?} (`minVersion`); export glTF 2.0");
        return Err(MeshFault::new("asset", problem));
    }
    if !version.starts_with("2.") {
        return Err(MeshFault::new("asset", format!("is of version {version:?}; export glTF 2.0")));
    }
    for (i, node) in json.nodes.iter().enumerate() {
        let fault = |problem: &str| Err(MeshFault::new(format!("node {i}"), problem.to_owned()));
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
) -> Parsed<Vec<Vec<u8>>> {
    let mut buffers: Vec<Vec<u8>> = Vec::new();
    let mut left = MAX_FILE;
    for buffer in document.buffers() {
        let fault = |problem: String| MeshFault::new(format!("buffer {}", buffer.index()), problem);
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => blob.take().ok_or_else(|| {
                fault("has no data and no name of a file; export it again".to_owned())
            })?,
            gltf::buffer::Source::Uri(uri) if uri.starts_with("data:") => {
                let data = uri.split_once(";base64,").map_or("", |(_, data)| data);
                DATA_URI
                    .decode(data)
                    .map_err(|e| fault(format!("is not base64: {e}; export it again")))?
            }
            gltf::buffer::Source::Uri(uri) => {
                let path = uri.strip_prefix("file:").unwrap_or(uri);
                let path = path.strip_prefix("//").unwrap_or(path);
                let path = urlencoding::decode(path)
                    .map_err(|_| fault(format!("names {uri:?}, which is not UTF-8; rename it")))?;
                let path = stays_inside(dir, &path).map_err(|e| fault(e.to_string()))?;
                files.push(path.clone());
                read_limited(&path, left).map_err(|e| fault(e.to_string()))?
            }
        };
        left = left.saturating_sub(bytes.len() as u64);
        if bytes.len() < buffer.length() {
            let (have, need) = (bytes.len(), buffer.length());
            return Err(fault(format!(
                "holds {have} bytes, {need} are announced; export it again"
            )));
        }
        buffers.push(bytes);
    }
    Ok(buffers)
}

/// Most numbers that one file may ask for: many primitives may share one accessor.
const MOST_NUMBERS: usize = 200_000_000;

/// Most numbers of an accessor without data: a small file can ask for any number.
const MOST_ZEROS: usize = 6_000_000;

/// The buffers of a file, and how many numbers may still be read from them.
pub(super) struct Data {
    buffers: Vec<Vec<u8>>,
    left: Cell<usize>,
}

impl Data {
    /// Numbers of an accessor, item after item; integers are scaled where it says `normalized`.
    ///
    /// # Errors
    /// Another shape, compressed data, or an end past its buffer: the crate's own reader would panic.
    pub(super) fn read(
        &self,
        accessor: &Accessor<'_>,
        shape: Dimensions,
    ) -> Result<Vec<f64>, String> {
        let name = format!("accessor {}", accessor.index());
        let kind = accessor.data_type();
        if accessor.dimensions() != shape {
            return Err(format!(
                "uses {name}, whose items are {:?}, not {shape:?}",
                accessor.dimensions()
            ));
        }
        if shape == Dimensions::Mat4 && kind != DataType::F32 {
            return Err(format!("uses {name}, whose matrices are not f32"));
        }
        let (count, parts) = (accessor.count(), shape.multiplicity());
        if count == 0 {
            return Err(format!("uses {name}, which is empty"));
        }
        let total = count.checked_mul(parts).filter(|total| *total <= self.left.get());
        let total = total.ok_or_else(|| {
            format!("uses {name}, and the file asks for over {MOST_NUMBERS} numbers")
        })?;
        self.left.set(self.left.get() - total);
        let past = || format!("uses {name}, which reaches past its buffer");
        let size = accessor.size();
        let mut numbers = match (accessor.view(), accessor.sparse()) {
            (Some(view), _) => {
                let stride = view.stride().unwrap_or(size);
                if stride < size {
                    return Err(format!("uses {name}, whose items overlap"));
                }
                let bytes =
                    self.slice(&view, accessor.offset(), stride, size, count).ok_or_else(past)?;
                let items = bytes.chunks(stride).take(count);
                items.flat_map(|item| scaled(accessor, &item[..size])).collect()
            }
            // Zeros, some of which sparse values may replace.
            (None, _) if total <= MOST_ZEROS => vec![0.0; total],
            (None, _) => {
                return Err(format!(
                    "uses {name}, {total} numbers without data (`bufferView`), {MOST_ZEROS} may be there; export its data"
                ));
            }
        };
        self.replace(accessor, &mut numbers)?;
        Ok(numbers)
    }

    /// Puts the sparse values of an accessor in their places among its numbers.
    fn replace(&self, accessor: &Accessor<'_>, numbers: &mut [f64]) -> Result<(), String> {
        let Some(sparse) = accessor.sparse() else { return Ok(()) };
        let name = format!("accessor {}", accessor.index());
        let past = || format!("uses {name}, which reaches past its buffer");
        let (indices, values) = (sparse.indices(), sparse.values());
        let kind_of_index = match indices.index_type() {
            IndexType::U8 => DataType::U8,
            IndexType::U16 => DataType::U16,
            IndexType::U32 => DataType::U32,
        };
        let (wide, size) = (kind_of_index.size(), accessor.size());
        let places = self
            .slice(&indices.view(), indices.offset(), wide, wide, sparse.count())
            .ok_or_else(past)?;
        let values = self
            .slice(&values.view(), values.offset(), size, size, sparse.count())
            .ok_or_else(past)?;
        let (count, parts) = (accessor.count(), accessor.dimensions().multiplicity());
        let mut before = None;
        for (place, item) in places.chunks_exact(wide).zip(values.chunks_exact(size)) {
            let place = number(place, kind_of_index) as usize;
            if let Some(before) = before.replace(place).filter(|before| *before >= place) {
                return Err(format!(
                    "uses {name}, whose sparse index {place} follows {before}; glTF sorts them, each once, so export it \
                     again"
                ));
            }
            if place >= count {
                return Err(format!(
                    "uses {name}, whose sparse index {place} is past its {count} items"
                ));
            }
            for (old, new) in
                numbers[place * parts..][..parts].iter_mut().zip(scaled(accessor, item))
            {
                *old = new;
            }
        }
        Ok(())
    }

    /// Bytes of `count` items of a view.
    fn slice(
        &self,
        view: &View<'_>,
        offset: usize,
        stride: usize,
        size: usize,
        count: usize,
    ) -> Option<&[u8]> {
        let need = match count {
            0 => 0,
            _ => (count - 1).checked_mul(stride)?.checked_add(size)?,
        };
        let whole = self.buffers.get(view.buffer().index())?;
        let whole = whole.get(view.offset()..view.offset().checked_add(view.length())?)?;
        whole.get(offset..offset.checked_add(need)?)
    }
}

/// Numbers of an item's bytes, normalized where the accessor says so.
fn scaled<'a>(accessor: &'a Accessor<'_>, item: &'a [u8]) -> impl Iterator<Item = f64> + 'a {
    let kind = accessor.data_type();
    let is_normalized = accessor.normalized();
    item.chunks_exact(kind.size()).map(move |bytes| {
        let value = number(bytes, kind);
        if is_normalized { normalized(value, kind) } else { value }
    })
}

/// A number of a component type, little-endian.
fn number(bytes: &[u8], kind: DataType) -> f64 {
    let bits = bytes.iter().rev().fold(0_u32, |bits, byte| bits << 8 | u32::from(*byte));
    match kind {
        DataType::I8 => f64::from(bits as u8 as i8),
        DataType::I16 => f64::from(bits as u16 as i16),
        DataType::U8 | DataType::U16 | DataType::U32 => f64::from(bits),
        DataType::F32 => f64::from(f32::from_bits(bits)),
    }
}

fn normalized(value: f64, kind: DataType) -> f64 {
    match kind {
        DataType::I8 => (value / 127.0).max(-1.0),
        DataType::U8 => value / 255.0,
        DataType::I16 => (value / 32_767.0).max(-1.0),
        DataType::U16 => value / 65_535.0,
        DataType::U32 | DataType::F32 => value,
    }
}
