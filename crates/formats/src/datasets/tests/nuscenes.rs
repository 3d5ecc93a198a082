//! Sets in the layout of nuScenes: counts against brute force, boxes of a real sweep, faults.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::{DMat3, DQuat, DVec3};

use super::faults::{Spoil, begins, put, read_text, remove};
use super::nuscenes_set::{BoxRow, Keyframe, lidar, write};
use crate::datasets::nuscenes::ScanBox;
use crate::datasets::{
    ImportOptions, ImportedScene, LabelledSequence, PsogOptions, build_psog, read_nuscenes,
    to_scene,
};
use lidar_cast::geom::Pose;
use sightline_scene::psog::Roi;
use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES, EgoBody, Scene};

/// Number in 0..1 of a sequence that repeats itself.
fn noise(state: &mut u64) -> f64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*state >> 40) as f64 / f64::from(1 << 24)
}

/// Boxes of a parked car and of one that drives past, over the frames of [`set`].
const BOXES: [BoxRow; 5] = [
    ("parked", "vehicle.car", 0, [612.0, 1604.0, 0.9], [2.0, 4.0, 1.6], 0.3),
    ("parked", "vehicle.car", 2, [612.1, 1604.0, 0.9], [2.0, 4.0, 1.6], 0.3),
    ("parked", "vehicle.car", 1, [612.0, 1604.1, 0.9], [2.0, 4.0, 1.6], 0.3),
    ("driving", "vehicle.car", 0, [608.0, 1597.0, 0.9], [2.0, 5.0, 1.6], 0.1),
    ("driving", "vehicle.car", 2, [616.0, 1597.4, 0.9], [2.0, 5.0, 1.6], 0.1),
];

/// Three keyframes 1.5 m and 0.2 rad apart: points all around of random labels, more of them in the boxes.
fn set() -> Vec<Keyframe> {
    let mut state = 3;
    let (at, turn) = lidar();
    let frame = |k: usize| {
        let position = DVec3::new(600.0 + 1.5 * k as f64, 1600.0 + 0.3 * k as f64, 0.02);
        let ego = (position, DQuat::from_rotation_z(0.4 + 0.2 * k as f64));
        let mut points = Vec::new();
        for n in 0..4000 {
            let mut spread = |half: f64| (2.0 * noise(&mut state) - 1.0) * half;
            let mut point = [spread(20.0), spread(20.0), spread(2.0)].map(|v| v as f32);
            let mut label = [0, 2, 17, 24, 26, 28, 31][n % 7];
            let around: Vec<&BoxRow> = BOXES.iter().filter(|row| row.2 == k).collect();
            if n % 4 == 0 && !around.is_empty() {
                let row = around[n % around.len()];
                let own = DVec3::new(spread(2.2), spread(1.1), spread(0.8));
                let world = DVec3::from(row.3) + DQuat::from_rotation_z(row.5) * own;
                let in_ego = ego.1.inverse() * (world - ego.0);
                point = (turn.inverse() * (in_ego - at)).as_vec3().to_array();
                label = 17;
            }
            points.push((point, label));
        }
        Keyframe { time: 1000.0 + 0.5 * k as f64, ego, points }
    };
    (0..3).map(frame).collect()
}

fn roi() -> Roi {
    Roi::from_bounds([-15.0, -15.0, -0.5], [15.0, 15.0, 3.5], [0.5; 3]).unwrap()
}

/// Class of a label by its name in the default list, and whether boxes are drawn around such things.
fn class_of(label: u8) -> Option<(usize, bool)> {
    let (name, boxed) = match label {
        2 => ("pedestrian", true),
        17 => ("vehicle", true),
        24 => ("road", false),
        26 => ("sidewalk", false),
        28 => ("building", false),
        _ => return None,
    };
    Some((DEFAULT_CLASSES.iter().position(|c| *c == name).unwrap(), boxed))
}

/// Points of a keyframe in the world by quaternions alone, and its sensor's place.
fn in_world(frame: &Keyframe) -> (Vec<DVec3>, DVec3) {
    let (at, turn) = lidar();
    let world = |p: DVec3| frame.ego.0 + frame.ego.1 * (at + turn * p);
    let points = frame.points.iter();
    (points.map(|(p, _)| world(DVec3::from(p.map(f64::from)))).collect(), world(DVec3::ZERO))
}

/// True if a world point lies in the box of an instance in a frame, grown by a margin; no box holds nothing.
fn in_box(name: &str, frame: usize, point: DVec3, margin: f64) -> bool {
    let Some(row) = BOXES.iter().find(|row| row.0 == name && row.2 == frame) else { return false };
    let own = DQuat::from_rotation_z(-row.5) * (point - DVec3::from(row.3));
    let half = [row.4[1], row.4[0], row.4[2]].map(|edge| edge / 2.0 + margin);
    own.x.abs() <= half[0] && own.y.abs() <= half[1] && own.z.abs() <= half[2]
}

/// True if a world point lies in the parked car's box of a frame.
fn parked(frame: usize, point: DVec3) -> bool {
    in_box("parked", frame, point, 0.0)
}

/// True if a point of a thing moves: in the driving car's box or a quarter of a metre beside it.
fn drives(frame: usize, point: DVec3) -> bool {
    in_box("driving", frame, point, 0.25) && !parked(frame, point)
}

type Counts = BTreeMap<([i64; 3], usize), u16>;

/// Frames of each voxel and class, counted point by point.
fn brute_force(set: &[Keyframe], window: usize) -> Counts {
    let mut counts = Counts::new();
    for (t, frame) in set.iter().enumerate() {
        let mut votes: HashMap<[i64; 3], BTreeMap<usize, u32>> = HashMap::new();
        for (n, other) in set.iter().enumerate().filter(|(n, _)| n.abs_diff(t) <= window) {
            let (points, sensor) = in_world(other);
            let to_ego = |p: DVec3| frame.ego.1.inverse() * (p - frame.ego.0);
            for (&point, &(_, label)) in points.iter().zip(&other.points) {
                let Some((class, boxed)) = class_of(label) else { continue };
                if n != t && boxed && drives(n, point) {
                    continue;
                }
                let (point, origin) = (to_ego(point), to_ego(sensor));
                let pushed = point + 0.001 * (point - origin).normalize();
                let voxel = (pushed + DVec3::new(15.0, 15.0, 0.5)) / 0.5;
                let voxel = voxel.to_array().map(|v| v.floor() as i64);
                if (0..3).all(|k| (0..[60, 60, 8][k]).contains(&voxel[k])) {
                    *votes.entry(voxel).or_default().entry(class).or_default() += 1;
                }
            }
        }
        for (voxel, classes) in votes {
            let most = classes.values().max().unwrap();
            let (class, _) = classes.iter().find(|(_, n)| *n == most).unwrap();
            *counts.entry((voxel, *class)).or_default() += 1;
        }
    }
    counts
}

#[test]
fn counts_are_those_of_brute_force() {
    let folder = tempfile::tempdir().unwrap();
    let set = set();
    write(folder.path(), &set, &BOXES);
    let scenes = read_nuscenes(folder.path(), None, &["scene-0061".to_owned()]).unwrap();
    assert_eq!((scenes.len(), &scenes[0].name()[..]), (1, "scene-0061"));
    assert_eq!(scenes[0].rate(), Some(2.0));
    for window in [0, 1, 9] {
        let options = PsogOptions { window: Some(window as u32), ..PsogOptions::new(roi()) };
        let (psog, report) = build_psog(&scenes, &options).unwrap();
        assert_eq!(report.frames, 3);
        let mut ours = Counts::new();
        for (row, &voxel) in psog.rows().zip(psog.index()) {
            for (class, &count) in row.iter().enumerate().filter(|(_, count)| **count > 0) {
                ours.insert((roi().coords(voxel).map(i64::from), class), count);
            }
        }
        let theirs = brute_force(&set, window);
        assert!(theirs.len() > 3000, "{}", theirs.len());
        assert!(ours == theirs, "window {window}: {} and {} counts", ours.len(), theirs.len());
    }
}

#[test]
fn points_move_as_the_quaternions_say_and_boxes_hold_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let set = set();
    write(folder.path(), &set, &BOXES);
    // A byte order mark changes nothing.
    edit(folder.path(), "scene", "[", "\u{feff}[");
    let scene =
        read_nuscenes(folder.path(), Some("v1.0-mini"), &["scene-0061".into()]).unwrap().remove(0);
    let mut in_boxes = 0;
    for (k, frame) in set.iter().enumerate() {
        let pose = scene.world_from_sensor(k as u32).unwrap();
        let scan = scene.read(k as u32).unwrap();
        let (expected, _) = in_world(frame);
        for ((point, label), expected) in scan.points.iter().zip(&scan.labels).zip(expected) {
            let found = pose.apply(DVec3::from(point.map(f64::from)));
            assert!(found.distance(expected) < 1e-9, "{found} {expected}");
            assert!(label.moving || !label.on_track || parked(k, expected));
            assert!(!label.moving || drives(k, expected));
            in_boxes += usize::from(label.on_track);
        }
    }
    assert!(in_boxes > 1500, "{in_boxes}");
    let tracks = scene.tracks().unwrap();
    assert_eq!(tracks.len(), 2);
    assert!(!tracks[0].at_rest() && tracks[1].at_rest());
    assert_eq!((tracks[0].kind, tracks[0].size), (ActorKind::Car, [5.0, 2.0, 1.6]));
}

#[test]
fn a_scene_of_boxes_stands_where_the_points_were() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &set(), &BOXES);
    let sequence = read_nuscenes(folder.path(), None, &["scene-0061".into()]).unwrap().remove(0);
    let imported = to_scene(&sequence, &ImportOptions { cell: 1.0 }).unwrap();
    let ImportedScene { plates, boxes, actors, .. } = imported;
    assert!(plates > 100 && boxes > 10 && actors == 2, "{plates} {boxes} {actors}");
    let scene = Scene::from_json(&imported.scene.to_string(), folder.path(), "scene.json").unwrap();
    assert_eq!((scene.frame_count(), scene.rate()), (3, 2.0));
    let start = DVec3::new(600.0, 1600.0, 0.02);
    for t in 0..3 {
        let (ours, theirs) = (scene.ego_pose(t), set()[t].ego);
        assert!((ours.translation + start).distance(theirs.0) < 1e-3);
        assert!((ours.rotation * DVec3::X).distance(theirs.1 * DVec3::X) < 1e-6);
        assert!(!scene.frame(t, EgoBody::Include).faces.is_empty());
    }
    let at = |actor, t| scene.actor_glide(actor, t).at(0.0).translation + start;
    // Actors by the tokens of their instances: the driving one has no row in frame 1.
    assert!(at(0, 1).distance(DVec3::new(612.0, 1597.2, 0.9)) < 1e-3, "{}", at(0, 1));
    // Boxes stand where they are annotated; boxes of parked cars, too.
    for (t, place) in
        [[612.0, 1604.0, 0.9], [612.0, 1604.1, 0.9], [612.1, 1604.0, 0.9]].iter().enumerate()
    {
        assert!(at(1, t).distance(DVec3::from(*place)) < 1e-3, "{}", at(1, t));
    }
    let tracks = scene.tracks();
    assert!(tracks.iter().all(|track| track.kind == ActorKind::Car && track.name == "vehicle.car"));
}

/// A walk of 0.2 m a frame, a turn on the spot, noise of 2 cm, and a thing that is not seen in the last frame.
#[test]
fn slow_actors_move_as_they_are_annotated() {
    let (person, size) = ("human.pedestrian.adult", [0.6, 0.6, 1.8]);
    let row = |name, k, x, y, yaw| (name, person, k, [600.0 + x, 1600.0 + y, 0.9], size, yaw);
    let boxes = [
        row("a-walks", 0, 9.0, 1.0, 0.0),
        row("a-walks", 1, 9.0, 1.2, 0.0),
        row("a-walks", 2, 9.0, 1.4, 0.0),
        row("b-turns", 0, 9.0, 5.0, 0.0),
        row("b-turns", 1, 9.0, 5.0, 0.5),
        row("b-turns", 2, 9.0, 5.0, 1.0),
        row("c-stands", 0, 9.0, 9.0, 0.0),
        row("c-stands", 1, 9.02, 9.0, 0.01),
        row("c-stands", 2, 9.0, 9.02, 0.0),
        row("d-hides", 0, 9.0, -5.0, 0.0),
        row("d-hides", 1, 9.0, -5.2, 0.0),
    ];
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &set(), &boxes);
    let sequence = read_nuscenes(folder.path(), None, &["scene-0061".into()]).unwrap().remove(0);
    let imported = to_scene(&sequence, &ImportOptions { cell: 1.0 }).unwrap();
    let scene = Scene::from_json(&imported.scene.to_string(), folder.path(), "scene.json").unwrap();
    let pose = |actor, t| scene.actor_glide(actor, t).at(0.0);
    let ys = |actor| [0, 1, 2].map(|t| (pose(actor, t).translation.y * 1000.0).round() / 1000.0);
    assert_eq!(ys(0), [1.0, 1.2, 1.4]);
    let heading = |t| (pose(1, t).rotation * DVec3::X).y;
    for (t, yaw) in [0.0_f64, 0.5, 1.0].iter().enumerate() {
        assert!((heading(t) - yaw.sin()).abs() < 1e-6);
    }
    assert_eq!(ys(2), [9.0; 3]);
    // Within half a metre it stands where it was last seen, and does not wait below the street.
    assert_eq!(ys(3), [-5.0, -5.2, -5.2]);
    assert!((pose(3, 2).translation.z - pose(3, 1).translation.z).abs() < 1e-9);
}

fn edit(folder: &Path, table: &str, from: &str, to: &str) {
    let name = format!("v1.0-mini/{table}.json");
    let text = read_text(folder, &name);
    assert!(text.contains(from), "{table} {from}");
    put(folder, &name, text.replacen(from, to, 1));
}

/// Texts of a table that are replaced, and how the error goes on behind the name of its file.
const EDITED: [(&str, &str, &str, &str); 18] = [
    ("scene", r#""other""#, r#""wanted""#, r#": the row "wanted": it comes twice; leave one out"#),
    ("scene", "scene-0103", "scene-0061", r#": the row "scene-0061": it comes twice"#),
    ("sample", r#""sample-1""#, r#""sample-0""#, r#": the row "sample-0": it comes twice"#),
    (
        "category",
        "c-flat.sidewalk",
        "c-vehicle.car",
        r#": the row "c-vehicle.car": it comes twice"#,
    ),
    ("sensor", r#""camera""#, r#""lidar""#, r#": the row "lidar": it comes twice"#),
    ("calibrated_sensor", "cs-camera", "cs-lidar", r#": the row "cs-lidar": it comes twice"#),
    ("sample_annotation", "sample-2", "sample-0", r#": the row "box-1": its instance has another"#),
    ("sample", r#""timestamp""#, "timestamp", ": row 0: key must be a string at line 4 column 5;"),
    ("ego_pose", r#""rotation""#, r#""turned""#, ": row 0: missing field `rotation` at line"),
    (
        "scene",
        "scene-0061",
        "scene-0001",
        r#": no scene is called "scene-0061"; it has `scene-0103`, `scene-0001`"#,
    ),
    (
        "sample",
        "sample-1",
        "sample-x",
        r#": has no row for "sample-1", which sample_data.json names"#,
    ),
    ("ego_pose", "ego-1", "ego-x", r#": has no row for "ego-1", which sample_data.json names;"#),
    (
        "lidarseg",
        r#""sample_data_token": "data-2""#,
        r#""sample_data_token": "data-9""#,
        r#": has no row for "data-2""#,
    ),
    (
        "instance",
        "parked",
        "left",
        r#": has no row for "parked", which sample_annotation.json names;"#,
    ),
    (
        "category",
        r#""name": "static.manmade""#,
        r#""name": "static.man""#,
        r#": category "static.man" is unknown; known are `noise`, `animal`,"#,
    ),
    ("category", r#""index": 24"#, r#""index": 28"#, r#": the row ""#),
    ("sample_data", "samples/LIDAR_TOP/1.pcd.bin", "../x.bin", r#": "../x.bin" leaves the folder"#),
    (
        "sample_annotation",
        "612.0",
        "1e300",
        r#": the row "box-0": its translation is farther than"#,
    ),
];

/// Other faults planted in a good set, and how each error begins.
const SPOILT: [(Spoil, &str); 15] = [
    (
        |d| put(d, "v1.0-mini/scene.json", "[]"),
        "DIR/v1.0-mini/scene.json: lists no scene; give a set of at least one",
    ),
    (
        |d| {
            let text = read_text(d, "v1.0-mini/sample.json");
            let bytes: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
            put(d, "v1.0-mini/sample.json", bytes);
        },
        "DIR/v1.0-mini/sample.json is not UTF-8 text; save it as UTF-8",
    ),
    (
        |d| remove(d, "v1.0-mini/scene.json"),
        "DIR holds no folder with a scene.json; name the version",
    ),
    (
        |d| remove(d, "v1.0-mini/lidarseg.json"),
        "DIR/v1.0-mini/lidarseg.json: the table is missing (",
    ),
    (
        |d| remove(d, "v1.0-mini/ego_pose.json"),
        "DIR/v1.0-mini/ego_pose.json: the table is missing (",
    ),
    (
        |d| put(d, "v1.0-mini/sample.json", "{}"),
        "DIR/v1.0-mini/sample.json: row 0: invalid type: map, expected a list of rows",
    ),
    (
        |d| edit(d, "category", "\"index\": 24", "\"index\": 99"),
        "DIR/lidarseg/v1.0-mini/data-0_lidarseg.bin: point 3 has label 24, and category.json has no category",
    ),
    (
        |d| {
            let text = read_text(d, "v1.0-mini/category.json").replace("\"index\"", "\"number\"");
            put(d, "v1.0-mini/category.json", text);
        },
        "DIR/v1.0-mini/category.json: no category has an `index`",
    ),
    (
        |d| edit(d, "lidarseg", "lidarseg/v1.0-mini/data-1", "/etc/data-1"),
        "DIR/v1.0-mini/lidarseg.json: \"/etc/data-1_lidarseg.bin\" leaves the folder",
    ),
    (
        |d| edit(d, "scene", "{", &format!("{{\"token\": \"{}", "x".repeat(2 << 20))),
        "DIR/v1.0-mini/scene.json: row 0: is longer than 1024 KiB",
    ),
    (
        |d| {
            let name = "v1.0-mini/sample_data.json";
            put(d, name, read_text(d, name).replace("\"sample-1\"", "\"sample-0\""));
        },
        "DIR/v1.0-mini/sample_data.json: the row \"data-1\": its sample has a keyframe",
    ),
    (
        |d| {
            let labels = std::fs::read(d.join("lidarseg/v1.0-mini/data-1_lidarseg.bin")).unwrap();
            put(d, "samples/LIDAR_TOP/1.pcd.bin", vec![0; 16 * labels.len()]);
        },
        "DIR/samples/LIDAR_TOP/1.pcd.bin has 4 numbers for each label, 5 are read as one point;",
    ),
    (
        |d| put(d, "samples/LIDAR_TOP/1.pcd.bin", [0; 42]),
        "DIR/samples/LIDAR_TOP/1.pcd.bin has 42 bytes, not a multiple of 20,",
    ),
    (
        |d| put(d, "lidarseg/v1.0-mini/data-1_lidarseg.bin", [24; 7]),
        "DIR/lidarseg/v1.0-mini/data-1_lidarseg.bin has 7 labels, but DIR/samples/LIDAR_TOP/1.pcd.bin has 4000 points;",
    ),
    (
        |d| {
            let mut bytes = std::fs::read(d.join("samples/LIDAR_TOP/2.pcd.bin")).unwrap();
            bytes[24..28].copy_from_slice(&f32::NAN.to_le_bytes());
            put(d, "samples/LIDAR_TOP/2.pcd.bin", bytes);
        },
        "DIR/samples/LIDAR_TOP/2.pcd.bin: point 1 has y = NaN;",
    ),
];

#[test]
fn bad_sets_are_refused() {
    let keyframes = set();
    let refused = |spoil: &dyn Fn(&Path), wanted: &str| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), &keyframes, &BOXES);
        begins(folder.path(), spoil, wanted, || {
            let scenes = read_nuscenes(folder.path(), None, &["scene-0061".into()])?;
            build_psog(&scenes, &PsogOptions::new(roi())).map(drop)
        });
    };
    for (table, from, to, fault) in EDITED {
        let wanted = format!("DIR/v1.0-mini/{table}.json{fault}");
        refused(&|d: &Path| edit(d, table, from, to), &wanted);
    }
    SPOILT.into_iter().for_each(|(spoil, wanted)| refused(&spoil, wanted));
}

/// A vehicle whose rotations are x, y, z, w, and a LiDAR in millimetres.
#[test]
fn poses_of_other_units_and_orders_are_doubted() {
    let doubts = |keyframes: &[Keyframe], spoil: &dyn Fn(&Path)| {
        let folder = tempfile::tempdir().unwrap();
        write(folder.path(), keyframes, &BOXES);
        spoil(folder.path());
        let scenes = read_nuscenes(folder.path(), None, &["scene-0061".into()]).unwrap();
        let notes = crate::datasets::LabelledSequence::notes(&scenes[0]).iter();
        let notes = notes.filter(|note| note.is_doubt());
        notes.map(ToString::to_string).collect::<String>()
    };
    let driven = doubts(&set(), &|_| {});
    assert!(!driven.contains("backwards") && !driven.contains("millimetres"), "{driven}");
    let mut mixed = set();
    for Keyframe { ego: (_, turn), .. } in &mut mixed {
        // The table holds x, y, z, w of this turn as w, x, y, z of another one.
        *turn = DQuat::from_xyzw(turn.y, turn.z, turn.w, turn.x);
    }
    assert_holds!(doubts(&mixed, &|_| {}), "in 2 of 2 steps between keyframes");
    let told = doubts(&set(), &|folder| edit(folder, "calibrated_sensor", "0.9437", "943.7"));
    assert!(told.contains("calibrated_sensor.json: LIDAR_TOP of the scene"), "{told}");
}

#[test]
fn a_scene_is_named_once() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), &set(), &BOXES);
    let twice = ["scene-0061".to_owned(), "scene-0103".to_owned(), "scene-0061".to_owned()];
    let error = read_nuscenes(folder.path(), None, &twice).unwrap_err().to_string();
    assert!(error.starts_with("the scene \"scene-0061\" is named twice;"), "{error}");
}

/// The points of a real sweep in its boxes: 61 of 69 boxes hold as many as nuScenes counted.
#[test]
#[cfg_attr(not(has_nuscenes), ignore = "needs nuScenes in ../shared/data or SIGHTLINE_DATA")]
fn boxes_of_a_real_sweep_hold_their_points() {
    let folder = Path::new(env!("REAL_DATA")).join("nc/nuscenes");
    let text = std::fs::read_to_string(folder.join("boxes.json")).unwrap();
    // Velocities that nobody knows stand there as NaN, which is no JSON.
    let text = text.replace("NaN", "null");
    let boxes: serde_json::Value = serde_json::from_str(&text).unwrap();
    let sweep = "n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd.bin";
    let points = crate::datasets::sequence::read_points::<20>(&folder.join(sweep)).unwrap();
    assert_eq!(points.len(), 34_688);
    let (mut equal, mut inside, mut declared) = (0, 0, 0);
    let all = boxes["instances"].as_array().unwrap();
    for row in all {
        let value = |k: usize| row["box"][k].as_f64().unwrap();
        let center = DVec3::new(value(0), value(1), value(2));
        let rotation = DMat3::from_rotation_z(value(6));
        let box_from_sensor = Pose { rotation, translation: center }.inverse();
        let it = ScanBox { box_from_sensor, half: DVec3::new(value(3), value(4), value(5)) / 2.0 };
        let held = points.iter().filter(|p| it.holds(DVec3::from(p.map(f64::from)))).count() as u64;
        let wanted = row["num_lidar_pts"].as_u64().unwrap();
        (inside, declared) = (inside + held, declared + wanted);
        equal += usize::from(held == wanted);
    }
    assert_eq!((all.len(), equal, inside, declared), (69, 61, 994, 1009));
}
