//! Rules of small vehicles, judged by a checker that shares no code with the program. Rigs that are found keep them.
//! Rules that contradict each other are refused before anything is written. `score` names each rule that a rig breaks.

use crate::cli::*;

/// A street of three frames, without a LiDAR of its own.
fn street() -> TempDir {
    let dir = TempDir::new().unwrap();
    let scene = json!({
        "sightline": 1,
        "roi": { "min": [-10, -10, -0.5], "max": [12, 10, 3.5], "voxel": [1, 1, 0.5] },
        "static": [
            { "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } },
            { "class": "building", "box": { "min": [6, 3, 0], "max": [9, 6, 3] } }],
        "actors": [{
            "parts": [{ "class": "vehicle", "box": { "min": [-2, -1, 0], "max": [2, 1, 1.5] } }],
            "route": { "points": [[-5, -5], [5, -5]], "start": 0, "spacing": 2 } }],
        "frames": 3 });
    write(&dir, "s.json", &scene);
    dir
}

fn roof(count: Value) -> Value {
    json!({ "name": "roof", "min": [-1, -0.8, 1.8], "max": [1, 0.8, 2.2], "count": count })
}

fn street_scene(dir: &Path) -> Value {
    read_json(dir.join("s.json"))
}

/// A vehicle file of two models, with further keys.
fn write_vehicle(dir: &Path, mounts: Value, more: Value) -> Value {
    let lidar = |channels| json!({ "channels": channels, "fov": [-25, 15], "azimuth_steps": 40, "range": 20 });
    let mut vehicle = json!({ "sightline": 1, "mounts": mounts, "sensors": [
        { "name": "A", "price": 10, "lidar": lidar(4) },
        { "name": "B", "price": 4, "lidar": lidar(2) }] });
    let keys = more.as_object().unwrap().clone();
    vehicle.as_object_mut().unwrap().extend(keys);
    write(dir, "v.json", &vehicle);
    vehicle
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or(0.0)
}

fn position(lidar: &Value) -> [f64; 3] {
    ["x", "y", "z"].map(|key| number(lidar, key))
}

fn corner(value: &Value, key: &str) -> [f64; 3] {
    [0, 1, 2].map(|k| value[key][k].number())
}

/// True if a LiDAR is the mirror image of another, or of itself.
fn is_image(a: &Value, b: &Value) -> bool {
    let turns = |key: &str| ["y", "roll", "yaw"].contains(&key);
    ["x", "y", "z", "roll", "pitch", "yaw"].iter().all(|key| {
        let sign = if turns(key) { -1.0 } else { 1.0 };
        (number(a, key) - sign * number(b, key)).abs() < 1e-6
    })
}

/// Rules of a vehicle whose mounts are boxes apart from each other that a rig breaks.
fn broken(vehicle: &Value, lidars: &[Value]) -> Vec<String> {
    let mut broken = Vec::new();
    let mounts = vehicle["mounts"].list();
    let mut on = vec![0; mounts.len()];
    for (i, lidar) in lidars.iter().enumerate() {
        let at = position(lidar);
        let is_in = |mount: &&Value| {
            let (low, high) = (corner(mount, "min"), corner(mount, "max"));
            (0..3).all(|k| low[k] - 1e-6 <= at[k] && at[k] <= high[k] + 1e-6)
        };
        match mounts.iter().position(|mount| is_in(&mount)) {
            None => broken.push(format!("{i} is beside the mounts")),
            Some(mount) => {
                on[mount] += 1;
                let models = mounts[mount]["sensors"].as_array();
                if models.is_some_and(|models| !models.contains(&lidar["sensor"])) {
                    broken.push(format!("{i} is of a wrong model"));
                }
            }
        }
        for out in vehicle["keep_out"].as_array().into_iter().flatten() {
            let (low, high) = (corner(out, "min"), corner(out, "max"));
            if (0..3).all(|k| low[k] + 1e-6 < at[k] && at[k] < high[k] - 1e-6) {
                broken.push(format!("{i} is kept out"));
            }
        }
        for (j, other) in lidars.iter().enumerate().skip(i + 1) {
            let far = (0..3).map(|k| (position(other)[k] - at[k]).powi(2)).sum::<f64>().sqrt();
            if far < number(vehicle, "min_distance") - 1e-6 {
                broken.push(format!("{i} and {j} are {far} m apart"));
            }
        }
        if vehicle["symmetric"] == true && !lidars.iter().any(|other| is_image(lidar, other)) {
            broken.push(format!("{i} has no mirror image"));
        }
        if vehicle["equal_height"] == true && (at[2] - position(&lidars[0])[2]).abs() > 1e-6 {
            broken.push(format!("{i} is at another height"));
        }
    }
    for (mount, on) in mounts.iter().zip(on) {
        let [least, most] = match &mount["count"] {
            Value::Array(range) => [0, 1].map(|k| range[k].as_u64().unwrap()),
            count => [count.as_u64().unwrap(); 2],
        };
        if !(least..=most).contains(&on) {
            broken.push(format!("{} holds {on}, not {least} to {most}", mount["name"]));
        }
    }
    broken
}

const OPTIMIZE: [&str; 11] = [
    "optimize", "s.json", "--vehicle", "v.json", "--evaluations", "10", "--backend", "cpu",
    "--tolerance", "0", "--out",
];

#[test]
fn every_rig_that_is_found_keeps_the_counts_and_the_rules() {
    let nose = json!({ "name": "nose", "min": [2, -0.6, 0.6], "max": [2.2, 0.6, 0.9], "count": [1, 2], "sensors": ["B"] });
    let point = json!({ "name": "mast", "min": [0, 0, 3], "max": [0, 0, 3], "count": 1 });
    let box_ = |low: [f64; 3], high: [f64; 3]| json!([{ "min": low, "max": high }]);
    let cases = [
        // Two corners of the roof are 2.592 m apart, and nothing else is.
        (json!([roof(json!(2))]), json!({ "min_distance": 2.5 })),
        (json!([roof(json!(4))]), json!({ "min_distance": 1.6 })),
        // 3 of 4 corners, one of them kept out: at the box's faces the room goes on.
        (
            json!([roof(json!(3))]),
            json!({ "min_distance": 1.6, "keep_out": box_([0.5, 0.5, 0.0], [2.0, 2.0, 3.0]) }),
        ),
        (
            json!([roof(json!([0, 2])), nose]),
            json!({ "min_distance": 1.0, "keep_out": box_([-2.0, -2.0, 1.0], [2.0, 2.0, 3.0]) }),
        ),
        (json!([roof(json!(2))]), json!({ "min_distance": 1.5, "symmetric": true })),
        // An odd one has no place in the plane, so that it comes with its image.
        (
            json!([roof(json!([1, 2]))]),
            json!({ "symmetric": true, "keep_out": box_([-2.0, -0.3, 0.0], [2.0, 0.3, 3.0]) }),
        ),
        (
            json!([roof(json!(3))]),
            json!({ "min_distance": 1.2, "symmetric": true, "equal_height": true }),
        ),
        (json!([roof(json!(2)), point, nose]), json!({ "min_distance": 0.9 })),
        (
            json!([roof(json!([0, 1])), roof(json!([0, 2]))]),
            json!({ "keep_out": box_([-0.5, -2.0, 0.0], [2.0, 2.0, 3.0]) }),
        ),
    ];
    for (number, (mut mounts, more)) in cases.into_iter().enumerate() {
        let dir = street();
        if number == 8 {
            // Higher, so that the two are apart.
            (mounts[1]["min"][2], mounts[1]["max"][2], mounts[1]["name"]) =
                (json!(2.5), json!(2.6), json!("rack"));
        }
        let vehicle = write_vehicle(dir.path(), mounts, more);
        for (out, more) in [("all", ""), ("least", "--budget 30")] {
            // Less money changes the rig where a number or a model is to be chosen.
            if out == "least" && ![3, 5].contains(&number) {
                continue;
            }
            let found = ok(&dir, &(OPTIMIZE, [out], more));
            let lidars = found["best"]["placement"]["lidars"].as_array().expect("a rig").clone();
            assert_eq!(broken(&vehicle, &lidars), [""; 0], "case {number}, {out}: {lidars:?}");
        }
    }
}

/// Vehicles whose rules leave no rig, and part of the sentence.
fn impossible() -> Vec<(Value, Value, &'static str)> {
    let small = |count| json!([{ "name": "m0", "min": [-0.6, -0.6, 1.6], "max": [0.6, 0.6, 2], "count": count }]);
    let over = json!([{ "min": [-2, -2, 0], "max": [2, 2, 3] }]);
    vec![
        (
            small(2),
            json!({ "keep_out": over }),
            "v.json: keep_out: list of 1 is not a choice that leaves room for a sensor: the boxes cover the whole mount `m0` (mounts[0]), which must hold 2; make them smaller",
        ),
        (
            json!([roof(json!([0, 2]))]),
            json!({ "keep_out": over }),
            "v.json: keep_out: list of 1 is not a choice that leaves room for a sensor: the boxes cover every mount",
        ),
        (
            small(2),
            json!({ "min_distance": 2 }),
            "v.json: min_distance: 2 is not a distance that 2 LiDARs on the mount `m0` (mounts[0]) can keep: it measures 1.744 m",
        ),
        // Neither by itself leaves no room; there is none for three at 1.5 m.
        (
            small(3),
            json!({ "min_distance": 1.5 }),
            "no placement of 3 LiDARs on `m0` was found that keeps its rules (at least 1.5 m apart); relax them",
        ),
    ]
}

#[test]
fn rules_that_leave_no_rig_are_refused_before_anything_is_written() {
    for (mounts, more, words) in impossible() {
        let dir = street();
        write_vehicle(dir.path(), mounts, more);
        for more in ["", "--budget 100", "--front price,near_gain"] {
            let told = fails(&dir, &(OPTIMIZE, "o", more));
            assert!(told.contains(words), "{more}: {told}\n  lacks {words}");
            assert!(!dir.path().join("o").exists(), "{more}: {told}");
        }
        for kind in ["cost", "channels", "random", "tasks", "height", "lidars"] {
            let args = format!("study {kind} s.json --vehicle v.json --evaluations 10 --random 5");
            let told = fails(&dir, &(&args, "--backend cpu --out o"));
            assert!(told.contains(words), "{kind}: {told}\n  lacks {words}");
            assert!(!dir.path().join("o").exists(), "{kind}: {told}");
        }
    }
}

#[test]
fn mirrored_pairs_need_a_wide_mount() {
    let mounts = json!([{ "name": "m0", "min": [-0.6, -0.6, 1.6], "max": [0.6, 0.6, 2], "count": 2, "sensors": ["A"] }]);
    for more in [
        json!({ "symmetric": true, "min_distance": 1.5 }),
        json!({ "symmetric": true, "equal_height": true, "min_distance": 1.5 }),
    ] {
        let dir = street();
        write_vehicle(dir.path(), mounts.clone(), more);
        fails(&dir, &(OPTIMIZE, "o"))
            .says("v.json: symmetric: true is not possible where y of the mount `m0` (mounts[0]) runs from -0.600 to 0.600");
        assert!(!dir.path().join("o").exists());
    }
}

#[test]
fn fewest_sensors_start_from_a_rig_by_the_rules() {
    let dir = street();
    let require = json!([{ "name": "all", "min": [-3, -3, 0], "max": [3, 3, 2], "share": 0.01 }]);
    let more = json!({ "min_distance": 2.5, "require": require });
    let vehicle = write_vehicle(dir.path(), json!([roof(json!([2, 4]))]), more);
    let found = ok(&dir, &(OPTIMIZE, "o --fewest"));
    let lidars = found["best"]["placement"]["lidars"].list().clone();
    assert_eq!((lidars.len(), broken(&vehicle, &lidars)), (2, vec![]));
}

/// Name and LiDARs of a rig, each at x, y and z and of a model.
type Rig<'a> = (&'a str, &'a [([f64; 3], &'a str)]);

/// A file of rigs.
fn write_rigs(dir: &Path, rigs: &[Rig]) {
    let lidar = |([x, y, z], sensor): &([f64; 3], &str)| json!({ "x": x, "y": y, "z": z, "sensor": sensor });
    let rig = |(name, lidars): &Rig| json!({ "name": name, "lidars": lidars.iter().map(lidar).collect::<Vec<_>>() });
    write(dir, "rigs.json", &json!({ "placements": rigs.iter().map(rig).collect::<Vec<_>>() }));
}

const SCORE: &str = "score s.json rigs.json --vehicle v.json --backend cpu --tolerance=0";

#[test]
fn a_rig_that_breaks_a_rule_is_told_so_in_text_json_and_csv() {
    let dir = street();
    let mut mount = roof(json!([1, 2]));
    mount["sensors"] = json!(["A"]);
    let more = json!({ "min_distance": 0.5, "keep_out": [{ "min": [-0.2, -0.2, 0], "max": [0.2, 0.2, 3] }] });
    let vehicle = write_vehicle(dir.path(), json!([mount]), more);
    let at = |x: f64| [x, 0.5, 2.0];
    let rigs: [(Rig, &[&str]); 5] = [
        (("good", &[(at(-0.5), "A"), (at(0.5), "A")]), &[]),
        (
            ("three", &[(at(-0.9), "A"), (at(0.0), "A"), (at(0.9), "A")]),
            &["there is no mount for one more `A`"],
        ),
        (
            ("other", &[(at(0.0), "B")]),
            &["LiDAR 0: there is no mount for one more `B`", "must hold 1 or more"],
        ),
        (("near", &[(at(0.0), "A"), (at(0.2), "A")]), &["LiDARs 0 and 1 are 0.300 m too close"]),
        (("kept", &[([0.0, 0.0, 2.0], "A")]), &["LiDAR 0 is 0.200 m inside of keep_out[0]"]),
    ];
    let named: Vec<Rig> = rigs.iter().map(|(rig, _)| *rig).collect();
    write_rigs(dir.path(), &named);
    let scores = ok(&dir, SCORE)["scores"].clone();
    let text = stdout(&dir, SCORE);
    let csv = stdout(&dir, &(SCORE, "--format csv"));
    let file = read_json(dir.path().join("rigs.json"));
    for (k, ((name, _), rules)) in rigs.iter().enumerate() {
        let found: Vec<&str> = scores[k]["broken_rules"]
            .as_array()
            .map_or(vec![], |all| all.iter().map(|rule| rule.text()).collect());
        let lidars = file["placements"][k]["lidars"].list();
        assert_eq!(found.is_empty(), broken(&vehicle, lidars).is_empty(), "{name}: {found:?}");
        assert_eq!(found.len(), rules.len(), "{name}: {found:?}");
        for rule in *rules {
            assert!(
                found.iter().any(|words| words.contains(rule)),
                "{name}: {found:?} lacks {rule}"
            );
        }
        for words in found {
            text.says(&format!("  ! RULE BROKEN: {words}\n"));
            csv.says(words);
        }
    }
    assert!(csv.lines().next().unwrap().ends_with(",broken_rules,price"), "{csv}");
    let prices: Vec<&str> =
        csv.lines().skip(1).map(|line| line.rsplit(',').next().unwrap()).collect();
    assert_eq!(prices, ["20", "30", "4", "20", "10"]);
    let several =
        stdout(&dir, &(SCORE.replace("s.json rigs", "s.json s.json rigs"), "--format csv"));
    assert_eq!(several.lines().filter(|line| line.ends_with(",30")).count(), 3, "{several}");
}

#[test]
fn scores_end_with_code_1_where_no_rig_meets_all_requirements() {
    let dir = street();
    let require = |share: f64| json!([{ "name": "near", "min": [-6, -6, 0], "max": [6, 6, 2], "share": share }]);
    let at: &[([f64; 3], &str)] = &[([0.0, 0.5, 2.0], "A")];
    // No LiDAR sees everything; two rigs see a thousandth.
    for (share, code) in [(1.0, 1), (0.001, 0)] {
        write_vehicle(
            dir.path(),
            json!([roof(json!([1, 2]))]),
            json!({ "require": require(share) }),
        );
        write_rigs(dir.path(), &[("one", at), ("two", at)]);
        for more in ["", "--format json", "--format csv", "--out scores.txt --force"] {
            let ended = sightline(&dir, &(SCORE, more));
            let told = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(code), "{more}: {told}");
            let words = "NOT MET: no placement of rigs.json meets all requirements";
            assert_eq!(told.contains(words), code == 1, "{told}");
        }
        let two = "score s.json s.json rigs.json --vehicle v.json --backend cpu";
        assert_eq!(sightline(&dir, two).status.code(), Some(code));
    }
}

#[test]
fn a_run_that_comes_to_an_error_leaves_no_folder() {
    let dir = street();
    // Beams of a centimetre above the region cover nothing: no candidate has a value.
    let mut scene = street_scene(dir.path());
    scene["lidar"] = json!({ "channels": 4, "fov": [-25, 15], "azimuth_steps": 40, "range": 20 });
    scene["mount"] = json!({ "min": [-1, -1, 3], "max": [1, 1, 3.2], "lidars": 2 });
    write(&dir, "seen.json", &scene);
    ok(&dir, "psog build seen.json --out q.npz");
    let mut blind = scene.clone();
    blind["psog"] = json!({ "file": "q.npz" });
    blind["lidar"]["range"] = json!(0.01);
    blind["mount"] = json!({ "min": [-1, -1, 5], "max": [1, 1, 5.2], "lidars": 2 });
    write(&dir, "blind.json", &blind);
    let args = "optimize blind.json --evaluations 10 --backend cpu";
    let more = "--objective m_sog_scaled --out deep/o";
    fails(&dir, &(args, more)).says("kept its rules, but none has a value of `m_sog_scaled`");
    assert!(!dir.path().join("deep").exists());
    // Beams that pass through everything have no echoes that weather could take.
    scene["coverage"] = json!("through");
    write(&dir, "through.json", &scene);
    let told = fails(&dir, "study weather through.json --backend cpu --evaluations 10 --out wx");
    assert!(!dir.path().join("wx").exists(), "{told}");
}

#[test]
fn a_tight_mount_of_a_scene_is_searched_or_refused_like_one_of_a_vehicle() {
    let dir = street();
    let mut scene = street_scene(dir.path());
    scene["lidar"] = json!({ "channels": 4, "fov": [-25, 15], "azimuth_steps": 40, "range": 20 });
    let mut write = |lidars: u64| {
        scene["mount"] = json!({ "min": [-1, -0.8, 1.8], "max": [1, 0.8, 2.2], "lidars": lidars, "min_distance": 2.5 });
        write(&dir, "tight.json", &scene);
    };
    let args = "optimize tight.json --evaluations 10 --backend cpu --out o";
    write(3);
    fails(&dir, args).says("tight.json: mount: no placement of 3 LiDARs on `mount` was found");
    assert!(!dir.path().join("o").exists());
    write(2);
    let found = ok(&dir, args);
    let lidars = found["best"]["placement"]["lidars"].list();
    let far =
        (0..3).map(|k| (position(&lidars[0])[k] - position(&lidars[1])[k]).powi(2)).sum::<f64>();
    assert!(far.sqrt() >= 2.5 - 1e-6, "{lidars:?}");
}

#[test]
fn a_scene_without_a_lidar_is_scanned_and_counted_with_a_vehicle() {
    let dir = street();
    write_vehicle(dir.path(), json!([roof(json!(2))]), json!({}));
    fails(&dir, "psog build s.json --out q.npz").says("lidar");
    let built = ok(&dir, "psog build s.json --vehicle v.json --out q.npz");
    assert_eq!(built["frames"], 3);
    let counted = ok(&dir, "scene info s.json --vehicle v.json");
    assert_eq!(counted[0]["frames"], 3);
}

#[test]
fn requirements_of_one_name_are_refused() {
    let dir = street();
    let area =
        |name: &str| json!({ "name": name, "min": [-6, -6, 0], "max": [6, 6, 2], "share": 0.5 });
    let car = |share: f64| json!({ "target": "car", "within": 20, "share": share });
    for (require, place) in [
        (
            json!([area("a"), area("b"), area("a")]),
            "v.json: require[2].name: `a` is not a name of its own, since require[0] has this one",
        ),
        // Names that nobody wrote are compared, too.
        (
            json!([car(0.5), area("a"), car(0.9)]),
            "v.json: require[2].name: `car from 5 to 20 m` is not a name of its own, since require[0]",
        ),
    ] {
        write_vehicle(dir.path(), json!([roof(json!(1))]), json!({ "require": require }));
        fails(&dir, &(OPTIMIZE, "o")).says(place);
    }
    // Requirements with other bearings have other names.
    let of = |bearing: [f64; 2]| json!({ "target": "car", "within": 20, "share": 0, "bearing": bearing });
    let all = [[-30.0, 30.0], [30.0, 90.0], [45.0, 45.0], [-180.0, 180.0]].map(of);
    write_vehicle(dir.path(), json!([roof(json!(1))]), json!({ "require": all }));
    let found = ok(&dir, &(OPTIMIZE, "o"));
    let names = [
        "car from 5 to 20 m, -30° to 30°",
        "car from 5 to 20 m, 30° to 90°",
        "car from 5 to 20 m, at 45°",
        "car from 5 to 20 m",
    ];
    for (k, name) in names.iter().enumerate() {
        assert_eq!(found["best"]["scores"]["requirements"][k]["name"], *name);
    }
}
