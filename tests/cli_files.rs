//! Files of the program: no output replaces an input, or without `--force` any file; names stay in their folder.

use std::os::unix::fs::symlink;

use crate::cli::*;
use crate::cli_interrupted::spawn;

/// A folder with a scene of a mesh and a sensor file, and everything else that commands read.
pub(crate) fn world() -> TempDir {
    let dir = corridor();
    let at = |name: &str| dir.path().join(name);
    fs::copy(at("corridor.psog.npz"), at("again.psog.npz")).unwrap();
    write(&dir, "m.obj", "v 4 -2 0\nv 4 2 0\nv 4 0 3\nv 6 0 3\nf 1 2 3\nf 2 3 4\n");
    let altitudes: Vec<f64> = (0..16).map(|k| 2.0 - f64::from(k)).collect();
    let sensor = json!({ "beam_altitude_angles": altitudes, "beam_azimuth_angles": vec![0.0; 16],
                         "lidar_mode": "512x10", "lidar_origin_to_beam_origin_mm": 0.0 });
    write(&dir, "ouster.json", &sensor);
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
    write(&dir, "town.json", &town);
    let second = town.to_string().replace("\"town\"", "\"town2\"");
    fs::write(at("town2.json"), second).unwrap();
    let lidars = json!([{ "x": 0, "y": 0, "z": 2 }, { "x": 0, "y": 0.4, "z": 2 }]);
    write_rig(&dir, "p.json", "p", lidars);
    dir
}

/// Every file below a folder with its bytes.
pub(crate) fn all_files(dir: &Path) -> Vec<(PathBuf, Vec<u8>)> {
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
    (
        "study sweep town.json p.json --of 0.z --from 1 --to 2 --values 2 --backend cpu --out",
        &["town.json", "m.obj", "p.json"],
    ),
    ("psog build town.json --out", &["town.json", "m.obj"]),
    ("psog merge corridor.psog.npz again.psog.npz --out", &["corridor.psog.npz"]),
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
            let cwd = format!("/proc/self/cwd/{input}");
            let root = format!("/proc/thread-self/root{absolute}");
            let around = format!("sub/../{input}");
            for out in [*input, "sub/link", "sub/hard", &around, &absolute, &cwd, &root] {
                for force in ["", "--force"] {
                    let words = format!("{command} {out} {force}");
                    let message = fails(&dir, &words);
                    // Or its ending is of another format than the command writes.
                    let says = ["already exists", "is read by this command", "give it the ending"];
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
    assert_eq!(tried, 14 * COMMANDS.iter().map(|(_, inputs)| inputs.len()).sum::<usize>());
    assert!(!all_files(dir.path()).iter().any(|(path, _)| is_litter(path)));
}

#[test]
fn an_input_that_the_shell_has_opened_is_no_output() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    let bytes = fs::read(at("p.json")).unwrap();
    for out in [
        "--out /dev/fd/3 3<p.json",
        "--out /dev/fd/3 3>>p.json",
        "--out /dev/stdout >>p.json",
        "--out /proc/self/fd/3 --force 3<>p.json",
        "--out /dev/stderr --force 2>>p.json",
    ] {
        let output = shell(&dir, "", &format!("score town.json p.json --backend cpu {out}"));
        assert_eq!(output.status.code(), Some(2), "{out}: {output:?}");
        let now = fs::read(at("p.json")).unwrap();
        // The sentence itself goes where the shell has sent stderr.
        assert!(now.starts_with(&bytes) && (now == bytes || out.contains("2>>")), "{out}");
        fs::write(at("p.json"), &bytes).unwrap();
    }
    // Pipes and a file that is stdout get the scores.
    for out in [
        "/dev/stdout >new",
        "/dev/stdout | cat >new",
        "/dev/fd/3 3>&1 | cat >new",
        "/dev/stderr 2>new",
    ] {
        let score = format!("score town.json p.json --backend cpu --quiet --out {out}");
        let output = shell(&dir, "", &score);
        assert!(output.status.success(), "{out}: {output:?}");
        assert!(fs::read_to_string(at("new")).unwrap().contains("near"), "{out}");
    }
}

#[test]
fn scores_so_far_replace_neither_an_input_nor_what_their_name_is_linked_to() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    let words = |placements: &str, more: &str| {
        format!("score town.json {placements} --backend cpu --out o.txt {more}")
    };
    let told = |command: String| fails(&dir, &command);
    let bytes = fs::read(at("p.json")).unwrap();
    let left = |name: &str| fs::read(at(name)).unwrap() == bytes;
    // The journal's name is that of an input, or of a hard link to one.
    fs::copy(at("p.json"), at("o.txt.partial")).unwrap();
    for more in ["--force", "--resume", ""] {
        let told = told(words("o.txt.partial", more));
        assert!(told.contains("is read by this command") && left("o.txt.partial"), "{told}");
    }
    fs::remove_file(at("o.txt.partial")).unwrap();
    fs::hard_link(at("p.json"), at("o.txt.partial")).unwrap();
    assert!(told(words("p.json", "--force")).contains("is read by this command") && left("p.json"));
    fs::remove_file(at("o.txt.partial")).unwrap();
    // A file of others, linked by a symbolic link or a hard one.
    fs::copy(at("p.json"), at("other.json")).unwrap();
    symlink(at("other.json"), at("o.txt.partial")).unwrap();
    for more in ["--force", "--resume"] {
        assert!(told(words("p.json", more)).contains("is not a plain file") && left("other.json"));
    }
    fs::remove_file(at("o.txt.partial")).unwrap();
    fs::hard_link(at("other.json"), at("o.txt.partial")).unwrap();
    ok_text(dir.path(), words("p.json", "--force").trim());
    assert!(left("other.json") && at("o.txt").is_file() && !at("o.txt.partial").exists());
}

#[test]
fn an_output_called_dash_is_refused_and_a_limit_of_sizes_is_an_error() {
    let dir = world();
    let before = all_files(dir.path());
    for command in [
        "score town.json p.json --out -",
        "score town.json p.json --coverage-out=-",
        "cast town.json p.json --gltf -",
        "psog build town.json --out - --force",
        "optimize town.json --out -",
    ] {
        fails(&dir, command).says(" -: no file is called `-`; give /dev/stdout");
    }
    for (limit, command) in [
        (0, "psog build town.json --out o.npz"),
        (1, "cast town.json p.json --backend cpu --out o"),
        (0, "score town.json p.json --backend cpu --out o"),
        (0, "optimize town.json --backend cpu --evaluations 4 --out run"),
    ] {
        // A pipe of stderr has no limit.
        let output = shell(&dir, &format!("ulimit -f {limit};"), command);
        let told = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{command}: {output:?}");
        assert!(told.contains("grows larger than the system lets a file be"), "{command}: {told}");
        // A search has begun its empty list of generations.
        let _ = fs::remove_file(dir.path().join("run/history.jsonl"));
        let _ = fs::remove_dir(dir.path().join("run"));
        assert!(all_files(dir.path()) == before, "{command}");
    }
}

/// Whether a file is one that was begun and not finished.
pub(crate) fn is_litter(path: &Path) -> bool {
    let name = path.file_name().unwrap().to_string_lossy();
    name.starts_with('.') || name.ends_with(".partial")
}

pub(crate) fn ok_text(dir: &Path, command: &str) {
    printed(dir, command);
}

#[test]
fn no_file_is_replaced_without_force_by_any_command() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    for (command, _) in COMMANDS.iter().filter(|(command, _)| !command.starts_with("rig import")) {
        write(&dir, "mine", "my own");
        let words = format!("{command} mine");
        fails(&dir, &words).says("mine: already exists; give --force");
        assert_eq!(fs::read(at("mine")).unwrap(), b"my own", "{command}");
        printed(&dir, &(words, "--force"));
        assert_ne!(fs::read(at("mine")).unwrap(), b"my own", "{command}");
    }
    // An optional second file, two outputs of one name, and files in shared folders.
    write(&dir, "mine.glb", "my own");
    for command in [
        "cast town.json p.json --backend cpu --gltf mine.glb",
        "optimize town.json --backend cpu --evaluations 4 --out run --gltf mine.glb",
        "scan town.json --placement p.json --backend cpu --out set --gltf mine.glb",
    ] {
        fails(&dir, command).says("mine.glb: already exists");
    }
    let twice = "cast town.json p.json --backend cpu --out both.glb --gltf ./both.glb";
    fails(&dir, twice).says("two outputs");
    ok_text(dir.path(), "man --out pages");
    fails(&dir, "man --out pages").says("already exists");
    ok_text(dir.path(), "man --out pages --force");
    ok_text(dir.path(), "score town.json p.json --backend cpu --coverage-out cov --quiet");
    let again = "score town.json p.json --backend cpu --coverage-out cov";
    fails(&dir, again).says("p.npy: already exists");
}

#[test]
fn folders_of_others_are_not_written_into() {
    let dir = world();
    let at = |name: &str| dir.path().join(name);
    fs::create_dir(at("full")).unwrap();
    for name in ["result.json", "table.csv", "chart.csv", "placements.json", "notes"] {
        write(at("full"), name, "my own");
    }
    let before = all_files(dir.path());
    for command in [
        "optimize town.json --backend cpu --evaluations 4 --out full",
        "optimize town.json --backend cpu --evaluations 4 --baselines p.json --out .",
        "study lidars town.json --backend cpu --evaluations 4 --out full",
        "chart town.json p.json --backend cpu --out full",
        "scan town.json --placement p.json --backend cpu --out full",
        "optimize town.json --backend cpu --evaluations 4 --baselines p.json --out . --force",
    ] {
        let message = fails(&dir, command);
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
        write(&dir, "evil.json", &evil);
        let before = all_files(dir.path());
        let args = "score ../../evil.json ../../scene.json ../../placements.json --backend cpu --quiet --coverage-out cov";
        let output = sightline(at("w/deep"), args);
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
    write(&dir, "dots.json", &dots);
    let before = all_files(dir.path());
    sightline(
        at("w/deep"),
        "scan ../../town.json --placement ../../dots.json --out sets --backend cpu --frames 1 --quiet",
    );
    let new = all_files(dir.path()).into_iter().filter(|file| !before.contains(file));
    for (path, _) in new {
        assert!(path.starts_with(at("w/deep/sets")), "{path:?}");
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
            let mut child = spawn(dir.path(), &words);
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
