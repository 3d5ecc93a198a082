//! Limits of the program: deadlines, interrupts at any moment, numbers without measure, checkpoints of others.

use sha2::{Digest, Sha256};

use crate::cli::*;

/// Time that an end may take on a busy machine.
const LATE: Duration = Duration::from_secs(20);

/// Many models on many mounts: far more to choose from than a second allows.
fn write_fleet(dir: &Path) {
    let sensors: Vec<Value> = (0..30)
        .map(|i| {
            json!({ "name": format!("s{i}"), "price": i + 1,
                "lidar": { "channels": 4, "fov": [-30, 10], "azimuth_steps": 60, "range": 50 } })
        })
        .collect();
    let mounts: Vec<Value> = (0..30)
        .map(|i| json!({ "name": format!("m{i}"), "min": [0.1, 0.1, 0.1], "max": [0.9, 1.9, 0.9], "count": [0, 4] }))
        .collect();
    write(dir, "fleet.json", &json!({ "sightline": 1, "sensors": sensors, "mounts": mounts }));
}

#[test]
fn time_ends_the_choice_of_sensors() {
    let dir = corridor();
    write_fleet(dir.path());
    let args = "optimize scene.json --vehicle fleet.json --budget 500";
    let more = "--objective information_gain --max-seconds 0.02 --backend cpu --out run";
    let start = Instant::now();
    let [text, told] = printed(&dir, &(args, more));
    assert!(start.elapsed() < LATE, "{:?}", start.elapsed());
    told.says("the time ended while the sensors were chosen");
    text.says("The time ended while the sensors were chosen (").says(" of 500 spent)");
    text.says("--resume and more time than the 0.02 s it had; poses").lacks("a --budget above");
    fails(&dir, "optimize scene.json --vehicle fleet.json --budget 1e300")
        .says("give a price up to 1e12, as 12000")
        .lacks("0000000");
    let result = read_json(dir.path().join("run/result.json"));
    assert!(result["stopped"].text().starts_with("time"), "{result}");
    // A resumed run goes on with the choice, not with what was taken in a hurry.
    let saved = read_json(dir.path().join("run/checkpoint.json"));
    assert!(saved["state"]["equipping"].is_object(), "{saved}");
    let (_, [_, told]) = ran(&dir, "optimize --resume run --max-seconds 0.02 --backend cpu");
    told.says("the run had not chosen its sensors: the poses to choose from are cast again");
}

#[test]
fn numbers_beyond_any_machine_are_refused() {
    let dir = corridor();
    let most = u64::MAX.to_string();
    for option in ["--random", "--hostile", "--sample"] {
        fails(&dir, &["verify", "scene.json", option, &most]).says(option).says("give at most");
    }
    let optimize = "optimize scene.json --backend cpu --out never";
    for (option, value) in [
        ("--delta", "1e-40"),
        ("--delta", "nan"),
        ("--max-seconds", "1e308"),
        ("--max-seconds", "-1"),
        ("--population", "0"),
        ("--evaluations", "0"),
        ("--evaluations", "-1"),
        ("--threads", "0"),
        ("--seed", "1.5"),
    ] {
        fails(&dir, &(optimize, [option, value]));
        assert!(!dir.path().join("never").exists(), "{option} {value} left a folder");
    }
}

/// Puts a value into a checkpoint, with the digest that belongs to it; false where it has no such place.
fn forge(run: &Path, whole: &Value, place: &str, value: &Value) -> bool {
    let mut state = whole["state"].clone();
    let Some(at) = state.pointer_mut(place) else { return false };
    *at = value.clone();
    let state = state.to_string();
    let digest: String = Sha256::digest(&state).iter().map(|byte| format!("{byte:02x}")).collect();
    let text = format!(
        r#"{{"checkpoint": {}, "command": "optimize", "digest": "{digest}", "inputs": {}, "state": {state}}}"#,
        whole["checkpoint"], whole["inputs"]
    );
    fs::write(run.join("checkpoint.json"), text).unwrap();
    true
}

#[test]
fn a_checkpoint_whose_numbers_do_not_belong_together_is_refused() {
    let dir = in_room();
    let args = "--evaluations 400 --max-seconds 0.05 --backend cpu --out run";
    sightline(&dir, &("optimize room.json", args));
    let run = dir.path().join("run");
    let whole = read_json(run.join("checkpoint.json"));
    let cma = "/run/generations/cma/running/cma";
    let changes = [
        ("/run/levels/at".to_owned(), json!(u64::MAX)),
        ("/run/levels/levels/0/0".to_owned(), json!(1_000_000)),
        ("/run/levels/errors".to_owned(), json!([])),
        (format!("{cma}/constants/mu"), json!(1_000_000)),
        (format!("{cma}/constants/population"), json!(1_u64 << 62)),
        (format!("{cma}/constants/n"), json!(0)),
        (format!("{cma}/constants/weights"), json!([])),
        (format!("{cma}/space/free/0"), json!(1_u64 << 53)),
        (format!("{cma}/space/bounds/0"), json!([1.0, 0.0])),
        (format!("{cma}/state/mean"), json!([[], 0, null])),
        (format!("{cma}/state/cov"), json!([[], 1_u64 << 33, 1_u64 << 33])),
        (format!("{cma}/state/generation"), json!(u64::MAX)),
        (format!("{cma}/min_std"), json!([0.1])),
        (format!("{cma}/progress/stride"), json!(0)),
        (format!("{cma}/progress/window"), json!(u64::MAX)),
        (format!("{cma}/waiting"), json!([[0.5]])),
        ("/run/generations/cma/first_population".to_owned(), json!(0)),
        ("/run/generations/evaluations".to_owned(), json!(u64::MAX)),
        ("/run/settings/population".to_owned(), json!(u64::MAX)),
        ("/run/settings/delta".to_owned(), json!({ "metres": 1e-40, "radians": 0.1 })),
    ];
    let mut forged = 0;
    for (place, value) in &changes {
        if forge(&run, &whole, place, value) {
            let told = fails(&dir, "optimize --resume run --backend cpu");
            told.says("checkpoint.json: ").says("; start a new run");
            forged += 1;
        }
    }
    assert!(forged > changes.len() - 4, "only {forged} places were there");
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_every_command_soon() {
    let dir = in_room();
    let commands = [
        "optimize room.json --evaluations 100000 --out o",
        "study lidars room.json --evaluations 5000 --out s",
        "chart room.json --placements 2000 --out c",
        "audit room.json",
        "near-field room.json --backend cpu",
        "psog build room.json --out p.npz",
        "view room.json --out v.html",
        "scene new --kind town --out t.json",
    ];
    for (number, command) in commands.into_iter().enumerate() {
        for wait in [5, 60, 400] {
            let mut child = begun(&dir, command);
            std::thread::sleep(Duration::from_millis(wait + 7 * number as u64));
            let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
            let start = Instant::now();
            let code = child.wait().unwrap().code();
            assert!(start.elapsed() < LATE, "{command:?} took {:?}", start.elapsed());
            // None: before the program listens, the system ends it. Others: it was done before.
            assert!(matches!(code, None | Some(0 | 1 | 2 | 130)), "{command:?}: {code:?}");
            for half in ["p.npz", "v.html", "t.json"] {
                let file = dir.path().join(half);
                assert!(!file.exists() || file.metadata().unwrap().len() > 0, "{half} is empty");
            }
            for folder in ["o", "s", "c"] {
                let _ = fs::remove_dir_all(dir.path().join(folder));
            }
        }
    }
}

#[test]
fn a_page_forbids_what_it_does_not_need() {
    let dir = in_room();
    ok(&dir, "optimize room.json --evaluations 30 --backend cpu --out run");
    let page = read_text(&dir, "run/report.html");
    let policy = page.find("Content-Security-Policy").expect("a policy");
    assert!(page[policy..].contains("default-src 'none'"));
    assert!(policy < page.find("<style").unwrap() && policy < page.find("<script").unwrap());
}

/// A scene so small that any of its commands is done at once.
fn closet(dir: &Path) {
    room(dir);
    change_as(dir, ["room.json", "closet.json"], |scene| {
        scene["name"] = json!("closet");
        scene["roi"]["voxel"] = json!([2, 2, 1]);
        scene["frames"] = json!(2);
        scene["actors"][0]["poses"].as_array_mut().unwrap().truncate(2);
        scene["lidar"]["azimuth_steps"] = json!(4);
        scene["psog"]["scan"]["azimuth_steps"] = json!(8);
    });
    let lidars = json!([
        { "x": 0.0, "y": 0.0, "z": 1.5 }, { "x": 0.5, "y": 0.0, "z": 1.5 }]);
    write_rig(dir, "placed.json", "a", lidars);
    let kitti = dir.join("kitti");
    for sub in ["velodyne", "labels"] {
        fs::create_dir_all(kitti.join(sub)).unwrap();
    }
    let point = [5.0_f32, 1.0, -1.7, 0.0].map(f32::to_le_bytes).concat();
    fs::write(kitti.join("velodyne/000000.bin"), point).unwrap();
    fs::write(kitti.join("labels/000000.label"), 40_u32.to_le_bytes()).unwrap();
    write(&kitti, "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
    write(&kitti, "calib.txt", "Tr: 0 -1 0 0 0 0 -1 -0.1 1 0 0 -0.2\n");
}

/// Runs a command that must end by itself within the time; its exit code and its words.
fn ends(dir: &Path, line: &str) -> (Option<i32>, String) {
    let errors = dir.join("errors.txt");
    let mut command = program(dir, line);
    let child = command.stdout(Stdio::null()).stderr(fs::File::create(&errors).unwrap()).spawn();
    let status = end_within(3 * LATE, child.unwrap(), line);
    (status.code(), fs::read_to_string(errors).unwrap())
}

/// Commands, and options of each; @ is where the number stands.
const OPTIONS: [(&str, &[&str]); 15] = [
    (
        "optimize closet.json --max-seconds 0 --method cma --backend cpu --out out",
        &[
            "--evaluations=@", "--target=@", "--population=@", "--frames=@", "--delta=@",
            "--delta=0.1,@", "--seed=@", "--threads=@", "--memory=@", "--fix=z=@", "--budget=@",
            "--condition=fog:mor=@",
        ],
    ),
    ("optimize closet.json --evaluations 4 --backend cpu --out out", &["--max-seconds=@"]),
    ("score closet.json placed.json --backend cpu", &["--frames=@", "--draw=@"]),
    ("cast closet.json placed.json --backend cpu", &["--frame=@"]),
    (
        "scan closet.json --placement placed.json --backend cpu --layout nuscenes --out out",
        &[
            "--seed=@",
            "--frames=@",
            "--keyframe-every=@",
            "--splits @ 1 1",
            "--condition=snow:rate=@",
        ],
    ),
    (
        "verify closet.json --backend cpu --random 1 --hostile 1 --sample 1",
        &["--frames=@", "--seed=@"],
    ),
    ("verify closet.json --backend cpu --hostile 1 --sample 1", &["--random=@"]),
    ("verify closet.json --backend cpu --random 1 --sample 1", &["--hostile=@"]),
    ("near-field closet.json --backend cpu", &["--frames=@"]),
    (
        "psog build --kitti kitti --out out",
        &[
            "--window=@", "--lidar-height=@", "--roi-min @ -10 -3", "--roi-max 40 @ 3",
            "--voxel @ @ @",
        ],
    ),
    ("rig export placed.json --scene closet.json --format urdf --out out", &["--base-link=@"]),
    ("scene new --triangles 1000 --out out.json", &["--frames=@", "--seed=@"]),
    ("scene new --frames 1 --out out.json", &["--triangles=@"]),
    (
        "chart closet.json --backend cpu --out out",
        &["--placements=2001", "--tolerance=1.5", "--finest=0"],
    ),
    (
        "study lidars closet.json --backend cpu --out out",
        &["--frames=0", "--random=100001", "--voxel=1e-40"],
    ),
];

/// Numbers that readers trip over.
const HOSTILE: [&str; 8] =
    ["0", "-1", "nan", "inf", "1e308", "1e-40", "18446744073709551615", "18446744073709551616"];

#[test]
fn every_number_of_every_command_is_taken_or_refused_in_a_sentence() {
    let dir = TempDir::new().unwrap();
    closet(dir.path());
    let mut refused = 0;
    for (command, options) in OPTIONS {
        for option in options {
            let values = if option.contains('@') { &HOSTILE[..] } else { &[""] };
            for value in values {
                let line = format!("{command} {}", option.replace('@', value));
                let (code, told) = ends(dir.path(), &line);
                assert!(matches!(code, Some(0..=2)), "{line}: {code:?}: {told}");
                assert!(!told.contains("panicked"), "{line}: {told}");
                if code == Some(2) {
                    let last = told.lines().last().unwrap_or_default();
                    assert!(last.starts_with("sightline: ") && last.len() < 600, "{line}: {told}");
                    refused += 1;
                }
                for left in ["out", "out.json", "out.ply"] {
                    let left = dir.path().join(left);
                    let _ = fs::remove_dir_all(&left).or_else(|_| fs::remove_file(&left));
                }
            }
        }
    }
    assert!(refused > 120, "{refused} refused");
}

#[test]
fn a_scan_of_more_beams_than_memory_holds_is_refused_before_it_is_taken() {
    let dir = TempDir::new().unwrap();
    closet(dir.path());
    change_as(&dir, ["closet.json", "dense.json"], |scene| {
        scene["lidar"] =
            json!({ "channels": 100, "fov": [-30, 10], "azimuth_steps": 100_000, "range": 20 });
        scene["mount"]["lidars"] = json!(16);
    });
    let lidars: Vec<Value> =
        (0..16).map(|k| json!({ "x": 0.0, "y": 0.0, "z": 1.2 + 0.03 * f64::from(k) })).collect();
    write_rig(&dir, "many.json", "all", lidars);
    let job = "scan dense.json --placement many.json --backend cpu --out out";
    let start = Instant::now();
    let output = shell(&dir, &format!("ulimit -c 0; ulimit -v {};", 6 << 20), job);
    let told = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{told}");
    told.says("the beams of a scan need").says("fewer");
    assert!(!dir.path().join("out").exists() && start.elapsed() < 3 * LATE, "{told}");
}

#[test]
fn a_mount_in_which_a_sensor_turns_any_way_is_searched_on_a_wider_grid() {
    let dir = TempDir::new().unwrap();
    let vehicle = json!({ "sightline": 1, "name": "free",
        "body": [{ "class": "vehicle", "box": { "min": [-1, -0.9, 0.3], "max": [3.5, 0.9, 0.9] } }],
        "sensors": [{ "name": "b", "price": 1,
            "lidar": { "channels": 8, "fov": [-25, 2], "azimuth_steps": 60, "range": 30 } }],
        "mounts": [{ "name": "m", "min": [-2, -1, 1], "max": [4, 1, 3.5], "roll": [-3.13, 3.13],
            "pitch": [-1.57, 1.57], "yaw": [-3.13, 3.13], "count": [1, 2] }] });
    write(&dir, "v.json", &vehicle);
    let scene = json!({ "sightline": 1, "name": "s", "vehicle": "v.json", "coverage": "first-hit",
        "roi": { "min": [-8, -8, -0.4], "max": [8, 8, 2], "voxel": [1, 1, 0.6] },
        "static": [{ "class": "road", "plane": { "min": [-40, -40], "max": [40, 40], "z": 0 } },
                   { "class": "wall", "box": { "min": [5, 3, 0], "max": [7, 4, 2] } }],
        "ego": { "poses": [{ "x": 0, "y": 0 }, { "x": 1, "y": 0 }] } });
    write(&dir, "s.json", &scene);
    let optimize = "optimize s.json --evaluations 10 --backend cpu --out";
    for command in [
        &format!("{optimize} run"),
        "study lidars s.json --evaluations 10 --backend cpu --out lidars",
        "study cost s.json --evaluations 10 --backend cpu --out cost",
    ] {
        printed(&dir, command);
    }
    let given = format!("{optimize} other --delta 0.1");
    fails(&dir, &given).says("sensor poses, at most").says("widen --delta");
}
