//! Numbers as people write them, and names of mounts, in what `optimize`, `score` and `rig` print and write.

use crate::cli::*;

/// A street corner with a car on it, and a vehicle whose LiDARs stand on a roof that is turned, so that poses are sums of
/// products, and on a nose.
fn folder() -> TempDir {
    let dir = TempDir::new().unwrap();
    let scene = json!({
        "sightline": 1, "name": "corner",
        "roi": { "min": [-8, -8, -0.5], "max": [8, 8, 2.5], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 4, "fov": [-20, 0], "azimuth_steps": 48, "range": 50 },
        "mount": { "min": [-0.5, -0.5, 1.5], "max": [0.5, 0.5, 2.0], "lidars": 2 },
        "frames": 2, "rate": 5,
        "static": [{ "class": "ground", "plane": { "min": [-20, -20], "max": [20, 20], "z": 0 } }],
        "actors": [{ "name": "crate", "kind": "car", "poses": [{ "x": 5, "y": 0 }, { "x": 4, "y": 1 }],
            "parts": [{ "class": "vehicle", "box": { "min": [-0.5, -1, 0], "max": [0.5, 1, 2] } }] }],
    });
    let lidar = json!({ "channels": 4, "fov": [-20, 0], "azimuth_steps": 48, "range": 50 });
    let vehicle = json!({
        "sightline": 1, "sensors": [{ "name": "four", "price": 1, "phase": 0.0, "lidar": lidar }],
        "mounts": [
            { "name": "roof", "polygon": [[-0.53, -0.41, 1.9], [0.47, -0.43, 1.97], [0.45, 0.4, 1.99], [-0.55, 0.42, 1.92]],
              "roll": [-0.31, 0.3], "pitch": [-0.21, 0.2], "count": [1, 1] },
            { "name": "nose", "min": [2.01, -0.33, 0.51], "max": [2.21, 0.31, 0.71], "pitch": [-0.1, 0.3], "count": [1, 1] },
        ],
    });
    write(&dir, "s.json", &scene);
    write(&dir, "car.json", &vehicle);
    dir
}

/// Every number of a document that has a fraction, with the keys that lead to it.
fn numbers(at: &str, value: &Value, found: &mut Vec<(String, String)>) {
    match value {
        Value::Number(number) if number.is_f64() => found.push((at.to_owned(), number.to_string())),
        Value::Array(list) => list.iter().for_each(|value| numbers(at, value, found)),
        Value::Object(map) => {
            map.iter().for_each(|(key, value)| numbers(&format!("{at}.{key}"), value, found));
        }
        _ => {}
    }
}

/// Fails on a number of more than nine digits, on −0, and on a pose with an exponent of dust.
fn as_people_write(what: &str, document: &Value) {
    let mut found = Vec::new();
    numbers(what, document, &mut found);
    assert!(found.len() > 10, "{what}: {found:?}");
    for (at, text) in found {
        let digits = text.split('e').next().unwrap_or_default();
        let digits = digits.trim_start_matches(['-', '0', '.']).replace('.', "");
        assert!(digits.len() <= 10 && text != "-0.0", "{at}: {text}");
        let dust = at.contains("lidars") && text.parse::<f64>().unwrap().abs() < 5e-10;
        assert!(!dust || text == "0.0", "{at}: {text}");
    }
}

const OPTIMIZE: &str =
    "optimize s.json --vehicle car.json --evaluations 40 --seed 3 --backend cpu --out run";

#[test]
fn a_found_pose_has_nine_decimals_and_is_scored_as_it_is_written() {
    let dir = folder();
    ok(&dir, OPTIMIZE);
    let mut result = read_json(dir.path().join("run/result.json"));
    let found = read_json(dir.path().join("run/placements.json"));
    as_people_write("placements", &json!(found["placements"][0]));
    as_people_write("result", &result["best"]["placement"]);
    // Poses of a turned roof are not on any grid, so the test is of something.
    let pose = found["placements"][0]["lidars"][0].to_string();
    assert!(pose.len() > 80, "{pose}");
    let score = "score s.json run/placements.json --vehicle car.json --backend cpu";
    let mut again = ok(&dir, score)["scores"][0].take();
    let mut scores = result["best"]["scores"].take();
    for one in [&mut again, &mut scores] {
        one.as_object_mut().unwrap().retain(|key, _| key != "guards" && key != "price");
    }
    assert_eq!(again, scores);
}

#[test]
fn lidars_carry_the_names_of_their_mounts() {
    let dir = folder();
    let printed = stdout(&dir, OPTIMIZE);
    let rows: Vec<&str> =
        printed.lines().skip_while(|line| !line.starts_with("LiDAR ")).take(6).collect();
    rows[0].says("mount");
    rows[3].says("x mm").says("yaw °");
    let (first, second) = (rows[1], rows[2]);
    assert!(first.contains(" roof") && second.contains(" nose"), "{printed}");
    let metres: f64 = second.split_whitespace().nth(1).unwrap().parse().unwrap();
    let millimetres: f64 = rows[5].split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!(metres > 2.0 && (millimetres - 1000.0 * metres).abs() <= 0.51, "{printed}");
    let result = read_json(dir.path().join("run/result.json"));
    assert_eq!(result["mounts"], json!(["roof", "nose"]));
    let page = read_text(&dir, "run/report.html");
    assert!(page.contains("Positions in millimetres") && page.contains(">nose<"));

    let export = "rig export run/placements.json:optimized --vehicle car.json --format";
    let launch = stdout(&dir, &(export, "ros2-launch"));
    launch.says("--child-frame-id roof_lidar\"").says("--child-frame-id nose_lidar\"");
    assert!(!launch.contains("e-1") && !launch.contains("-0 "), "{launch}");
    // Names of before stay good, and those given count.
    let named = "carla --sensor lidar_1=four --sensor roof_lidar=four";
    let carla: Value = serde_json::from_str(&stdout(&dir, &(export, named))).unwrap();
    assert_eq!([&carla[0]["id"], &carla[1]["id"]], ["roof_lidar", "nose_lidar"]);
    as_people_write("carla", &carla);
    stdout(&dir, &(export, "json --frame a --frame b")).says("four");
}
