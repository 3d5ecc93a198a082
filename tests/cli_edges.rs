//! The edge of use: P-SOGs that tell nothing, folders that two runs want, names that a
//! terminal would obey.

use std::collections::BTreeSet;
use std::fs::File;

use sightline::psog::{Psog, Roi, write_psog};

use crate::cli::*;

const OPTIMIZE: [&str; 6] = ["optimize", "scene.json", "--evaluations", "4", "--backend", "cpu"];

/// The corridor with a P-SOG of one frame, in which the voxels of these indices are occupied.
fn certain_corridor(index: Vec<u64>) -> TempDir {
    let dir = corridor();
    let roi = Roi::new([0.0; 3], [1.0; 3], [10, 2, 1]).unwrap();
    let counts = vec![1; index.len()];
    let psog = Psog::new(roi, 1, vec!["car".to_owned()], index, counts).unwrap();
    let file = fs::File::create(dir.path().join("corridor.psog.npz")).unwrap();
    write_psog(file, &psog).unwrap();
    dir
}

#[test]
fn a_psog_that_tells_nothing_is_said_and_ends_nothing() {
    for index in [vec![4, 6, 7], vec![]] {
        let dir = certain_corridor(index);
        let score = ["score", "scene.json", "placements.json", "--backend", "cpu"];
        let output = sightline(&dir, &score);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(stderr.contains("the P-SOG tells nothing"), "{stderr}");
        let objectives =
            [("scaled", "m_sog_scaled"), ("gain", "information_gain"), ("negative", "-1*m_sog")];
        for (out, objective) in objectives {
            let args = ["--objective", objective, "--out", out, "--baselines", "placements.json"];
            let run = ok(&dir, &[&OPTIMIZE[..], &args].concat());
            assert_eq!(run["best"]["objective"].as_f64(), Some(0.0), "{objective}");
            let says = run["certificate"]["gain_says"].as_str().unwrap();
            assert!(!says.contains("NaN"), "{says}");
            let page = fs::read_to_string(dir.path().join(out).join("report.html")).unwrap();
            assert!(page.contains("The placement found is as good as "), "{objective}");
        }
        let args = ["study", "lidars", "scene.json", "--evaluations", "4", "--backend", "cpu"];
        let output = sightline(&dir, &args);
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(stderr.contains("no row has an answer: no placement that"), "{stderr}");
        // A share of nothing is no number, which is no fault of the mount.
        let message = fails(&dir, &[&OPTIMIZE[..], &["--out", "share"]].concat());
        assert!(message.contains("nothing is uncertain in its P-SOG"), "{message}");
        assert!(!dir.path().join("share").exists());
    }
}

#[test]
fn candidates_that_see_nothing_are_not_said_to_break_rules() {
    let dir = corridor();
    let mut scene = scene();
    (scene["mount"]["min"][2], scene["mount"]["max"][2]) = (json!(5), json!(6));
    for angle in ["pitch", "yaw"] {
        scene["mount"][angle] = json!([0, 0]);
    }
    write(&dir, "scene.json", &scene);
    let message = fails(&dir, &[&OPTIMIZE[..], &["--out", "run"]].concat());
    let words = "candidates kept its rules, but none has a value of `near_gain`";
    assert!(message.contains(words), "{message}");
}

#[test]
fn a_folder_belongs_to_one_run_at_a_time() {
    let dir = corridor();
    ok(&dir, &[&OPTIMIZE[..], &["--out", "run"]].concat());
    fs::create_dir(dir.path().join("new")).unwrap();
    let new = ["--out", "new"];
    let commands = [
        [&OPTIMIZE[..], &new].concat(),
        vec!["optimize", "--resume", "run", "--backend", "cpu"],
        [&["study", "lidars", "scene.json", "--backend", "cpu"][..], &new].concat(),
        [&["chart", "scene.json", "--backend", "cpu"][..], &new].concat(),
    ];
    let held = ["run", "new"].map(|name| File::open(dir.path().join(name)).unwrap());
    held.iter().for_each(|folder| folder.lock().unwrap());
    for args in &commands {
        let message = fails(&dir, args);
        assert!(message.contains("another run writes into it"), "{args:?}: {message}");
    }
    // Scores of several commands may go into one folder.
    let score = ["score", "scene.json", "placements.json", "--backend", "cpu"];
    ok(&dir, &[&score[..], &["--coverage-out", "new"]].concat());
    drop(held);
    ok(&dir, &commands[1]);
}

#[test]
fn of_two_runs_that_begin_at_once_one_ends_well() {
    let dir = corridor();
    for attempt in 0..4 {
        let folder = format!("run-{attempt}");
        let args = [&OPTIMIZE[..], &["--out", &folder]].concat();
        let runs = [(); 2].map(|()| crate::cli_interrupted::spawn(dir.path(), &args));
        let ends = runs.map(|run| run.wait_with_output().unwrap());
        // Both, where one has ended before the other comes to look.
        assert!(ends.iter().any(|end| end.status.success()), "{ends:?}");
        assert!(dir.path().join(folder).join("report.html").is_file());
    }
}

#[test]
fn a_study_that_cannot_be_leaves_no_folder_and_names_the_file() {
    let dir = corridor();
    let message = fails(&dir, "study voxels scene.json --backend cpu");
    assert!(message.contains("scene.json: its P-SOG is a file"), "{message}");
    assert!(!dir.path().join("studies").exists());
}

#[test]
fn a_second_chart_gets_a_folder_of_its_own() {
    let dir = corridor();
    let chart = ["chart", "scene.json", "--placements", "2", "--backend", "cpu"];
    ok(&dir, &chart);
    ok(&dir, &chart);
    assert!(dir.path().join("runs/scene-chart-2/chart.svg").is_file());
}

#[test]
fn no_name_reaches_a_terminal_as_a_command() {
    let dir = corridor();
    let placement = json!({ "name": "\u{1b}[31mred", "lidars": [{ "x": 0, "y": 0, "z": 0 }] });
    let file = dir.path().join("odd.json");
    fs::write(file, json!({ "placements": [placement] }).to_string()).unwrap();
    let message = fails(&dir, "score scene.json odd.json --backend cpu");
    assert!(message.contains("`\\u{1b}[31mred` is not a placement name"), "{message}");
    let roi = Roi::new([0.0; 3], [1.0; 3], [10, 2, 1]).unwrap();
    let long = "x".repeat(201);
    for name in ["\u{1b}[31mred".to_owned(), long] {
        let error = Psog::new(roi, 1, vec![name], vec![], vec![]).err().unwrap().to_string();
        assert!(error.contains("a class name has 1 to 200 characters"), "{error}");
    }
    // Marks of direction and breaks of lines are no control characters; tables spell them out.
    let dir = crate::cli_files::world();
    let town = fs::read_to_string(dir.path().join("town.json")).unwrap();
    let turned = town.replace("\"town\"", "\"a\u{202e}b\u{2028}c\"");
    fs::write(dir.path().join("turned.json"), turned).unwrap();
    let text = stdout(&dir, "scene info turned.json");
    assert!(text.contains("a\\u{202e}b\\u{2028}c"), "{text}");
}

#[test]
fn names_of_any_length_end_in_a_sentence() {
    let dir = corridor();
    let long = "n".repeat(70_000);
    for place in ["/name", "/vehicle/name", "/lidar/name", "/classes/0", "/actors/0/name"] {
        let mut scene = scene();
        match place {
            "/name" => scene["name"] = json!(long),
            "/classes/0" => scene["classes"] = json!([long]),
            "/actors/0/name" => {
                scene["actors"] = json!([{ "name": long, "parts": [], "poses": [] }])
            }
            _ => {
                let (mut vehicle, model) =
                    (json!({ "sightline": 1, "name": "v" }), scene["lidar"].take());
                let mut mount = scene["mount"].take();
                let lidars = mount.as_object_mut().unwrap().remove("lidars").unwrap();
                mount.as_object_mut().unwrap().remove("min_distance");
                mount["name"] = json!("roof");
                mount["count"] = lidars;
                vehicle["sensors"] = json!([{ "name": "one", "lidar": model }]);
                match place {
                    "/vehicle/name" => mount["name"] = json!(long),
                    _ => vehicle["sensors"][0]["name"] = json!(long),
                }
                vehicle["mounts"] = json!([mount]);
                write(&dir, "v.json", &vehicle);
                scene.as_object_mut().unwrap().retain(|key, _| key != "lidar" && key != "mount");
                scene["vehicle"] = json!("v.json");
            }
        }
        write(&dir, "long.json", &scene);
        let told = fails(&dir, "score long.json placements.json --backend cpu");
        let says = ["a name of at most 200 characters", "1 to 64 printable characters"];
        assert!(
            says.iter().any(|words| told.contains(words)),
            "{place}: {}",
            &told[..told.len().min(900)]
        );
        assert!(told.len() < 6000, "{place}: {} bytes", told.len());
    }
}

#[test]
fn what_is_empty_too_long_or_called_otherwise_is_said_in_plain_words() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    write(&dir, "empty.json", " \n");
    let empty = fails(&dir, "score empty.json placements.json");
    assert!(empty.contains("empty.json: the file is empty"), "{empty}");
    let none = fails(&dir, "score scene.json empty.json --backend cpu");
    assert!(none.contains("empty.json: holds no placement"), "{none}");

    // Its size is known before any of its bytes is read: there is no memory for them.
    fs::File::create(at("huge.json")).unwrap().set_len(6 << 30).unwrap();
    let score = "exec '$0' score scene.json huge.json --backend cpu --threads 1"
        .replace("$0", env!("CARGO_BIN_EXE_sightline"));
    let limited = format!("ulimit -c 0; ulimit -v 900000; {score}");
    let mut shell = Command::new("sh");
    let out = shell.args(["-c", &limited]).current_dir(dir.path()).output().unwrap();
    let huge = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(huge.contains("huge.json: larger than 1073741824 bytes"), "{huge}");

    let far = json!({ "name": "a", "lidars": [{ "x": 0, "y": 0, "z": 2, "roll": 1e300 }] });
    write(&dir, "far.json", &json!({ "placements": [far] }));
    for command in [
        ["rig", "export", "far.json:a", "--format=urdf"],
        ["rig", "compare", "far.json:a", "placements.json:away"],
    ] {
        let far = fails(&dir, &command);
        assert!(far.contains("far.json: placement `a`, LiDAR 0: roll = 1e300"), "{far}");
    }

    let mut three = scene();
    three["lidar"]["fov"] = json!([0, 0, 0]);
    write(&dir, "three.json", &three);
    let three = fails(&dir, "score three.json placements.json");
    assert!(three.contains("lidar.fov: the list is longer than it should be"), "{three}");

    let mut mesh = scene();
    mesh["coverage"] = json!("first-hit");
    let classes = json!({ "Raod": "road", "Wall": "wall" });
    mesh["static"] =
        json!([{ "class": "static", "mesh": { "file": "town.obj", "classes": classes } }]);
    write(&dir, "mesh.json", &mesh);
    let town = "v 5 0 0\nv 5 2 0\nv 5 0 2\nusemtl Road\nf 1 2 3\nusemtl Wall\nf 1 3 2\n";
    fs::write(at("town.obj"), town).unwrap();
    let stderr = stderr(&dir, "score mesh.json placements.json");
    let note = "mesh.json: static[0].mesh.classes: town.obj has no material or label `Raod`; did you \
                mean `Road`?";
    assert!(stderr.contains(note), "{stderr}");
}

#[test]
fn a_chart_whose_state_was_changed_is_refused() {
    let dir = corridor();
    let chart = ["chart", "scene.json", "--placements", "2", "--backend", "cpu"];
    ok(&dir, &[&chart[..], &["--out", "chart"]].concat());
    change(&dir, "chart/checkpoint.json", |saved| {
        saved["state"]["measured"][1]["scores"].as_array_mut().unwrap().pop().unwrap();
    });
    let message = fails(&dir, "chart --resume chart --backend cpu");
    assert!(message.contains("was changed after it was written"), "{message}");
}

/// From too little for the program's own start up to enough for the whole run, in steps that stop it
/// in every stage.
#[cfg(target_os = "linux")]
#[test]
fn running_out_of_memory_is_an_error_with_a_sentence() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dir = tempfile::tempdir().unwrap();
    let program = env!("CARGO_BIN_EXE_sightline");
    let scene =
        crate::main_job::shortened(dir.path(), &root.join("scenes/urban-crossing.json"), 4, None);
    let job = format!(
        "exec '{program}' optimize '{}' --backend cpu --frames 1 --max-seconds 1 --out run",
        scene.display()
    );
    let (mut refused, mut done) = (0, 0);
    for kibibytes in [64, 80, 120, 150, 165, 180, 200, 1500].map(|mebibytes| mebibytes << 10) {
        let limited = format!("ulimit -c 0; ulimit -v {kibibytes}; {job}");
        let mut shell = Command::new("sh");
        let out = shell.arg("-c").arg(limited).current_dir(dir.path()).output().unwrap();
        let answer = String::from_utf8_lossy(&out.stderr);
        match out.status.code() {
            Some(0) => done += 1,
            Some(2) => {
                let sentences = ["out of memory", "use larger voxels"];
                assert!(sentences.iter().any(|sentence| answer.contains(sentence)), "{answer}");
                assert!(!dir.path().join("run/result.json").exists(), "half a run at {kibibytes}");
                refused += 1;
            }
            code => panic!("{code:?} with {kibibytes} KiB: {answer}"),
        }
        let _ = std::fs::remove_dir_all(dir.path().join("run"));
    }
    assert!(refused > 2 && done > 0, "{refused} refused, {done} done");
}

#[test]
fn files_of_covered_voxels_have_the_names_of_placements_or_none_is_written() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    let names = ["a", ".a", ".", "..", "CON", "A", "a.npy"];
    let rigs = |names: &[&str]| {
        let lidar = |k: usize| json!({ "x": 0.5 + k as f64, "y": 0.5, "z": 0.5 });
        let rig = |(k, name): (usize, &&str)| json!({ "name": name, "lidars": [lidar(k)] });
        let all: Vec<Value> = names.iter().enumerate().map(rig).collect();
        write(&dir, "names.json", &json!({ "placements": all }));
    };
    rigs(&names);
    let score = |out: &'static str, scenes: &[&'static str]| {
        let args = [&["score"], scenes, &["names.json", "--backend", "cpu", "--coverage-out", out]];
        args.concat()
    };
    let listed = |folder: &str| -> BTreeSet<String> {
        let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string();
        fs::read_dir(at(folder)).unwrap().map(|entry| name(entry).unwrap()).collect()
    };
    let wanted: BTreeSet<String> = names.iter().map(|name| format!("{name}.npy")).collect();
    ok(&dir, &score("one", &["scene.json"]));
    assert_eq!(listed("one"), wanted);
    // A beam along x covers the voxels from its own on: every file has its own length.
    let sizes: BTreeSet<u64> =
        wanted.iter().map(|file| at("one").join(file).metadata().unwrap().len()).collect();
    assert_eq!(sizes.len(), names.len(), "{sizes:?}");
    ok(&dir, &score("two", &["scene.json", "scene.json"]));
    for (folder, sizes) in [("two/corridor", &sizes), ("two/corridor-2", &sizes)] {
        let files = listed(folder);
        assert_eq!(files, wanted);
        let size = |file: &String| at(folder).join(file).metadata().unwrap().len();
        assert_eq!(&files.iter().map(size).collect::<BTreeSet<u64>>(), sizes);
    }
    // The last file of an earlier run is found before the first is written.
    for (out, scenes, first, old) in [
        ("new", &["scene.json"][..], "new/a.npy", "new/z.npy"),
        ("more", &["scene.json"; 2], "more/corridor/a.npy", "more/corridor-2/z.npy"),
    ] {
        rigs(&["a", "z"]);
        fs::create_dir_all(at(old).parent().unwrap()).unwrap();
        write(&dir, old, "kept");
        let told = fails(&dir, &score(out, scenes));
        assert!(told.contains(old) && told.contains("--force"), "{told}");
        assert!(!at(first).exists(), "half a result");
        assert_eq!(fs::read(at(old)).unwrap(), b"kept");
        ok(&dir, &[&score(out, scenes)[..], &["--force"]].concat());
        assert_ne!(fs::read(at(old)).unwrap(), b"kept");
    }
}
