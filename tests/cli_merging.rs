//! `optimize --fidelity auto` with triangles that are many and small beside a voxel.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::cli::{ok, room};

/// The room with one wall made of 14 400 triangles of some centimetres, in so many frames; `waves` are
/// as deep as that, in metres.
fn fine_room(dir: &Path, frames: usize, waves: f64) {
    room(dir);
    let text = fs::read_to_string(dir.join("room.json")).unwrap();
    let mut scene: Value = serde_json::from_str(&text).unwrap();
    let (mut obj, [columns, rows]) = (String::new(), [120, 60]);
    for i in 0..=columns {
        for j in 0..=rows {
            let (y, z) = (-3.0 + 0.05 * f64::from(i), 0.05 * f64::from(j));
            writeln!(obj, "v {} {y} {z}", 3.3 + waves * (7.0 * y).sin() * (5.0 * z).sin()).unwrap();
        }
    }
    for (i, j) in (0..columns).flat_map(|i| (0..rows).map(move |j| (i, j))) {
        let at = |i: i32, j: i32| i * (rows + 1) + j + 1;
        writeln!(obj, "f {} {} {} {}", at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1))
            .unwrap();
    }
    fs::write(dir.join("wall.obj"), obj).unwrap();
    scene["static"][1] = json!({ "class": "wall", "mesh": { "file": "wall.obj" } });
    fs::write(dir.join("room.json"), scene.to_string()).unwrap();
    // One frame alone has no entropy: its voxels are those of three.
    ok(dir, &["psog", "build", "room.json", "--out", "room.npz"]);
    scene["psog"] = json!({ "file": "room.npz" });
    scene["frames"] = json!(frames);
    for poses in scene["actors"].as_array_mut().unwrap() {
        poses["poses"].as_array_mut().unwrap().truncate(frames);
    }
    fs::write(dir.join("room.json"), scene.to_string()).unwrap();
}

fn optimize(dir: &Path, scene: &str, out: &str) -> Value {
    let args = ["optimize", scene, "--evaluations", "24", "--method", "cma", "--backend", "cpu"];
    ok(dir, &[&args[..], &["--out", out]].concat())
}

#[test]
fn small_triangles_are_merged_for_the_search_and_not_for_the_result() {
    for frames in [1, 3] {
        let dir = TempDir::new().unwrap();
        fine_room(dir.path(), frames, 0.05);
        let run = optimize(dir.path(), "room.json", "out");
        let merging = &run["modelled"]["merging"];
        assert_eq!(merging["used"], true, "{merging}");
        let count = |key: &str| merging[key].as_u64().unwrap();
        assert!(5 * count("merged") <= count("triangles"), "{merging}");
        let error = merging["error"].as_f64().unwrap();
        assert!(error > 0.0 && error <= 0.005, "{merging}");
        // What is reported is scored with every triangle.
        assert!(run["modelled"]["triangles"].as_u64().unwrap() > 14_400);
        let best = json!({ "placements": [run["best"]["placement"]] });
        fs::write(dir.path().join("best.json"), best.to_string()).unwrap();
        let score = ok(dir.path(), &["score", "room.json", "best.json", "--backend", "cpu"]);
        assert_eq!(score["scores"][0], run["best"]["scores"]);
        assert!(run["fidelity"]["words"].as_str().unwrap().contains("triangles are left"));
        // The same again, to the bit.
        let again = optimize(dir.path(), "room.json", "again");
        assert_eq!((&again["best"], &again["modelled"]), (&run["best"], &run["modelled"]));
    }
}

#[test]
fn triangles_that_matter_are_kept() {
    let dir = TempDir::new().unwrap();
    fine_room(dir.path(), 3, 0.4);
    let merging = &optimize(dir.path(), "room.json", "out")["modelled"]["merging"];
    assert_eq!(merging["used"], false, "{merging}");
    assert!(merging["error"].as_f64().unwrap() > 0.005, "{merging}");
}

#[test]
fn a_scene_of_large_triangles_keeps_them_and_says_so() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    let run = optimize(dir.path(), "room.json", "out");
    let merging = &run["modelled"]["merging"];
    assert_eq!((&merging["used"], &merging["error"]), (&json!(false), &Value::Null), "{merging}");
    assert_eq!((&merging["merged"], &merging["triangles"]), (&json!(30), &json!(38)));
}
