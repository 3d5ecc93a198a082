//! Scans of CARLA: three forms of one scan, mirrored axes, actors as boxes, faults.

use std::path::Path;

use glam::{DMat3, DVec3, Vec3};

use super::faults::{Spoil, begins, put, remove};
use crate::datasets::carla::class_of_name;
use crate::datasets::{
    CarlaSequence, CarlaTags, FormatError, ImportOptions, LabelledSequence, PsogOptions,
    build_psog, to_scene,
};
use sightline_scene::psog::Roi;
use sightline_scene::scene::{ActorKind, DEFAULT_CLASSES, Scene};

/// x, y (right), z, object, tag.
type Point = (f32, f32, f32, u32, u32);

/// Poses of two frames: the second 10 m on along x, 5 m to the right, turned 90° to the right, rolled.
const POSES: &str =
    "frame,x,y,z,roll,pitch,yaw,time\n7,100,20,2.4,0,0,0,3.0\n8,110,25,2.4,10,0,90,3.1\n";

/// A road all around, a wall to the left, and a car on its way from (8, 3) to (9, 3), y to the right.
fn scan(shift: f32) -> Vec<Point> {
    let mut points = Vec::new();
    for i in -20..20_i16 {
        for j in -10..10_i16 {
            points.push((f32::from(i) * 0.4 + 0.2, f32::from(j) * 0.4 + 0.2, -2.4, 0, 1));
        }
        let along = f32::from(i) * 0.3;
        points.push((along, -5.1, -1.0, 0, 4));
        points.push((along, -5.1, -1.1, 0, 4));
        points.push((along.abs() * 0.75 + 6.0 + shift, 2.0 + f32::from(i % 2) * 0.5, -1.5, 42, 14));
    }
    points
}

fn ply(points: &[Point]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float32 x\nproperty float32 y\nproperty float32 z\n\
         property float32 CosAngle\nproperty uint32 ObjIdx\nproperty uint32 ObjTag\nend_header\n",
        points.len()
    );
    for (x, y, z, object, tag) in points {
        text += &format!("{x:.4} {y:.4} {z:.4} 0.5000 {object} {tag}\n");
    }
    text
}

fn records(points: &[Point]) -> Vec<u8> {
    let record = |&(x, y, z, object, tag): &Point| {
        let numbers = [x, y, z, 0.5].map(f32::to_le_bytes).concat();
        [numbers, [object, tag].map(u32::to_le_bytes).concat()].concat()
    };
    points.iter().flat_map(record).collect()
}

fn npy(points: &[Point]) -> Vec<u8> {
    let header = format!(
        "{{'descr': [('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('CosAngle', '<f4'), ('ObjIdx', '<u4'), \
         ('ObjTag', '<u4')], 'fortran_order': False, 'shape': ({},), }}\n",
        points.len()
    );
    let length = (header.len() as u16).to_le_bytes();
    [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), &records(points)].concat()
}

fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("lidar_000007.ply"), ply(&scan(0.0))).unwrap();
    std::fs::write(folder.path().join("000008.bin"), records(&scan(1.0))).unwrap();
    std::fs::write(folder.path().join("poses.csv"), POSES).unwrap();
    folder
}

fn open(folder: &Path) -> Result<CarlaSequence, FormatError> {
    CarlaSequence::open(folder, &folder.join("poses.csv"), None, None)
}

#[test]
fn all_forms_of_a_scan_are_one() {
    let dir = folder();
    let read = |name: &str, bytes: Vec<u8>| {
        std::fs::remove_file(dir.path().join("000008.bin")).unwrap_or_default();
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let points = open(dir.path()).unwrap().read(8).unwrap().points;
        std::fs::remove_file(path).unwrap();
        points
    };
    let points = scan(0.25);
    let raw = read("8.bin", records(&points));
    assert_eq!(raw.len(), points.len());
    assert_eq!(raw[5], [points[5].0, -points[5].1, points[5].2]);
    assert_eq!(read("8.npy", npy(&points)), raw);
    let text = read("scan8.ply", ply(&points).into_bytes());
    assert!(raw.iter().zip(&text).all(|(a, b)| Vec3::from(*a).distance(Vec3::from(*b)) < 1e-4));
}

/// CARLA's own matrix (left-handed, y right) against ours: M·C·M with M = diag(1, −1, 1).
#[test]
fn poses_are_those_of_carla_mirrored() {
    let dir = folder();
    let poses = "file,x,y,z,roll,pitch,yaw\n7.ply,1,2,3,0,0,0\n/data/00008.ply,4,5,6,11,-23,37\n";
    std::fs::write(dir.path().join("poses.csv"), poses).unwrap();
    let pose = open(dir.path()).unwrap().world_from_sensor(8).unwrap();
    let [(sr, cr), (sp, cp), (sy, cy)] = [11.0_f64, -23.0, 37.0].map(|v| v.to_radians().sin_cos());
    // carla.Transform.get_matrix(), row by row.
    let rows = [
        DVec3::new(cp * cy, cy * sp * sr - sy * cr, -cy * sp * cr - sy * sr),
        DVec3::new(cp * sy, sy * sp * sr + cy * cr, -sy * sp * cr + cy * sr),
        DVec3::new(sp, -cp * sr, cp * cr),
    ];
    let carla = DMat3::from_cols(rows[0], rows[1], rows[2]).transpose();
    let mirror = DMat3::from_diagonal(DVec3::new(1.0, -1.0, 1.0));
    assert!(pose.rotation.abs_diff_eq(mirror * carla * mirror, 1e-12), "{:?}", pose.rotation);
    assert_eq!(pose.translation, DVec3::new(4.0, -5.0, 6.0));
}

#[test]
fn counts_are_those_of_the_points() {
    let dir = folder();
    let sequence = open(dir.path()).unwrap();
    assert!((sequence.lidar_height() - 2.4).abs() < 1e-6);
    assert_eq!((sequence.frames(), sequence.rate()), (vec![7, 8], Some(10.0)));
    let roi = Roi::from_bounds([-9.0, -9.0, -0.5], [9.0, 9.0, 3.5], [0.5; 3]).unwrap();
    let options = PsogOptions { window: Some(0), ..PsogOptions::new(roi) };
    let (psog, report) = build_psog(&[sequence], &options).unwrap();
    assert_eq!(report.points_in + report.points_outside, 2 * scan(0.0).len() as u64);
    let class = |name| DEFAULT_CLASSES.iter().position(|c| *c == name).unwrap();
    // The wall lies 5.1 m to the left, 1.4 m up; the car 2 m to the right.
    let voxel =
        |point: DVec3| psog.find(roi.voxel_of(point).unwrap()).map(|k| psog.row(k).to_vec());
    assert_eq!(voxel(DVec3::new(0.1, 5.15, 1.35)).unwrap()[class("wall")], 2);
    assert_eq!(voxel(DVec3::new(0.1, -5.15, 1.35)), None);
    assert_eq!(voxel(DVec3::new(6.1, -2.05, 0.95)).unwrap()[class("vehicle")], 1);
}

#[test]
fn actors_become_boxes_on_their_way() {
    let dir = folder();
    // Both frames from the same place, so that the car alone moves, by 1 m along x.
    std::fs::write(
        dir.path().join("poses.csv"),
        "frame,x,y,z,roll,pitch,yaw\n7,5,0,2.4,0,0,0\n8,5,0,2.4,0,0,0\n",
    )
    .unwrap();
    let sequence = open(dir.path()).unwrap();
    let tracks = sequence.tracks().unwrap();
    assert_eq!((tracks.len(), tracks[0].kind, tracks[0].name.as_str()), (1, ActorKind::Car, "Car"));
    let [first, second] = [0, 1].map(|k| tracks[0].poses[k].world_from_box);
    assert!((second.translation - first.translation).distance(DVec3::X) < 1e-4);
    assert!((tracks[0].size[0] - 4.5).abs() < 1e-4, "{:?}", tracks[0].size);
    assert!((first.rotation * DVec3::X).distance(DVec3::X) < 1e-6);
    let imported = to_scene(&sequence, &ImportOptions::default()).unwrap();
    let scene = Scene::from_json(&imported.scene.to_string(), dir.path(), "scene.json").unwrap();
    assert_eq!((scene.frame_count(), scene.tracks()[0].kind), (2, ActorKind::Car));
    // 16 × 8 m of road are one plate.
    assert_eq!((imported.plates, imported.actors), (1, 1), "{}", imported.scene["static"]);
}

#[test]
fn every_tag_has_a_meaning() {
    for (tags, classes) in [(CarlaTags::Until0913, 21), (CarlaTags::Since0914, 27)] {
        let found = tags.names().iter().map(|name| class_of_name(name).unwrap());
        assert_eq!(found.filter(|(class, ..)| class.is_some()).count(), classes);
    }
    // The old tags without Unlabeled and Sky are the default classes in their order.
    let old = CarlaTags::Until0913.names().iter().filter_map(|name| class_of_name(name).unwrap().0);
    assert!(old.eq(0..21));
    for (name, class) in [("Buildings", 0), ("RoadLines", 5), ("TrafficSigns", 11), ("Bus", 9)] {
        assert_eq!(class_of_name(name).unwrap().0, Some(class), "{name}");
    }
    assert_eq!(class_of_name("Submarine"), None);
}

/// The scan of [`scan`] with the tags of 0.9.10.
fn old_scan() -> Vec<Point> {
    let old = |tag| match tag {
        1 => 7,
        4 => 1,
        _ => 10,
    };
    scan(0.0).into_iter().map(|(x, y, z, object, tag)| (x, y, z, object, old(tag))).collect()
}

#[test]
fn the_road_tells_the_version_of_the_tags() {
    let dir = folder();
    let open = |tags, height| {
        CarlaSequence::open(dir.path(), &dir.path().join("poses.csv"), tags, height).unwrap()
    };
    let sequence = open(None, None);
    assert_eq!((sequence.tags(), sequence.notes()), (CarlaTags::Since0914, &[][..]));
    for file in ["lidar_000007.ply", "000008.bin"] {
        std::fs::remove_file(dir.path().join(file)).unwrap();
    }
    // Read as 0.9.14, the wall beside the road would be the road.
    for frame in [7, 8] {
        std::fs::write(dir.path().join(format!("{frame}.bin")), records(&old_scan())).unwrap();
    }
    let sequence = open(None, None);
    assert_eq!(sequence.tags(), CarlaTags::Until0913);
    assert!((sequence.lidar_height() - 2.4).abs() < 1e-6);
    let [note] = sequence.notes() else { panic!("{:?}", sequence.notes()) };
    assert!(!note.is_doubt() && note.text().contains("--carla-tags"), "{note}");
    let forced = open(Some(CarlaTags::Since0914), Some(2.4));
    assert_eq!(forced.tags(), CarlaTags::Since0914);
    let is_told = |sequence: &CarlaSequence, words: &str| {
        sequence.notes().iter().any(|note| note.is_doubt() && note.text().contains(words))
    };
    assert!(is_told(&forced, "of 0.9.10 fit better"));
    // A height that the road contradicts.
    assert!(is_told(&open(None, Some(4.0)), "2.40 m below it"));
    // Few points of a road: the scan that has most of them counts, and their number is told.
    let few = |frame: u32, count: i16, z: f32| {
        let points: Vec<Point> = (0..count).map(|k| (f32::from(k), 1.0, z, 0, 1)).collect();
        std::fs::write(dir.path().join(format!("{frame}.bin")), records(&points)).unwrap();
    };
    few(7, 2, -1.0);
    few(8, 9, -2.0);
    let since = Some(CarlaTags::Since0914);
    let unsure = open(since, None);
    assert_eq!(unsure.lidar_height(), 2.0);
    assert!(is_told(&unsure, "at most 9 points in a scan"));
    let words =
        "which put the LiDAR 2.00 m above the ground; --lidar-height gives the LiDAR's height.";
    assert!(is_told(&unsure, words), "{:?}", unsure.notes());
    assert!(!is_told(&open(since, Some(2.0)), "at most 9"));
    few(8, 10, -2.5);
    let sure = open(since, None);
    assert_eq!((sure.lidar_height(), sure.notes()), (2.5, &[][..]));
    // No evidence for either version.
    for frame in [7, 8] {
        let points = [(3.0, 0.0, -1.0, 0, 9)];
        std::fs::write(dir.path().join(format!("{frame}.bin")), records(&points)).unwrap();
    }
    assert!(open(None, Some(2.0)).notes()[0].is_doubt());
}

#[test]
fn tables_of_poses_say_what_is_not_read() {
    let dir = folder();
    let text = "frame,x,y,z,roll,pitch,yaw,time,speed\n7,0,0,2.4,0,0,0,2,1\n8,1,0,2.4,0,0,0,1,1\n9,1,0,2.4,0,0,0,3,1\n";
    poses(dir.path(), text);
    let sequence = open(dir.path()).unwrap();
    let said = sequence.notes().iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for part in
        ["columns `speed` are not known", "1 rows belong to no scan", "frame 8 after it 1; times"]
    {
        assert!(said.contains(part), "{part}: {said}");
    }
}

fn poses(folder: &Path, text: &str) {
    put(folder, "poses.csv", text);
}

fn in_ply(folder: &Path, from: &str, to: &str) {
    put(folder, "lidar_000007.ply", ply(&scan(0.0)).replacen(from, to, 1));
}

/// Words in `poses.csv`, their replacement, and the beginning of the error.
const SPOILT_POSES: [(&str, &str, &str); 10] = [
    ("2.4,0", "2,4,0", " line 2: has more cells than the first row; write decimals with a point"),
    ("roll", "x", " line 1: has two columns \"x\"; leave one out"),
    ("frame,", "1,1,", " line 1: give a first row with frame (or file), x, y, z"),
    ("\n8,110", "\r8,nan", " line 3: \"nan\" is no number within"),
    ("\n8,", "\n9,", " has no row for frame 8, whose scan is DIR/000008.bin;"),
    ("\n8,", "\n7,", " line 3: frame 7 comes twice;"),
    ("110", "nan", " line 3: \"nan\" is no number within"),
    ("\n8,", "\nlast,", " line 3: \"last\" ends with no frame number"),
    // Numbers that are no frame, not names of files that end with one.
    ("\n8,", "\n8.5,", " line 3: \"8.5\" ends with no frame number"),
    ("\n8,", "\n-8,", " line 3: \"-8\" ends with no frame number"),
];

/// Other faults planted in good scans, and how each error begins.
const SPOILT: [(Spoil, &str); 12] = [
    (
        |d| {
            for (old, new) in [("lidar_000007.ply", "7.bin"), ("000008.bin", "8.bin")] {
                remove(d, old);
                put(d, new, records(&[(3.0, 0.0, -1.0, 0, 99)]));
            }
        },
        "DIR/7.bin: point 0 has tag 99; tags of CARLA 0.9.14 end at 28,",
    ),
    (
        |d| in_ply(d, " 0.5000", " 0.5000 7"),
        "DIR/lidar_000007.ply line 11: has more than the 6 numbers of the header",
    ),
    (
        |d| put(d, "last.ply", "ply\n"),
        "DIR/last.ply: a scan of CARLA is named by its frame, at most 4294967295, like 000123.ply;",
    ),
    (
        |d| put(d, "4294967296.bin", []),
        "DIR/4294967296.bin: a scan of CARLA is named by its frame, at most 4294967295,",
    ),
    (|d| poses(d, ""), "DIR/poses.csv line 1: give a first row with frame (or file)"),
    (|d| poses(d, "frame,x,y,z,roll,pitch\n"), "DIR/poses.csv line 1: has no column yaw;"),
    (|d| put(d, "8.ply", "ply\n"), "DIR has two scans of frame 8; keep one"),
    (|d| put(d, "000008.bin", [0; 25]), "DIR/000008.bin has 25 bytes, not a multiple of 24,"),
    (
        |d| put(d, "000008.bin", records(&[(0.0, f32::NAN, 0.0, 0, 1)])),
        "DIR/000008.bin: point 0 has y = NaN;",
    ),
    (
        |d| put(d, "000008.bin", records(&[(0.0, 1.0, 0.0, 0, 29)])),
        "DIR/000008.bin: point 0 has tag 29; tags of CARLA 0.9.14 end at 28,",
    ),
    (
        |d| in_ply(d, "uint32 ObjTag", "uint32 Tag"),
        "DIR/lidar_000007.ply line 10: the header has no property ObjTag",
    ),
    (
        |d| in_ply(d, "vertex 920", "vertex 921"),
        "DIR/lidar_000007.ply line 930: 921 points are announced, and 920 follow",
    ),
];

#[test]
fn bad_scans_are_refused() {
    assert_eq!(scan(0.0).len(), 920);
    let roi = Roi::new([-8.0, -8.0, 0.0], [1.0; 3], [16, 16, 4]).unwrap();
    let refused = |spoil: &dyn Fn(&Path), wanted: &str| {
        let folder = folder();
        begins(folder.path(), spoil, wanted, || {
            build_psog(&[open(folder.path())?], &PsogOptions::new(roi)).map(drop)
        });
    };
    for (from, to, fault) in SPOILT_POSES {
        let spoil = |d: &Path| poses(d, &POSES.replace(from, to));
        refused(&spoil, &format!("DIR/poses.csv{fault}"));
    }
    SPOILT.into_iter().for_each(|(spoil, wanted)| refused(&spoil, wanted));
}
