//! The scenes and placements of this repository.

use std::collections::BTreeMap;

use super::*;

const OWN: [(&str, usize); 4] =
    [("urban-crossing", 24), ("highway", 20), ("residential", 24), ("industrial-yard", 16)];

fn own(name: &str) -> Scene {
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    Scene::read(dir.join(format!("{name}.json"))).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn own_scenes_are_whole_and_use_every_class() {
    let mut used = BTreeMap::<String, usize>::new();
    let mut counts = Vec::new();
    for (name, frames) in OWN {
        let scene = own(name);
        assert_eq!((scene.name(), scene.frame_count()), (name, frames));
        assert_eq!(scene.coverage(), Coverage::FirstHit);
        assert_eq!(scene.roi().shape, [400, 400, 30]);
        let first = scene.frame(0, EgoBody::Include);
        counts.push(first.faces.len());
        assert!((500..10_000).contains(&first.faces.len()), "{name}: {}", first.faces.len());
        for &class in &first.face_class {
            *used.entry(scene.classes()[class as usize].clone()).or_default() += 1;
        }
        for t in 0..frames {
            let soup = scene.frame(t, EgoBody::Include);
            assert!(soup.vertices.iter().flatten().all(|v| v.is_finite()));
            assert_eq!((&soup.faces, &soup.face_class), (&first.faces, &first.face_class));
        }
    }
    println!("triangles: {counts:?}; by class: {used:#?}");
    let missing: Vec<_> = DEFAULT_CLASSES.iter().filter(|c| !used.contains_key(**c)).collect();
    assert!(missing.is_empty(), "{missing:?}");
    assert!(counts[1..].iter().all(|&n| n < counts[0]), "the crossing is the largest: {counts:?}");
}

/// The ego drives 1 to 3 m a frame, in a body of a car below the mount, with ground under it and the world reaching 90 m or
/// more around it. No actor drives into it: no vertex of anything above the ground comes within its body.
#[test]
fn own_scenes_surround_a_moving_ego_and_nothing_stands_in_it() {
    for (name, frames) in OWN {
        let scene = own(name);
        for t in 0..frames {
            if t > 0 {
                let step = scene.ego_pose(t).translation - scene.ego_pose(t - 1).translation;
                assert!((1.0..=3.001).contains(&step.length()), "{name} {t}: {step}");
            }
            let with = scene.frame(t, EgoBody::Include);
            let outside = scene.frame(t, EgoBody::Exclude);
            let bounds = |v: &[[f32; 3]]| {
                v.iter().fold([[f32::MAX; 3], [f32::MIN; 3]], |[lo, hi], v| {
                    [[0, 1, 2].map(|i| lo[i].min(v[i])), [0, 1, 2].map(|i| hi[i].max(v[i]))]
                })
            };
            let [lo, hi] = bounds(&with.vertices[outside.vertices.len()..]);
            assert!(
                (hi[2] as f64) < scene.vehicle().corners()[0][2] && lo[2] >= 0.0,
                "{name}: {lo:?} {hi:?}"
            );
            assert!((0..2).all(|i| lo[i] > -2.5 && hi[i] < 2.5), "{name}: {lo:?} {hi:?}");
            let [lo, hi] = bounds(&outside.vertices);
            assert!((0..2).all(|i| lo[i] < -90.0 && hi[i] > 90.0), "{name} {t}: {lo:?} {hi:?}");
            let is_inside = |v: &&[f32; 3]| v[0].abs() < 2.3 && v[1].abs() < 0.95 && v[2] > 0.1;
            let inside = outside.vertices.iter().find(is_inside);
            assert!(inside.is_none(), "{name} {t}: {inside:?}");
        }
    }
}

/// Table 7 as printed: x, y (right), z, roll of the four LiDARs.
#[test]
fn placements_are_those_of_table_7_in_our_frame() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes/placements.json");
    let text = std::fs::read_to_string(path).unwrap();
    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    let list = file["placements"].as_array().unwrap();
    let names: Vec<_> = list.iter().map(|p| p["name"].as_str().unwrap()).collect();
    let expected = "Center Line Pyramid Square Trapezoid Line-roll Pyramid-roll Ours-det Ours-seg \
                    Corruption 2D-plane";
    assert_eq!(names.join(" "), expected);
    let ours_seg =
        [[0.0, 0.5, 2.6, -0.3], [0.6, 0.3, 2.8, 0.0], [0.4, 0.0, 2.5, 0.0], [0.1, -0.6, 2.8, 0.2]];
    for (lidar, [x, y, z, roll]) in list[8]["lidars"].as_array().unwrap().iter().zip(ours_seg) {
        let value = |key: &str| lidar[key].as_f64().unwrap();
        assert_eq!([value("x"), value("y"), value("z"), value("roll")], [x, -y, z, roll]);
        assert_eq!((value("pitch"), value("yaw")), (0.0, 0.0));
        // CARLA's own matrix, mirrored in the xz plane, is our Rx(roll).
        let (sin, cos) = roll.sin_cos();
        let carla = glam::DMat3::from_cols_array(&[1.0, 0.0, 0.0, 0.0, cos, -sin, 0.0, sin, cos]);
        let mirror = glam::DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
        let ours = Pose::new(DVec3::ZERO, value("roll"), 0.0, 0.0).rotation;
        assert!((mirror * carla * mirror).abs_diff_eq(ours, 1e-15));
    }
    for placement in list {
        assert_eq!(placement["lidars"].as_array().unwrap().len(), 4);
        let keys: Vec<_> = placement.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["name", "lidars"]);
    }
}
