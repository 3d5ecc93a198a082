//! Messages of bad scenes, each with place and mend.

use super::*;

/// Messages that are not as expected, all at once.
fn differing(cases: impl Iterator<Item = (String, String)>) -> Vec<[String; 2]> {
    cases
        .map(|(text, expected)| [message(&text), format!("s.json: {expected}")])
        .filter(|[found, expected]| found != expected)
        .collect()
}

/// Bad variants of the small form: what to replace, by what, and the message after `s.json: `.
#[test]
fn bad_settings_are_named_with_their_place_and_mend() {
    let cases = [
        (
            "\"roll\"",
            "\"rol\"",
            "mount: unknown key `rol`; did you mean `roll`? (line 5, column 68)",
        ),
        (
            "\"name\"",
            "\"title\"",
            "unknown key `title`; known are `sightline`, `name`, `roi`, `psog`, `lidar`, `mount`, `coverage`, `classes`, `detection`, `shapes`, `static`, `actors`, `frames`, `ego` (line 1, column 25)",
        ),
        (
            "\"sightline\": 1",
            "\"sightline\": 2",
            "sightline: version 2 is unknown; this program reads version 1, write `\"sightline\": 1`",
        ),
        (
            "\"sightline\": 1, ",
            "",
            "the key `sightline` is missing; this program reads version 1, write `\"sightline\": 1`",
        ),
        (
            "\"lidars\": 4",
            "\"lidars\": 4, \"keep_out\": [{ \"min\": [0, 0, 2], \"max\": [1, 0, 3] }]",
            "mount.keep_out[0].max[1]: 0 is not above min (0): the box would keep nothing out",
        ),
        (
            "\"lidars\": 4",
            "\"lidars\": 4, \"keep_out\": [{ \"min\": [-1, -1, 2], \"max\": [0.1, 1, 3] }, { \"min\": [0.1, -1, 2], \"max\": [1, 1, 3] }]",
            "mount.keep_out: list of 2 is not a choice that leaves room for a sensor: the boxes cover the whole mount; make them smaller",
        ),
        (
            "\"lidars\": 4",
            "\"lidars\": 4, \"keep_out\": [{ \"min\": [0, 0, 2] }]",
            "mount.keep_out[0]: missing key `max` (line 5, column 151)",
        ),
        (
            "\"min\": [-0.6, -0.6, 2.2]",
            "\"symmetric\": true, \"min\": [-0.6, -0.5, 2.2]",
            "mount.symmetric: true is not possible where y runs from -0.5 to 0.6; mirrored sensors need a range from -a to a",
        ),
        (
            "\"roll\": [-0.3, 0.3]",
            "\"symmetric\": true, \"roll\": [0.1, 0.1]",
            "mount.symmetric: true is not possible where roll runs from 0.1 to 0.1; mirrored sensors need a range from -a to a",
        ),
        (
            "\"min_distance\": 0.2",
            "\"symmetric\": true, \"min_distance\": 1.3",
            "mount.symmetric: true is not possible where y runs from -0.6 to 0.6: two mirrored sensors need more than 0 m and at least min_distance, 1.3 m, between them; widen y",
        ),
        ("\"lidars\": 4", "\"lidars\": 0", "mount.lidars: 0 is not a whole number from 1 to 16"),
        (
            "\"lidars\": 4",
            "\"lidars\": 4.5",
            "mount.lidars: the fraction `4.5` stands where a whole number, 0 or more belongs (line 5, column 118)",
        ),
        (
            "\"lidars\": 4",
            "\"lidars\": \"4\"",
            "mount.lidars: string \"4\" stands where a whole number, 0 or more belongs (line 5, column 118)",
        ),
        (", \"lidars\": 4", "", "mount: missing key `lidars` (line 5, column 105)"),
        (
            "[-0.3, 0.3]",
            "[0.3, -0.3]",
            "mount.roll: [0.3, -0.3] is not a range [lower, upper] with lower <= upper",
        ),
        (
            "[-0.3, 0.3]",
            "[-17, 17]",
            "mount.roll[0]: -17 is not an angle in radians within one turn (-6.2832 to 6.2832)",
        ),
        (
            "0.2, \"lidars\"",
            "-1, \"lidars\"",
            "mount.min_distance: -1 is not a distance of 0 m or more",
        ),
        (
            "[-0.6, -0.6, 2.2]",
            "[0.7, -0.6, 2.2]",
            "mount.max[0]: 0.6 is not 0.7 or more, the lower corner of the mount",
        ),
        (
            "[-0.6, -0.6, 2.2]",
            "[-60, -0.6, 2.2]",
            "mount: the mount runs from [-60.0, -0.6, 2.2] to [0.6, 0.6, 2.8], outside of the ROI ([-40.0, -40.0, -0.5] to [40.0, 40.0, 5.5]) in x; move the mount or enlarge the ROI",
        ),
        (
            "[0.6, 0.6, 2.8]",
            "[0.6, 41, 2.8]",
            "mount: the mount runs from [-0.6, -0.6, 2.2] to [0.6, 41.0, 2.8], outside of the ROI ([-40.0, -40.0, -0.5] to [40.0, 40.0, 5.5]) in y; move the mount or enlarge the ROI",
        ),
        (
            "[-40, -40, -0.5], \"max\": [40, 40, 5.5]",
            "[-40, -40, -22.5], \"max\": [40, 40, -16.5]",
            "mount: the mount runs from [-0.6, -0.6, 2.2] to [0.6, 0.6, 2.8], outside of the ROI ([-40.0, -40.0, -22.5] to [40.0, 40.0, -16.5]) in z; move the mount or enlarge the ROI",
        ),
        (
            "[40, 40, 5.5]",
            "[40, -40, 5.5]",
            "roi.max[1]: -40 is not above min (-40): the ROI would have no voxels; give max > min",
        ),
        ("[0.2, 0.2, 0.2]", "[0.2, 0, 0.2]", "roi.voxel[1]: 0 is not a positive length"),
        (
            "[0.2, 0.2, 0.2]",
            "[0.2, 1e-9, 0.2]",
            "roi.voxel[1]: 0.000000001 is not large enough: 80000000000 voxels lie along this axis, at most 16777216 may",
        ),
        (
            "[0.2, 0.2, 0.2]",
            "[0.001, 0.001, 0.2]",
            "roi: 192000000000 voxels are more than the limit of 2147483648; take a smaller ROI or larger voxels",
        ),
        (
            "[0.2, 0.2, 0.2]",
            "[0.2, 0.2]",
            "roi.voxel: a list of length 2 stands where a list of length 3 belongs (line 2, column 78)",
        ),
        (
            "[0.2, 0.2, 0.2]",
            "[0.2, null, 0.2]",
            "roi.voxel[1]: null stands where a number belongs (line 2, column 78)",
        ),
        (
            "[0.2, 0.2, 0.2]",
            "[0.2, 1e999, 0.2]",
            "roi.voxel[1]: a number too large; write a finite one, as 1.5 (line 2, column 79)",
        ),
        (
            "[0.2, 0.2, 0.2]",
            "[0.2, NaN, 0.2]",
            "roi: no value that JSON knows; numbers are finite, as 1.5 (line 2, column 75)",
        ),
        (
            "\"channels\": 16",
            "\"channels\": 0",
            "lidar.channels: 0 is not a number of channels: a LiDAR without channels casts no beam; give 1 to 1024",
        ),
        (
            "\"channels\": 16",
            "\"channels\": 4000000000",
            "lidar.channels: 4000000000 is not a whole number from 1 to 1024",
        ),
        (
            "\"channels\": 16, ",
            "",
            "lidar: has none of the keys; give exactly one of `channels`, `file`, `directions`",
        ),
        (
            "\"channels\": 16",
            "\"channels\": 16, \"file\": \"x\"",
            "lidar: has `channels`, `file`; give exactly one of `channels`, `file`, `directions`",
        ),
        (
            "\"fov\": [-24.8, 2.0]",
            "\"fov\": [2.0, -24.8]",
            "lidar.fov: [2.0, -24.8] is not a range [lower, upper] with lower <= upper",
        ),
        (
            "\"fov\": [-24.8, 2.0], ",
            "",
            "lidar: `fov` is missing: give the vertical field of view in degrees, [-24.8, 2.0] for example",
        ),
        ("-24.8", "-124.8", "lidar.fov[0]: -124.8 is not an elevation from -90 to 90 degrees"),
        ("250", "200000", "lidar.azimuth_steps: 200000 is not a whole number from 1 to 100000"),
        (
            ": 16, \"fov\": [-24.8, 2.0], \"azimuth_steps\": 250",
            ": 1000, \"fov\": [-24.8, 2.0], \"azimuth_steps\": 100000",
            "lidar: 100000000 beams are more than the limit of 10000000; take fewer channels or azimuth steps",
        ),
        (
            "\"azimuth_steps\": 250, ",
            "",
            "lidar: `azimuth_steps` is missing: give the measurements of one channel in a turn, 250 for example",
        ),
        ("100.0", "0", "lidar.range: 0 is not a range above 0 and at most 100000 m"),
        ("100.0", "1e300", "lidar.range: 1e300 is not a range above 0 and at most 100000 m"),
        (
            "\"through\"",
            "\"first-hit\"",
            "coverage: \"first-hit\" is not possible without geometry; add `static`, `actors` or `ego.body`, or write \"through\"",
        ),
        ("\"through\"", "\"Through\"", "coverage: \"Through\" is not \"first-hit\" or \"through\""),
        (
            "\"file\": \"two-walls.psog.npz\"",
            "",
            "psog: has none of the keys; give exactly one of `file`, `scan`",
        ),
        (
            "\"file\": \"two-walls.psog.npz\"",
            "\"scan\": {}",
            "psog: `scan` cannot stand here: a scene without geometry needs a P-SOG file, write `\"psog\": { \"file\": … }`",
        ),
        (
            "\"psog\": { \"file\": \"two-walls.psog.npz\" },",
            "",
            "`psog` is missing: a scene without geometry needs a P-SOG file, write `\"psog\": { \"file\": … }`",
        ),
        (
            "\"coverage\"",
            "\"frames\": 8, \"coverage\"",
            "`frames` cannot stand here: without geometry all frames are alike; add `static` or `actors`, or leave it out",
        ),
        (
            "\"coverage\"",
            "\"frames\": 0, \"coverage\"",
            "frames: 0 is not a whole number from 1 to 10000",
        ),
        (
            "\"coverage\"",
            "\"classes\": [\"road\", \"road\"], \"coverage\"",
            "classes[1]: \"road\" is not a name used once in the list",
        ),
        (
            "\"coverage\"",
            "\"classes\": [], \"coverage\"",
            "classes: a list of 0 is not 1 to 256 class names",
        ),
        (
            "\"name\": \"two-walls\"",
            "\"name\": \"a\", \"name\": \"b\"",
            "this key comes twice: `name` (line 1, column 37)",
        ),
        ("\"coverage\": \"through\" }", "", "the file ends inside of a value (line 6, column 2)"),
    ];
    let texts = cases.into_iter().map(|(from, to, expected)| {
        assert!(SMALL.contains(from), "{from}");
        (SMALL.replacen(from, to, 1), expected.to_owned())
    });
    let differing = differing(texts);
    assert!(differing.is_empty(), "{differing:#?}");
}

/// Bad shapes and actors; the message after `s.json: `.
#[test]
fn bad_geometry_is_named_with_its_place_and_mend() {
    let shapes = [
        (
            "{}",
            "static[0]: has none of the keys; give exactly one of `box`, `prism`, `cylinder`, `plane`, `mesh`, `shape`",
        ),
        (
            r#"{ "box": { "foot": [0, 0, 0], "size": [1, 1, 1] } }"#,
            "static[0]: `class` is missing: name the class of this shape, `\"class\": \"building\"` for example",
        ),
        (
            r#"{ "class": "vehicel", "box": { "foot": [0, 0, 0], "size": [1, 1, 1] } }"#,
            "static[0].class: no class is called `vehicel`; did you mean `vehicle`?",
        ),
        (
            r#"{ "class": "wall", "box": { "foot": [0, 0, 0], "size": [1, -2, 1] } }"#,
            "static[0].box.size[1]: -2 is not a positive length",
        ),
        (
            r#"{ "class": "wall", "box": { "foot": [0, 0, 0] } }"#,
            "static[0].box: has `foot`; give exactly one of `center, size`, `foot, size`, `min, max`",
        ),
        (
            r#"{ "class": "wall", "box": { "min": [0, 0, 0], "max": [1, 0, 1] } }"#,
            "static[0].box.max[1]: 0 is not above min (0)",
        ),
        (
            r#"{ "class": "wall", "box": { "foot": [0, 2e9, 0], "size": [1, 1, 1] } }"#,
            "static[0].box.foot[1]: 2000000000 is not a coordinate within 1e9 m of the origin",
        ),
        (
            r#"{ "class": "wall", "bix": {} }"#,
            "static[0]: unknown key `bix`; did you mean `box`? (line 6, column 37)",
        ),
        (
            r#"{ "class": "wall", "cylinder": { "center": [0, 0, 0], "radius": 1, "height": 1 } }"#,
            "static[0].cylinder: unknown key `center`; known are `foot`, `radius`, `height`, `sides` (line 6, column 54)",
        ),
        (
            r#"{ "class": "wall", "cylinder": { "foot": [0, 0, 0], "radius": 1, "height": 1, "sides": 2 } }"#,
            "static[0].cylinder.sides: 2 is not a whole number from 3 to 256",
        ),
        (
            r#"{ "class": "wall", "prism": { "base": [[0, 0], [2, 2], [2, 0], [0, 2]], "z": [0, 1] } }"#,
            "static[0].prism.base[2]: the side from [2.0, 0.0] to [0.0, 2.0] is not free of the side from [0.0, 0.0] to [2.0, 2.0]; the outline must not cross or touch itself",
        ),
        (
            r#"{ "class": "wall", "prism": { "base": [[0, 0], [2, 2]], "z": [0, 1] } }"#,
            "static[0].prism.base: a list of 2 is not 3 to 1000 corners",
        ),
        (
            r#"{ "class": "wall", "prism": { "base": [[0, 0], [2, 2], [2, 0]], "z": [1, 1] } }"#,
            "static[0].prism.z: [1.0, 1.0] is not a range [bottom, top] with bottom < top",
        ),
        (
            r#"{ "class": "wall", "plane": { "min": [0, 0], "max": [0, 1], "z": 0 } }"#,
            "static[0].plane.max[0]: 0 is not above min (0)",
        ),
        (
            r#"{ "class": "wall", "plane": { "min": [0, 0], "max": [1, 1], "z": 0 }, "at": [[1]] }"#,
            "static[0].at[0]: a list of 1 numbers is not [x, y], [x, y, z] or [x, y, z, yaw]",
        ),
        (
            r#"{ "class": "wall", "plane": { "min": [0, 0], "max": [1, 1], "z": 0 }, "repeat": { "count": 4000000000, "step": [0, 0, 0] } }"#,
            "static[0].repeat.count: 4000000000 is not a whole number from 1 to 100000",
        ),
        (
            r#"{ "shape": "tee" }"#,
            "static[0].shape: no shape is called `tee`; did you mean `tree`?",
        ),
        (
            r#"{ "shape": "loop" }"#,
            "shapes.loop[0].shape: \"loop\" is not nested less than 8 deep; does it contain itself?",
        ),
        (
            r#"{ "shape": "tree", "class": "wall" }"#,
            "static[0]: `class` cannot stand here: the parts of the shape `tree` have their own classes",
        ),
        (
            r#"{ "shape": "many", "repeat": { "count": 100000, "step": [1, 0, 0] } }"#,
            "static[0]: 10800110 triangles are more than the limit of 10000000; take fewer copies or a coarser mesh",
        ),
    ];
    let shapes = shapes.into_iter().map(|(shape, expected)| {
        let tree = r#", "shapes": { "tree": [{ "class": "pole", "plane": { "min": [1, 0], "max": [2, 1], "z": 0 } }],
          "many": [{ "class": "pole", "box": { "foot": [1, 0, 0], "size": [2, 1, 1] }, "repeat": { "count": 9, "step": [1, 0, 0] } }]"#;
        let cycle = if shape.contains("loop") { r#", "loop": [{ "shape": "loop" }]"# } else { "" };
        (full(shape, &format!("{tree}{cycle} }}")), expected.to_owned())
    });
    let more = [
        (
            r#""actors": [{ "parts": [] }]"#,
            "actors[0]: `poses` is missing: say where the actor is, with `poses` or `route`",
        ),
        (
            r#""frames": 2, "actors": [{ "parts": [], "poses": [{ "x": 0, "y": 0 }] }]"#,
            "actors[0].poses: a list of 1 is not one pose for each of the 2 frames",
        ),
        (
            r#""frames": 2, "ego": { "poses": [{ "x": 0, "y": 0 }] }"#,
            "ego.poses: a list of 1 is not one pose for each of the 2 frames",
        ),
        (
            r#""ego": { "poses": [{ "x": 0, "y": 0, "pitch": 90 }] }"#,
            "ego.poses[0].pitch: 90 is not an angle in radians within one turn (-6.2832 to 6.2832)",
        ),
        (
            r#""ego": { "poses": [], "route": { "points": [], "spacing": 1 } }"#,
            "ego: has `poses`, `route`; give exactly one of `poses`, `route`",
        ),
        (
            r#""ego": { "route": { "points": [[0, 0]], "spacing": 1 } }"#,
            "ego.route.points: a list of 1 is not a route: give two points or more",
        ),
        (
            r#""ego": { "route": { "points": [[0, 0], [0, 0, 5]], "spacing": 1 } }"#,
            "ego.route.points[1]: [0.0, 0.0, 5.0] is not ahead of the point before it: a heading needs a step in x or y",
        ),
        (
            r#""ego": { "route": { "points": [[0, 0], [0]], "spacing": 1 } }"#,
            "ego.route.points[1]: a list of 1 numbers is not [x, y] or [x, y, z]",
        ),
        (
            r#""shapes": { "a": [], "a": [] }"#,
            "shapes: this key comes twice: `a` (line 6, column 113)",
        ),
        (
            r#""shapes": { "a": [] }"#,
            "shapes.a: an empty list is not a shape; add one or leave the name out",
        ),
    ];
    let more = more
        .into_iter()
        .map(|(keys, expected)| (full(BOX, &format!(", {keys}")), expected.to_owned()));
    let differing = differing(shapes.chain(more));
    assert!(differing.is_empty(), "{differing:#?}");
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
    let dir = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
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
