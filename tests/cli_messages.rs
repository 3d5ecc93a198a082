//! Slips of newcomers: each message names the file, the place in it and the mend.

use crate::cli::*;

/// A car with one mount on its roof.
fn car() -> Value {
    json!({ "sightline": 1, "name": "car",
        "body": [{ "class": "vehicle", "box": { "min": [-1, -0.9, 0.3], "max": [3.5, 0.9, 1.6] } }],
        "sensors": [{ "name": "spin", "price": 2, "phase": 0,
            "lidar": { "channels": 8, "fov": [-25, 15], "azimuth_steps": 60, "range": 30 } }],
        "mounts": [{ "name": "roof", "min": [0, -0.6, 1.9], "max": [1.5, 0.6, 2.2], "count": [1, 2] }] })
}

/// A folder with `s.json`, a scene of level ground and a box, `car.json` and placements.
fn folder() -> TempDir {
    let dir = TempDir::new().unwrap();
    let scene = json!({ "sightline": 1, "name": "s", "vehicle": "car.json", "frames": 2,
        "roi": { "min": [-14, -14, -0.4], "max": [14, 14, 2.8], "voxel": [0.4, 0.4, 0.4] },
        "static": [{ "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } }],
        "actors": [{ "name": "walker",
            "parts": [{ "class": "pedestrian", "box": { "foot": [0, 0, 0], "size": [0.5, 0.6, 1.8] } }],
            "poses": [{ "x": 6, "y": 2 }, { "x": -4, "y": 3 }] }] });
    let rigs = json!({ "$schema": "a, \"b\"", "sightline": 1, "placements": [
        { "name": "A", "lidars": [{ "x": 0.5, "y": 0, "z": 2 }] },
        { "name": "B", "lidars": [{ "x": 0.5, "y": 0.4, "z": 2 }, { "x": 0.5, "y": -0.4, "z": 2 }] }] });
    write(&dir, "s.json", &scene);
    write(&dir, "car.json", &car().to_string());
    write(&dir, "rigs.json", &rigs);
    dir
}

/// Message of the program on the scene of a car that is changed.
fn of_car(dir: &TempDir, change: impl Fn(&mut Value)) -> String {
    let mut car = car();
    change(&mut car);
    write(dir, "own.json", &car.to_string());
    let args = "score s.json rigs.json:A --vehicle own.json --backend cpu";
    String::from_utf8(sightline(dir, args).stderr).unwrap()
}

#[test]
fn files_of_other_kinds_are_named() {
    let dir = folder();
    for (name, text, looks) in [
        ("a.csv", "x,y,z\n1,2,3\n", "is not JSON, it looks like CSV"),
        ("a.yaml", "sightline: 1\nname: x\n", "is not JSON, it looks like YAML"),
        ("a.ply", "ply\nformat ascii 1.0\n", "is not JSON, it looks like a PLY mesh"),
        ("a.zip", "PK\u{3}\u{4}....", "is not JSON, it looks like a ZIP archive"),
        ("a.pcd", "# .PCD v0.7\nVERSION 0.7\n", "is not JSON, it looks like a PCD point cloud"),
        ("a.obj", "# car\no body\nv 0 0 0\n", "is not JSON, it looks like an OBJ mesh"),
    ] {
        write(&dir, name, text);
        for (args, begins) in [
            (["score", "s.json", "rigs.json", "--vehicle", name], "a vehicle file begins with {"),
            (["score", name, "rigs.json", "--backend", "cpu"], "a scene file begins with {"),
            (["score", "s.json", name, "--backend", "cpu"], "a file of placements begins with {"),
        ] {
            let told = fails(&dir, &args);
            let begins = format!("{name}: {looks}; {begins}");
            assert!(told.contains(&begins), "{begins}: {told}");
            let imports = told.contains("; `sightline rig import` reads rigs of other programs");
            let is_rig = args[2] == name && ["a.csv", "a.yaml"].contains(&name);
            assert_eq!(imports, is_rig, "{told}");
        }
    }
    fs::create_dir(dir.path().join("runs")).unwrap();
    fails(&dir, "optimize s.json --inject runs")
        .says("runs: is a directory; give a file of placements");
    // Binary ones are known by name.
    fs::write(dir.path().join("b.stl"), [0xff; 90]).unwrap();
    fails(&dir, "score s.json b.stl --backend cpu")
        .says("b.stl: is not JSON, it looks like an STL mesh; a file of");
    fails(&dir, "score b.stl rigs.json --backend cpu")
        .says("b.stl: is no text, it looks like an STL mesh; give a text");
    let result = json!({ "sightline": "0.1.0", "scene": "s", "settings": {}, "stopped": "time: over", "mounts": ["a"] });
    write(&dir, "result.json", &result);
    let words =
        "result.json: is the result of a run; give the folder of the run, or its placements.json";
    for command in ["score", "verify"] {
        fails(&dir, &[command, "s.json", "result.json"]).says(words);
    }
    for (comment, line) in [("// mine\n", 1), ("\n/* mine */", 2), ("# mine\n# and yours\n", 1)] {
        for (file, args) in [
            ("s.json", "score c.json rigs.json"),
            ("rigs.json", "score s.json c.json"),
            ("car.json", "score s.json rigs.json --vehicle c.json"),
            ("car.json", "study targets rigs.json --vehicle car.json --target c.json"),
            ("car.json", "sensor info c.json"),
            ("rigs.json", "rig export c.json --format urdf"),
            ("rigs.json", "rig import c.json"),
        ] {
            let text = read_text(&dir, file);
            write(&dir, "c.json", &format!("{comment}{text}"));
            let told = fails(&dir, args);
            let words = format!("c.json: line {line} is a comment, and JSON has no comments");
            assert!(told.contains(&words), "{args}: {told}");
        }
    }
    write(&dir, "a.json", "{ // mine\n \"sightline\": 1 }");
    fails(&dir, "score s.json rigs.json --vehicle a.json")
        .says("a comment stands here, and JSON has none; remove it (line 1, column 3)");
}

#[test]
fn results_and_meshes_are_named_wherever_they_are_given() {
    let dir = folder();
    let result = json!({ "sightline": "0.1.0", "scene": "s", "settings": {}, "stopped": "time: over", "mounts": ["a"] });
    write(&dir, "result.json", &result);
    write(&dir, "m.gltf", "{\n  \"asset\": { \"version\": \"2.0\" },\n  \"nodes\": []\n}");
    fails(&dir, "score s.json m.gltf")
        .says("m.gltf: is a glTF mesh; name it as `file` of a `mesh`");
    for (args, wanted) in [
        ("score FILE rigs.json", "a scene"),
        ("score s.json rigs.json --vehicle FILE", "a vehicle"),
        ("study targets rigs.json --vehicle car.json --target FILE", "a target"),
        ("rig export FILE --format urdf", "a file of placements"),
        ("rig import FILE", "a rig of another program"),
    ] {
        for (file, is, mend) in [
            ("result.json", "the result of a run", "give the folder of the run"),
            ("m.gltf", "a glTF mesh", "name it as `file` of a `mesh`"),
        ] {
            let args = args.replace("FILE", file);
            let told = fails(&dir, &args);
            let words = format!("{file}: is {is}, where {wanted} belongs; {mend}");
            assert!(told.contains(&words), "{args}: {told}");
        }
    }
    fs::create_dir(dir.path().join("runs")).unwrap();
    fails(&dir, "rig export runs --format urdf")
        .says("runs: is a directory; give a file of placements");
}

#[test]
fn millimetres_are_told_with_the_file_and_the_mount() {
    let dir = folder();
    of_car(&dir, |car| {
        car["mounts"][0]["min"] = json!([0, -600, 1900]);
        car["mounts"][0]["max"] = json!([4800, 600, 2200]);
    })
    .says("own.json: mounts[0]: the mount runs from")
    .says("is it in millimetres? lengths are in metres, 4800 mm are 4.8");
    of_car(&dir, |car| {
        car["mounts"][0]["min"] = json!([0, -0.6, 0.9]);
        car["mounts"][0]["max"] = json!([1.5, 0.6, 1.2]);
    })
    .says("own.json: mounts[0]: the whole mount lies inside the ego body");
    // A doubt of `score`, whose placements may stand elsewhere, and an error of a search.
    let args = "optimize s.json --vehicle own.json --backend cpu --evaluations 40 --out run";
    let refused = fails(&dir, args);
    assert_eq!(refused.matches("the whole mount lies inside the ego body").count(), 1, "{refused}");
    assert!(!dir.path().join("run").exists());
    of_car(&dir, |car| {
        car["body"][0]["box"] = json!({ "min": [-1000, -900, 300], "max": [3500, 900, 1600] });
    })
    .says("own.json: the ego body is 4500.0 m large")
    .says("divide the numbers of its shapes by 1000");
}

#[test]
fn a_mesh_of_a_wrong_scale_ends_in_one_error_with_the_right_one() {
    let dir = folder();
    // A wedge of 4.5 m in millimetres, in plan the whole of its box.
    let corners = [[-1000, -900], [3500, -900], [3500, 900], [-1000, 900]];
    let vertex = |[x, y]: [i32; 2]| format!("vertex {x} {y} 300\n");
    let face = |k: [usize; 3]| {
        let vertices: String = k.iter().map(|&k| vertex(corners[k])).collect();
        format!("facet normal 0 0 1\nouter loop\n{vertices}endloop\nendfacet\n")
    };
    write(&dir, "body.stl", &format!("solid\n{}{}endsolid\n", face([0, 1, 2]), face([0, 2, 3])));
    let of_scale = |within: f64| {
        of_car(&dir, |car| {
            car["body"] =
                json!([{ "class": "vehicle", "mesh": { "file": "body.stl", "scale": 0.01 } }]);
            car["require"] =
                json!([{ "target": "adult", "within": within, "bearing": [-10, 10], "share": 1 }]);
        })
    };
    let told = of_scale(8.0);
    let large = "own.json: the ego body is 45.0 m large with the `scale` of 0.01 that its mesh has; lengths are in metres: \
                 `\"scale\": 0.001` would make it 4.50 m";
    told.says(large).says("every place of `adult from 5 to 8 m, -10° to 10°`");
    assert_eq!(told.matches("own.json").count(), 1, "{told}");
    // A rule with a place beside the body leaves it a note.
    let told = of_scale(60.0);
    assert!(told.contains(large) && !told.contains("every place"), "{told}");
}

#[test]
fn score_tells_mounts_that_look_into_the_body() {
    let dir = folder();
    of_car(&dir, |car| {
        car["mounts"][0]["yaw"] = json!([3.0, 3.2]);
        car["sensors"][0]["lidar"]["azimuth"] = json!([-40, 40]);
        car["body"][0]["box"] = json!({ "min": [-4, -1.5, 0.3], "max": [-0.8, 1.5, 3.5] });
    })
    .says("in the middle of its range")
    .says("at the own body");
}

#[test]
fn doubts_about_a_vehicle_are_told_once() {
    let dir = folder();
    assert!(!of_car(&dir, |_| {}).contains("own.json"));
    let count = of_car(&dir, |car| car["mounts"][0]["count"] = json!([3, 1]));
    count.says(
        "mounts[0].count: [3, 1] is not [least, most]: the least is above the most; write [1, 3]",
    );
    let narrow = of_car(&dir, |car| car["sensors"][0]["lidar"]["fov"] = json!([-0.43, 0.26]));
    assert_eq!(narrow.matches("radians?").count(), 1, "{narrow}");
    narrow.says("0.690 rad are 39.5°");
    let far = of_car(&dir, |car| {
        car["require"] = json!([{ "target": "child", "within": 10, "share": 0.1 }, { "target": "car", "within": 31, "share": 0.1 }]);
    });
    let beyond = "require[1].within: 31 m is farther than any sensor of the vehicle reaches, 30 m";
    assert!(far.contains(beyond) && !far.contains("require[0]"), "{far}");
    of_car(&dir, |car| drop(car.as_object_mut().unwrap().remove("body")))
        .says("own.json: has no `body`: beams pass through the vehicle");
    of_car(&dir, |car| car["min_distance"] = json!(300))
        .says("min_distance: 300 m is more than any two places")
        .says("300 mm are 0.3 m");
    change(&dir, "s.json", |scene| scene["ego"]["body"] = car()["body"].clone());
    of_car(&dir, |car| drop(car.as_object_mut().unwrap().remove("body")))
        .says("own.json: has no `body`: the ego body of s.json stands for it");
    assert!(!of_car(&dir, |_| {}).contains("own.json"));
}

#[test]
fn a_rule_beyond_a_stated_rated_range_says_what_its_beams_leave_out() {
    let dir = folder();
    let told = |rated: Option<f64>, response: bool| {
        of_car(&dir, |car| {
            if let Some(rated) = rated {
                car["sensors"][0]["response"] = json!({ "rated_range": rated });
            }
            car["require"] = json!([{ "target": "child", "within": 8, "share": 0.1, "response": response },
                                    { "target": "tyre", "within": 8, "share": 0.1, "response": response }]);
        })
    };
    // A child reflects 10 %, for which ranges are rated; of a tyre's 2 % enough light comes back to 8 · √0.2 = 3.6 m.
    let words = "require[1]: beams on tyre count to 8 m whether enough light comes back or not; it reflects 2 %, \
                 which is seen half of the time by spin to 4 m (`rated_range`); `\"response\": true` counts";
    let at_eight = told(Some(8.0), false);
    assert!(at_eight.contains(words) && !at_eight.contains("require[0]"), "{at_eight}");
    told(Some(7.0), false).says("require[0]: beams on child").says("by spin to 7 m");
    for silent in [told(None, false), told(Some(7.0), true)] {
        assert!(!silent.contains("rated_range"), "{silent}");
    }
}

#[test]
fn one_placement_of_a_file_is_read_alike_by_every_command() {
    let dir = folder();
    let names = |args: &str| -> Vec<String> {
        let scores = ok(&dir, args)["scores"].list().clone();
        scores.iter().map(|one| one["name"].text().to_owned()).collect()
    };
    assert_eq!(names("score s.json rigs.json"), ["A", "B"]);
    assert_eq!(names("score s.json rigs.json:B"), ["B"]);
    // LiDARs that name no model are of the only one.
    stdout(&dir, "score s.json rigs.json:B --backend cpu")
        .says(", 480 beams a LiDAR")
        .says("\nB: price 4; distances");
    for args in [
        "score s.json rigs.json:C --backend cpu",
        "study tolerance s.json rigs.json:C --frames=1",
        "audit s.json rigs.json:C --backend cpu",
    ] {
        fails(&dir, args).says("rigs.json: has no placement `C`; it has A, B");
    }
    fails(&dir, "score s.json none.json:A").says("none.json: cannot be read");
}

#[test]
fn placements_may_state_the_version_of_other_files() {
    let dir = folder();
    printed(&dir, "rig compare rigs.json:A rigs.json:A");
    let rigs = read_text(&dir, "rigs.json");
    for (from, to, told) in [
        (
            "\"sightline\":1",
            "\"sightline\":2",
            "version 2 is unknown; this program reads version 1",
        ),
        ("\"sightline\"", "\"sihgtline\"", "unknown key `sihgtline`; did you mean `sightline`?"),
        (
            "\"sightline\"",
            "\"q\"",
            "unknown key `q`; known are `$schema`, `sightline`, `placements`",
        ),
    ] {
        write(&dir, "other.json", &rigs.replace(from, to));
        for args in [["score", "s.json", "other.json"], ["rig", "compare", "other.json:A"]] {
            let mut args = args.to_vec();
            if args[0] == "rig" {
                args.push("rigs.json:A");
            }
            let said = fails(&dir, &args);
            assert!(said.contains(told) && !said.contains("placement `A`"), "{args:?}: {said}");
        }
    }
}

#[test]
fn mirrored_pairs_may_face_back() {
    let dir = folder();
    let back = |yaw: Value, x: f64| {
        move |car: &mut Value| {
            car["symmetric"] = json!(true);
            car["mounts"] = json!([{ "name": "rear", "min": [x, -0.6, 1.9], "max": [-0.5, 0.6, 2.2],
                "yaw": yaw, "count": 2 }]);
            car["sensors"][0]["lidar"]["azimuth"] = json!([-60, 60]);
        }
    };
    of_car(&dir, back(json!([2.6, 3.9]), -1.0))
        .says("yaw of a mount that faces back from 3.1416 - a to 3.1416 + a");
    of_car(&dir, back(json!([2.6, 3.7]), -1.0))
        .says("mounts[0].yaw: 2.6 to 3.7; mirrored pairs stand from 2.6000 to 3.6832");
    // A fixed half turn is written with a few digits.
    for (yaw, note) in [("3.14159", false), ("3.14", true), ("-3.1416", false)] {
        let yaw: f64 = yaw.parse().unwrap();
        let told = of_car(&dir, back(json!([yaw, yaw]), -1.0));
        assert!(!told.contains("no mirror image"), "{yaw}: {told}");
        assert_eq!(told.contains("mirrored pairs stand from"), note, "{yaw}: {told}");
    }
    assert!(of_car(&dir, back(json!([3.2, 3.2]), -1.0)).contains("no mirror image"));
    of_car(&dir, back(json!([2.6, 3.7]), -1.0));
    let found = ok(&dir, "optimize s.json --vehicle own.json --backend cpu --evaluations 20");
    let lidars = found["best"]["placement"]["lidars"].list().clone();
    let of = |lidar: usize, key: &str| lidars[lidar][key].number();
    assert!((of(0, "y") + of(1, "y")).abs() < 1e-6, "{lidars:?}");
    let turn = (of(0, "yaw") + of(1, "yaw")).rem_euclid(std::f64::consts::TAU);
    assert!(turn.min(std::f64::consts::TAU - turn) < 1e-6, "{lidars:?}");
    for k in 0..2 {
        let yaw = of(k, "yaw").rem_euclid(std::f64::consts::TAU);
        assert!((2.6 - 1e-6..=3.7).contains(&yaw), "{lidars:?}");
        assert!((-1.0 - 1e-6..=-0.5 + 1e-6).contains(&of(k, "x")), "{lidars:?}");
    }
}

#[test]
fn two_rigs_are_told_apart_by_requirements_first() {
    let dir = folder();
    let mut car = car();
    car["sensors"].as_array_mut().unwrap().push(json!({ "name": "idle", "price": 9,
        "lidar": { "channels": 4, "fov": [-25, 15], "azimuth_steps": 90, "range": 30 } }));
    car["require"] = json!([{ "ground": 5, "share": 0.0 }, { "target": "car", "from": 5, "within": 10, "share": 0.6 }]);
    write(&dir, "car.json", &car);
    // Looking up meets no car: the rig behind it is better though it gains less at the same place.
    let rigs = json!({ "placements": [
        { "name": "up", "lidars": [{ "x": 0.5, "y": 0, "z": 2, "pitch": -0.7, "sensor": "spin" }] },
        { "name": "level", "lidars": [{ "x": 0.5, "y": 0, "z": 2, "sensor": "spin" },
                                      { "x": 0.5, "y": 0.4, "z": 2, "sensor": "spin" }] }] });
    write(&dir, "rigs.json", &rigs);
    let text = stdout(&dir, "score s.json rigs.json --backend cpu");
    assert!(text.contains(", 480 beams a LiDAR"), "no rig has the other model: {text}");
    text.says("\nup: price 2; distances from the origin met in all 16 directions: car ");
    text.says("\nlevel: price 4; distances");
    text.says("\nMetres of targets count from the origin, of ground");
    // Every table that prints metres says where they begin.
    for (study, from) in [
        ("targets", "Distances from the origin. 5 beams or more meet a target"),
        ("redundancy", "Targets 5 to 50 m from the origin, 5 beams or more each"),
        ("nearfield", " m² of ground within 10 m of the body, "),
    ] {
        let args = ["study", study, "s.json", "rigs.json", "--frames", "1", "--backend", "cpu"];
        let (_, [text, _]) = ran(&dir, &args);
        assert!(text.contains(from), "{study}: {text}");
    }
    let last = text.lines().last().unwrap();
    assert!(last.starts_with("better: level (2 of 2 requirements met, near_gain "), "{text}");
    assert!(last.ends_with("then the number of violated guards, then near_gain"), "{text}");
    assert!(last.contains("missing, ") && last.contains("; decided by the requirements"), "{text}");
    let scores = ok(&dir, "score s.json rigs.json --backend cpu");
    let card = &scores["scores"][0]["range_card"];
    for of in card["targets"][0]["bearings"].list() {
        let bearing = of["bearing"].number();
        assert!(bearing > -180.0 && bearing <= 180.0, "{bearing}");
    }
    let blind = &card["blind"][0];
    assert!(blind["worst"].is_number() && blind["lost"][0].is_array(), "{blind}");
    let one = sightline(&dir, "score s.json rigs.json:up --backend cpu");
    assert!(!String::from_utf8(one.stdout).unwrap().contains("better"));
}

#[test]
fn rules_that_ask_for_nothing_radians_and_mounts_below_the_ground_are_told() {
    let dir = folder();
    let child = |more: Value| {
        let mut rule = json!({ "target": "child", "within": 20, "share": 0.5 });
        rule.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        rule
    };
    for (rule, told) in [
        (child(json!({ "share": 0 })), "require[0].share: 0 asks for nothing; 0.9 asks for 90 %"),
        (
            child(json!({ "bearing": [-0.26, 0.26] })),
            "require[0].bearing: -0.26 to 0.26 are degrees; radians? 0.26 rad are 14.9°",
        ),
        (
            child(json!({ "bearing": [2.57, 3.71] })),
            "require[0].bearing: 2.57 to 3.71 are degrees; radians? 3.71 rad are 212.6°",
        ),
        (
            child(json!({ "bearing": [0, 6.25] })),
            "require[0].bearing: 0 to 6.25 are degrees; radians? 6.25 rad are 358.1°",
        ),
        (
            child(json!({ "within": -40 })),
            "require[0].within: -40 is not above 0 m and at most 1000 m",
        ),
        (
            child(json!({ "from": 9, "within": 4 })),
            "require[0].within: 4 m must be at least `from` (9 m)",
        ),
        (
            json!({ "name": "box", "min": [0, 0, 0], "max": [1, 1, 1], "share": 1, "without_any_one": true }),
            "require[0]: `without_any_one` cannot stand here: it is of a `target`, `ground`, a `blind_zone` or `overlap`",
        ),
        (json!({}), "require[0]: `min` is missing: give the corners of a box, a `target`"),
    ] {
        let said = of_car(&dir, |car| car["require"] = json!([rule]));
        assert!(said.contains(&format!("own.json: {told}")), "{told}: {said}");
    }
    for bearing in [json!([-2, 2]), json!([0, 3]), json!([-5, 5]), json!([-7.5, 7.5])] {
        let rule = json!([child(json!({ "bearing": bearing }))]);
        let fine = of_car(&dir, |car| car["require"] = rule.clone());
        assert!(!fine.contains("radians?"), "{fine}");
    }
    of_car(&dir, |car| {
        car["mounts"][0]["min"] = json!([4, -0.6, -0.5]);
        car["mounts"][0]["max"] = json!([4.5, 0.6, 0.2]);
    })
    .says("mounts[0] reaches down to z = -0.5, below the ground");
    of_car(&dir, |car| {
        car["mounts"][0]["min"] = json!([4, -0.6, -0.5]);
        car["mounts"][0]["max"] = json!([4.5, 0.6, -0.2]);
    })
    .says("mounts[0] reaches down to z = -0.5, below the ground");
    of_car(&dir, |car| car["mounts"][0]["pitch"] = json!([-10, 10]))
        .says("mounts[0].pitch[0]: -10 is not an angle in radians within")
        .says("-10° are -0.1745 rad");
}

#[test]
fn an_origin_in_millimetres_and_a_model_without_its_vehicle_are_told() {
    let dir = folder();
    fails(&dir, &("rig handover rigs.json:A --vehicle car.json --out h", "--base-link=-1400"))
        .says("-1400 m is far from any vehicle; -1400 mm are -1.4 m");
    let rig = r#"{ "sightline": 1, "placements": [{ "name": "A", "lidars": [
        { "x": 0.5, "y": 0, "z": 2, "sensor": "spin" }] }] }"#;
    write(&dir, "named.json", rig);
    let mut scene = read_json(dir.path().join("s.json"));
    scene.as_object_mut().unwrap().remove("vehicle");
    scene["lidar"] = json!({ "channels": 8, "fov": [-25, 15], "azimuth_steps": 60, "range": 30 });
    scene["mount"] = json!({ "min": [0, -1, 1], "max": [1, 1, 2], "lidars": 1 });
    write(&dir, "plain.json", &scene);
    let told = fails(&dir, "score plain.json named.json --backend cpu");
    told.says("names of models come with the file of a vehicle, `--vehicle FILE`");
    assert!(!told.contains("give --vehicle"), "{told}");
    // The folder of a run says which vehicle it was made with.
    fs::create_dir(dir.path().join("run")).unwrap();
    write(&dir, "run/placements.json", rig);
    let result =
        json!({ "settings": { "vehicle": "car.json" }, "best": { "placement": { "name": "A" } } });
    write(&dir, "run/result.json", &result);
    fails(&dir, "score plain.json run --backend cpu")
        .says("there is no sensor `spin`")
        .says("; give --vehicle car.json, with which this run was made");
    fails(&dir, "optimize run")
        .says("run: is the folder of a run; go on with --resume run, or give a scene file");
}
