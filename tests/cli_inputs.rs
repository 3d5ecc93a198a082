//! Files that are read: what they are taken for, and what a run does when they change.

use crate::cli::*;

#[test]
fn a_run_does_not_go_on_with_other_files() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name);
    let mut scene = read_json(room(dir.path()));
    ok(&dir, "psog build room.json --out room.npz");
    scene["psog"] = json!({ "file": "room.npz" });
    scene["lidar"] = json!({ "file": "sensor.json", "azimuth_steps": 60, "range": 20 });
    scene["static"][0] = json!({ "class": "wall", "mesh": { "file": "wall.obj" } });
    write(&dir, "room.json", &scene);
    write(&dir, "sensor.json", "{ \"elevation_deg\": [-20, 0] }");
    write(&dir, "wall.obj", "v 3 -3 0\nv 3 3 0\nv 3 0 3\nf 1 2 3\n");
    let args = "optimize room.json --backend cpu --evaluations 8 --out run";
    let begun = ok(&dir, args);
    let resume = "optimize --resume run --backend cpu";
    for name in ["room.json", "sensor.json", "wall.obj", "room.npz"] {
        let bytes = fs::read(path(name)).unwrap();
        // A byte more is still the same scene to the reader of each of these.
        fs::write(path(name), [&bytes[..], b"\n"].concat()).unwrap();
        fails(&dir, resume).says(&format!("{name}: has changed"));
        fs::write(path(name), bytes).unwrap();
    }
    // Nothing is left to do: the result is told as it was written, with the times of the search.
    let resumed = ok(&dir, resume);
    assert_eq!(resumed["best"], begun["best"]);
    assert_eq!(resumed["timings"]["generations"], begun["timings"]["generations"]);
    assert!(resumed["rate"].as_f64() > Some(0.0), "{}", resumed["rate"]);
    assert_eq!(resumed["timings"]["page"], begun["timings"]["page"]);
    assert_eq!(resumed["timings"]["total"], begun["timings"]["total"]);
    // A run that replaces another one has not taken its time.
    let mut times = read_json(path("run/times.json"));
    times["times"]["search"] = json!(1e6);
    write(&dir, "run/times.json", &times);
    let anew = ok(&dir, &(args, "--force"));
    let seconds = anew["timings"]["search"].as_f64();
    assert!(seconds.is_some_and(|seconds| seconds < 1e6), "{}", anew["timings"]);
}

fn line(name: &str) -> String {
    format!("{{\"name\":\"{name}\",\"lidars\":[{{\"x\":0.5,\"y\":0.5,\"z\":0.5}}]}}\n")
}

/// Scores placements that come through a pipe.
fn piped(dir: &TempDir, input: &str, more: &[&str]) -> Output {
    let args = "score scene.json - --format json --backend cpu";
    crate::cli::piped(dir.path(), &(args, more), input.as_bytes())
}

#[test]
fn placements_come_through_pipes_as_lines_or_as_a_document() {
    let dir = corridor();
    let names = |output: Output| -> Vec<String> {
        let answer: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| {
            panic!("{}", String::from_utf8_lossy(&output.stderr));
        });
        let names = answer["scores"].list().iter();
        names.map(|score| score["name"].text().to_owned()).collect()
    };
    let many: String = (0..1500).map(|n| line(&format!("p{n}"))).collect();
    assert_eq!(names(piped(&dir, &many, &[])).len(), 1500);
    let document = format!(" {{\n \"placements\":\n[{},{}]}}", line("a"), line("b"));
    assert_eq!(names(piped(&dir, &document, &[])), ["a", "b"]);
    assert_eq!(names(piped(&dir, &format!("\u{feff}{}", line("a")), &[])), ["a"]);
    // A fault late in a stream leaves no file; nor does an empty one.
    for (end, words) in [
        (line("p7"), "-, line 1501: the name `p7` is used twice"),
        ("{\"name\": 3}".to_owned(), "-, line 1501, column 10: name: the number `3` stands where"),
    ] {
        let late = piped(&dir, &(many.clone() + &end), &["--out", "scores.json"]);
        let message = String::from_utf8_lossy(&late.stderr).into_owned();
        assert_eq!(late.status.code(), Some(2), "{message}");
        message.says(words);
        assert!(!dir.path().join("scores.json").exists());
    }
    // On stdout it comes after scores, which say so and are no whole document.
    let late = piped(&dir, &(many + "{}"), &[]);
    let message = String::from_utf8_lossy(&late.stderr);
    assert_eq!(late.status.code(), Some(2), "{message}");
    message.says("only the scores of the first 1024 placements");
    message.says("-, line 1501, column 2: missing key");
    assert!(serde_json::from_slice::<Value>(&late.stdout).is_err());
    let none = piped(&dir, "\n", &[]);
    assert_eq!((none.status.code(), none.stdout.len()), (Some(2), 0));
}

#[test]
fn wrong_placements_are_answered_with_place_and_mend() {
    let dir = corridor();
    let lidar = "{\"x\":0,\"y\":0,\"z\":1}";
    for (name, text, words) in [
        ("a.json", format!("[{}]", line("a")), "is a bare list; write {\"placements\""),
        ("i.json", line("a"), "placement `a`: name: belongs to a placement; write {\"placements\""),
        (
            "k.jsonl",
            format!("{{\"placements\":[{}]}}", line("a").trim()),
            "placements: belongs to a document; give the file the ending .json",
        ),
        ("g.json", scene().to_string(), "g.json: is a scene; give a file of placements"),
        (
            "b.json",
            format!("{{\"placements\":[{},{{\"lidars\":[{lidar}]}}]}}", line("a")),
            "placements[1]: missing key `name`",
        ),
        (
            "c.jsonl",
            line("a") + "{\"name\":\"b\",\"lidars\":[{\"x\":\"far\",\"y\":0,\"z\":1}]}",
            "line 2, column 32, placement `b`: lidars[0].x: string \"far\" stands where a number belongs",
        ),
        ("d.jsonl", line("a") + "{\"name\"", "line 2, column 7: the text ends inside of an object"),
        (
            "h.json",
            format!("{{\"placements\":[{{\"name\":\"a\",\"lidars\":[{lidar},]}}]}}"),
            "placements[0].lidars: the comma before `]` is one too many; remove it",
        ),
        (
            "e.jsonl",
            line("a").replace("\"x\":0.5", "\"x\":NaN"),
            "line 1, column 28, placement `a`: lidars[0].x: no value that JSON knows; numbers are finite",
        ),
    ] {
        fs::write(dir.path().join(name), text).unwrap();
        fails(&dir, &["score", "scene.json", name, "--backend", "cpu"]).says(name).says(words);
    }
    fs::write(dir.path().join("f.json"), b"{\"placements\": [\xff]}").unwrap();
    fails(&dir, "score scene.json f.json").says("f.json: is not UTF-8 text from byte 16 on");
}

#[test]
fn what_is_most_likely_not_meant_is_told_once_and_taken_as_it_is() {
    let dir = corridor();
    let one = |name: &str, lidar: Value| json!({ "name": name, "lidars": [lidar] });
    let mut placements = vec![
        one("turned", json!({ "x": 0.5, "y": 0.5, "z": 0.5, "yaw": 90 })),
        one("fine", json!({ "x": 0.5, "y": 0.5, "z": 0.5, "yaw": 3.2 })),
        one("high", json!({ "x": 0.5, "y": 0.5, "z": 2500 })),
    ];
    placements
        .extend((0..3).map(|k| one(&format!("p{k}"), json!({ "x": 1.4, "y": 0.5, "z": 0.5 }))));
    let text = json!({ "placements": placements }).to_string();
    fs::write(dir.path().join("odd.json"), text).unwrap();
    let told = stderr(&dir, "score scene.json odd.json --backend cpu");
    for words in [
        "odd.json: placement `turned`, LiDAR 0: yaw = 90 is more than a turn; angles are in radians",
        "placement `high`, LiDAR 0: z = 2500 is far from any vehicle; positions are in metres",
        "placement `p0`, LiDAR 0: it stands 0.500 m outside its mount",
        "odd.json: such a problem with 2 more LiDARs",
    ] {
        assert!(told.contains(words), "{told}\n lacks {words}");
    }
    assert!(!told.contains("`fine`") && !told.contains("`p1`"), "{told}");
}

/// Answer of the program to a scene with another value at a JSON pointer.
fn with_scene(pointer: &str, value: Value, args: &[&str]) -> String {
    let dir = corridor();
    let mut scene = scene();
    *scene.pointer_mut(pointer).unwrap() = value;
    write(&dir, "scene.json", &scene);
    fails(&dir, args)
}

#[test]
fn what_cannot_be_is_named_with_its_file_and_leaves_nothing() {
    let score = ["score", "scene.json", "placements.json", "--backend", "cpu"];
    with_scene("/name", json!("a\u{1}b"), &score)
        .says("scene.json: name: \"a\\u{1}b\" is not a text without");
    with_scene("/roi/max/0", json!(20), &score)
        .says("scene.json and corridor.psog.npz: the P-SOG has");

    let dir = TempDir::new().unwrap();
    let path = room(dir.path());
    let optimize = "optimize room.json --backend cpu --evaluations 8";
    write(&dir, "file", "");
    for (more, words) in [
        (["--delta", "1e-9"], "widen --delta"),
        (["--adapter", "X"], "leave one of them out"),
        (["--memory", "16"], "--memory"),
    ] {
        fails(&dir, &(optimize, &more)).says(words);
        assert!(!dir.path().join("runs").exists(), "{more:?} left a folder");
    }
    write(&dir, "p.json", &format!("{{\"placements\":[{}]}}", line("a")));
    fails(&dir, "cast room.json p.json --frame 99")
        .says("room.json: there is no frame 99; give --frame 0 to 2");
    stderr(&dir, "score room.json p.json --frames 99").says("--frames 99: the scene has 3");

    // Headings of a log count turns on.
    let mut scene = read_json(&path);
    let tau = std::f64::consts::TAU;
    let poses = [0, 1, 2].map(|turn| json!({ "x": 0, "y": 0, "yaw": f64::from(turn) * tau }));
    scene["ego"] = json!({ "poses": poses });
    fs::write(&path, scene.to_string()).unwrap();
    ok(&dir, "score room.json p.json --backend cpu");
    // Further apart than the mount is long; and not, but still further than two can be.
    scene["mount"]["min_distance"] = json!(50);
    fs::write(&path, scene.to_string()).unwrap();
    fails(&dir, optimize).says("room.json: mount.min_distance: 50 is not");
    scene["mount"]["keep_out"] = json!([{ "min": [-1, -1, 1], "max": [0.5, 1, 2] }]);
    scene["mount"]["min_distance"] = json!(1.5);
    fs::write(&path, scene.to_string()).unwrap();
    fails(&dir, optimize).says("was found that keeps its rules (at least 1.5 m apart;");
}

#[test]
fn doubts_about_a_sensor_file_are_told_and_refused_under_strict() {
    let dir = TempDir::new().unwrap();
    let write = |name: &str, value: &Value| write(&dir, name, &value);
    write("radians.json", &json!({ "elevation_deg": [-0.2, -0.1, 0.0, 0.1, 0.2] }));
    let facts = ok(&dir, "sensor info radians.json");
    assert!(facts["notes"][0].text().contains("radians?"), "{facts}");
    fails(&dir, "sensor info radians.json --out p.svg --strict").says("radians?");
    assert!(!dir.path().join("p.svg").exists());
}

/// Ouster's own 512 columns beside others on the command line: a note has both numbers.
#[test]
fn other_columns_than_those_of_the_file_are_told() {
    let dir = TempDir::new().unwrap();
    let file = json!({ "beam_altitude_angles": [10, 0], "beam_azimuth_angles": [0, 0], "lidar_mode": "512x20" });
    write(&dir, "os.json", &file);
    let notes = |steps: &str| {
        let facts = ok(&dir, &["sensor", "info", "os.json", "--azimuth-steps", steps]);
        facts["notes"].to_string()
    };
    notes("600").says("os.json: azimuth_steps: 512; --azimuth-steps gives 600");
    assert!(!notes("512").contains("azimuth_steps"), "{}", notes("512"));
}

/// A vehicle that an editor saved in UTF-16.
#[test]
fn utf_16_is_told_with_the_mend() {
    let dir = TempDir::new().unwrap();
    let wide = |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    for file in ["vehicle.json", "scene.json", "map.xodr"] {
        fs::write(dir.path().join(file), wide("\u{feff}{\"sightline\": 1, \"sensors\": []}"))
            .unwrap();
    }
    write_rig(&dir, "p.json", "p", json!([{ "x": 0, "y": 0, "z": 2 }]));
    for args in [
        "score scene.json p.json",
        "study targets p.json --vehicle vehicle.json --target child",
        "scene import map.xodr --out w.json",
    ] {
        fails(&dir, args).says("is UTF-16 text; save it as UTF-8");
    }
}

/// The answer on a sensor with channels is a sensor file with the same window and ranges.
#[test]
fn facts_of_a_sensor_can_be_read_again() {
    let dir = TempDir::new().unwrap();
    let emitters = json!([{ "azimuthDeg": [0, 0], "elevationDeg": [-15, 15] }]);
    let profile = json!({ "profile": { "scanType": "rotary", "farRangeM": 80, "scanRateBaseHz": 10,
        "reportRateBaseHz": 3600, "startAzimuthDeg": -60, "endAzimuthDeg": 60, "emitterStates": emitters } });
    write(&dir, "profile.json", &profile);
    let first = ok(&dir, "sensor info profile.json");
    write(&dir, "facts.json", &first);
    let second = ok(&dir, "sensor info facts.json");
    assert_eq!((&first["beams"], &first["range"]), (&json!(242), &json!(80.0)));
    for key in ["beams", "range", "rate", "azimuth_window", "azimuth_steps", "elevation_deg"] {
        assert_eq!(first[key], second[key], "{key}");
    }
}
