//! The container: lists of glTF objects and the one buffer behind them, as a `.glb` file.

use std::collections::HashMap;
use std::f64::consts::TAU;
use std::io::Write;

use lidar_cast::maths;
use serde::Serialize;
use serde_json::{Value, json};
use sightline_scene::scene::DEFAULT_CLASSES;
use sightline_scene::vehicle::BeamTable;

use super::super::Checked;

/// Most bytes: lengths are 32-bit.
const MOST_BYTES: u64 = u32::MAX as u64;
/// Bytes kept for the JSON, which is small beside the buffer.
const JSON_ROOM: u64 = 1 << 30;
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

#[derive(Debug, Clone, Copy)]
pub(super) enum PrimitiveMode {
    Points = 0,
    Lines = 1,
    Triangles = 4,
}

impl PrimitiveMode {
    pub(super) fn primitive(self, points: usize, indices: Option<usize>, material: usize) -> Value {
        let mut primitive = json!({
            "attributes": { "POSITION": points }, "material": material, "mode": self as u32,
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
    pub(super) fn node(&mut self, node: Value) -> usize {
        add(&mut self.nodes, node)
    }

    pub(super) fn mesh(&mut self, name: &str, primitives: Vec<Value>) -> usize {
        add(&mut self.meshes, json!({ "name": name, "primitives": primitives }))
    }

    /// Material of a name, made on first use; colour in linear light.
    pub(super) fn material(&mut self, name: &str, colour: [f64; 4]) -> usize {
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
    pub(super) fn positions(&mut self, positions: &[[f32; 3]]) -> Checked<usize> {
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
    pub(super) fn indices(&mut self, indices: &[u32]) -> Checked<usize> {
        let view = self.view(bytemuck::cast_slice(indices), ELEMENT_ARRAY_BUFFER)?;
        Ok(add(
            &mut self.accessors,
            json!({ "bufferView": view, "componentType": UNSIGNED_INT, "count": indices.len(),
                    "type": "SCALAR" }),
        ))
    }

    /// A stretch of the buffer; all numbers have four bytes, so that all stretches are aligned.
    fn view(&mut self, bytes: &[u8], target: u32) -> Checked<usize> {
        let offset = self.binary.len();
        let (need, limit) = (offset as u64 + bytes.len() as u64, MOST_BYTES - JSON_ROOM);
        if need > limit {
            return Err(refused!(
                "the glTF would have more than {need} bytes, at most {limit} fit; show fewer placements, or no points"
            ));
        }
        self.binary.extend_from_slice(bytes);
        Ok(add(
            &mut self.views,
            json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len(), "target": target }),
        ))
    }

    /// Closes the document: one scene with one root.
    pub(super) fn finish(&mut self, scene: &str, root: usize) {
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
    pub(super) fn write(&self, mut out: impl Write) -> std::io::Result<()> {
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

/// Length of the lines, metres, unless the range is shorter: the whole range would hide the scene.
const LENGTH: f64 = 8.0;
/// A gap of azimuths narrower than this is none: the sensor turns all the way round.
const GAP: f64 = TAU / 24.0;
/// Between lines from the sensor, and between corners of arcs.
const RAY_STEP: f64 = TAU / 24.0;
const ARC_STEP: f64 = TAU / 96.0;
/// Corners between the lowest and the highest beam.
const RISE_STEPS: usize = 6;

/// A sector of azimuths and elevations; radians counter-clockwise from +x and up from level, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Frustum {
    /// First and last azimuth; a whole turn apart for a sensor that turns.
    pub azimuth: [f64; 2],
    /// Lowest and highest elevation.
    pub elevation: [f64; 2],
    /// Lines that are drawn.
    pub length: f64,
}

impl Frustum {
    pub(super) fn of(table: &BeamTable) -> Self {
        let directions = || table.directions().iter().map(|d| d.map(f64::from));
        let rise = |[x, y, z]: [f64; 3]| maths::atan2(z, maths::hypot(x, y));
        let low = directions().map(rise).fold(f64::INFINITY, f64::min);
        let high = directions().map(rise).fold(f64::NEG_INFINITY, f64::max);
        let mut azimuths: Vec<f64> = directions().map(|[x, y, _]| maths::atan2(y, x)).collect();
        azimuths.sort_unstable_by(f64::total_cmp);
        let length = f64::from(table.range()).min(LENGTH);
        Self { azimuth: sector(&azimuths), elevation: [low, high], length }
    }

    /// Ends of line after line.
    pub(super) fn lines(&self) -> Vec<[f32; 3]> {
        let ([from, to], [low, high]) = (self.azimuth, self.elevation);
        let mut ends = Vec::new();
        for ray in steps(from, to, RAY_STEP) {
            ends.extend([[0.0; 3], self.at(ray, low), [0.0; 3], self.at(ray, high)]);
            let rise = |k: usize| low + (high - low) * k as f64 / RISE_STEPS as f64;
            let between = |k: usize| [self.at(ray, rise(k)), self.at(ray, rise(k + 1))];
            ends.extend((0..RISE_STEPS).flat_map(between));
        }
        for elevation in self.elevation {
            let arc: Vec<f64> = steps(from, to, ARC_STEP).collect();
            let arc = arc.windows(2).flat_map(|pair| [pair[0], pair[1]]);
            ends.extend(arc.map(|azimuth| self.at(azimuth, elevation)));
        }
        ends
    }

    fn at(&self, azimuth: f64, elevation: f64) -> [f32; 3] {
        let ([sin, cos], [up, out]) = (
            [maths::sin(azimuth), maths::cos(azimuth)],
            [maths::sin(elevation) * self.length, maths::cos(elevation) * self.length],
        );
        [out * cos, out * sin, up].map(|v| v as f32)
    }
}

/// Even steps from one angle to another, both ends among them.
fn steps(from: f64, to: f64, step: f64) -> impl Iterator<Item = f64> {
    let count = ((to - from) / step).ceil().max(1.0);
    (0..=count as usize).map(move |k| from + (to - from) * k as f64 / count)
}

/// Sector that rising azimuths span: the whole turn without their widest gap.
fn sector(azimuths: &[f64]) -> [f64; 2] {
    let (Some(&first), Some(&last)) = (azimuths.first(), azimuths.last()) else {
        return [0.0, TAU];
    };
    let mut best = (first + TAU - last, [first, last]);
    for pair in azimuths.windows(2) {
        if pair[1] - pair[0] > best.0 {
            best = (pair[1] - pair[0], [pair[1], pair[0] + TAU]);
        }
    }
    if best.0 < GAP { [0.0, TAU] } else { best.1 }
}

pub(super) const FRUSTUM: [f64; 4] = [0.9, 0.35, 0.02, 0.7];

/// sRGB colours of the default classes, close to the palettes of Cityscapes and CARLA.
#[rustfmt::skip]
const COLOURS: [[u8; 3]; DEFAULT_CLASSES.len()] = [
    [112, 112, 118], [190, 153, 153], [85, 90, 100], [220, 20, 60], [153, 153, 153], [222, 214, 170], [128, 100, 128],
    [216, 120, 200], [90, 140, 45], [35, 80, 190], [150, 140, 120], [220, 200, 20], [120, 90, 70], [150, 100, 100],
    [200, 150, 140], [180, 165, 180], [250, 170, 30], [110, 190, 160], [170, 120, 50], [45, 60, 150], [145, 190, 120],
];

/// Colour of a class in linear light, with alpha 1; one of other name has a hue that follows from its letters.
pub(super) fn of_class(name: &str) -> [f64; 4] {
    let known = DEFAULT_CLASSES.iter().position(|known| *known == name);
    let [r, g, b] = known.map_or_else(|| of_letters(name), |class| COLOURS[class].map(linear));
    [r, g, b, 1.0]
}

/// Light of an sRGB value.
fn linear(value: u8) -> f64 {
    let value = f64::from(value) / 255.0;
    let light =
        if value <= 0.040_45 { value / 12.92 } else { maths::pow((value + 0.055) / 1.055, 2.4) };
    (light * 1e4).round() / 1e4
}

fn of_letters(name: &str) -> [f64; 3] {
    let hue =
        name.bytes().fold(7_u32, |hash, byte| hash.wrapping_mul(31).wrapping_add(byte.into()));
    let hue = f64::from(hue % 360) / 60.0;
    [5.0, 3.0, 1.0].map(|n| {
        let k: f64 = (n + hue) % 6.0;
        let value = 0.8 - 0.55 * k.min(4.0 - k).clamp(0.0, 1.0);
        linear((value * 255.0) as u8)
    })
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    /// Frusta span the angles that the sensor was made from, not the rounded directions.
    #[test]
    fn a_frustum_spans_what_the_sensor_was_made_of() {
        let turning = BeamTable::spinning(&[(-25.0, 0.0), (5.0, 0.0)], 250, 100.0).unwrap();
        let found = Frustum::of(&turning);
        assert_eq!((found.azimuth, found.length), ([0.0, TAU], LENGTH));
        let off = |k: usize, degrees: f64| (found.elevation[k] - degrees.to_radians()).abs();
        assert!(off(0, -25.0) < 1e-6 && off(1, 5.0) < 1e-6, "{found:?}");
        for [from, to] in [[-1.0, 0.5], [2.5, 3.9]] {
            let count = 101;
            let turn = |k: i32| from + (to - from) * f64::from(k) / f64::from(count - 1);
            let directions = (0..count).map(|k| DVec3::new(turn(k).cos(), turn(k).sin(), 0.0));
            let table = BeamTable::from_directions(directions, 3.0).unwrap();
            let found = Frustum::of(&table);
            let off = |a: f64, b: f64| (a - b + 1.0).rem_euclid(TAU) - 1.0;
            assert!(off(found.azimuth[0], from).abs() < 1e-6, "{found:?}");
            assert!(off(found.azimuth[1], to).abs() < 1e-6, "{found:?}");
            assert_eq!(found.length, 3.0);
        }
    }

    #[test]
    fn lines_are_as_long_as_they_say() {
        let table = BeamTable::spinning(&[(-12.0, 0.0), (12.0, 0.0)], 90, 50.0).unwrap();
        let lines = Frustum::of(&table).lines();
        assert!(lines.len().is_multiple_of(2));
        for end in lines.iter().filter(|end| **end != [0.0; 3]) {
            let length = end.iter().map(|v| v * v).sum::<f32>().sqrt();
            assert!((length - LENGTH as f32).abs() < 1e-4, "{end:?}");
        }
    }
}
