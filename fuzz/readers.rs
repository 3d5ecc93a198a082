//! One function for each reader of outside bytes, shared by the fuzz targets and `tests/corpus.rs`.
//!
//! Each puts the bytes where the reader looks for them, reads them, and checks what was accepted:
//! whatever the bytes are, the answer is a value that keeps its promises or an error that says why.

use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::sync::LazyLock;
use std::time::Duration;

use serde_json::value::RawValue;
use sightline::datasets::{PsogOptions, build_psog, read_nuscenes};
use sightline::internals::RunDir;
use sightline::psog::{Psog, Roi, read_psog, write_psog};
use sightline::rig::RigFormat;
use sightline::scene::{Scene, Target};
use sightline::search::{Event, Run, State, Suite, TimeLimit};
use sightline::vehicle::sensor_file::{self as sensors, Beams};
use sightline::worlds::{import_opendrive, read_opendrive};
use sightline::{EngineChoice, Problem};

// Two crates have this file as a module, at different depths.
#[path = "checks.rs"]
mod checks;

use checks::{
    check_carla, check_kitti, check_mesh, check_placements, check_rig, check_scene, check_sequence,
    put, said, scene_with,
};

/// A reader by the name of its fuzz target and of its folder of seeds.
pub struct Reader {
    /// Name of the target.
    pub name: &'static str,
    /// Reads bytes, with a folder of its own for files.
    pub read: fn(&Path, &[u8]),
}

/// All readers of outside bytes.
pub const READERS: [Reader; 30] = [
    Reader { name: "scene_json", read: scene_json },
    Reader { name: "sensor_file", read: sensor_file },
    Reader { name: "vehicle_json", read: vehicle_json },
    Reader { name: "target_json", read: target_json },
    Reader { name: "placements_json", read: placements_json },
    Reader { name: "placements_jsonl", read: placements_jsonl },
    Reader { name: "psog_npz", read: psog_npz },
    Reader { name: "kitti_bin", read: kitti_bin },
    Reader { name: "kitti_label", read: kitti_label },
    Reader { name: "kitti_poses", read: kitti_poses },
    Reader { name: "kitti_calib", read: kitti_calib },
    Reader { name: "carla_ply", read: carla_ply },
    Reader { name: "carla_poses", read: carla_poses },
    Reader { name: "carla_npy", read: carla_npy },
    Reader { name: "nuscenes_tables", read: nuscenes_tables },
    Reader { name: "mesh_obj", read: mesh_obj },
    Reader { name: "mesh_ply", read: mesh_ply },
    Reader { name: "mesh_stl", read: mesh_stl },
    Reader { name: "mesh_gltf", read: mesh_gltf },
    Reader { name: "body_urdf", read: body_urdf },
    Reader { name: "rig_yaml", read: rig_yaml },
    Reader { name: "rig_urdf", read: rig_urdf },
    Reader { name: "rig_sdf", read: rig_sdf },
    Reader { name: "rig_launch", read: rig_launch },
    Reader { name: "rig_carla", read: rig_carla },
    Reader { name: "rig_objects", read: rig_objects },
    Reader { name: "rig_json", read: rig_json },
    Reader { name: "map_xodr", read: map_xodr },
    Reader { name: "checkpoint_json", read: checkpoint_json },
    Reader { name: "options", read: options },
];

/// A folder for the readers' files: in memory where there is such a place, since a file system on disk
/// makes sure of each of them.
pub fn folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    tempfile::tempdir_in(memory).or_else(|_| tempfile::tempdir()).expect("a folder for files")
}

/// A scene file; its meshes and sensors do not exist.
pub fn scene_json(folder: &Path, bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    check_scene(Scene::from_json(&text, folder, "scene.json"));
}

/// A sensor file of any vendor, which a scene names.
pub fn sensor_file(folder: &Path, bytes: &[u8]) {
    put(folder, "sensor", bytes);
    let Ok(pattern) = said(sensors::read(&folder.join("sensor"), None)) else { return };
    if let Some([from, to]) = pattern.azimuth {
        assert!(from <= to && to - from < 360.0 && from.abs() <= 360.0 && to.abs() <= 360.0);
    }
    let lidar = match &pattern.beams {
        Beams::Channels(channels) => {
            assert!((1..=1024).contains(&channels.len()));
            let mut all = channels.iter();
            assert!(all.all(|c| c.elevation.abs() <= 90.0 && c.azimuth_offset.abs() <= 360.0));
            r#"{ "file": "sensor", "azimuth_steps": 4, "range": 50 }"#
        }
        Beams::Directions(directions) => {
            let length = |d: &[f64; 3]| d.iter().map(|v| v * v).sum::<f64>();
            assert!(directions.iter().all(|d| (length(d) - 1.0).abs() < 1e-9));
            r#"{ "file": "sensor", "range": 50 }"#
        }
    };
    check_scene(Scene::from_json(&scene_with(lidar, ""), folder, "scene.json"));
}

/// Placements in one document.
pub fn placements_json(folder: &Path, bytes: &[u8]) {
    check_placements(folder, "placements.json", bytes);
}

/// Placements, one a line.
pub fn placements_jsonl(folder: &Path, bytes: &[u8]) {
    check_placements(folder, "placements.jsonl", bytes);
}

/// A P-SOG; one that is accepted survives being written and read again.
pub fn psog_npz(folder: &Path, bytes: &[u8]) {
    put(folder, "psog.npz", bytes);
    let Ok(psog) = said(read_psog(&folder.join("psog.npz"))) else { return };
    assert!(psog.index().is_sorted() && psog.index().last() < Some(&psog.roi().voxel_count()));
    let again = folder.join("again.npz");
    let file = std::fs::File::create(&again).expect("a file can be made");
    write_psog(file, &psog).expect("a P-SOG that was read can be written");
    assert_eq!(read_psog(&again).expect("a P-SOG that was written can be read"), psog);
}

/// The points of a labelled scan.
pub fn kitti_bin(folder: &Path, bytes: &[u8]) {
    let labels = 80_u32.to_le_bytes().repeat(bytes.len() / 16);
    check_kitti(folder, bytes, &labels, POSES.as_bytes(), CALIB.as_bytes());
}

/// The labels of a labelled scan.
pub fn kitti_label(folder: &Path, bytes: &[u8]) {
    let points = [1.5_f32, 0.5, 0.5, 0.0].map(f32::to_le_bytes).concat().repeat(bytes.len() / 4);
    check_kitti(folder, &points, bytes, POSES.as_bytes(), CALIB.as_bytes());
}

/// Camera poses of a sequence.
pub fn kitti_poses(folder: &Path, bytes: &[u8]) {
    check_kitti(folder, &SCAN, &LABEL, bytes, CALIB.as_bytes());
}

/// Calibration of a sequence.
pub fn kitti_calib(folder: &Path, bytes: &[u8]) {
    check_kitti(folder, &SCAN, &LABEL, POSES.as_bytes(), bytes);
}

/// A scan of CARLA's semantic LiDAR.
pub fn carla_ply(folder: &Path, bytes: &[u8]) {
    check_carla(folder, "000001.ply", bytes, CARLA_POSES.as_bytes());
}

/// A scan of CARLA's raw data as an array of records.
pub fn carla_npy(folder: &Path, bytes: &[u8]) {
    check_carla(folder, "000001.npy", bytes, CARLA_POSES.as_bytes());
}

/// Tables of nuScenes in one text, each below a line `=== NAME`; its scan has one point, a road.
pub fn nuscenes_tables(folder: &Path, bytes: &[u8]) {
    let (set, tables) = (folder.join("nuscenes"), folder.join("nuscenes/v1.0-mini"));
    for sub in ["samples", "lidarseg", "v1.0-mini"] {
        fs::create_dir_all(set.join(sub)).expect("the folder can be written");
    }
    put(&set, "samples/0.bin", &[1.5_f32, 0.5, -1.8, 0.0, 0.0].map(f32::to_le_bytes).concat());
    put(&set, "lidarseg/0.bin", &[24]);
    for name in NUSCENES_TABLES {
        let title = format!("=== {name}\n");
        let start = bytes.windows(title.len()).position(|w| w == title.as_bytes());
        let rest = start.map_or(&b"[]"[..], |start| &bytes[start + title.len()..]);
        let end = rest.windows(4).position(|w| w == b"=== ").unwrap_or(rest.len());
        put(&tables, &format!("{name}.json"), &rest[..end]);
    }
    let Ok(scenes) = said(read_nuscenes(&set, None, &[])) else { return };
    for scene in &scenes {
        check_sequence(folder, scene);
    }
    let roi = Roi::new([-8.0, -8.0, 0.0], [1.0; 3], [16, 16, 4]).expect("a valid grid");
    let _ = said(build_psog(&scenes, &PsogOptions::new(roi)));
}

/// Poses of CARLA's LiDAR.
pub fn carla_poses(folder: &Path, bytes: &[u8]) {
    check_carla(folder, "000001.ply", CARLA_SCAN.as_bytes(), bytes);
}

/// A mesh in Wavefront OBJ.
pub fn mesh_obj(folder: &Path, bytes: &[u8]) {
    check_mesh(folder, "mesh.obj", bytes);
}

/// A mesh in PLY, ascii or binary.
pub fn mesh_ply(folder: &Path, bytes: &[u8]) {
    check_mesh(folder, "mesh.ply", bytes);
}

/// A mesh in STL, text or binary.
pub fn mesh_stl(folder: &Path, bytes: &[u8]) {
    check_mesh(folder, "mesh.stl", bytes);
}

/// A robot in URDF as the body of the vehicle; of its meshes only `package://truck/hull.stl` exists.
pub fn body_urdf(folder: &Path, bytes: &[u8]) {
    let hull = folder.join("truck/hull.stl");
    if !hull.exists() {
        let made = fs::create_dir_all(folder.join("truck"));
        let stl = include_bytes!("corpus/mesh_stl/binary.stl");
        if made.and_then(|()| fs::write(&hull, stl)).is_err() {
            return;
        }
    }
    put(folder, "truck.urdf", bytes);
    let lidar = r#"{ "channels": 1, "fov": [0, 0], "azimuth_steps": 4, "range": 50 }"#;
    for geometry in ["visual", "collision"] {
        let ego = format!(
            r#", "ego": {{ "body": [{{ "class": "vehicle",
                 "urdf": {{ "file": "truck.urdf", "geometry": "{geometry}" }} }}] }}"#
        );
        check_scene(Scene::from_json(&scene_with(lidar, &ego), folder, "scene.json"));
    }
}

/// A mesh in glTF, text or binary: the bytes tell which.
pub fn mesh_gltf(folder: &Path, bytes: &[u8]) {
    put(folder, "beside.bin", &[0; 64]);
    check_mesh(folder, "mesh.gltf", bytes);
}

/// A map in OpenDRIVE, made into a world of two frames; its scene reads back.
pub fn map_xodr(folder: &Path, bytes: &[u8]) {
    put(folder, "map.xodr", bytes);
    let Ok(text) = said(read_opendrive(&folder.join("map.xodr"))) else { return };
    let Ok(world) = said(import_opendrive(&text, "map.xodr", 1, 2)) else { return };
    let mut scene = world.scene("map", "map.ply");
    // The mesh has a reader of its own.
    scene["static"] = serde_json::Value::Array(Vec::new());
    let read = Scene::from_json(&scene.to_string(), folder, "scene.json");
    assert!(read.is_ok(), "{read:?}");
    assert!(world.mesh().vertices.iter().flatten().all(|v| v.is_finite()));
}

/// A rig in Autoware's YAML, PandaSet's, or static transforms.
pub fn rig_yaml(_: &Path, bytes: &[u8]) {
    check_rig(bytes, Some(RigFormat::Autoware));
    check_rig(bytes, Some(RigFormat::Pandaset));
    check_rig(bytes, Some(RigFormat::Tf));
}

/// A rig in URDF.
pub fn rig_urdf(_: &Path, bytes: &[u8]) {
    check_rig(bytes, Some(RigFormat::Urdf));
}

/// A rig in SDF.
pub fn rig_sdf(_: &Path, bytes: &[u8]) {
    check_rig(bytes, Some(RigFormat::Sdf));
}

/// A rig in a launch file of ROS 1 or ROS 2.
pub fn rig_launch(_: &Path, bytes: &[u8]) {
    check_rig(bytes, Some(RigFormat::Ros2Launch));
}

/// A list of sensors of CARLA, as JSON.
pub fn rig_carla(_: &Path, bytes: &[u8]) {
    check_rig(bytes, Some(RigFormat::Carla));
}

/// Objects of the CARLA ROS bridge.
pub fn rig_objects(_: &Path, bytes: &[u8]) {
    check_rig(bytes, Some(RigFormat::CarlaObjects));
}

/// Placements as a rig.
pub fn rig_json(_: &Path, bytes: &[u8]) {
    check_rig(bytes, Some(RigFormat::Json));
}

/// State of a search with the digest that belongs to it, as `--resume` takes it; one that is accepted takes a step.
pub fn checkpoint_json(folder: &Path, bytes: &[u8]) {
    let Ok(text) = serde_json::from_slice::<Box<RawValue>>(bytes) else { return };
    let folder = folder.join("run");
    let _ = fs::remove_dir_all(&folder);
    let run = RunDir::<Box<RawValue>>::create("fuzzed", Some(&folder), "run", Vec::new());
    run.and_then(|run| run.save(&text)).expect("the folder can be written");
    let Ok((run, state)) = said(RunDir::<State>::resume("fuzzed", &folder)) else { return };
    if said(state.check(&SEARCHED).map_err(|why| run.refusal(&why))).is_err() {
        return;
    }
    let mut search = Run::resume(SEARCHED.clone(), state);
    let engine = EngineChoice { memory: Some(16 << 20), ..EngineChoice::cpu() };
    search.open_with(engine, Some(TimeLimit::from_now(Duration::from_millis(50))), None);
    let _ = said(search.step(&mut |_: &Event<'_>| true));
}

/// A little scene that is searched; the seeds of [`checkpoint_json`] are states of such searches.
static SEARCHED: LazyLock<Suite> = LazyLock::new(|| {
    let roi = Roi::new([-4.0, -4.0, -1.0], [1.0; 3], [8, 8, 4]).expect("a valid grid");
    let classes = vec!["vehicle".to_owned()];
    let psog = Psog::new(roi, 4, classes, vec![9, 70, 130], vec![1, 2, 3]).expect("a valid P-SOG");
    let text = r#"{ "sightline": 1, "name": "searched",
        "roi": { "min": [-4, -4, -1], "max": [4, 4, 3], "voxel": [1, 1, 1] },
        "lidar": { "channels": 2, "fov": [-20, 10], "azimuth_steps": 8, "range": 50 },
        "mount": { "min": [-1, -1, 0], "max": [1, 1, 1], "min_distance": 0.2, "lidars": 2 },
        "psog": { "file": "none.npz" }, "coverage": "first-hit", "frames": 2,
        "static": [{ "class": "road_line", "plane": { "min": [-4, -4], "max": [4, 4], "z": -1 } }],
        "actors": [{ "parts": [{ "class": "vehicle", "box": { "center": [0, 0, 0], "size": [1, 1, 1] } }],
                     "poses": [{ "x": 2, "y": -1 }, { "x": 2, "y": 0 }] }] }"#;
    let scene = Scene::from_json(text, Path::new("."), "scene.json").expect("a valid scene");
    let problem = Problem::from_scene(&scene, &psog, scene.sensors().expect("beams"), &[0, 1])
        .expect("a valid problem");
    Suite::new([("searched".to_owned(), problem.into())]).expect("a scene")
});

/// Arguments of the program, one a line; none is run, and a refusal is one line.
pub fn options(_: &Path, bytes: &[u8]) {
    let text = String::from_utf8_lossy(bytes);
    let words = std::iter::once("sightline").chain(text.lines());
    let words: Vec<OsString> = words.map(OsString::from).collect();
    let Some(told) = sightline::cli::refusal(&words) else { return };
    assert!(!told.is_empty() && told.contains("--help"), "{told}");
}

const SCAN: [u8; 16] = [0, 0, 128, 63, 0, 0, 128, 63, 0, 0, 128, 63, 0, 0, 0, 0];
const LABEL: [u8; 4] = [80, 0, 0, 0];
const POSES: &str = "1 0 0 0 0 1 0 0 0 0 1 0\n";
const CALIB: &str = "Tr: 0 -1 0 0 0 0 -1 -0.1 1 0 0 -0.2\n";

const CARLA_POSES: &str = "frame,x,y,z,roll,pitch,yaw\n1,10,-5,2,0,0,30\n";
const CARLA_SCAN: &str = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float32 x\nproperty float32 y\n\
    property float32 z\nproperty uint32 ObjIdx\nproperty uint32 ObjTag\nend_header\n1 2 -1.5 0 1\n";

/// Tables of nuScenes that are read.
const NUSCENES_TABLES: [&str; 10] = [
    "scene", "sample", "sensor", "calibrated_sensor", "sample_data", "ego_pose", "lidarseg",
    "category", "instance", "sample_annotation",
];

/// Target files. An accepted target has an extent, and its box lies around its middle.
pub fn target_json(folder: &Path, bytes: &[u8]) {
    let file = folder.join("target.json");
    if fs::write(&file, bytes).is_err() {
        return;
    }
    if let Ok(target) = Target::read(&file) {
        let [low, high] = target.corners;
        assert!(target.size.iter().all(|side| (0.0..=100.0).contains(side)));
        assert!((0..2).all(|k| (low[k] + high[k]).abs() <= 1e-3 && low[k] <= high[k]));
        assert!(!target.tree.triangles.is_empty());
    }
}

/// A vehicle file of a scene without anything else; of its files only the mesh `roof.obj` exists.
pub fn vehicle_json(folder: &Path, bytes: &[u8]) {
    let scene = r#"{ "sightline": 1, "roi": { "min": [-40, -40, -1], "max": [40, 40, 5], "voxel": [1, 1, 1] },
                     "psog": { "file": "x.npz" }, "coverage": "through", "vehicle": "vehicle.json" }"#;
    let roof = folder.join("roof.obj");
    if !roof.exists() && fs::write(roof, include_str!("../tests/data/roof.obj")).is_err() {
        return;
    }
    if fs::write(folder.join("vehicle.json"), bytes).is_err() {
        return;
    }
    let scene = Scene::from_json(scene, folder, "scene.json");
    if let Ok(vehicle) = scene.as_ref().map(Scene::vehicle) {
        let equipment = vehicle.cheapest();
        assert!((1..=16).contains(&equipment.len()) && vehicle.cost(&equipment) >= 0.0);
        let rules = vehicle.constraints(&equipment);
        let middle = |(low, high): &(f64, f64)| 0.5 * (low + high);
        let middles: Vec<f64> = rules.variable_bounds().iter().map(middle).collect();
        let poses = rules.poses_of(&middles);
        assert!(poses.iter().all(|pose| pose.values().iter().all(|v| v.is_finite())));
    }
    check_scene(scene);
}
