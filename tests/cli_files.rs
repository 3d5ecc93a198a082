//! Files of the program: no output replaces an input, or without `--force` any file; names stay in their folder.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::cli::{corridor, fails, ok, scene, sightline};

/// A folder with a scene of a mesh and a sensor file, and everything else that commands read.
fn world() -> TempDir {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    fs::write(at("m.obj"), "v 4 -2 0\nv 4 2 0\nv 4 0 3\nv 6 0 3\nf 1 2 3\nf 2 3 4\n").unwrap();
    let altitudes: Vec<f64> = (0..16).map(|k| 2.0 - f64::from(k)).collect();
    let sensor = json!({ "beam_altitude_angles": altitudes, "beam_azimuth_angles": vec![0.0; 16],
                         "lidar_mode": "512x10", "lidar_origin_to_beam_origin_mm": 0.0 });
    fs::write(at("ouster.json"), sensor.to_string()).unwrap();
    let body =
        json!([{ "class": "vehicle", "box": { "foot": [0, 0, 0.3], "size": [4, 1.8, 1.2] } }]);
    let town = json!({
        "sightline": 1, "name": "town",
        "roi": { "min": [-10, -10, -0.5], "max": [10, 10, 3], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 4, "fov": [-20, 2], "azimuth_steps": 60, "range": 40 },
        "mount": { "min": [-0.5, -0.5, 1.8], "max": [0.5, 0.5, 2.4], "lidars": 2 },
        "coverage": "first-hit", "frames": 2, "ego": { "body": body },
        "static": [{ "class": "building", "mesh": { "file": "m.obj" } },
                   { "class": "road", "box": { "foot": [0, 0, -0.2], "size": [40, 40, 0.2] } }],
        "actors": [{ "name": "car", "parts": body,
                     "route": { "points": [[8, -6], [8, 6]], "spacing": 4 } }]
    });
    fs::write(at("town.json"), town.to_string()).unwrap();
    let second = town.to_string().replace("\"town\"", "\"town2\"");
    fs::write(at("town2.json"), second).unwrap();
    let lidars = json!([{ "x": 0, "y": 0, "z": 2 }, { "x": 0, "y": 0.4, "z": 2 }]);
    let placements = json!({ "placements": [{ "name": "p", "lidars": lidars }] });
    fs::write(at("p.json"), placements.to_string()).unwrap();
    dir
}

/// Every file below a folder with its bytes.
fn all_files(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut all = Vec::new();
    for entry in fs::read_dir(dir).unwrap().flatten() {
        match entry.file_type().unwrap().is_dir() {
            true => all.extend(all_files(&entry.path())),
            false => all.push((entry.path(), fs::read(entry.path()).unwrap())),
        }
    }
    all.sort();
    all
}

/// Commands up to the option of their output, and the inputs of each.
const COMMANDS: &[(&str, &[&str])] = &[
    ("score town.json p.json --backend cpu --out", &["town.json", "m.obj", "p.json"]),
    (
        "score town.json town2.json p.json --backend cpu --out",
        &["town.json", "town2.json", "p.json"],
    ),
    ("view town.json p.json:p --backend cpu --out", &["town.json", "m.obj", "p.json"]),
    ("cast town.json p.json --backend cpu --out", &["town.json", "m.obj", "p.json"]),
    ("study nearfield town.json p.json --backend cpu --out", &["town.json", "m.obj", "p.json"]),
    ("psog build town.json --out", &["town.json", "m.obj"]),
    ("psog merge corridor.psog.npz corridor.psog.npz --out", &["corridor.psog.npz"]),
    ("sensor info ouster.json --out", &["ouster.json"]),
    ("rig export p.json:p --format urdf --out", &["p.json"]),
    (
        "rig export p.json:p --format carla --scene town.json --out",
        &["p.json", "town.json", "m.obj"],
    ),
    ("rig import p.urdf --out", &["p.urdf"]),
];

#[test]
fn no_output_replaces_an_input_however_it_is_spelled() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    ok_text(dir.path(), "rig export p.json:p --format urdf --out p.urdf");
    fs::create_dir(at("sub")).unwrap();
    let mut tried = 0;
    for (command, inputs) in COMMANDS {
        for input in *inputs {
            let bytes = fs::read(at(input)).unwrap();
            symlink(at(input), at("sub/link")).unwrap();
            fs::hard_link(at(input), at("sub/hard")).unwrap();
            let absolute = at(input).to_string_lossy().into_owned();
            for out in [*input, "sub/link", "sub/hard", &format!("sub/../{input}"), &absolute] {
                for force in ["", "--force"] {
                    let words: Vec<&str> =
                        command.split(' ').chain([out, force]).filter(|w| !w.is_empty()).collect();
                    let message = fails(dir.path(), &words);
                    let says = ["already exists", "is read by this command"];
                    assert!(
                        says.iter().any(|words| message.contains(words)),
                        "{words:?}: {message}"
                    );
                    assert_eq!(fs::read(at(input)).unwrap(), bytes, "{words:?}");
                    tried += 1;
                }
            }
            fs::remove_file(at("sub/link")).unwrap();
            fs::remove_file(at("sub/hard")).unwrap();
        }
    }
    assert_eq!(tried, 10 * COMMANDS.iter().map(|(_, inputs)| inputs.len()).sum::<usize>());
    assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
}

/// Whether a file is one that was begun and not finished.
fn is_litter(path: &Path) -> bool {
    let name = path.file_name().unwrap().to_string_lossy();
    name.starts_with('.') || name.ends_with(".partial")
}

fn ok_text(dir: &Path, command: &str) {
    let words: Vec<&str> = command.split(' ').collect();
    let output = sightline(dir, &words);
    assert!(output.status.success(), "{command}: {output:?}");
}

#[test]
fn no_file_is_replaced_without_force_by_any_command() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    for (command, _) in COMMANDS.iter().filter(|(command, _)| !command.starts_with("rig import")) {
        fs::write(at("mine"), "my own").unwrap();
        let with = |more: &[&'static str]| {
            command.split(' ').chain(["mine"]).chain(more.to_vec()).collect::<Vec<_>>()
        };
        let message = fails(dir.path(), &with(&[]));
        assert!(message.contains("mine: already exists; give --force"), "{command}: {message}");
        assert_eq!(fs::read(at("mine")).unwrap(), b"my own", "{command}");
        let output = sightline(dir.path(), &with(&["--force"]));
        assert!(output.status.success(), "{command}: {output:?}");
        assert_ne!(fs::read(at("mine")).unwrap(), b"my own", "{command}");
    }
    // An optional second file, two outputs of one name, and files in shared folders.
    fs::write(at("mine.glb"), "my own").unwrap();
    for command in [
        "cast town.json p.json --backend cpu --gltf mine.glb",
        "optimize town.json --backend cpu --evaluations 4 --out run --gltf mine.glb",
        "scan town.json --placement p.json --backend cpu --out set --gltf mine.glb",
    ] {
        let message = fails(dir.path(), &command.split(' ').collect::<Vec<_>>());
        assert!(message.contains("mine.glb: already exists"), "{command}: {message}");
    }
    let twice = "cast town.json p.json --backend cpu --out both.glb --gltf ./both.glb";
    assert!(fails(dir.path(), &twice.split(' ').collect::<Vec<_>>()).contains("two outputs"));
    ok_text(dir.path(), "man --out pages");
    assert!(fails(dir.path(), &["man", "--out", "pages"]).contains("already exists"));
    ok_text(dir.path(), "man --out pages --force");
    ok_text(dir.path(), "score town.json p.json --backend cpu --coverage-out cov --quiet");
    let again = ["score", "town.json", "p.json", "--backend", "cpu", "--coverage-out", "cov"];
    assert!(fails(dir.path(), &again).contains("p.npy: already exists"));
}

#[test]
fn folders_of_others_are_not_written_into() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir(at("full")).unwrap();
    for name in ["result.json", "table.csv", "chart.csv", "placements.json", "notes"] {
        fs::write(at("full").join(name), "my own").unwrap();
    }
    let before = all_files(dir.path());
    for command in [
        "optimize town.json --backend cpu --evaluations 4 --out full",
        "optimize town.json --backend cpu --evaluations 4 --baselines p.json --out .",
        "study lidars town.json --backend cpu --evaluations 4 --out full",
        "chart town.json p.json --backend cpu --quick --out full",
        "scan town.json --placement p.json --backend cpu --out full",
        "optimize town.json --backend cpu --evaluations 4 --baselines p.json --out . --force",
    ] {
        let message = fails(dir.path(), &command.split(' ').collect::<Vec<_>>());
        let says = ["is not empty", "which this command reads", "is no data set"];
        assert!(
            says.iter().any(|words| message.contains(words)) || message.contains("full"),
            "{message}"
        );
        assert_eq!(all_files(dir.path()), before, "{command}");
    }
}

#[test]
fn names_of_scenes_and_placements_stay_in_the_folder() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir_all(at("w/deep")).unwrap();
    let long = "x".repeat(400);
    let absolute = at("absolute").to_string_lossy().into_owned();
    let names = ["../../x", &absolute, "..", ".", "", "nul", "a\nb", &long, "a/b", "..\\x"];
    for name in names {
        let mut evil: Value = scene();
        evil["name"] = json!(name);
        fs::write(at("evil.json"), evil.to_string()).unwrap();
        let before = all_files(dir.path());
        let args = [
            "score",
            "../../evil.json",
            "../../scene.json",
            "../../placements.json",
            "--backend",
            "cpu",
            "--quiet",
            "--coverage-out",
            "cov",
        ];
        let output = sightline(&at("w/deep"), &args);
        let inside = at("w/deep/cov");
        let new = all_files(dir.path()).into_iter().filter(|file| !before.contains(file));
        let outside: Vec<PathBuf> =
            new.map(|(path, _)| path).filter(|path| !path.starts_with(&inside)).collect();
        assert!(outside.is_empty(), "{name:?}: {outside:?}");
        // An empty name is refused, all others are made harmless.
        assert!(output.status.success() || output.status.code() == Some(2), "{name:?}: {output:?}");
        let _ = fs::remove_dir_all(inside);
    }
    let pose = json!([{ "x": 0, "y": 0, "z": 2 }, { "x": 0, "y": 0.4, "z": 2 }]);
    let dots = json!({ "placements": [{ "name": "..", "lidars": pose }, { "name": ".", "lidars": pose }] });
    fs::write(at("dots.json"), dots.to_string()).unwrap();
    let before = all_files(dir.path());
    sightline(
        &at("w/deep"),
        &[
            "scan",
            "../../town.json",
            "--placement",
            "../../dots.json",
            "--out",
            "sets",
            "--backend",
            "cpu",
            "--frames",
            "1",
            "--quiet",
        ],
    );
    let new = all_files(dir.path()).into_iter().filter(|file| !before.contains(file));
    for (path, _) in new {
        assert!(path.starts_with(at("w/deep/sets")), "{path:?}");
    }
}

fn spawn(dir: &Path, args: &[&str]) -> Child {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sightline"));
    command.args(args).current_dir(dir).stdin(Stdio::null()).stdout(Stdio::null());
    command.stderr(Stdio::piped()).spawn().unwrap()
}

fn wait_for(what: impl Fn() -> bool) {
    let until = Instant::now() + Duration::from_secs(60);
    while !what() {
        assert!(Instant::now() < until, "waited for a minute");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn interrupt(child: &Child, signal: &str) {
    assert!(
        Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success()
    );
}

#[test]
fn scores_of_many_placements_go_on_where_they_stopped() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    let line =
        |k: u32| format!("{{\"name\":\"p{k}\",\"lidars\":[{{\"x\":0.5,\"y\":0.5,\"z\":0.5}}]}}\n");
    fs::write(at("many.jsonl"), (0..30_000).map(line).collect::<String>()).unwrap();
    let timings = |text: Vec<u8>| {
        let text = String::from_utf8(text).unwrap();
        text.split("\"timings\"").next().unwrap().to_owned()
    };
    for format in ["text", "json"] {
        let args =
            ["score", "scene.json", "many.jsonl", "--backend", "cpu", "--format", format, "--out"];
        let with = |more: &[&'static str]| [&args[..], more].concat();
        assert!(sightline(dir.path(), &with(&["whole"])).status.success());
        for signal in ["-INT", "-KILL", "-TERM"] {
            let mut child = spawn(dir.path(), &with(&["cut"]));
            let partial = at("cut.partial");
            wait_for(|| fs::metadata(&partial).is_ok_and(|meta| meta.len() > 2000));
            let second = fails(dir.path(), &with(&["cut", "--resume"]));
            assert!(
                second.contains("another run writes into it") || second.contains("already exists"),
                "{second}"
            );
            interrupt(&child, signal);
            let status = child.wait().unwrap();
            assert!(
                partial.exists() && !at("cut").exists(),
                "{signal}: ended before it was told to"
            );
            assert_eq!(status.code(), (signal != "-KILL").then_some(130), "{signal}");
            assert!(fails(dir.path(), &with(&["cut"])).contains("cut.partial: holds the scores"));
            let other = with(&["cut", "--resume", "--frames", "1"]);
            assert!(fails(dir.path(), &other).contains("was begun with other"));
            // A torn end, as a full disk leaves it.
            let mut bytes = fs::read(&partial).unwrap();
            bytes.extend_from_slice(b"{\"scored\":99999,\"bytes\":40,\"sha256\":\"");
            fs::write(&partial, bytes).unwrap();
            assert!(sightline(dir.path(), &with(&["cut", "--resume"])).status.success());
            assert!(!partial.exists());
            let (cut, whole) = (fs::read(at("cut")).unwrap(), fs::read(at("whole")).unwrap());
            assert!(timings(cut) == timings(whole), "{format} {signal}");
            fs::remove_file(at("cut")).unwrap();
        }
        fs::remove_file(at("whole")).unwrap();
    }
    assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
}

#[test]
fn of_two_scans_at_once_one_is_refused() {
    let dir = world();
    for _ in 0..10 {
        let args = [
            "scan",
            "town.json",
            "--placement",
            "p.json",
            "--backend",
            "cpu",
            "--threads",
            "1",
            "--out",
            "set",
            "--seed",
        ];
        let both = ["1", "2"].map(|seed| spawn(dir.path(), &[&args[..], &[seed]].concat()));
        let codes = both.map(|child| child.wait_with_output().unwrap().status.code());
        assert!(codes.contains(&Some(0)) && codes.contains(&Some(2)), "{codes:?}");
        fs::remove_dir_all(dir.path().join("set")).unwrap();
    }
}

#[test]
fn pipes_and_files_of_gigabytes_in_place_of_inputs_are_refused_at_once() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    assert!(Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
    fs::File::create(at("huge")).unwrap().set_len(1 << 42).unwrap();
    fs::create_dir_all(at("run")).unwrap();
    fs::create_dir_all(at("kitti")).unwrap();
    for (file, link) in [("pipe", "run/checkpoint.json"), ("pipe", "kitti/poses.txt")] {
        symlink(at(file), at(link)).unwrap();
    }
    for command in [
        "psog info FILE",
        "psog merge FILE FILE --out o",
        "psog build FILE --out o",
        "psog build --kitti kitti --out o",
        "sensor info FILE",
        "rig import FILE",
        "rig compare FILE p.json",
        "score FILE p.json",
        "score town.json p.json --vehicle FILE",
        "scene info FILE",
        "scan town.json --placement FILE --out o",
        "optimize --resume run",
        "optimize town.json --baselines FILE --out o",
        "view town.json FILE --out o.html",
        "cast town.json FILE",
    ] {
        for file in ["pipe", "huge", "/dev/zero"] {
            let words = command.replace("FILE", file);
            let mut child = spawn(dir.path(), &words.split(' ').collect::<Vec<_>>());
            let begin = Instant::now();
            while child.try_wait().unwrap().is_none() {
                if begin.elapsed() > Duration::from_secs(30) {
                    child.kill().unwrap();
                    panic!("{words}: still runs");
                }
                std::thread::sleep(Duration::from_millis(10));
            }
            assert_eq!(child.wait().unwrap().code(), Some(2), "{words}");
        }
    }
}

#[test]
fn the_command_on_the_page_gives_the_same_run() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir(at("a b's")).unwrap();
    for name in ["town.json", "m.obj", "p.json"] {
        fs::copy(at(name), at("a b's").join(name)).unwrap();
    }
    ok(
        dir.path(),
        &[
            "optimize",
            "a b's/town.json",
            "--backend",
            "cpu",
            "--evaluations",
            "24",
            "--seed",
            "7",
            "--baselines",
            "a b's/p.json",
            "--inject",
            "p.json",
            "--symmetric",
            "--fix",
            "roll=0",
            "--condition",
            "fog:mor=50",
            "--objective",
            "0.5*near_gain + 0.5*information_gain",
            "--out",
            "first",
        ],
    );
    let page = fs::read_to_string(at("first/report.html")).unwrap();
    let begin = page.find("<code>sightline").unwrap() + "<code>".len();
    let command = page[begin..].split("</code>").next().unwrap();
    let command = command
        .replace("&quot;", "\"")
        .replace("&lt;", "<")
        .replace("&gt;", ">")
        .replace("&amp;", "&");
    let command = command.replacen("sightline", env!("CARGO_BIN_EXE_sightline"), 1);
    // Pasted into a shell that stands elsewhere.
    let elsewhere = TempDir::new().unwrap();
    let run =
        Command::new("sh").args(["-c", &command]).current_dir(elsewhere.path()).output().unwrap();
    assert!(run.status.success(), "{command}: {run:?}");
    let folder = elsewhere.path().join("runs/town");
    for name in ["history.jsonl", "placements.json", "placement.svg", "map.svg"] {
        let (first, again) =
            (fs::read(at("first").join(name)).unwrap(), fs::read(folder.join(name)).unwrap());
        assert!(first == again, "{name} differs");
    }
    let result = |path: PathBuf| {
        let mut result: Value = serde_json::from_slice(&fs::read(path).unwrap()).unwrap();
        for key in ["timings", "peak_memory", "evaluations_per_second"] {
            result.as_object_mut().unwrap().remove(key);
        }
        result
    };
    let (first, again) = (result(at("first/result.json")), result(folder.join("result.json")));
    for (key, value) in first.as_object().unwrap() {
        let is_time = key == "rate"
            || key.contains("second")
            || key.contains("memory")
            || key.contains("time");
        assert!(is_time || value == &again[key], "{key}: {value} and {}", again[key]);
    }
}

/// Placements of the corridor, one a line.
fn many(dir: &Path, count: u32) {
    let line =
        |k: u32| format!("{{\"name\":\"p{k}\",\"lidars\":[{{\"x\":0.5,\"y\":0.5,\"z\":0.5}}]}}\n");
    fs::write(dir.join("many.jsonl"), (0..count).map(line).collect::<String>()).unwrap();
}

#[test]
fn a_hangup_ends_a_batch_unless_it_is_ignored() {
    let dir = corridor();
    many(dir.path(), 30_000);
    let partial = dir.path().join("cut.partial");
    for (before, code) in [("", 130), ("trap '' HUP; ", 0)] {
        let program = env!("CARGO_BIN_EXE_sightline");
        let words =
            format!("{before}exec {program} score scene.json many.jsonl --backend cpu --out cut");
        let mut child = Command::new("sh")
            .args(["-c", &words])
            .current_dir(dir.path())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        wait_for(|| fs::metadata(&partial).is_ok_and(|meta| meta.len() > 2000));
        interrupt(&child, "-HUP");
        assert_eq!(child.wait().unwrap().code(), Some(code), "{before}");
        assert_eq!((partial.exists(), dir.path().join("cut").exists()), (code > 0, code == 0));
        let _ = fs::remove_file(&partial);
    }
}

#[test]
fn a_batch_that_is_not_kept_says_how_far_it_came() {
    let dir = corridor();
    many(dir.path(), 30_000);
    let second = scene().to_string().replace("\"corridor\"", "\"second\"");
    fs::write(dir.path().join("second.json"), second).unwrap();
    for (files, all) in [
        (&["scene.json", "second.json", "many.jsonl"][..], " of 30000 placements"),
        (&["scene.json", "-"], " placements"),
    ] {
        let mut child = Command::new(env!("CARGO_BIN_EXE_sightline"))
            .arg("score")
            .args(files)
            .args(["--backend", "cpu", "--verbose", "--out", "cut"])
            .current_dir(dir.path())
            .stdin(fs::File::open(dir.path().join("many.jsonl")).unwrap())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        // The first sentence of the engine: scoring begins.
        let mut told = BufReader::new(child.stderr.take().unwrap());
        let mut words = String::new();
        while !words.contains("computing on cpu") {
            assert!(told.read_line(&mut words).unwrap() > 0, "{words}");
        }
        std::thread::sleep(Duration::from_millis(50));
        interrupt(&child, "-INT");
        told.read_to_string(&mut words).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(130), "{words}");
        let says = words.contains("interrupted after ") && words.contains(all);
        assert!(says && words.contains("cut is not written"), "{words}");
        assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
        assert!(!dir.path().join("cut").exists());
    }
}

#[test]
fn a_scan_ends_soon_within_a_long_frame_and_goes_on() {
    let dir = world();
    let town = fs::read_to_string(dir.path().join("town.json")).unwrap();
    let mut town: Value = serde_json::from_str(&town).unwrap();
    town["lidar"] =
        json!({ "channels": 128, "fov": [-20, 2], "azimuth_steps": 20_000, "range": 40 });
    fs::write(dir.path().join("dense.json"), town.to_string()).unwrap();
    let args =
        ["scan", "dense.json", "--placement", "p.json", "--backend", "cpu", "--threads", "1"];
    let mut child = spawn(dir.path(), &[&args[..], &["--out", "set"]].concat());
    wait_for(|| dir.path().join("set").exists());
    let start = Instant::now();
    interrupt(&child, "-TERM");
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert!(start.elapsed() < Duration::from_secs(4), "{:?}", start.elapsed());
    assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
}

#[test]
fn a_page_of_a_run_that_time_ended_says_so() {
    let dir = world();
    let args = ["optimize", "town.json", "--backend", "cpu"];
    let page = |folder: &str, limit: &[&str]| {
        ok(dir.path(), &[&args[..], &["--out", folder], limit].concat());
        fs::read_to_string(dir.path().join(folder).join("report.html")).unwrap()
    };
    let ended = page("ended", &["--max-seconds", "2", "--evaluations", "1000000"]);
    assert!(ended.contains(" --max-seconds 2") && ended.contains("Time ended this run"), "{ended}");
    let whole = page("whole", &["--max-seconds", "500", "--evaluations", "8"]);
    assert!(!whole.contains("--max-seconds") && whole.contains("They give the same bytes"));
}

#[test]
fn a_batch_that_was_killed_at_its_start_begins_anew() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    let args = ["score", "scene.json", "placements.json", "--backend", "cpu", "--out"];
    assert!(sightline(dir.path(), &[&args[..], &["whole"]].concat()).status.success());
    for begin in ["", "{\"sightline_part"] {
        fs::write(at("cut.partial"), begin).unwrap();
        let output = sightline(dir.path(), &[&args[..], &["cut", "--resume"]].concat());
        assert!(output.status.success(), "{output:?}");
        assert!(fs::read(at("cut")).unwrap() == fs::read(at("whole")).unwrap());
        assert!(!at("cut.partial").exists());
        fs::remove_file(at("cut")).unwrap();
    }
    fs::write(at("cut.partial"), "my notes").unwrap();
    let refused = fails(dir.path(), &[&args[..], &["cut", "--resume"]].concat());
    assert!(refused.contains("was begun with other"), "{refused}");
    assert_eq!(fs::read_to_string(at("cut.partial")).unwrap(), "my notes");
}
