//! Files that are read: what they are taken for, and what a run does when they change.

use std::fs;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::cli::{fails, ok, room};

#[test]
fn a_run_does_not_go_on_with_other_files() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let mut scene: Value = serde_json::from_slice(&fs::read(room(dir.path())).unwrap()).unwrap();
    ok(dir.path(), &["psog", "build", "room.json", "--out", "room.npz"]);
    scene["psog"] = json!({ "file": "room.npz" });
    scene["lidar"] = json!({ "file": "sensor.json", "azimuth_steps": 60, "range": 20 });
    scene["static"][0] = json!({ "class": "wall", "mesh": { "file": "wall.obj" } });
    fs::write(path("room.json"), scene.to_string()).unwrap();
    fs::write(path("sensor.json"), "{ \"elevation_deg\": [-20, 0] }").unwrap();
    fs::write(path("wall.obj"), "v 3 -3 0\nv 3 3 0\nv 3 0 3\nf 1 2 3\n").unwrap();
    let args = ["optimize", "room.json", "--backend", "cpu", "--evaluations", "8", "--out", "run"];
    let begun = ok(dir.path(), &args);
    let resume = ["optimize", "--resume", "run", "--backend", "cpu"];
    for name in ["room.json", "sensor.json", "wall.obj", "room.npz"] {
        let bytes = fs::read(path(name)).unwrap();
        // A byte more is still the same scene to the reader of each of these.
        fs::write(path(name), [&bytes[..], b"\n"].concat()).unwrap();
        let message = fails(dir.path(), &resume);
        assert!(message.contains(&format!("{name}: has changed")), "{message}");
        fs::write(path(name), bytes).unwrap();
    }
    // Nothing is left of the generations; what they took is still told.
    let resumed = ok(dir.path(), &resume);
    assert_eq!(resumed["best"], begun["best"]);
    assert_eq!(resumed["timings"]["generations"], begun["timings"]["generations"]);
    assert!(resumed["rate"].as_f64() > Some(0.0), "{}", resumed["rate"]);
    assert!(resumed["timings"]["total"].as_f64() > begun["timings"]["total"].as_f64());
}
