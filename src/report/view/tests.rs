//! The view's data against scores, and as a page reads it.

use std::path::Path;
use std::sync::Arc;

use base64::prelude::{BASE64_STANDARD, Engine};
use serde_json::Value;

use super::*;
use crate::scene::EgoBody;
use crate::search::Evaluator;
use crate::vehicle::SensorPose;

/// A road with a wall, a walker that comes and goes, and a car under two LiDARs; its name would end a script.
pub(in crate::report) fn yard() -> (Scene, Arc<Problem>, [Placement; 2]) {
    let text = r#"{
        "sightline": 1, "name": "</script>yard", "frames": 3, "coverage": "first-hit",
        "roi": { "min": [-12, -12, -0.4], "max": [12, 12, 2.8], "voxel": [0.4, 0.4, 0.4] },
        "lidar": { "channels": 12, "fov": [-30, 0], "azimuth_steps": 120, "range": 60 },
        "mount": { "min": [-1.5, -0.8, 1.6], "max": [1.5, 0.8, 2.4], "lidars": 2 },
        "static": [{ "class": "road", "plane": { "min": [-40, -40], "max": [40, 40], "z": 0 } },
                   { "class": "building", "box": { "foot": [0, 9, 0], "size": [20, 1, 4] } }],
        "actors": [{ "poses": [{ "x": 5, "y": 3 }, { "x": 5, "y": 5 }, { "x": -6, "y": 3 }],
            "parts": [{ "class": "pedestrian", "box": { "foot": [0, 0, 0], "size": [0.5, 0.5, 1.8] } }] },
                   { "poses": [{ "x": 8, "y": -3 }, { "x": 3, "y": -5 }, { "x": -6, "y": -3 }],
            "parts": [{ "class": "pedestrian", "box": { "foot": [0, 0, 0], "size": [0.5, 0.5, 1.8] } }] }],
        "ego": { "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [4, 2, 1.5] } }] } }"#;
    let scene = Scene::from_json(text, Path::new(""), "yard.json").unwrap();
    let problem = crate::JobScene::from(scene.clone()).problem().unwrap();
    let at = |x: f64, z: f64| SensorPose { x, z, ..SensorPose::default() };
    let two = Placement { name: "two".into(), lidars: vec![at(-1.0, 1.8), at(1.0, 2.2)] };
    let one = Placement { name: "one".into(), lidars: vec![at(0.0, 1.7)] };
    (scene, problem, [two, one])
}

fn viewed() -> (Scene, Arc<Problem>, [Placement; 2], ViewData) {
    let (scene, problem, layouts) = yard();
    let mut evaluator = Evaluator::on_cpu(problem.clone());
    let [two, one] = &layouts;
    let engine = evaluator.backend_mut();
    let view = ViewData::new(&scene, &problem, engine, two, std::slice::from_ref(one), 1).unwrap();
    (scene, problem, layouts, view)
}

#[test]
fn gains_by_class_and_by_distance_add_up_to_the_scores() {
    let (_, problem, layouts, view) = viewed();
    let scores = Evaluator::on_cpu(problem).scores(&layouts).unwrap();
    let gains = &view.sight.gains;
    for (layout, scores) in scores.iter().enumerate() {
        let want = scores.segmentation.information_gain.unwrap();
        assert!(want > 1.0);
        for parts in [&gains.by_class, &gains.by_distance] {
            let sum: f64 = parts.iter().map(|part| part.gained[layout]).sum();
            assert!((sum - want).abs() < 1e-6 * want, "{sum} is not {want}");
        }
    }
    // A LiDAR's own gain is the whole gain without the part that only the other LiDAR reaches.
    let gained = gains.gained();
    for (alone, other) in gains.alone.iter().zip(scores[0].unique_share.iter().rev()) {
        assert!((alone - gained * (1.0 - other)).abs() < 1e-6 * gained, "{alone}, {other}");
    }
}

#[test]
fn a_frame_has_the_triangles_of_the_scene_at_their_places() {
    let (scene, .., view) = viewed();
    // Both walkers have one shape: ground and wall, walker, body.
    assert_eq!((view.things.shapes.len(), &*view.things.shape_of), (3, &[0, 1, 1, 2][..]));
    for (frame, poses) in view.frames.iter().zip(&view.things.poses) {
        let want = scene.frame(*frame, EgoBody::Include);
        let mut found = Vec::new();
        for (pose, shape) in poses.iter().zip(&view.things.shape_of) {
            let shape = &view.things.shapes[*shape];
            for corner in (0..shape.faces.len() as u32).flat_map(|prim| shape.corners(prim)) {
                let row = |k: usize| (0..3).map(|c| pose[4 * k + c] * corner[c]).sum::<f32>();
                found.push([0, 1, 2].map(|k| row(k) + pose[4 * k + 3]));
            }
        }
        let corners = (0..want.faces.len() as u32).flat_map(|prim| want.corners(prim));
        let corners: Vec<[f32; 3]> = corners.collect();
        assert_eq!(found.len(), corners.len());
        for (found, want) in found.iter().zip(&corners) {
            assert!((0..3).all(|k| (found[k] - want[k]).abs() < 1e-4), "{found:?}, {want:?}");
        }
    }
}

#[test]
fn a_page_reads_back_what_was_packed() {
    let (.., view) = viewed();
    let (header, bytes) = view.packed();
    assert!(!header.contains('<') && !bytes.contains('<'));
    let header: Value = serde_json::from_str(&header).unwrap();
    assert_eq!(header["scene"], "</script>yard");
    let bytes = BASE64_STANDARD.decode(bytes).unwrap();
    let array = |at: &Value, size: usize| {
        let [from, length] = [1, 2].map(|k| at[k].as_u64().unwrap() as usize);
        assert_eq!(from % 4, 0);
        bytes[from..from + length * size].to_vec()
    };
    let voxels = view.sight.voxels.len();
    let indices: &[u32] = &bytemuck::pod_collect_to_vec(&array(&header["voxels"]["index"], 4));
    assert!(indices.iter().eq(view.sight.voxels.iter().map(|voxel| &voxel.index)));
    let masks = array(&header["voxels"]["masks"], 1);
    assert_eq!(masks.len(), 3 * voxels);
    assert!(masks.contains(&3) && masks.iter().all(|mask| *mask < 4));
    assert_eq!(array(&header["voxels"]["shares"], 1).len(), 2 * voxels);
    // The ends of beams come back within a step of the box that they are counted in.
    let ends: Vec<u16> = bytemuck::pod_collect_to_vec(&array(&header["beams"]["ends"], 2));
    let reach = header["beams"]["reach"].as_f64().unwrap();
    let wanted = view.beams.ends.iter().flatten().flatten().flatten();
    for (end, want) in ends.iter().zip(wanted) {
        let metres = (f64::from(*end) / 65535.0 * 2.0 - 1.0) * reach;
        assert!((metres - f64::from(*want)).abs() < reach / 60000.0, "{metres}, {want}");
    }
}

#[test]
fn what_is_not_drawn_is_said() {
    let (scene, problem, [two, _]) = yard();
    let mut evaluator = Evaluator::on_cpu(problem.clone());
    let engine = evaluator.backend_mut();
    let sight = InformationView::new(&problem, engine, &two, &[], &[0], 10).unwrap();
    assert_eq!((sight.voxels.len(), sight.masks[0].len()), (10, 10));
    assert!(sight.left_out().unwrap().starts_with("Drawn are the 10 of "));
    assert!(sight.voxels.windows(2).all(|pair| pair[0].worth >= pair[1].worth));
    let view = ViewData::new(&scene, &problem, engine, &two, &[], 1).unwrap();
    assert_eq!(view.left_out(), Vec::<String>::new());
}

#[test]
fn a_mesh_of_many_triangles_becomes_one_of_few() {
    // A flat square of 200 000 triangles.
    let (n, step) = (316_u32, 0.05_f32);
    let vertices =
        (0..=n).flat_map(|i| (0..=n).map(move |j| [i as f32 * step, j as f32 * step, 0.0]));
    let at = |i: u32, j: u32| i * (n + 1) + j;
    let faces = (0..n).flat_map(|i| {
        (0..n).flat_map(move |j| {
            [[at(i, j), at(i + 1, j), at(i, j + 1)], [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]]
        })
    });
    let faces: Vec<[u32; 3]> = faces.collect();
    let face_class = vec![0; faces.len()];
    let soup = TriangleSoup { vertices: vertices.collect(), faces, face_class };
    let shown = few(vec![soup.clone()], TRIANGLES);
    let left = count(&shown);
    assert!((1_000..=TRIANGLES).contains(&left), "{left}");
    let things = Things {
        shapes: shown,
        shape_of: vec![0],
        own: 1,
        poses: vec![],
        triangles: count(&[soup]),
    };
    assert!(things.left_out().unwrap().starts_with("The scene's 199712 triangles are drawn as "));
}
