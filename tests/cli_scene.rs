//! Generated scenes: what they hold, that they repeat themselves, and that they can be scored.

use std::fs;

use serde_json::json;
use tempfile::TempDir;

use crate::cli::{fails, ok, sightline};

fn generate(dir: &TempDir, file: &str, seed: &str) {
    let args = ["scene", "--triangles", "5000", "--frames", "2", "--seed", seed, "--out", file];
    let output = sightline(dir.path(), &args);
    assert!(output.status.success() && output.stdout.is_empty(), "{output:?}");
}

#[test]
fn a_generated_street_can_be_cast_into() {
    let dir = TempDir::new().unwrap();
    generate(&dir, "street.json", "1");
    let placements = json!({ "placements": [
        { "name": "roof", "lidars": [{ "x": 0, "y": 0, "z": 2.4 }] }] });
    fs::write(dir.path().join("p.json"), placements.to_string()).unwrap();
    let args = ["cast", "street.json", "p.json", "--out", "hits.npz", "--backend", "cpu"];
    let answer = ok(dir.path(), &args);
    assert_eq!(answer["beams"], 16 * 720);
    let hits = answer["hits"].as_u64().unwrap();
    assert!((8 * 720..16 * 720).contains(&hits), "{hits} hits");

    let read = |file: &str| fs::read(dir.path().join(file)).unwrap();
    generate(&dir, "again.json", "1");
    generate(&dir, "other.json", "2");
    assert_eq!(read("street.ply"), read("again.ply"));
    assert_ne!(read("street.ply"), read("other.ply"));
}

#[test]
fn a_street_that_cannot_be_made_is_refused() {
    let dir = TempDir::new().unwrap();
    let error = fails(dir.path(), &["scene", "--triangles", "10", "--out", "x.json"]);
    assert!(error.contains("--triangles") && error.contains("4000"), "{error}");
    let error = fails(dir.path(), &["scene", "--out", "x.ply"]);
    assert!(error.contains("ending .json"), "{error}");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}
