//! Wrong input, and whether the answer says what is wrong, where, and what to do.

use crate::cli::*;
use crate::cli_shared::yard;

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
    write(&dir, "scene.json", &scene);
    fails(&dir, "score scene.json placements.json --backend cpu")
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
        (
            "/psog/file",
            json!("missing.npz"),
            &["scene.json: psog.file: missing.npz: cannot be read: No such", "; give a P-SOG file"],
        ),
        ("/coverage", json!("sideways"), &["scene.json", "coverage", "through"]),
        ("/rio", json!(1), &["scene.json", "rio", "roi"]),
        ("/mount/min_distanse", json!(1), &["scene.json", "min_distanse", "min_distance"]),
        ("/sightline", json!(2), &["scene.json", "sightline"]),
        ("/roi/voxel", json!([0.5, 1, 1]), &["P-SOG", "roi"]),
        ("/detection", json!(["pole", "cat"]), &["scene.json", "detection[1]", "cat", "`car`"]),
    ];
    for (pointer, value, words) in cases {
        let answer = with_scene(pointer, value.clone());
        for word in words.iter() {
            answer.says(word);
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
            json!({ "placements": [{ "name": "a", "lidars": [{ "x": 1, "y": 0, "z": 1, "rol": 0 }] }] }),
            &["bad.json", "lidars[0]", "unknown key `rol`; did you mean `roll`?"],
        ),
        (
            json!({ "placements": [{ "name": "a", "lidars": [{ "x": 1, "y": 0 }] }] }),
            &["bad.json", "`z`"],
        ),
    ];
    for (text, words) in cases {
        write(&dir, "bad.json", &text);
        let answer = fails(&dir, "score scene.json bad.json --backend cpu");
        for word in words.iter() {
            answer.says(word);
        }
    }
    // NaN is no JSON; the answer still says where it stands.
    for text in ["NaN", "1e999", "-Infinity"] {
        let lidars = |z: &str| format!("[{{\"x\": 0, \"y\": 0, \"z\": {z}}}]");
        let text = format!(
            "{{\"placements\": [{{\"name\": \"good\", \"lidars\": {}}},\n \
             {{\"name\": \"sick\", \"lidars\": {}}}]}}",
            lidars("1"),
            lidars(text)
        );
        fs::write(dir.path().join("bad.json"), text).unwrap();
        fails(&dir, "score scene.json bad.json --backend cpu")
            .says("placement `sick`")
            .says("line 2");
    }
    write(&dir, "bad.jsonl", "{\"name\":\"a\",\"lidars\":[{\"x\":0,\"y\":0,\"z\":0}]}\nnot json\n");
    fails(&dir, "score scene.json bad.jsonl --backend cpu").says("bad.jsonl, line 2");
}

#[test]
fn a_file_that_is_neither_scene_nor_placements_is_told_before_any_work() {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    write(&dir, "typo.json", "{\"placement\": []}");
    write(&dir, "torn.json", "{ \"name\": \"x\", \"placements\": [");
    write(&dir, "other.json", "{ \"note\": 1, \"placements\": [] }");
    fs::create_dir(at("folder.json")).unwrap();
    let second = scene().to_string().replace("corridor\"", "second\"");
    fs::write(at("second.json"), second).unwrap();
    let files = [
        ("none.json", "none.json: cannot be read"),
        ("none.jsonl", "none.jsonl: cannot be read"),
        ("folder.json", "folder.json: cannot be read"),
        ("typo.json", "typo.json, line 1, column 12: placement: unknown key `placement`"),
        ("torn.json", "torn.json, line 1"),
        ("other.json", "other.json, line 1"),
    ];
    let before = crate::cli_files::all_files(dir.path());
    for (file, words) in files {
        for command in [
            "study loss scene.json FILE --backend cpu --out o",
            "study loss scene.json second.json FILE --backend cpu --out o",
            "study random scene.json FILE --backend cpu --random 2 --out o",
            "study height scene.json FILE --backend cpu --out o",
            "chart scene.json FILE --quick --backend cpu --out o",
            "audit scene.json FILE --backend cpu",
            "verify scene.json FILE",
            "score scene.json second.json FILE --backend cpu",
            "study targets scene.json FILE --backend cpu",
        ] {
            // Placements are no file of that study, so that its last file is a scene.
            if command.contains("height") && !file.starts_with("none") {
                continue;
            }
            let command = command.replace("FILE", file);
            fails(&dir, &command).says(words);
            assert_eq!(crate::cli_files::all_files(dir.path()), before, "{command}");
        }
    }
}

#[test]
fn wrong_arguments_and_places_are_answered_with_exit_code_2() {
    let dir = corridor();
    let score = ["score", "scene.json", "placements.json"];
    let with = |more: &[&'static str]| fails(&dir, &(&score, more));
    with(&["--out", "no/such/folder/scores.json"])
        .says("no/such/folder/scores.json: there is no folder no/such/folder; make it");
    with(&["--out", "."]).says("directory");
    #[cfg(target_os = "linux")]
    for command in [
        "score scene.json placements.json --backend cpu --out /proc/x",
        "score scene.json placements.json --backend cpu --coverage-out /proc/x",
        "optimize scene.json --backend cpu --out /proc/x",
        "scene new --kind street --seed 1 --out /proc/x",
    ] {
        fails(&dir, command).says("sightline: /proc/x: cannot be written: No such file");
    }
    let usage = with(&["--backend", "abacus"]);
    assert!(usage.starts_with("sightline: invalid value 'abacus' for '--backend"), "{usage}");
    assert!(
        usage.ends_with("[possible values: auto, gpu, cpu]; see `sightline score --help`\n"),
        "{usage}"
    );
    assert_eq!(usage.lines().count(), 1, "{usage}");
    fails(&dir, "scene new --triangles 10000000 --out large.json")
        .says("10000000 is not a whole number from 4000 to 9999000");
    with(&["--adapter", "no such device"]).says("no such device");
    fails(&dir, "verify scene.json --backend cpu")
        .says("--backend cpu: a Vulkan device is compared with the CPU");
    fails(&dir, &("verify scene.json --adapter", ["no such device"]))
        .says("named `no such device`")
        .lacks("--backend");
    with(&["--memory", "12 parsecs"]).says("parsecs");
    with(&["--memory", "16", "--backend", "cpu"]).says("--memory");
    fails(&dir, "score nowhere.json placements.json").says("nowhere.json");
    fails(&dir, "cast scene.json placements.json --out hits.npz").says("no geometry");
    assert!(!dir.path().join("hits.npz").exists());
    fails(&dir, "optimize scene.json --out run --objective m_sag").says("did you mean `m_sog`?");
    fails(&dir, "optimize --resume run").says("checkpoint.json");
    write(&dir, "taken", "a file");
    fails(&dir, "optimize scene.json --out taken").says("taken");
    // Nothing but the inputs is left behind.
    let mut names: Vec<_> = fs::read_dir(dir.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["corridor.psog.npz", "placements.json", "scene.json", "taken"]);
}

/// A sequence of one frame with three points, in the SemanticKITTI layout.
fn sequence(dir: &Path) {
    let identity = "1 0 0 0 0 1 0 0 0 0 1 0";
    fs::create_dir_all(dir.join("seq/velodyne")).unwrap();
    fs::create_dir_all(dir.join("seq/labels")).unwrap();
    write(dir, "seq/poses.txt", &format!("{identity}\n"));
    write(dir, "seq/calib.txt", &format!("Tr: {identity}\n"));
    let points: [[f32; 4]; 3] =
        [[5.0, 0.0, -1.0, 0.5], [5.0, 1.0, -1.0, 0.5], [6.0, 0.0, -1.0, 0.5]];
    let bytes: Vec<u8> = points.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(dir.join("seq/velodyne/000000.bin"), bytes).unwrap();
    let labels: Vec<u8> = [10_u32, 40, 40].iter().flat_map(|l| l.to_le_bytes()).collect();
    fs::write(dir.join("seq/labels/000000.label"), labels).unwrap();
}

#[test]
fn bad_labelled_frames_are_answered_with_file_and_count() {
    let dir = TempDir::new().unwrap();
    let region = "--roi-min -8 -8 -1 --roi-max 8 8 3 --voxel 0.5 0.5 0.5";
    let build = ("psog build --kitti seq --out x.npz", region);
    sequence(dir.path());
    assert_eq!(ok(&dir, &build)["occupied"], 3);
    fs::remove_file(dir.path().join("x.npz")).unwrap();
    let velodyne = dir.path().join("seq/velodyne/000000.bin");
    let labels = dir.path().join("seq/labels/000000.label");
    let answer = |words: &[&str]| {
        let answer = fails(&dir, &build);
        for word in words.iter() {
            answer.says(word);
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
    let nan = f32::NAN.to_le_bytes();
    fs::write(&velodyne, [&bytes[..16], &nan, &bytes[20..]].concat()).unwrap();
    answer(&["000000.bin", "1"]);
    write(&dir, "seq/poses.txt", "");
    answer(&["poses.txt"]);
    write(&dir, "seq/calib.txt", "P0: 1\n");
    answer(&["calib.txt", "Tr", "data_odometry_calib.zip", "Tr: 1 0 0 0 0 1 0"]);
}

#[test]
fn labelled_frames_need_neither_region_nor_voxel() {
    let dir = TempDir::new().unwrap();
    sequence(dir.path());
    let build = ["psog", "build", "--kitti", "seq", "--force", "--out", "x.npz"];
    let built = ok(&dir, &build);
    assert_eq!((&built["voxel"][2], &built["shape"]), (&json!(0.1), &json!([800, 800, 60])));
    assert_eq!((&built["min"], &built["occupied"]), (&json!([-40.0, -40.0, -0.5]), &json!(3)));
    let finer = ok(&dir, &(&build, "--voxel 0.2 0.2 0.3"));
    assert_eq!(finer["shape"], json!([400, 400, 20]));
    fails(&dir, "psog build x.json --voxel 1 1 1 --out x.npz").says("cannot be used with");
    let (_, [table, _]) = ran(&dir, "psog info x.npz");
    table.says("region      x -40 to 40, y -40 to 40, z -0.5 to 5.5 m\n");
    table.says("\n(empty)");
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
        let mut scene = read_json(&path);
        scene["static"] = json!([{ "class": "wall", "mesh": { "file": file } }]);
        fs::write(&path, scene.to_string()).unwrap();
        fs::write(dir.path().join(file), text).unwrap();
        fails(&dir, "optimize room.json --out run").says(file);
        assert!(!dir.path().join("run").exists(), "{file}: a folder was left behind");
    }
}

#[test]
fn scans_without_ground_in_the_region_are_said() {
    let dir = TempDir::new().unwrap();
    sequence(dir.path());
    let told = |more: &str| stderr(&dir, &("psog build --kitti seq --force --out x.npz", more));
    let guessed = told("");
    assert!(guessed.contains("1.73 m are taken") && guessed.lines().count() == 1, "{guessed}");
    assert_eq!(told("--lidar-height 1.73"), "");
    told("--lidar-height -3").says("no voxel of the region holds ground").says("--lidar-height");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_told_by_every_writer() {
    let dir = corridor();
    fs::copy(dir.path().join("corridor.psog.npz"), dir.path().join("other.psog.npz")).unwrap();
    for args in [
        "psog merge corridor.psog.npz other.psog.npz --out /dev/full",
        "score scene.json placements.json --backend cpu --out /dev/full",
    ] {
        let answer = fails(&dir, args);
        let last = answer.lines().last().unwrap();
        assert_eq!(
            last, "sightline: /dev/full: the disk is full; make room and run again",
            "{args}"
        );
    }
}

#[test]
fn a_psog_that_is_merged_twice_is_an_error() {
    let dir = corridor();
    let words = "psog merge corridor.psog.npz";
    for (again, is) in [("", "is given twice"), ("./", "is the same file as corridor.psog.npz")] {
        fails(&dir, &format!("{words} {again}corridor.psog.npz --out x.psog.npz"))
            .says(&format!("corridor.psog.npz: {is}, and its frames count once; leave it out"));
    }
    assert!(!dir.path().join("x.psog.npz").exists());
}

#[test]
fn a_damaged_psog_is_an_error() {
    let dir = corridor();
    let path = dir.path().join("corridor.psog.npz");
    let bytes = fs::read(&path).unwrap();
    fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    fails(&dir, "score scene.json placements.json").says("corridor.psog.npz");
    fails(&dir, "psog info corridor.psog.npz").says("corridor.psog.npz");
}

#[test]
fn what_cannot_be_done_is_told_before_the_work_and_leaves_nothing() {
    let dir = yard();
    let before = fs::read_dir(dir.path()).unwrap().count();
    let sweep = "study sweep yard.json rigs.json --backend cpu";
    for (line, words) in [
        (
            "study nearfield yard.json rigs.json --out near.png",
            "is written as SVG; give it the ending .svg",
        ),
        ("cast yard.json rigs.json --out hits.csv", "is written as NPZ; give it the ending .npz"),
        (&format!("{sweep} --of 0.z --from 1 --to 2 --out z.JSON"), "give it the ending .svg"),
        (
            &format!("{sweep} --of 0.z --from 1 --to 3200 --strict"),
            "z of 3200 is far from any vehicle",
        ),
        (
            &format!("{sweep} --of 0.pitch --from -0.1 --to 0.2 --strict"),
            "radians? 0.2 rad are 11.46°",
        ),
        (
            &format!("{sweep} --of 0.pitch --from 0 --to 3.14 --strict"),
            "radians? 3.14 rad are 179.91°",
        ),
        ("optimize yard.json --out run --adapter nowhere", "no Vulkan device named `nowhere`"),
        ("optimize yard.json --out run --delta 1e-9", "are possible; widen --delta"),
        (
            "optimize yard.json --out run --tolerance 1mm,6deg --strict",
            "1mm,6deg is more than mountings",
        ),
        (
            "optimize yard.json --front near_gain,m_sog_scaled --out run --tolerance 1mm,6deg --strict",
            "1mm,6deg is more than mountings",
        ),
    ] {
        fails(&dir, line).says(words);
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), before, "nothing is left");
}
