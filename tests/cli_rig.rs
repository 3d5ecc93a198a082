//! Rigs on the command line: out, in again, compared, refused.

use crate::cli::*;

const FORMATS: [&str; 7] =
    ["autoware", "urdf", "sdf", "ros2-launch", "carla", "carla-objects", "json"];

/// A folder with two placements, one of them with sensors.
fn folder() -> TempDir {
    let dir = TempDir::new().unwrap();
    let lidar = |y: f64, roll: f64| json!({ "x": 0.6, "y": y, "z": 2.8, "roll": roll, "pitch": 0.1, "yaw": -0.5 * y });
    let placements = json!({ "placements": [
        { "name": "pair", "lidars": [lidar(0.5, -0.02), lidar(-0.5, -0.02)] },
        { "name": "one", "lidars": [{ "x": 0.0, "y": 0.0, "z": 2.0, "sensor": "VLP-16" }] },
    ]});
    write(&dir, "p.json", &placements);
    dir
}

#[test]
fn a_placement_goes_out_and_comes_in_in_every_format() {
    let dir = folder();
    for format in FORMATS {
        let out = format!("{format}.out");
        let base = "--base-link=-1.4,0,0.25";
        printed(&dir, &format!("rig export p.json:pair --format {format} {base} --out {out}"));
        // Placements of this program are in the ego frame already.
        let base = if format == "json" { "--base-link=0" } else { base };
        let read = stdout(&dir, &format!("rig import {out} {base} --name pair"));
        let read: Value = serde_json::from_str(&read).unwrap();
        assert_eq!(read["placements"][0]["name"], "pair", "{format}");
        for (lidar, y) in read["placements"][0]["lidars"].list().iter().zip([0.5, -0.5]) {
            for (key, wanted) in [("x", 0.6), ("y", y), ("z", 2.8), ("roll", -0.02), ("pitch", 0.1)]
            {
                let found = lidar[key].number();
                assert!((found - wanted).abs() < 1e-8, "{format}: {key} is {found}");
            }
        }
    }
    let names = |folder: &str| {
        let entries = fs::read_dir(dir.path().join(folder)).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    assert_eq!(names("autoware.out"), ["sensor_kit_calibration.yaml", "sensors_calibration.yaml"]);
}

#[test]
fn both_files_of_autoware_on_stdout_are_one_document() {
    let dir = folder();
    let export = "rig export p.json:one --format autoware --frame velodyne_top";
    let [text, notes] = printed(&dir, export);
    assert!(text.contains("z: 1.9623") && notes.contains("--optical-height"), "{text}{notes}");
    fs::write(dir.path().join("both.yaml"), text).unwrap();
    let args = "rig import both.yaml --sensor velodyne_top=VLP-16 --out in.json";
    let [stdout, notes] = printed(&dir, args);
    assert!(stdout.is_empty() && notes.contains("LiDAR 0 is `velodyne_top`, VLP-16"), "{notes}");
    let read = read_json(dir.path().join("in.json"));
    let lidar = &read["placements"][0]["lidars"][0];
    assert_eq!((&lidar["sensor"], &lidar["z"]), (&json!("VLP-16"), &json!(2.0)));
}

#[test]
fn rigs_are_compared_as_text_and_as_json() {
    let dir = folder();
    let args = "rig compare p.json:pair p.json:pair";
    let found = ok(&dir, args);
    assert_eq!(found["lidars"][0]["moved"], 0.0);
    assert_eq!(found["after"][0]["same_roll"], true);
    assert!((found["after"][0]["turned"].number() - 0.04).abs() < 1e-9);
    stdout(&dir, args)
        .says("lidar_0 with lidar_1")
        .says("roll changes its sign")
        .says("\ndifferent in pose or model: 0 of 2 LiDARs\n");
    // Equal pose, another model.
    let read = read_text(&dir, "p.json");
    write(&dir, "q.json", &read.replace("VLP-16", "VLS-128"));
    let args = "rig compare p.json:one q.json:one";
    let found = ok(&dir, args);
    assert_eq!(found["lidars"][0]["models"], json!(["VLP-16", "VLS-128"]));
    assert_eq!((&found["lidars"][0]["moved"], &found["different"]), (&json!(0.0), &json!(1)));
    stdout(&dir, args)
        .says("  ! lidar_0: the model is VLP-16 before and VLS-128 after\ndifferent in pose or model: 1 of 1");
    // A model that is not known is no difference.
    let sensor = "\"sensor\":\"VLP-16\"";
    let unknown = read.replace(&format!("{sensor},"), "").replace(&format!(",{sensor}"), "");
    write(&dir, "u.json", &unknown);
    stdout(&dir, "rig compare p.json:one u.json:one")
        .says("different in pose or model: 0 of 1 LiDAR\n")
        .lacks("the model is");
    // A file in another base frame.
    printed(&dir, "rig export p.json:pair --format urdf --base-link=0.3 --out base.urdf");
    let compare = "rig compare p.json:pair base.urdf";
    stdout(&dir, compare)
        .says("all moved by (-0.3, 0, 0) m: another base frame? give --base-link\n");
    stdout(&dir, &(compare, "--base-link=0.3")).lacks("all moved by");
    let text = stdout(&dir, "rig compare p.json:one p.json:pair");
    let told = "The first rig has 1 LiDAR, the second 2: compared by frame, then by least distance.\n\
                Without a partner in the first rig: lidar_1.\n";
    text.says(" of the 1 with a partner; 1 and 2 LiDARs in all\n");
    assert!(text.starts_with(told), "{text}");
    stdout(&dir, "rig compare p.json:one p.json:pair --format csv")
        .says("\nalone_after,lidar_1,,,,,,,\n");
}

#[test]
fn a_rig_comes_through_standard_input() {
    let dir = folder();
    let list = r#"[{"type": "sensor.lidar.ray_cast", "id": "top", "x": 1, "y": 0, "z": 2}]"#;
    let import = |bytes: &[u8]| piped(dir.path(), "rig import -", bytes);
    for text in [list.to_owned(), format!("\u{feff}{list}")] {
        let output = import(text.as_bytes());
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && text.contains("\"x\": 1.0"), "{output:?}");
    }
    let utf_16: Vec<u8> = list.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let large = [list.as_bytes(), &b" ".repeat(16 << 20)].concat();
    for (bytes, words) in [
        (utf_16, "standard input: is UTF-16 text; save it as UTF-8"),
        (large, "standard input: is larger than the limit of 16777216 bytes"),
    ] {
        let output = import(&bytes);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code() == Some(2) && told.contains(words), "{told}");
    }
    for args in ["import - p.json", "import p.json -", "compare p.json:one -"] {
        fails(&dir, &("rig", args)).says("-: stands for standard input alone");
    }
}

#[test]
fn what_cannot_be_done_is_a_sentence() {
    let dir = folder();
    let several = "pick one of `pair`, `one` as FILE:NAME (in Python name=NAME)";
    fails(&dir, "rig import p.json").says(several);
    stdout(&dir, "rig import p.json:one").says("\"one\"").lacks("\"pair\"");
    for (args, words) in [
        ("p.json --format urdf", several),
        ("p.json:two --format urdf", "called `two`"),
        ("p.json:one --format usd", "carla-objects"),
        ("p.json:pair --format urdf --frame a", "1 names"),
        ("p.json:one --format urdf --sensor top=VLP-16", "there are `lidar_0`"),
        (
            "p.json:one --format urdf --optical-height top=0.1",
            "no frame is called `top`; there are `lidar_0`, `VLP-16`",
        ),
        (
            "p.json:one --format urdf --sensor a=A --sensor a=B",
            "--sensor a: comes twice; give it once",
        ),
        ("p.json:one --format urdf --out p.json", "would be overwritten"),
        ("none.json --format urdf", "none.json"),
    ] {
        fails(&dir, &("rig export", args)).says(words);
    }
    fails(&dir, "rig import p.json --base-link 1,2").says("X,Y,Z");
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    for (name, text, words) in [
        (
            "a.csv",
            "x,y,z\n1,2,3\n",
            "a.csv: is not JSON, it looks like CSV; a placements file begins",
        ),
        (
            "v.json",
            "{ \"mounts\": [] }",
            "v.json: is a vehicle, where a file of placements belongs",
        ),
    ] {
        fs::write(dir.path().join(name), text).unwrap();
        fails(&dir, &format!("rig export {name} --format urdf")).says(words);
    }
}
