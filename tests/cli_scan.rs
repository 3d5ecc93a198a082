//! `scan` on the command line: folders that are whole or go on, the same bytes, refusals.

use std::collections::BTreeMap;

use crate::cli::*;

/// A street with a house and a car that drives, and two placements.
pub(crate) fn street() -> TempDir {
    let dir = TempDir::new().unwrap();
    let scene = json!({
        "sightline": 1, "name": "street", "frames": 3, "rate": 10, "coverage": "first-hit",
        "roi": { "min": [-20, -20, -0.5], "max": [20, 20, 3.5], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 8, "fov": [-25, 5], "azimuth_steps": 60, "range": 60 },
        "mount": { "min": [-1, -1, 2], "max": [1, 1, 3], "lidars": 2 },
        "static": [
            { "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } },
            { "class": "building", "box": { "min": [12, -10, 0], "max": [14, 10, 6] } } ],
        "actors": [{ "name": "car", "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.2], "size": [4, 1.8, 1.4] } }],
                     "route": { "points": [[6, 4], [60, 4]], "spacing": 0.5 } }],
        "ego": { "route": { "points": [[0, 0], [60, 0]], "spacing": 0.5 } },
    });
    let lidar = |x: f64| json!({ "x": x, "y": 0.0, "z": 2.3 });
    let placements = json!({ "placements": [
        { "name": "one", "lidars": [lidar(0.0)] },
        { "name": "two", "lidars": [lidar(0.5), lidar(-0.5)] },
    ]});
    write(&dir, "s.json", &scene);
    write(&dir, "p.json", &placements);
    dir
}

/// Every file below a folder, with its bytes.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                found.insert(name, fs::read(&path).unwrap());
            }
        }
    }
    found
}

#[test]
fn a_folder_is_whole_the_same_on_any_threads_and_goes_on_where_it_was_left() {
    let dir = street();
    for layout in ["npz", "semantickitti", "nuscenes"] {
        let scan = |out: &str, threads: &str, more: &str| {
            let args = ["scan", "s.json", "--placement", "p.json:two", "--layout", layout];
            let rest = ["--out", out, "--threads", threads];
            ok(&dir, &(&args, &rest, more))
        };
        let (first, second) = (format!("{layout}-1"), format!("{layout}-2"));
        let summary = scan(&first, "1", "");
        let set = &summary["datasets"][0];
        assert_eq!((set["frames"].as_u64(), set["scenes"].as_u64()), (Some(3), Some(1)));
        assert!(set["points"].as_u64().unwrap() > 500, "{set}");
        let whole = files(&dir.path().join(&first));
        assert!(!whole.keys().any(|name| name.contains("INCOMPLETE")));
        scan(&second, "3", "");
        assert_eq!(whole, files(&dir.path().join(&second)), "{layout}: any number of threads");
        // A cloud that is missing is written again, and nothing else.
        let lost = whole.keys().find(|name| name.ends_with(".npz") || name.ends_with(".bin"));
        fs::remove_file(dir.path().join(&second).join(lost.unwrap())).unwrap();
        let again = scan(&second, "2", "");
        let points = |set: &Value, key: &str| set[key].as_u64().unwrap();
        assert!(points(&again["datasets"][0], "points_now") < points(set, "points"), "{again}");
        assert_eq!(whole, files(&dir.path().join(&second)), "{layout}: gone on with");
    }
}

#[test]
fn several_placements_have_a_folder_each_and_weather_changes_the_points() {
    let dir = street();
    ok(&dir, "scan s.json --placement p.json --out all");
    for name in ["one", "two"] {
        assert!(dir.path().join("all").join(name).join("dataset.json").is_file());
    }
    let points = |condition: &str| {
        let args = "scan s.json --placement p.json:one";
        let rest = ["--out", condition, "--condition", condition];
        let set = ok(&dir, &(args, &rest));
        set["datasets"][0]["points"].as_u64().unwrap()
    };
    assert!(points("fog:mor=15") < points("fog:mor=inf"));
    let score = |condition: &[&str]| {
        let args = ["score", "s.json", "p.json", "--backend", "cpu"];
        ok(&dir, &(&args, condition))["scores"][1]["covered"].number()
    };
    assert!(score(&["--condition", "fog:mor=10"]) < score(&[]));
    // Scores in bad weather say so, in text and in JSON.
    let wet = "score s.json p.json --backend cpu --condition wet:water=1";
    assert_eq!(ok(&dir, wet)["conditions"], json!(["wet:water=1"]));
    let text = stdout(&dir, wet);
    assert!(text.lines().next().unwrap().ends_with(" a LiDAR, under wet:water=1"), "{text}");
    assert!(ok(&dir, "score s.json p.json --backend cpu").get("conditions").is_none());
    let score = "score s.json p.json --backend cpu";
    stderr(&dir, &(score, "--condition blur")).says("blur: takes no beam away").says("fog:mor=inf");
    stderr(&dir, &(score, "--condition blur --condition wet:water=1"))
        .says("scores are those of the other conditions");
    // Beams that the sensor itself loses are lost in clear air, too.
    let scores = |condition: &str| ok(&dir, &(score, condition))["scores"].clone();
    let blurred = scores("--condition blur");
    assert_eq!(blurred, scores("--condition fog:mor=inf"));
    assert_ne!(blurred, scores(""));
}

#[test]
fn what_cannot_be_scanned_is_said_before_anything_is_written() {
    let dir = street();
    let named = read_text(&dir, "p.json").replace("\"two\"", "\"velodyne\"");
    fs::write(dir.path().join("v.json"), named).unwrap();
    let refused = |args: &str| {
        let error = fails(&dir, &("scan s.json", args));
        assert!(!dir.path().join("out").exists(), "{args}");
        error
    };
    for (more, words) in [
        ("--placement p.json:three --out out", "has no placement `three`; it has one, two"),
        ("--placement p.json --placement p.json:one --out out", "`one` comes twice"),
        (
            "--placement p.json:one --out out/velodyne --layout semantickitti",
            "has `velodyne` in its path",
        ),
        // The second of two would lie in a folder of that name.
        (
            "--placement v.json --out out --layout semantickitti",
            "out/velodyne: has `velodyne` in its path",
        ),
        ("--placement p.json:one --out out --layout nuscenes --map lamp", "write CLASS=CLASS"),
        (
            "--placement p.json:one --out out --map building=fence",
            "--map: is for --layout nuscenes and semantickitti, and this one is npz; leave it out",
        ),
        (
            "--placement p.json:one --out out --layout semantickitti --keyframe-every 2",
            "--keyframe-every: is for --layout nuscenes, and this one is semantickitti",
        ),
        (
            "--placement p.json:one --out out --layout nuscenes --map buildin=fence",
            "no scene has a class `buildin`; did you mean `building`?",
        ),
        (
            "--placement p.json:one --out out --condition fog:mor=-5",
            "`mor=-5` of fog: wanted is a number from",
        ),
        ("--placement p.json:one --out out --condition hail", "there is no condition `hail`"),
        ("--placement p.json:one --out out --layout kitti", "`kitti` is no layout"),
        (
            "--placement p.json:one --out out --ideal --condition fog:mor=50",
            "the condition `fog:mor=50` acts on beams, of which an ideal scan has the geometry alone;",
        ),
        (
            "--placement p.json:one --out out --layout nuscenes --map road=road --map road=fence",
            "the class `road` is mapped to `road` and to `fence`; map it once",
        ),
        (
            "--placement p.json:one --out out --splits 1e9 1 0",
            "splits 1000000000, 1, 0: take three shares from 0 to below 1e9 whose sum",
        ),
        (
            "--placement p.json:one --out out --layout nuscenes --keyframe-every 0",
            "invalid value '0' for '--keyframe-every <N>': 0 is not a whole number from 1 on",
        ),
        // A file on the way, and where the folders of two placements are to be.
        ("--placement p.json:one --out p.json/x/y", "sightline: p.json: is a file, and a data set"),
        ("--placement p.json --out s.json", "sightline: s.json: is a file, and a data"),
        (
            "--placement p.json:one --out p.json",
            "p.json: is a file, and a data set is a folder; name another place",
        ),
    ] {
        let error = refused(more);
        assert!(error.contains(words), "{more}: {error}");
    }
    #[cfg(target_os = "linux")]
    assert!(
        refused("--placement p.json:one --out /proc/xx")
            .starts_with("sightline: /proc/xx: cannot be written: No such")
    );
    fs::create_dir(dir.path().join("mine")).unwrap();
    write(&dir, "mine/thesis.txt", "all of it");
    fails(&dir, "scan s.json --placement p.json:one --out mine")
        .says("is not empty and holds no data set");
    ok(&dir, "scan s.json --placement p.json:one --out set");
    // The seed is 1 unless given, as in Python: the set is the same.
    ok(&dir, "scan s.json --placement p.json:one --out set --seed 1");
    fails(&dir, "scan s.json --placement p.json:one --out set --seed 7")
        .says("holds a data set of other settings (seed); name");
    for inner in ["set/inner", "set/street/deep/inner"] {
        fails(&dir, &["scan", "s.json", "--placement", "p.json:one", "--out", inner])
            .says(&format!("{inner}: lies in "))
            .says("set, the folder of another data set");
        assert!(!dir.path().join(inner).exists());
    }
    // Files that a killed run had begun go, by the number of its process.
    let mut ended = Command::new("true").spawn().unwrap();
    ended.wait().unwrap();
    let begun = format!("set/.sightline/.sightline-{}-AbCdEf.tmp", ended.id());
    fs::write(dir.path().join(&begun), "{").unwrap();
    fs::remove_file(dir.path().join("set/street/000001.npz")).unwrap();
    ok(&dir, "scan s.json --placement p.json:one --out set");
    assert!(!dir.path().join(&begun).exists());
    write(&dir, "set/dataset.json", "\n");
    fails(&dir, "scan s.json --placement p.json:one --out set")
        .says("dataset.json: cannot be read (EOF")
        .says("put it back as it was, or name another folder");
    let help = sightline(&dir, "scan --help");
    assert!(String::from_utf8_lossy(&help.stdout).contains("sightline scan scenes/highway.json"));
}

#[test]
fn a_folder_is_gone_on_with_only_with_the_same_files() {
    let dir = street();
    change(&dir, "s.json", |scene| {
        scene["static"][1] = json!({ "class": "building", "mesh": { "file": "house.obj" } })
    });
    write(&dir, "house.obj", "v 12 -9 0\nv 12 9 0\nv 12 0 6\nf 1 2 3\n");
    let args = |scene| ["scan", scene, "--placement", "p.json:one", "--out", "set"];
    ok(&dir, &args("s.json"));
    let frame = dir.path().join("set/street/000001.npz");
    let bytes = fs::read(&frame).unwrap();
    fs::remove_file(&frame).unwrap();
    for (name, from, to) in [("s.json", "\"z\":0", "\"z\":1"), ("house.obj", "6", "7")] {
        let path = dir.path().join(name);
        let before = fs::read_to_string(&path).unwrap();
        let after = before.replacen(from, to, 1);
        assert_ne!(before, after);
        fs::write(&path, after).unwrap();
        let error = fails(&dir, &args("s.json"));
        let words = format!("set: `{name}` has changed since this data set was begun; put it back");
        error.says(&words);
        assert!(!frame.exists());
        fs::write(&path, before).unwrap();
    }
    // Equal files by other paths.
    let away = dir.path().join("away");
    fs::create_dir(&away).unwrap();
    ok(&away, &["scan", "../s.json", "--placement", "../p.json:one", "--out", "../set"]);
    assert_eq!(fs::read(&frame).unwrap(), bytes);
}

#[test]
fn a_device_casts_to_the_same_bytes_and_is_named() {
    let dir = street();
    let scan = |out: &str, more: &str| {
        let args = "scan s.json --placement p.json --condition fog:mor=60";
        stderr(&dir, &(args, ["--out", out], more))
    };
    let by_device = scan("device", "--backend gpu");
    // For two placements, and once a run.
    assert_eq!(by_device.matches("casting on gpu: ").count(), 1, "{by_device}");
    scan("host", "--backend cpu");
    let [host, device] = ["host", "device"].map(|out| files(&dir.path().join(out)));
    assert!(host == device && host.len() > 6, "{:?}", host.keys());
    let wrong = "scan s.json --placement p.json --out x --adapter abacus";
    fails(&dir, wrong).says("no Vulkan device named `abacus`");
    fails(&dir, &(wrong, "--backend cpu")).says("--adapter abacus: picks a Vulkan device");
}
