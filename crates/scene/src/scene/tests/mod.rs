//! Scenes read from text: both forms, frames, routes, rules.

use std::collections::BTreeMap;
use std::path::Path;

use glam::DVec3;
use lidar_cast::geom::TriangleSoup;

use super::*;
use crate::vehicle::Ties;

mod bodies;
mod errors;
#[cfg(feature = "mesh")]
mod mesh_mounts;
#[cfg(feature = "mesh")]
mod robots;
mod vehicle;

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

/// Such a scene with a vehicle in place of its LiDAR and mount.
fn with_vehicle(vehicle: &str, shapes: &str, more: &str) -> String {
    let scene = full(shapes, more);
    let (from, to) = (scene.find("\"lidar\"").unwrap(), scene.find("\"static\"").unwrap());
    format!("{}\"vehicle\": {vehicle}, {}", &scene[..from], &scene[to..])
}

fn read(text: &str) -> Checked<Scene> {
    Scene::from_json(text, Path::new("dir"), "s.json")
}

fn message(text: &str) -> String {
    match read(text) {
        Ok(_) => panic!("accepted: {text}"),
        Err(e) => e.to_string(),
    }
}

/// Notes on a scene, a line each.
fn notes(scene: &Scene) -> String {
    scene.notes().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Doubts about a scene, a line each.
fn doubts(scene: &Scene) -> String {
    let doubts = scene.notes().iter().filter(|note| note.is_doubt());
    doubts.map(ToString::to_string).collect::<Vec<_>>().join("\n")
}

/// Notes on a scene with further keys, a line each; all of them are doubts.
pub(super) fn told(keys: &str) -> String {
    let roi = r#"{"min": [-20, -20, -0.5], "max": [20, 20, 5.5], "voxel": [0.4, 0.4, 0.4]}"#;
    let text = format!(r#"{{"sightline": 1, "roi": {roi}, {keys}}}"#);
    let scene = Scene::from_json(&text, Path::new(""), "s.json").unwrap();
    // That bodies move is a fact.
    let is_known =
        |note: &Note| note.is_doubt() || note.text().contains("moves from frame to frame");
    assert!(scene.notes().iter().all(is_known), "{}", notes(&scene));
    doubts(&scene)
}

const BOX: &str = r#"{ "class": "building", "box": { "foot": [10, 0, 0], "size": [2, 3, 4] } }"#;

#[test]
fn the_small_form_is_read() {
    let scene = read(SMALL).unwrap();
    assert_eq!(scene.name(), "two-walls");
    assert_eq!(read(&SMALL.replace("two-walls\",", " \",")).unwrap().name(), "s");
    assert_eq!(scene.roi().shape, [400, 400, 30]);
    assert_eq!(scene.coverage(), Coverage::Through);
    assert_eq!(*scene.psog_source(), PsogSource::File("dir/two-walls.psog.npz".into()));
    assert_eq!((scene.has_geometry(), scene.frame_count()), (false, 1));
    assert_eq!(scene.frame(0, EgoBody::Include), TriangleSoup::default());
    assert_eq!(scene.classes().len(), 21);
    assert_eq!(scene.detection_among(scene.classes()), [9]);
    // The classes of a P-SOG count, whatever the scene calls its own.
    assert_eq!(scene.detection_among(&["road".into(), "car".into()]), [1]);
    let vehicle = scene.vehicle();
    let [mount] = &vehicle.mounts[..] else { panic!("{vehicle:?}") };
    assert_eq!(mount.region.lower[3..], [-0.3, 0.0, 0.0]);
    assert_eq!(mount.region.upper[3..], [0.3, 0.0, 0.0]);
    assert_eq!((vehicle.min_distance, mount.count), (0.2, [4; 2]));
    assert_eq!((vehicle.keep_out.len(), vehicle.ties), (0, Ties::default()));
    let Lidar::Spinning { elevations, azimuth_offsets, azimuth_steps, azimuth, range } =
        scene.lidars()[0]
    else {
        panic!("{:?}", scene.lidars()[0]);
    };
    assert_eq!((elevations[0], elevations[15], *azimuth), (-24.8, 2.0, None));
    assert_eq!((&azimuth_offsets[..], *azimuth_steps, *range), (&[0.0; 16][..], 250, 100.0));
    assert_eq!(scene.lidars()[0].beam_count(), 4000);
}

#[test]
fn the_full_form_has_its_defaults() {
    let scene = read(&full(BOX, "")).unwrap();
    assert_eq!(scene.coverage(), Coverage::FirstHit);
    let PsogSource::Scan(scan) = scene.psog_source() else { panic!() };
    assert_eq!((scan.channels, scan.fov, scan.azimuth_steps), (None, [-50.0, 20.0], None));
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
    let Lidar::Spinning { elevations, .. } = read(&text).unwrap().lidars()[0].clone() else {
        panic!()
    };
    assert_eq!(elevations, [-24.8]);
}

#[test]
fn directions_are_normalized() {
    let lidar = r#""lidar": { "directions": [[3, 0, 4], [0, 1e300, 0]], "range": 50 },"#;
    let start = SMALL.find("\"lidar\"").unwrap();
    let end = SMALL.find("\"mount\"").unwrap();
    let text = format!("{}{lidar}{}", &SMALL[..start], &SMALL[end..]);
    let Lidar::Directions { directions, range } = read(&text).unwrap().lidars()[0].clone() else {
        panic!()
    };
    assert!((DVec3::from(directions[0]) - DVec3::new(0.6, 0.0, 0.8)).length() < 1e-15);
    assert_eq!((directions[1], range), ([0.0, 1.0, 0.0], 50.0));
    let zero = text.replace("[3, 0, 4]", "[0, 0, 0]");
    let words = "is not a direction: its length is 0; give a vector that points somewhere";
    assert_eq!(message(&zero), format!("s.json: lidar.directions[0]: [0.0, 0.0, 0.0] {words}"));
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
        let Lidar::Spinning { elevations, azimuth_offsets, .. } = scene.lidars()[0] else {
            panic!()
        };
        assert_eq!(elevations, &[-5.0, 5.5]);
        assert_eq!(azimuth_offsets, &offsets);
    }
    let none = with("\"file\": \"none.json\"").unwrap_err();
    assert_holds!(none, "none.json: `elevation_deg` is missing: ");
    assert_holds!(with("\"file\": \"nowhere.json\"").unwrap_err(), "cannot be read");
}

#[test]
fn a_sector_points_from_its_first_to_its_last_azimuth() {
    let with = |more: &str| {
        read(&SMALL.replace("\"azimuth_steps\": 250", &format!("\"azimuth_steps\": 5, {more}")))
    };
    let scene = with("\"azimuth\": [-60, 60]").unwrap();
    assert_eq!(scene.lidars()[0].beam_count(), 16 * 5);
    let table = scene.lidars()[0].table().unwrap();
    for (j, degrees) in [-60.0_f32, -30.0, 0.0, 30.0, 60.0].into_iter().enumerate() {
        let [x, y, _] = table.directions()[j];
        assert!((y.atan2(x).to_degrees() - degrees).abs() < 1e-4, "{j}: {x} {y}");
    }
    let grid = table.grid().unwrap();
    assert!(!grid.turn && grid.steps == 5);
    // Half of the steps, over the same field of view.
    let thin = scene.lidars()[0].thinned(2).table().unwrap();
    assert_eq!(thin.directions()[2], table.directions()[4]);
    let turn = with("\"azimuth\": [-180, 180]").unwrap_err().to_string();
    let words = "is not less than a turn: leave `azimuth` out for a sensor that turns";
    assert_eq!(turn, format!("s.json: lidar.azimuth: [-180.0, 180.0] {words}"));
    assert_holds!(with("\"azimuth\": [60, -60]").unwrap_err(), "with from < to");
    let one =
        SMALL.replace("\"azimuth_steps\": 250", "\"azimuth_steps\": 1, \"azimuth\": [90, 100]");
    let [x, y, _] = read(&one).unwrap().lidars()[0].table().unwrap().directions()[0];
    assert!(x.abs() < 1e-6 && y > 0.9);
}

#[test]
fn keys_that_a_sensor_file_does_not_need_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
    let ouster =
        r#"{"beam_altitude_angles": [1], "beam_azimuth_angles": [2], "lidar_mode": "512x20"}"#;
    file("ouster", ouster);
    file("livox", "Time,Azimuth,Zenith\n0,0,90\n0.5,10,90\n0.6,20,90\n");
    let with = |lidar: &str| {
        let form = "\"channels\": 16, \"fov\": [-24.8, 2.0], \"azimuth_steps\": 250";
        Scene::from_json(&SMALL.replace(form, lidar), dir.path(), "s.json")
    };
    let error = |lidar: &str| with(lidar).unwrap_err().to_string();
    assert_eq!(with(r#""file": "ouster""#).unwrap().lidars()[0].beam_count(), 512);
    let own = with(r#""file": "ouster", "azimuth_steps": 100"#).unwrap();
    assert_eq!(own.lidars()[0].beam_count(), 100);
    for (keys, words) in [
        (r#", "azimuth": [0, 90]"#, "`azimuth_steps` is missing"),
        (r#", "azimuth_offsets": "clockwise""#, "says which way it counts; leave it out"),
        (r#", "window": [0, 1]"#, "`window` cannot stand here: it cuts a Livox"),
    ] {
        assert_holds!(error(&format!(r#""file": "ouster"{keys}"#)), words);
    }
    assert_eq!(with(r#""file": "livox""#).unwrap().lidars()[0].beam_count(), 1);
    let two = with(r#""file": "livox", "window": [0.5, 0.7]"#).unwrap();
    assert_eq!(two.lidars()[0].beam_count(), 2);
    assert_holds!(error(r#""file": "livox", "window": [1, 0]"#), "with from < to");
    let steps = error(r#""file": "livox", "azimuth_steps": 4"#);
    assert_holds!(steps, "`azimuth_steps` cannot stand here");
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

#[cfg(feature = "mesh")]
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

#[test]
fn ground_is_road_soil_and_what_else_lies_flat() {
    let ground = |class: &&str| Ground::of(class).is_some();
    let found: Vec<&str> = DEFAULT_CLASSES.into_iter().filter(ground).collect();
    let want = ["road_line", "road", "sidewalk", "ground", "bridge", "rail_track", "terrain"];
    assert_eq!(found, want);
    assert_eq!(Ground::of("lane-marking"), Some(Ground::Road));
    let classes = ["car", "terrain"].map(str::to_owned);
    assert_eq!(Ground::among(&classes), [false, true]);
}

#[test]
fn further_rules_narrow_the_mount_and_are_checked_like_its_own() {
    let scene = || Scene::from_json(SMALL, Path::new(""), "s.json").unwrap();
    let rules = |fixed: &[(&str, f64)], symmetric| MountRules {
        equal_height: true,
        symmetric,
        fixed: fixed.iter().map(|(field, value)| ((*field).to_owned(), *value)).collect(),
    };
    let narrowed = scene().with_rules(&rules(&[("z", 2.5), ("roll", 0.0)], true), "s.json");
    let scene_before = scene();
    let (old, narrowed) = (scene_before.vehicle(), narrowed.unwrap());
    let new = narrowed.vehicle();
    let region = &new.mounts[0].region;
    assert_eq!(region.lower, [-0.6, -0.6, 2.5, 0.0, 0.0, 0.0]);
    assert_eq!(region.upper, [0.6, 0.6, 2.5, 0.0, 0.0, 0.0]);
    assert_eq!(new.ties, Ties { equal_height: true, symmetric: true });
    assert_eq!((new.mounts[0].count, new.min_distance), (old.mounts[0].count, old.min_distance));
    for (fixed, wanted) in [
        (("z", 3.0), "mount.z: 3 is not within the mount, which runs from 2.2 to 2.8"),
        (("roll", f64::NAN), "mount.roll: NaN is not within the mount"),
        (("height", 2.5), "mount.height: `height` is not one of x, y, z, roll, pitch and yaw"),
        (("roll", 0.1), "mount.symmetric: true is not possible where roll runs from 0.1 to 0.1"),
        (("y", 0.0), "mount.symmetric: true is not possible where y runs from 0 to 0"),
    ] {
        let error = scene().with_rules(&rules(&[fixed], true), "s.json").unwrap_err();
        assert_begins!(error, &format!("s.json: {wanted}"));
    }
    for (fixed, wanted) in [
        (vec![("z", 2.3), ("z", 2.5)], "mount.z: 2.5 is not the only value, z is fixed twice"),
        (vec![("roll", 10.0)], "in radians? 10° are 0.1745 rad"),
    ] {
        assert_holds!(scene().with_rules(&rules(&fixed, true), "s.json").unwrap_err(), wanted);
    }
}

#[test]
fn a_text_in_latin_1_is_refused_at_its_first_such_letter() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("s.json");
    std::fs::write(&file, b"{ \"sightline\": 1,\n  \"name\": \"caf\xe9\" }").unwrap();
    let told = Scene::read(&file).unwrap_err().to_string();
    let words = "is not UTF-8 text; save it as UTF-8 (line 2, column 15)";
    assert!(told.ends_with(words), "{told}");
    let vehicle = dir.path().join("v.json");
    std::fs::write(&vehicle, b"{ \"sightline\": 1, \"name\": \"Bus-f\xfcr\" }").unwrap();
    let told = Scene::level_ground(&vehicle).unwrap_err().to_string();
    assert_holds!(told, "v.json", "is not UTF-8 text; save it as UTF-8");
}

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
            let mount = scene.vehicle().corners()[0][2];
            assert!(f64::from(hi[2]) < mount && lo[2] >= 0.0, "{name}: {lo:?} {hi:?}");
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
