//! Commands over several scenes, as a user would give them.

use crate::cli::*;

/// Two rooms of one vehicle, and two placements: in the second room another walker goes about, on one side.
fn rooms() -> TempDir {
    let dir = in_room();
    let other = |scene: &mut Value| {
        scene["name"] = json!("hall");
        scene["frames"] = json!(4);
        scene["actors"][0]["poses"] =
            (0..4).map(|t| json!({ "x": f64::from(t) - 3.0, "y": 1.8 })).collect();
    };
    changed(dir.path(), "hall.json", other);
    let placements = json!({ "placements": [
        { "name": "middle", "lidars": [{ "x": 0, "y": 0.2, "z": 1.5 }, { "x": 0, "y": -0.2, "z": 1.5 }] },
        { "name": "sides", "lidars": [{ "x": 0.1, "y": 0.5, "z": 1.7, "roll": 0.2 },
                                      { "x": 0, "y": -0.5, "z": 1.3 }] }] });
    write(&dir, "p.json", &placements);
    dir
}

/// The room with something else in it.
fn changed(dir: &Path, name: &str, change: impl FnOnce(&mut Value)) {
    let mut scene = read_json(dir.join("room.json"));
    change(&mut scene);
    write(dir, name, &scene);
}

const CPU: &str = "--backend cpu";

#[test]
fn score_prints_each_scene_and_the_mean() {
    let dir = rooms();
    let score = |files: &[&str]| ok(&dir, &("score", files, CPU));
    // Placements may stand anywhere, and scenes of one name are told apart.
    let files = ["room.json", "p.json", "hall.json", "room.json"];
    let all = score(&files);
    stderr(&dir, &("score", &files, CPU))
        .says("room.json: is given twice and counts twice in means");
    let alone = ["room.json", "hall.json"].map(|scene| score(&[scene, "p.json"]));
    let scenes = all["scenes"].list();
    let names: Vec<&str> = scenes.iter().map(|s| s["scene"].text()).collect();
    assert_eq!(names, ["room", "hall", "room-2"]);
    for (scene, alone) in scenes.iter().zip([&alone[0], &alone[1], &alone[0]]) {
        assert_eq!(scene["scores"], alone["scores"]);
        let keys =
            |value: &Value| -> Vec<String> { value.as_object().unwrap().keys().cloned().collect() };
        let (mut ours, mut theirs) = (keys(scene), keys(alone));
        ours.sort();
        theirs.sort();
        assert_eq!(ours, theirs, "a scene is printed as it is alone");
    }
    for (index, mean) in all["mean"].list().iter().enumerate() {
        let share = |scores: &Value| scores["information_gain_share"].number();
        let want = scenes.iter().map(|s| share(&s["scores"][index])).sum::<f64>() / 3.0;
        assert!((share(mean) - want).abs() < 1e-9);
    }
    ok(&dir, &("score room.json hall.json p.json --coverage-out c", CPU));
    assert!(dir.path().join("c/hall/sides.npy").exists());
    // Several files of placements are scored together; a name that comes twice gets its file behind it on either side.
    fs::copy(dir.path().join("p.json"), dir.path().join("again.json")).unwrap();
    let once = ok(&dir, &("score room.json p.json", CPU));
    for scenes in ["room.json", "room.json hall.json"] {
        let all = ok(&dir, &format!("score {scenes} p.json again.json p.json:sides {CPU}"));
        let all = if scenes == "room.json" { &all } else { &all["scenes"][0] };
        let [once, all] = [&once, all].map(|of| of["scores"].list());
        assert_eq!(all.len(), 2 * once.len() + 1);
        let names: Vec<&str> = all.iter().map(|scores| scores["name"].text()).collect();
        let again = names.iter().position(|name| *name == "sides (again.json)").unwrap();
        let sides = names.iter().position(|name| *name == "sides (p.json)").unwrap();
        assert_eq!(all[again]["information_gain"], all[sides]["information_gain"]);
        assert_eq!(names[names.len() - 1], "sides (p.json, 2)", "{names:?}");
        assert!(!names.contains(&"sides"), "{names:?}");
    }
    let text = stdout(&dir, "score room.json hall.json p.json");
    for words in ["room: first-hit over 3", "hall: first-hit over 4", "mean of room, hall"] {
        text.says(words);
    }
}

#[test]
fn scenes_that_do_not_belong_together_are_refused_in_a_sentence() {
    let dir = rooms();
    changed(dir.path(), "dense.json", |scene| scene["lidar"]["channels"] = json!(9));
    changed(dir.path(), "high.json", |scene| scene["mount"]["max"][2] = json!(1.9));
    changed(dir.path(), "still.json", |scene| scene["actors"] = json!([]));
    for command in ["optimize", "score p.json"] {
        for (scene, words) in [
            ("dense.json", "dense.json: the scene `room-2` has another LiDAR than `room`"),
            ("high.json", "high.json: the scene `room-2` has another mount than `room`"),
            ("still.json", "still.json: the scene `room-2` has a P-SOG in which nothing"),
        ] {
            fails(&dir, &format!("{command} room.json {scene} {CPU}")).says(words);
        }
    }
    write(&dir, "q.jsonl", "");
    for (args, words) in [
        ("score p.json", "p.json: holds placements; give a scene"),
        ("score room.json", "room.json: is the only file"),
        ("score room.json p.json q.jsonl", "q.jsonl: holds no placement"),
        ("study loss room.json p.json q.jsonl", "both hold placements; give one"),
        ("study nearfield p.json q.jsonl", "p.json and q.jsonl: both hold placements"),
        (
            "study weather room.json q.jsonl p.json:a",
            "q.jsonl and p.json:a: both hold placements; give one such file",
        ),
        ("study nearfield p.json room.json", "p.json: is a file of placements, where a scene"),
        ("audit p.json", "p.json: holds placements; give a scene"),
        (
            "study overlap p.json",
            "`study targets`, `study tolerance` and `study sweep` take --vehicle FILE without a scene",
        ),
        (
            "scan room.json ./room.json --placement p.json --out d",
            "./room.json: is the same file as room.json, and a data set has each scene once",
        ),
        ("score room.json room.json", "room.json: is a scene; give a file of placements"),
        (
            "sensor info room.json",
            "room.json: is a scene, where the table of a sensor belongs; give it as SCENE",
        ),
        (
            "rig import room.json",
            "room.json: is a scene, where a rig of another program belongs; give it as SCENE",
        ),
    ] {
        let error = fails(&dir, args);
        assert!(error.contains(words), "{args}: {error}");
        assert!(!error.contains("counts twice"), "{args}: {error}");
    }
    // Other classes are no error: no score compares them.
    changed(dir.path(), "tree.json", |scene| {
        scene["classes"] = json!(["ground", "wall", "pedestrian", "hedge"]);
        scene["static"][1]["class"] = json!("hedge");
        scene["name"] = json!("garden");
    });
    stderr(&dir, "score room.json tree.json p.json")
        .says("garden: its classes are not those of room: it")
        .says("adds hedge");
}

#[test]
fn scenes_of_other_own_bodies_keep_them_and_are_told() {
    let dir = rooms();
    let body =
        json!([{ "class": "vehicle", "box": { "center": [0, 0, 0.6], "size": [2, 1, 0.5] } }]);
    changed(dir.path(), "van.json", |scene| scene["ego"] = json!({ "body": body }));
    for (scene, words) in [
        (
            "van.json",
            "van.json: its own body is not that of room.json; beams of each scene end at its own body",
        ),
        ("hall.json", ""),
    ] {
        let said = stderr(&dir, &["score", "room.json", scene, "p.json"]);
        let is_told = said.contains("its own body is not that of");
        assert!(said.contains(words) && is_told != words.is_empty(), "{said}");
    }
}

fn optimize(out: &str, more: &str) -> String {
    format!("optimize room.json hall.json --seed 3 --out {out} {CPU} {more}")
}

#[test]
fn optimize_shows_every_scene_and_says_whether_the_gain_is_more_than_chance() {
    let dir = rooms();
    let found = ok(&dir, &optimize("both", "--evaluations 60 --mirror --baselines p.json"));
    let scenes = found["scenes"].list();
    let names: Vec<&str> = scenes.iter().map(|s| s["name"].text()).collect();
    assert_eq!(names, ["room", "room mirrored", "hall", "hall mirrored"]);
    assert_eq!(found["frames"], 14);
    for scored in std::iter::once(&found["best"]).chain(found["baselines"].list()) {
        assert_eq!(scored["by_scene"].list().len(), 4);
    }
    assert_eq!(found["spread"]["scenes"], 2, "mirror images are no scenes of their own");
    assert_eq!(found["spread"]["resamples"], 10_000);
    let page = read_text(&dir, "both/report.html");
    let words = found["spread"]["words"].text();
    words.says("the scenes' own spread");
    assert!(page.contains("Scene by scene") && page.contains("hall mirrored"));
    assert_eq!(found["spread"]["gain"], "near_gain", "what the search makes large");
    assert!(words.starts_with("Over 2 scenes its near gain is ") && page.contains(words));
    assert!(dir.path().join("both/map-2.svg").exists());
    // One scene cannot say, and its result has no keys of several.
    let args = "optimize hall.json --out one --evaluations 30";
    let (_, [text, _]) = ran(&dir, &(args, "--baselines p.json", CPU));
    text.says("One scene only: give several to see whether");
    let one = read_json(dir.path().join("one/result.json"));
    assert!(["scenes", "spread"].iter().all(|key| one.get(key).is_none()));
    assert!(one["best"].get("by_scene").is_none() && one["settings"].get("mirror").is_none());
}

#[test]
fn a_run_over_scenes_that_was_interrupted_goes_on_to_the_same_bytes() {
    let dir = rooms();
    let more = "--evaluations 400 --mirror";
    ok(&dir, &optimize("whole", more));
    let mut child = begun(&dir, &optimize("broken", more));
    wait_for(|| dir.path().join("broken/checkpoint.json").exists());
    // Killed, not asked: what stands in the folder is all there is.
    child.kill().unwrap();
    child.wait().unwrap();
    let read = |run: &str, file: &str| fs::read(dir.path().join(run).join(file)).unwrap();
    let cut = read("broken", "checkpoint.json");
    assert_ne!(cut, read("whole", "checkpoint.json"), "killed too late");
    let resumed = ok(&dir, "optimize --resume broken --backend cpu");
    for file in ["history.jsonl", "checkpoint.json", "convergence.svg", "map.svg", "map-2.svg"] {
        assert_eq!(read("whole", file), read("broken", file), "{file}");
    }
    let whole: Value = serde_json::from_slice(&read("whole", "result.json")).unwrap();
    for key in ["best", "baselines", "spread", "certificate", "scenes"] {
        assert_eq!(whole[key], resumed[key], "{key}");
    }
    // Another second scene is another run.
    changed(dir.path(), "hall.json", |scene| scene["name"] = json!("hall"));
    fails(&dir, "optimize --resume broken --backend cpu").says("hall.json: has changed");
}

#[test]
fn audit_study_and_chart_go_from_scene_to_scene() {
    let dir = rooms();
    let (_, audit, _) = answer(&dir, "audit room.json hall.json p.json --backend cpu");
    let names: Vec<&str> = audit["scenes"].list().iter().map(|s| s["scene"].text()).collect();
    assert_eq!(names, ["room", "hall"]);
    assert!(audit["passed"].is_boolean());

    let study = ok(&dir, &("study height room.json hall.json --evaluations 24 --out study", CPU));
    let gain = |table: &Value| table["rows"][0]["values"][0].number();
    let scenes = study["scenes"].list();
    let mean = 0.5 * (gain(&scenes[0]) + gain(&scenes[1]));
    assert!((gain(&study["mean"]) - mean).abs() < 1e-12, "{study}");
    assert!(dir.path().join("study/hall/table.csv").exists());

    let chart = "chart room.json hall.json p.json --placements 4";
    let charts = ok(&dir, &(chart, "--out chart", CPU));
    assert_eq!(charts["scenes"][1]["scene"], "hall");
    assert_eq!(charts["scenes"][0]["placements"].list().len(), 6);
    assert!(dir.path().join("chart/room/chart.svg").exists());

    let printed = stdout(&dir, &(chart, "--quick --out quick --format csv", CPU));
    let read = |scene: &str| {
        fs::read_to_string(dir.path().join("quick").join(scene).join("chart.csv")).unwrap()
    };
    let behind = |scene: &str| -> String {
        read(scene).lines().skip(1).map(|line| format!("{scene},{line}\n")).collect()
    };
    let titles = format!("scene,{}\n", read("room").lines().next().unwrap());
    let wanted = titles + &behind("room") + &behind("hall");
    assert_eq!(printed, wanted);
}
