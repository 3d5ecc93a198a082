//! Fields of nuScenes tables that no reader knows are named, and boxes of another order of numbers doubted.

use std::path::Path;

use glam::{DQuat, DVec3};

use super::nuscenes_set::{BoxRow, Keyframe, write};
use crate::datasets::{LabelledSequence, read_nuscenes};

const BOXES: [BoxRow; 1] = [("a", "vehicle.car", 0, [612.0, 1604.0, 0.9], [2.0, 4.0, 1.6], 0.3)];

/// A set of one keyframe whose tables have every field that nuScenes has.
fn written(folder: &Path) {
    let points = (0..50).map(|k| ([4.0 + 0.1 * k as f32, 1.0, -1.84], 24)).collect();
    let ego = (DVec3::new(600.0, 1600.0, 0.0), DQuat::IDENTITY);
    write(folder, &[Keyframe { time: 1000.0, ego, points }], &BOXES);
}

/// Sentences of the set's only scene, with DIR in place of its folder.
fn said(folder: &Path) -> Vec<String> {
    let scenes = read_nuscenes(folder, None, &["scene-0061".to_owned()]).unwrap();
    let dir = folder.display().to_string();
    scenes[0].notes().iter().map(|note| note.to_string().replace(&dir, "DIR")).collect()
}

/// Adds fields to every row of a table.
fn add(folder: &Path, table: &str, fields: &str) {
    let path = folder.join(format!("v1.0-mini/{table}.json"));
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(path, text.replace("{\n", &format!("{{\n{fields},\n"))).unwrap();
}

#[test]
fn fields_of_nuscenes_are_all_known() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path());
    assert_eq!(said(folder.path()), [""; 0]);
}

#[test]
fn fields_of_others_are_named_once_a_table() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path());
    let add = |table: &str, fields: &str| add(folder.path(), table, fields);
    add("ego_pose", "\"geocoordinate\": {\"x\": [1, 2]}, \"acceleration\": null");
    add("sample_annotation", "\"velocity\": [1.0, 0.0]");
    // `velocity` is known in no table, `height` only in the table of pictures.
    add("calibrated_sensor", "\"height\": 2");
    let mut said = said(folder.path());
    said.sort();
    let sentence = |table: &str, names: &str| {
        format!("DIR/v1.0-mini/{table}.json: {names}: not known here, and not read.")
    };
    let wanted = [
        sentence("calibrated_sensor", "`height`"),
        sentence("ego_pose", "`acceleration`, `geocoordinate`"),
        sentence("sample_annotation", "`velocity`"),
    ];
    assert_eq!(said, wanted);
}

#[test]
fn few_names_are_told_and_only_the_head_of_a_long_one() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path());
    let fields: Vec<String> = (0..30).map(|k| format!("\"{}{k:02}\": 0", "x".repeat(50))).collect();
    add(folder.path(), "scene", &format!("{}, \"a\": 0", fields.join(", ")));
    let many: Vec<String> = (0..30).map(|k| format!("\"n{k:02}\": 0")).collect();
    add(folder.path(), "sample", &many.join(", "));
    let mut said = said(folder.path());
    said.sort();
    let names: Vec<String> = (0..8).map(|k| format!("`n{k:02}`")).collect();
    assert_begins!(said[0], &format!("DIR/v1.0-mini/sample.json: {}: not", names.join(", ")));
    assert_begins!(said[1], &format!("DIR/v1.0-mini/scene.json: `a`, `{}`: not", "x".repeat(40)));
}

/// A car of 4.5 m that drives 3 m ahead, in tables whose numbers have another order.
#[test]
fn boxes_of_other_orders_are_doubted() {
    let doubts = |size: [f64; 3], yaw: f64| {
        let folder = tempfile::tempdir().unwrap();
        let keyframe = |k: usize| {
            let ego = (DVec3::new(600.0 + k as f64, 1600.0, 0.0), DQuat::IDENTITY);
            let points = (0..50).map(|k| ([4.0 + 0.1 * k as f32, 1.0, -1.84], 24)).collect();
            Keyframe { time: 1000.0 + 0.5 * k as f64, ego, points }
        };
        let at =
            |k: usize| ("a", "vehicle.car", k, [612.0 + 3.0 * k as f64, 1604.0, 0.8], size, yaw);
        write(folder.path(), &[keyframe(0), keyframe(1)], &[at(0), at(1)]);
        said(folder.path()).concat()
    };
    assert_eq!(doubts([1.9, 4.5, 1.6], 0.0), "");
    let wide = doubts([4.5, 1.9, 1.6], 0.0);
    assert!(wide.contains("by it 1 of 1 vehicles are wider than long"), "{wide}");
    // The identity as x, y, z, w is half a turn as w, x, y, z.
    let back = doubts([1.9, 4.5, 1.6], std::f64::consts::PI);
    assert!(back.contains("vehicles move backwards or sideways in 1 of 1 steps"), "{back}");
}

/// Four keyframes a metre apart, the third with a rotation in another order; and a scene of five samples.
#[test]
fn a_keyframe_turned_round_and_a_sample_that_is_missing_are_doubted() {
    let doubts = |odd: DQuat, stated: usize| {
        let folder = tempfile::tempdir().unwrap();
        let keyframe = |k: usize| {
            let turn = if k == 2 { odd } else { DQuat::IDENTITY };
            let points = (0..50).map(|k| ([4.0 + 0.1 * k as f32, 1.0, -1.84], 24)).collect();
            Keyframe {
                time: 1000.0 + 0.5 * k as f64,
                ego: (DVec3::new(k as f64, 0.0, 0.0), turn),
                points,
            }
        };
        write(folder.path(), &[0, 1, 2, 3].map(keyframe), &[]);
        let path = folder.path().join("v1.0-mini/scene.json");
        let text = std::fs::read_to_string(&path).unwrap();
        let changed = text.replace("\"nbr_samples\": 4", &format!("\"nbr_samples\": {stated}"));
        std::fs::write(path, changed).unwrap();
        said(folder.path()).concat()
    };
    assert_eq!(doubts(DQuat::from_rotation_z(0.5), 4), "");
    let turned = doubts(DQuat::from_rotation_z(std::f64::consts::PI), 4);
    assert_holds!(turned, "turns by more than 90 degrees between its keyframes 1 and 2; rotations");
    let missing = doubts(DQuat::IDENTITY, 5);
    assert_holds!(
        missing,
        "`nbr_samples` of the scene \"scene-0061\" is 5, and 4 samples name it;"
    );
}
