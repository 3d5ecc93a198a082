//! Rigs of several sensor models on the command line: LiDARs that name their model, or none.

use crate::cli::*;
use crate::cli_vehicle::{CPU, changed, garage};

/// Two LiDARs of a cart: without models, and with their own.
fn two_lidars(dir: &Path) {
    let lidars = |models: [Option<&str>; 2]| -> Vec<Value> {
        let places = [
            json!({ "x": 0.1, "y": 0.0, "z": 1.5 }),
            json!({ "x": 0.0, "y": 0.5, "z": 1.0, "yaw": 1.5 }),
        ];
        let named = places.into_iter().zip(models).map(|(mut lidar, model)| {
            if let Some(model) = model {
                lidar["sensor"] = json!(model);
            }
            lidar
        });
        named.collect()
    };
    for (file, models) in
        [("plain.json", [None, None]), ("named.json", [Some("spinning"), Some("solid")])]
    {
        let all = json!({ "placements": [{ "name": "a", "lidars": lidars(models) }] });
        fs::write(dir.join(file), all.to_string()).unwrap();
    }
}

const CART: [&str; 4] = ["--vehicle", "cart.json", "--backend", "cpu"];

#[test]
fn no_command_picks_a_model_for_a_lidar_that_names_none() {
    let dir = garage();
    two_lidars(dir.path());
    let wanted = "plain.json: placement `a`, LiDAR 0 names no sensor, and the vehicle has 2 models: \
                  spinning, solid; add \"sensor\": \"spinning\" to the LiDAR, or give --sensor 0=spinning";
    for args in [
        &["score", "room.json", "plain.json"][..],
        &["score", "room.json", "room.json", "plain.json"],
        &["cast", "room.json", "plain.json"],
        &["view", "room.json", "plain.json", "--out", "v.html"],
        &["view", "room.json", "named.json", "--baseline", "plain.json", "--out", "v.html"],
        &["scan", "room.json", "--placement", "plain.json", "--out", "scans"],
        &["audit", "room.json", "plain.json"],
        &["optimize", "room.json", "--baselines", "plain.json", "--out", "o"],
        &["optimize", "room.json", "--inject", "plain.json", "--out", "o"],
    ] {
        let said = fails(&dir, &[args, &CART].concat());
        assert!(said.contains(wanted), "{args:?}: {said}");
    }
    let gain = |file: &str, more: &[&str]| {
        let args = [&["score", "room.json", file][..], &CART, more].concat();
        ok(&dir, &args)["scores"][0]["information_gain"].as_f64().unwrap()
    };
    let own = gain("named.json", &[]);
    assert_eq!(gain("plain.json", &["--sensor", "0=spinning", "--sensor", "all=solid"]), own);
    assert!(gain("plain.json", &["--sensor", "all=spinning"]) > own);
    let replaced = [&["score", "room.json", "named.json", "--sensor", "1=spinning"][..], &CART];
    let said = fails(&dir, &replaced.concat());
    assert!(
        said.contains("LiDAR 1 is a `solid`, and --sensor 1=spinning says otherwise"),
        "{said}"
    );
}

#[test]
fn a_mixed_rig_keeps_its_score_through_every_format_or_is_refused() {
    let dir = garage();
    two_lidars(dir.path());
    let gain = |file: &str| {
        let score = [&["score", "room.json", file][..], &CART].concat();
        ok(&dir, &score)["scores"][0]["information_gain"].as_f64().unwrap()
    };
    let own = gain("named.json");
    for format in ["autoware", "urdf", "sdf", "ros2-launch", "carla", "carla-objects", "json"] {
        let [out, back] = [format!("{format}.out"), format!("{format}.json")];
        let to = ["--format", format, "--out", &out, "--vehicle", "cart.json"];
        crate::cli::sightline(&dir, &[&["rig", "export", "named.json"][..], &to].concat());
        let import = ["rig", "import", &out, "--out", &back];
        printed(&dir, &import);
        if ["autoware", "urdf", "sdf", "json"].contains(&format) {
            assert_eq!(gain(&back), own, "{format}");
        } else {
            let score = [&["score", "room.json", &back][..], &CART].concat();
            let said = fails(&dir, &score);
            assert!(said.contains("names no sensor, and the vehicle has 2 models"), "{said}");
        }
    }
    let read = |file: &str| fs::read_to_string(dir.path().join(file)).unwrap();
    for format in ["urdf", "sdf"] {
        let text = read(&format!("{format}.out"));
        for part in [
            "<horizontal><samples>90</samples>",
            "<horizontal><samples>31</samples><resolution>1</resolution><min_angle>-0.872664626</min_angle>\
             <max_angle>0.872664626</max_angle>",
            "<vertical><samples>6</samples><resolution>1</resolution><min_angle>-0.698131701</min_angle>",
            "<max>8</max>",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }
    let carla: Value = serde_json::from_str(&read("carla.out")).unwrap();
    let of = |key: &str| [0, 1].map(|k| carla[k][key].as_f64().unwrap());
    assert_eq!(of("channels"), [6.0, 5.0]);
    assert_eq!(of("range"), [20.0, 8.0]);
    assert_eq!(of("horizontal_fov"), [360.0, 100.0]);
    assert_eq!(of("upper_fov"), [30.0, 30.0]);
    assert_eq!(of("points_per_second"), [5400.0, 1550.0]);
    let models: Value = serde_json::from_str(&read("autoware.out/models.json")).unwrap();
    assert_eq!(models["lidars"], json!({ "roof_lidar": "spinning", "lidar_1": "solid" }));
    assert_eq!(models["models"]["solid"]["azimuth"], json!([-50.0, 50.0]));
    let plain = ["rig", "export", "plain.json", "--format", "urdf", "--vehicle", "cart.json"];
    assert!(fails(&dir, &plain).contains("`roof_lidar` names no sensor, and the vehicle has"));
}

#[test]
fn a_rig_of_the_second_model_of_a_mount_is_legal_everywhere() {
    let dir = garage();
    changed(dir.path(), "two.json", |cart| {
        cart["mounts"][0]["sensors"] = json!(["spinning", "solid"]);
    });
    let roof = |sensor: &str, x: f64| json!({ "x": x, "y": 0.0, "z": 1.5, "roll": 0.0, "pitch": 0.0, "yaw": 0.0, "sensor": sensor });
    let rigs = json!({ "placements": [
        { "name": "A", "lidars": [roof("spinning", 0.1)] },
        { "name": "B", "lidars": [roof("solid", 0.0)] }] });
    write(&dir, "rigs.json", &rigs);
    let room = ["room.json", "rigs.json:B", "--vehicle", "two.json", "--baselines", "rigs.json:A"];
    printed(&dir, &[&["view"], &room[..], &["--out", "b.html"], &CPU].concat());
    let page = fs::read_to_string(dir.path().join("b.html")).unwrap();
    assert!(!page.contains("no mount for"), "{page}");
    let own = json!({ "placements": [rigs["placements"][1]] });
    write(&dir, "b.json", &own);
    let sweep = ["study", "sweep", "room.json", "b.json", "--vehicle", "two.json"];
    let swept = ok(
        &dir,
        &[&sweep[..], &["--of", "roof.z", "--from", "1.5", "--to", "1.9", "--values", "2"], &CPU]
            .concat(),
    );
    let rows = swept["sweeps"][0]["rows"].as_array().unwrap();
    let broken: Vec<usize> =
        rows.iter().map(|row| row["broken_rules"].as_array().unwrap().len()).collect();
    assert_eq!(broken, [0, 0, 1], "{rows:?}");
    // A rig given to compare with is judged by what the mounts may hold, whatever the search was to take.
    let search =
        ["optimize", "room.json", "--vehicle", "two.json", "--budget", "10", "--evaluations", "20"];
    let more = ["--baselines", "b.json", "--out", "run", "--backend", "cpu"];
    let found = ok(&dir, &[&search[..], &more].concat());
    assert_eq!(found["baselines"][0]["violations"], json!([]), "{found}");
}
