//! Sensor files that a scene or a vehicle names: the scene's numbers win over the file's.

use std::path::Path;

use crate::scene::Scene;
use crate::vehicle::{Lidar, Response};

const PROFILE: &str = r#"{ "profile": { "scanType": "rotary", "nearRangeM": 0.5, "farRangeM": 120,
    "rangeAccuracyM": 0.03, "minReflectance": 0.1, "minReflectanceRange": 55, "scanRateBaseHz": 20,
    "reportRateBaseHz": 20480, "startAzimuthDeg": -45, "endAzimuthDeg": 45,
    "emitterStates": [{ "azimuthDeg": [0, 0], "elevationDeg": [-15, 15] }] } }"#;

/// A scene whose JSON holds `carrier`: its vehicle or its LiDAR.
fn scene(carrier: &str) -> Scene {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("p.json"), PROFILE).unwrap();
    let text = format!(
        r#"{{ "sightline": 1, "roi": {{ "min": [-4, -4, -1], "max": [4, 4, 3], "voxel": [1, 1, 1] }},
            "psog": {{ "file": "x.npz" }}, "coverage": "through", {carrier} }}"#
    );
    Scene::from_json(&text, dir.path(), "scene.json").unwrap()
}

fn in_scene(lidar: &str) -> Scene {
    scene(&format!(
        r#""lidar": {lidar}, "mount": {{ "min": [0, 0, 1], "max": [0, 0, 1], "lidars": 1 }}"#
    ))
}

fn on_vehicle(lidar: &str, response: &str) -> Scene {
    scene(&format!(
        r#""vehicle": {{ "sensors": [{{ "name": "a", "lidar": {lidar}{response} }}],
            "mounts": [{{ "name": "roof", "min": [0, 0, 1], "max": [0, 0, 1], "count": 1 }}] }}"#
    ))
}

fn notes(scene: &Scene) -> String {
    scene
        .notes()
        .iter()
        .map(|note| note.text().rsplit('/').next().unwrap())
        .collect::<Vec<_>>()
        .join("\n")
}

fn response(scene: &Scene) -> Response {
    scene.sensors().unwrap().models()[0].response
}

#[test]
fn ranges_errors_and_windows_are_those_of_the_file() {
    let file = r#"{ "file": "p.json" }"#;
    for scene in [in_scene(file), on_vehicle(file, "")] {
        // 1024 columns a turn, every 0.3516 degrees: 128 on each side of the first one.
        let Lidar::Spinning { azimuth_steps, azimuth, range, .. } = scene.lidars()[0] else {
            panic!()
        };
        assert_eq!((*azimuth_steps, *azimuth, *range), (257, Some([-45.0, 45.0]), 120.0));
        let Response { rate, rated_range, noise, min_range, .. } = response(&scene);
        assert_eq!([rate, rated_range, noise, min_range], [20.0, 55.0, 0.03, 0.5]);
        assert!(notes(&scene).contains("from -45 to 45 degrees; only columns of this window"));
    }
}

#[test]
fn a_scene_that_says_otherwise_counts_and_is_told() {
    let given = r#"{ "file": "p.json", "range": 100, "azimuth_steps": 512 }"#;
    let response_given = r#", "response": { "noise": 0.01, "rate": 20 }"#;
    let scene = on_vehicle(given, response_given);
    let Lidar::Spinning { azimuth_steps, range, .. } = scene.lidars()[0] else { panic!() };
    assert_eq!((*azimuth_steps, *range), (129, 100.0));
    let Response { rated_range, noise, .. } = response(&scene);
    assert_eq!((rated_range, noise), (55.0, 0.01));
    let said = notes(&scene);
    for part in [
        "range: 100; the sensor file states 120.",
        "azimuth_steps: 512; the sensor file states 1024.",
        "noise: 0.01; the sensor file states 0.03.",
    ] {
        assert!(said.contains(part), "{part}: {said}");
    }
    assert!(!said.contains("rate: "), "{said}");
    let turned = in_scene(r#"{ "file": "p.json", "azimuth": [-10, 10], "azimuth_steps": 21 }"#);
    let Lidar::Spinning { azimuth_steps, azimuth, .. } = turned.lidars()[0] else { panic!() };
    assert_eq!((*azimuth_steps, *azimuth), (21, Some([-10.0, 10.0])));
    assert!(notes(&turned).contains("azimuth: [-10.0, 10.0] degrees; the sensor file states"));
}

#[test]
fn a_field_of_view_in_radians_is_doubted() {
    let scene =
        in_scene(r#"{ "channels": 16, "fov": [-0.26, 0.26], "azimuth_steps": 4, "range": 50 }"#);
    assert!(
        scene.notes()[0].is_doubt() && notes(&scene).contains("fov: 0.520 degrees for 16 channels")
    );
    let missing = Scene::from_json(
        r#"{ "sightline": 1, "roi": { "min": [-4, -4, -1], "max": [4, 4, 3], "voxel": [1, 1, 1] },
             "psog": { "file": "x.npz" }, "lidar": { "channels": 1, "fov": [0, 0], "azimuth_steps": 4 },
             "mount": { "min": [0, 0, 1], "max": [0, 0, 1], "lidars": 1 } }"#,
        Path::new(""),
        "scene.json",
    );
    assert!(missing.unwrap_err().to_string().contains("`range` is missing"));
}
