//! glTF 2.0, `.gltf` and `.glb`: the triangles of the default scene, node transforms applied.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;

use super::raw::{Fault, MAX_FILE, MOST_TRIANGLES, RawMesh};
use crate::json::read_limited;

/// Deepest nesting of nodes.
const MAX_DEPTH: usize = 64;
/// Most vertices; primitives may share an accessor, so a small file can ask for any number.
const MAX_VERTICES: usize = 3 * MOST_TRIANGLES;

/// Reads a glTF; buffers beside it are looked up in `dir`. Points and lines are left out.
pub(super) fn read(bytes: &[u8], dir: &Path) -> Result<RawMesh, Fault> {
    let whole = |e: gltf::Error| Fault::new("file", e.to_string());
    // The crate subtracts the 12 bytes of the header from this length unchecked.
    if let Some([b'g', b'l', b'T', b'F', _, _, _, _, length @ ..]) = bytes.first_chunk::<12>()
        && u32::from_le_bytes(*length) < 12
    {
        return Err(Fault::new("header", "announces a file shorter than itself; export it again"));
    }
    let gltf::Gltf { document, blob } =
        gltf::Gltf::from_slice_without_validation(bytes).map_err(whole)?;
    // The crate's validation indexes with these before checking them.
    let json = document.into_json();
    let accessors = json.accessors.len();
    for (i, mesh) in json.meshes.iter().enumerate() {
        let mut used = mesh.primitives.iter().flat_map(|p| p.attributes.values());
        if let Some(index) = used.find(|index| index.value() >= accessors) {
            let problem = format!("uses accessor {}, there are {accessors}", index.value());
            return Err(Fault::new(format!("mesh {i}"), problem));
        }
    }
    let document = gltf::Document::from_json(json).map_err(whole)?;
    let mut files = Vec::new();
    let buffers = read_buffers(&document, dir, blob, &mut files)?;
    let Some(scene) = document.default_scene().or_else(|| document.scenes().next()) else {
        return Err(Fault::new("file", "holds no scene"));
    };
    let mut walk = Walk {
        mesh: RawMesh { files, ..RawMesh::default() },
        buffers: &buffers,
        seen: vec![false; document.nodes().len()],
    };
    for node in scene.nodes() {
        walk.node(&node, DMat4::IDENTITY, 0)?;
    }
    Ok(walk.mesh)
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
                base64::decode(data).map_err(|e| fault(format!("is not base64: {e}")))?
            }
            gltf::buffer::Source::Uri(uri) => {
                let path = uri.strip_prefix("file:").unwrap_or(uri);
                let path = path.strip_prefix("//").unwrap_or(path);
                let path = urlencoding::decode(path)
                    .map_err(|_| fault(format!("names {uri:?}, which is not UTF-8")))?;
                files.push(dir.join(&*path));
                read_limited(&dir.join(&*path), left).map_err(|e| fault(e.to_string()))?
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

struct Walk<'a> {
    mesh: RawMesh,
    buffers: &'a [Vec<u8>],
    /// glTF demands a tree: a node with two parents could make a loop, or exponentially many copies.
    seen: Vec<bool>,
}

impl Walk<'_> {
    fn node(&mut self, node: &gltf::Node<'_>, outer: DMat4, depth: usize) -> Result<(), Fault> {
        let name = format!("node {}", node.index());
        if depth > MAX_DEPTH || std::mem::replace(&mut self.seen[node.index()], true) {
            return Err(Fault::new(name, "is nested too deep or has two parents"));
        }
        let inner = node.transform().matrix().map(|column| column.map(f64::from));
        let placed = outer * DMat4::from_cols_array_2d(&inner);
        if let Some(mesh) = node.mesh() {
            for primitive in mesh.primitives() {
                let name = format!("mesh {}, primitive {}", mesh.index(), primitive.index());
                self.primitive(&primitive, &placed).map_err(|problem| Fault::new(name, problem))?;
            }
        }
        node.children().try_for_each(|child| self.node(&child, placed, depth + 1))
    }

    fn primitive(&mut self, primitive: &gltf::Primitive<'_>, placed: &DMat4) -> Result<(), String> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(());
        }
        let Some(positions) = primitive.get(&gltf::Semantic::Positions) else {
            return Err("has no positions".to_owned());
        };
        let shape = (positions.data_type(), positions.dimensions());
        if shape != (DataType::F32, Dimensions::Vec3) {
            return Err("has positions that are not three f32 numbers each".to_owned());
        }
        self.check_accessor(&positions)?;
        if let Some(indices) = primitive.indices() {
            let kind = indices.data_type();
            let known = matches!(kind, DataType::U8 | DataType::U16 | DataType::U32);
            if !known || indices.dimensions() != Dimensions::Scalar {
                return Err("has indices that are not whole numbers".to_owned());
            }
            self.check_accessor(&indices)?;
        }
        let buffers = self.buffers;
        let reader = primitive.reader(|b| buffers.get(b.index()).map(Vec::as_slice));
        let corners = primitive.indices().map_or(positions.count(), |indices| indices.count());
        let triangles = match mode {
            Mode::Triangles => corners / 3,
            _ => corners.saturating_sub(2),
        };
        if self.mesh.faces.len().saturating_add(triangles) > MOST_TRIANGLES
            || self.mesh.vertices.len().saturating_add(positions.count()) > MAX_VERTICES
        {
            return Err(format!("is one too many: {MOST_TRIANGLES} triangles may be there"));
        }
        let base = self.mesh.vertices.len() as u32;
        let points = reader.read_positions().ok_or("has no positions")?;
        let place = |p: [f32; 3]| placed.transform_point3(DVec3::from(p.map(f64::from)));
        self.mesh.vertices.extend(points.map(place));
        let count = self.mesh.vertices.len() as u32 - base;
        let indices: Vec<u32> = match reader.read_indices() {
            Some(indices) => indices.into_u32().collect(),
            None => (0..count).collect(),
        };
        if let Some(index) = indices.iter().find(|&&i| i >= count) {
            return Err(format!("refers to vertex {index}, it has {count}"));
        }
        let material = self.mesh.material(primitive.material().name());
        let corner = |i: usize| indices[i] + base;
        for i in 0..triangles {
            let face = match mode {
                Mode::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
                Mode::TriangleStrip if i % 2 == 1 => [i + 1, i, i + 2],
                Mode::TriangleStrip => [i, i + 1, i + 2],
                _ => [0, i + 1, i + 2],
            };
            self.mesh.faces.push(face.map(corner));
            self.mesh.face_material.push(material);
        }
        Ok(())
    }

    /// Refuses an accessor that reaches past its buffer: the crate's reader would panic.
    fn check_accessor(&self, accessor: &gltf::Accessor<'_>) -> Result<(), String> {
        let name = accessor.index();
        let Some(view) = accessor.view().filter(|_| accessor.sparse().is_none()) else {
            return Err(format!("uses accessor {name} without plain data (sparse or compressed)"));
        };
        let (size, count) = (accessor.size() as u64, accessor.count() as u64);
        let stride = view.stride().map_or(size, |s| s as u64);
        if stride < size || count == 0 {
            return Err(format!("uses accessor {name}, which is empty or whose items overlap"));
        }
        let length = self.buffers.get(view.buffer().index()).map_or(0, |b| b.len() as u64);
        let need = (count - 1)
            .checked_mul(stride)
            .and_then(|n| n.checked_add(size))
            .and_then(|n| n.checked_add(accessor.offset() as u64));
        let end = (view.offset() as u64).checked_add(view.length() as u64);
        match (need, end) {
            (Some(need), Some(end)) if need <= view.length() as u64 && end <= length => Ok(()),
            _ => Err(format!("uses accessor {name}, which reaches past its buffer")),
        }
    }
}
