//! `require` of overlap from outside: the numbers of `study overlap`, words on LiDARs that are cut off, and what a search
//! makes of it.

use crate::cli::*;

/// Ground with a wall and a walker who moves, and a cart with one LiDAR on its roof and others at its edge.
fn yard(dir: &Path, require: Value) {
    let side = json!({ "channels": 24, "fov": [-50, -5], "azimuth": [-45, 45], "azimuth_steps": 60, "range": 30 });
    cart(dir, (side, [1.5, 1.7]), json!([0, 1]), require);
    yard_of(
        dir,
        json!([
        { "class": "road", "plane": { "min": [-50, -50], "max": [50, 50], "z": 0 } },
        { "class": "building", "box": { "min": [6, -8, 0], "max": [9, -3, 3] } }]),
    );
    let lidar = |sensor: &str, x: f64, y: f64, yaw: f64| json!({ "sensor": sensor, "x": x, "y": y, "z": 1.6, "yaw": yaw });
    let [left, back, ahead] = [
        lidar("side", 0.2, 0.8, 1.4),
        lidar("side", -1.9, -0.2, 3.0),
        lidar("side", 1.4, 0.3, 0.4),
    ];
    let mut roof = lidar("wide", 0.4, 0.1, 0.0);
    roof["z"] = json!(2.1);
    let placements = json!({ "placements": [
        { "name": "apart", "lidars": [ahead, back] }, { "name": "beside", "lidars": [ahead, left] },
        { "name": "three", "lidars": [ahead, left, back] },
        { "name": "four", "lidars": [roof, left, back, ahead] }, { "name": "one", "lidars": [left] } ] });
    write(dir, "rigs.json", &placements);
}

fn run(dir: &Path, command: &str, more: &str) -> Value {
    ok(dir, &(command, "yard.json rigs.json --backend cpu", more))
}

const SCORE: &str = "score --tolerance 0";

#[test]
fn required_overlap_has_the_number_of_the_study() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), json!([{ "overlap": 0.05 }, { "overlap": 0.6, "name": "close" }]));
    for weather in ["", "--condition fog:mor=15"] {
        let scores = run(dir.path(), SCORE, weather)["scores"].clone();
        let rules = |k: usize| scores[k]["requirements"].clone();
        assert_eq!(
            rules(4)[0],
            json!({ "name": "overlap of LiDARs", "required": 0.05, "found": 0.0, "met": false,
                "missing": "one LiDAR has nothing to share" })
        );
        // The study refuses a single LiDAR.
        change(&dir, "rigs.json", |rigs| {
            rigs["placements"].as_array_mut().unwrap().pop();
        });
        let rows = run(dir.path(), "study overlap", weather)["rows"].clone();
        for k in 0..4 {
            let up_to = &rows[k]["overlap_up_to"];
            assert_eq!([&rules(k)[0]["found"], &rules(k)[1]["found"]], [up_to; 2], "{k}");
            assert_eq!(rules(k)[0]["met"], up_to.as_f64() >= Some(0.05), "{k}");
        }
        let found = |k: usize| rules(k)[0]["found"].number();
        assert_eq!(found(0), 0.0, "the two look opposite ways");
        assert!(found(1) > 0.05 && found(3) > 0.05, "{} {}", found(1), found(3));
        yard(dir.path(), json!([{ "overlap": 0.05 }, { "overlap": 0.6, "name": "close" }]));
    }
}

#[test]
fn lidars_that_are_cut_off_are_named() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), json!([{ "overlap": 0.6 }]));
    let scores = run(dir.path(), SCORE, "")["scores"].clone();
    let missing = |k: usize| scores[k]["requirements"][0]["missing"].as_str().unwrap_or_default();
    assert_eq!(missing(0), "LiDAR 1 is cut off: shares nothing with any other");
    let row = &run_pairs(dir.path())["rows"][1]["overlap"][0][1];
    let shown = (1e3 * row.number()).floor() / 10.0;
    assert_eq!(missing(1), format!("LiDAR 1 is cut off: shares at most {shown:.1} % with LiDAR 0"));
    let text = stdout(&dir, "score yard.json rigs.json --backend cpu");
    let line = format!(
        "! NOT MET: overlap of LiDARs: {shown:.1} % shared, 60.0 % required, LiDAR 1 is cut off: "
    );
    text.says(&line);
}

/// The study of the rigs of two LiDARs or more.
fn run_pairs(dir: &Path) -> Value {
    change_as(dir, ["rigs.json", "pairs.json"], |rigs| {
        rigs["placements"].as_array_mut().unwrap().pop();
    });
    ok(dir, "study overlap yard.json pairs.json --backend cpu")
}

#[test]
fn without_any_one_the_least_that_is_left_counts() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), json!([{ "overlap": 0.9, "without_any_one": true }]));
    let all = run(dir.path(), SCORE, "")["scores"].clone();
    let rigs = read_json(dir.path().join("rigs.json"));
    let without = |lost: usize| {
        let mut lidars = rigs["placements"][3]["lidars"].list().clone();
        lidars.remove(lost);
        json!({ "name": format!("without-{lost}"), "lidars": lidars })
    };
    let one_less: Vec<Value> = (0..4).map(without).collect();
    write(&dir, "rigs.json", &json!({ "placements": one_less }));
    set_rules(&dir, json!([{ "overlap": 0.9 }]));
    let each = run(dir.path(), SCORE, "")["scores"].clone();
    let found = |scores: &Value, k: usize| scores[k]["requirements"][0]["found"].number();
    let lefts: Vec<f64> = (0..4).map(|k| found(&each, k)).collect();
    assert_eq!(found(&all, 3), lefts.iter().copied().fold(f64::INFINITY, f64::min), "{lefts:?}");
    assert!(lefts[1] > lefts[0], "the roof alone joins the others: {lefts:?}");
    assert_eq!(all[3]["requirements"][0]["worst_without"], 0, "{all}");
    assert_eq!(all[3]["requirements"][0]["name"], "overlap of LiDARs, any one LiDAR lost");
}

#[test]
fn over_several_scenes_the_mean_counts() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), json!([{ "overlap": 0.5 }]));
    change_as(&dir, ["yard.json", "walled.json"], |scene| {
        (scene["name"], scene["static"][1]["box"]) =
            (json!("walled"), json!({ "min": [2, -8, 0], "max": [2.5, 12, 3] }))
    });
    run_pairs(dir.path());
    let files = "yard.json walled.json pairs.json --backend cpu";
    let [scores, study] = [SCORE, "study overlap"].map(|command| ok(&dir, &(command, files)));
    let up_to = |row: usize| study["rows"][row]["overlap_up_to"].number();
    for k in [1, 3] {
        let found = scores["mean"][k]["requirements"][0]["found"].number();
        assert_eq!(found, 0.5 * (up_to(k) + up_to(4 + k)), "{k}");
    }
    assert_ne!(up_to(1), up_to(4 + 1), "the wall changes it");
}

#[test]
fn a_search_finds_a_rig_whose_lidars_share_enough() {
    let dir = TempDir::new().unwrap();
    let search = |out: &str, require: Value, count: Value| {
        yard(dir.path(), require);
        change(&dir, "cart.json", |vehicle| {
            let mut edge = vehicle["mounts"][1].clone();
            edge["count"] = count;
            vehicle["mounts"] = json!([edge]);
        });
        let args = "optimize yard.json --backend cpu --evaluations 12 --seed 2 --out";
        let (code, found, _) = answer(&dir, &format!("{args} {out}"));
        (code, found["best"]["scores"].clone())
    };
    let required = json!([{ "overlap": 0.7 }]);
    let (code, scores) = search("asked", required.clone(), json!(3));
    let found = &scores["requirements"][0];
    assert_eq!(code, Some(0), "{found}");
    assert!(found["met"] == true && found["holds_in"].as_f64().is_some(), "{found}");
    // Where one LiDAR would do, one alone does not: it shares nothing.
    let (code, scores) = search("few", required.clone(), json!([1, 3]));
    let best = read_json(dir.path().join("few/placements.json"));
    let lidars = best["placements"][0]["lidars"].list();
    assert!(code == Some(0) && lidars.len() > 1, "{scores} {best}");
    // Without the rule the LiDARs look apart.
    search("free", json!([]), json!(3));
    set_rules(&dir, required);
    let free = "score yard.json free/placements.json --backend cpu";
    let free = ok(&dir, &free)["scores"][0].clone();
    assert_eq!(free["requirements"][0]["met"], false, "{}", free["requirements"]);
}

#[test]
fn wrong_rules_on_overlap_are_named() {
    let dir = TempDir::new().unwrap();
    for (wrong, said) in [
        (json!({ "overlap": 0 }), "above 0 and at most 1"),
        (json!({ "overlap": -0.1 }), "above 0"),
        (json!({ "overlap": 500 }), "0.05 for example"),
        (json!({ "overlap": 0.1, "share": 0.5 }), "leave `share` out"),
        (json!({ "overlap": 0.1, "ground": 3 }), "write two rules"),
        (json!({ "overlap": 0.1, "target": "car" }), "`target`"),
        (json!({ "overlap": 0.1, "min": [0, 0, 0] }), "`min`"),
        (json!({ "overlap": "all" }), "overlap"),
        (json!({ "overlap": 0.1, "of": "voxels" }), "`of`"),
    ] {
        yard(dir.path(), json!([{ "ground": 1, "share": 0 }, wrong]));
        let error = fails(&dir, "score yard.json rigs.json --backend cpu");
        let is_placed = error.contains("cart.json") && error.contains("require[1]");
        assert!(is_placed && error.contains(said), "{wrong}: {error}");
    }
    yard(dir.path(), json!([{ "overlap": 0.1 }]));
    change(&dir, "yard.json", |through| through["coverage"] = json!("through"));
    fails(&dir, "score yard.json rigs.json --backend cpu")
        .says("`overlap of LiDARs`, and beams end at nothing");
}

#[test]
fn requirements_are_told_in_the_order_of_the_file() {
    let dir = TempDir::new().unwrap();
    let area = json!({ "name": "area", "min": [-5, -5, 0], "max": [5, 5, 0.5], "share": 0.01 });
    yard(
        dir.path(),
        json!([
            { "overlap": 0.01, "name": "e" }, { "ground": 3, "share": 0.02, "name": "d" }, area,
            { "target": "car", "within": 20, "share": 0.03, "name": "b" },
            { "blind_zone": "left", "depth": 2, "name": "a" }]),
    );
    let names = |required: &Value| -> Vec<String> {
        let all = required.list().iter();
        all.map(|rule| rule["name"].text().to_owned()).collect()
    };
    let scores = run(dir.path(), "score", "")["scores"].clone();
    assert_eq!(names(&scores[3]["requirements"]), ["e", "d", "area", "b", "a"]);
    // Each number goes with its name: alone, a rule finds the same.
    let alone = |rule_alone: Value| {
        set_rules(&dir, json!([rule_alone]));
        run(dir.path(), "score", "")["scores"][3]["requirements"][0].clone()
    };
    let all = read_json(dir.path().join("cart.json"));
    for k in 0..5 {
        let (told, one) = (&scores[3]["requirements"][k], alone(all["require"][k].clone()));
        assert_eq!(told, &one, "share, and copies that hold");
    }
    // An area without a voxel is told by its own place.
    let mut gone = all["require"].clone();
    (gone[2]["min"], gone[2]["max"]) = (json!([90, 90, 0]), json!([91, 91, 1]));
    set_rules(&dir, gone);
    fails(&dir, "score yard.json rigs.json --backend cpu")
        .says("require[2]: `area` holds no voxel");
}

#[test]
fn seats_are_said_to_be_too_few_to_share_or_to_lose_a_lidar() {
    let dir = TempDir::new().unwrap();
    let loss = json!({ "ground": 3, "share": 0.1, "without_any_one": true });
    let both = json!({ "name": "both", "overlap": 0.1, "without_any_one": true });
    for (mounts, on_last, hold) in [(1, 1, Some("one")), (2, 1, Some("two")), (2, 2, None)] {
        yard(dir.path(), json!([{ "overlap": 0.1 }, loss, both]));
        change(&dir, "cart.json", |vehicle| {
            vehicle["mounts"].as_array_mut().unwrap().truncate(mounts);
            vehicle["mounts"][mounts - 1]["count"] = json!([0, on_last]);
        });
        let told = stderr(&dir, "score yard.json rigs.json --backend cpu");
        for (place, takes, is_told) in [
            ("require[0].overlap", "two", hold == Some("one")),
            ("require[1].without_any_one", "two", hold == Some("one")),
            ("require[2].without_any_one", "three", hold.is_some()),
        ] {
            let hold = hold.unwrap_or("two");
            let words = format!("{place}: takes {takes} LiDARs, and the mounts hold {hold}; raise");
            assert_eq!(told.contains(&words), is_told, "{told}");
        }
    }
}
