//! The scene file of a world, in the keys of `scenes/README.md`, and its mesh.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;

use serde_json::{Value, json};

use super::fleet::{self, BodyPart};
use super::traffic::{ActorPose, Trajectory};
use super::world::{GeneratedWorld, RATE};
use lidar_cast::geom::TriangleSoup;
use lidar_cast::maths;
use sightline_scene::scene::DEFAULT_CLASSES;

impl GeneratedWorld {
    /// The scene of this world, whose static triangles lie in the file `mesh` beside it.
    ///
    /// Region, LiDAR and mount equal those of the example scenes; the LiDAR has 720 azimuth steps.
    pub fn scene(&self, name: &str, mesh: &str) -> Value {
        let used: BTreeSet<usize> = self.people.actors.iter().map(|a| a.model).collect();
        let models = used.iter().map(|&m| &self.people.models[m]);
        let shapes: BTreeMap<&str, &[BodyPart]> =
            models.map(|m| (m.name.as_str(), m.parts.as_slice())).collect();
        let actors: Vec<Value> = self
            .people
            .actors
            .iter()
            .enumerate()
            .map(|(i, a)| {
                let model = &self.people.models[a.model];
                let track = &self.people.scene.tracks[a.track];
                let (key, motion) = motion(track, self.frames);
                json!({ "name": format!("{}-{i}", model.kind), "kind": model.kind,
                    "parts": [{ "shape": model.name }], key: motion })
            })
            .collect();
        let (body, _) = fleet::ego();
        let ego = &self.people.scene.tracks[self.people.ego];
        json!({
            "sightline": 1,
            "name": name,
            "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
            "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 720, "range": 100 },
            "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3],
                       "min_distance": 0.2, "lidars": 4 },
            "coverage": "first-hit",
            "frames": self.frames,
            "rate": RATE,
            "ego": { "body": body, "poses": poses(ego, self.frames) },
            "static": [mesh_shape(&self.model, mesh)],
            "shapes": shapes,
            "actors": actors,
        })
    }
}

/// The shape that reads the mesh in `file` with the classes of its labels.
pub fn mesh_shape(soup: &TriangleSoup, file: &str) -> Value {
    let used: BTreeSet<u16> = soup.face_class.iter().copied().collect();
    let name = |c: u16| (c.to_string(), json!(DEFAULT_CLASSES[usize::from(c)]));
    let classes: serde_json::Map<String, Value> = used.into_iter().map(name).collect();
    json!({ "class": "static", "mesh": { "file": file, "classes": classes } })
}

fn round(v: f64, places: f64) -> f64 {
    (v * places).round() / places
}

fn poses(track: &Trajectory, frames: usize) -> Vec<Value> {
    let pose = |stand: &ActorPose| {
        let [x, y, z] = stand.at.to_array().map(|v| round(v, 1e3));
        let mut pose = json!({ "x": x, "y": y, "z": z, "yaw": round(stand.yaw, 1e4) });
        let pitch = round(stand.pitch, 1e4);
        if pitch != 0.0 {
            pose["pitch"] = json!(pitch);
        }
        pose
    };
    (0..frames).map(|t| pose(track.stand(t))).collect()
}

/// A parked thing as a route without speed, all others as a pose a frame.
fn motion(track: &Trajectory, frames: usize) -> (&'static str, Value) {
    let [stand] = track.stands.as_slice() else { return ("poses", json!(poses(track, frames))) };
    let [x, y, z] = stand.at.to_array().map(|v| round(v, 1e3));
    let (sin, cos) = maths::sin_cos(stand.yaw);
    let points = [[x, y, z], [round(x + cos, 1e4), round(y + sin, 1e4), z]];
    ("route", json!({ "points": points, "spacing": 0 }))
}

/// Writes a mesh as binary PLY with the class of each face as `label`.
///
/// # Errors
/// Errors of the writer.
pub fn write_ply(soup: &TriangleSoup, file: &mut impl Write) -> std::io::Result<()> {
    write!(
        file,
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\n\
         property float y\nproperty float z\nelement face {}\n\
         property list uchar int vertex_indices\nproperty uchar label\nend_header\n",
        soup.vertices.len(),
        soup.faces.len()
    )?;
    for coordinate in soup.vertices.iter().flatten() {
        file.write_all(&coordinate.to_le_bytes())?;
    }
    for (face, &class) in soup.faces.iter().zip(&soup.face_class) {
        file.write_all(&[3])?;
        for vertex in face {
            file.write_all(&vertex.to_le_bytes())?;
        }
        file.write_all(&[class as u8])?;
    }
    Ok(())
}
