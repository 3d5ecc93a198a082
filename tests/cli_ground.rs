//! Requirements on near ground and blind zones, from outside: they have the numbers of `study nearfield`, and a search heeds
//! them. Range cards on ground that is not level.

use crate::cli::*;
use crate::cli_requirements::on_slopes;

/// Ground with a kerb and a walker who moves, and a cart whose body hides what is beside it.
fn yard(dir: &Path, require: Value) {
    let side = json!({ "channels": 24, "fov": [-70, -10], "azimuth": [-60, 60], "azimuth_steps": 90, "range": 30 });
    cart(dir, (side, [1.4, 1.6]), json!(1), require);
    yard_of(
        dir,
        json!([
        { "class": "road", "plane": { "min": [-50, -50], "max": [50, 4], "z": 0 } },
        { "class": "sidewalk", "plane": { "min": [-50, 4], "max": [50, 50], "z": 0.15 } },
        { "class": "building", "box": { "min": [6, -8, 0], "max": [9, -3, 3] } }]),
    );
    let lidar = |sensor: &str, x: f64, y: f64, z: f64, yaw: f64| json!({ "sensor": sensor, "x": x, "y": y, "z": z, "yaw": yaw });
    let roof = lidar("wide", 0.4, 0.1, 2.1, 0.0);
    let [left, back] = [lidar("side", 0.2, 0.85, 1.5, 1.4), lidar("side", -1.9, -0.2, 1.5, 3.0)];
    let placements = json!({ "placements": [
        { "name": "roof", "lidars": [roof] }, { "name": "two", "lidars": [roof, left] },
        { "name": "three", "lidars": [roof, left, back] } ] });
    write(dir, "rigs.json", &placements);
}

const RULES: [(&str, f64); 4] = [("ahead", 1.5), ("behind", 2.0), ("left", 1.0), ("right", 2.5)];

fn rules() -> Value {
    let mut all = vec![json!({ "ground": 10, "share": 0.5 }), json!({ "ground": 3, "share": 0.5 })];
    all.extend(RULES.map(|(side, depth)| json!({ "blind_zone": side, "depth": depth })));
    all.into()
}

/// The rules of [`rules`] must say of a placement what the near field says.
fn agrees(scores: &Value, near: &Value) {
    let found = |k: usize| scores["requirements"][k]["found"].number();
    assert_eq!(found(0), near["near_field"].number(), "{near}");
    assert_eq!(found(1), near["ring"].number(), "{near}");
    for (k, (side, depth)) in RULES.into_iter().enumerate() {
        let (rule, zone) = (&scores["requirements"][2 + k], &near["zone"][side]);
        let lanes: Vec<&Value> = near["zone"]["lanes"].list().iter().collect();
        let lanes: Vec<&Value> = lanes.into_iter().filter(|lane| lane["side"] == side).collect();
        let is_lost = |lane: &&&Value| {
            let lost = lane["lost"].as_array().into_iter().flatten();
            let mut ends = lost.map(|of| [0, 1].map(|k| of[k].number()));
            let begins_in = lane["depth"].as_f64().is_some_and(|found| found <= depth);
            begins_in && ends.any(|[from, to]| from <= depth && to > depth)
        };
        let lost = lanes.iter().filter(is_lost).count();
        let is_met = zone.as_f64().is_some_and(|found| found <= depth) && lost == 0;
        assert_eq!(rule["met"], is_met, "{side}: {rule} {zone}");
        let up = |metres: f64| (10.0 * metres).ceil() / 10.0;
        let told = match zone.as_f64() {
            Some(found) if lost > 0 => format!(
                "the blind zone {side} ends at {:.1} m; {lost} of {} lanes lose ground behind it again",
                up(found),
                lanes.len()
            ),
            Some(found) => format!("the blind zone {side} ends at {:.1} m", up(found)),
            None => format!("the blind zone {side} does not end within 10 m"),
        };
        assert_eq!(rule.get("missing"), (!is_met).then(|| json!(told)).as_ref(), "{rule} {zone}");
    }
}

#[test]
fn required_ground_has_the_numbers_of_the_near_field() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), rules());
    for weather in ["", "--condition fog:mor=15 --condition wet:water=1"] {
        let of = |command: &str| ok(&dir, &(command, "yard.json rigs.json --backend cpu", weather));
        let (scores, near) = (of("score --tolerance 0"), of("study nearfield"));
        let (scores, near) = (&scores["scores"], &near["near_fields"]);
        (0..3).for_each(|k| agrees(&scores[k], &near[k]));
        let met = |k: usize| {
            let all = scores[k]["requirements"].list();
            all.iter().filter(|rule| rule["met"] == true).count()
        };
        assert!(!weather.is_empty() || (met(0) < met(2) && met(2) >= 4), "{scores}");
    }
    stdout(&dir, "score yard.json rigs.json --backend cpu")
        .says("NOT MET: blind zone left to 1 m: ");
}

#[test]
fn a_mirrored_scene_swaps_the_sides() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), rules());
    let scores = |out: &str| {
        let args = "optimize yard.json --baselines rigs.json --backend cpu --max-seconds 0 --tolerance 0 --out";
        let (_, run, _) = answer(&dir, &format!("{args} {out}"));
        let two = run["baselines"].list().iter().find(|of| of["scores"]["name"] == "two");
        two.unwrap()["scores"]["requirements"].clone()
    };
    let (plain, both) = (scores("plain"), scores("both --mirror"));
    // Mirrored by hand: the scene and the body, as the vehicle stays as it is.
    let mut scene = read_json(dir.path().join("yard.json"));
    scene["static"][0]["plane"] = json!({ "min": [-50, -4], "max": [50, 50], "z": 0 });
    scene["static"][1]["plane"] = json!({ "min": [-50, -50], "max": [50, -4], "z": 0.15 });
    scene["static"][2]["box"] = json!({ "min": [6, 3, 0], "max": [9, 8, 3] });
    for pose in scene["actors"][0]["poses"].as_array_mut().unwrap() {
        pose["y"] = json!(-pose["y"].number());
    }
    write(&dir, "yard.json", &scene);
    let image = scores("image");
    for k in 0..6 {
        let found = |of: &Value| of[k]["found"].number();
        let mean = 0.5 * (found(&plain) + found(&image));
        assert!((found(&both) - mean).abs() < 2e-3, "{k}: {both} {plain} {image}");
    }
    assert_ne!(plain[0]["found"], image[0]["found"], "the scene is no image of itself");
    assert_ne!(plain[4]["found"], plain[5]["found"], "nor is the rig");
}

#[test]
fn ground_seen_without_any_one_lidar_is_the_least_that_is_left() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), json!([{ "ground": 3, "share": 0.99, "without_any_one": true }]));
    let score =
        || ok(&dir, "score yard.json rigs.json --backend cpu --tolerance 0")["scores"].clone();
    let all = score();
    let rigs = read_json(dir.path().join("rigs.json"));
    let without = |lost: usize| {
        let mut lidars = rigs["placements"][2]["lidars"].list().clone();
        lidars.remove(lost);
        json!({ "name": format!("without-{lost}"), "lidars": lidars })
    };
    write(&dir, "rigs.json", &json!({ "placements": [without(0), without(1), without(2)] }));
    set_rules(&dir, json!([{ "ground": 3, "share": 0.99 }]));
    let each = score();
    let found = |scores: &Value, k: usize| scores[k]["requirements"][0]["found"].number();
    let least = (0..3).map(|k| found(&each, k)).fold(f64::INFINITY, f64::min);
    assert_eq!(found(&all, 2), least, "{all} {each}");
    let told = all[2]["requirements"][0]["missing"].text();
    told.says("least is seen ");
    assert_eq!(all[2]["requirements"][0]["worst_without"], 0, "{all}");
}

#[test]
fn a_search_finds_a_rig_that_sees_the_ground_it_must() {
    let dir = TempDir::new().unwrap();
    let search = |out: &str, require: Value| {
        yard(dir.path(), require);
        let args = "optimize yard.json --backend cpu --evaluations 16 --seed 1 --budget 6 --out";
        let (code, found, _) = answer(&dir, &format!("{args} {out}"));
        (code, found["best"]["scores"].clone())
    };
    let required = json!([{ "blind_zone": "behind", "depth": 1 }, { "ground": 3, "share": 0.9 }]);
    let (code, scores) = search("asked", required.clone());
    assert_eq!(code, Some(0), "{scores}");
    assert!(scores["requirements"].list().iter().all(|rule| rule["met"] == true));
    assert!(scores["requirements"][0]["holds_in"].as_f64().is_some(), "{scores}");
    // Without the rules it leaves more of the ground unseen.
    search("free", json!([]));
    set_rules(&dir, required);
    let free = "score yard.json free/placements.json --backend cpu";
    let free = ok(&dir, &free)["scores"][0]["requirements"].clone();
    assert!(free.list().iter().any(|rule| rule["met"] == false), "{free}");
}

#[test]
fn ground_and_boxes_that_no_pose_sees_are_out_of_reach() {
    let dir = TempDir::new().unwrap();
    // From the middle of the roof beams that clear its edge, 40° down at most, reach the ground 1.2 m beside the cart.
    yard(
        dir.path(),
        json!([{ "blind_zone": "left", "depth": 0.5 }, { "ground": 10, "share": 0.05 },
            { "name": "inside", "min": [-1, -0.4, 0.3], "max": [1, 0.4, 1], "share": 0.9 }]),
    );
    let text = read_text(&dir, "cart.json");
    let mut cart: Value = serde_json::from_str(&text).unwrap();
    cart["mounts"].as_array_mut().unwrap().truncate(1);
    cart["mounts"][0]["count"] = json!([1, 2]);
    cart["mounts"][0]["min"][1] = json!(-0.2);
    cart["mounts"][0]["max"][1] = json!(0.2);
    write(&dir, "cart.json", &cart);
    let args = "optimize yard.json --backend cpu --evaluations 10 --seed 1 --out run";
    let (code, [text, said]) = ran(&dir, args);
    assert_eq!(code, Some(1), "{said}");
    let words = "blind zone left to 0.5 m: even a LiDAR at every pose looked at on each mount";
    said.says(&format!("OUT OF REACH: {words}"));
    let words = format!(
        "Out of reach: {words} leaves it 0.0 % seen, 100.0 % required, the blind zone left ends at "
    );
    text.says(&words);
    text.says("; raise `depth`, lower `share`, ");
    let words = "inside: even a LiDAR at every pose looked at on each mount leaves it 0.0 % seen, 90.0 % required";
    said.says(&format!("OUT OF REACH: {words}"));
    text.says(&format!("Out of reach: {words}"));
    // How far the result comes stands in the first sentences.
    text.says("NOT MET: blind zone left to 0.5 m: 0.0 % seen, ");
    assert!(!text.contains("ground to 10 m: even") && !text.contains("Next, since"), "{text}");
}

#[test]
fn wrong_rules_on_the_ground_are_named() {
    let dir = TempDir::new().unwrap();
    for (rule, said) in [
        (json!({ "ground": 30, "share": 1 }), "at most 10"),
        (json!({ "ground": 0, "share": 1 }), "above 0"),
        (json!({ "ground": 3 }), "`share`"),
        (json!({ "ground": 3, "share": 90 }), "a share from 0 to 1: 90 % is 0.9"),
        (json!({ "ground": 3, "share": 1, "blind_zone": "left" }), "write two"),
        (json!({ "ground": 3, "share": 1, "beams": 5 }), "`beams`"),
        (json!({ "blind_zone": "front", "depth": 1 }), "ahead, behind, left or right"),
        (json!({ "blind_zone": "left" }), "`depth`"),
        (json!({ "blind_zone": "left", "depth": 11 }), "at most 10"),
        (json!({ "blind_zone": "left", "depth": 1, "target": "car" }), "`target`"),
        (json!({ "target": "car", "within": 9, "share": 1, "depth": 1 }), "`depth`"),
    ] {
        yard(dir.path(), json!([{ "ground": 1, "share": 0 }, rule]));
        fails(&dir, "score yard.json rigs.json --backend cpu").says("require[1]").says(said);
    }
    // A scene without ground, or a vehicle without a body, cannot answer.
    yard(dir.path(), json!([{ "ground": 3, "share": 1 }]));
    let score = "score yard.json rigs.json --backend cpu";
    change(&dir, "cart.json", |cart| drop(cart.as_object_mut().unwrap().remove("body")));
    fails(&dir, score).says("`ground to 3 m`, and the scene has no own body");
    yard(dir.path(), json!([{ "ground": 3, "share": 1 }]));
    change(&dir, "yard.json", |yard| {
        yard["static"][0]["class"] = json!("wall");
        yard["static"][1]["class"] = json!("wall");
    });
    fails(&dir, score).says("no triangle of a class of ground");
}

/// A trailer hides what is behind the cart while it is straight, in one of three frames.
#[test]
fn a_body_that_moves_hides_no_frame_in_which_a_rule_fails() {
    let dir = TempDir::new().unwrap();
    let rules =
        [json!({ "blind_zone": "behind", "depth": 3 }), json!({ "ground": 3, "share": 0.01 })];
    yard(dir.path(), json!(rules));
    change(&dir, "yard.json", |yard| yard["actors"] = json!([]));
    change(&dir, "cart.json", |cart| {
        let poses = [0.0, 1.57, 1.57].map(|yaw| json!({ "x": -2, "y": 0, "yaw": yaw }));
        let part =
            json!({ "class": "vehicle", "box": { "min": [-4, -0.9, 0], "max": [-1.5, 0.9, 2] } });
        cart["bodies"] = json!([{ "name": "trailer", "parts": [part], "poses": poses }]);
    });
    let files = ["yard.json", "rigs.json", "--backend", "cpu", "--tolerance", "0"];
    let of = |more: &str| {
        let found = ok(&dir, &("score", &files, more));
        found["scores"][2]["requirements"].clone()
    };
    let (all, straight) = (of(""), of("--frames 1"));
    // Bent, the trailer hides nothing behind the straight one: two of three frames would do.
    let worst = json!({ "frame": 0, "share": 0.0 });
    assert_eq!((&all[0]["found"], &all[0]["worst_frame"]), (&json!(0.0), &worst), "{all}");
    assert_eq!((&straight[0]["found"], straight[0].get("worst_frame")), (&json!(0.0), None));
    let share = |of: &Value| of.number();
    let (mean, first) = (share(&all[1]["found"]), share(&straight[1]["found"]));
    let bent = (3.0 * mean - first) / 2.0;
    let worst = share(&all[1]["worst_frame"]["share"]);
    assert!((worst - bent.min(first)).abs() < 1e-9 && worst < mean, "{all} {straight}");
    stdout(&dir, &("score", &files))
        .says("blind zone behind to 3 m: 0.0 % seen in frame 0, 100.0 % required")
        .says(" % in frame ");
    let near = ok(&dir, "study nearfield yard.json rigs.json --backend cpu");
    let zone = &near["near_fields"][2]["zone"];
    assert_eq!((&zone["behind"], &zone["worst_frames"]["behind"]), (&Value::Null, &json!(0)));
}

/// A straight trailer hides a car behind the cart, a bent one a car to the right.
#[test]
fn a_target_must_be_met_in_the_worst_pose_of_a_body_that_moves() {
    let dir = TempDir::new().unwrap();
    let car = |more: Value| {
        let mut rule = json!({ "target": "car", "from": 12, "within": 12, "share": 0 });
        rule.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        rule
    };
    let rules = json!([
        car(json!({ "bearing": [180, 180], "share": 1 })),
        car(json!({ "bearing": [225, 240] })),
        car(json!({ "name": "one lost", "without_any_one": true }))
    ]);
    yard(dir.path(), rules);
    let of = |yaws: [f64; 3], more: &str| {
        let poses = yaws.map(|yaw| json!({ "x": -2, "y": 0, "yaw": yaw }));
        let part =
            json!({ "class": "vehicle", "box": { "min": [-4, -0.9, 0], "max": [-1.5, 0.9, 2] } });
        change(&dir, "cart.json", |cart| {
            cart["bodies"] = json!([{ "name": "trailer", "parts": [part], "poses": poses }]);
        });
        let args = "score yard.json rigs.json --backend cpu";
        ok(&dir, &(args, more))["scores"][2]["requirements"].clone()
    };
    let exact = "--tolerance 0";
    let [straight, bent] = [0.0, 1.57].map(|yaw| of([yaw; 3], exact));
    let found = |of: &Value, rule: usize| of[rule]["found"].number();
    assert_eq!((found(&straight, 0), found(&bent, 0)), (0.0, 1.0), "{straight} {bent}");
    assert!(found(&straight, 1) > found(&bent, 1), "{straight} {bent}");
    assert!((0..3).all(|rule| straight[rule].get("worst_frame").is_none()), "{straight}");
    for (yaws, frames) in [([0.0, 1.57, 1.57], [0, 1]), ([1.57, 0.0, 1.57], [1, 0])] {
        let both = of(yaws, exact);
        for rule in 0..3 {
            let shares = [found(&straight, rule), found(&bent, rule)];
            let worst = usize::from(shares[1] < shares[0]);
            let named = json!({ "frame": frames[worst], "share": shares[worst] });
            let named = (shares[0] != shares[1]).then_some(named);
            assert_eq!(found(&both, rule), shares[worst], "{both}");
            assert_eq!(both[rule].get("worst_frame"), named.as_ref(), "{both}");
        }
        assert_eq!(both[0]["missing"], straight[0]["missing"], "{both}");
    }
    // No copy within the tolerance sees through the trailer.
    let [both, bent] = [[1.57, 0.0, 1.57], [1.57; 3]].map(|yaws| of(yaws, ""));
    assert_eq!((&both[0]["holds_in"], &bent[0]["holds_in"]), (&json!(0.0), &json!(1.0)));
}

/// With a LiDAR lost, a rule that must hold without any one is judged as the plain one, its worst frame, too.
#[test]
fn a_study_of_losses_has_the_worst_frame_of_one_loss_and_no_second() {
    let dir = TempDir::new().unwrap();
    let twice = |name: &str, mut rule: Value| {
        rule["name"] = json!(name);
        let mut lost = rule.clone();
        (lost["name"], lost["without_any_one"]) = (json!(format!("{name}, one lost")), json!(true));
        [rule, lost]
    };
    let ground = twice("ring", json!({ "ground": 5, "share": 0.99 }));
    let car = json!({ "target": "car", "from": 12, "within": 12, "share": 0.99 });
    yard(dir.path(), json!([&ground[..], &twice("car", car)].concat()));
    let mut cart = read_json(dir.path().join("cart.json"));
    let poses = [0.0, 1.57, 1.57].map(|yaw| json!({ "x": -2, "y": 0, "yaw": yaw }));
    let part =
        json!({ "class": "vehicle", "box": { "min": [-4, -0.9, 0], "max": [-1.5, 0.9, 2] } });
    cart["bodies"] = json!([{ "name": "trailer", "parts": [part], "poses": poses }]);
    write(&dir, "cart.json", &cart);
    let text =
        stdout(&dir, "study loss yard.json rigs.json:three --backend cpu --frames 3 --out lost");
    let rows: Vec<&str> = text.lines().filter(|row| row.contains("three without LiDAR")).collect();
    assert_eq!(rows.len(), 3, "{text}");
    for row in rows {
        for name in ["ring", "car"] {
            let told =
                |name: &str| row.split_once(name).unwrap().1.split_once(", 99.0 %").unwrap().0;
            let plain = told(&format!("{name}: "));
            assert!(plain.contains("in frame"), "{row}");
            assert_eq!(told(&format!("{name}, one lost: ")), plain, "{row}");
        }
    }
}

#[test]
fn a_lidar_below_the_ground_is_the_first_warning_of_a_score() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), json!([]));
    let lidar = |z: f64| json!({ "sensor": "wide", "x": 0.4, "y": 0.1, "z": z });
    write_rig(&dir, "low.json", "low", [lidar(2.1), lidar(-0.5)]);
    let found = ok(&dir, "score yard.json low.json --backend cpu");
    let first = found["scores"][0]["guards"][0].text();
    assert!(first.starts_with("below_ground: LiDAR 1 is 0.50 m below the ground"), "{found}");
}

#[test]
fn ground_lost_again_behind_a_slit_breaks_the_rule_on_a_depth() {
    let dir = TempDir::new().unwrap();
    yard(dir.path(), json!([{ "blind_zone": "behind", "depth": 2 }]));
    change(
        &dir,
        "cart.json",
        |cart| // From 1.5 m over the rear edge beams end within 1.05 m of it.
    cart["sensors"][1]["lidar"]["fov"] = json!([-80, -55]),
    );
    let back = json!({ "sensor": "side", "x": -2, "y": 0, "z": 1.5, "yaw": std::f64::consts::PI });
    write_rig(&dir, "slit.json", "slit", [back]);
    let files = "yard.json slit.json --backend cpu";
    let near = ok(&dir, &("study nearfield", files));
    let zone = &near["near_fields"][0]["zone"];
    assert_eq!(zone["behind"], 0.125, "{zone}");
    let want = json!([{ "side": "behind", "from": 1.25, "to": 10.0, "lanes": 8, "of": 8 }]);
    assert_eq!(zone["lost"], want);
    let scores = ok(&dir, &("score --tolerance 0", files));
    let rule = &scores["scores"][0]["requirements"][0];
    assert_eq!((&rule["met"], &rule["found"]), (&json!(false), &json!(0.0)), "{rule}");
    let missing = rule["missing"].text();
    assert!(missing.ends_with("; 8 of 8 lanes lose ground behind it again"), "{missing}");
    stdout(&dir, &("study nearfield", files))
        .says("! slit: behind 0.2 m, but unseen again in 8 of 8 lanes, the longest stretch from 1.3 to 10 m\n");
}

#[test]
fn a_range_card_stands_on_ground_that_is_not_level_and_on_nothing_else_of_the_scene() {
    let dir = TempDir::new().unwrap();
    // The nose points 0.05 rad down, so that the road rises ahead.
    on_slopes(dir.path(), [("hill", 0.05), ("plain", 0.0)], &[]);
    let pose = |pitch: f64| json!([{ "x": 0, "y": 0, "z": 1.8, "pitch": pitch, "sensor": "m" }]);
    write_rig(&dir, "down.json", "a", pose(0.05));
    let card = |scene: &str, rig: &str| -> Value {
        let line = format!("score {scene}.json {rig}.json --backend cpu --format json");
        let found: Value = serde_json::from_str(&ran(&dir, &line).1[0]).unwrap();
        found["scores"][0]["range_card"].clone()
    };
    let (hill, plain, down) = (card("hill", "p"), card("plain", "p"), card("plain", "down"));
    assert_eq!(hill["ground"], json!({ "scene": "hill", "frame": 0 }));
    assert!(plain["ground"].is_null() && plain["targets"] != hill["targets"], "{plain}");
    // A LiDAR that looks as far down on a level road sees the car ahead alike, but that it leans there.
    let ahead = |card: &Value| -> Vec<f64> {
        let met = card["targets"][0]["bearings"][0]["met"].list();
        met.iter().flat_map(|run| [run[0].number(), run[1].number()]).collect()
    };
    let [of_hill, of_down] = [ahead(&hill), ahead(&down)];
    assert_eq!(of_hill.len(), of_down.len(), "{of_hill:?} {of_down:?}");
    let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= 5.0;
    assert!(of_hill.iter().zip(&of_down).all(is_near), "{of_hill:?} {of_down:?}");
    assert_ne!(of_hill, ahead(&plain));
    let (_, [text, _]) = ran(&dir, "score hill.json p.json --backend cpu");
    text.says("met in all 16 directions, on the ground of hill in frame 0: car ");
    // Neither the crate beside the road nor a house among the ground's own shapes is in the way.
    let house = json!({ "class": "building", "box": { "min": [14, -9, 0], "max": [24, -3, 9] } });
    change(&dir, "hill.json", |scene| {
        scene["actors"] = json!([]);
        scene["static"].as_array_mut().unwrap().insert(0, house);
    });
    assert_eq!(card("hill", "p"), hill);
    let _ = ran(&dir, "view hill.json p.json --out v.html --backend cpu");
    let page = read_text(&dir, "v.html");
    page.says(" of a target on the ground of hill in frame 0, which is not level");
}
