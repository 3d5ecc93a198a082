//! `study targets`, range cards and blind sectors, from outside.

use crate::cli::*;

/// A vehicle with a ring of level beams 0.1° apart at any height, and a sensor that looks ±90° around its front.
fn vehicle(dir: &Path, body: Value) {
    let ring = json!({ "name": "ring", "price": 1, "phase": 0,
        "lidar": { "channels": 1, "fov": [0, 0], "azimuth_steps": 3600, "range": 80 },
        "response": { "rated_range": 30 } });
    let half = json!({ "name": "half", "price": 1, "lidar": { "channels": 48, "fov": [-24, 4],
        "azimuth": [-90, 90], "azimuth_steps": 400, "range": 80 } });
    let mut vehicle = json!({ "sightline": 1, "name": "cart", "sensors": [ring, half],
        "mounts": [{ "name": "mast", "min": [-1, -1, 0.2], "max": [1, 1, 2.5], "yaw": [-3.1, 3.1],
            "sensors": ["half"], "count": 2 }] });
    if body != json!([]) {
        vehicle["body"] = body;
    }
    write(dir, "cart.json", &vehicle);
    let lidar =
        |sensor: &str, yaw: f64| json!({ "x": 0, "y": 0, "z": 1, "yaw": yaw, "sensor": sensor });
    let placements = json!({ "placements": [
        { "name": "one", "lidars": [lidar("ring", 0.0)] },
        { "name": "two", "lidars": [lidar("ring", 0.0), lidar("half", 0.0)] },
        { "name": "round", "lidars": [lidar("half", 0.0), lidar("half", 3.1)] } ] });
    write(dir, "rigs.json", &placements);
}

fn rows<'a>(found: &'a Value, placement: &str, target: &str) -> Vec<&'a Value> {
    let rows = found["rows"].list().iter();
    rows.filter(|row| row["placement"] == placement && row["target"] == target).collect()
}

const STUDY: &str = "study targets rigs.json --vehicle cart.json";

#[test]
fn level_beams_on_a_target_are_those_of_its_angle() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    let target = json!({ "sightline": 1, "name": "board", "reflectance": 0.5, "source": "made here",
        "shapes": [{ "box": { "foot": [0, 0, 0], "size": [0.2, 2, 1.5] } }] });
    write(&dir, "board.json", &target);
    let asked = "--target board.json --target tyre --distances 60,10,20 --bearings 0,180";
    let found = ok(&dir, &(STUDY, asked));
    for row in rows(&found, "one", "board") {
        let half = (1.0 / (row["distance"].number() - 0.1)).atan().to_degrees();
        let beams = 2 * (half / 0.1).floor() as u64 + 1;
        assert_eq!((&row["beams"], &row["by_lidar"]), (&json!(beams), &json!([beams])), "{row}");
    }
    // Level beams at 1 m pass over a tyre; the second LiDAR looks down, but not back.
    assert!(rows(&found, "one", "tyre").iter().all(|row| row["beams"] == 0));
    for row in rows(&found, "two", "board") {
        let [ring, half] = [0, 1].map(|k| row["by_lidar"][k].as_u64().unwrap());
        assert_eq!(row["beams"], ring + half);
        assert_eq!(half > 0, row["bearing"] == 0.0, "{row}");
    }
    // A direction that is given twice has one row.
    let twice = "--target tyre --distances 10 --bearings 0,180,360,0,-180";
    let (_, [_, told]) = ran(&dir, &(STUDY, twice));
    told.says("--bearings: 360° is 0°: given once, as 0°");
    told.says("--bearings: -180° is 180°: given once, as 180°");
    assert_eq!(told.matches("given once").count(), 2, "{told}");
    let found_twice = ok(&dir, &(STUDY, twice));
    let bearings = rows(&found_twice, "one", "tyre");
    let bearings: Vec<&Value> = bearings.iter().map(|row| &row["bearing"]).collect();
    assert_eq!(bearings, [&json!(0.0), &json!(180.0)]);
    // No sensor reaches farther than 80 m: that is said once of all rigs.
    let told = stderr(&dir, &(STUDY, "--target board.json --distances 60,82,100,120 --bearings 0"));
    let words = "--distances: a rig whose sensors reach 80 m at most meets no target at 100, 120 m: this lies beyond their range";
    assert!(told.matches(words).count() == 1, "{told}");
    stderr(&dir, &(STUDY, asked)).lacks("beyond their range");
    let distances: Vec<&Value> =
        rows(&found, "one", "board").iter().map(|r| &r["distance"]).collect();
    assert_eq!(distances[..3], [&json!(10.0), &json!(20.0), &json!(60.0)]);
    assert_eq!(found["targets"][0]["size"], json!([0.2, 2.0, 1.5]));
    assert_eq!(found["targets"][0]["shapes"], target["shapes"]);
    assert!(found["targets"][1]["source"].text().contains("unconfirmed"));
    // At 60 m the board has 19 beams: the first detection with 20 is at 20 m.
    let found = ok(&dir, &(STUDY, asked, "--beams 20"));
    assert_eq!(found["detections"][0]["first"], 20.0);
    assert_eq!(found["detections"][0]["detected"], json!([[10.0, 20.0]]));
    // A return is rated at 30 m for 10 %: 50 % are seen to 30·√5 = 67 m, fog of 50 m takes 60 m away.
    let first = |more: &str| {
        let found = ok(&dir, &(STUDY, asked, more));
        found["detections"][0]["first"].number()
    };
    assert_eq!(first("--response"), 60.0);
    assert_eq!(first("--condition fog:mor=50"), 20.0);
}

#[test]
fn distances_that_are_not_given_go_to_the_range_of_the_sensors() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    let path = dir.path().join("cart.json");
    let cart = fs::read_to_string(&path).unwrap();
    let asked = &(STUDY, "--target car --bearings 0");
    for (range, last) in [(80.0, 80.0), (42.5, 40.0), (250.0, 200.0)] {
        fs::write(&path, cart.replace("\"range\":80", &format!("\"range\":{range}"))).unwrap();
        let found = ok(&dir, asked);
        let distances = rows(&found, "one", "car").into_iter().map(|row| row["distance"].as_f64());
        let distances: Vec<f64> = distances.flatten().collect();
        assert_eq!((distances[0], distances.last()), (5.0, Some(&last)));
        assert_eq!(found["reach"], json!(range));
        let [text, told] = printed(&dir, asked);
        let words = format!(
            "{last} m is the farthest distance looked at; the sensors reach {range} m (--distances)."
        );
        assert_eq!(text.lines().last(), Some(&*words), "{text}");
        told.lacks("beyond their range");
    }
}

#[test]
fn the_own_body_hides_a_target_and_the_card_says_so() {
    let dir = TempDir::new().unwrap();
    let wall =
        json!([{ "class": "vehicle", "box": { "min": [-2, -1.5, 0], "max": [-1.9, 1.5, 3] } }]);
    vehicle(dir.path(), wall);
    let asked = "--target car --distances 3,20 --bearings 0,180";
    let found = ok(&dir, &(STUDY, asked, "--out polar.svg"));
    for row in rows(&found, "one", "car") {
        let (is_behind, is_near) = (row["bearing"] == 180.0, row["distance"] == 3.0);
        // At 3 m its nose stands before the wall, in the own body.
        assert_eq!(row["beams"] == 0, is_behind && !is_near, "{row}");
        assert_eq!(row["overlaps"] == true, is_behind && is_near, "{row}");
    }
    let svg = read_text(&dir, "polar.svg");
    assert!(svg.contains("round") && svg.ends_with("</svg>\n"));
    let (_, [text, _]) = ran(&dir, &(STUDY, asked));
    text.says("ahead 0°").says("behind 180°");
    assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
}

/// A street that the cart stands in, with a wall on its left and a box on its way in the second frame.
fn street(dir: &Path) {
    let actor = json!({ "name": "box", "poses": [{ "x": 300, "y": 0 }, { "x": 8, "y": 0 }],
        "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [1, 4, 3] } }] });
    let scene = json!({ "sightline": 1, "name": "street", "frames": 2, "coverage": "first-hit",
        "vehicle": "cart.json",
        "roi": { "min": [-12, -12, -0.4], "max": [12, 12, 2.8], "voxel": [0.4, 0.4, 0.4] },
        "static": [
            { "class": "road", "plane": { "min": [-100, -100], "max": [100, 100], "z": -0.2 } },
            { "class": "wall", "box": { "foot": [0, 11, -0.2], "size": [60, 4, 6] } }],
        "actors": [actor] });
    write(dir, "street.json", &scene);
}

#[test]
fn in_a_scene_things_hide_a_target_and_take_its_place() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    street(dir.path());
    let asked = "study targets street.json rigs.json --backend cpu --target car";
    let places = ["--distances", "10.5,20", "--bearings", "0,90", "--frames", "2"];
    let found = ok(&dir, &(asked, &places));
    let beams = |bearing: f64, distance: f64, frame: u64| {
        let of = |row: &&&Value| {
            row["bearing"] == bearing && row["distance"] == distance && row["frame"] == frame
        };
        let rows = rows(&found, "one", "car");
        let row = rows.iter().find(of).unwrap();
        assert_eq!(row["scene"], "street");
        row["beams"].clone()
    };
    // The ground lies 0.2 m lower: the ring at 1 m still meets the car.
    let free = beams(0.0, 20.0, 0).as_u64().unwrap();
    assert_eq!(free, 2 * ((0.9_f64 / 17.75).atan().to_degrees() / 0.1).floor() as u64 + 1);
    assert_eq!(beams(0.0, 20.0, 1), 0, "the box stands before it");
    assert_eq!(beams(90.0, 10.5, 0), Value::Null, "the wall stands there");
    assert_eq!(beams(90.0, 20.0, 0), 0, "the wall stands before it");
    let first = |found: &Value| found["detections"][0]["first"].clone();
    assert_eq!(first(&found), Value::Null, "in both frames");
    let found = ok(&dir, &(asked, &places, "--in 1"));
    assert_eq!(first(&found), 20.0, "in one of two frames");
    let text = |within: &str| stdout(&dir, &(asked, &places, within));
    let counts = "fewest–most beams of a frame; a target is detected with 5 or more";
    text("--in 1")
        .says("5 beams or more meet a target in 1 frame or more, over 2 frames of street")
        .says(&format!("{counts} in 1 frame or more\n"));
    text("--in 2")
        .says("5 beams or more meet a target in every frame, over 2 frames of street")
        .says(&format!("{counts} in every frame\n"));
}

#[test]
fn a_body_that_moves_takes_places_where_it_stands_in_each_frame() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    street(dir.path());
    let path = dir.path().join("cart.json");
    let mut cart: Value = serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    let bar =
        json!({ "class": "vehicle", "box": { "min": [-0.2, 0.4, 0.2], "max": [0.2, 0.6, 0.6] } });
    let at = |x: f64| json!({ "x": x, "y": 0 });
    cart["bodies"] = json!([{ "parts": [bar], "poses": [at(-5.0), at(-15.0)] }]);
    write(&dir, "cart.json", &cart);
    let asked = "study targets street.json rigs.json --backend cpu --target car --distances 5,15 --bearings 180 \
                 --frames 2";
    let found = ok(&dir, asked);
    let rows = rows(&found, "one", "car");
    assert_eq!(rows.len(), 4);
    for row in rows {
        // The bar touches the side of the car, not its middle.
        let is_taken = (row["frame"] == 0) == (row["distance"] == 5.0);
        assert_eq!(row["overlaps"] == true, is_taken, "{row}");
        assert!(row["beams"].is_number(), "{row}");
    }
}

#[test]
fn every_score_carries_its_card_and_names_what_is_blind() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    street(dir.path());
    let found = ok(&dir, "score street.json rigs.json --backend cpu");
    let [one, two, round] = [0, 1, 2].map(|k| &found["scores"][k]);
    let guards = |scores: &Value| scores["guards"].to_string();
    assert!(!guards(one).contains("blind_sector") && !guards(two).contains("blind_sector"));
    assert!(!guards(round).contains("blind_sector"), "{}", guards(round));
    let card = &one["range_card"];
    assert_eq!(card["targets"].list().len(), 3);
    assert_eq!(card["targets"][0]["bearings"].list().len(), 16);
    assert_eq!(card["targets"][0]["bearings"][0]["met"][0][0], 2.5);
    let lidars = json!([
        { "x": 0, "y": 0, "z": 1, "sensor": "half" }]);
    write_rig(&dir, "ahead.json", "ahead", lidars);
    let found = ok(&dir, "score street.json ahead.json --backend cpu");
    guards(&found["scores"][0])
        .says("blind_sector: left and behind and right (in sectors of 30° over 210°, left round from 75° over 180° to -75°), worst at ");
}

#[test]
fn more_placements_than_are_looked_at_closely_are_said_and_have_no_card() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    street(dir.path());
    let lidar = json!({ "x": 0, "y": 0, "z": 1, "sensor": "half" });
    for count in [64, 65] {
        let rig = |k| json!({ "name": format!("r{k}"), "lidars": [lidar] });
        write(&dir, "many.json", &json!({ "placements": (0..count).map(rig).collect::<Vec<_>>() }));
        for (scenes, key) in [("street.json", "scores"), ("street.json street.json", "mean")] {
            let (_, found, told) = answer(&dir, &format!("score {scenes} many.json --backend cpu"));
            let words = "are looked at for up to 64 placements; here are more";
            assert_eq!(told.matches(words).count(), usize::from(count > 64), "{told}");
            let scores = found[key][count - 1].as_object().unwrap();
            assert_eq!(scores["range_card"].is_null(), count > 64, "{scores:?}");
            // The street has no ground.
            assert_eq!(scores.contains_key("blind_zone"), count > 64, "{scores:?}");
            assert!(!scores.contains_key("requirements_hold_in"), "no requirements: {scores:?}");
        }
    }
    // Beams that go through everything have no card, of however few placements.
    change_as(&dir, ["street.json", "through.json"], |scene| scene["coverage"] = json!("through"));
    for (scenes, key) in [("through.json", "scores"), ("through.json through.json", "mean")] {
        let (_, found, told) = answer(&dir, &format!("score {scenes} many.json --backend cpu"));
        told.lacks("are looked at");
        let scores = found[key][64].as_object().unwrap();
        assert!(!scores.contains_key("range_card"), "{scores:?}");
    }
}

#[test]
fn the_default_objective_does_not_win_by_looking_away() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    // All that changes is ahead: by gain alone both LiDARs look there.
    let walker = |x: [f64; 2]| {
        json!({ "name": "w", "poses": [{ "x": x[0], "y": 2 }, { "x": x[1], "y": -2 }],
        "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [2, 2, 1.8] } }] })
    };
    let scene = json!({ "sightline": 1, "name": "ahead", "frames": 2, "coverage": "first-hit",
        "vehicle": "cart.json", "psog": { "scan": { "window": 2, "stride": 1 } },
        "roi": { "min": [-2, -12, 0.2], "max": [24, 12, 2.6], "voxel": [0.4, 0.4, 0.4] },
        "static": [{ "class": "road", "plane": { "min": [-100, -100], "max": [100, 100], "z": 0 } }],
        "actors": [walker([6.0, 9.0]), walker([12.0, 14.0]), walker([18.0, 20.0])] });
    write(&dir, "front.json", &scene);
    let blind = |objective: &str| {
        let args = format!(
            "optimize front.json --backend cpu --evaluations 30 --seed 3 --objective {objective} --out {objective}"
        );
        let found = ok(&dir, &args);
        blind_degrees(&found["best"]["scores"])
    };
    // Two halves that look ahead, against two that must stand back to back to the tenth of a radian.
    let (gain, default) = (blind("information_gain"), blind("near_gain"));
    assert!(gain > 90.0 && default < 60.0, "{gain}° and {default}° are blind");
    let page = read_text(&dir, "information_gain/report.html");
    // The page begins with its blind sectors.
    page.says("Blind sectors:").says("BLIND: ");
}

#[test]
fn wrong_targets_are_one_sentence_each() {
    let dir = TempDir::new().unwrap();
    vehicle(dir.path(), json!([]));
    write(&dir, "flat.json", &json!({ "sightline": 1, "name": "flat", "shapes": [] }));
    for (more, word) in [
        ("--target chidl", "did you mean `child`?"),
        ("--target none.json", "none.json"),
        ("--target flat.json", "flat.json: shapes"),
        ("--target cart.json", "a vehicle"),
        ("--target car --target car", "is given twice"),
        ("--distances 10,-5", "metres above 0"),
        ("--in 5 --frames 2", "--in 5: is more than the 2 frames that are looked at"),
        ("--bearings north", "degrees from -360 to 360"),
        ("--condition wet:water=1", "fog, snow and rain alone"),
    ] {
        let told = fails(&dir, &(STUDY, more));
        assert!(told.contains(word) && told.lines().count() == 1, "{more}: {told}");
    }
    // Level ground has one frame, whatever is asked for; one that is asked for is no slip.
    let asked = "--target car --distances 10";
    stderr(&dir, &(STUDY, asked, "--frames 4 --in 3"))
        .says("--frames 4: without a scene there is one frame, level ground");
    stderr(&dir, &(STUDY, asked, "--frames 1 --in 1")).lacks("--frames");
    fails(&dir, "study targets rigs.json")
        .says("rigs.json: there is neither a scene nor a vehicle");
}

/// The cart in an empty yard, with rules on targets.
pub(crate) fn ruled(dir: &Path, require: Value) {
    vehicle(dir, json!([]));
    set_rules(dir, require);
    street(dir);
}

#[test]
fn rules_on_targets_are_shares_of_their_places() {
    let dir = TempDir::new().unwrap();
    let rule = |more: Value| {
        let mut rule = json!({ "target": "car", "from": 10, "within": 15, "share": 0.9 });
        rule.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        rule
    };
    // `half` sees ±90°: 12 of 24 steps of 15° from −180° to 165° and both ends, and the ends of a half turn.
    ruled(
        dir.path(),
        json!([
            rule(json!({ "name": "ahead", "bearing": [-60, 60] })),
            rule(json!({ "name": "round" })),
            rule(json!({ "name": "one lost", "bearing": [-60, 60], "without_any_one": true })),
            rule(
                json!({ "name": "many beams", "bearing": [0, 0], "beams": 100, "target": "tyre" })
            ),
            rule(json!({ "name": "half round", "share": 0.4 })),
            rule(json!({ "name": "half lost", "share": 0.4, "without_any_one": true })),
        ]),
    );
    let lidar = |yaw: f64| json!({ "x": 0, "y": 0, "z": 1, "yaw": yaw, "sensor": "half" });
    let rigs = json!({ "placements": [
        { "name": "single", "lidars": [lidar(0.0)] },
        { "name": "twice", "lidars": [lidar(0.0), lidar(0.0)] },
        { "name": "opposite", "lidars": [lidar(0.0), lidar(std::f64::consts::PI)] } ] });
    write(&dir, "rigs.json", &rigs);
    let found = ok(&dir, "score street.json rigs.json --backend cpu");
    let shares = |k: usize| -> Vec<(f64, bool)> {
        let list = found["scores"][k]["requirements"].list();
        list.iter().map(|r| (r["found"].number(), r["met"] == true)).collect()
    };
    let single = shares(0);
    assert_eq!((single[0], single[2]), ((1.0, true), (0.0, false)), "nothing is left of one");
    // A car at the edge of the half turn is met by the half of it that is inside.
    assert!((0.5..0.6).contains(&single[1].0) && !single[1].1, "{single:?}");
    let missing = |rule: usize| found["scores"][0]["requirements"][rule]["missing"].clone();
    assert_eq!(missing(0), Value::Null);
    let round = missing(1).text().to_owned();
    assert!(round.starts_with("missing at 10 to 15 m: "), "{round}");
    assert_eq!(missing(2), "missing at 10 to 15 m: all 17 bearings, -60° to 60°");
    // A share that suffices names its missed places, too; those of two LiDARs back to back without the worse one.
    assert_eq!((single[4], missing(4)), ((single[1].0, true), json!(round)));
    let half_lost = &found["scores"][2]["requirements"][5];
    assert_eq!(half_lost["met"], true, "{half_lost}");
    assert!(half_lost["missing"].text().starts_with("missing at 10 to 15 m: "));
    let one_lost = &found["scores"][0]["requirements"][2];
    assert_eq!((&one_lost["intact"], &one_lost["worst_without"]), (&json!(1.0), &json!(0)));
    assert_eq!(single[3], (0.0, false));
    let twice = shares(1);
    assert_eq!((twice[0], twice[2]), ((1.0, true), (1.0, true)));
    // The share is the same whichever of the two is lost: none of them is the worst.
    assert_eq!(found["scores"][1]["requirements"][2]["worst_without"], Value::Null);
    assert_eq!(found["scores"][2]["requirements"][2]["worst_without"], json!(0));
    let opposite = shares(2);
    assert_eq!((opposite[1], opposite[2].1), ((1.0, true), false));
    let names = &found["scores"][0]["requirements"];
    assert_eq!((&names[0]["name"], &names[0]["required"]), (&json!("ahead"), &json!(0.9)));
    // One of two that look alike could be left out, but for the rule that one may be lost.
    let redundant =
        |found: &Value| found["scores"][1]["guards"].to_string().contains("redundant_lidar");
    assert!(!redundant(&found), "{found}");
    ruled(dir.path(), json!([rule(json!({ "name": "ahead", "bearing": [-60, 60] }))]));
    let found = ok(&dir, "score street.json rigs.json --backend cpu");
    assert!(redundant(&found), "{found}");
    // Neither could be left out where a rule wants the beams of both.
    let of_both = [2, 4, 8, 16, 32, 64].into_iter().find_map(|beams| {
        let ahead =
            json!({ "name": "ahead", "bearing": [0, 0], "beams": beams, "target": "adult" });
        ruled(dir.path(), json!([rule(ahead)]));
        write(&dir, "rigs.json", &rigs);
        let found = ok(&dir, "score street.json rigs.json --backend cpu");
        let met = |k: usize| found["scores"][k]["requirements"][0]["met"] == true;
        (met(1) && !met(0)).then_some(found)
    });
    let found = of_both.expect("some beams need both");
    assert!(!redundant(&found), "{found}");
}

#[test]
fn a_search_meets_a_rule_that_gain_alone_does_not_and_says_so_where_it_cannot() {
    let dir = TempDir::new().unwrap();
    let rule = |share: f64, beams: u64| json!([{ "target": "adult", "within": 15, "bearing": [100, 260], "share": share, "beams": beams }]);
    ruled(dir.path(), rule(0.9, 5));
    let args = |out: &'static str| {
        let objective = "--objective information_gain --out";
        format!("optimize street.json --backend cpu --evaluations 30 --seed 2 {objective} {out}")
    };
    let (code, found, _) = answer(&dir, &args("met"));
    let requirement = &found["best"]["scores"]["requirements"][0];
    assert_eq!((code, &requirement["met"]), (Some(0), &json!(true)), "{requirement}");
    assert_eq!(requirement["name"], "adult from 5 to 15 m, 100° to 260°");
    let page = read_text(&dir, "met/report.html");
    page.says("<code>sightline study tolerance street.json met</code>");
    // No rig puts 100 beams on an adult at 15 m: the run ends with 1, its page begins with what is not met.
    ruled(dir.path(), rule(1.0, 100));
    let (code, _, told) = answer(&dir, &args("unmet"));
    assert_eq!(code, Some(1), "{told}");
    let page = read_text(&dir, "unmet/report.html");
    page.says("NOT MET: adult from 5 to 15 m, 100° to 260°, 100 beams: ");
    // A margin is the difference of the numbers beside it.
    let row = page.split("adult from 5 to 15 m, 100° to 260°, 100 beams</").nth(1).unwrap();
    let cells: Vec<&str> = row.split("</tr>").next().unwrap().split('>').collect();
    let numbers: Vec<f64> =
        cells.iter().filter_map(|cell| cell.split('<').next().unwrap().parse().ok()).collect();
    let [found, required, margin, ..] = numbers[..] else { panic!("{row}") };
    assert_eq!(format!("{:.1}", found - required), format!("{margin:.1}"), "{row}");
}

#[test]
fn wrong_rules_are_refused_with_their_place() {
    let dir = TempDir::new().unwrap();
    // Where beams end at nothing no target is met: that is said, not passed over.
    ruled(dir.path(), json!([{ "target": "car", "within": 10, "share": 1 }]));
    let path = dir.path().join("street.json");
    let street = fs::read_to_string(&path).unwrap().replace("first-hit", "through");
    fs::write(&path, street).unwrap();
    fails(&dir, "score street.json rigs.json")
        .says("requires `car from 5 to 10 m`, and beams end at nothing");
    let told = |rule: Value| {
        ruled(dir.path(), json!([rule]));
        fails(&dir, "score street.json rigs.json")
    };
    let cases = [
        (json!({ "target": "chidl", "within": 10, "share": 1 }), "`child`"),
        (
            json!({ "target": "none.json", "within": 10, "share": 1 }),
            "cart.json: require[0].target: none.json: cannot be read",
        ),
        (
            json!({ "target": "street.json", "within": 10, "share": 1 }),
            "require[0].target: `street.json` is not a target: street.json is a scene; name a preset",
        ),
        (json!({ "target": "car", "share": 1 }), "within"),
        (json!({ "target": "car", "within": 10, "share": 95 }), "require[0].share"),
        (json!({ "target": "car", "within": -1, "share": 1 }), "require[0].within"),
        (json!({ "target": "car", "within": 10, "from": 20, "share": 1 }), "require[0].within"),
        (
            json!({ "target": "car", "within": 10, "bearing": [60, -60], "share": 1 }),
            "require[0].bearing",
        ),
        (json!({ "target": "car", "within": 10, "beams": 0, "share": 1 }), "require[0].beams"),
        (
            json!({ "target": "car", "within": 10, "share": 1, "min": [0, 0, 0] }),
            "leave the box out",
        ),
        (json!({ "name": "box", "share": 1 }), "`target`"),
        (
            json!({ "name": "box", "min": [0, 0, 0], "max": [1, 1, 1], "share": 1, "beams": 3 }),
            "beams",
        ),
    ];
    for (rule, word) in cases {
        let told = told(rule.clone());
        assert!(told.contains(word) && told.contains("cart.json"), "{rule}: {told}");
    }
}
