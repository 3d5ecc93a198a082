//! Sensors of other technologies in `study redundancy`: sectors and shadows in closed form, tables, and wrong input.

use crate::cli::*;
use crate::cli_shared::{cells, yard};

/// Half of the edges of the body on the pad, and its top, metres.
const PAD_BODY: [f64; 2] = [0.5, 1.5];

pub(crate) fn f64s<const N: usize>(value: &Value) -> [f64; N] {
    let values: Vec<f64> = value.list().iter().map(|v| v.number()).collect();
    values.try_into().unwrap()
}

/// Level ground around a block of 1 m, a LiDAR that looks up, and whatever else stands there.
fn pad(others: &Value, walls: &[Value]) -> TempDir {
    let dir = TempDir::new().unwrap();
    let [half, top] = PAD_BODY;
    let body = json!([{ "class": "vehicle", "box": { "min": [-half, -half, 0.2], "max": [half, half, top] } }]);
    let up = json!({ "channels": 4, "fov": [10, 20], "azimuth_steps": 8, "range": 20 });
    let vehicle = json!({ "sightline": 1, "name": "block", "body": body, "sensors": [{ "name": "up", "lidar": up }],
        "mounts": [{ "name": "mast", "min": [-1, -1, 0.5], "max": [1, 1, 4], "count": 1 }], "other_sensors": others });
    write(dir.path(), "block.json", &vehicle);
    let mut world =
        vec![json!({ "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } })];
    world.extend_from_slice(walls);
    let scene = json!({ "sightline": 1, "name": "pad", "frames": 1, "coverage": "first-hit", "vehicle": "block.json",
        "classes": ["road", "wall", "vehicle"], "psog": { "scan": { "window": 2, "stride": 1 } },
        "roi": { "min": [-12, -12, -0.5], "max": [12, 12, 2.5], "voxel": [1, 1, 1] }, "static": world });
    write(dir.path(), "pad.json", &scene);
    write_rig(dir.path(), "rig.json", "one", json!([{ "x": 0, "y": 0, "z": 3.5 }]));
    dir
}

fn technologies(dir: &Path, args: &str) -> Value {
    let found = ok(dir, &format!("study redundancy {args} --backend cpu"));
    found["rows"][0]["technologies"].clone()
}

/// Counts of a thing: by the number of technologies, and each technology's.
pub(crate) fn counts(seen: &Value) -> ([f64; 4], Vec<f64>) {
    let each = seen["each"].list().iter();
    (f64s(&seen["by"]), each.map(|of| of["count"].number()).collect())
}

#[test]
fn sectors_of_level_ground_are_counted_by_their_angles() {
    // The camera looks down from 3 m above the middle: the block, 1.5 m high, hides the ground to twice its half edge. The
    // radar, 1 m up and turned to the left, sees 10° down, from 1 / tan 10° on.
    let others = json!([
        { "name": "mast", "technology": "camera", "x": 0, "y": 0, "z": 3, "yaw": 0.3, "fov": [80, 180], "range": 50 },
        { "name": "corner", "technology": "radar", "x": 0.6, "y": 0, "z": 1, "yaw": 0.5, "fov": [120, 20], "range": 8 }]);
    let dir = pad(&others, &[]);
    let found = technologies(dir.path(), "pad.json rig.json --target car");
    let degrees = |y: f64, x: f64, yaw: f64| (y.atan2(x) - yaw).to_degrees();
    for (key, within) in [("ground_3m", 3.0), ("ground_10m", 10.0)] {
        let (mut by, mut each) = ([0.0; 4], vec![0.0; 3]);
        for ([x, y], _) in
            cells([PAD_BODY[0]; 2]).into_iter().filter(|(_, distance)| *distance <= within)
        {
            let is_hidden = x.abs().max(y.abs()) < 3.0 / (3.0 - PAD_BODY[1]) * PAD_BODY[0];
            let camera = degrees(y, x, 0.3).abs() <= 40.0 && !is_hidden;
            let level = (x - 0.6).hypot(y);
            let is_near = level.hypot(1.0) <= 8.0 && level >= 1.0 / 10_f64.to_radians().tan();
            // Behind its left side the block is in the way; 60° to either side of 0.5 rad stay ahead of it.
            let radar = is_near && degrees(y, x - 0.6, 0.5).abs() <= 60.0;
            by[usize::from(camera) + usize::from(radar)] += 1.0;
            each[1] += f64::from(u8::from(camera));
            each[2] += f64::from(u8::from(radar));
        }
        assert_eq!(counts(&found[key]), (by, each.clone()), "{key}");
        assert!(each[1] > 30.0 && by[0] > 500.0 / 3.0, "{by:?} {each:?}");
        let all: f64 = by.iter().sum();
        assert!((f64s::<4>(&found[key]["share"])[0] - by[0] / all).abs() < 1e-12);
        assert_eq!(found[key]["each"][1]["technology"], "camera");
        assert!((found[key]["each"][1]["share"].number() - each[1] / all).abs() < 1e-12);
    }
    let sensors = json!([{ "technology": "lidar", "count": 1 }, { "technology": "camera", "count": 1 },
        { "technology": "radar", "count": 1 }]);
    assert_eq!(found["sensors"], sensors);
}

#[test]
fn a_wall_hides_the_ground_behind_it_by_similar_triangles() {
    // From 2 m up the top of a wall of 1 m, 5 m ahead, ends the view of the ground up to 10 m; twice as wide there.
    let camera = json!([{ "name": "eye", "technology": "camera", "x": 0, "y": 0, "z": 2, "fov": [90, 90], "range": 50 }]);
    let wall = json!({ "class": "wall", "box": { "min": [5, -2, 0], "max": [5.001, 2, 1] } });
    let free = pad(&camera, &[]);
    let dir = pad(&camera, &[wall]);
    let seen = |dir: &TempDir| {
        let found = technologies(dir.path(), "pad.json rig.json --target car");
        counts(&found["ground_10m"]).1[1]
    };
    let hidden = cells([PAD_BODY[0]; 2])
        .into_iter()
        .filter(|([x, y], _)| *x > 5.0 && *x < 10.0 && y.abs() < 2.0 * x / 5.0 && y.abs() < *x);
    let hidden = hidden.count() as f64;
    assert_eq!(seen(&free) - seen(&dir), hidden);
    assert!(hidden > 400.0, "{hidden}");
}

/// Seven cameras and five radars in all attitudes on the cart of the yard, one radar inside the body.
pub(crate) fn rig() -> Value {
    let mut others = Vec::new();
    for (k, yaw) in [0.0, 0.96, -0.96, 1.92, -1.92, 3.1].into_iter().enumerate() {
        let (x, y) = (1.2 * f64::cos(yaw), 0.5 * f64::sin(yaw));
        others.push(json!({ "name": format!("camera {k}"), "technology": "camera", "x": x, "y": y, "z": 1.75,
            "roll": 0.05 * k as f64, "pitch": 0.1, "yaw": yaw, "fov": [65, 40], "range": 22 }));
    }
    others.push(json!({ "name": "mirror", "technology": "camera", "x": 0.5, "y": 0.95, "z": 1.1, "pitch": 0.9, "yaw": 1.5,
        "fov": [120, 80], "range": 20 }));
    for (k, [x, y, yaw]) in
        [[2.1, 0.0, 0.0], [2.05, 0.95, 1.4], [2.05, -0.95, -1.4], [-2.1, 0.5, 2.9], [1.0, 0.2, 0.0]]
            .into_iter()
            .enumerate()
    {
        others.push(
            json!({ "name": format!("radar {k}"), "technology": "radar", "x": x, "y": y, "z": 0.6,
            "pitch": if k == 1 { 0.25 } else { -0.02 }, "yaw": yaw, "fov": [110, 14], "range": 40 }),
        );
    }
    Value::Array(others)
}

#[test]
fn a_camera_and_a_lidar_that_look_the_same_way_see_the_same() {
    let dir = yard();
    let dir = dir.path();
    let camera = json!([{ "name": "eye", "technology": "camera", "x": 2.1, "y": 0, "z": 1.4, "pitch": 0.1, "yaw": 0.4,
        "fov": [80, 40], "range": 60 }]);
    change(dir, "cart.json", |cart| {
        cart["other_sensors"] = camera;
        cart["sensors"][1]["lidar"] = json!({ "channels": 128, "fov": [-20, 20], "azimuth": [-40, 40],
            "azimuth_steps": 3600, "range": 60 });
    });
    let lidar = json!({ "x": 2.1, "y": 0, "z": 1.4, "pitch": 0.1, "yaw": 0.4, "sensor": "front" });
    write_rig(dir, "same.json", "same", [lidar]);
    let found = technologies(dir, "yard.json same.json --target car");
    // A LiDAR sees ground up to half a metre beside its beams, and voxels by a corner; the camera looks at middles.
    for (key, beside) in [("occupied", 0.1), ("ground_10m", 0.15), ("targets", 0.15)] {
        let seen = if key == "targets" { &found[key][0] } else { &found[key] };
        let (by, each) = counts(seen);
        let (camera, lidar) = (each[1] - by[2], each[0] - by[2]);
        assert!(camera <= 0.01 * by[2] && by[2] > 10.0, "{key}: {by:?} {each:?}");
        assert!(lidar <= beside * by[2], "{key}: {by:?} {each:?}");
    }
}

#[test]
fn scores_and_vehicles_of_lidars_alone_stay_as_they_are() {
    let dir = yard();
    let dir = dir.path();
    let output = |args: &str| stdout(dir, &format!("{args} --backend cpu"));
    let study = "study redundancy yard.json rigs.json --frames 1 --target car";
    let forms = ["", " --format json", " --format csv"].map(|form| format!("{study}{form}"));
    let scores = || ok(dir, "score yard.json rigs.json --backend cpu")["scores"].clone();
    let (before, alone) = (forms.clone().map(|args| output(&args)), scores());
    assert!(before.iter().all(|text| !text.contains("technolog")), "{before:?}");
    change(dir, "cart.json", |cart| cart["other_sensors"] = json!([]));
    assert_eq!(forms.clone().map(|args| output(&args)), before);
    change(dir, "cart.json", |cart| cart["other_sensors"] = rig());
    assert_eq!(scores(), alone);
    let [text, found, csv] = forms.map(|args| output(&args));
    // All that was there stays.
    let lines = before[0].lines().filter(|line| !line.is_empty());
    lines.for_each(|line| assert!(text.contains(line), "{line}\n{text}"));
    let columns = |text: &str| text.lines().next().unwrap().split(',').count();
    assert_eq!((columns(&before[2]), columns(&csv)), (9, 14));
    let mut found: Value = serde_json::from_str(&found).unwrap();
    for row in found["rows"].as_array_mut().unwrap() {
        assert!(row.as_object_mut().unwrap().remove("technologies").is_some());
    }
    assert_eq!(found, serde_json::from_str::<Value>(&before[1]).unwrap());
}

#[test]
fn tables_are_a_hundred_columns_wide_and_scenes_have_a_mean() {
    let dir = yard();
    let dir = dir.path();
    let of = |k: u8| {
        let word = format!("longtechnology{}", char::from(b'a' + k));
        json!({ "name": word, "technology": word, "x": 2.1, "y": 0, "z": 1, "fov": [f64::from(k + 1) * 9.0, 40], "range": 30 })
    };
    change(dir, "cart.json", |cart| cart["other_sensors"] = (0..12).map(of).collect());
    let args =
        "study redundancy yard.json other.json rigs.json --backend cpu --frames 1 --target car";
    let text = stdout(dir, args);
    text.says("% by technologies");
    assert!(text.lines().all(|line| line.chars().count() <= 100), "{text}");
    for k in 0..12 {
        let column = format!("longtechnology{}", char::from(b'a' + k));
        assert_eq!(text.matches(&column).count(), 6, "{column}: {text}");
    }
    let found = ok(dir, args);
    let share = |row: &Value| row["technologies"]["occupied"]["each"][12]["share"].number();
    let mean = 0.5 * (share(&found["rows"][1]) + share(&found["rows"][3]));
    assert!((share(&found["mean"][1]) - mean).abs() < 1e-12 && mean > 0.01);
    assert!(share(&found["rows"][1]) != share(&found["rows"][3]));
    let thing = |row: &Value, k: usize| f64s::<4>(&row["technologies"]["targets"][0]["by"])[k];
    let mean = 0.5 * (thing(&found["rows"][1], 3) + thing(&found["rows"][3], 3));
    assert_eq!(thing(&found["mean"][1], 3), mean);
}

#[test]
fn weather_dims_no_camera_which_is_said() {
    let dir = yard();
    let dir = dir.path();
    change(dir, "cart.json", |cart| cart["other_sensors"] = rig());
    let study = |more: &str| {
        let args = "study redundancy yard.json rigs.json --backend cpu --frames 1";
        let (_, [_, told]) = ran(dir, &(args, more));
        (ok(dir, &(args, more))["rows"][0]["technologies"]["occupied"].clone(), told)
    };
    let (clear, told) = study("");
    assert!(!told.contains("as in clear air"), "{told}");
    let (fog, told) = study("--condition fog:mor=40");
    told.says("other_sensors see as in clear air");
    let (clear, fog) = (counts(&clear).1, counts(&fog).1);
    assert!(clear[0] > fog[0] && clear[1..] == fog[1..], "{clear:?} {fog:?}");
}

#[test]
fn wrong_sensors_are_one_sentence_each() {
    let dir = yard();
    let dir = dir.path();
    let good = json!({ "name": "eye", "technology": "camera", "x": 2.1, "y": 0, "z": 1, "fov": [60, 40], "range": 80 });
    let cart = read_json(dir.join("cart.json"));
    let told = |others: &str| {
        let mut text = cart.to_string();
        text.insert_str(1, &format!("\"other_sensors\": {others}, "));
        fs::write(dir.join("bad.json"), text).unwrap();
        fails(dir, "study redundancy rigs.json --vehicle bad.json --backend cpu --quiet")
    };
    let with = |key: &str, value: &str| {
        let mut sensor = good.clone();
        sensor.as_object_mut().unwrap().remove(key);
        let text = sensor.to_string();
        let value = if value.is_empty() { String::new() } else { format!("\"{key}\": {value}, ") };
        format!("[{good}, {}]", text.replacen('{', &format!("{{{value}"), 1).replace("eye", "b"))
    };
    for (key, value, words) in [
        ("fov", "[0, 40]", "bad.json: other_sensors[1].fov[0]: 0 is not an angle"),
        ("fov", "[361, 40]", "other_sensors[1].fov[0]: 361 is not"),
        ("fov", "[60, 181]", "above 0 and at most 180 degrees"),
        ("fov", "[60]", "other_sensors[1].fov"),
        ("range", "1001", "other_sensors[1].range: 1001 is not"),
        ("range", "0", "a range above 0 and at most 1000 m"),
        ("range", "NaN", "bad.json"),
        ("x", "1e999", "bad.json"),
        ("z", "101", "other_sensors[1].z: 101 is not"),
        ("yaw", "90", "other_sensors[1].yaw: 90 is not"),
        ("technology", "\"lidar\"", "a LiDAR has its model in `sensors`"),
        ("technology", "\"Camera 2\"", "other_sensors[1].technology: \"Camera 2\" is not"),
        ("technology", "\"\"", "a word of 1 to 16 letters"),
        ("name", "\" \"", "other_sensors[1].name"),
        ("name", "\"a\", \"colour\": 1", "colour"),
        ("range", "", "range"),
    ] {
        let told = told(&with(key, value));
        assert!(told.contains(words) && told.lines().count() == 1, "{key} {value}: {told}");
        told.says("bad.json");
    }
    told(&format!("[{good}, {good}]"))
        .says("other_sensors[1].name: `eye` is not")
        .says("used twice");
    let many: Vec<Value> = (0..65).map(|_| good.clone()).collect();
    told(&Value::Array(many).to_string()).says("other_sensors: a list of 65").says("at most 64");
}

#[test]
fn any_word_is_a_technology_and_degrees_are_doubted() {
    let dir = yard();
    let dir = dir.path();
    change(dir, "cart.json", |cart| {
        let sensor = |word: &str, roll: f64| {
            json!({ "name": word, "technology": word, "x": 2.1, "y": 0, "z": 1, "roll": roll, "fov": [60, 40],
                "range": 80 })
        };
        cart["other_sensors"] = json!([sensor("camera", 0.1), sensor("sonar", 5.0)]);
    });
    let done = sightline(dir, "study redundancy rigs.json --vehicle cart.json --backend cpu");
    let [said, told] = [done.stdout, done.stderr].map(|text| String::from_utf8(text).unwrap());
    said.says("1 camera  1 sonar");
    told.says("other_sensors[1].roll is 5 rad; degrees?");
}
