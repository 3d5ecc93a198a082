//! `study nearfield`, weights of near ground and the guard of the own body, from outside.

use crate::cli::*;

/// The yard with a LiDAR over the roof of its vehicle.
fn yard(dir: &TempDir) {
    let lidar = json!({ "channels": 12, "fov": [-30, 0], "azimuth_steps": 120, "range": 60 });
    let mount = json!({ "min": [-1.5, -0.8, 1.6], "max": [1.5, 0.8, 2.4], "lidars": 1 });
    write(dir, "yard.json", &level_yard(lidar, mount));
    let pose = |z: f64| json!([{ "x": 0.0, "y": 0.0, "z": z }]);
    let low = json!({ "name": "low", "lidars": pose(1.6) });
    let high = json!({ "name": "high", "lidars": pose(2.4) });
    write(dir, "two.json", &json!({ "placements": [low, high] }));
}

#[test]
fn the_near_field_of_two_heights() {
    let dir = TempDir::new().unwrap();
    yard(&dir);
    let study = "study nearfield yard.json two.json --backend cpu";
    let found = ok(&dir, &(study, "--out n.svg"));
    let of = |k: usize| found["near_fields"][k].clone();
    let number = |value: &Value| value.number();
    let (low, high) = (of(0), of(1));
    assert!(number(&low["ring"]) < number(&high["ring"]), "{low} {high}");
    assert!(number(&low["beams"][0]["own"]) > number(&high["beams"][0]["own"]));
    // The outline is as deep before an edge as the depth that is told.
    for (side, rig) in
        ["ahead", "left", "right"].iter().flat_map(|side| [(side, &low), (side, &high)])
    {
        let lanes = rig["zone"]["lanes"].list().iter();
        let depths = lanes.filter(|lane| lane["side"] == *side).map(|lane| lane["depth"].as_f64());
        // A lane that does not end leaves none.
        let deepest = depths.reduce(|a, b| Some(a?.max(b?))).unwrap();
        assert_eq!(deepest, rig["zone"][side].as_f64(), "{side}: {rig}");
    }
    assert_eq!(low["poles"].list().len(), 58);
    let area = number(&found["ground_area"]);
    let (share, blind) = (number(&high["near_field"]), number(&high["blind_area"]));
    assert!(((1.0 - share) * area - blind).abs() < 0.01 * area, "{share} of {area}: {blind}");
    let svg = read_text(&dir, "n.svg");
    // Every line of the legend ends within the drawing; letters of 13 pixels are 7.2 wide on average.
    let width: f64 =
        svg.split_once(" width=\"").unwrap().1.split_once('"').unwrap().0.parse().unwrap();
    let legend = svg.rsplit_once("<g ").unwrap().1;
    let mut names = 0;
    for element in legend.split("<text x=\"").skip(1) {
        let (x, rest) = element.split_once('"').unwrap();
        let words = rest.split_once('>').unwrap().1.split_once('<').unwrap().0;
        let end = 8.0 + x.parse::<f64>().unwrap() + 7.2 * words.chars().count() as f64;
        assert!(end < width, "{words} ends at {end} of {width}");
        names += 1;
    }
    assert_eq!(names, 8, "{legend}");
    // So do the words over each drawing: of two, each is half as wide.
    let over = svg.split_once("<path").unwrap().0.split("<text x=\"8\"").skip(1);
    let over = over.map(|text| text.split_once('>').unwrap().1.split_once('<').unwrap().0);
    let over: Vec<&str> = over.collect();
    assert!(over.len() == 3 && over[2].ends_with(" poles"), "{over:?}");
    assert!(
        over.iter().all(|words| 8.0 + 7.2 * (words.chars().count() as f64) < width / 2.0),
        "{over:?}"
    );
    assert!(svg.matches("<circle").count() >= 116 && svg.ends_with("</svg>\n"));
    // Fog hides what is far, a wet road mirrors what is flat: more ground is blind, and more beams end at nothing.
    let weather = "--condition fog:mor=10 --condition wet:water=1";
    let hidden = ok(&dir, &(study, weather));
    assert_eq!(hidden["conditions"], json!(["fog:mor=10", "wet:water=1"]));
    let hidden = &hidden["near_fields"][1];
    assert!(number(&hidden["blind_area"]) > number(&high["blind_area"]), "{hidden} {high}");
    assert!(number(&hidden["beams"][0]["nothing"]) > number(&high["beams"][0]["nothing"]));
    fails(&dir, &(study, "--condition rain --condition rain")).says("rain is given twice");
    let (_, [text, _]) = ran(&dir, study);
    assert_eq!(text.lines().count(), 10, "{text}");
    text.says("\nground is seen where a beam ends on ground within 0.5 m\n");
    assert!(text.ends_with("partly unconfirmed; no type approval (docs/nearfield.md)\n"), "{text}");
    // Shares of ground are rounded down like shares of requirements.
    let row = text.lines().find(|line| line.starts_with("high ")).unwrap();
    let shown = row.split_whitespace().nth(1).unwrap();
    assert_eq!(shown, format!("{:.1}", (1e3 * share).floor() / 10.0), "{share}");
    let (_, [text, _]) = ran(&dir, &(study, weather));
    text.says("under fog:mor=10 and wet:water=1");
}

#[test]
fn a_lidar_on_the_roof_is_told_off_and_weights_are_told() {
    let dir = TempDir::new().unwrap();
    yard(&dir);
    let scored =
        |more: &str| ok(&dir, &("score yard.json two.json --backend cpu", more))["scores"].clone();
    let plain = scored("");
    let guards = |k: usize| plain[k]["guards"].to_string();
    assert!(guards(0).contains("self_hit: LiDAR 0 ends") && !guards(1).contains("self_hit"));
    // The near field is a score: that of the study.
    let study = ok(&dir, "study nearfield yard.json two.json --backend cpu");
    let looked = scored("--near-field");
    for k in 0..2 {
        let near = &study["near_fields"][k];
        // Scores have nine digits.
        let same = |score: &str, share: &str| {
            let [a, b] = [&looked[k][score], &near[share]].map(|value| value.number());
            assert!((a - b).abs() < 1e-9, "{score}: {a} is not {b}");
        };
        same("near_field", "near_field");
        same("near_ring", "ring");
        assert!(plain[k]["near_field"].is_null());
    }
    // Over several scenes too, in each and in the mean.
    let both = ok(&dir, "score yard.json yard.json two.json --near-field --backend cpu");
    for scores in [&both["scenes"][0]["scores"], &both["scenes"][1]["scores"], &both["mean"]] {
        let guards = |k: usize| scores[k]["guards"].to_string();
        assert!(guards(0).contains("self_hit") && !guards(1).contains("self_hit"), "{scores}");
        assert_eq!(scores[1]["near_field"], looked[1]["near_field"]);
    }
}

#[test]
fn without_a_scene_the_near_field_is_that_of_level_ground() {
    let dir = TempDir::new().unwrap();
    yard(&dir);
    let yard = read_json(dir.path().join("yard.json"));
    let cart = json!({ "sightline": 1, "name": "cart", "body": yard["ego"]["body"],
        "sensors": [{ "name": "turning", "phase": 0, "lidar": yard["lidar"] }],
        "mounts": [{ "name": "roof", "sensors": ["turning"], "count": [1, 1],
                     "min": [-1.5, -0.8, 1.6], "max": [1.5, 0.8, 2.4] }] });
    write(&dir, "cart.json", &cart);
    let more = "--vehicle cart.json --backend cpu";
    let near = ok(&dir, &("study nearfield two.json", more));
    let shared = ok(&dir, &("study redundancy two.json", more));
    for (near, shared) in near["near_fields"].list().iter().zip(shared["rows"].list()) {
        assert_eq!(near["name"], shared["placement"]);
        let unseen = |ground: &str| shared[ground]["share"][0].number();
        let seen = |key: &str| near[key].number();
        assert!((seen("near_field") - (1.0 - unseen("ground_10m"))).abs() < 1e-12, "{near}");
        assert!((seen("ring") - (1.0 - unseen("ground_3m"))).abs() < 1e-12, "{near}");
    }
    // The lower one looks over the edge of the roof at ground beyond 10 m.
    let seen = |k: usize| near["near_fields"][k]["near_field"].number();
    assert!(seen(0) == 0.0 && seen(1) > 0.1, "{near}");
}

#[test]
fn what_cannot_be_is_named() {
    let dir = TempDir::new().unwrap();
    yard(&dir);
    fs::create_dir(dir.path().join("run")).unwrap();
    fs::copy(dir.path().join("two.json"), dir.path().join("run/placements.json")).unwrap();
    write(&dir, "run/result.json", &json!({ "best": { "placement": { "name": "high" } } }));
    for (args, says) in [
        ("study nearfield none.json", "none.json"),
        ("study nearfield yard.json two.json --out two.json", "two.json"),
        ("study", "<KIND>"),
        ("study nearfield two.json", "two.json: there is neither a scene nor a vehicle"),
        ("study nearfield run", "run/placements.json:high: there is neither a scene nor"),
        ("cast run two.json", "run: is the folder of a run, where a scene belongs; give"),
        ("study lidars run", "high: holds placements, which `study lidars` does not take"),
    ] {
        fails(&dir, args).says(says);
    }
    let text = read_text(&dir, "yard.json");
    write(&dir, "yard.json", &text.replace("road", "wall"));
    fails(&dir, "study nearfield yard.json --backend cpu")
        .says("yard.json: there is no ground within 10 m");
}

#[test]
fn a_search_looks_away_from_the_own_body() {
    let dir = TempDir::new().unwrap();
    let block = |class: &str, low: [f64; 3], high: [f64; 3]| json!({ "class": class, "box": { "min": low, "max": high } });
    let actor = |class: &str, size: [f64; 3], poses: [[f64; 3]; 3]| {
        json!({ "parts": [{ "class": class, "box": { "foot": [0, 0, 0], "size": size } }],
                "poses": poses.map(|[x, y, yaw]| json!({ "x": x, "y": y, "yaw": yaw })) })
    };
    write(
        &dir,
        "rings.json",
        &json!({ "elevation_deg":
        [-31, -25, -19, -15, -12, -9.5, -7, -5.5, -4, -3, -2.5, -2, -1, -0.5, 0, 1, 2, 3, 6, 11] }),
    );
    let vehicle = json!({ "sightline": 1, "min_distance": 0.15,
        "body": [block("vehicle", [-2.0, -1.0, 0.3], [2.5, 1.0, 1.5]),
                 block("vehicle", [-1.5, -0.9, 1.5], [1.0, 0.9, 2.0])],
        "sensors": [{ "name": "a", "phase": 0, "lidar": { "file": "rings.json", "azimuth_steps": 180, "range": 60 } }],
        "mounts": [{ "name": "roof", "min": [-0.3, -0.4, 2.2], "max": [0.3, 0.4, 2.2], "pitch": [0, 0.2], "count": 2 }] });
    let scene = json!({ "sightline": 1, "coverage": "first-hit", "frames": 3, "vehicle": vehicle,
        "roi": { "min": [-15, -15, -1], "max": [15, 15, 3], "voxel": [0.5, 0.5, 0.5] },
        "static": [{ "class": "road", "plane": { "min": [-80, -80], "max": [120, 80], "z": 0 } },
                   block("building", [5.0, 8.0, 0.0], [14.0, 16.0, 6.0]),
                   { "class": "wall", "box": { "center": [-9, -7, 1], "size": [7, 0.4, 2], "yaw": 0.4 } }],
        "actors": [actor("vehicle", [4.2, 1.8, 1.5], [[9.0, -7.0, 0.3], [8.0, -2.5, 0.5], [7.0, 2.0, 2.0]]),
                   actor("pedestrian", [0.4, 0.5, 1.75], [[3.0, -3.0, 0.0], [4.0, -2.6, 0.0], [5.0, -2.2, 0.0]])],
        "ego": { "poses": [{ "x": 0, "y": 0 }, { "x": 1.3, "y": 0.4, "yaw": 0.2 }, { "x": 2.5, "y": -0.7, "yaw": -0.5 }] },
        "psog": { "scan": { "spacing": 0.4, "window": 1 } } });
    write(&dir, "s.json", &scene);
    let args =
        "--objective information_gain --tolerance 0 --evaluations 40 --backend cpu --out run";
    let found = ok(&dir, &format!("optimize s.json {args}"))["best"].clone();
    assert!(!found["scores"]["guards"].to_string().contains("self_hit"), "{found}");
    // Every pair of a coarser grid, of poses that do not look at the roof: `plain` is far below them.
    let pose = |k: usize| {
        let (x, y, pitch) =
            (0.3 * (k / 15) as f64 - 0.3, 0.4 * (k / 5 % 3) as f64 - 0.4, 0.05 * (k % 5) as f64);
        json!({ "x": x, "y": y, "z": 2.2, "pitch": pitch })
    };
    let scores = |rigs: Vec<Vec<usize>>| {
        let lidars = |rig: &Vec<usize>| rig.iter().map(|&k| pose(k)).collect::<Vec<_>>();
        let rigs = rigs.iter().enumerate();
        let rigs: Vec<Value> = rigs
            .map(|(k, rig)| json!({ "name": format!("r{k}"), "lidars": lidars(rig) }))
            .collect();
        write(&dir, "rigs.json", &json!({ "placements": rigs }));
        ok(&dir, "score s.json rigs.json --tolerance 0 --backend cpu")["scores"].list().to_vec()
    };
    let alone = scores((0..45).map(|k| vec![k]).collect());
    let is_clear = |k: &usize| !alone[*k]["guards"].to_string().contains("self_hit");
    let clear: Vec<usize> = (0..45).filter(is_clear).collect();
    assert!((5..40).contains(&clear.len()), "{clear:?}");
    let best_of = |few: &[usize]| {
        let pairs = few.iter().flat_map(|a| few.iter().map(|b| vec![*a, *b]));
        let gains = scores(pairs.filter(|pair| pair[0] / 5 < pair[1] / 5).collect());
        gains.iter().map(|of| of["information_gain"].number()).fold(0.0, f64::max)
    };
    let (best, pair) = (found["objective"].number(), best_of(&clear));
    assert!(best >= pair, "{best} {pair}");
    let all: Vec<usize> = (0..45).collect();
    assert!(best_of(&all) > pair, "a pair that looks at the roof gains more");
}

#[test]
fn scores_results_and_pages_have_the_depths_of_the_study() {
    let dir = TempDir::new().unwrap();
    yard(&dir);
    let study = ok(&dir, "study nearfield yard.json two.json --frames 4 --backend cpu");
    let depths = |of: &Value| ["ahead", "behind", "left", "right"].map(|side| of[side].clone());
    let zone = |k: usize| depths(&study["near_fields"][k]["zone"]);
    let score = "score yard.json two.json --backend cpu";
    let scores = ok(&dir, score);
    for k in 0..2 {
        let found = &scores["scores"][k]["blind_zone"];
        for (found, wanted) in depths(found).iter().zip(zone(k)) {
            match wanted.is_null() {
                true => assert!(found.is_null(), "{scores}"),
                false => assert!((found.number() - wanted.number()).abs() < 1e-9, "{scores}"),
            }
        }
        assert_eq!(found["frames"], study["frames"], "{found}");
    }
    assert_ne!(zone(0), zone(1), "one rig sees nearer ground than the other");
    let [ahead, ..] = zone(1).map(|depth| (10.0 * depth.as_f64().unwrap() - 1e-6).ceil() / 10.0);
    let words = format!("; blind zone over {} frame", study["frames"]);
    let (_, [text, _]) = ran(&dir, score);
    let line = text.lines().find(|line| line.starts_with("high: ")).unwrap();
    line.says(&words).says(&format!(": ahead {ahead:.1} m, behind "));
    printed(&dir, "view yard.json two.json:high --out v.html --backend cpu");
    let page = read_text(&dir, "v.html");
    page.says("<p>Blind zone, ground straight before the body that no beam reaches, over ");
    page.says(&format!("ahead {ahead:.1} m, behind "));
    // Each scene has depths of its own; the mean over scenes has the depths of the first scene.
    let both = ok(&dir, "score yard.json yard.json two.json --backend cpu");
    for all in [&both["scenes"][1]["scores"], &both["mean"]] {
        assert_eq!(all[1]["blind_zone"], scores["scores"][1]["blind_zone"]);
    }
    let run = "optimize yard.json --out run --evaluations 20 --seed 1 --backend cpu";
    printed(&dir, run);
    let result = read_json(dir.path().join("run/result.json"));
    let [found, near] = [&result["best"]["scores"]["blind_zone"], &result["near_field"]];
    assert_eq!(depths(found), depths(&near["zone"]), "{found}");
    assert_eq!(found["frames"], near["frames"]);
}
