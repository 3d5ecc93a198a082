//! The view's data as the page holds it: a JSON header, and one run of bytes that it points into.

use base64::prelude::{BASE64_STANDARD, Engine};
use bytemuck::NoUninit;
use serde_json::{Value, json};

use super::ViewData;
use crate::geom::TriangleSoup;

/// Arrays one after the other; each begins at a multiple of four bytes.
#[derive(Default)]
struct Bytes(Vec<u8>);

impl Bytes {
    /// Appends an array; returns its type in JavaScript, its first byte and its length.
    fn put<T: NoUninit>(&mut self, kind: &str, values: &[T]) -> Value {
        let (from, bytes) = (self.0.len(), bytemuck::cast_slice(values));
        self.0.extend_from_slice(bytes);
        self.0.resize(self.0.len().next_multiple_of(4), 0);
        let element = match kind {
            "u8" => 1,
            "u16" => 2,
            _ => 4,
        };
        json!([kind, from, bytes.len() / element])
    }
}

/// Position of a value between two ends, in `steps` steps.
fn step(value: f64, [low, high]: [f64; 2], steps: f64) -> f64 {
    ((value - low) / (high - low).max(1e-9) * steps).round().clamp(0.0, steps)
}

impl ViewData {
    /// The JSON header, and the bytes as base64.
    pub fn packed(&self) -> (String, String) {
        let mut bytes = Bytes::default();
        let shapes: Vec<Value> =
            self.things.shapes.iter().map(|shape| shape_json(shape, &mut bytes)).collect();
        let poses = self.things.poses.concat().concat();
        let (sight, beams) = (&self.sight, &self.beams);
        let byte = |share: f64| step(share, [0.0, 1.0], 255.0) as u8;
        let index: Vec<u32> = sight.voxels.iter().map(|v| v.index).collect();
        let worth: Vec<u8> = sight.voxels.iter().map(|v| byte(v.worth).max(1)).collect();
        let class: Vec<u8> = sight.voxels.iter().map(|v| v.class.min(255) as u8).collect();
        let shares: Vec<u8> = sight.shares.iter().flatten().map(|share| byte(*share)).collect();
        let masks = sight.masks.concat();
        let masks = match self.placement.lidars.len() {
            0..=8 => bytes.put("u8", &masks.iter().map(|m| *m as u8).collect::<Vec<u8>>()),
            _ => bytes.put("u16", &masks),
        };
        let reach = f64::from(beams.reach);
        let end = |v: f32| step(f64::from(v), [-reach, reach], 65535.0) as u16;
        let ends = beams.ends.iter().flatten().flatten().flat_map(|e| e.map(end));
        let ends: Vec<u16> = ends.collect();
        let counts = beams.ends.iter().flatten().map(|ends| ends.len() as u32);
        let counts: Vec<u32> = counts.collect();
        let lidars = self.placement.lidars.iter().map(|pose| json!([pose.x, pose.y, pose.z]));
        let header = json!({
            "scene": self.scene,
            "classes": self.classes,
            "frames": self.frames,
            "roi": { "min": self.roi.min(), "voxel": self.roi.voxel(), "shape": self.roi.shape() },
            "lidars": lidars.collect::<Vec<Value>>(),
            "shapes": shapes,
            "shape_of": self.things.shape_of,
            "own": self.things.own,
            "poses": bytes.put("f32", &poses),
            "voxels": {
                "index": bytes.put("u32", &index),
                "worth": bytes.put("u8", &worth),
                "class": bytes.put("u8", &class),
                "masks": masks,
                "shares": bytes.put("u8", &shares),
            },
            "beams": {
                "ends": bytes.put("u16", &ends),
                "counts": bytes.put("u32", &counts),
                "reach": reach,
            },
        });
        // No text in it ends the script that it stands in.
        (header.to_string().replace('<', "\\u003c"), BASE64_STANDARD.encode(&bytes.0))
    }
}

/// A shape's corners in steps of its box, nine numbers a triangle, and the class of each.
fn shape_json(shape: &TriangleSoup, bytes: &mut Bytes) -> Value {
    let ends = [0, 1, 2].map(|k| {
        let along = || shape.vertices.iter().map(|v| f64::from(v[k]));
        [along().fold(f64::MAX, f64::min), along().fold(f64::MIN, f64::max)]
    });
    let ends = if shape.vertices.is_empty() { [[0.0, 1.0]; 3] } else { ends };
    let corner = |v: [f32; 3]| [0, 1, 2].map(|k| step(f64::from(v[k]), ends[k], 65535.0) as u16);
    let corners = (0..shape.faces.len() as u32).flat_map(|prim| shape.corners(prim));
    let corners: Vec<u16> = corners.flat_map(corner).collect();
    let classes: Vec<u8> = shape.face_class.iter().map(|class| (*class).min(255) as u8).collect();
    json!({
        "min": ends.map(|[low, _]| low),
        "size": ends.map(|[low, high]| high - low),
        "corners": bytes.put("u16", &corners),
        "classes": bytes.put("u8", &classes),
    })
}
