//! Messages of bad scenes, each with place and mend.

use super::*;

/// Checks that each text is refused with its message; reports all differences at once.
fn check(cases: impl Iterator<Item = (String, String)>) {
    let mut count = 0;
    let differing: Vec<[String; 2]> = cases
        .inspect(|_| count += 1)
        .map(|(text, expected)| [message(&text), format!("s.json: {expected}")])
        .filter(|[found, expected]| found != expected)
        .collect();
    assert!(differing.is_empty(), "{differing:#?}");
    assert!(count >= 10, "only {count} cases");
}

/// Records of a table: the text after `-` is replaced by the text after `+`, and the message follows `!`.
fn records(table: &str) -> impl Iterator<Item = [&str; 3]> {
    table.split("\n\n").map(|record| {
        let of = |mark: char| {
            let line = record.lines().find_map(|line| line.strip_prefix(mark));
            line.map_or("", |line| line.strip_prefix(' ').unwrap_or(line))
        };
        ['-', '+', '!'].map(of)
    })
}

/// Bad variants of the small form.
#[test]
fn bad_settings_are_named_with_their_place_and_mend() {
    check(records(include_str!("bad_settings.txt")).map(|[from, to, expected]| {
        assert!(!from.is_empty() && SMALL.contains(from), "{from}");
        (SMALL.replacen(from, to, 1), expected.to_owned())
    }));
}

/// Bad entries of `static`, beside named shapes; the shape `loop` contains itself.
#[test]
fn bad_shapes_are_named_with_their_place_and_mend() {
    check(records(include_str!("bad_shapes.txt")).map(|[_, shape, expected]| {
        let tree = r#", "shapes": { "tree": [{ "class": "pole", "plane": { "min": [1, 0], "max": [2, 1], "z": 0 } }],
          "many": [{ "class": "pole", "box": { "foot": [1, 0, 0], "size": [2, 1, 1] }, "repeat": { "count": 9, "step": [1, 0, 0] } }]"#;
        let cycle = if shape.contains("loop") { r#", "loop": [{ "shape": "loop" }]"# } else { "" };
        (full(shape, &format!("{tree}{cycle} }}")), expected.to_owned())
    }));
}

/// Bad actors, routes and shapes.
#[test]
fn bad_motion_is_named_with_its_place_and_mend() {
    check(
        records(include_str!("bad_keys.txt"))
            .map(|[_, keys, expected]| (full(BOX, &format!(", {keys}")), expected.to_owned())),
    );
}

/// A box is never flat, but a mesh may be.
#[test]
#[cfg(feature = "mesh")]
fn an_actor_that_no_beam_can_hit_is_noted() {
    let dir = tempfile::tempdir().unwrap();
    let noted = |third: &str| {
        std::fs::write(dir.path().join("a.obj"), format!("v 0 0 0\nv 1 1 1\nv {third}\nf 1 2 3\n"))
            .unwrap();
        let actor = r#", "actors": [{ "parts": [{ "class": "vehicle", "mesh": { "file": "a.obj" } }],
                                      "poses": [{ "x": 0, "y": 0 }] }]"#;
        notes(&Scene::from_json(&full(BOX, actor), dir.path(), "s.json").unwrap())
    };
    assert_begins!(noted("2 2 2"), "s.json: actors[0].parts: no triangle has an area");
    assert_eq!(noted("2 2 3"), "");
}

#[test]
#[cfg(feature = "mesh")]
fn a_vertex_far_away_is_told_with_an_exponent() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.obj"), "v 0 0 0\nv 1e300 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    let shape = r#"{ "class": "building", "mesh": { "file": "a.obj" } }"#;
    let error = Scene::from_json(&full(shape, ""), dir.path(), "s.json").unwrap_err();
    assert_holds!(error, "vertex 1: lies at [1e300, 0e0, 0e0], further than");
}

#[test]
fn a_scene_cut_anywhere_is_refused() {
    let text = full(
        BOX,
        r#", "frames": 2, "shapes": { "a": [{ "class": "fence", "plane": { "min": [0, 0], "max": [1, 1], "z": 0 } }] }"#,
    );
    assert!(read(&text).is_ok());
    for end in 0..text.len() {
        assert!(read(&text[..end]).is_err(), "cut at {end}");
    }
    let deep = "[".repeat(1_000_000);
    assert!(read(&deep).is_err());
}

/// Bytes changed at random end in a scene or in an error, never in a panic.
#[test]
fn garbled_input_never_panics() {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenes");
    let scene = std::fs::read(dir.join("highway.json")).unwrap();
    let mut read = 0;
    for _ in 0..300 {
        let mut bytes = scene.clone();
        for _ in 0..rng.random_range(1..4) {
            let i = rng.random_range(0..bytes.len());
            bytes[i] = b"0123456789-.eE[]{},:\" abxyz"[rng.random_range(0..27)];
        }
        let text = String::from_utf8(bytes).unwrap();
        if let Ok(scene) = Scene::from_json(&text, &dir, "s.json") {
            let soup = scene.frame(scene.frame_count() - 1, EgoBody::Include);
            assert!(soup.vertices.iter().flatten().all(|v| v.is_finite()));
            read += 1;
        }
    }
    assert!((1..300).contains(&read), "{read}");
}

/// Serde reads a list as an object, by position; none of ours is one.
#[test]
fn a_list_in_place_of_an_object_is_refused_with_its_place_and_keys() {
    let body =
        r#""parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [4, 2, 1] } }]"#;
    let part = |shape: &str| full(&format!(r#"{{ "class": "wall", {shape} }}"#), "");
    let small = |from: &str, to: &str| {
        assert!(SMALL.contains(from), "{from}");
        SMALL.replacen(from, to, 1)
    };
    let roi = r#"{ "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] }"#;
    let cases = [
        (small(roi, "[[-40, -40, -0.5], [40, 40, 5.5], [0.2, 0.2, 0.2]]"), "roi"),
        (small(r#"{ "file": "two-walls.psog.npz" }"#, r#"["two-walls.psog.npz"]"#), "psog"),
        (part(r#""plane": [[1, 0], [2, 1], 0]"#), "static[0].plane"),
        (part(r#""box": [[1, 0, 0], [2, 1, 1]]"#), "static[0].box"),
        (
            full(BOX, &format!(r#", "actors": [{{ {body}, "poses": [[10, 0, 1.5708]] }}]"#)),
            "actors[0].poses[0]",
        ),
        (
            full(BOX, &format!(r#", "actors": [{{ {body}, "route": [[[0, 0], [9, 0]], 1] }}]"#)),
            "actors[0].route",
        ),
        (full(BOX, r#", "ego": { "poses": [[10, 0, 1.5708]] }"#), "ego.poses[0]"),
        (full("[]", ""), "static[0]"),
    ];
    for (text, place) in cases {
        let wanted = format!("s.json: {place}: is a list; write an object with `");
        assert_begins!(message(&text), &wanted);
    }
    assert!(message("[1]").contains("s.json: is a list; write an object with `sightline`"));
}
