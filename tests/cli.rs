//! The program driven as a user would, its errors compared with what a user needs.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use sightline::grid::{Psog, Roi, write_psog};
use tempfile::TempDir;

pub fn sightline(dir: &Path, args: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_sightline"))
        .args(args)
        .current_dir(dir)
        .stdin(Stdio::null())
        .output()
        .unwrap();
    assert!(!String::from_utf8_lossy(&output.stderr).contains("panicked"), "{output:?}");
    output
}

pub fn ok(dir: &Path, args: &[&str]) -> Value {
    let output = sightline(dir, args);
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{args:?}: {stderr}");
    serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{args:?}: {e}: {}", String::from_utf8_lossy(&output.stdout)))
}

/// stderr of a command that must end with exit code 2.
fn fails(dir: &Path, args: &[&str]) -> String {
    let output = sightline(dir, args);
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{args:?}: {stderr}");
    assert!(
        output.stdout.is_empty(),
        "{args:?} printed {}",
        String::from_utf8_lossy(&output.stdout)
    );
    stderr
}

/// A corridor of 10 × 2 × 1 voxels of a metre, seen along x by one beam; T = 4 frames of two classes.
///
/// Voxel (i, 0, 0) has index 2 i. Listed: index 4 (car in 1 of 4 frames), 6 (car in 2, pole in 1),
/// 7 (pole in 2: the other row, never covered), 12 (car in all four).
fn corridor() -> TempDir {
    let dir = TempDir::new().unwrap();
    let roi = Roi::new([0.0, 0.0, 0.0], [1.0; 3], [10, 2, 1]).unwrap();
    let counts = vec![1, 0, 2, 1, 0, 2, 4, 0];
    let classes = vec!["car".to_owned(), "pole".to_owned()];
    let psog = Psog::new(roi, 4, classes, vec![4, 6, 7, 12], counts).unwrap();
    write_psog(&dir.path().join("corridor.psog.npz"), &psog).unwrap();
    fs::write(dir.path().join("scene.json"), scene().to_string()).unwrap();
    let placements = json!({ "placements": [
        { "name": "ahead", "lidars": [{ "x": 0.5, "y": 0.5, "z": 0.5 }] },
        { "name": "twice", "lidars": [{ "x": 0.5, "y": 0.5, "z": 0.5 }, { "x": 0.5, "y": 0.5, "z": 0.5 }] },
        { "name": "away", "lidars": [{ "x": -1.0, "y": 0.5, "z": 0.5, "yaw": std::f64::consts::PI }] },
    ]});
    fs::write(dir.path().join("placements.json"), placements.to_string()).unwrap();
    dir
}

fn scene() -> Value {
    json!({
        "sightline": 1, "name": "corridor",
        "roi": { "min": [0, 0, 0], "max": [10, 2, 1], "voxel": [1, 1, 1] },
        "psog": { "file": "corridor.psog.npz" },
        "lidar": { "channels": 1, "fov": [0, 0], "azimuth_steps": 1, "range": 100 },
        "mount": { "min": [0.1, 0.1, 0.1], "max": [0.9, 1.9, 0.9], "roll": [0, 0],
                   "min_distance": 0.0, "lidars": 1 },
        "coverage": "through"
    })
}

#[test]
fn scores_of_a_corridor_worked_out_by_hand() {
    let dir = corridor();
    let p = |n: f64| if n == 0.0 { 0.0 } else { -(n / 4.0) * (n / 4.0).ln() };
    // Along the row: 10 voxels. H: {1, empty 3}, {2, 1, empty 1}, {4}. Bernoulli: 1/4, 3/4, 1.
    let gain = (p(1.0) + p(3.0)) + (p(2.0) + p(1.0) + p(1.0)) + 0.0;
    let bernoulli = 2.0 * (p(1.0) + p(3.0));
    let total = gain + p(2.0) + p(2.0);
    for backend in ["cpu", "gpu"] {
        let args =
            ["score", "scene.json", "placements.json", "--format", "json", "--backend", backend];
        let answer = ok(dir.path(), &args);
        assert_eq!(answer["scene"], "corridor");
        assert_eq!(answer["backend"], backend);
        assert_eq!(answer["coverage"], "through");
        assert_eq!(answer["frames"], 1);
        for key in ["load", "build", "cast", "cover", "reduce", "total"] {
            assert!(answer["timings"][key].as_f64().unwrap() >= 0.0, "{key}");
        }
        let ahead = &answer["scores"][0];
        assert_eq!(ahead["name"], "ahead");
        let close = |key: &str, want: f64| {
            let got = ahead[key].as_f64().unwrap();
            assert!((got - want).abs() <= 1e-6 * want.abs(), "{key}: {got} is not {want}");
        };
        close("information_gain", gain);
        close("entropy_sum", gain);
        close("information_gain_share", gain / total);
        close("m_sog", -gain / 10.0);
        close("m_sog_scaled", -gain / 100.0);
        close("s_mig", -bernoulli);
        assert_eq!((&ahead["covered"], &ahead["covered_nonzero"]), (&json!(10), &json!(3)));
        assert_eq!(ahead["covered_by_class"], json!({ "car": 3, "pole": 1 }));
        assert_eq!(ahead["beams"], 1);
        assert!(ahead["hit_share"].is_null());
        assert_eq!(ahead["guards"], json!([]));
        // The same pose twice covers the same, and each LiDAR is redundant.
        let twice = &answer["scores"][1];
        assert_eq!((&twice["covered"], &twice["beams"]), (&json!(10), &json!(2)));
        assert_eq!(twice["guards"].as_array().unwrap().len(), 2);
        // A placement that looks away covers nothing: no number, but a reason.
        let away = &answer["scores"][2];
        assert!(away["m_sog_scaled"].is_null() && away["information_gain"].is_null());
        assert!(away["guards"][0].as_str().unwrap().starts_with("covers_nothing"));
    }
}

#[test]
fn covered_voxels_are_written_as_numpy_arrays() {
    let dir = corridor();
    ok(dir.path(), &["score", "scene.json", "placements.json", "--coverage-out", "cover"]);
    let bytes = fs::read(dir.path().join("cover/ahead.npy")).unwrap();
    let covered: Vec<u64> = npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap();
    assert_eq!(covered, (0..10).map(|i| 2 * i).collect::<Vec<u64>>());
    let bytes = fs::read(dir.path().join("cover/away.npy")).unwrap();
    let covered: Vec<u64> = npyz::NpyFile::new(&bytes[..]).unwrap().into_vec().unwrap();
    assert!(covered.is_empty());
}

#[test]
fn a_stream_of_placements_gives_the_scores_of_a_document() {
    let dir = corridor();
    let lines: Vec<String> = (0..3000)
        .map(|i| {
            let y = 0.1 + 1.8 * f64::from(i) / 3000.0;
            json!({ "name": format!("p{i}"), "lidars": [{ "x": 0.2, "y": y, "z": 0.5 }] })
                .to_string()
        })
        .collect();
    fs::write(dir.path().join("many.jsonl"), lines.join("\n")).unwrap();
    let document = format!("{{\"placements\": [{}]}}", lines.join(","));
    fs::write(dir.path().join("many.json"), document).unwrap();
    let score = |file: &str| ok(dir.path(), &["score", "scene.json", file, "--backend", "cpu"]);
    let (stream, document) = (score("many.jsonl"), score("many.json"));
    assert_eq!(stream["scores"].as_array().unwrap().len(), 3000);
    assert_eq!(stream["scores"], document["scores"]);
    assert_eq!(stream["scores"][2999]["name"], "p2999");
}

/// Replaces one value of the scene by its JSON pointer and says what the program answers.
fn with_scene(pointer: &str, value: Value) -> String {
    let dir = corridor();
    let mut scene = scene();
    match scene.pointer_mut(pointer) {
        Some(slot) => *slot = value,
        None => {
            let (parent, key) = pointer.rsplit_once('/').unwrap();
            scene.pointer_mut(parent).unwrap()[key] = value;
        }
    }
    fs::write(dir.path().join("scene.json"), scene.to_string()).unwrap();
    fails(dir.path(), &["score", "scene.json", "placements.json", "--backend", "cpu"])
}

#[test]
fn a_bad_scene_is_answered_with_place_and_mend() {
    let cases: &[(&str, Value, &[&str])] = &[
        ("/roi/voxel/1", json!(0), &["scene.json", "voxel", "0"]),
        ("/roi/max/0", json!(0), &["scene.json", "roi"]),
        ("/lidar/channels", json!(0), &["scene.json", "channels"]),
        ("/lidar/azimuth_steps", json!(-3), &["scene.json", "azimuth_steps"]),
        ("/lidar/range", json!("far"), &["scene.json", "range"]),
        ("/mount/min/0", json!(500), &["scene.json", "mount"]),
        ("/mount/lidars", json!(0), &["scene.json", "lidars"]),
        ("/psog/file", json!("missing.npz"), &["missing.npz"]),
        ("/coverage", json!("sideways"), &["scene.json", "coverage", "through"]),
        ("/rio", json!(1), &["scene.json", "rio", "roi"]),
        ("/mount/min_distanse", json!(1), &["scene.json", "min_distanse", "min_distance"]),
        ("/sightline", json!(2), &["scene.json", "sightline"]),
        ("/roi/voxel", json!([0.5, 1, 1]), &["P-SOG", "roi"]),
    ];
    for (pointer, value, words) in cases {
        let answer = with_scene(pointer, value.clone());
        for word in *words {
            assert!(answer.contains(word), "{pointer}: `{answer}` lacks `{word}`");
        }
    }
}

#[test]
fn bad_placements_are_answered_with_their_name() {
    let dir = corridor();
    let lidar = json!({ "x": 0, "y": 0, "z": 1 });
    let cases: &[(Value, &[&str])] = &[
        (json!({ "placements": [] }), &["bad.json", "no placement"]),
        (
            json!({ "placements": [{ "name": "a", "lidars": [] }] }),
            &["bad.json", "`a`", "0 LiDARs"],
        ),
        (
            json!({ "placements": [{ "name": "a/b", "lidars": [lidar] }] }),
            &["bad.json", "`a/b`", "letters"],
        ),
        (
            json!({ "placements": [
                { "name": "a", "lidars": [lidar] }, { "name": "a", "lidars": [lidar] }] }),
            &["bad.json", "`a`", "twice"],
        ),
        (
            json!({ "placements": [{ "name": "a", "lidars": [{ "x": 1e300, "y": 0, "z": 1 }] }] }),
            &["bad.json", "`a`", "x = 1e300"],
        ),
        (json!({ "placement": [] }), &["bad.json", "placement", "placements"]),
        (
            json!({ "placements": [{ "name": "a", "lidars": [{ "x": 1, "y": 0 }] }] }),
            &["bad.json", "`z`"],
        ),
    ];
    for (text, words) in cases {
        fs::write(dir.path().join("bad.json"), text.to_string()).unwrap();
        let answer = fails(dir.path(), &["score", "scene.json", "bad.json", "--backend", "cpu"]);
        for word in *words {
            assert!(answer.contains(word), "{text}: `{answer}` lacks `{word}`");
        }
    }
    fs::write(
        dir.path().join("bad.jsonl"),
        "{\"name\":\"a\",\"lidars\":[{\"x\":0,\"y\":0,\"z\":0}]}\nnot json\n",
    )
    .unwrap();
    let answer = fails(dir.path(), &["score", "scene.json", "bad.jsonl", "--backend", "cpu"]);
    assert!(answer.contains("bad.jsonl, line 2"), "{answer}");
}

#[test]
fn wrong_arguments_and_places_are_answered_with_exit_code_2() {
    let dir = corridor();
    let score = ["score", "scene.json", "placements.json"];
    let with = |more: &[&'static str]| fails(dir.path(), &[&score[..], more].concat());
    assert!(with(&["--out", "no/such/folder/scores.json"]).contains("no/such/folder"));
    assert!(with(&["--out", "."]).contains("directory"));
    assert!(with(&["--backend", "abacus"]).contains("abacus"));
    assert!(with(&["--adapter", "no such device"]).contains("no such device"));
    assert!(with(&["--memory", "12 parsecs"]).contains("parsecs"));
    assert!(with(&["--memory", "16", "--backend", "cpu"]).contains("--memory"));
    assert!(
        fails(dir.path(), &["score", "nowhere.json", "placements.json"]).contains("nowhere.json")
    );
    let cast = fails(dir.path(), &["cast", "scene.json", "placements.json", "--out", "hits.npz"]);
    assert!(cast.contains("no geometry"), "{cast}");
    assert!(!dir.path().join("hits.npz").exists());
    let objective = ["optimize", "scene.json", "--out", "run", "--objective", "m_sag"];
    assert!(fails(dir.path(), &objective).contains("did you mean `m_sog`?"));
    assert!(fails(dir.path(), &["optimize", "--resume", "run"]).contains("checkpoint.json"));
    fs::write(dir.path().join("taken"), "a file").unwrap();
    assert!(fails(dir.path(), &["optimize", "scene.json", "--out", "taken"]).contains("taken"));
    // Nothing but the inputs is left behind.
    let mut names: Vec<_> = fs::read_dir(dir.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["corridor.psog.npz", "placements.json", "scene.json", "taken"]);
}

#[test]
fn devices_names_the_one_that_auto_takes() {
    let dir = TempDir::new().unwrap();
    let answer = ok(dir.path(), &["devices", "--format", "json"]);
    let devices = answer["devices"].as_array().unwrap();
    assert_eq!(devices.iter().filter(|d| d["auto"] == true).count(), 1, "{answer}");
    assert!(devices[0]["max_binding"].as_u64().unwrap() >= 128 << 20);
}

/// A room of 8 × 6 m with a pillar: a full-form scene small enough for many generations.
pub fn room(dir: &Path) -> PathBuf {
    let scene = json!({
        "sightline": 1, "name": "room",
        "roi": { "min": [-4, -3, 0], "max": [4, 3, 3], "voxel": [0.5, 0.5, 0.5] },
        "psog": { "scan": { "channels": 24, "fov": [-60, 40], "azimuth_steps": 120 } },
        "lidar": { "channels": 8, "fov": [-30, 10], "azimuth_steps": 60, "range": 20 },
        "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "roll": [-0.3, 0.3],
                   "min_distance": 0.2, "lidars": 2 },
        "coverage": "first-hit", "frames": 3,
        "static": [
            { "class": "ground", "plane": { "min": [-4, -3], "max": [4, 3], "z": 0.1 } },
            { "class": "wall", "box": { "center": [3.9, 0, 1.5], "size": [0.2, 6, 3] } },
            { "class": "wall", "box": { "center": [-3.9, 0, 1.5], "size": [0.2, 6, 3] } },
        ],
        "actors": [
            { "name": "walker", "parts": [
                { "class": "pedestrian", "box": { "center": [0, 0, 0.9], "size": [0.5, 0.5, 1.8] } }],
              "poses": [{ "x": 2, "y": -1 }, { "x": 2, "y": 0 }, { "x": 2, "y": 1 }] }
        ]
    });
    let path = dir.join("room.json");
    fs::write(&path, scene.to_string()).unwrap();
    path
}

#[test]
fn hits_of_a_room_are_where_its_walls_are() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    let placements = json!({ "placements": [
        { "name": "middle", "lidars": [{ "x": 0, "y": 0.75, "z": 1.5 }] }] });
    fs::write(dir.path().join("p.json"), placements.to_string()).unwrap();
    for backend in ["cpu", "gpu"] {
        let args = [
            "cast",
            "room.json",
            "p.json",
            "--frame",
            "1",
            "--out",
            "hits.npz",
            "--backend",
            backend,
        ];
        let answer = ok(dir.path(), &args);
        assert_eq!(answer["beams"], 480);
        let file = fs::File::open(dir.path().join("hits.npz")).unwrap();
        let mut npz = npyz::npz::NpzArchive::new(std::io::BufReader::new(file)).unwrap();
        let distance: Vec<f32> = npz.by_name("distance").unwrap().unwrap().into_vec().unwrap();
        let direction: Vec<f32> = npz.by_name("direction").unwrap().unwrap().into_vec().unwrap();
        let triangle: Vec<u32> = npz.by_name("triangle").unwrap().unwrap().into_vec().unwrap();
        let class: Vec<u16> = npz.by_name("class").unwrap().unwrap().into_vec().unwrap();
        let face_class: Vec<u16> = npz.by_name("face_class").unwrap().unwrap().into_vec().unwrap();
        let lidar: Vec<u16> = npz.by_name("lidar").unwrap().unwrap().into_vec().unwrap();
        assert_eq!((distance.len(), direction.len(), lidar.len()), (480, 1440, 480));
        // Channel 0 points 30° down: straight ahead it meets the ground, 1.4 m below, after 2.8 m.
        assert!((distance[0] - 2.8).abs() < 1e-5, "{}", distance[0]);
        // Channel 6 of 8 rises by 30/7°… the wall stands 3.8 m ahead and behind.
        let beam = 6 * 60;
        let up = (-30.0_f32 + 6.0 * 40.0 / 7.0).to_radians();
        assert!((distance[beam] - 3.8 / up.cos()).abs() < 1e-5, "{}", distance[beam]);
        assert!((distance[beam + 30] - 3.8 / up.cos()).abs() < 1e-5, "{}", distance[beam + 30]);
        // To the left the room is open.
        assert_eq!((distance[beam + 15], triangle[beam + 15]), (f32::INFINITY, u32::MAX));
        assert_eq!(class[beam], face_class[triangle[beam] as usize]);
    }
}

fn optimize_args<'a>(out: &'a str, evaluations: &'a str) -> Vec<&'a str> {
    let fixed = ["optimize", "room.json", "--backend", "cpu", "--seed", "5", "--frames", "2"];
    [&fixed[..], &["--out", out, "--evaluations", evaluations]].concat()
}

#[test]
fn optimize_writes_its_folder_and_repeats_itself() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    let first = ok(dir.path(), &optimize_args("first", "90"));
    let second =
        ok(dir.path(), &[&optimize_args("second", "90")[..], &["--threads", "1"]].concat());
    let gpu: Vec<&str> = optimize_args("third", "90")
        .into_iter()
        .map(|arg| if arg == "cpu" { "gpu" } else { arg })
        .collect();
    let third = ok(dir.path(), &gpu);
    for file in [
        "result.json",
        "history.jsonl",
        "checkpoint.json",
        "report.html",
        "convergence.svg",
        "placement.svg",
        "map.svg",
    ] {
        assert!(dir.path().join("first").join(file).exists(), "{file} is missing");
    }
    let history =
        |run: &str| fs::read_to_string(dir.path().join(run).join("history.jsonl")).unwrap();
    assert_eq!(history("first"), history("second"), "another number of threads");
    assert_eq!(history("first"), history("third"), "another backend");
    assert_eq!(first["best"], second["best"]);
    assert_eq!(first["best"], third["best"]);
    // The best so far never falls, and is the best of all generations.
    let records: Vec<Value> =
        history("first").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let numbers = |key: &str| records.iter().map(|r| r[key].as_f64().unwrap()).collect::<Vec<_>>();
    let (best, so_far) = (numbers("best"), numbers("best_so_far"));
    for k in 0..best.len() {
        let highest = best[..=k].iter().fold(f64::NEG_INFINITY, |m, b| m.max(*b));
        assert_eq!(so_far[k], highest, "generation {k}");
    }
    // The result keeps the rules and is at least as good as what it started from.
    assert_eq!(first["best"]["violations"], json!([]));
    let report = fs::read_to_string(dir.path().join("first/report.html")).unwrap();
    assert!(
        report.contains("<svg")
            && report.contains("optimized")
            && !report.contains("src=")
            && !report.contains("<link")
    );
    assert_eq!(first["baselines"].as_array().unwrap().len(), 11);
    let again = sightline(dir.path(), &optimize_args("first", "90"));
    assert_eq!(again.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&again.stderr).contains("--resume"));
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_goes_on_to_the_same_bytes() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    ok(dir.path(), &optimize_args("whole", "400"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_sightline"))
        .args(optimize_args("broken", "400"))
        .current_dir(dir.path())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let checkpoint = dir.path().join("broken/checkpoint.json");
    let start = Instant::now();
    while !checkpoint.exists() {
        assert!(start.elapsed() < Duration::from_secs(60), "no checkpoint was written");
        std::thread::sleep(Duration::from_millis(1));
    }
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().unwrap().success());
    let code = child.wait().unwrap().code();
    // Too late an interrupt would prove nothing; 400 evaluations leave room for it.
    assert_eq!(code, Some(130));
    let state: Value =
        serde_json::from_slice(&fs::read(dir.path().join("broken/result.json")).unwrap()).unwrap();
    assert_eq!(state["stopped"], "interrupted");
    assert!(state["evaluations"].as_u64().unwrap() < 400);
    let resumed = ok(dir.path(), &["optimize", "--resume", "broken", "--backend", "cpu"]);
    let read = |run: &str, file: &str| fs::read(dir.path().join(run).join(file)).unwrap();
    for file in ["history.jsonl", "checkpoint.json", "convergence.svg", "placement.svg", "map.svg"]
    {
        assert_eq!(read("whole", file), read("broken", file), "{file}");
    }
    let whole: Value = serde_json::from_slice(&read("whole", "result.json")).unwrap();
    assert_eq!(whole["best"], resumed["best"]);
}

/// A sequence of one frame with three points, in the SemanticKITTI layout.
fn sequence(dir: &Path) {
    let identity = "1 0 0 0 0 1 0 0 0 0 1 0";
    fs::create_dir_all(dir.join("seq/velodyne")).unwrap();
    fs::create_dir_all(dir.join("seq/labels")).unwrap();
    fs::write(dir.join("seq/poses.txt"), format!("{identity}\n")).unwrap();
    fs::write(dir.join("seq/calib.txt"), format!("Tr: {identity}\n")).unwrap();
    let points: [[f32; 4]; 3] =
        [[5.0, 0.0, -1.0, 0.5], [5.0, 1.0, -1.0, 0.5], [6.0, 0.0, -1.0, 0.5]];
    let bytes: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(dir.join("seq/velodyne/000000.bin"), bytes).unwrap();
    let labels: Vec<u8> = [10_u32, 40, 40].iter().flat_map(|l| l.to_le_bytes()).collect();
    fs::write(dir.join("seq/labels/000000.label"), labels).unwrap();
}

const BUILD: [&str; 16] = [
    "psog",
    "build",
    "--kitti",
    "seq",
    "--roi-min",
    "-8",
    "-8",
    "-1",
    "--roi-max",
    "8",
    "8",
    "3",
    "--voxel",
    "0.5",
    "0.5",
    "0.5",
];

#[test]
fn bad_labelled_frames_are_answered_with_file_and_count() {
    let dir = TempDir::new().unwrap();
    let build = [&BUILD[..], &["--out", "x.npz"]].concat();
    sequence(dir.path());
    assert_eq!(ok(dir.path(), &build)["occupied"], 3);
    fs::remove_file(dir.path().join("x.npz")).unwrap();
    let velodyne = dir.path().join("seq/velodyne/000000.bin");
    let labels = dir.path().join("seq/labels/000000.label");
    let answer = |words: &[&str]| {
        let answer = fails(dir.path(), &build);
        for word in words {
            assert!(answer.contains(word), "`{answer}` lacks `{word}`");
        }
        assert!(!dir.path().join("x.npz").exists());
        sequence(dir.path());
    };
    let bytes = fs::read(&velodyne).unwrap();
    fs::write(&velodyne, &bytes[..bytes.len() - 3]).unwrap();
    answer(&["000000.bin", "16"]);
    fs::write(&labels, 10_u32.to_le_bytes()).unwrap();
    answer(&["000000.label", "1", "3"]);
    fs::write(&labels, [7_u32, 40, 40].map(u32::to_le_bytes).concat()).unwrap();
    answer(&["000000.label", "7"]);
    let nan: Vec<u8> = bytes[..16]
        .iter()
        .copied()
        .chain(f32::NAN.to_le_bytes())
        .chain(bytes[20..].iter().copied())
        .collect();
    fs::write(&velodyne, nan).unwrap();
    answer(&["000000.bin", "1"]);
    fs::write(dir.path().join("seq/poses.txt"), "").unwrap();
    answer(&["poses.txt"]);
    fs::write(dir.path().join("seq/calib.txt"), "P0: 1\n").unwrap();
    answer(&["calib.txt", "Tr"]);
}

#[test]
fn bad_meshes_are_answered_with_file_and_element() {
    let cases = [
        ("bad.obj", "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n"),
        ("bad.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
        (
            "bad.ply",
            "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
             property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
             0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
        ),
        (
            "bad.ply",
            "ply\nformat ascii 1.0\nelement vertex 4000000000\nproperty float x\nend_header\n0\n",
        ),
        ("bad.glb", "glTF and then nothing"),
    ];
    for (file, text) in cases {
        let dir = TempDir::new().unwrap();
        let path = room(dir.path());
        let mut scene: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        scene["static"] = json!([{ "class": "wall", "mesh": { "file": file } }]);
        fs::write(&path, scene.to_string()).unwrap();
        fs::write(dir.path().join(file), text).unwrap();
        let answer = fails(dir.path(), &["optimize", "room.json", "--out", "run"]);
        assert!(answer.contains(file), "{answer}");
        assert!(!dir.path().join("run").exists(), "{file}: a folder was left behind");
    }
}

#[test]
fn a_damaged_psog_is_an_error() {
    let dir = corridor();
    let path = dir.path().join("corridor.psog.npz");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    let score = ["score", "scene.json", "placements.json"];
    let answer = fails(dir.path(), &score);
    assert!(answer.contains("corridor.psog.npz"), "{answer}");
    let answer = fails(dir.path(), &["psog", "info", "corridor.psog.npz"]);
    assert!(answer.contains("corridor.psog.npz"), "{answer}");
}

#[test]
fn verify_passes_on_a_room_and_says_what_it_compared() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    let args =
        ["verify", "room.json", "--frames", "2", "--random", "20", "--sample", "3000", "--json"];
    let answer = ok(dir.path(), &args);
    assert_eq!(answer["passed"], true, "{answer}");
    assert_eq!((&answer["placements"], &answer["frames"]), (&json!(81), &json!(2)));
    let found = &answer["gpu_against_cpu"];
    assert!(found["beams"].as_u64().unwrap() > 100_000, "{found}");
    assert!(found["voxels"].as_u64().unwrap() > 50_000, "{found}");
    for key in ["triangles", "distances", "differing_voxels", "differing_scores"] {
        assert_eq!(found[key], 0, "{key}");
    }
    assert_eq!(answer["cpu_against_f64"]["beams"], 3000);
    assert_eq!(answer["cpu_against_f64"]["unexplained"], 0);
}
