//! `rig handover`: its files against closed forms, the placement file and numbers by hand.

use std::io::Read;

use sightline::vehicle::{Lidar, SensorPose, sensor_file};

use crate::cli::*;
use crate::cli_files::all_files;

/// Lower and upper corners of the body's two boxes, metres.
const BOXES: [[[f64; 3]; 2]; 2] =
    [[[-2.0, -0.9, 0.3], [2.0, 0.9, 1.1]], [[-1.5, -0.8, 1.1], [0.5, 0.8, 1.75]]];
/// Elevations, steps and range of the sensor that turns.
const CHANNELS: u32 = 12;
const FOV: [f64; 2] = [-41.3, 11.7];
const STEPS: u32 = 150;
/// Steps and azimuths of the sensor that looks to a side.
const SIDE: (u32, [f64; 2]) = (61, [-60.0, 60.0]);

/// A vehicle of two boxes with two models and two mounts, and three LiDARs on it.
pub(crate) fn folder() -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    let shape = |[low, high]: &[[f64; 3]; 2]| {
        let size = [0, 1, 2].map(|k| high[k] - low[k]);
        let foot = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), low[2]];
        json!({ "class": "vehicle", "box": { "foot": foot, "size": size } })
    };
    let vehicle = json!({
        "sightline": 1, "name": "cart", "body": BOXES.iter().map(shape).collect::<Vec<_>>(),
        "sensors": [
            { "name": "turning", "price": 4000.5,
              "lidar": { "channels": CHANNELS, "fov": FOV, "azimuth_steps": STEPS, "range": 90 } },
            { "name": "side, narrow", "price": 700,
              "lidar": { "channels": 8, "fov": [-30, 10], "azimuth": SIDE.1, "azimuth_steps": SIDE.0, "range": 40 } }
        ],
        "mounts": [
            { "name": "roof", "sensors": ["turning"], "count": [0, 1],
              "min": [-1, -0.5, 1.7], "max": [1, 0.5, 2.4], "roll": [-0.2, 0.2], "pitch": [-0.2, 0.2] },
            { "name": "flank", "sensors": ["side, narrow"], "count": [0, 2],
              "min": [0, -1.2, 0.5], "max": [2, 1.2, 1], "yaw": [-3.2, 3.2] }
        ],
        "require": [{ "name": "far above", "min": [-1, -1, 90], "max": [1, 1, 91], "share": 0.5 }]
    });
    write(&dir, "cart.json", &vehicle);
    let placements = json!({ "placements": [
        { "name": "rig", "lidars": [
            { "x": 0.25, "y": -0.125, "z": 2.1, "roll": 0.05, "pitch": 0.1, "sensor": "turning" },
            { "x": 1.1, "y": 1.0, "z": 0.75, "yaw": 1.5, "sensor": "side, narrow" },
            { "x": 1.1, "y": -1.0, "z": 0.75, "yaw": -1.5, "sensor": "side, narrow" } ] },
        { "name": "other", "lidars": [{ "x": 0, "y": 0, "z": 2, "sensor": "turning" }] } ] });
    write(&dir, "p.json", &placements);
    dir
}

/// The hand-over of the first rig, in `out`.
pub(crate) fn handed_over(dir: &TempDir, more: &str) -> TempDir {
    let out = tempfile::tempdir().unwrap();
    let place = out.path().join("out");
    let place = place.to_str().unwrap();
    ok(dir, &("rig handover p.json:rig --vehicle cart.json --backend cpu", ["--out", place], more));
    out
}

/// Text of a file of a hand-over.
pub(crate) fn read(out: &TempDir, name: &str) -> String {
    fs::read_to_string(out.path().join("out").join(name)).unwrap()
}

/// Rows of a CSV file without quotes that hold commas, but for those of the names here.
fn cells(text: &str) -> Vec<Vec<String>> {
    let line = |line: &str| {
        let line = line.replace("\"side, narrow\"", "side; narrow");
        line.split(',').map(str::to_owned).collect()
    };
    text.lines().map(line).collect()
}

#[test]
fn poses_are_those_of_the_placement_in_both_units_and_materials_add_up() {
    let dir = folder();
    let out = handed_over(&dir, "");
    let rows = cells(&read(&out, "poses.csv"));
    let column = |title: &str| rows[0].iter().position(|cell| cell == title).unwrap();
    let cell = |lidar: usize, title: &str| rows[lidar + 1][column(title)].clone();
    assert_eq!(rows.len(), 4);
    let first = ["lidar", "mount", "model", "x_m", "y_mm", "z_mm", "roll_rad", "pitch_deg"];
    let wanted = ["0", "roof", "turning", "0.25", "-125", "2100", "0.05", "5.729578"];
    assert_eq!(first.map(|title| cell(0, title)), wanted);
    assert_eq!((cell(2, "mount"), cell(2, "model")), ("flank".into(), "side; narrow".into()));
    assert_eq!((cell(2, "yaw_deg"), cell(1, "yaw_rad")), ("-85.943669".into(), "1.5".into()));
    // 4000.5 + 2 · 700.
    let wanted = "model,count,price_each,price\nturning,1,4000.5,4000.5\n\"side, narrow\",2,700,1400\n\
                  total,3,,5400.5\n";
    assert_eq!(read(&out, "materials.csv"), wanted);
    // A sensor that spins freely has no phase, a locked one has.
    assert_eq!((cell(0, "phase_rad"), cell(0, "phase_deg")), (String::new(), String::new()));
    change(&dir, "cart.json", |vehicle| vehicle["sensors"][0]["phase"] = json!(0));
    let locked = cells(&read(&handed_over(&dir, ""), "poses.csv"));
    let phases =
        |lidar: usize| ["phase_rad", "phase_deg"].map(|of| locked[lidar + 1][column(of)].clone());
    assert_eq!([phases(0), phases(1)], [["0", "0"]; 2].map(|both| both.map(String::from)));
    // A sensor within the body sees little else, and is told off.
    change(&dir, "p.json", |rigs| rigs["placements"][0]["lidars"][0]["z"] = json!(1.5));
    let warning = "Warning: self_hit: LiDAR 0 ";
    assert!(read(&handed_over(&dir, ""), "README.txt").contains(warning));
    let readme = read(&out, "README.txt");
    let line = readme.lines().find(|line| line.starts_with("  LiDAR 0: ")).unwrap();
    assert!(
        line.ends_with(" % at its angle 0"),
        "it spins freely, its guard is over other angles: {line}"
    );
    let share = line.split(", ").nth(1).unwrap().split(' ').next().unwrap().parse::<f64>().unwrap();
    assert_eq!(readme.contains(warning), share > 25.0, "{readme}");
    assert!(readme.contains("ISO 8855") && readme.contains("a positive pitch looks down"));
    for (name, _) in all_files(out.path()).iter().map(|(path, _)| (path.file_name().unwrap(), ())) {
        let name = name.to_str().unwrap();
        assert!(name == "README.txt" || readme.contains(&format!("  {name}: ")), "{name}");
    }
}

/// Metres along a ray to where it enters a box from outside.
fn enters(from: [f64; 3], along: [f64; 3], [low, high]: &[[f64; 3]; 2]) -> Option<f64> {
    let (mut near, mut far) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in 0..3 {
        let [a, b] = [low[k], high[k]].map(|side| (side - from[k]) / along[k]);
        (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
    }
    (near <= far && near > 0.0).then_some(near)
}

/// Elevation and azimuth of each beam of a ring and column in degrees.
fn beams(
    elevations: (u32, [f64; 2]),
    columns: u32,
    azimuths: impl Fn(u32) -> f64,
) -> Vec<[f64; 2]> {
    let (rings, [low, high]) = elevations;
    let up = |ring: u32| low + (high - low) * f64::from(ring) / f64::from(rings - 1);
    (0..rings)
        .flat_map(|ring| (0..columns).map(|j| [up(ring), azimuths(j)]).collect::<Vec<_>>())
        .collect()
}

#[test]
fn a_mask_holds_the_beams_whose_way_ends_at_a_box_of_the_body() {
    let dir = folder();
    let out = handed_over(&dir, "");
    let turning = beams((CHANNELS, FOV), STEPS, |j| 360.0 * f64::from(j) / f64::from(STEPS));
    let side = beams((8, [-30.0, 10.0]), SIDE.0, |j| -60.0 + 2.0 * f64::from(j));
    let tilted = SensorPose { roll: 0.05, pitch: 0.1, ..SensorPose::at(0.25, -0.125, 2.1) };
    let left = SensorPose { yaw: 1.5, ..SensorPose::at(1.1, 1.0, 0.75) };
    for (name, pose, beams, columns, least) in
        [("mask-0-roof", tilted, turning, STEPS, 300), ("mask-1-flank", left, side, SIDE.0, 0)]
    {
        let rows = cells(&read(&out, &format!("{name}.csv")));
        assert_eq!(rows[0][..3], ["channel", "elevation_deg", "azimuth_offset_deg"]);
        assert_eq!(rows.len() as u32, 1 + beams.len() as u32 / columns);
        let png = pixels(&out.path().join("out").join(format!("{name}.png")), columns as usize);
        let mut masked = 0;
        for (k, [up, across]) in beams.iter().enumerate() {
            let (ring, column) = (k / columns as usize, k % columns as usize);
            let (row, title) = (&rows[ring + 1], &rows[0][column + 3]);
            assert_eq!(row[0], ring.to_string());
            assert!((row[1].parse::<f64>().unwrap() - up).abs() < 1e-6 && row[2] == "0");
            assert!((title.parse::<f64>().unwrap() - across).abs() < 1e-6, "{title}, not {across}");
            let (up, across) = (up.to_radians(), across.to_radians());
            let along = [up.cos() * across.cos(), up.cos() * across.sin(), up.sin()];
            let along = (pose.ego_from_sensor().rotation * glam::DVec3::from(along)).to_array();
            let from = pose.position().to_array();
            let body = BOXES.iter().filter_map(|box_| enters(from, along, box_));
            let body = body.fold(f64::INFINITY, f64::min);
            let ground = if along[2] < 0.0 { -from[2] / along[2] } else { f64::INFINITY };
            let own = body < ground && body < 40.0;
            assert_eq!(row[column + 3] == "1", own, "{name}, ring {ring}, column {column}");
            assert_eq!(png[k], if own { 255 } else { 0 });
            masked += usize::from(own);
        }
        assert!(masked >= least, "{masked}");
    }
}

/// Pixels of a grey picture of eight bits: rows without filters.
fn pixels(path: &Path, width: usize) -> Vec<u8> {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x89PNG\r\n\x1a\n");
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[12..16], number(16), &bytes[24..26]), (&b"IHDR"[..], width, &[8, 0][..]));
    assert_eq!(&bytes[37..41], b"IDAT");
    let mut raw = Vec::new();
    let packed = &bytes[41..41 + number(33)];
    flate2::read::ZlibDecoder::new(packed).read_to_end(&mut raw).unwrap();
    assert_eq!(raw.len(), number(20) * (width + 1));
    raw.chunks(width + 1).flat_map(|row| row[1..].to_vec()).collect()
}

#[test]
fn crop_boxes_are_those_of_the_body_with_its_margin_from_base_link() {
    let dir = folder();
    let out = handed_over(&dir, "--margin 0.1 --base-link=-1.25,0,0.2");
    let text = read(&out, "crop_boxes.yaml");
    let nodes: Vec<&str> = text.split("/**/").skip(1).collect();
    let number = |node: &str, key: &str| -> f64 {
        let line = node.lines().find(|line| line.trim().starts_with(key)).unwrap();
        let value = line.split(": ").nth(1).unwrap();
        assert!(value.contains('.'), "{line}: ROS wants a point in it");
        value.parse().unwrap()
    };
    let all = [[-2.0, -0.9, 0.3], [2.0, 0.9, 1.75]];
    let names = ["crop_box_filter_self:", "crop_box_filter_self_0:", "crop_box_filter_self_1:"];
    assert_eq!(nodes.len(), 3);
    for ((node, name), [low, high]) in nodes.iter().zip(names).zip([all, BOXES[0], BOXES[1]]) {
        assert!(node.starts_with(name) && node.contains("    negative: true\n"), "{node}");
        for frame in ["input_pointcloud_frame", "input_frame", "output_frame"] {
            assert!(node.contains(&format!("    {frame}: base_link\n")));
        }
        for (k, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let base = [-1.25, 0.0, 0.2][k];
            for (side, wanted) in [("min", low[k] - 0.1 - base), ("max", high[k] + 0.1 - base)] {
                let found = number(node, &format!("{side}_{axis}"));
                // Outwards, to a centimetre at most.
                let out = if side == "min" { wanted - found } else { found - wanted };
                assert!(
                    (-2e-5..1e-2).contains(&out),
                    "{name} {side}_{axis}: {found}, not {wanted}"
                );
            }
        }
    }
}

#[test]
fn notes_on_sensor_files_are_in_the_readme_until_the_vehicle_answers_them() {
    let dir = folder();
    let sensor = json!({ "elevation_deg": [-20, -10, 0], "azimuth_offset_deg": [1, 0, -1], "azimuth_steps": 120,
                         "range": 50, "azimuth_sign": "as the vendor counts" });
    write(&dir, "s.json", &sensor);
    let path = dir.path().join("cart.json");
    let text = fs::read_to_string(&path).unwrap();
    let readme = |lidar: Value| {
        let mut vehicle: Value = serde_json::from_str(&text).unwrap();
        vehicle["sensors"][0]["lidar"] = lidar;
        fs::write(&path, vehicle.to_string()).unwrap();
        read(&handed_over(&dir, ""), "README.txt")
    };
    let told = readme(json!({ "file": "s.json", "range": 50 }));
    let line = told.lines().find(|line| line.starts_with("Note: ")).unwrap_or_default();
    assert!(line.contains("s.json: azimuth_sign: \"as the vendor counts\"; offsets"), "{told}");
    let told = readme(json!({ "file": "s.json", "range": 50, "azimuth_offsets": "clockwise" }));
    assert!(!told.contains("azimuth_sign"), "{told}");
}

#[test]
fn places_are_told_from_base_link_where_it_is_given() {
    let dir = folder();
    let rows = |more: &str| cells(&read(&handed_over(&dir, more), "poses.csv"));
    let (plain, based) = (rows(""), rows("--base-link=-1.25,0,0.5"));
    let first = plain[0].len();
    assert_eq!(based[0][first..], ["base_link_x_m", "base_link_y_m", "base_link_z_m"]);
    assert_eq!(based[1][first..], ["1.5", "-0.125", "1.6"]);
    assert!(plain.iter().zip(&based).all(|(few, all)| all[..first] == few[..]));
}

#[test]
fn profiles_for_isaac_have_the_beams_of_the_models() {
    let dir = folder();
    let out = handed_over(&dir, "");
    let read = |name: &str| {
        let file = out.path().join("out").join(name);
        let steps = sensor_file::read(&file, None).unwrap().azimuth_steps.unwrap();
        Lidar::from_sensor_file(&file, steps, 90.0).unwrap().table().unwrap()
    };
    for (name, beams) in [
        ("turning.isaac.json", beams((CHANNELS, FOV), STEPS, |j| 2.4 * f64::from(j))),
        (
            "side__narrow.isaac.json",
            beams((8, [-30.0, 10.0]), SIDE.0, |j| -60.0 + 2.0 * f64::from(j)),
        ),
    ] {
        let found = read(name);
        assert_eq!(found.directions().len(), beams.len(), "{name}");
        for (direction, [up, across]) in found.directions().iter().zip(beams) {
            let (up, across) = (up.to_radians(), across.to_radians());
            let wanted = [up.cos() * across.cos(), up.cos() * across.sin(), up.sin()];
            for (a, b) in direction.iter().zip(wanted) {
                assert!((f64::from(*a) - b).abs() < 3e-7, "{name}: {direction:?}, not {wanted:?}");
            }
        }
    }
}

#[test]
fn a_rig_that_spins_freely_has_the_blind_zone_of_the_study_and_the_share_of_score() {
    let dir = folder();
    change(&dir, "cart.json", |cart| drop(cart.as_object_mut().unwrap().remove("require")));
    let more = "--vehicle cart.json --backend cpu";
    let near = ok(&dir, &("study nearfield p.json", more));
    for near in near["near_fields"].list() {
        let rig = format!("p.json:{}", near["name"].text());
        let made = ok(&dir, &(format!("rig handover {rig} --out h --force"), more));
        let svg = read_text(&dir, "h/drawing.svg");
        let number = |of: &Value| of.number();
        // With its angle at 0 the second rig has 72.2 m² in place of 73.2.
        let area =
            format!("open where it goes on; {:.1} m² to 10 m", number(&near["zone"]["area"]));
        assert!(svg.contains(&area), "{area}");
        for side in ["ahead", "left", "right"] {
            // Lanes end at eighths of a metre; tenths are rounded up.
            let depth = (10.0 * number(&near["zone"][side])).ceil() / 10.0;
            let depth = format!(">{side}: blind to {depth:.1} m");
            assert!(svg.contains(&depth), "{depth}");
        }
        // One rounding, upwards: 34.61 % is told as 34.7 by guard and study.
        let share =
            format!("{:.1} %", (1e3 * number(&near["beams"][0]["own"]) - 1e-9).ceil() / 10.0);
        let guard =
            format!("self_hit: LiDAR 0 (roof) ends {share} of its beams at the own vehicle");
        assert!(made["guards"][0].text().starts_with(&guard), "{made}: {guard}");
        assert!(svg.contains("Warning: self_hit: LiDAR 0 (roof)"), "the drawing says so, too");
    }
    let text = stdout(&dir, &("study nearfield p.json", more));
    let row = text.lines().filter(|line| line.starts_with("rig ")).nth(1).unwrap();
    assert!(row.ends_with(" 34.7 0 0"), "{text}");
}

#[test]
fn a_scene_with_a_lidar_and_a_mount_needs_no_vehicle() {
    let dir = crate::cli_files::world();
    let out = dir.path().join("out");
    ok(&dir, "rig handover town.json p.json --frame 1 --backend cpu --out out");
    read_text(&out, "poses.csv").says("\n0,,lidar,0,0,2,0,0,2000,");
    assert!(out.join("mask-1.png").is_file() && out.join("lidar.isaac.json").is_file());
}

#[test]
fn refusals_leave_nothing_behind() {
    let dir = folder();
    fs::create_dir(dir.path().join("full")).unwrap();
    write(&dir, "full/note", "mine");
    let text = read_text(&dir, "p.json");
    write(&dir, "odd.json", &text.replace("\"turning\"", "\"odd\""));
    let before = all_files(dir.path());
    // A rule about a model that there is not says nothing.
    let line = "rig handover odd.json:rig --vehicle cart.json --backend cpu --out o";
    let told = fails(&dir, &line);
    assert!(told.contains("there is no sensor `odd`") && !told.contains("RULE BROKEN"), "{told}");
    for (line, words) in [
        ("p.json --vehicle cart.json --out o", "holds 2 placements, and one is handed over"),
        ("p.json:none --vehicle cart.json --out o", "has no placement `none`"),
        ("p.json:rig --out o", "neither a scene nor a vehicle"),
        ("p.json:rig --vehicle cart.json --frame 1 --out o", "there is no frame 1"),
        ("p.json:rig --vehicle cart.json --margin -1 --out o", "give metres from 0 to 10"),
        ("p.json:rig --vehicle cart.json --out full", "is not empty"),
        ("p.json:rig --vehicle cart.json --out p.json", "a file where a folder is wanted"),
        (
            "p.json:rig --vehicle cart.json --out cart.json --force",
            "a file where a folder is wanted",
        ),
        ("p.json:rig --vehicle cart.json --out . --force", "which this command reads"),
        ("a.json b.json p.json:rig --out o", "is a second scene"),
    ] {
        let line = format!("rig handover {line} --backend cpu");
        fails(&dir, &line).says(words);
        assert!(!dir.path().join("o").exists() && all_files(dir.path()) == before, "{line}");
    }
    ok(&dir, "rig handover p.json:rig --vehicle cart.json --backend cpu --out full --force");
    assert_eq!(read_text(&dir, "full/note"), "mine");
    assert!(dir.path().join("full/poses.csv").is_file());
}

#[test]
fn a_smaller_rig_leaves_no_mask_of_a_larger_one() {
    let dir = folder();
    let line = "rig handover p.json:rig --vehicle cart.json --backend cpu --out out --force";
    ok(&dir, line);
    let masks = || {
        let names = fs::read_dir(dir.path().join("out")).unwrap();
        let names = names.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut masks: Vec<String> = names.filter(|name| name.starts_with("mask-")).collect();
        masks.sort();
        masks
    };
    let three = masks();
    assert_eq!(three.len(), 6, "{three:?}");
    // Names that the command does not give are the user's own.
    for own in ["mask-2-notes.txt", "mask-old.csv"] {
        fs::write(dir.path().join("out").join(own), "mine").unwrap();
    }
    change(&dir, "p.json", |rigs| {
        rigs["placements"][0]["lidars"].as_array_mut().unwrap().truncate(1);
    });
    ok(&dir, line);
    let mut left: Vec<&str> =
        three.iter().map(String::as_str).filter(|name| name.starts_with("mask-0")).collect();
    left.extend(["mask-2-notes.txt", "mask-old.csv"]);
    assert_eq!(masks(), left);
}

/// Place on the sheet of a text of the drawing, by the words that it begins with: x in millimetres, and the element.
fn text_at<'a>(svg: &'a str, words: &str) -> (f64, &'a str) {
    let at = svg.find(&format!(">{words}")).unwrap_or_else(|| panic!("no {words}"));
    let element = &svg[svg[..at].rfind("<text").unwrap()..at];
    let (_, rest) = element.split_once("x=\"").unwrap();
    (rest.split_once('"').unwrap().0.parse().unwrap(), element)
}

#[test]
fn the_name_of_the_blind_zone_ahead_ends_before_the_legend() {
    let dir = TempDir::new().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = |file: &str| root.join(file).to_str().unwrap().to_owned();
    let drawn = |placement: &str, vehicle: &str, out: &str| {
        let (placement, vehicle) = (path(placement), path(vehicle));
        let of = ["rig", "handover", &placement, "--vehicle", &vehicle, "--backend", "cpu"];
        ok(&dir, &[&of[..], &["--out", out]].concat());
        read_text(&dir, format!("{out}/drawing.svg"))
    };
    let svg = drawn("tests/data/van-blind.json", "benches/searches/van.json", "h");
    let (end, element) = text_at(&svg, "ahead: blind to");
    element.says("text-anchor=\"end\"");
    let (legend, _) = text_at(&svg, "van: optimized");
    assert!(legend - end > 4.9, "{end} mm, legend at {legend} mm");
    // The blind zone goes on behind it, where it is drawn to 5 m: no line closes it there.
    let end = "L14 58.065L14 61.398";
    let paths: Vec<&str> =
        svg.split("<path ").filter(|path| path.contains("#d1495b") && path.contains(end)).collect();
    assert_eq!(paths.len(), 1, "{paths:?}");
    assert!(!paths[0].split('>').next().unwrap().contains(" stroke="), "{}", paths[0]);
    // The box around the body is a hole in it: 6 m × 2 m at 1:75.
    let (_, hole) = paths[0].split_once("ZM").unwrap();
    let hole: Vec<f64> =
        hole.split(['L', ' ', 'Z']).map_while(|number| number.parse().ok()).collect();
    let sides = [hole[2] - hole[0], hole[1] - hole[5]];
    assert!((sides[0] - 80.0).abs() < 0.01 && (sides[1] - 80.0 / 3.0).abs() < 0.01, "{hole:?}");
    let edge = svg
        .split("<path ")
        .any(|path| path.contains("14 61.398") && path.contains("stroke=\"#d1495b\""));
    assert!(edge, "its sides have a line");
    // The drawing beside the guide, whatever the version that drew it.
    let unversioned = |svg: &str| {
        let (before, after) = svg.split_once("drawn by sightline ").unwrap();
        before.to_owned() + after.split_once('<').unwrap().1
    };
    let svg = drawn("docs/van/found.json", "scenes/vehicles/van.json", "guide");
    let committed = read_text(root, "docs/van/drawing.svg");
    assert_eq!(unversioned(&svg), unversioned(&committed));
}

/// All texts of a drawing, once none lies over another. A letter is `wide` sizes wide on average (Helvetica: at least 0.42),
/// and a text reaches `above` and `below` its line.
pub(crate) fn texts_apart(svg: &str, wide: f64, [above, below]: [f64; 2]) -> Vec<String> {
    let boxes = svg.split("<text").skip(1).map(|text| {
        let (element, rest) = text.split_once('>').unwrap();
        let words = rest.split_once('<').unwrap().0.to_owned();
        let [x, y, size] = [" x", " y", " font-size"].map(|key| -> f64 {
            let (_, value) = element.split_once(&format!("{key}=\"")).unwrap();
            value.split_once('"').unwrap().0.parse().unwrap()
        });
        let width = wide * size * words.chars().count() as f64;
        let left = match element {
            _ if element.contains("\"end\"") => x - width,
            _ if element.contains("\"middle\"") => x - 0.5 * width,
            _ => x,
        };
        (words, [left, y - above * size, left + width, y + below * size])
    });
    let boxes: Vec<(String, [f64; 4])> = boxes.collect();
    for (k, (words, a)) in boxes.iter().enumerate() {
        for (other, b) in &boxes[..k] {
            let is_apart = (0..2).any(|k| a[k + 2] <= b[k] || b[k + 2] <= a[k]);
            assert!(is_apart, "`{words}` lies over `{other}`: {a:?} {b:?}");
        }
    }
    boxes.into_iter().map(|(words, _)| words).collect()
}

#[test]
fn no_words_of_the_view_from_above_lie_over_others() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let svg = read_text(root, "docs/van/drawing.svg");
    let all = texts_apart(&svg, 0.42, [0.6, 0.0]);
    let named = |words: &&String| ["roof", "side-", "front"].iter().any(|of| words.starts_with(of));
    assert!(all.iter().filter(named).count() > 7, "{all:?}");
}
