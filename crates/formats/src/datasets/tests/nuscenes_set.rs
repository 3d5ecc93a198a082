//! A small set in the layout of nuScenes, written as its tables are.

use std::path::Path;

use glam::{DQuat, DVec3};
use serde_json::{Value, json};

/// A keyframe: time in seconds, ego position and heading, points in the sensor frame with their labels.
pub(super) struct Keyframe {
    pub time: f64,
    pub ego: (DVec3, DQuat),
    pub points: Vec<([f32; 3], u8)>,
}

/// A box in the world: instance, category, keyframe, middle, size (w, l, h), yaw.
pub(super) type BoxRow = (&'static str, &'static str, usize, [f64; 3], [f64; 3], f64);

/// Where LIDAR_TOP stands: x right, y forward, as in nuScenes, a little tilted.
pub(super) fn lidar() -> (DVec3, DQuat) {
    let turn = DQuat::from_rotation_z(-std::f64::consts::FRAC_PI_2);
    (DVec3::new(0.9437, 0.0, 1.8402), turn * DQuat::from_rotation_x(0.02))
}

/// Categories of the set with their indices.
pub(super) const CATEGORIES: [(&str, u8); 7] = [
    ("noise", 0),
    ("human.pedestrian.adult", 2),
    ("vehicle.car", 17),
    ("flat.driveable_surface", 24),
    ("flat.sidewalk", 26),
    ("static.manmade", 28),
    ("vehicle.ego", 31),
];

fn wxyz(q: DQuat) -> [f64; 4] {
    [q.w, q.x, q.y, q.z]
}

/// Writes the set `v1.0-mini` with the scene `scene-0061`, and an empty second scene's rows among them.
pub(super) fn write(folder: &Path, keyframes: &[Keyframe], boxes: &[BoxRow]) {
    for sub in ["v1.0-mini", "samples/LIDAR_TOP", "lidarseg/v1.0-mini"] {
        std::fs::create_dir_all(folder.join(sub)).unwrap();
    }
    let table = |name: &str, rows: Vec<Value>| {
        let path = folder.join(format!("v1.0-mini/{name}.json"));
        std::fs::write(path, serde_json::to_string_pretty(&rows).unwrap()).unwrap();
    };
    let scene = |token: &str, name: &str| {
        json!({ "token": token, "name": name, "description": "", "log_token": "log",
                "nbr_samples": keyframes.len(), "first_sample_token": "sample-0",
                "last_sample_token": format!("sample-{}", keyframes.len().saturating_sub(1)) })
    };
    table("scene", vec![scene("other", "scene-0103"), scene("wanted", "scene-0061")]);
    let sensors = vec![
        json!({ "token": "camera", "channel": "CAM_FRONT", "modality": "camera" }),
        json!({ "token": "lidar", "channel": "LIDAR_TOP", "modality": "lidar" }),
    ];
    table("sensor", sensors);
    let (at, turn) = lidar();
    let calibrated = |token: &str, sensor: &str, at: DVec3, turn: DQuat| {
        json!({ "token": token, "sensor_token": sensor, "translation": at.to_array(),
                "rotation": wxyz(turn), "camera_intrinsic": [] })
    };
    let camera = calibrated("cs-camera", "camera", DVec3::X, DQuat::IDENTITY);
    table("calibrated_sensor", vec![camera, calibrated("cs-lidar", "lidar", at, turn)]);
    let category = |&(name, index): &(&str, u8)| json!({ "token": format!("c-{name}"), "name": name, "description": "", "index": index });
    table("category", CATEGORIES.iter().map(category).collect());
    let (mut samples, mut data, mut egos, mut lidarseg) = (vec![], vec![], vec![], vec![]);
    for (k, frame) in keyframes.iter().enumerate() {
        let (sample, stamp) = (format!("sample-{k}"), (frame.time * 1e6) as u64);
        samples.push(json!({ "token": sample, "timestamp": stamp, "scene_token": "wanted", "prev": "", "next": "" }));
        samples.push(json!({ "token": format!("else-{k}"), "timestamp": stamp, "scene_token": "other", "prev": "", "next": "" }));
        let scan = format!("samples/LIDAR_TOP/{k}.pcd.bin");
        let row = |token: String, sensor: &str, keyframe: bool, file: &str| {
            json!({ "token": token, "sample_token": sample, "ego_pose_token": format!("ego-{k}"),
                    "calibrated_sensor_token": sensor, "timestamp": stamp, "is_key_frame": keyframe,
                    "filename": file, "prev": "", "next": "" })
        };
        data.push(row(format!("sweep-{k}"), "cs-lidar", false, "sweeps/none.bin"));
        data.push(row(format!("image-{k}"), "cs-camera", true, "samples/none.jpg"));
        data.push(row(format!("data-{k}"), "cs-lidar", true, &scan));
        egos.push(json!({ "token": format!("ego-{k}"), "timestamp": stamp,
                          "translation": frame.ego.0.to_array(), "rotation": wxyz(frame.ego.1) }));
        let labels = format!("lidarseg/v1.0-mini/data-{k}_lidarseg.bin");
        lidarseg.push(json!({ "token": format!("data-{k}"), "sample_data_token": format!("data-{k}"), "filename": labels }));
        let row = |(k, &(p, _)): (usize, &([f32; 3], u8))| [p[0], p[1], p[2], 7.0, (k % 32) as f32];
        let values = frame.points.iter().enumerate().flat_map(row);
        let bytes: Vec<u8> = values.flat_map(f32::to_le_bytes).collect();
        std::fs::write(folder.join(scan), bytes).unwrap();
        let bytes: Vec<u8> = frame.points.iter().map(|&(_, label)| label).collect();
        std::fs::write(folder.join(labels), bytes).unwrap();
    }
    // Rows need not be in order of time.
    samples.reverse();
    table("sample", samples);
    table("sample_data", data);
    table("ego_pose", egos);
    table("lidarseg", lidarseg);
    write_boxes(table, boxes);
    std::fs::create_dir_all(folder.join("maps")).unwrap();
    std::fs::write(folder.join("maps/m.png"), []).unwrap();
}

/// Tables of boxes, and those that only need to be there.
fn write_boxes(table: impl Fn(&str, Vec<Value>), boxes: &[BoxRow]) {
    let mut instances: Vec<Value> = Vec::new();
    for (name, category, ..) in boxes {
        let row = json!({ "token": name, "category_token": format!("c-{category}"),
            "nbr_annotations": 1, "first_annotation_token": "", "last_annotation_token": "" });
        if !instances.contains(&row) {
            instances.push(row);
        }
    }
    table("instance", instances);
    let row = |(k, &(name, _, frame, at, size, yaw)): (usize, &BoxRow)| {
        json!({ "token": format!("box-{k}"), "sample_token": format!("sample-{frame}"),
                "instance_token": name, "attribute_tokens": [], "visibility_token": "4",
                "translation": at, "size": size, "rotation": wxyz(DQuat::from_rotation_z(yaw)),
                "num_lidar_pts": 1, "num_radar_pts": 0, "prev": "", "next": "" })
    };
    table("sample_annotation", boxes.iter().enumerate().map(row).collect());
    let level = |token| json!({ "token": token, "level": "", "description": "" });
    table("visibility", ["1", "2", "3", "4"].map(level).to_vec());
    table("attribute", vec![json!({ "token": "a", "name": "vehicle.moving", "description": "" })]);
    let log = json!({ "token": "log", "logfile": "", "vehicle": "", "date_captured": "",
        "location": "boston-seaport" });
    table("log", vec![log]);
    let map = json!({ "token": "m", "log_tokens": ["log"], "category": "semantic_prior",
        "filename": "maps/m.png" });
    table("map", vec![map]);
}
