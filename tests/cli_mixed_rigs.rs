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
        write_rig(dir, file, "a", lidars(models));
    }
}

const CART: &str = "--vehicle cart.json --backend cpu";

#[test]
fn no_command_picks_a_model_for_a_lidar_that_names_none() {
    let dir = garage();
    two_lidars(dir.path());
    let wanted = "plain.json: placement `a`, LiDAR 0 names no sensor, and the vehicle has 2 models: \
                  spinning, solid; add \"sensor\": \"spinning\" to the LiDAR, or give --sensor 0=spinning";
    for args in [
        "score room.json plain.json",
        "score room.json room.json plain.json",
        "cast room.json plain.json",
        "view room.json plain.json --out v.html",
        "view room.json named.json --baseline plain.json --out v.html",
        "scan room.json --placement plain.json --out scans",
        "audit room.json plain.json",
        "optimize room.json --baselines plain.json --out o",
        "optimize room.json --inject plain.json --out o",
    ] {
        fails(&dir, &(args, CART)).says(wanted);
    }
    let gain = |rig: &str| {
        ok(&dir, &("score room.json", rig, CART))["scores"][0]["information_gain"].number()
    };
    let own = gain("named.json");
    assert_eq!(gain("plain.json --sensor 0=spinning --sensor all=solid"), own);
    assert!(gain("plain.json --sensor all=spinning") > own);
    fails(&dir, &("score room.json named.json --sensor 1=spinning", CART))
        .says("LiDAR 1 is a `solid`, and --sensor 1=spinning says otherwise");
}

#[test]
fn a_mixed_rig_keeps_its_score_through_every_format_or_is_refused() {
    let dir = garage();
    two_lidars(dir.path());
    let gain = |file: &str| {
        ok(&dir, &("score room.json", file, CART))["scores"][0]["information_gain"].number()
    };
    let own = gain("named.json");
    for format in ["autoware", "urdf", "sdf", "ros2-launch", "carla", "carla-objects", "json"] {
        let [out, back] = [format!("{format}.out"), format!("{format}.json")];
        sightline(
            &dir,
            &format!("rig export named.json --format {format} --out {out} --vehicle cart.json"),
        );
        printed(&dir, &format!("rig import {out} --out {back}"));
        if ["autoware", "urdf", "sdf", "json"].contains(&format) {
            assert_eq!(gain(&back), own, "{format}");
        } else {
            fails(&dir, &("score room.json", &back, CART))
                .says("names no sensor, and the vehicle has 2 models");
        }
    }
    let read = |file: &str| read_text(&dir, file);
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
    let of = |key: &str| [0, 1].map(|k| carla[k][key].number());
    assert_eq!(of("channels"), [6.0, 5.0]);
    assert_eq!(of("range"), [20.0, 8.0]);
    assert_eq!(of("horizontal_fov"), [360.0, 100.0]);
    assert_eq!(of("upper_fov"), [30.0, 30.0]);
    assert_eq!(of("points_per_second"), [5400.0, 1550.0]);
    let models: Value = serde_json::from_str(&read("autoware.out/models.json")).unwrap();
    assert_eq!(models["lidars"], json!({ "roof_lidar": "spinning", "lidar_1": "solid" }));
    assert_eq!(models["models"]["solid"]["azimuth"], json!([-50.0, 50.0]));
    let plain = "rig export plain.json --format urdf --vehicle cart.json";
    fails(&dir, plain).says("`roof_lidar` names no sensor, and the vehicle has");
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
    let view = "view room.json rigs.json:B --vehicle two.json --baselines rigs.json:A --out b.html";
    printed(&dir, &(view, CPU));
    let page = read_text(&dir, "b.html");
    assert!(!page.contains("no mount for"), "{page}");
    write(&dir, "b.json", &json!({ "placements": [rigs["placements"][1]] }));
    let sweep = "study sweep room.json b.json --vehicle two.json";
    let swept = ok(&dir, &(sweep, "--of roof.z --from 1.5 --to 1.9 --values 2", CPU));
    let rows = swept["sweeps"][0]["rows"].list();
    let broken: Vec<usize> = rows.iter().map(|row| row["broken_rules"].list().len()).collect();
    assert_eq!(broken, [0, 0, 1], "{rows:?}");
    // A rig given to compare with is judged by what the mounts may hold, whatever the search was to take.
    let search = "optimize room.json --vehicle two.json --budget 10 --evaluations 20";
    let more = "--baselines b.json --out run --backend cpu";
    let found = ok(&dir, &(search, more));
    assert_eq!(found["baselines"][0]["violations"], json!([]), "{found}");
}
