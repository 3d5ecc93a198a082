//! The 3-D view of a page: things, voxels and beams of one scene, as plain data.
//!
//! | file | holds |
//! |---|---|
//! | `sight` | voxels with information, and which layouts see them |
//! | `view.js`, `gl.js` | the view itself, in the page |

pub(crate) mod sight;

use base64::prelude::{BASE64_STANDARD, Engine};
use bytemuck::NoUninit;
use serde_json::{Value, json};

use crate::chart::world::merge_vertices;
use crate::engine::{Backend, BackendError};
use crate::geom::{Pose, TriangleSoup};
use crate::problem::{Problem, SensorBatch, spread};
use crate::psog::Roi;
use crate::scene::{EgoBody, Scene};
use crate::vehicle::Placement;

pub(super) use sight::InformationView;

/// Frames that the slider goes through at most, on a page of one scene and on one of several.
const FRAMES: [u32; 2] = [12, 6];
/// Bytes that the voxels of a page may take, before base64 makes four of three.
const VOXEL_BYTES: usize = 1_500_000;
/// Most voxels that are drawn of all scenes of a page.
const VOXELS: usize = 60_000;

/// Data that the 3-D view of a placement shows in one scene.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ViewData {
    pub scene: String,
    roi: Roi,
    classes: Vec<String>,
    /// Numbers of the frames shown.
    pub frames: Vec<usize>,
    frame_count: usize,
    placement: Placement,
    things: Things,
    pub(super) sight: InformationView,
    beams: BeamEnds,
}

impl ViewData {
    /// View of `placement` and `baselines` in a scene whose problem is over all of its frames. A page holds
    /// `scenes` views, which share its room.
    pub(crate) fn new(
        scene: &Scene,
        problem: &Problem,
        engine: &mut dyn Backend,
        placement: &Placement,
        baselines: &[Placement],
        scenes: usize,
    ) -> Result<Self, BackendError> {
        let frames = spread(problem.frame_count(), Some(FRAMES[usize::from(scenes > 1)]));
        let mask = if placement.lidars.len() > 8 { 2 } else { 1 };
        let each = 7 + baselines.len() + mask * frames.len();
        let most = VOXELS.min(VOXEL_BYTES / each) / scenes;
        Ok(Self {
            scene: scene.name().to_owned(),
            roi: *problem.roi(),
            classes: problem.content().classes().to_vec(),
            frame_count: problem.frame_count(),
            things: Things::new(scene, &frames, scenes),
            sight: InformationView::new(problem, engine, placement, baselines, &frames, most)?,
            beams: BeamEnds::new(problem, engine, placement, &frames, scenes)?,
            placement: placement.clone(),
            frames,
        })
    }

    /// Sentences on frames, things and voxels that the view leaves out.
    pub(crate) fn left_out(&self) -> Vec<String> {
        let (shown, all) = (self.frames.len(), self.frame_count);
        let frames =
            (shown < all).then(|| format!("The slider goes through {shown} of {all} frames."));
        frames.into_iter().chain(self.things.left_out()).chain(self.sight.left_out()).collect()
    }

    /// The JSON header, and the bytes as base64.
    pub(crate) fn packed(&self) -> (String, String) {
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

/// Most triangles of all shapes of a page, which holds 19 bytes of each.
const TRIANGLES: usize = 40_000;
/// Edge in metres of the cells that corners are first merged in where there are more, and of the last.
const CELLS: [f64; 2] = [0.1, 30.0];

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Things {
    /// Equal things share a shape.
    pub shapes: Vec<TriangleSoup>,
    /// Shape of each thing, in the order static world, actors, bodies of the ego.
    pub shape_of: Vec<usize>,
    /// Number of the first body of the ego among the things.
    pub own: usize,
    /// Rows of the rotation and translation from each thing's frame to the ego frame, `[frames][things]`.
    pub poses: Vec<Vec<[f32; 12]>>,
    /// Triangles of the scene's shapes, before any were merged.
    triangles: usize,
}

impl Things {
    /// The things of a scene and their poses in some of its frames, on a page with `scenes` scenes.
    pub(super) fn new(scene: &Scene, frames: &[usize], scenes: usize) -> Self {
        let mut shapes: Vec<TriangleSoup> = Vec::new();
        let mut shape_of = Vec::new();
        for part in scene.parts(EgoBody::Include) {
            let soup = scene.part(part);
            let known = shapes.iter().position(|shape| *shape == soup);
            shape_of.push(known.unwrap_or(shapes.len()));
            if known.is_none() {
                shapes.push(soup);
            }
        }
        let triangles = count(&shapes);
        let rows = |pose: Pose| {
            let (turn, at) = (pose.rotation, pose.translation);
            let row = |k: usize| [0, 1, 2].map(|c| turn.col(c)[k]);
            let ([a, b, c], [d, e, f], [g, h, i]) = (row(0), row(1), row(2));
            [a, b, c, at.x, d, e, f, at.y, g, h, i, at.z].map(|v| v as f32)
        };
        let poses = frames.iter().map(|&k| scene.part_poses(k).into_iter().map(rows).collect());
        Self {
            poses: poses.collect(),
            shapes: few(shapes, TRIANGLES / scenes),
            shape_of,
            own: scene.body_part(),
            triangles,
        }
    }

    /// Sentence on corners that were merged; `None` where none was.
    pub(super) fn left_out(&self) -> Option<String> {
        let (all, shown) = (self.triangles, count(&self.shapes));
        let said = || {
            format!("The scene's {all} triangles are drawn as {shown}: near corners are merged.")
        };
        (shown < all).then(said)
    }
}

fn count(shapes: &[TriangleSoup]) -> usize {
    shapes.iter().map(|shape| shape.faces.len()).sum()
}

/// The shapes with corners merged in ever larger cells until the triangles are few enough. Triangles beyond `most` even
/// then are dropped.
fn few(mut shapes: Vec<TriangleSoup>, most: usize) -> Vec<TriangleSoup> {
    let mut cell = CELLS[0];
    while count(&shapes) > most && cell < CELLS[1] {
        for shape in &mut shapes {
            *shape = merge_vertices(shape, cell);
        }
        cell *= 2.0;
    }
    let mut left = most;
    for shape in &mut shapes {
        shape.faces.truncate(left);
        shape.face_class.truncate(left);
        left -= shape.faces.len();
    }
    shapes
}

/// Most beams of a LiDAR drawn on a page, over its scenes; of more, every second, third and so on is drawn.
const BEAMS: usize = 1200;

/// Ends of beams in the ego frame, metres; beams that hit nothing are left out where beams end at hits.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct BeamEnds {
    /// `[frames][lidars]`.
    pub ends: Vec<Vec<Vec<[f32; 3]>>>,
    /// Largest step over the LiDARs: one in `every` beams is drawn.
    pub every: usize,
    /// Upper bound on the coordinates of all ends.
    pub reach: f32,
}

impl BeamEnds {
    /// The beams of a placement in some frames of a scene, on a page with `scenes` scenes.
    pub(super) fn new(
        problem: &Problem,
        engine: &mut dyn Backend,
        placement: &Placement,
        frames: &[usize],
        scenes: usize,
    ) -> Result<Self, BackendError> {
        let batch = SensorBatch::new(problem, &placement.lidars, None)?;
        let places = placement.lidars.iter().flat_map(|l| [l.x, l.y, l.z]);
        let far = places.fold(0.0, |m: f64, v| m.max(v.abs()));
        let mut beams = Self { ends: vec![], every: 1, reach: problem.far_range() + far as f32 };
        for &frame in frames {
            let hits = problem.geometry(frame).map(|_| engine.hits(&placement.lidars, frame));
            let hits = hits.transpose()?;
            let mut of_frame = Vec::new();
            for (lidar, pose) in batch.ego_from_sensors(frame).iter().enumerate() {
                let directions = batch.table(lidar).directions();
                let every = directions.len().div_ceil(BEAMS.div_ceil(scenes)).max(1);
                beams.every = beams.every.max(every);
                let own = hits.as_ref().map(|hits| &hits[batch.beams_of(lidar)]);
                let end = |beam: usize| {
                    let hit = own.map(|hits| hits[beam]).filter(|hit| hit.is_hit());
                    let missed = (!problem.ends_at_hits()).then(|| batch.range(lidar));
                    let along = glam::DVec3::from(directions[beam].map(f64::from));
                    let t = if problem.ends_at_hits() { hit.map(|hit| hit.t) } else { missed }?;
                    Some(pose.apply(along * f64::from(t)).as_vec3().to_array())
                };
                of_frame.push((0..directions.len()).step_by(every).filter_map(end).collect());
            }
            beams.ends.push(of_frame);
        }
        Ok(beams)
    }
}

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

#[cfg(test)]
pub(super) mod tests;
