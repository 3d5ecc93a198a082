//! Studies of own rigs: placements and budgets that studies take, requirements that are missed, studies without an answer.

use crate::cli::*;
use crate::cli_targets::ruled;

/// A street, and a van with one spinning sensor on its roof and solid ones on two sides, which come in pairs.
pub(crate) fn street() -> TempDir {
    let dir = TempDir::new().unwrap();
    let solid = json!({ "channels": 8, "fov": [-30, 10], "azimuth": [-60, 60], "azimuth_steps": 60, "range": 30 });
    let spinning = |channels| json!({ "channels": channels, "fov": [-30, 5], "azimuth_steps": 120, "range": 60 });
    let side = |name: &str, y: f64| {
        json!({ "name": name, "min": [-0.5, y - 0.05, 0.6], "max": [0.5, y + 0.05, 0.9], "yaw": [-3.15, 3.15],
            "sensors": ["solid"], "count": [0, 1] })
    };
    let van = json!({ "sightline": 1, "name": "van",
        "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [3, 1.6, 1.5] } }],
        "sensors": [{ "name": "fine", "price": 10, "lidar": spinning(16) },
                    { "name": "coarse", "price": 4, "lidar": spinning(4) },
                    { "name": "solid", "price": 3, "lidar": solid }],
        "mounts": [{ "name": "roof", "min": [-1, 0, 1.7], "max": [1, 0, 2], "sensors": ["fine", "coarse"], "count": [0, 1] },
                   side("left", 0.95), side("right", -0.95)],
        "symmetric": true, "min_distance": 0.2,
        "require": [{ "name": "far left", "min": [-1, 5, 0], "max": [1, 9, 0.5], "share": 0.05 },
                    { "name": "left", "min": [-1, 1, 0], "max": [1, 3, 0.5], "share": 0.5 }] });
    write(&dir, "van.json", &van);
    let scene = json!({ "sightline": 1, "name": "street", "vehicle": "van.json", "frames": 3,
        "roi": { "min": [-16, -16, -0.5], "max": [16, 16, 3.5], "voxel": [0.5, 0.5, 0.5] },
        "static": [{ "class": "road", "plane": { "min": [-40, -40], "max": [40, 40], "z": 0 } },
                   { "class": "wall", "box": { "center": [0, 14, 1.5], "size": [30, 0.4, 3] } }],
        "actors": [{ "name": "crate", "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [2, 2, 2] } }],
            "poses": [{ "x": 8, "y": 0 }, { "x": 9, "y": 4 }, { "x": -10, "y": 3 }] }] });
    write(&dir, "street.json", &scene);
    let rigs = json!({ "placements": [
        { "name": "roof", "lidars": [{ "x": 0, "y": 0, "z": 1.8, "sensor": "fine" }] },
        { "name": "sides", "lidars": [{ "x": 0, "y": 0.95, "z": 0.8, "yaw": 1.5, "pitch": 0.2, "sensor": "solid" },
                                      { "x": 0, "y": -0.95, "z": 0.8, "yaw": -1.5, "pitch": 0.2, "sensor": "solid" }] }] });
    write(&dir, "rigs.json", &rigs);
    dir
}

/// The table of a study of the street, two frames, short searches.
fn study(dir: &TempDir, line: &str) -> Value {
    ok(dir, &format!("study {line} --frames 2 --evaluations 12 --random 8 --backend cpu"))
}

/// Number of a row in a column.
fn value(table: &Value, row: &Value, title: &str) -> Option<f64> {
    let titles = table["columns"].list();
    let at = titles.iter().position(|t| t == title).unwrap_or_else(|| panic!("no {title}"));
    row["values"][at - 1].as_f64()
}

fn rows(table: &Value) -> &[Value] {
    table["rows"].list()
}

fn names(table: &Value) -> Vec<&str> {
    rows(table).iter().map(|row| row["name"].text()).collect()
}

/// Price of the LiDARs of a row, and how many of them are on the roof, the left and the right.
fn price_and_mounts(row: &Value) -> (f64, [usize; 3]) {
    let lidars = row["placement"]["lidars"].list();
    let price = |lidar: &Value| match lidar["sensor"].text() {
        "fine" => 10.0,
        "coarse" => 4.0,
        "solid" => 3.0,
        other => panic!("{other}"),
    };
    let on = |low: f64, high: f64| {
        let is_on = |lidar: &&Value| (low..high).contains(&lidar["y"].number());
        lidars.iter().filter(is_on).count()
    };
    (lidars.iter().map(price).sum(), [on(-0.5, 0.5), on(0.5, 2.0), on(-2.0, -0.5)])
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs().max(1e-3)
}

#[test]
fn rigs_in_weather_have_the_scores_and_requirements_that_score_prints() {
    let dir = street();
    let conditions = ["fog:mor=20", "rain:rate=100", "crosstalk:share=0.1"];
    let options: String = conditions.map(|one| format!(" --condition {one}")).concat();
    let table = study(&dir, &format!("weather street.json rigs.json --out w{options}"));
    assert_eq!(rows(&table).len(), 8);
    let mut gains = Vec::new();
    for (sky, found) in rows(&table).chunks(2).enumerate() {
        let under = sky.checked_sub(1).map(|k| conditions[k]);
        let condition = under.map_or(String::new(), |one| format!(" --condition {one}"));
        let line = format!("score street.json rigs.json --frames 2 --backend cpu{condition}");
        let scored = ok(&dir, &line);
        for (row, scores) in found.iter().zip(scored["scores"].list()) {
            let name = row["name"].text();
            let rig = scores["name"].text();
            assert!(name.starts_with(&format!("{rig}, ")), "{name}");
            let want = |key: &str| scores[key].number();
            for (title, want) in [
                ("gain %", 100.0 * want("information_gain_share")),
                ("near gain %", 100.0 * want("near_gain")),
                ("covered", want("covered")),
                ("guards violated", doubts(scores) as f64),
            ] {
                let found = value(&table, row, title).unwrap();
                assert!(close(found, want), "{name}, {title}: {found}, {want}");
            }
            let required = scores["requirements"].list();
            let missed = required.iter().filter(|seen| seen["met"] == false).count();
            assert_eq!(value(&table, row, "count not met"), Some(missed as f64), "{name}");
            assert_eq!(row["requirements_met"], missed == 0, "{name}");
            gains.push(want("near_gain"));
            ahead(&dir, (&table, row), rig, under);
        }
    }
    // Both sides look at the body, as no score alone tells.
    let hits = ok(&dir, "score street.json rigs.json --frames 2 --backend cpu");
    assert!(hits.to_string().contains("self_hit"), "{hits}");
    // Fog of 20 m takes much, and one rig misses what the other meets.
    assert!(gains[2] < 0.95 * gains[0], "{gains:?}");
    assert_ne!(rows(&table)[0]["requirements_met"], rows(&table)[1]["requirements_met"]);
}

/// Guards that speak against the scores of a placement: blind sectors are facts about the rig.
fn doubts(scores: &Value) -> usize {
    let is_fact = |guard: &&Value| {
        let words = guard.text();
        ["blind_sector", "redundant_lidar"].iter().any(|fact| words.starts_with(fact))
    };
    let guards = scores["guards"].list();
    guards.iter().filter(|guard| !is_fact(guard)).count()
}

/// Holds the range of a car ahead against the beams that `study targets` counts on it.
fn ahead(dir: &TempDir, (table, row): (&Value, &Value), rig: &str, condition: Option<&str>) {
    let found = value(table, row, "car ahead m");
    if condition.is_some_and(|one| one.starts_with("crosstalk")) {
        return assert_eq!(found, None);
    }
    let mut at: Vec<f64> = (1..=8).map(|k| 2.5 * f64::from(k)).collect();
    at.extend((5..=12).map(|k| 5.0 * f64::from(k)));
    let distances: Vec<String> = at.iter().map(f64::to_string).collect();
    let condition = condition.map_or(String::new(), |one| format!(" --condition {one}"));
    let line = format!(
        "study targets rigs.json --vehicle van.json --target car --bearings 0 --distances {} --backend cpu{condition}",
        distances.join(",")
    );
    let looked = ok(dir, &line);
    let of_rig = looked["rows"].list().iter().filter(|of| of["placement"] == rig);
    let met = |of: &&Value| of["beams"].as_u64().unwrap() >= 5 && of["overlaps"] != true;
    let from = of_rig.skip_while(|of| !met(of));
    let last = from.take_while(met).last().map_or(0.0, |of| of["distance"].number());
    assert_eq!(found, Some(last), "{rig}{condition}: {looked}");
}

#[test]
fn regions_random_and_voxels_look_at_own_rigs_alone() {
    let dir = street();
    // A box around everything holds all information.
    let table =
        study(&dir, "regions street.json rigs.json --box all:-17,-17,-1,17,17,4 --out regions");
    assert_eq!(names(&table), ["roof", "sides"]);
    let scored = ok(&dir, "score street.json rigs.json --frames 2 --backend cpu");
    for (row, scores) in rows(&table).iter().zip(scored["scores"].list()) {
        let want = 100.0 * scores["information_gain_share"].number();
        let found = value(&table, row, "all %").unwrap();
        assert!((found - want).abs() < 1e-4, "{found}, {want}");
        let required = scores["requirements"].list().iter();
        assert_eq!(row["requirements_met"], required.clone().all(|seen| seen["met"] == true));
        let missed = required.filter(|seen| seen["met"] == false).count();
        assert_eq!(row["not_met"].as_array().map_or(0, Vec::len), missed);
    }
    let table = study(&dir, "voxels street.json rigs.json --out voxels");
    assert_eq!(table["columns"], json!(["voxel", "roof", "sides"]));
    let table = study(&dir, "random street.json rigs.json --budget 8 --out random");
    let own = names(&table);
    assert_eq!(own[own.len() - 3..], ["roof", "sides", "optimized"]);
    assert!(price_and_mounts(rows(&table).last().unwrap()).0 <= 8.0, "{table}");
    // Without rigs an own vehicle is compared with no layout of the paper.
    let table = study(&dir, "regions street.json --budget 8 --out alone");
    assert_eq!(names(&table), ["optimized"]);
    assert!(price_and_mounts(&rows(&table)[0]).0 <= 8.0, "{table}");
}

#[test]
fn each_number_of_lidars_keeps_mounts_symmetry_and_budget() {
    let dir = street();
    let table = study(&dir, "lidars street.json --budget 9 --out poor");
    // The fine sensor is too dear: a coarse one, or two sides; 4 + 2 × 3 is more than 9.
    for (k, row) in rows(&table)[..3].iter().enumerate() {
        let (price, [roof, left, right]) = price_and_mounts(row);
        assert!(price <= 9.0 && roof <= 1 && left <= 1 && left == right, "{row}");
        assert!(roof + left + right <= k + 1, "{row}");
        assert_eq!(value(&table, row, "LiDARs taken"), Some((roof + left + right) as f64));
        assert_eq!(value(&table, row, "price"), Some(price));
    }
    // Rows that repeat a rig say so.
    let lidars = |row: usize| rows(&table)[row]["placement"]["lidars"].clone();
    assert!(lidars(0) != lidars(1) && lidars(1) == lidars(2), "{}", table["rows"]);
    table["notes"].to_string().says("Row 3 repeats the rig of 2: no more are taken.");
    let rich = study(&dir, "lidars street.json --out rich");
    rich["notes"].to_string().lacks("repeat");
    assert_eq!(price_and_mounts(&rows(&rich)[2]), (16.0, [1, 1, 1]));
    // Numbers that the mounts cannot hold have no row.
    assert_eq!(names(&rich), ["1", "2", "3"]);
    rich["notes"].to_string().says("they take 0 to 3 LiDARs.");
    let best = &rows(&rich)[2]["placement"];
    write(&dir, "best.json", &json!({ "placements": [best] }));
    let scores = &ok(&dir, "score street.json best.json --frames 2 --backend cpu")["scores"][0];
    let gain = value(&rich, &rows(&rich)[2], "near gain %").unwrap();
    assert!(close(gain, 100.0 * scores["near_gain"].number()), "{gain}, {scores}");
}

#[test]
fn prices_and_scenes_are_compared_within_the_budget() {
    let dir = street();
    let table = study(&dir, "cost street.json --budget 10 --out cost");
    let prices: Vec<f64> = rows(&table).iter().map(|row| price_and_mounts(row).0).collect();
    assert!(prices.iter().all(|price| *price <= 10.0), "{prices:?}");
    let free = study(&dir, "cost street.json --out free");
    assert_eq!(price_and_mounts(rows(&free).last().unwrap()).0, 16.0, "{free}");
    let other = read_text(&dir, "street.json");
    let other = other.replace("\"street\"", "\"other\"").replace("[0,14,1.5]", "[0,10,1.5]");
    fs::write(dir.path().join("other.json"), other).unwrap();
    let table = study(&dir, "transfer street.json other.json --budget 8 --out transfer");
    assert_eq!(names(&table), ["street", "other"]);
    assert!(rows(&table).iter().all(|row| price_and_mounts(row).0 <= 8.0), "{table}");
    let missed = format!("{}", rows(&table)[0]["not_met"]);
    assert!(rows(&table)[0]["requirements_met"] == true || missed.contains(" on "), "{missed}");
}

#[test]
fn rows_that_miss_a_requirement_are_marked_in_text_and_csv() {
    let dir = street();
    let line = "study regions street.json rigs.json --frames 2 --backend cpu --out one";
    let text = stdout(&dir, line);
    assert!(text.lines().any(|line| line.starts_with("! roof ")), "{text}");
    text.says("! roof: NOT MET: left: ");
    let csv = read_text(&dir, "one/table.csv");
    let mut lines = csv.lines();
    assert!(lines.next().unwrap().ends_with(",requirements met,not met"), "{csv}");
    let roof = lines.next().unwrap();
    assert!(roof.starts_with("roof,") && roof.contains(",false,\"NOT MET: left: "), "{roof}");
    read_text(&dir, "one/chart.svg").says("! roof");
}

#[test]
fn a_study_without_an_answer_ends_with_one_and_says_why() {
    let dir = street();
    // A mount for one LiDAR, and two that are to be mirror images of each other.
    change(&dir, "van.json", |van| {
        for mount in van["mounts"].as_array_mut().unwrap() {
            mount["count"] = json!([4, 4]);
        }
        van["symmetric"] = json!(false);
    });
    let line = "study lidars street.json --frames 1 --evaluations 4 --backend cpu";
    let (code, [_, stderr]) = ran(&dir, line);
    assert_eq!(code, Some(1), "{stderr}");
    stderr.says("no row has an answer: the mounts of van must hold 12");
    assert!(dir.path().join("studies/street-lidars/table.csv").is_file());
}

#[test]
fn what_a_study_does_not_take_is_refused() {
    let dir = street();
    let one = json!({ "name": "twin", "lidars": [{ "x": 0, "y": 0, "z": 1.8, "sensor": "fine" }] });
    write(&dir, "twins.json", &json!({ "placements": [one, one] }));
    crate::cli::room(dir.path());
    for (line, says) in [
        ("weather street.json", "the vehicle is not the paper's car"),
        ("voxels street.json", "give a file of placements behind the scenes"),
        ("weather street.json rigs.json --budget 9", "leave --budget out"),
        ("regions street.json rigs.json --budget 9", "leave --budget out"),
        ("lidars street.json rigs.json", "`study lidars` does not take"),
        ("lidars street.json --budget 3", "below the cheapest rig"),
        ("cost street.json --budget 3", "below the cheapest rig"),
        ("loss room.json --budget 9", "the LiDARs of the scene have no prices"),
        ("regions street.json twins.json", "the name `twin` is used twice"),
        ("nearfield street.json", "the vehicle is not the paper's car"),
        ("weather street.json rigs.json --condition fog --condition fog", "two conditions are"),
    ] {
        fails(&dir, &format!("study {line} --backend cpu")).says(says);
    }
    assert!(!Path::new(&dir.path().join("studies")).exists());
}

#[test]
fn the_paper_s_car_is_compared_with_the_layouts_of_its_table() {
    let dir = street();
    let mut scene = read_json(dir.path().join("street.json"));
    scene.as_object_mut().unwrap().remove("vehicle");
    scene["lidar"] = json!({ "channels": 4, "fov": [-30, 5], "azimuth_steps": 60, "range": 60 });
    scene["mount"] = json!({ "min": [-1, -1, 2], "max": [1, 1, 3], "roll": [-1, 1], "lidars": 4 });
    write(&dir, "paper.json", &scene);
    let table = study(&dir, "regions paper.json --out paper");
    assert_eq!(names(&table)[0], "Center");
    assert_eq!(names(&table).last(), Some(&"optimized"));
    // A lower mount holds none of them.
    (scene["mount"]["min"][2], scene["mount"]["max"][2]) = (json!(1.0), json!(1.5));
    write(&dir, "low.json", &scene);
    assert_eq!(names(&study(&dir, "regions low.json --out low")), ["optimized"]);
}

#[test]
fn the_loss_of_own_rigs_is_over_all_frames_unless_told() {
    let dir = street();
    let loss = |more: &str| {
        let found = ok(&dir, &("study loss street.json rigs.json --backend cpu", more));
        found["title"].text().to_owned()
    };
    assert!(loss("--out all").starts_with("street, 3 frames: "));
    assert!(loss("--out one --frames 1").starts_with("street, 1 frame: "));
}

#[test]
fn own_rigs_lose_each_lidar_in_turn() {
    let dir = TempDir::new().unwrap();
    let ahead = json!({ "name": "ahead", "target": "car", "from": 10, "within": 15, "bearing": [-60, 60], "share": 0.9 });
    let mut pair = ahead.clone();
    (pair["name"], pair["without_any_one"]) = (json!("pair"), json!(true));
    ruled(dir.path(), json!([ahead, pair]));
    let lidar = |yaw: f64| json!({ "x": 0, "y": 0, "z": 1, "yaw": yaw, "sensor": "half" });
    let rigs = json!({ "placements": [
        { "name": "both", "lidars": [lidar(0.0), lidar(std::f64::consts::PI)] },
        { "name": "twice", "lidars": [lidar(0.0), lidar(0.0), lidar(std::f64::consts::PI)] },
        { "name": "front", "lidars": [lidar(0.0), lidar(0.0)] } ] });
    let back = std::f64::consts::PI;
    write_rig(&dir, "blind.json", "back", [lidar(back), lidar(back)]);
    write(&dir, "own.json", &rigs);
    let found = ok(&dir, "study loss street.json own.json --backend cpu --out lost");
    let title = found["title"].text();
    assert!(title.ends_with(": near gain % with all LiDARs, and after the loss of one"), "{title}");
    let columns = found["columns"].list();
    assert_eq!(columns.len(), 8, "{columns:?}");
    let values = |row: usize| -> Vec<Value> { found["rows"][row]["values"].list().clone() };
    // One of two: nothing ahead, or nothing behind but what the half turns share.
    let both = values(0);
    assert_eq!((&both[5], &both[4]), (&json!(2.0), &Value::Null));
    assert!(both[6].number() > 150.0, "{both:?}");
    // Without the first of two that look alike nothing changes.
    let twice = values(1);
    assert_eq!((&twice[0], &twice[5]), (&twice[2], &json!(0.0)));
    // The scores that `score` has of the LiDARs that are left, and how far each requirement is from failing.
    let after = &found["rows"][0]["after_loss"];
    assert_eq!(after.list().len(), 2, "{after}");
    write_rig(&dir, "rest.json", "rest", [lidar(std::f64::consts::PI)]);
    let rest = &ok(&dir, "score street.json rest.json --backend cpu")["scores"][0];
    for key in ["near_gain", "information_gain_share", "m_sog_scaled", "covered"] {
        assert_eq!(after[0][key].number(), rest[key].number(), "{key}");
    }
    assert_eq!(after[0]["name"], "LiDAR 0 (mast)");
    for (k, name) in ["ahead", "pair"].into_iter().enumerate() {
        let margin = &after[0]["requirements"][k];
        assert!(margin["name"].text().starts_with(name), "{margin}");
        assert_eq!((&margin["found"], &margin["met"]), (&json!(0.0), &json!(false)));
        assert!((margin["margin_points"].number() + 90.0).abs() < 1e-9, "{margin}");
        assert!(after[1]["requirements"][k]["margin_points"].number() >= 0.0, "{after}");
    }
    let text = stdout(&dir, "study loss street.json own.json --backend cpu --out lost");
    let lost = text.lines().find(|line| line.starts_with("  LiDAR 0 (mast)")).expect(&text);
    assert_eq!(lost.matches("!-90.0").count(), 2, "{text}");
    assert!(
        text.lines()
            .skip_while(|line| !line.starts_with("LiDAR lost"))
            .take(9)
            .all(|line| line.len() <= 80)
    );
    // Every column has a name of its own, and the gain is in per cent, as the table of `score` has it.
    let table = read_text(&dir, "lost/table.csv");
    let mut titles: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let count = titles.len();
    for title in ["LiDAR 0 lost: near gain %", "LiDAR 2 lost: ahead margin points"] {
        assert!(titles.contains(&title), "{titles:?}");
    }
    titles.sort_unstable();
    titles.dedup();
    assert_eq!(titles.len(), count, "{table}");
    let scores = ok(&dir, "score street.json own.json --backend cpu");
    let gain = scores["scores"][0]["near_gain"].number();
    assert!((both[0].number() - 100.0 * gain).abs() < 1e-9, "{both:?} {gain}");
    // The chart has the gains alone: two rigs at three and four values; the losses that fail are hollow.
    let chart = read_text(&dir, "lost/chart.svg");
    let hollow = chart.matches("fill=\"#fff\" stroke=").count();
    assert_eq!(
        found["rows"][0]["unmet_at"],
        json!([1, 2]),
        "the first loss alone misses both: {found}"
    );
    assert_eq!(hollow, 2, "{chart}");
    assert!(!chart.contains("most not met") && chart.contains("near gain % (hollow"), "{chart}");
    let notes = found["notes"].to_string();
    let lost = "both without LiDAR 0 (mast): NOT MET: ahead: 0.0 % seen, 90.0 % required, missing at 10 to 15 m";
    notes.says(lost);
    notes.says("both without LiDAR 1: BLIND: left and behind and right (in sectors of 30° over 210°, left round from 75° over 180° to -75°)");
    // Sectors that all LiDARs leave blind are told once.
    notes
        .says(
            "front with all LiDARs already: left and behind and right (in sectors of 30° over 210°",
        )
        .lacks("front without")
        .lacks("both with all");
    let looked = &scores["scores"][0]["range_card"]["blind_between"];
    let [near, far] = [0, 1].map(|end: usize| looked[end].number());
    notes.says(&format!("a car is lost somewhere between {near} and {far} m"));
    // A rule that allows for a loss is looked at with this one LiDAR lost, and no second.
    notes.says("; NOT MET: pair: 0.0 % seen, 90.0 % required");
    notes.lacks("twice without LiDAR 0").lacks("already NOT MET");
    // A requirement that all LiDARs miss is missed without each, and told so.
    let args = "study loss street.json blind.json --backend cpu --out blind";
    let notes = ok(&dir, args)["notes"].to_string();
    for lost in ["back without LiDAR 0", "back without LiDAR 1"] {
        let (_, rest) = notes.split_once(lost).expect(&notes);
        let told = rest.split("back without").next().unwrap();
        assert!(told.contains("already NOT MET: ahead: 0.0 % seen, 90.0 % required"), "{notes}");
    }
    // In fog cars are lost where `score` of the LiDARs that are left says so in the same fog.
    let single = |name: &str, yaw: f64| json!({ "name": name, "lidars": [lidar(yaw)] });
    let left = json!({ "placements": [single("ahead", 0.0), single("back", back)] });
    write(&dir, "left.json", &left);
    let degrees = |more: &str| {
        let scores = ok(&dir, &("score street.json left.json --backend cpu", more));
        let [ahead, back] = [0, 1].map(|row| blind_degrees(&scores["scores"][row]));
        ahead.max(back)
    };
    let fog = "--condition fog:mor=12";
    let in_fog = ok(&dir, &("study loss street.json own.json --backend cpu --out fog", fog));
    let blind = in_fog["rows"][0]["values"][6].number();
    assert_eq!((blind, both[6].number()), (degrees(fog), degrees("")));
    assert!(blind > both[6].number(), "{blind} {both:?}");
    fails(&dir, "study lidars street.json own.json")
        .says("own.json: holds placements, which `study lidars` does not take");
}

#[test]
fn studies_look_at_a_rule_of_100_per_cent_as_closely_as_score() {
    let dir = street();
    // A mast 9 cm wide hides a car between two of the bearings that a search looks at.
    let mast = |low: [f64; 3], high: [f64; 3]| json!({ "class": "vehicle", "box": { "min": low, "max": high } });
    let vehicle = json!({ "sightline": 1, "name": "cart",
        "body": [mast([-0.5, -0.5, 0.3], [0.5, 0.5, 1.5]), mast([0.998, 0.02, 0.3], [1.0, 0.11, 3.0])],
        "sensors": [{ "name": "ring", "lidar": { "channels": 48, "fov": [-14.1, 0], "azimuth_steps": 1800, "range": 100 } }],
        "mounts": [{ "name": "top", "min": [-0.1, -0.1, 2], "max": [0.1, 0.1, 2.1], "count": 1 }],
        "require": [{ "target": "car", "from": 10, "within": 50, "share": 1 }] });
    write(&dir, "cart.json", &vehicle);
    write_rig(&dir, "ring.json", "one", json!([{ "x": 0, "y": 0, "z": 2 }]));
    let of = "street.json ring.json --vehicle cart.json";
    let line = format!("score {of} --frames 2 --backend cpu --tolerance 0");
    let required = ok(&dir, &line)["scores"][0]["requirements"][0].clone();
    assert_eq!(required["met"], false, "{required}");
    let missing = required["missing"].text();
    missing.says("1 of 192 bearings");
    for kind in ["weather", "regions", "random"] {
        let table = study(&dir, &format!("{kind} {of} --out {kind}"));
        let row = rows(&table).iter().find(|row| row["name"].text().starts_with("one"));
        let row = row.unwrap_or_else(|| panic!("{table}"));
        assert_eq!(row["requirements_met"], false, "{kind}: {row}");
        assert!(row["not_met"][0].text().ends_with(missing), "{kind}: {row}");
    }
    let line = format!("study tolerance {of} --frames 2 --backend cpu --steps 1");
    let (code, room, _) = answer(&dir, &line);
    let told = room["rows"][0]["missed"][0].as_str().unwrap_or_else(|| panic!("{room}"));
    assert_eq!((code, told.ends_with(missing)), (Some(1), true), "{room}");
}

#[test]
fn channels_are_of_a_model_that_the_budget_buys() {
    let dir = street();
    let table = study(&dir, "channels street.json --budget 5");
    assert!(table["notes"].to_string().contains("The sensor that differs is `coarse`"), "{table}");
    let covered: Vec<Option<f64>> =
        rows(&table).iter().map(|row| value(&table, row, "near gain %")).collect();
    assert_ne!(covered[0], covered[3], "{table}");
}
