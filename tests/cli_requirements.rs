//! Requirements from outside: copies within the mounting tolerance, and the fewest sensors that meet them.

use sightline::job::{JobStep, Tolerance};
use sightline::{Event, Job, Scene, Settings};

use crate::cli::*;

/// A street whose vehicle may carry up to four LiDARs on a mast: `half` looks ±90° around its front, `narrow` ±30°.
fn street(dir: &Path, require: Value) {
    let model = |name: &str, price: u32, side: u32| {
        json!({ "name": name, "price": price, "lidar": { "channels": 32, "fov": [-24, 4],
            "azimuth": [-(side as i32), side], "azimuth_steps": 2 * side, "range": 60 } })
    };
    let vehicle = json!({ "sightline": 1, "name": "cart",
        "sensors": [model("half", 3, 90), model("narrow", 1, 30)],
        "mounts": [{ "name": "mast", "min": [-0.5, -0.5, 1], "max": [0.5, 0.5, 1.5], "yaw": [-3.15, 3.15],
            "sensors": ["half", "narrow"], "count": [0, 4] }], "require": require });
    write(dir, "cart.json", &vehicle);
    let scene = json!({ "sightline": 1, "name": "street", "vehicle": "cart.json", "frames": 4,
        "roi": { "min": [-16, -16, -0.5], "max": [16, 16, 3.5], "voxel": [0.5, 0.5, 0.5] },
        "static": [{ "class": "ground", "plane": { "min": [-40, -40], "max": [40, 40], "z": 0 } }],
        "actors": [{ "name": "crate", "kind": "car",
            "parts": [{ "class": "vehicle", "box": { "min": [-1, -1, 0], "max": [1, 1, 2] } }],
            "poses": [{ "x": 8, "y": 0 }, { "x": 9, "y": 2 }, { "x": 10, "y": 3 }, { "x": 7, "y": -4 }] }] });
    write(dir, "street.json", &scene);
}

fn car(bearing: [i32; 2], share: f64) -> Value {
    json!({ "name": format!("car {bearing:?}"), "target": "car", "from": 10, "within": 15, "bearing": bearing,
        "share": share })
}

#[test]
fn a_requirement_that_copies_within_the_tolerance_break_is_met_on_paper_only() {
    let dir = TempDir::new().unwrap();
    let lidar = json!({ "x": 0, "y": 0, "z": 1, "sensor": "half" });
    let rigs = json!({ "placements": [{ "name": "ahead", "lidars": [lidar], "price": 3 }] });
    write(&dir, "rigs.json", &rigs);
    let score = |require: Value, more: &str| {
        street(dir.path(), require);
        ok(&dir, &("score street.json rigs.json --backend cpu", more))["scores"][0].clone()
    };
    // All round a half turn sees about half: just the share that it sees is required in the second run.
    let found = score(json!([car([-180, 180], 0.1)]), "");
    let share = found["requirements"][0]["found"].number();
    assert!((0.5..0.6).contains(&share), "{found}");
    let ring = json!({ "name": "ground", "min": [2, -3, -0.3], "max": [6, 3, 0.3], "share": 0.05 });
    let all = json!([ring, car([-60, 60], 0.9), car([-180, 180], share)]);
    let found = score(all.clone(), "--tolerance 5mm,2deg");
    let holds = |k: usize| found["requirements"][k]["holds_in"].number();
    assert_eq!((holds(0), holds(1)), (1.0, 1.0), "{found}");
    assert!(holds(2) > 0.1 && holds(2) < 0.95, "{found}");
    assert_eq!(found["requirements_hold_in"], holds(2));
    // The page of a rig has the copies of `score`, and no column for them where nobody looked.
    let view = |tolerance: &str| {
        let args = "view street.json rigs.json --backend cpu --force --out v.html --tolerance";
        printed(&dir, &(args, tolerance));
        read_text(&dir, "v.html")
    };
    let page = view("5mm,2deg");
    let (_, table) = page.split_once("copies that hold %").unwrap();
    let (table, _) = table.split_once("</table>").unwrap();
    table.says(&format!("<td>{}</td>", (1e3 * holds(2)).round() / 10.0));
    assert!(page.contains(" --tolerance 5mm,2deg "), "its command has the tolerance");
    let copies = "Copies are mounted up to ";
    let within =
        |page: &str| page.split_once(copies).unwrap().1.split_once(" off").unwrap().0.to_owned();
    assert_eq!([within(&page), within(&view("5mm,0.5deg"))], ["5 mm and 2°", "5 mm and 0.5°"]);
    view("0").lacks("copies that hold %");
    // Voxels on the ground that beams just reach depend on millimetres, too.
    let edge = json!([{ "name": "ground", "min": [2, -3, -0.3], "max": [6, 3, 0.3],
        "share": found["requirements"][0]["found"] }]);
    let found = score(edge, "");
    assert_eq!(found["requirements"][0]["met"], true);
    assert!(found["requirements"][0]["holds_in"].number() < 0.95, "{found}");
    let plain = score(all, "--tolerance 0");
    assert_eq!(plain["requirements"][2].get("holds_in"), None);
    stdout(&dir, "score street.json rigs.json --backend cpu --tolerance 5mm,2deg")
        .says("required, ON PAPER ONLY, met by ")
        .says("all requirements: ON PAPER ONLY, met by ");
    fails(&dir, "score street.json rigs.json --tolerance 5").says("5mm,0.5deg");
}

#[test]
fn a_result_is_moved_until_its_copies_within_the_tolerance_meet_what_is_required() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), json!([car([-180, 180], 0.685)]));
    let search = |tolerance: &str| {
        let args = "optimize street.json --budget 3 --backend cpu --evaluations 30 --force --out run --tolerance";
        printed(&dir, &format!("{args} {tolerance}"));
        let args = "score street.json run/placements.json --backend cpu --tolerance 10mm,1deg";
        ok(&dir, args)["scores"][0].clone()
    };
    let (paper, mounted) = (search("0"), search("10mm,1deg"));
    for found in [&paper, &mounted] {
        assert_eq!(found["requirements"][0]["met"], true, "{found}");
    }
    assert!(paper["requirements_hold_in"].number() < 0.9, "{paper}");
    assert!(mounted["requirements_hold_in"].number() >= 0.95, "{mounted}");
    // Little is paid for it.
    let gain = |found: &Value| found["near_gain"].number();
    assert!(gain(&mounted) > 0.9 * gain(&paper), "{mounted}");
}

#[test]
fn among_equal_numbers_the_cheapest_that_a_search_brings_to_meet_all_is_taken() {
    let dir = TempDir::new().unwrap();
    let begun = "all requirements are met at a price of 3; a cheaper rig of 1 sensor is searched";
    let search = |require: Value, more: &str| {
        street(dir.path(), require);
        let args =
            "optimize street.json --fewest --backend cpu --evaluations 16 --seed 3 --out o --force";
        let (code, found, told) = answer(&dir, &(args, more));
        let price = found["best"]["price"].number();
        (code, price, found["best"]["placement"].clone(), told)
    };
    // On the coarse grid the narrow sensor misses 1 % of the cars; a search turns it to where it sees all.
    let rule = json!([car([5, 65], 1.0)]);
    let (code, price, narrow, told) = search(rule.clone(), "");
    assert_eq!((code, price), (Some(0), 1.0), "{told}");
    told.says(begun);
    // Where its mounting may be off by 8° the narrow one holds on paper only, and the wide one in its copies.
    let (code, price, ..) = search(rule.clone(), "--tolerance 5mm,8deg");
    assert_eq!((code, price), (Some(0), 3.0));
    // One that a search cannot turn so leaves the dearer one its place, with nothing said to be untried.
    let (code, price, half, told) = search(json!([car([-45, 45], 0.9)]), "");
    assert_eq!((code, price), (Some(0), 3.0), "{told}");
    told.says(begun);
    assert!(!told.contains("not tried"), "{told}");
    // Five models: the one for 2 meets all once it is turned, and the one for 1 does not: the one for 2 comes back.
    street(dir.path(), json!([car([0, 60], 1.0)]));
    change(&dir, "cart.json", |cart| {
        let sides = [(90, 5), (27, 4), (25, 3), (24, 2), (18, 1)];
        let model = |(side, price): (i32, i32)| {
            let mut model = cart["sensors"][0].clone();
            model["name"] = json!(format!("w{side}"));
            model["price"] = json!(price);
            model["lidar"]["azimuth"] = json!([-side, side]);
            model["lidar"]["azimuth_steps"] = json!(2 * side);
            model
        };
        let models = sides.map(model);
        cart["mounts"][0]["sensors"] = models.iter().map(|model| model["name"].clone()).collect();
        cart["sensors"] = json!(models);
    });
    let args =
        "optimize street.json --fewest --backend cpu --evaluations 16 --seed 3 --out o --force";
    let (code, [text, told]) = ran(&dir, args);
    told.says("are met at a price of 5; a cheaper rig");
    told.says("are met at a price of 2; a cheaper rig");
    told.says("equipment: 1 × w18 on mast, 1 in all");
    text.says("meets its requirement (car [0, 60]) at a price of 2 ");
    text.says("\nequipment: 1 × w24 on mast, 2 in all\n");
    assert_eq!(code, Some(0));
    // A state from within the cheaper search goes on to the same placement, whether that one meets all or not.
    for (require, wanted) in [(rule, narrow), (json!([car([-45, 45], 0.9)]), half)] {
        street(dir.path(), require);
        let job = || {
            let scene = Scene::read(dir.path().join("street.json")).unwrap();
            let tolerance = Some(Tolerance::default());
            let settings = Settings { evaluations: 16, seed: 3, ..Settings::default() };
            Job::new(scene).fewest(true).tolerance(tolerance).search(settings)
        };
        let (job, mut steps) = (job(), 0);
        let mut run = job.begin().unwrap();
        while steps < 3 {
            let mut watch = |event: &Event<'_>| {
                steps += usize::from(matches!(event, Event::Note(note) if *note == begun));
                true
            };
            assert!(matches!(run.step(&mut watch).unwrap(), JobStep::On));
            steps += usize::from(steps > 0);
        }
        let state = serde_json::to_value(run.state()).unwrap();
        let mut run = job.resume(serde_json::from_value(state).unwrap()).unwrap();
        let outcome = loop {
            match run.step(&mut |_: &Event<'_>| true).unwrap() {
                JobStep::On => {}
                JobStep::Stopped => panic!("nobody stopped it"),
                JobStep::Done(outcome) => break outcome,
            }
        };
        let found = json!(outcome.best.unwrap().placement);
        assert_eq!(found["lidars"], wanted["lidars"]);
    }
}

#[test]
fn the_fewest_sensors_that_meet_all_requirements_are_the_cheapest_of_them() {
    let dir = TempDir::new().unwrap();
    let search = |out: &str, require: Value| {
        street(dir.path(), require);
        let args = "optimize street.json --fewest --backend cpu --evaluations 16 --seed 3 --out";
        let (code, found, told) = answer(&dir, &format!("{args} {out}"));
        let listed = read_json(dir.path().join(out).join("placements.json"));
        let best = listed["placements"][0].clone();
        let sensors = best["lidars"].list().iter();
        let sensors: Vec<_> = sensors.map(|l| l["sensor"].text().to_owned()).collect();
        (code, sensors, best["price"].number(), found, told)
    };
    // One narrow sensor is enough ahead, and cheaper than a wide one; all round it takes two wide ones.
    let (code, sensors, price, ..) = search("ahead", json!([car([-15, 15], 0.95)]));
    assert_eq!((code, &sensors[..], price), (Some(0), &["narrow".to_owned()][..], 1.0));
    let (code, sensors, price, _, told) = search("round", json!([car([-180, 180], 0.95)]));
    assert_eq!((code, sensors.len(), price), (Some(0), 2, 6.0), "{told}");
    told.says("no equipment of 1 sensor was found that meets all requirements");
    // It wrote a file of placements.
    let again = "score street.json round/placements.json --backend cpu";
    assert_eq!(ok(&dir, again)["scores"][0]["requirements"][0]["met"], true);
    // One LiDAR alone can never hold what must hold without any one: the choice begins with two.
    let mut lost = car([-15, 15], 0.95);
    lost["without_any_one"] = json!(true);
    let (_, sensors, _, _, told) = search("lost", json!([lost]));
    assert!(sensors.len() >= 2 && told.contains("--fewest begins with 2 sensors"), "{told}");
    assert!(!told.contains("no equipment of 1 sensor"), "{told}");
    // A requirement that nothing meets: as many as there may be, and exit code 1.
    let hopeless = json!({ "target": "tyre", "from": 15, "within": 15, "beams": 100, "share": 1 });
    let (code, sensors, _, found, _) = search("hopeless", json!([hopeless]));
    assert_eq!((code, sensors.len()), (Some(1), 4));
    assert_eq!(found["best"]["scores"]["requirements"][0]["met"], false);
    // Time that ends before more are tried is told.
    let args = "optimize street.json --fewest --max-seconds 0.01 --backend cpu --out late";
    let (_, [_, told]) = ran(&dir, args);
    told.says("rigs of more than 1 sensor were not tried");
    let found = read_text(&dir, "late/result.json");
    let verdict = serde_json::from_str::<Value>(&found).unwrap()["verdict"].clone();
    assert!(verdict.text().contains(" Not tried: rigs of more than 1 sensor."), "{verdict}");
    // No more sensors are tried than the budget pays for.
    let args = "optimize street.json --fewest --budget 2 --backend cpu --evaluations 16 --out poor";
    let (_, [_, told]) = ran(&dir, args);
    assert!(told.contains("1 sensor was found") && !told.contains("2 sensors was"), "{told}");
    street(dir.path(), json!([]));
    fails(&dir, "optimize street.json --fewest").says("--fewest: the vehicle requires nothing");
}

#[test]
fn the_rig_that_is_best_after_its_worst_loss_meets_what_is_required() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), json!([car([-180, 180], 0.95)]));
    change(&dir, "cart.json", |vehicle| {
        vehicle["sensors"].as_array_mut().unwrap().truncate(1);
        (vehicle["mounts"][0]["count"], vehicle["mounts"][0]["sensors"]) =
            (json!(2), json!(["half"]));
    });
    // All that changes is ahead: two LiDARs that look there lose nothing with one of them.
    // With one evaluation the starts alone are looked at.
    for evaluations in [40, 1] {
        let args = format!(
            "study loss street.json --backend cpu --evaluations {evaluations} --seed 1 --out loss{evaluations}"
        );
        let found = ok(&dir, &args);
        for row in found["rows"].list() {
            assert_eq!(row["requirements_met"], true, "{row}");
        }
    }
}

#[test]
fn a_requirement_beyond_the_range_of_the_sensors_says_so() {
    let dir = TempDir::new().unwrap();
    let at = |name: &str, from: u32, within: u32| json!({ "name": name, "target": "car", "from": from, "within": within, "share": 0.9 });
    street(dir.path(), json!([at("near", 10, 20), at("partly", 40, 80), at("far", 70, 80)]));
    // A model that the rig does not have sees farther.
    change(&dir, "cart.json", |vehicle| {
        let mut long = vehicle["sensors"][0].clone();
        (long["name"], long["lidar"]["range"]) = (json!("long"), json!(200));
        vehicle["sensors"].as_array_mut().unwrap().push(long);
    });
    write_rig(&dir, "rigs.json", "ahead", json!([{ "x": 0, "y": 0, "z": 1, "sensor": "half" }]));
    let found = ok(&dir, "score street.json rigs.json --backend cpu");
    let missing = |k: usize| found["scores"][0]["requirements"][k]["missing"].text().to_owned();
    assert!(!missing(0).contains("LiDARs reach"), "{}", missing(0));
    assert!(missing(1).ends_with("; the LiDARs reach 60 m at most"), "{}", missing(1));
    let far = "; the LiDARs reach 60 m at most: this lies beyond their range";
    assert!(missing(2).ends_with(far), "{}", missing(2));
}

#[test]
fn ground_that_is_not_level_where_targets_stand_is_said() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), json!([car([-60, 60], 0.1)]));
    write_rig(&dir, "rigs.json", "ahead", json!([{ "x": 0, "y": 0, "z": 1, "sensor": "half" }]));
    let mut scene = read_json(dir.path().join("street.json"));
    for (z, who) in
        [(0.2, None), (1.5, Some("requirements and range card")), (1.6, Some("requirements"))]
    {
        let plane = |from: i32, to: i32, z: f64| json!({ "class": "road", "plane": { "min": [from, -40], "max": [to, 40], "z": z } });
        scene["static"] = json!([plane(-40, 12, 0.0), plane(12, 60, z)]);
        write(&dir, "street.json", &scene);
        let words = format!(
            "targets of {} stand on level ground, and the ground of street rises {z} m to 15 m at 0° in frame 0; `study targets`",
            who.unwrap_or_default()
        );
        for (command, more) in [
            ("score", ""),
            ("view", " --force --out v.html"),
            ("study loss", " --force --out loss"),
            ("study weather", " --force --out weather"),
            ("study sweep", " --of 0.yaw --from 0 --to 1 --values 2"),
            ("study tolerance", " --steps 1"),
        ] {
            let line = format!("{command} street.json rigs.json --backend cpu{more}");
            let (_, [_, told]) = ran(&dir, &line);
            assert_eq!(told.contains(&words), who.is_some(), "{line}: {told}");
        }
        let page = read_text(&dir, "v.html");
        assert_eq!(page.contains(&format!("Note: {}", &words[..40])), who.is_some());
    }
    // A requirement that stands on the ground of the scene is no reason to doubt.
    let mut on_scene = car([-60, 60], 0.1);
    on_scene["ground"] = json!("scene");
    set_rules(&dir, json!([on_scene]));
    stderr(&dir, "score street.json rigs.json --backend cpu").says(
        "the range card stands on the ground of street, which rises 1.6 m to 15 m at 0° in frame 0",
    );
}

/// Scenes on a road that the nose points to by an angle, with a rig `a` in `p.json`. Its vehicle must meet a car on level
/// ground, one on the ground of the scene, and the given rules.
pub(crate) fn on_slopes(dir: &Path, scenes: [(&str, f64); 2], more: &[Value]) {
    let car = |name: &str| {
        json!({ "name": name, "target": "car", "from": 30, "within": 30, "bearing": [0, 0],
        "beams": 30, "share": 1 })
    };
    let mut slope = car("slope");
    slope["ground"] = json!("scene");
    let require: Vec<Value> =
        [car("flat"), slope].into_iter().chain(more.iter().cloned()).collect();
    let cart = json!({ "sightline": 1, "name": "cart",
        "body": [{ "class": "vehicle", "box": { "min": [-1, -0.5, 0.3], "max": [1, 0.5, 1.2] } }],
        "sensors": [{ "name": "m", "price": 3, "phase": 0,
            "lidar": { "channels": 21, "fov": [-10, 0], "azimuth_steps": 720, "range": 100 } }],
        "mounts": [{ "name": "roof", "min": [0, 0, 1.8], "max": [0, 0, 1.8], "count": [0, 1], "sensors": ["m"] }],
        "require": require });
    write(dir, "cart.json", &cart);
    for (name, pitch) in scenes {
        let scene = json!({ "sightline": 1, "name": name, "vehicle": "cart.json", "coverage": "first-hit",
            "roi": { "min": [-8, -8, -1], "max": [8, 8, 3], "voxel": [1, 1, 1] },
            "static": [{ "class": "road", "plane": { "min": [-99, -99], "max": [99, 99], "z": 0 } }],
            "ego": { "poses": [{ "x": 0, "y": 0, "z": 0, "pitch": pitch }, { "x": 2, "y": 0, "z": 0, "pitch": pitch }] },
            "actors": [{ "name": "crate", "kind": "car",
                "parts": [{ "class": "vehicle", "box": { "min": [-1, -1, 0], "max": [1, 1, 2] } }],
                "poses": [{ "x": 8, "y": 4 }, { "x": 10, "y": 4 }] }] });
        write(dir, &format!("{name}.json"), &scene);
    }
    write_rig(dir, "p.json", "a", json!([{ "x": 0, "y": 0, "z": 1.8, "sensor": "m" }]));
}

#[test]
fn each_scene_has_its_own_share_of_a_requirement_and_all_have_the_mean() {
    let dir = TempDir::new().unwrap();
    let rules = [
        json!({ "ground": 10, "share": 0.01, "without_any_one": true }),
        json!({ "ground": 8, "share": 0.9 }),
    ];
    on_slopes(dir.path(), [("hill", 0.05), ("plain", 0.0)], &rules);
    let found = |scores: &Value| -> Vec<f64> {
        let rules = scores["requirements"].list();
        rules.iter().map(|rule| rule["found"].number()).collect()
    };
    let scored = |scenes: &str| -> Value {
        let line = format!("score {scenes} p.json --backend cpu --format json");
        serde_json::from_str(&ran(&dir, &line).1[0]).unwrap()
    };
    let both = scored("hill.json plain.json");
    let each = ["hill", "plain"].map(|name| scored(&format!("{name}.json"))["scores"][0].clone());
    for (of_scene, alone) in both["scenes"].list().iter().zip(&each) {
        let of_scene = of_scene["scores"][0]["requirements"].list().iter();
        for (rule, alone) in of_scene.zip(alone["requirements"].list()) {
            for key in ["name", "found", "met", "missing", "intact", "worst_frame", "places"] {
                assert_eq!(rule[key], alone[key], "{key}: {rule}");
            }
        }
    }
    let each = each.map(|scores| found(&scores));
    assert_eq!((each[0][1], each[1][1]), (0.0, 1.0), "the car on the slope");
    assert!(each[0][3] != each[1][3], "{each:?}");
    for (rule, mean) in found(&both["mean"][0]).into_iter().enumerate() {
        assert!((mean - (each[0][rule] + each[1][rule]) / 2.0).abs() < 1e-12, "{rule}");
    }
}

#[test]
fn a_target_on_the_ground_of_a_scene_is_looked_at_there_by_every_command() {
    let dir = TempDir::new().unwrap();
    // The nose points 0.05 rad down: 30 m ahead the ground rises 1.5 m, and few beams meet the car on it.
    on_slopes(dir.path(), [("hill", 0.05), ("again", 0.05)], &[]);
    let optimize =
        |more: &str| format!("optimize hill.json --evaluations 4 --force --out o {more}");
    let [missed, none] = [
        "NOT MET: slope, on the ground of the scene: 0.0 % seen",
        "NOT MET: no point meets all requirements",
    ];
    for (line, words) in [
        ("score hill.json p.json", missed),
        ("score hill.json again.json p.json", missed),
        ("study loss hill.json p.json --out loss", missed),
        ("study weather hill.json p.json --out weather", missed),
        ("study tolerance hill.json p.json --steps 1", missed),
        (optimize("--fewest").as_str(), missed),
        (optimize("--mirror").as_str(), missed),
        (optimize("--bound 5").as_str(), missed),
        ("optimize hill.json again.json --evaluations 4 --force --out o", missed),
        (optimize("--front price,near_gain").as_str(), none),
    ] {
        let (code, [text, _]) = ran(&dir, &(line, "--backend cpu"));
        assert!(text.contains(words) && !text.contains("NOT MET: flat"), "{line}: {text}");
        let is_study = line.starts_with("study loss") || line.starts_with("study weather");
        assert_eq!(code, Some(i32::from(!is_study)), "{line}");
    }
    let args = "view hill.json p.json --out v.html --backend cpu";
    assert_eq!(sightline(dir.path(), args).status.code(), Some(1));
}

#[test]
fn a_vehicle_without_requirements_is_told_of_them_first() {
    let dir = TempDir::new().unwrap();
    write_rig(&dir, "rigs.json", "ahead", json!([{ "x": 0, "y": 0, "z": 1, "sensor": "half" }]));
    for (require, is_told) in [(json!([]), true), (json!([car([-60, 60], 0.1)]), false)] {
        street(dir.path(), require);
        let text = |args: &str| {
            let (_, [text, _]) = ran(&dir, &format!("{args} --backend cpu"));
            text
        };
        let hint = "\nNo requirement is set: `require` of the vehicle says what must be seen. ";
        let scored = text("score street.json rigs.json");
        assert_eq!(scored.contains(&format!("{hint}The page of `view`")), is_told, "{scored}");
        let found = text("optimize street.json --budget 3 --evaluations 8 --force --out run");
        assert_eq!(found.contains(&format!("{hint}report.html")), is_told, "{found}");
        let page = read_text(&dir, "run/report.html");
        let place = page.find("No requirement is set");
        assert_eq!(place.is_some(), is_told);
        assert!(
            place.is_none_or(|place| place < page.find("<canvas").unwrap()),
            "before the picture"
        );
    }
}

#[test]
fn weather_takes_beams_from_required_targets_as_from_those_of_the_study() {
    let dir = TempDir::new().unwrap();
    let rule =
        json!({ "target": "car", "from": 10, "within": 40, "bearing": [0, 0], "share": 0.9 });
    street(dir.path(), json!([rule]));
    write_rig(&dir, "rigs.json", "ahead", json!([{ "x": 0, "y": 0, "z": 1, "sensor": "half" }]));
    let mut shares = Vec::new();
    for weather in ["", "--condition fog:mor=40", "--condition fog:mor=15"] {
        let score = "score street.json rigs.json --backend cpu";
        let score = ok(&dir, &(&score, weather))["scores"][0].clone();
        // The places of the rule, every 2.5 m.
        let distances: Vec<String> =
            (0..13).map(|k| (10.0 + 2.5 * f64::from(k)).to_string()).collect();
        let distances = distances.join(",");
        let study = "study targets rigs.json --vehicle cart.json --target car";
        let places = ["--distances", &distances, "--bearings", "0"];
        let rows = ok(&dir, &(study, &places, weather))["rows"].clone();
        let met = rows.list().iter().filter(|row| row["beams"].as_u64() >= Some(5));
        let share = met.count() as f64 / 13.0;
        assert_eq!(score["requirements"][0]["found"].as_f64(), Some(share), "{score} {rows}");
        shares.push((share, score["range_card"]["targets"][0]["bearings"][0]["met"].to_string()));
    }
    assert!(shares[0].0 > shares[1].0 && shares[1].0 > shares[2].0, "{shares:?}");
    assert!(shares[0].1 != shares[2].1, "the range card is one of clear air: {shares:?}");
}

#[test]
fn a_rule_may_count_only_beams_that_return_in_clear_air() {
    let dir = TempDir::new().unwrap();
    let dark = json!({ "sightline": 1, "name": "dark box", "reflectance": 0.02, "source": "made here",
        "shapes": [{ "box": { "foot": [0, 0, 0], "size": [2, 2, 2] } }] });
    write(&dir, "dark.json", &dark);
    write_rig(&dir, "rigs.json", "ahead", json!([{ "x": 0, "y": 0, "z": 1, "sensor": "half" }]));
    let rule = |response: bool| json!({ "target": "dark.json", "from": 10, "within": 40, "bearing": [0, 0], "share": 0.9, "response": response });
    street(dir.path(), json!([rule(false), rule(true)]));
    let score = "score street.json rigs.json --backend cpu";
    let required = ok(&dir, score)["scores"][0]["requirements"].clone();
    let distances: Vec<String> = (0..13).map(|k| (10.0 + 2.5 * f64::from(k)).to_string()).collect();
    let distances = distances.join(",");
    let share = |more: &str| {
        let study = "study targets rigs.json --vehicle cart.json --target";
        let places = ["dark.json", "--distances", &distances, "--bearings", "0"];
        let found = ok(&dir, &(study, &places, more));
        let rows = found["rows"].list().iter();
        rows.filter(|row| row["beams"].as_u64() >= Some(5)).count() as f64 / 13.0
    };
    // A sensor rated at 36 m for 10 % sees 2 % to 36·√0.2 = 16.1 m: the front of a box at 15 m, not of one at 17.5 m.
    let expected = [1.0, 3.0 / 13.0];
    assert_eq!([share(""), share("--response")], expected);
    assert_eq!([0, 1].map(|k| required[k]["found"].number()), expected, "{required}");
    assert_eq!(required[1]["name"], "dark box from 10 to 40 m, at 0°, beams that return");
    assert_eq!(required[1]["missing"], "missing at 17.5 to 40 m, 0°");
    // Copies are looked at in the same way.
    assert_eq!([0, 1].map(|k| required[k]["holds_in"].as_f64()), [Some(1.0), Some(0.0)]);
    // Another kind of rule has no such key.
    street(dir.path(), json!([{ "ground": 3, "share": 0.5, "response": true }]));
    fails(&dir, score).says("require[0]: `response` cannot stand here: a rule on the ground");
}
