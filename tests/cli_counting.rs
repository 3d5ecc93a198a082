//! Requirements for which no place and no cell counts: refused, by each command, rather than met or missed by every rig.

use crate::cli::*;

/// Level road around a vehicle whose body is a box in plan, with one requirement.
fn parked(dir: &Path, [min, max]: [[f64; 2]; 2], require: &Value) {
    let vehicle = json!({ "sightline": 1, "name": "box",
        "body": [{ "class": "vehicle", "box": { "min": [min[0], min[1], 0.4], "max": [max[0], max[1], 1.5] } }],
        "sensors": [{ "name": "a", "lidar": { "channels": 16, "fov": [-24.8, 2], "azimuth_steps": 90, "range": 60 } }],
        "mounts": [{ "name": "roof", "min": [-1, -0.5, 1.6], "max": [1, 0.5, 3.5], "count": [0, 2] }],
        "require": [{ "name": "all", "min": [-8, -8, -0.5], "max": [8, 8, 1.5], "share": 0 }, require] });
    write(dir, "box.json", &vehicle);
    let scene = json!({ "sightline": 1, "name": "road", "coverage": "first-hit", "vehicle": "box.json",
        "roi": { "min": [-8, -8, -0.5], "max": [8, 8, 1.5], "voxel": [1, 1, 1] },
        "static": [{ "class": "road", "plane": { "min": [-20, -20], "max": [20, 20], "z": 0 } }] });
    write(dir, "road.json", &scene);
    write_rig(dir, "p.json", "p", json!([{ "x": 0, "y": 0, "z": 3.2 }]));
}

const SCORE: &str = "score road.json p.json --backend cpu";
/// Body from x = -2 to 2.5 and y = -0.9 to 0.9.
const CAR: [[f64; 2]; 2] = [[-2.0, -0.9], [2.5, 0.9]];

#[test]
fn ground_nearer_than_any_cell_is_an_error_that_says_from_where_on() {
    let dir = TempDir::new().unwrap();
    // Middles of cells lie at odd eighths of a metre: the nearest at x = 2.625, 0.125 m ahead, and at y = 1.125, 0.225 m
    // beside the body.
    for (rule, field, least) in [
        (json!({ "ground": 0.05, "share": 0.5 }), "ground", "0.13"),
        (json!({ "ground": 0.12, "share": 0.5 }), "ground", "0.13"),
        (json!({ "blind_zone": "ahead", "depth": 0.1 }), "depth", "0.13"),
        (json!({ "blind_zone": "left", "depth": 0.2 }), "depth", "0.23"),
    ] {
        parked(dir.path(), CAR, &rule);
        fails(&dir, SCORE)
            .says(&format!("box.json: require[1].{field}: "))
            .says(&format!("give {least} or more"));
    }
    let told = fails(&dir, "optimize road.json --out run --evaluations 5 --backend cpu");
    assert!(told.contains("require[1].depth") && !dir.path().join("run").exists(), "{told}");
    for rule in [
        json!({ "ground": 0.13, "share": 0.5 }),
        json!({ "blind_zone": "ahead", "depth": 0.13 }),
        json!({ "blind_zone": "left", "depth": 0.23 }),
    ] {
        parked(dir.path(), CAR, &rule);
        let found = &ok(&dir, SCORE)["scores"][0]["requirements"][1];
        assert!(found["found"].is_number(), "{found}");
    }
    // A body between two lanes has none before its edges; a line has no outline, and a large one too many cells.
    let thin = [[-2.0, 0.01], [2.5, 0.02]];
    parked(dir.path(), thin, &json!({ "blind_zone": "ahead", "depth": 5 }));
    fails(&dir, SCORE).says("require[1].blind_zone").says("narrower");
    parked(dir.path(), [[-2e5, -0.9], [2e5, 0.9]], &json!({ "ground": 3, "share": 0.5 }));
    fails(&dir, SCORE).says("its body is 400000 m long or wide");
}

#[test]
fn a_target_whose_places_all_lie_in_the_own_body_is_an_error() {
    let dir = TempDir::new().unwrap();
    let truck = [[-4.0, -1.2], [8.0, 1.2]];
    let child = |within: f64| json!({ "target": "child", "within": within, "bearing": [-5, 5], "share": 0.95 });
    // Places at 5, 6 and 7 m straight ahead; the body ends at 8 m.
    parked(dir.path(), truck, &child(7.0));
    fails(&dir, SCORE)
        .says("box.json: require[1]: every place of `child from 5 to 7 m, -5° to 5°` lies in the own body");
    fails(&dir, "study sweep p.json --vehicle box.json --of 0.z --from 3 --to 3.4 --backend cpu")
        .says("require[1]: every place");
    // Among 5, 7.5 and 10 m only the last is free: it alone counts.
    parked(dir.path(), truck, &child(10.0));
    let found = &ok(&dir, SCORE)["scores"][0]["requirements"][1];
    assert!([0.0, 1.0].contains(&found["found"].number()), "{found}");
}

#[test]
fn a_target_on_the_ground_of_a_scene_wants_a_scene_with_free_ground() {
    let dir = TempDir::new().unwrap();
    let car = |within: f64, ground: &str| {
        json!({ "name": "car", "target": "car", "from": within, "within": within, "beams": 45, "ground": ground,
            "share": 0.5 })
    };
    let sweep = "study sweep p.json --vehicle box.json --of 0.z --from 3 --to 3.4 --backend cpu";
    parked(dir.path(), CAR, &car(8.0, "scene"));
    fails(&dir, sweep).says(
        "box.json: require[1].ground: `car` stands on the ground of a scene, and there is none",
    );
    let found = ok(&dir, SCORE)["scores"][0]["requirements"][1]["found"].clone();
    // Names do not tell a scene from the level ground of commands without one.
    let road = read_text(&dir, "road.json");
    let named = road.replace(r#""name":"road""#, r#""name":"level ground""#);
    assert_ne!(named, road);
    fs::write(dir.path().join("road.json"), named).unwrap();
    assert_eq!(ok(&dir, SCORE)["scores"][0]["requirements"][1]["found"], found);
    // The road ends at 20 m.
    parked(dir.path(), CAR, &car(40.0, "scene"));
    fails(&dir, SCORE)
        .says("box.json: require[1]: no place of `car` is free")
        .says(": there is no ground below any of its 48 places; change");
    // Beams and other targets are looked at whether or not the scene can judge the requirement.
    ok(&dir, "cast road.json p.json --backend cpu");
    ok(&dir, "study targets road.json p.json --target car --distances 8 --backend cpu");
    // This scene is level, and its rule has the share of the study there.
    parked(dir.path(), CAR, &car(8.0, "scene"));
    let bearings: Vec<String> =
        (1..=48).map(|k| (f64::from(k) * 7.5 - 180.0).to_string()).collect();
    let bearings = format!("--bearings={}", bearings.join(","));
    let study =
        "study targets road.json p.json --target car --distances 8 --frames 1 --backend cpu";
    let rows = ok(&dir, &(study, bearings))["rows"].clone();
    let met = |row: &&Value| row["beams"].as_u64().is_some_and(|beams| beams >= 45);
    let rows = rows.list();
    let met = rows.iter().filter(met).count();
    assert!(met > 0 && met < 48, "{met}");
    assert_eq!((rows.len(), found.as_f64()), (48, Some(met as f64 / 48.0)));
    for (rule, said) in [
        (car(8.0, "level"), "require[1].ground: `level` is not `scene`; leave it out"),
        (json!({ "ground": "scene", "share": 1 }), "require[1].ground: `scene` is not a number"),
        (
            json!({ "target": "car", "within": 9, "ground": true, "share": 1 }),
            "or \"scene\" of a target",
        ),
    ] {
        parked(dir.path(), CAR, &rule);
        fails(&dir, SCORE).says(said);
    }
}
