//! Scans against closed forms, brute force and other ways to the same numbers.

mod bundles;
mod geometry;
mod measurement;

use super::{Scan, Scanner, Scanning};
use sightline_scene::scene::Scene;
use sightline_scene::vehicle::{Placement, SensorPose};

/// A scene of given `static`, `actors` and `ego`, with a sensor of `channels` × `steps` beams and a response.
pub(super) fn scene(things: &str, lidar: &str, response: &str) -> Scene {
    let text = format!(
        r#"{{ "sightline": 1, "name": "test", "rate": 5, "frames": 3, "coverage": "first-hit",
             "roi": {{ "min": [-40, -40, -1], "max": [40, 40, 5], "voxel": [1, 1, 1] }},
             "vehicle": {{ "sensors": [{{ "name": "s", "phase": 0, "lidar": {lidar}, "response": {response} }}],
                           "mounts": [{{ "name": "roof", "min": [-1, -1, 0], "max": [1, 1, 3], "count": [1, 4] }}] }},
             {things} }}"#
    );
    Scene::from_json(&text, "".as_ref(), "test").unwrap()
}

pub(super) fn placement(poses: &[SensorPose]) -> Placement {
    Placement { name: "p".into(), lidars: poses.to_vec() }
}

pub(super) fn scan(scene: &Scene, poses: &[SensorPose], scanning: &Scanning) -> Vec<Scan> {
    let placement = placement(poses);
    let scanner = Scanner::new(scene, &placement, scanning).unwrap();
    scanner.scans().collect()
}

pub(super) fn ideal() -> Scanning {
    Scanning { ideal: true, ..Scanning::default() }
}

/// The bytes of all numbers of scans.
pub(super) fn bits(scans: &[Scan]) -> Vec<u8> {
    format!("{:?}", scans.iter().map(|scan| (&scan.returns, &scan.boxes)).collect::<Vec<_>>())
        .into_bytes()
}
