//! Studies: their files, going on with them, and numbers that can be checked.

use std::fs;

use serde_json::Value;
use tempfile::TempDir;

use crate::cli::{fails, ok, room, sightline};

fn study(dir: &std::path::Path, kind: &str, more: &[&str]) -> Value {
    let fixed =
        ["study", kind, "room.json", "--backend", "cpu", "--evaluations", "24", "--random", "20"];
    ok(dir, &[&fixed[..], more].concat())
}

/// Values of one column, by the name of the row.
fn column(table: &Value, title: &str) -> Vec<(String, f64)> {
    let titles = table["columns"].as_array().unwrap();
    let at = titles.iter().position(|t| t == title).unwrap_or_else(|| panic!("no {title}"));
    let rows = table["rows"].as_array().unwrap().iter();
    rows.filter_map(|row| Some((row["name"].as_str()?.to_owned(), row["values"][at - 1].as_f64()?)))
        .collect()
}

#[test]
fn every_kind_leaves_a_table_and_a_chart() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    for kind in ["channels", "random", "tasks", "height", "regions", "loss", "voxels"] {
        let table = study(dir.path(), kind, &["--out", kind]);
        let columns = table["columns"].as_array().unwrap().len();
        for row in table["rows"].as_array().unwrap() {
            assert_eq!(row["values"].as_array().unwrap().len() + 1, columns, "{kind}: {row}");
        }
        let csv = fs::read_to_string(dir.path().join(kind).join("table.csv")).unwrap();
        assert_eq!(csv.lines().count(), 1 + table["rows"].as_array().unwrap().len(), "{kind}");
        let svg = fs::read_to_string(dir.path().join(kind).join("chart.svg")).unwrap();
        assert!(svg.contains("<circle") && svg.ends_with("</svg>\n"), "{kind}");
    }
    let channels: Value =
        serde_json::from_slice(&fs::read(dir.path().join("channels/study.json")).unwrap()).unwrap();
    assert_eq!(channels["settings"]["study"], "channels");
}

#[test]
fn more_lidars_gain_more_and_the_worst_loss_is_no_worse_for_having_been_searched() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    let table = study(dir.path(), "lidars", &["--out", "lidars"]);
    let gains = column(&table, "gain %");
    assert_eq!(gains.len(), 8);
    assert!(gains[7].1 > gains[0].1, "{gains:?}");
    let marginal = column(&table, "marginal gain %");
    let sum: f64 = marginal.iter().map(|m| m.1).sum();
    assert!((sum - gains[7].1).abs() < 1e-9, "marginal gains add up to the last gain");
    let loss = study(dir.path(), "loss", &["--out", "loss"]);
    let [whole, worst] = ["all LiDARs", "after the worst loss"].map(|c| column(&loss, c));
    assert!(worst[1].1 >= worst[0].1, "{worst:?}");
    assert!(worst.iter().zip(&whole).all(|(w, a)| w.1 <= a.1), "a loss gains nothing");
}

#[test]
fn a_study_goes_on_and_keeps_what_it_has() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    let first = study(dir.path(), "height", &["--out", "s"]);
    let path = dir.path().join("s/study.json");
    let mut saved: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    // A case that was measured is kept as it is; one that is missing is measured again.
    saved["rows"][0]["values"][0] = 12.5.into();
    saved["rows"].as_array_mut().unwrap().pop();
    fs::write(&path, saved.to_string()).unwrap();
    let again = study(dir.path(), "height", &["--out", "s"]);
    assert_eq!(again["rows"][0]["values"][0], 12.5);
    let last = |table: &Value| table["rows"].as_array().unwrap().last().unwrap().clone();
    assert_eq!(last(&again), last(&first));
    let other = ["study", "height", "room.json", "--backend", "cpu", "--out", "s", "--seed", "9"];
    let refused = sightline(dir.path(), &other);
    assert_eq!(refused.status.code(), Some(2));
    let message = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(message.contains("other settings"), "{message}");
}

#[test]
fn wrong_input_is_named() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    for (args, says) in [
        (&["study", "transfer", "room.json"][..], "two or more scene files"),
        (&["study", "height", "room.json", "room.json"][..], "takes one scene"),
        (&["study", "regions", "room.json", "--box", "a:1,2,3"][..], "NAME:x0,y0,z0,x1,y1,z1"),
        (&["study", "channels", "room.json", "--sensor", "none.json"][..], "none.json"),
        (&["study", "lidars", "room.json", "--objective", "gain"][..], "did you mean"),
    ] {
        let refused = sightline(dir.path(), args);
        assert_eq!(refused.status.code(), Some(2), "{args:?}");
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(message.contains(says), "{message}");
    }
}

#[test]
fn cases_of_one_name_would_share_numbers_and_are_refused() {
    let dir = TempDir::new().unwrap();
    room(dir.path());
    fs::copy(dir.path().join("room.json"), dir.path().join("copy.json")).unwrap();
    for folder in ["a", "b"] {
        fs::create_dir(dir.path().join(folder)).unwrap();
        let sensor = format!("{{ \"elevation_deg\": [0, {}] }}", folder.len());
        fs::write(dir.path().join(folder).join("vlp.json"), sensor).unwrap();
    }
    let sensors = ["--sensor", "a/vlp.json", "--sensor", "b/vlp.json"];
    let boxes = ["--box", "near:0,0,0,1,1,1"];
    for (args, says) in [
        (&["transfer", "room.json", "copy.json"][..], "two scenes are called `room`"),
        (&[&["channels", "room.json"][..], &sensors].concat(), "two sensors are called `vlp`"),
        (&[&["regions", "room.json"][..], &boxes].concat(), "two regions are called `near`"),
    ] {
        let args = [&["study"][..], args, &["--backend", "cpu"]].concat();
        let message = fails(dir.path(), &args);
        assert!(message.contains(says), "{message}");
    }
    assert!(!dir.path().join("studies").exists());
}
