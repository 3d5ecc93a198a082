//! The container: lists of glTF objects and the one buffer behind them, as a `.glb` file.

use std::collections::HashMap;
use std::io::Write;

use serde_json::{Value, json};

use super::super::ExportError;

/// Most bytes: lengths are 32-bit.
const MOST_BYTES: u64 = u32::MAX as u64;
/// Bytes kept for the JSON, which is small beside the buffer.
const JSON_ROOM: u64 = 1 << 30;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Mode of a glTF primitive.
#[derive(Debug, Clone, Copy)]
pub(super) enum PrimitiveMode {
    Points = 0,
    Lines = 1,
    Triangles = 4,
}

impl PrimitiveMode {
    /// A primitive of accessors.
    pub fn primitive(self, positions: usize, indices: Option<usize>, material: usize) -> Value {
        let mut primitive = json!({
            "attributes": { "POSITION": positions }, "material": material, "mode": self as u32,
        });
        if let Some(indices) = indices {
            primitive["indices"] = indices.into();
        }
        primitive
    }
}

/// Lists of a glTF document and its binary buffer; adding returns the index.
#[derive(Debug, Clone, Default)]
pub(super) struct Container {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    named: HashMap<String, usize>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    binary: Vec<u8>,
    json: Vec<u8>,
}

fn add(list: &mut Vec<Value>, value: Value) -> usize {
    list.push(value);
    list.len() - 1
}

impl Container {
    pub fn node(&mut self, node: Value) -> usize {
        add(&mut self.nodes, node)
    }

    pub fn mesh(&mut self, name: &str, primitives: Vec<Value>) -> usize {
        add(&mut self.meshes, json!({ "name": name, "primitives": primitives }))
    }

    /// Material of a name, made on first use; colour in linear light.
    pub fn material(&mut self, name: &str, colour: [f64; 4]) -> usize {
        if let Some(&known) = self.named.get(name) {
            return known;
        }
        let mut material = json!({
            "name": name,
            "doubleSided": true,
            "pbrMetallicRoughness":
                { "baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 1.0 },
        });
        if colour[3] < 1.0 {
            material["alphaMode"] = "BLEND".into();
        }
        let index = add(&mut self.materials, material);
        self.named.insert(name.to_owned(), index);
        index
    }

    /// Corners, with the bounds that the format demands.
    ///
    /// # Errors
    /// The file would be too large.
    pub fn positions(&mut self, positions: &[[f32; 3]]) -> Result<usize, ExportError> {
        let view = self.view(bytemuck::cast_slice(positions), ARRAY_BUFFER)?;
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for position in positions {
            for axis in 0..3 {
                low[axis] = low[axis].min(position[axis]);
                high[axis] = high[axis].max(position[axis]);
            }
        }
        // Written as `f64`, an `f32` has all of its digits.
        let [low, high] = [low, high].map(|bound| bound.map(f64::from));
        Ok(add(
            &mut self.accessors,
            json!({ "bufferView": view, "componentType": FLOAT, "count": positions.len(),
                    "type": "VEC3", "min": low, "max": high }),
        ))
    }

    /// Numbers of corners.
    ///
    /// # Errors
    /// The file would be too large.
    pub fn indices(&mut self, indices: &[u32]) -> Result<usize, ExportError> {
        let view = self.view(bytemuck::cast_slice(indices), ELEMENT_ARRAY_BUFFER)?;
        Ok(add(
            &mut self.accessors,
            json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(),
                    "type": "SCALAR" }),
        ))
    }

    /// A stretch of the buffer; all numbers have four bytes, so that all stretches are aligned.
    fn view(&mut self, bytes: &[u8], target: u32) -> Result<usize, ExportError> {
        let offset = self.binary.len();
        let need = offset as u64 + bytes.len() as u64;
        if need > MOST_BYTES - JSON_ROOM {
            return Err(ExportError::GltfTooLarge { need, limit: MOST_BYTES - JSON_ROOM });
        }
        self.binary.extend_from_slice(bytes);
        Ok(add(
            &mut self.views,
            json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "target": target }),
        ))
    }

    /// Closes the document: one scene with one root.
    pub fn finish(&mut self, scene: &str, root: usize) {
        let mut document = json!({
            "asset": { "version": "2.0",
                       "generator": concat!("sightline ", env!("CARGO_PKG_VERSION")),
                       // Value of the key `axes` for this mesh in a scene file.
                       "extras": { "axes": "z-forward" } },
            "scene": 0,
            "scenes": [{ "name": scene, "nodes": [root] }],
            "nodes": std::mem::take(&mut self.nodes),
        });
        // Empty lists are not allowed.
        let lists = [
            ("meshes", &mut self.meshes),
            ("materials", &mut self.materials),
            ("accessors", &mut self.accessors),
            ("bufferViews", &mut self.views),
        ];
        for (name, list) in lists {
            if !list.is_empty() {
                document[name] = std::mem::take(list).into();
            }
        }
        if !self.binary.is_empty() {
            document["buffers"] = json!([{ "byteLength": self.binary.len() }]);
        }
        self.json = document.to_string().into_bytes();
        let padded = self.json.len().next_multiple_of(4);
        self.json.resize(padded, b' ');
    }

    /// Header, JSON, buffer: all little-endian, all lengths multiples of 4.
    pub fn write(&self, mut out: impl Write) -> std::io::Result<()> {
        let chunk = |bytes: &[u8]| if bytes.is_empty() { 0 } else { 8 + bytes.len() };
        let length = 12 + chunk(&self.json) + chunk(&self.binary);
        let length = u32::try_from(length).map_err(std::io::Error::other)?;
        out.write_all(b"glTF")?;
        out.write_all(&2_u32.to_le_bytes())?;
        out.write_all(&length.to_le_bytes())?;
        for (name, bytes) in [(b"JSON", &self.json), (b"BIN\0", &self.binary)] {
            if !bytes.is_empty() {
                out.write_all(&(bytes.len() as u32).to_le_bytes())?;
                out.write_all(name)?;
                out.write_all(bytes)?;
            }
        }
        Ok(())
    }
}
