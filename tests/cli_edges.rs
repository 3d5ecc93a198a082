//! The edge of use: P-SOGs that tell nothing, folders that two runs want, names that a
//! terminal would obey.

use std::collections::BTreeSet;
use std::fs::File;

use sightline::psog::{Psog, Roi, write_psog};

use crate::cli::*;

const OPTIMIZE: &str = "optimize scene.json --evaluations 4 --backend cpu";

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
        let output = sightline(&dir, "score scene.json placements.json --backend cpu");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        stderr.says("the P-SOG holds no information");
        let objectives =
            [("scaled", "m_sog_scaled"), ("gain", "information_gain"), ("negative", "-1*m_sog")];
        for (out, objective) in objectives {
            let args = ["--objective", objective, "--out", out, "--baselines", "placements.json"];
            let run = ok(&dir, &(OPTIMIZE, &args));
            assert_eq!(run["best"]["objective"].as_f64(), Some(0.0), "{objective}");
            let says = run["certificate"]["gain_says"].text();
            assert!(!says.contains("NaN"), "{says}");
            let page = fs::read_to_string(dir.path().join(out).join("report.html")).unwrap();
            assert!(page.contains("The placement found is as good as "), "{objective}");
        }
        let output = sightline(&dir, "study lidars scene.json --evaluations 4 --backend cpu");
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        stderr.says("no row has an answer: no placement that");
        // A share of nothing is no number, which is no fault of the mount.
        fails(&dir, &(OPTIMIZE, "--out share")).says("nothing is uncertain in its P-SOG");
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
    fails(&dir, &(OPTIMIZE, "--out run"))
        .says("candidates kept its rules, but none has a value of `near_gain`");
}

#[test]
fn a_folder_belongs_to_one_run_at_a_time() {
    let dir = corridor();
    ok(&dir, &(OPTIMIZE, "--out run"));
    fs::create_dir(dir.path().join("new")).unwrap();
    let resume = "optimize --resume run --backend cpu";
    let held = ["run", "new"].map(|name| File::open(dir.path().join(name)).unwrap());
    held.iter().for_each(|folder| folder.lock().unwrap());
    for args in [
        &format!("{OPTIMIZE} --out new"),
        resume,
        "study lidars scene.json --backend cpu --out new",
        "chart scene.json --backend cpu --out new",
    ] {
        fails(&dir, args).says("another run writes into it");
    }
    // Scores of several commands may go into one folder.
    ok(&dir, &("score scene.json placements.json --backend cpu", "--coverage-out new"));
    drop(held);
    ok(&dir, resume);
}

#[test]
fn of_two_runs_that_begin_at_once_one_ends_well() {
    let dir = corridor();
    for attempt in 0..4 {
        let folder = format!("run-{attempt}");
        let args = &(OPTIMIZE, "--out", &folder);
        let runs = [(); 2].map(|()| crate::cli_interrupted::spawn(dir.path(), args));
        let ends = runs.map(|run| run.wait_with_output().unwrap());
        // Both, where one has ended before the other comes to look.
        assert!(ends.iter().any(|end| end.status.success()), "{ends:?}");
        assert!(dir.path().join(folder).join("report.html").is_file());
    }
}

#[test]
fn a_study_that_cannot_be_leaves_no_folder_and_names_the_file() {
    let dir = corridor();
    fails(&dir, "study voxels scene.json --backend cpu").says("scene.json: its P-SOG is a file");
    assert!(!dir.path().join("studies").exists());
}

#[test]
fn a_second_chart_gets_a_folder_of_its_own() {
    let dir = corridor();
    let chart = "chart scene.json --placements 2 --backend cpu";
    ok(&dir, chart);
    ok(&dir, chart);
    assert!(dir.path().join("runs/scene-chart-2/chart.svg").is_file());
}

#[test]
fn no_name_reaches_a_terminal_as_a_command() {
    let dir = corridor();
    let placement = json!({ "name": "\u{1b}[31mred", "lidars": [{ "x": 0, "y": 0, "z": 0 }] });
    let file = dir.path().join("odd.json");
    fs::write(file, json!({ "placements": [placement] }).to_string()).unwrap();
    fails(&dir, "score scene.json odd.json --backend cpu")
        .says("`\\u{1b}[31mred` is not a placement name");
    let roi = Roi::new([0.0; 3], [1.0; 3], [10, 2, 1]).unwrap();
    let long = "x".repeat(201);
    for name in ["\u{1b}[31mred".to_owned(), long] {
        let error = Psog::new(roi, 1, vec![name], vec![], vec![]).err().unwrap().to_string();
        error.says("a class name has 1 to 200 characters");
    }
    // Marks of direction and breaks of lines are no control characters; tables spell them out.
    let dir = crate::cli_files::world();
    let town = read_text(&dir, "town.json");
    let turned = town.replace("\"town\"", "\"a\u{202e}b\u{2028}c\"");
    fs::write(dir.path().join("turned.json"), turned).unwrap();
    stdout(&dir, "scene info turned.json").says("a\\u{202e}b\\u{2028}c");
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
    empty.says("empty.json: the file is empty");
    fails(&dir, "score scene.json empty.json --backend cpu").says("empty.json: holds no placement");

    // Its size is known before any of its bytes is read: there is no memory for them.
    fs::File::create(at("huge.json")).unwrap().set_len(6 << 30).unwrap();
    let score = "score scene.json huge.json --backend cpu --threads 1";
    let out = shell(&dir, "ulimit -c 0; ulimit -v 900000;", score);
    String::from_utf8_lossy(&out.stderr).says("huge.json: larger than 1073741824 bytes");

    let far = json!({ "name": "a", "lidars": [{ "x": 0, "y": 0, "z": 2, "roll": 1e300 }] });
    write(&dir, "far.json", &json!({ "placements": [far] }));
    for command in
        ["rig export far.json:a --format=urdf", "rig compare far.json:a placements.json:away"]
    {
        fails(&dir, command).says("far.json: placement `a`, LiDAR 0: roll = 1e300");
    }

    let mut three = scene();
    three["lidar"]["fov"] = json!([0, 0, 0]);
    write(&dir, "three.json", &three);
    fails(&dir, "score three.json placements.json")
        .says("lidar.fov: the list is longer than it should be");

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
    stderr.says(note);
}

#[test]
fn a_chart_whose_state_was_changed_is_refused() {
    let dir = corridor();
    ok(&dir, &("chart scene.json --placements 2 --backend cpu", "--out chart"));
    change(&dir, "chart/checkpoint.json", |saved| {
        saved["state"]["measured"][1]["scores"].as_array_mut().unwrap().pop().unwrap();
    });
    fails(&dir, "chart --resume chart --backend cpu").says("was changed after it was written");
}

/// From too little for the program's own start up to enough for the whole run, in steps that stop it
/// in every stage.
#[cfg(target_os = "linux")]
#[test]
fn running_out_of_memory_is_an_error_with_a_sentence() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let dir = tempfile::tempdir().unwrap();
    let scene =
        crate::main_job::shortened(dir.path(), &root.join("scenes/urban-crossing.json"), 4, None);
    let scene = scene.display();
    let job = format!("optimize '{scene}' --backend cpu --frames 1 --max-seconds 1 --out run");
    let (mut refused, mut done) = (0, 0);
    for kibibytes in [64, 80, 120, 150, 165, 180, 200, 1500].map(|mebibytes| mebibytes << 10) {
        let out = shell(&dir, &format!("ulimit -c 0; ulimit -v {kibibytes};"), &job);
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
    let score = |out: &str, scenes: &str| {
        format!("score {scenes} names.json --backend cpu --coverage-out {out}")
    };
    let listed = |folder: &str| -> BTreeSet<String> {
        let name = |entry: std::io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string();
        fs::read_dir(at(folder)).unwrap().map(|entry| name(entry).unwrap()).collect()
    };
    let wanted: BTreeSet<String> = names.iter().map(|name| format!("{name}.npy")).collect();
    ok(&dir, &score("one", "scene.json"));
    assert_eq!(listed("one"), wanted);
    // A beam along x covers the voxels from its own on: every file has its own length.
    let sizes: BTreeSet<u64> =
        wanted.iter().map(|file| at("one").join(file).metadata().unwrap().len()).collect();
    assert_eq!(sizes.len(), names.len(), "{sizes:?}");
    ok(&dir, &score("two", "scene.json scene.json"));
    for (folder, sizes) in [("two/corridor", &sizes), ("two/corridor-2", &sizes)] {
        let files = listed(folder);
        assert_eq!(files, wanted);
        let size = |file: &String| at(folder).join(file).metadata().unwrap().len();
        assert_eq!(&files.iter().map(size).collect::<BTreeSet<u64>>(), sizes);
    }
    // The last file of an earlier run is found before the first is written.
    for (out, scenes, first, old) in [
        ("new", "scene.json", "new/a.npy", "new/z.npy"),
        ("more", "scene.json scene.json", "more/corridor/a.npy", "more/corridor-2/z.npy"),
    ] {
        rigs(&["a", "z"]);
        fs::create_dir_all(at(old).parent().unwrap()).unwrap();
        write(&dir, old, "kept");
        fails(&dir, &score(out, scenes)).says(old).says("--force");
        assert!(!at(first).exists(), "half a result");
        assert_eq!(fs::read(at(old)).unwrap(), b"kept");
        ok(&dir, &(&score(out, scenes), "--force"));
        assert_ne!(fs::read(at(old)).unwrap(), b"kept");
    }
}
