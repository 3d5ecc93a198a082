use glam::DVec3;

use super::*;

/// The small form of the contract.
const SMALL: &str = r#"{ "sightline": 1, "name": "two-walls",
  "roi":  { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.2, 0.2, 0.2] },
  "psog": { "file": "two-walls.psog.npz" },
  "lidar": { "channels": 16, "fov": [-24.8, 2.0], "azimuth_steps": 250, "range": 100.0 },
  "mount": { "min": [-0.6, -0.6, 2.2], "max": [0.6, 0.6, 2.8], "roll": [-0.3, 0.3], "min_distance": 0.2, "lidars": 4 },
  "coverage": "through" }"#;

/// A scene with geometry; `shapes` is the `static` list, `more` further keys.
fn full(shapes: &str, more: &str) -> String {
    let cut = SMALL.replace("\"psog\": { \"file\": \"two-walls.psog.npz\" },", "");
    cut.replace("\"coverage\": \"through\"", &format!("\"static\": [{shapes}]{more}"))
}

fn read(text: &str) -> Result<Scene, SceneError> {
    Scene::from_json(text, Path::new("dir"), "s.json")
}

/// Messages that are not as expected, all at once.
fn differing(cases: impl Iterator<Item = (String, String)>) -> Vec<[String; 2]> {
    cases
        .map(|(text, expected)| [message(&text), format!("s.json: {expected}")])
        .filter(|[found, expected]| found != expected)
        .collect()
}

fn message(text: &str) -> String {
    match read(text) {
        Ok(_) => panic!("accepted: {text}"),
        Err(e) => e.to_string(),
    }
}

const BOX: &str = r#"{ "class": "building", "box": { "foot": [10, 0, 0], "size": [2, 3, 4] } }"#;

#[test]
fn the_small_form_is_read() {
    let scene = read(SMALL).unwrap();
    assert_eq!(scene.name(), "two-walls");
    assert_eq!(scene.roi().shape, [400, 400, 30]);
    assert_eq!(scene.coverage(), Coverage::Through);
    assert_eq!(*scene.psog_source(), PsogSource::File("dir/two-walls.psog.npz".into()));
    assert_eq!((scene.has_geometry(), scene.frame_count()), (false, 1));
    assert_eq!(scene.frame(0, EgoBody::Include), TriangleSoup::default());
    assert_eq!(scene.classes().len(), 21);
    assert_eq!(scene.detection_classes(), [9]);
    let mount = scene.mount();
    assert_eq!((mount.roll, mount.pitch, mount.yaw), ([-0.3, 0.3], [0.0; 2], [0.0; 2]));
    assert_eq!((mount.min_distance, mount.lidars), (0.2, 4));
    let Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, range } = scene.lidar()
    else {
        panic!("{:?}", scene.lidar());
    };
    assert_eq!((elevations[0], elevations[15]), (-24.8, 2.0));
    assert_eq!(
        (azimuth_offsets.as_slice(), *azimuth_steps, *range),
        ([0.0; 16].as_slice(), 250, 100.0)
    );
    assert_eq!(scene.lidar().beam_count(), 4000);
}

#[test]
fn the_full_form_has_its_defaults() {
    let scene = read(&full(BOX, "")).unwrap();
    assert_eq!(scene.coverage(), Coverage::FirstHit);
    let PsogSource::Scan(scan) = scene.psog_source() else { panic!() };
    assert_eq!((scan.channels, scan.fov, scan.azimuth_steps), (64, [-50.0, 20.0], 720));
    assert_eq!((scan.range, scan.height, scan.window, scan.stride), (100.0, 2.8, 5, 1));
    let soup = scene.frame(0, EgoBody::Include);
    assert_eq!((soup.vertices.len(), soup.faces.len()), (8, 12));
    assert!(soup.face_class.iter().all(|&c| c == 0));
}

#[test]
fn a_roi_is_rounded_to_whole_voxels_or_up() {
    for (max, voxels) in [("40", 400), ("39.9", 400), ("40.00001", 400), ("40.01", 401)] {
        let text = SMALL.replacen("\"max\": [40", &format!("\"max\": [{max}"), 1);
        assert_eq!(read(&text).unwrap().roi().shape[0], voxels, "{max}");
    }
}

#[test]
fn one_channel_takes_the_lower_end() {
    let text = SMALL.replace("\"channels\": 16", "\"channels\": 1");
    let Lidar::Spinning { elevations, .. } = read(&text).unwrap().lidar else { panic!() };
    assert_eq!(elevations, [-24.8]);
}

#[test]
fn directions_are_normalized() {
    let lidar = r#""lidar": { "directions": [[3, 0, 4], [0, 1e300, 0]], "range": 50 },"#;
    let start = SMALL.find("\"lidar\"").unwrap();
    let end = SMALL.find("\"mount\"").unwrap();
    let text = format!("{}{lidar}{}", &SMALL[..start], &SMALL[end..]);
    let Lidar::Directions { directions, range } = read(&text).unwrap().lidar else { panic!() };
    assert!((DVec3::from(directions[0]) - DVec3::new(0.6, 0.0, 0.8)).length() < 1e-15);
    assert_eq!((directions[1], range), ([0.0, 1.0, 0.0], 50.0));
    let zero = text.replace("[3, 0, 4]", "[0, 0, 0]");
    assert_eq!(
        message(&zero),
        "s.json: lidar.directions[0]: [0.0, 0.0, 0.0] is not a direction: its length is 0; give a \
         vector that points somewhere"
    );
}

#[test]
fn a_sensor_file_gives_channels_and_offsets() {
    let dir = tempfile::tempdir().unwrap();
    let sensor = r#"{"name": "two", "elevation_deg": [-5, 5.5], "azimuth_offset_deg": [1, -2]}"#;
    std::fs::write(dir.path().join("two.json"), sensor).unwrap();
    std::fs::write(dir.path().join("none.json"), r#"{"name": "none"}"#).unwrap();
    let with = |lidar: &str| {
        let text = SMALL.replace("\"channels\": 16, \"fov\": [-24.8, 2.0]", lidar);
        Scene::from_json(&text, dir.path(), "s.json")
    };
    for (sign, offsets) in
        [("", [1.0, -2.0]), (", \"azimuth_offsets\": \"clockwise\"", [-1.0, 2.0])]
    {
        let scene = with(&format!("\"file\": \"two.json\"{sign}")).unwrap();
        let Lidar::Spinning { elevations, azimuth_offsets, .. } = scene.lidar() else { panic!() };
        assert_eq!(elevations, &[-5.0, 5.5]);
        assert_eq!(azimuth_offsets, &offsets);
    }
    let message = with("\"file\": \"none.json\"").unwrap_err().to_string();
    assert!(message.contains("none.json: `elevation_deg` is missing: "), "{message}");
    assert!(with("\"file\": \"nowhere.json\"").unwrap_err().to_string().contains("cannot be read"));
}

#[test]
fn actors_move_and_the_ego_carries_its_body() {
    let more = r#", "frames": 3,
      "ego": { "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [4, 2, 1] } }],
               "route": { "points": [[100, 200], [100, 300]], "spacing": 2 } },
      "actors": [{ "name": "tram", "parts": [{ "class": "dynamic", "plane": { "min": [0, 0], "max": [1, 1], "z": 2 } }],
                   "poses": [{ "x": 100, "y": 210 }, { "x": 100, "y": 212 }, { "x": 100, "y": 214, "yaw": 1.5707963267948966 }] }]"#;
    let scene = read(&full(BOX, more)).unwrap();
    for t in 0..3 {
        assert_eq!(scene.ego_pose(t).translation, DVec3::new(100.0, 200.0 + 2.0 * t as f64, 0.0));
        let soup = scene.frame(t, EgoBody::Include);
        assert_eq!(soup.face_class[..12], [0; 12]);
        assert_eq!(soup.face_class[12..14], [18; 2]);
        assert_eq!(soup.face_class[14..], [9; 12]);
        let without = scene.frame(t, EgoBody::Exclude);
        assert_eq!((without.faces.as_slice(), without.vertices.len()), (&soup.faces[..14], 12));
        // The ego looks along world +y, 10 m behind the actor.
        let corner = soup.vertices[8];
        assert!((corner[0] - 10.0).abs() < 1e-5 && corner[1].abs() < 1e-5, "{corner:?}");
        assert_eq!(corner[2], 2.0);
        // World +x is to the right of the ego until the actor turns to the left.
        let side = soup.vertices[9];
        let expected = if t < 2 { [10.0, -1.0] } else { [11.0, 0.0] };
        assert!((side[0] - expected[0]).abs() + (side[1] - expected[1]).abs() < 1e-5, "{side:?}");
        assert_eq!(soup.vertices[12], [-2.0, -1.0, 0.0]);
    }
}

#[test]
fn national_coordinates_keep_their_millimetres() {
    let shapes = r#"{ "class": "wall", "box": { "min": [85003.001, 447004.002, 0], "max": [85003.004, 447006, 3] } }"#;
    let more = r#", "frames": 1, "ego": { "poses": [{ "x": 85000, "y": 447000 }] }"#;
    let soup = read(&full(shapes, more)).unwrap().frame(0, EgoBody::Include);
    let [x, y, _] = soup.vertices[0];
    assert!((x - 3.001).abs() < 1e-6 && (y - 4.002).abs() < 1e-6, "{x} {y}");
    assert!((soup.vertices[1][0] - 3.004).abs() < 1e-6);
}

#[test]
fn shapes_are_named_copied_and_repeated() {
    let shapes = r#"{ "shape": "pair", "at": [[10, 0], [0, 5, 1, 3.141592653589793]] },
      { "class": "fence", "plane": { "min": [0, 0], "max": [1, 1], "z": 0 }, "repeat": { "count": 3, "step": [2, 0, 1] } }"#;
    let more = r#", "shapes": { "one": [{ "class": "pole", "plane": { "min": [1, 0], "max": [2, 1], "z": 0 } }],
      "pair": [{ "shape": "one" }, { "shape": "one", "at": [[0, 0, 4]] }] }"#;
    let soup = read(&full(shapes, more)).unwrap().frame(0, EgoBody::Include);
    assert_eq!(soup.faces.len(), 4 * 2 + 3 * 2);
    assert_eq!(soup.vertices[0], [11.0, 0.0, 0.0]);
    assert_eq!(soup.vertices[4], [11.0, 0.0, 4.0]);
    let turned = soup.vertices[12];
    assert!((turned[0] + 1.0).abs() < 1e-6 && (turned[1] - 5.0).abs() < 1e-6, "{turned:?}");
    assert_eq!(turned[2], 5.0);
    assert_eq!(soup.vertices[24], [4.0, 0.0, 2.0]);
}

#[test]
fn meshes_are_scaled_turned_and_mapped_to_classes() {
    let dir = tempfile::tempdir().unwrap();
    let obj = "mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl Grass\nf 1 2 3\nusemtl Post\nf 1 2 4\n";
    std::fs::write(dir.path().join("m.obj"), obj).unwrap();
    let with = |mesh: &str| {
        let text = full(&format!("{{ {mesh} }}"), "");
        Scene::from_json(&text, dir.path(), "s.json").map(|s| s.frame(0, EgoBody::Include))
    };
    let mesh = r#""class": "pole", "mesh": { "file": "m.obj", "scale": 2, "translate": [10, 0, 0], "yaw": 1.5707963267948966, "classes": { "Grass": "terrain" } }"#;
    let soup = with(mesh).unwrap();
    assert_eq!(soup.face_class, [20, 4]);
    assert!((soup.vertices[1][0] - 10.0).abs() < 1e-6 && (soup.vertices[1][1] - 2.0).abs() < 1e-6);
    let up = with(r#""class": "pole", "mesh": { "file": "m.obj", "axes": "y-up" }"#).unwrap();
    assert_eq!(up.vertices[2], [0.0, 0.0, 1.0]);
    let message = with(&mesh.replace("\"class\": \"pole\", ", "")).unwrap_err().to_string();
    let start = "s.json: static[0].mesh: mesh ";
    let end = "m.obj: material `Post` has no class; name it in `classes` or give the shape a \
               `class` for the rest";
    assert!(message.starts_with(start) && message.ends_with(end), "{message}");
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
            "roi.voxel[1]: number out of range (line 2, column 79)",
        ),
        ("[0.2, 0.2, 0.2]", "[0.2, NaN, 0.2]", "roi: expected value (line 2, column 75)"),
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
            "\"coverage\"",
            "\"detection\": [\"vehicles\"], \"coverage\"",
            "detection[0]: no class is called `vehicles`; did you mean `vehicle`?",
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
            "shapes.many[0]: 10000008 triangles are more than the limit of 10000000; take fewer copies or a coarser mesh",
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
            r#""ego": { "poses": [{ "x": 0, "y": 0, "yaw": 90 }] }"#,
            "ego.poses[0].yaw: 90 is not an angle in radians within one turn (-6.2832 to 6.2832)",
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
