//! Scenes in national coordinates: the world, the actors and the ego moved far away see the same.

use glam::DVec3;
use serde_json::{Value, json};
use sightline::score::Scores;

use crate::own_scenes::{Own, SCENES, description, table_7};

/// Farthest that a score may move, as a share of it.
const TOLERANCE: f64 = 1e-5;

/// The scene file with everything but what hangs on the ego moved.
fn shifted(scene: &Value, shift: [f64; 3]) -> Value {
    let mut scene = scene.clone();
    let world = scene["static"].take();
    scene["shapes"]["the-whole-world"] = world;
    scene["static"] = json!([{ "shape": "the-whole-world", "at": [shift] }]);
    let route = |route: &mut Value| {
        for point in route["points"].as_array_mut().unwrap() {
            let at = |k: usize| point.get(k).and_then(Value::as_f64).unwrap_or(0.0) + shift[k];
            *point = json!([at(0), at(1), at(2)]);
        }
    };
    route(&mut scene["ego"]["route"]);
    scene["actors"].as_array_mut().unwrap().iter_mut().for_each(|actor| route(&mut actor["route"]));
    scene
}

/// Every number of a placement's scores that a user may compare.
fn numbers(scores: &Scores) -> Vec<(&'static str, f64)> {
    let task = scores.segmentation;
    let all = [
        ("m_sog", task.m_sog),
        ("m_sog_scaled", task.m_sog_scaled),
        ("information_gain", task.information_gain),
        ("s_mig", scores.s_mig),
        ("covered", Some(scores.covered)),
        ("hit_share", scores.hit_share),
        ("detection.m_sog_scaled", scores.detection.and_then(|d| d.m_sog_scaled)),
    ];
    all.into_iter().map(|(name, value)| (name, value.unwrap())).collect()
}

#[test]
fn scenes_far_from_the_origin_have_the_same_scores() {
    let placements = table_7();
    for name in SCENES {
        let scene = description(name);
        let here = Own::new(&scene);
        let scores = here.scores(&placements);
        for shift in [[1e5, -1e5, 0.0], [4e5, 4e5, 310.5]] {
            let there = Own::new(&shifted(&scene, shift));
            let moved = there.scene.ego_pose(3).translation - here.scene.ego_pose(3).translation;
            assert!((moved - DVec3::from(shift)).length() < 1e-9, "{moved}");
            for (a, b) in scores.iter().zip(&there.scores(&placements)) {
                for ((what, a), (_, b)) in numbers(a).into_iter().zip(numbers(b)) {
                    let change = ((a - b) / a).abs();
                    assert!(change <= TOLERANCE, "{name} {shift:?}: {what} changes by {change:e}");
                }
            }
        }
    }
}
