//! Scenes by rule, written as a scene file and its mesh.

use std::path::Path;

use serde_json::{Value, json};

use super::target::SceneOutput;
use crate::geom::TriangleSoup;
use crate::runs::{RunError, Watcher};
use crate::scene::street;
use crate::worlds::{WorldKind, generate, mesh_shape};

/// Makes a world of a kind from a seed, with `frames` frames, and writes it to `out`.
///
/// # Errors
/// Files that cannot be written, a world that cannot be made.
pub fn new_world(
    kind: WorldKind,
    seed: u64,
    frames: usize,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    let target = SceneOutput::new(out, None)?;
    let world = generate(kind, seed, frames)?;
    target.write(world.mesh(), &world.scene(&target.name(), &target.mesh_name()), watcher)
}

/// Makes a plain crossing of exactly `triangles` triangles, for timings, and writes it to `out`.
///
/// # Errors
/// Files that cannot be written.
pub fn new_street(
    triangles: usize,
    seed: u64,
    frames: u32,
    out: &Path,
    watcher: &dyn Watcher,
) -> Result<(), RunError> {
    let target = SceneOutput::new(out, None)?;
    let soup = street(triangles, seed);
    target.write(&soup, &plain(&target, frames, &soup), watcher)
}

/// Region, sensor and mount of the own scenes, the sensor with 720 azimuth steps.
fn plain(target: &SceneOutput<'_>, frames: u32, soup: &TriangleSoup) -> Value {
    let body = |size: [f64; 3]| json!([{ "class": "vehicle", "box": { "foot": [0, 0, 0.25], "size": size } }]);
    let route = |from: [f64; 2], to: [f64; 2], spacing: f64| json!({ "points": [from, to], "spacing": spacing });
    json!({
        "sightline": 1,
        "name": target.name(),
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
        "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 720, "range": 100 },
        "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 4 },
        "coverage": "first-hit",
        "frames": frames,
        "ego": { "body": body([4.5, 1.8, 1.3]), "route": route([-12.0, -1.7], [100.0, -1.7], 3.0) },
        "static": [mesh_shape(soup, &target.mesh_name())],
        "actors": [
            { "name": "oncoming", "parts": body([4.4, 1.8, 1.4]), "route": route([40.0, 1.7], [-100.0, 1.7], 5.0) },
            { "name": "ahead", "parts": body([4.4, 1.8, 1.4]), "route": route([6.0, -1.7], [100.0, -1.7], 4.0) },
            { "name": "crossing", "parts": body([8.0, 2.4, 2.8]), "route": route([1.7, -30.0], [1.7, 100.0], 6.0) }
        ]
    })
}
