//! `rig handover` of the folder of a run, and of a front.

use crate::cli::*;
use crate::cli_handover::folder;

/// A vehicle of some requirements, and a yard.
fn yard_with(require: Value) -> TempDir {
    let dir = folder();
    set_rules(&dir, require);
    let scene = json!({ "sightline": 1, "name": "yard", "coverage": "first-hit",
        "roi": { "min": [-10, -10, -0.5], "max": [10, 10, 3], "voxel": [0.5, 0.5, 0.5] },
        "static": [{ "class": "road", "plane": { "min": [-99, -99], "max": [99, 99], "z": 0 } },
                   { "class": "building", "box": { "foot": [8, 0, 0], "size": [1, 6, 2.5] } }],
        "ego": { "poses": [{ "x": 0, "y": 0, "z": 0 }, { "x": 1, "y": 0, "z": 0 }] },
        // A vehicle of its own, in whose place the run has another.
        "lidar": { "channels": 4, "fov": [-20, 0], "azimuth_steps": 90, "range": 40 },
        "mount": { "min": [-1, -0.5, 2], "max": [1, 0.5, 2.2], "lidars": 2 } });
    write(&dir, "yard.json", &scene);
    dir
}

const SEARCH: &str =
    "optimize yard.json --vehicle cart.json --evaluations 10 --backend cpu --out runs/yard";

/// A run in a yard: its folder, beside a vehicle and a scene.
fn run_folder() -> TempDir {
    let car = json!({ "target": "car", "from": 30, "within": 30, "beams": 90, "share": 1 });
    let dir = yard_with(json!([car]));
    let (code, [text, said]) = ran(&dir, SEARCH);
    assert_eq!(code, Some(1), "{said}");
    // No sensor here puts 90 beams on a car at 30 m, on no pose: said before the search and in its result.
    assert!(!text.contains("\n\n\n"), "one empty line at a time: {text}");
    let words =
        "car at 30 m, 90 beams: even the best pose looked at on each mount meets it with at most ";
    said.says(&format!("OUT OF REACH: {words}"));
    text.says(&format!("Out of reach: {words}"));
    assert!(!text.contains("Next, since") && !text.contains("all checks passed"), "{text}");
    dir
}

#[test]
fn overlap_is_shared_and_not_seen_in_the_words_of_a_run() {
    // Two LiDARs at one place share all, until one of them is a little off.
    let dir = yard_with(json!([{ "name": "pairs", "overlap": 1 }]));
    let (_, [text, said]) = ran(&dir, SEARCH);
    assert!(text.contains(" % shared"), "{text}{said}");
    ok(&dir, "rig handover runs/yard --backend cpu --out a");
    let read = |path: &str| fs::read_to_string(dir.path().join(path)).unwrap();
    let found = read_json(dir.path().join("runs/yard/result.json"));
    let share = found["best"]["scores"]["requirements"][0]["found"].as_f64().unwrap();
    let words = format!("pairs: {:.1} % shared, 100.0 % required", (1e3 * share).floor() / 10.0);
    let told = read("a/README.txt");
    assert!(told.contains(&words), "{words}: {told}");
}

#[test]
fn the_folder_of_a_run_alone_brings_its_scene_and_vehicle() {
    let dir = run_folder();
    let (scene, rig) = ("yard.json", "runs/yard --vehicle cart.json");
    for (command, given, more) in [
        ("score", format!("{scene} {rig}"), "--format csv"),
        ("audit", format!("{scene} {rig}"), "--frames 1"),
        ("view", format!("{scene} {rig}"), "--out view.html --force"),
        ("study nearfield", format!("{scene} {rig}"), ""),
        ("study redundancy", format!("{scene} {rig}"), ""),
        ("study overlap", format!("{scene} {rig}"), ""),
        ("study tolerance", format!("{scene} {rig}"), "--steps 1"),
        ("study sweep", format!("{scene} {rig}"), "--of 0.x --from 0 --to 0.5 --values 2"),
        ("study loss", format!("{scene} {rig}"), "--out loss --force"),
        // A target stands on level ground: no scene is taken.
        ("study targets", rig.to_owned(), "--target car --distances 5 --bearings 0"),
    ] {
        let asked = |given: &str| ran(&dir, &format!("{command} {given} {more} --backend cpu"));
        let ((code, [alone, said]), (same, [whole, _])) = (asked("runs/yard"), asked(&given));
        assert_eq!((code, &alone), (same, &whole), "{command}: {said}");
        assert!(code.is_some_and(|code| code < 2), "{command}: {said}");
        said.says("runs/yard: the folder of a run alone; with ");
        assert_eq!(said.contains("yard.json, "), command != "study targets", "{command}: {said}");
        said.says("cart.json, as in the run");
        // The vehicle given is taken; commands that need a scene take the scene of the run.
        let (code, [_, said]) = asked("runs/yard:plain --vehicle cart.json");
        assert!(code.is_some_and(|code| code < 2), "{command}: {said}");
        let on_level = ["nearfield", "redundancy", "tolerance", "sweep", "targets"];
        let told = "yard.json, as in the run, and cart.json as given";
        let is_level = on_level.iter().any(|study| command == format!("study {study}"));
        assert_eq!(said.contains(told), !is_level, "{command}: {said}");
        let level = "cart.json is given without a scene, so that the ground is level; name ";
        assert_eq!(said.contains(level), is_level, "{command}: {said}");
    }
    // Files that are others now, and options of the run, are told.
    change(&dir, "yard.json", |scene| scene["name"] = json!("field"));
    change(&dir, "runs/yard/result.json", |result| {
        result["settings"]["conditions"] = json!(["fog:mor=50"]);
        result["settings"]["frames"] = json!(1);
    });
    let (_, [_, said]) = ran(&dir, "score runs/yard --backend cpu");
    said.says(
        "; the run was under fog:mor=50, which --condition gives here; the run looked at 1 frame",
    );
    said.says("yard.json is another file than its run began with");
    fails(&dir, "view runs/yard/placements.json --out a.html").says("give a scene, then a file");
}

#[test]
fn the_folder_of_a_run_stands_for_its_optimum() {
    let dir = run_folder();
    let ok = |line: &str| ok(&dir, line);
    ok("rig handover runs/yard --backend cpu --out a");
    ok(
        "rig handover runs/yard/placements.json:optimized --vehicle cart.json --backend cpu --out b",
    );
    let read = |path: &str| read_text(&dir, path);
    for file in ["poses.csv", "materials.csv"] {
        assert_eq!(read(&format!("a/{file}")), read(&format!("b/{file}")), "{file}");
    }
    // The line on a missed requirement says where it is missed, as the run does.
    read("a/README.txt")
        .says("\nNOT MET: car at 30 m, 90 beams: 0.0 % seen, 100.0 % required, missing at 30 m: ");
    // The drawing of a rig that misses a requirement says so, whether the run tells it or it is measured.
    for drawing in [read("a/drawing.svg"), read("b/drawing.svg")] {
        drawing.says(">NOT MET: car at 30 m, 90 beams: 0.0 % seen, 100.0 % required");
    }
    assert!(read("a/drawing.svg").contains("Found with seed 1 in the run yard"));
    // The folder of a run carries its result, its warnings and its command; a placement of a file has none.
    let mut result: Value = serde_json::from_str(&read("runs/yard/result.json")).unwrap();
    let verdict = result["verdict"].text();
    assert!(verdict.starts_with("The requirement is not met"), "{verdict}");
    let guards = result["best"]["scores"]["guards"].list().iter();
    let guards = guards.map(|guard| match guard.text() {
        sector if sector.starts_with("blind_sector: ") => sector.replace("blind_sector", "BLIND"),
        other => format!("Warning: {other}"),
    });
    let mut lines: Vec<String> = guards.map(|line| line + "\n").collect();
    lines.push(format!("Result: {verdict}\n"));
    // The command names files without the folders of this machine.
    let command = result["command"].text();
    let folder = format!("{}/", dir.path().canonicalize().unwrap().display());
    command.says(&folder);
    lines.push(format!("Repeat: {} --backend cpu\n", command.replace(&folder, "")));
    let [of_run, of_file] = ["a", "b"].map(|folder| read(&format!("{folder}/README.txt")));
    assert!(lines.iter().all(|line| of_run.contains(line)), "{of_run}");
    assert!(!lines.iter().any(|line| of_file.contains(line)), "{of_file}");
    // Its page has names as code, and no mark of it in a sentence.
    let page = read("runs/yard/report.html");
    let (_, body) = page.split_once("<body").unwrap();
    let mut sentences = body.split("</script>").flat_map(|part| {
        let (shown, _) = part.split_once("<script").unwrap_or((part, ""));
        shown.split("</pre>").map(|part| part.split_once("<pre").map_or(part, |of| of.0))
    });
    let left = sentences.find_map(|part| Some(part.split_once('`')?.1));
    assert_eq!(left.map(|words| words.chars().take(99).collect::<String>()), None);
    page.says("beams; lower <code>beams</code> or take a sensor of finer spacing");
    // Its scene, for another frame: the vehicle and the words are still those of the run.
    ok("rig handover yard.json runs/yard --frame 1 --backend cpu --out h");
    let in_scene = read("h/README.txt");
    assert!(lines.iter().all(|line| in_scene.contains(line)), "{in_scene}");
    in_scene.says("in frame 1 of yard");
    // In another scene the vehicle is that of the run, and the requirement is measured there.
    write(&dir, "other.json", &read("yard.json").replace("\"yard\"", "\"other\""));
    ok("rig handover other.json runs/yard --backend cpu --out i");
    let elsewhere = read("i/README.txt");
    assert!(!elsewhere.contains("Result: ") && elsewhere.contains("NOT MET: car"), "{elsewhere}");
    // A requirement that holds on paper only, and a LiDAR outside its mount, are no secret of the search.
    let requirement = &mut result["best"]["scores"]["requirements"][0];
    requirement["found"] = json!(1.0);
    requirement["holds_in"] = json!(0.9);
    write(&dir, "runs/yard/result.json", &result);
    ok("rig handover runs/yard --backend cpu --out d");
    result["best"]["scores"]["requirements"][0]["holds_in"] = json!(0.97);
    result["best"]["scores"]["requirements_hold_in"] = json!(0.94);
    write(&dir, "runs/yard/result.json", &result);
    ok("rig handover runs/yard --backend cpu --out f");
    let moved = read("p.json").replacen("0.25", "3.25", 1);
    fs::write(dir.path().join("moved.json"), moved).unwrap();
    ok("rig handover moved.json:rig --vehicle cart.json --backend cpu --out e");
    for (folder, words) in [
        ("d", "ON PAPER ONLY, met by 90 % of copies"),
        ("e", "RULE BROKEN: "),
        ("f", "all requirements: ON PAPER ONLY, met by 94 %"),
    ] {
        for file in ["README.txt", "drawing.svg"] {
            let text = read(&format!("{folder}/{file}"));
            assert!(text.contains(words), "{folder}/{file}: {text}");
        }
    }
    assert!(read("b/drawing.svg").contains("Placement of placements.json"));
    // Everywhere else, too: the folder is the result in its file of placements, with a name any of that file.
    let file = "runs/yard/placements.json";
    for (folder, named) in
        [("runs/yard", format!("{file}:optimized")), ("runs/yard:plain", format!("{file}:plain"))]
    {
        for command in [
            "score yard.json RIG --vehicle cart.json",
            "study targets RIG --vehicle cart.json",
            "study redundancy yard.json RIG --vehicle cart.json",
            "study nearfield yard.json RIG --vehicle cart.json",
        ] {
            let said = |rig: &str| {
                let line = command.replace("RIG", rig) + " --backend cpu --format csv";
                let (code, [text, told]) = ran(&dir, &line);
                assert!(code.is_some_and(|code| code < 2), "{line}: {told}");
                text
            };
            assert_eq!(said(folder), said(&named), "{command}");
        }
    }
    let run = |line: &str| {
        printed(&dir, line);
    };
    run("rig export runs/yard --vehicle cart.json --format urdf --out own.urdf");
    run(
        "rig export runs/yard/placements.json:optimized --vehicle cart.json --format urdf --out named.urdf",
    );
    assert_eq!(read("own.urdf"), read("named.urdf"));
    let same = ok("rig compare runs/yard runs/yard/placements.json:optimized");
    assert!(same["lidars"].list().iter().all(|of| of["moved"] == 0.0), "{same}");
    let view = "view yard.json runs/yard --vehicle cart.json --backend cpu --out view.html";
    let (code, [_, told]) = ran(&dir, view);
    assert_eq!(code, Some(1), "the requirement is not met: {told}");
    // A study of one placement names it in its record, and one of another does not go on with it.
    let study = |rig: &str| {
        format!(
            "study loss yard.json {rig} --vehicle cart.json --frames 1 --backend cpu --out lost"
        )
    };
    assert_eq!(ok(&study("runs/yard"))["rows"][0]["name"], "optimized");
    fails(&dir, &study("runs/yard:plain")).says("lost: holds a study of other settings");
    fails(&dir, "rig handover runs --out c")
        .says("runs: is a folder without result.json; give a file");
    fails(&dir, "rig handover yard.json p.json --out c")
        .says("`sightline rig handover yard.json p.json:rig`");
    // A vehicle that is another one now: its rules count, and the hand-over says so.
    let lower = read("cart.json").replace("1.7],", "1.6],").replace("2.4],", "1.65],");
    fs::write(dir.path().join("cart.json"), lower).unwrap();
    ok("rig handover runs/yard --backend cpu --out g");
    read("g/README.txt")
        .says("CHANGED SINCE THE RUN: ")
        .says("cart.json; rules")
        .says("RULE BROKEN: LiDAR ");
}

#[test]
fn two_of_a_model_on_a_mount_of_several_models_break_no_rule() {
    let dir = folder();
    change(&dir, "cart.json", |vehicle| {
        vehicle["mounts"][0]["sensors"] = json!(["turning", "side, narrow"]);
        vehicle["mounts"][0]["count"] = json!([0, 2]);
        vehicle.as_object_mut().unwrap().remove("require");
    });
    let roof = |x: f64| json!({ "x": x, "y": 0, "z": 2, "sensor": "turning" });
    for (name, xs, breaks) in [("two", &[-0.5, 0.5][..], false), ("three", &[-0.5, 0.0, 0.5], true)]
    {
        let lidars: Vec<_> = xs.iter().map(|x| roof(*x)).collect();
        write_rig(&dir, "rig.json", name, lidars);
        ok(&dir, &format!("rig handover rig.json --vehicle cart.json --backend cpu --out {name}"));
        let text = fs::read_to_string(dir.path().join(name).join("README.txt")).unwrap();
        assert_eq!(text.contains("RULE BROKEN: "), breaks, "{text}");
    }
}
