//! Baselines beside a front: marked in picture, tables and record, and no part of the search.

use crate::cli::*;
use crate::front::{car_ahead, street};

/// Two rigs beside the cart's front: one that looks behind, and one above its mount.
fn write_rigs(dir: &Path) {
    let rig = |name: &str, lidar: Value| json!({ "name": name, "lidars": [lidar] });
    let rigs = [
        rig("behind", json!({ "sensor": "narrow", "x": -0.8, "y": 0, "z": 1, "yaw": 3.1 })),
        rig("above", json!({ "sensor": "half", "x": 0.8, "y": 0, "z": 3 })),
    ];
    write(dir, "rigs.json", &json!({ "placements": rigs }));
}

#[test]
fn baselines_stand_beside_the_front_and_change_none_of_it() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], car_ahead(0.95));
    write_rigs(dir.path());
    let search = "optimize street.json --front price,near_gain --backend cpu --evaluations 0";
    let plain = ok(&dir, &(search, "--out plain"));
    assert!(plain.get("baselines").is_none());
    let result = ok(&dir, &(search, "--out run --baselines rigs.json"));
    for key in ["front", "picks", "scored", "stopped"] {
        assert_eq!(result[key], plain[key], "{key}");
    }
    let scored = ok(&dir, "score street.json rigs.json --backend cpu");
    let baselines = result["baselines"].list();
    for ((baseline, scores), price) in
        baselines.iter().zip(scored["scores"].list()).zip([11.0, 30.0])
    {
        let mut plain = scores.clone();
        assert_eq!(plain.as_object_mut().unwrap().remove("price"), Some(json!(price)));
        assert_eq!(baseline["scores"], plain);
        assert_eq!(
            baseline["objectives"],
            json!({ "price": price, "near_gain": scores["near_gain"] })
        );
    }
    assert_eq!(baselines.len(), 2);
    assert_eq!(
        (&baselines[0]["name"], &baselines[0]["requirements_met"]),
        (&json!("behind"), &json!(false))
    );
    let equipment = [&baselines[0]["equipment"], &baselines[1]["equipment"]];
    assert_eq!(equipment, ["1 × narrow on rear", "rules of the mounts are broken, LiDARs: 1"]);
    assert_eq!(baselines[1]["scores"]["broken_rules"].as_array().map(Vec::len), Some(1));
    let read = |name: &str| read_text(&dir, name);
    assert_eq!(read("run/placements.json"), read("plain/placements.json"));
    for (words, picture) in [
        ("baseline (hollow: misses a", "front.svg"),
        ("behind<", "front.svg"),
        ("Diamonds are the baselines", "report.html"),
        ("RULE BROKEN", "report.html"),
        ("--baselines ", "report.html"),
    ] {
        assert!(read(&format!("run/{picture}")).contains(words), "{words}");
        assert!(!read(&format!("plain/{picture}")).contains(words), "{words}");
    }
    // A front that goes on keeps them.
    let resume = "optimize --resume run --backend cpu --format csv --figures again";
    let (_, [csv, _]) = ran(&dir, resume);
    assert_eq!(csv.matches(",baseline,").count(), 2, "{csv}");
    assert_eq!(read("again/front.svg"), read("run/front.svg"));
}

#[test]
fn baselines_of_a_front_are_checked_before_the_search() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], json!([]));
    write_rig(&dir, "rigs.json", "a", json!([{ "sensor": "wide", "x": 0, "y": 0, "z": 1 }]));
    let line = "optimize street.json --front price,near_gain --backend cpu --baselines rigs.json --out run";
    fails(&dir, line).says("rigs.json").says("wide");
    assert!(!dir.path().join("run").exists());
}
