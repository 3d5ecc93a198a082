//! `--format csv`: every number is that of `--format json`, in full precision.

use crate::cli::*;
use crate::cli_files::world;

/// Rows of a table by the titles of its first line.
struct Csv(Vec<Vec<String>>);

impl Csv {
    fn of(dir: &Path, line: &str) -> Self {
        let (code, [stdout, stderr]) = ran(dir, &format!("{line} --format csv"));
        assert!(matches!(code, Some(0 | 1)), "{line}: {stderr}");
        Self::read(&stdout)
    }

    /// Reads RFC 4180, line ends inside of quotes left aside.
    fn read(text: &str) -> Self {
        let line = |line: &str| {
            let (mut cells, mut quoted) = (vec![String::new()], false);
            for c in line.chars() {
                match c {
                    '"' => quoted = !quoted,
                    ',' if !quoted => cells.push(String::new()),
                    c => cells.last_mut().unwrap().push(c),
                }
            }
            cells
        };
        let rows: Vec<Vec<String>> = text.lines().map(line).collect();
        assert!(rows.len() > 1 && rows.iter().all(|row| row.len() == rows[0].len()), "{text}");
        Self(rows)
    }

    fn rows(&self) -> usize {
        self.0.len() - 1
    }

    fn cell(&self, row: usize, title: &str) -> &str {
        let column = self.0[0].iter().position(|cell| cell == title);
        let column = column.unwrap_or_else(|| panic!("{title} in {:?}", self.0[0]));
        &self.0[row + 1][column]
    }

    /// A cell is the number, or empty where there is none.
    fn is(&self, row: usize, title: &str, wanted: &Value) {
        let cell = self.cell(row, title);
        match wanted.as_f64() {
            Some(wanted) => assert_eq!(cell.parse::<f64>().unwrap(), wanted, "{title}"),
            None => assert_eq!(cell, wanted.as_str().unwrap_or_default(), "{title}"),
        }
    }
}

/// Two placements in a small town, and its vehicle with a requirement.
pub(crate) fn town() -> TempDir {
    let dir = world();
    let lidar = |y: f64, z: f64| json!({ "x": 0.1, "y": y, "z": z, "pitch": 0.05 });
    let placements = json!({ "placements": [
        { "name": "p", "lidars": [lidar(0.0, 2.0), lidar(0.4, 2.0)] },
        { "name": "q", "lidars": [lidar(-0.3, 1.9), lidar(0.3, 2.3)] } ] });
    write(&dir, "two.json", &placements);
    let vehicle = json!({ "sightline": 1, "name": "cart",
        "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.3], "size": [4, 1.8, 1.2] } }],
        "sensors": [{ "name": "s", "lidar": { "channels": 8, "fov": [-30, 2], "azimuth_steps": 90, "range": 40 } }],
        "mounts": [{ "name": "roof", "count": [2, 2], "sensors": ["s"], "min": [-0.5, -0.5, 1.8],
                     "max": [0.5, 0.5, 2.4], "pitch": [-0.2, 0.2] }],
        "require": [{ "target": "car", "within": 20, "share": 0.05 }] });
    write(&dir, "cart.json", &vehicle);
    dir
}

/// A row has the scores of a placement.
fn check(csv: &Csv, row: usize, scores: &Value) {
    for (title, key) in [
        ("placement", "name"),
        ("information_gain_nats", "information_gain"),
        ("information_gain_share", "information_gain_share"),
        ("near_gain_share", "near_gain"),
        ("near_gain_2_share", "near_gain_2"),
        ("near_gain_3_share", "near_gain_3"),
        ("m_sog", "m_sog"),
        ("m_sog_scaled", "m_sog_scaled"),
        ("s_mig_nats", "s_mig"),
        ("covered_voxels", "covered"),
        ("hit_share", "hit_share"),
    ] {
        csv.is(row, title, &scores[key]);
    }
    csv.is(row, "detection_m_sog_scaled", &scores["detection"]["m_sog_scaled"]);
    let guards = scores["guards"].list().iter().map(|g| g.text());
    assert_eq!(csv.cell(row, "warnings"), guards.collect::<Vec<_>>().join("; "));
}

#[test]
fn scores_are_those_of_the_json_in_one_scene_and_in_several() {
    let dir = town();
    let line = "score town.json two.json --vehicle cart.json --near-field --backend cpu";
    let (csv, found) = both(dir.path(), line);
    assert_eq!(csv.rows(), 2);
    assert!(!csv.0[0].contains(&"price".to_owned()), "no sensor has one");
    for (row, scores) in found["scores"].list().iter().enumerate() {
        check(&csv, row, scores);
        csv.is(row, "near_field_share", &scores["near_field"]);
        csv.is(row, "near_ring_share", &scores["near_ring"]);
        csv.is(row, "requirements_hold_in_share", &scores["requirements_hold_in"]);
        assert!(scores["requirements_hold_in"].is_number(), "{scores}");
        let seen = &scores["requirements"][0];
        assert_eq!(csv.cell(row, "requirements_met"), seen["met"].to_string());
        let name = seen["name"].text();
        csv.is(row, &format!("{name}_found"), &seen["found"]);
        csv.is(row, &format!("{name}_required"), &seen["required"]);
        csv.is(row, &format!("{name}_holds_in"), &seen["holds_in"]);
        assert_eq!(csv.cell(row, &format!("{name}_met")), seen["met"].to_string());
        let words = csv.cell(row, "requirements");
        assert!(words.ends_with(&format!(": {} of 0.05", seen["found"])), "{words}, {seen}");
    }
    let (csv, found) = both(dir.path(), "score town.json town2.json two.json --backend cpu");
    assert_eq!(csv.rows(), 6);
    for (scene, name) in ["town", "town2"].into_iter().enumerate() {
        for k in 0..2 {
            assert_eq!(csv.cell(2 * scene + k, "scene"), name);
            check(&csv, 2 * scene + k, &found["scenes"][scene]["scores"][k]);
        }
    }
    assert_eq!(csv.cell(5, "scene"), "mean");
    check(&csv, 5, &found["mean"][1]);
}

#[test]
fn scores_go_into_a_file_with_one_first_line() {
    let dir = town();
    printed(&dir, "score town.json two.json --backend cpu --format csv --out scores.csv");
    let text = read_text(&dir, "scores.csv");
    assert_eq!(text.matches("information_gain_nats").count(), 1);
    assert_eq!(Csv::read(&text).rows(), 2);
}

#[test]
fn a_search_has_a_row_for_its_result_and_for_each_baseline() {
    let dir = town();
    let mut cart = read_json(dir.path().join("cart.json"));
    cart["sensors"][0]["price"] = json!(150);
    write(&dir, "cart.json", &cart);
    let line = "optimize town.json --vehicle cart.json --backend cpu --evaluations 8 --baselines two.json --out run";
    let csv = Csv::of(dir.path(), line);
    let result = read_json(dir.path().join("run/result.json"));
    let all = std::iter::once(&result["best"]).chain(result["baselines"].list());
    let all: Vec<&Value> = all.collect();
    assert_eq!((csv.rows(), all.len()), (3, 3));
    for (row, of) in all.into_iter().enumerate() {
        check(&csv, row, &of["scores"]);
        let seen = &of["scores"]["requirements"][0];
        assert_eq!(csv.cell(row, "requirements_met"), seen["met"].to_string());
        let broken = of["violations"].list().len();
        assert_eq!(csv.cell(row, "broken_rules").is_empty(), broken == 0, "{of}");
        csv.is(row, "price", &json!(300));
        csv.is(row, "price", &of["price"]);
        csv.is(row, "requirements_hold_in_share", &of["scores"]["requirements_hold_in"]);
    }
    // Ground near the vehicle is looked at for the result, and for the best baseline if any counts.
    let near = &result["near_field"];
    assert!(near["ring"].is_number(), "{near}");
    csv.is(0, "near_field_share", &near["near_field"]);
    csv.is(0, "near_ring_share", &near["ring"]);
    let looked = (0..3).filter(|&row| !csv.cell(row, "near_field_share").is_empty()).count();
    assert!(looked < 3, "one baseline at most");
    // A finished run prints its table again.
    assert_eq!(Csv::of(dir.path(), "optimize --resume run --backend cpu").0, csv.0);
}

#[test]
fn a_front_has_a_row_for_each_point() {
    let dir = TempDir::new().unwrap();
    crate::front::street(dir.path(), [30, 11], json!([]));
    let line =
        "optimize street.json --front price,near_gain --backend cpu --evaluations 0 --out run";
    let csv = Csv::of(dir.path(), line);
    let result = read_json(dir.path().join("run/result.json"));
    let points = result["front"].list();
    assert!(points.len() > 1 && csv.rows() == points.len(), "{result}");
    for (row, point) in points.iter().enumerate() {
        check(&csv, row, &point["scores"]);
        csv.is(row, "price", &point["price"]);
        csv.is(row, "objective_price", &point["price"]);
        csv.is(row, "objective_near_gain", &point["objectives"]["near_gain"]);
        csv.is(row, "sensors", &point["sensors"]);
        assert_eq!(csv.cell(row, "meets"), point["requirements_met"].to_string());
    }
}

#[test]
fn near_fields_and_targets_are_those_of_the_json() {
    let dir = town();
    let (csv, found) = both(dir.path(), "study nearfield town.json two.json --backend cpu");
    let mut endless = 0;
    for (row, near) in found["near_fields"].list().iter().enumerate() {
        csv.is(row, "placement", &near["name"]);
        csv.is(row, "near_field_share", &near["near_field"]);
        csv.is(row, "ring_3m_share", &near["ring"]);
        csv.is(row, "blind_area_m2", &near["blind_area"]);
        csv.is(row, "zone_area_m2", &near["zone"]["area"]);
        for side in ["ahead", "behind", "left", "right"] {
            let (title, depth) = (format!("blind_{side}_m"), &near["zone"][side]);
            match depth.is_null() {
                // Deeper than the 10 m that are looked at, which is no unknown depth.
                true => assert_eq!(csv.cell(row, &title), "inf"),
                false => csv.is(row, &title, depth),
            }
            endless += usize::from(depth.is_null());
        }
        let poles = near["poles"].list().iter();
        let of = poles.filter(|pole| pole["standard"] == "R159").collect::<Vec<_>>();
        let seen = of.iter().filter(|pole| pole["seen"] == true).count();
        assert_eq!(csv.cell(row, "R159_seen"), seen.to_string());
        assert_eq!(csv.cell(row, "R159_poles"), of.len().to_string());
        assert_eq!(csv.cell(row, "lost_again").is_empty(), near["zone"].get("lost").is_none());
        let own: Vec<f64> = csv
            .cell(row, "own_body_share_by_lidar")
            .split("; ")
            .map(|c| c.parse().unwrap())
            .collect();
        assert_eq!(own, [0, 1].map(|k| near["beams"][k]["own"].number()));
    }
    assert!(endless > 0, "some blind zone does not end");
    let line = "study targets town.json two.json --target car --distances 4,6,8 --backend cpu";
    let (csv, found) = both(dir.path(), line);
    assert_eq!(csv.rows(), 3 * 32);
    for (row, of) in found["rows"].list().iter().enumerate() {
        for (title, key) in [
            ("scene", "scene"),
            ("frame", "frame"),
            ("placement", "placement"),
            ("target", "target"),
            ("bearing_deg", "bearing"),
            ("distance_m", "distance"),
            ("beams", "beams"),
        ] {
            csv.is(row, title, &of[key]);
        }
        let each = of["by_lidar"].list().iter().map(Value::to_string);
        assert_eq!(csv.cell(row, "beams_by_lidar"), each.collect::<Vec<_>>().join("; "));
    }
    let mut runs = 0;
    // Rows are by placement, target, bearing and distance: three a bearing.
    for (bearing, of) in found["detections"].list().iter().enumerate() {
        let row = 3 * bearing;
        csv.is(row, "first_m", &of["first"]);
        let all = of["detected"].list();
        let all = all.iter().map(|run| format!("{} to {}", run[0].number(), run[1].number()));
        let all = all.collect::<Vec<_>>().join("; ");
        runs += usize::from(!all.is_empty());
        assert_eq!(csv.cell(row, "detected_m"), all);
    }
    assert!(runs > 4, "{runs}");
}

/// An answer as CSV and as JSON.
fn both(dir: &Path, line: &str) -> (Csv, Value) {
    let (_, found, _) = answer(dir, line);
    (Csv::of(dir, line), found)
}

#[test]
fn audits_and_comparisons_are_those_of_the_json() {
    let dir = town();
    let (csv, found) = both(dir.path(), "audit town.json two.json --backend cpu");
    let [trials, changes] = ["trials", "stability"].map(|key| found[key].list());
    assert_eq!(csv.rows(), 1 + trials.len() + changes.len());
    let check = |row: usize, part: &str, name: &Value, scores: &Value| {
        csv.is(row, "scene", &json!("town"));
        csv.is(row, "part", &json!(part));
        csv.is(row, "name", name);
        csv.is(row, "near_gain_share", &scores["near_gain"]);
        csv.is(row, "covered_voxels", &scores["covered"]);
    };
    check(0, "base", &found["base"]["name"], &found["base"]);
    csv.is(0, "ranking_against_mean_height", &found["ranking_against_mean_height"]);
    for (row, trial) in (1..).zip(trials) {
        check(row, "attempt", &trial["name"], &trial["scores"]);
        csv.is(row, "verdict", &trial["verdict"]);
        let fooled = trial["fooled"].list().iter().map(|name| name.text());
        assert_eq!(csv.cell(row, "fooled"), fooled.collect::<Vec<_>>().join("; "));
    }
    for (row, change) in (1 + trials.len()..).zip(changes) {
        check(row, "change", &change["change"], &change["base"]);
        for title in ["worst_relative_change", "median_kendall_tau", "kendall_tau", "first"] {
            csv.is(row, title, &change[title]);
        }
    }

    let (csv, found) = both(dir.path(), "rig compare two.json:p two.json:q");
    let (lidars, after) = (&found["lidars"], &found["after"]);
    let parts = ["lidars", "before", "after"].map(|key| found[key].list().len());
    assert_eq!((csv.rows(), parts[0]), (parts.iter().sum::<usize>(), 2));
    // The JSON has fewer digits.
    let near = |row: usize, title: &str, wanted: &Value| {
        let cell: f64 = csv.cell(row, title).parse().unwrap();
        assert!((cell - wanted.number()).abs() < 1e-6, "{title}: {cell}, {wanted}");
    };
    csv.is(1, "part", &json!("moved"));
    csv.is(1, "lidar", &lidars[1]["frame"]);
    csv.is(1, "other", &lidars[1]["partner"]);
    assert!(lidars[1]["moved"].number() > 0.1, "{lidars}");
    near(1, "moved_m", &lidars[1]["moved"]);
    let (row, pair) = (parts[0] + parts[1], &after[0]);
    csv.is(row, "part", &json!("after"));
    csv.is(row, "lidar", &pair["left"]);
    csv.is(row, "other", &pair["right"]);
    near(row, "moved_m", &pair["moved"]);
    near(row, "turned_rad", &pair["turned"]);
    assert_eq!(csv.cell(row, "same_roll"), pair["same_roll"].to_string());
}

#[test]
fn shared_things_sweeps_and_tolerances_are_those_of_the_json() {
    let dir = town();
    let both = |line: &str| both(dir.path(), line);
    let (csv, found) = both("study redundancy town.json two.json --target car --backend cpu");
    let seen = &found["rows"][1]["ground_10m"];
    let row = (0..csv.rows()).filter(|&k| csv.cell(k, "thing") == "ground to 10 m").nth(1).unwrap();
    assert_eq!(csv.cell(row, "placement"), "q");
    csv.is(row, "count", &seen["all"]);
    csv.is(row, "seen_by_0_share", &seen["share"][0]);
    csv.is(row, "seen_by_3_or_more_share", &seen["share"][3]);
    let (csv, found) = both("study overlap town.json two.json --backend cpu");
    assert_eq!(csv.rows(), 6);
    for (row, [a, b]) in [[0, 0], [0, 1], [1, 1]].into_iter().enumerate() {
        csv.is(row, "lidar", &json!(a));
        csv.is(row, "other", &json!(b));
        csv.is(row, "shared_voxels", &found["rows"][0]["shared_voxels"][a][b]);
        csv.is(row, "shared_sphere_share", &found["rows"][0]["shared_directions"][a][b]);
    }
    let line =
        "study sweep town.json two.json --of 1.z --from 1.9 --to 2.5 --values 3 --backend cpu";
    let (csv, found) = both(line);
    assert_eq!(csv.rows(), 8);
    for row in 0..8 {
        let sweep = &found["sweeps"][row / 4];
        let at = &sweep["rows"][row % 4];
        csv.is(row, "value", &at["value"]);
        csv.is(row, "unit", &sweep["unit"]);
        csv.is(row, "placement", &sweep["placement"]);
        csv.is(row, "near_gain_share", &at["scores"]["near_gain"]);
        assert_eq!(csv.cell(row, "as_given"), at["as_given"].to_string());
        assert_eq!(csv.cell(row, "broken_rules").is_empty(), at["broken_rules"] == json!([]));
    }
    let line = "study tolerance town.json two.json --vehicle cart.json --steps 2 --backend cpu";
    let (csv, found) = both(line);
    let field = &found["rows"][0]["fields"][2];
    csv.is(2, "field", &field["field"]);
    csv.is(2, "minus_holds_to", &field["down"]["holds_to"]);
    csv.is(2, "plus_breaks_at", &field["up"]["breaks_at"]);
}

#[test]
fn every_row_of_random_placements_says_whether_requirements_are_met() {
    let dir = town();
    let line = "study random town.json two.json --vehicle cart.json --random 8 --evaluations 4 --backend cpu --out r";
    let csv = Csv::of(dir.path(), line);
    assert_eq!(csv.cell(4, "placement"), "random, best");
    for row in 0..csv.rows() {
        assert!(
            ["true", "false"].contains(&csv.cell(row, "requirements met")),
            "{:?}",
            csv.0[row + 1]
        );
    }
    read_text(&dir, "r/study.json").says(" of 8 random placements meet all requirements");
}

#[test]
fn a_study_prints_the_table_that_it_writes() {
    let dir = town();
    let line =
        "study height town.json --random 8 --evaluations 4 --backend cpu --out one --format csv";
    let printed = stdout(&dir, line);
    assert_eq!(printed, read_text(&dir, "one/table.csv"));
    let line =
        "study height town.json town2.json --random 8 --evaluations 4 --backend cpu --out two";
    let both = Csv::of(dir.path(), line);
    let one = Csv::read(&printed);
    assert_eq!(both.0[0][1..], one.0[0]);
    assert_eq!(both.0[1][1..], one.0[1]);
    assert!(both.rows() >= 2 * one.rows());
}
