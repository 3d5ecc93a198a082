//! Vehicles on the command line: mixed rigs, a budget, phases, what must be seen.

use crate::cli::*;

pub(crate) const CPU: &str = "--backend cpu";

/// A room, and a vehicle with a spinning sensor on the roof and solid ones on two sides.
pub(crate) fn garage() -> TempDir {
    let dir = in_room();
    let spinning = json!({ "channels": 6, "fov": [-40, 30], "azimuth_steps": 90, "range": 20 });
    let solid = json!({ "channels": 5, "fov": [-30, 30], "azimuth": [-50, 50], "azimuth_steps": 31, "range": 8 });
    let side = |name: &str, y: f64| {
        let x = 0.3 * y.signum();
        let polygon = json!([[x, y, 0.9], [-x, y, 0.9], [-x, y, 1.2], [x, y, 1.2]]);
        json!({ "name": name, "polygon": polygon, "pitch": [-0.2, 0.2], "sensors": ["solid"], "count": [0, 1] })
    };
    let vehicle = json!({
        "sightline": 1,
        "sensors": [{ "name": "spinning", "price": 10, "lidar": spinning },
                    { "name": "solid", "price": 3, "lidar": solid }],
        "mounts": [{ "name": "roof", "min": [-0.4, -0.4, 1.4], "max": [0.4, 0.4, 1.7], "roll": [-0.2, 0.2],
                     "sensors": ["spinning"], "count": [0, 1] },
                   side("left", 0.5), side("right", -0.5)],
        "min_distance": 0.2
    });
    write(&dir, "cart.json", &vehicle);
    dir
}

pub(crate) fn changed(dir: &Path, name: &str, change: impl FnOnce(&mut Value)) {
    let mut vehicle = read_json(dir.join("cart.json"));
    change(&mut vehicle);
    write(dir, name, &vehicle);
}

/// Models of the LiDARs of a run's result.
fn sensors(result: &Value) -> Vec<&str> {
    let lidars = result["best"]["placement"]["lidars"].list();
    lidars.iter().map(|lidar| lidar["sensor"].text()).collect()
}

fn optimize(budget: &str, out: &str) -> String {
    format!(
        "optimize room.json --vehicle cart.json --evaluations 40 --budget {budget} --out {out} --backend cpu"
    )
}

#[test]
fn sensors_are_chosen_for_the_money_and_put_where_they_may_stand() {
    let dir = garage();
    let rich = ok(&dir, &optimize("16", "rich"));
    assert!(sensors(&rich).contains(&"spinning"), "{rich}");
    assert!(rich["settings"]["equipped"]["cost"].number() <= 16.0);
    assert!(rich["timings"]["equip"].number() > 0.0, "{}", rich["timings"]);
    let poor = ok(&dir, &optimize("6.5", "poor"));
    assert_eq!(sensors(&poor), ["solid", "solid"]);
    let gain = |result: &Value| result["best"]["scores"]["information_gain"].number();
    assert!(gain(&rich) > gain(&poor), "{} and {}", gain(&rich), gain(&poor));
    // First for the engineer, then for the sceptic.
    let page = read_text(&dir, "rich/report.html");
    let at = |heading: &str| page.find(heading).unwrap_or_else(|| panic!("no {heading}"));
    let order = [
        "Range card<",
        "The placement<",
        "Seen by how many LiDARs<",
        "If one LiDAR fails<",
        "Overlap of the LiDARs<",
        "Warnings<",
        "How to repeat it<",
    ];
    assert!(order.map(at).is_sorted(), "{:?}", order.map(at));
    let words = rich["phases"]["words"].text();
    words.says("8 other draws of the azimuth phases");
    assert!(poor.get("phases").is_none(), "solid sensors do not turn");
    let lidars = poor["best"]["placement"]["lidars"].list();
    let sides = [0, 1].map(|k| lidars[k]["y"].number());
    assert!(sides[0] > 0.49 && sides[1] < -0.49, "{sides:?}");
    // Other commands read a run's files.
    write(&dir, "best.json", &json!({ "placements": [rich["best"]["placement"]] }));
    let again = ok(&dir, "score room.json best.json --vehicle cart.json --backend cpu");
    let again = again["scores"][0]["information_gain"].number();
    // At other draws of the spinning sensor's phases.
    assert!((again / gain(&rich) - 1.0).abs() < 0.1, "{again} and {}", gain(&rich));
}

#[test]
fn prices_add_up_as_they_are_written() {
    let dir = garage();
    changed(dir.path(), "cents.json", |vehicle| {
        vehicle["sensors"][0]["price"] = json!(1.1);
        vehicle["mounts"] = json!([vehicle["mounts"][0]]);
        vehicle["mounts"][0]["count"] = json!([3, 3]);
    });
    // In floating point three times 1.1 is 3.3000000000000003.
    let search = |budget| optimize(budget, "run").replace("cart.json", "cents.json");
    fails(&dir, &search("3.29")).says("--budget: 3.29 is below").says("costs 3.3;");
    let found = ok(&dir, &search("3.3"));
    assert_eq!(found["settings"]["equipped"]["cost"], json!(3.3), "{found}");
    assert_eq!(found["settings"]["equipped"]["open_mounts"], json!([]), "three stand on one mount");
    let listed = read_json(dir.path().join("run/placements.json"));
    assert_eq!(listed["placements"][0]["price"], json!(3.3));
    let front = "optimize room.json --vehicle cents.json --front price,near_gain --evaluations 20";
    ok(&dir, &(front, "--budget 3.3 --out front", CPU));
    for file in ["result.json", "placements.json"] {
        read_text(dir.path().join("front"), file).says("\"price\": 3.3").lacks("3.30000");
    }
}

#[test]
fn the_vehicle_of_the_readme_gets_a_rig_for_its_budget() {
    let dir = garage();
    let readme = include_str!("../README.md");
    let (_, rest) = readme.split_once("```json\n").unwrap();
    let (text, rest) = rest.split_once("```").unwrap();
    assert!(rest.contains("--vehicle car.json --budget 9000"), "the command below it");
    fs::write(dir.path().join("car.json"), text).unwrap();
    let run = "optimize room.json --vehicle car.json --budget 9000 --out own";
    let result = ok(&dir, &(run, "--evaluations 8 --tolerance 0", CPU));
    assert_eq!(result["settings"]["equipped"]["cost"], 8400.0, "three sensors of 2800");
    assert_eq!(result["best"]["scores"]["requirements"][0]["name"], "child from 5 to 30 m");
}

#[test]
fn a_run_that_was_killed_while_sensors_were_chosen_goes_on_to_the_same_bytes() {
    let dir = garage();
    ok(&dir, &optimize("16", "whole"));
    let checkpoint = dir.path().join("broken/checkpoint.json");
    let mut child = begun(&dir, &optimize("16", "broken"));
    wait_for(|| checkpoint.exists());
    // Killed, not asked.
    child.kill().unwrap();
    child.wait().unwrap();
    let cut = read_json(&checkpoint);
    let equipping = &cut["state"]["equipping"]["choosing"];
    assert!(equipping.is_object() || cut["state"]["run"]["phase"] != "confirm", "killed too late");
    ok(&dir, "optimize --resume broken --backend cpu");
    let read = |run: &str, file: &str| fs::read(dir.path().join(run).join(file)).unwrap();
    for file in ["checkpoint.json", "history.jsonl", "placement.svg", "map.svg"] {
        assert_eq!(read("whole", file), read("broken", file), "{file}");
    }
}

#[test]
fn sensors_on_two_sides_stay_mirror_images() {
    let dir = garage();
    changed(dir.path(), "cart.json", |vehicle| {
        vehicle["symmetric"] = json!(true);
        for mount in vehicle["mounts"].as_array_mut().unwrap() {
            mount["count"] = json!(1);
        }
    });
    let found = ok(&dir, &optimize("100", "even"));
    // The rule is the vehicle's; no option gave it.
    let rules = json!({ "equal_height": false, "symmetric": true, "fixed": [] });
    assert_eq!(found["settings"]["rules"], rules);
    let lidars = found["best"]["placement"]["lidars"].list();
    let field = |k: usize, name: &str| lidars[k][name].number();
    let side = |k: usize| lidars[k]["sensor"] == "solid";
    let [a, b] = (0..3).filter(|&k| side(k)).collect::<Vec<_>>()[..] else { panic!("{found}") };
    for (name, sign) in
        [("x", 1.0), ("y", -1.0), ("z", 1.0), ("roll", -1.0), ("pitch", 1.0), ("yaw", -1.0)]
    {
        let off = field(a, name) - sign * field(b, name);
        assert!(off.abs() < 1e-9, "{name}: {off}");
    }
    let top = (0..3).find(|&k| !side(k)).unwrap();
    assert_eq!([field(top, "y"), field(top, "roll")], [0.0; 2], "in the plane");
    assert!(found["methods"].list().len() == 2, "swaps move them, too: {found}");
    // With a choice of numbers, too: two sides cost 6, one alone is none.
    changed(dir.path(), "cart.json", |vehicle| {
        for mount in vehicle["mounts"].as_array_mut().unwrap() {
            mount["count"] = json!([0, 1]);
        }
    });
    let message = fails(&dir, &optimize("3.5", "poor"));
    assert!(message.contains("cheapest") && message.contains('6'), "{message}");
    let pair = ok(&dir, &optimize("6.5", "pair"));
    assert_eq!(sensors(&pair), ["solid", "solid"]);
    let lidars = pair["best"]["placement"]["lidars"].list();
    let sides = [0, 1].map(|k| lidars[k]["y"].number());
    assert!(sides[0] > 0.49 && (sides[0] + sides[1]).abs() < 1e-9, "{sides:?}");
    // One height on the roof and on the sides there is not.
    changed(dir.path(), "cart.json", |vehicle| vehicle["equal_height"] = json!(true));
    fails(&dir, &optimize("100", "level")).says("unless all are boxes, and `left` is a patch");
}

#[test]
fn what_must_be_seen_changes_what_is_bought() {
    let dir = garage();
    changed(dir.path(), "cart.json", |vehicle| {
        vehicle["require"] = json!([
            { "name": "left", "min": [-0.5, 0.6, 0.6], "max": [0.5, 1.6, 1.4], "share": 0.5 },
        ]);
    });
    let found = ok(&dir, &optimize("3", "one"));
    let lidar = &found["best"]["placement"]["lidars"][0];
    assert!(sensors(&found) == ["solid"] && lidar["y"].number() > 0.0, "{lidar}");
    let seen = &found["best"]["scores"]["requirements"][0];
    assert!(seen["found"].number() >= 0.5 && seen["met"] == true, "{seen}");
    let page = read_text(&dir, "one/report.html");
    let heading = "<h1>The placement found meets its requirement (left) at a price of 3 (budget 3) with a near gain of ";
    let rest = page.split(heading).nth(1).unwrap_or_else(|| panic!("{page:.3000}"));
    assert!(rest.split("</h1>").next().unwrap().ends_with(" %."), "{page:.3000}");
}

#[cfg(feature = "gpu")]
#[test]
fn mixed_rigs_pass_verify() {
    let dir = garage();
    let found = ok(&dir, "verify room.json --vehicle cart.json --random 6 --backend gpu");
    assert_eq!(found["passed"], true, "{found}");
}

#[test]
fn the_study_of_cost_rises_with_the_price() {
    let dir = garage();
    let study = ["study", "cost", "room.json", "--vehicle", "cart.json", "--evaluations", "20"];
    let table = ok(&dir, &(&study, CPU));
    let rows = table["rows"].list();
    let prices: Vec<f64> = rows.iter().map(|row| row["values"][0].number()).collect();
    assert!(prices.len() >= 2 && prices.is_sorted() && prices[0] == 3.0, "{prices:?}");
    assert!(prices.last() >= Some(&10.0), "{prices:?}");
    let gains: Vec<f64> = rows.iter().map(|row| row["values"][1].number()).collect();
    assert!(gains.last() > gains.first(), "{gains:?}");
    // Searches of a study do not look at copies: a table with requirements says so.
    let note = "Requirements are met as mounted only: searches of a study allow for no tolerance";
    assert!(!table["notes"].to_string().contains(note), "{table}");
    changed(dir.path(), "need.json", |cart| {
        cart["require"] =
            json!([{ "name": "near", "min": [-2, -2, 0], "max": [2, 2, 1], "share": 0.1 }]);
    });
    let line = "study cost room.json --vehicle need.json --evaluations 4 --out need";
    let table = ok(&dir, &(line, CPU));
    assert!(table["notes"].to_string().contains(note), "{table}");
    // Own rigs are not searched.
    let lidars = json!([
        { "x": 0, "y": 0, "z": 1.5, "sensor": "spinning" }, { "x": 0.3, "y": 0, "z": 1.5, "sensor": "spinning" }]);
    write_rig(&dir, "own.json", "own", lidars);
    for kind in ["loss", "weather"] {
        let line = format!("study {kind} room.json own.json --vehicle need.json --out {kind}");
        let notes = ok(&dir, &(line, CPU))["notes"].to_string();
        let told = "Requirements are met as mounted only: `sightline score` tells";
        assert!(notes.contains(told) && !notes.contains("searches of a study"), "{notes}");
    }
    // A sensor without a price is named wherever prices matter, and nowhere else.
    changed(dir.path(), "free.json", |cart| {
        cart["sensors"][1].as_object_mut().unwrap().remove("price");
    });
    changed(dir.path(), "gift.json", |cart| cart["sensors"][1]["price"] = json!(0));
    let note = "`solid` has no price and counts as 0; give it a `price`";
    for (line, is_told) in [
        ("optimize room.json --vehicle gift.json --budget 12 --out g", false),
        ("study cost room.json --vehicle free.json --out c", true),
        ("optimize room.json --vehicle free.json --budget 12 --out b", true),
        ("optimize room.json --vehicle free.json --front price,near_gain --out f", true),
        ("optimize room.json --vehicle free.json --out n", false),
        ("optimize room.json --vehicle cart.json --budget 12 --out p", false),
    ] {
        let told = stderr(&dir, &(line, "--evaluations 4 --backend cpu"));
        assert!(told.contains(note) == is_told, "{line}: {told}");
    }
}

#[test]
fn studies_take_mixed_rigs_or_say_why_not() {
    let dir = garage();
    // The cart is not the paper's car, and has no layouts of its own: two studies need rigs.
    let lidar = json!({ "x": 0, "y": 0, "z": 1.5, "sensor": "spinning" });
    write_rig(&dir, "rigs.json", "one", [lidar]);
    let study = |kind: &str| {
        let rigs = if ["voxels", "regions"].contains(&kind) { "rigs.json" } else { "" };
        let args = "--vehicle cart.json --evaluations 8 --random 5 --backend cpu";
        format!("study {kind} room.json {rigs} {args} --out {kind}")
    };
    for kind in ["lidars", "channels", "voxels", "random", "regions", "loss"] {
        let table = ok(&dir, &study(kind));
        assert!(!table["rows"].list().is_empty(), "{kind}");
        if kind == "random" {
            // All of few placements have a warning: the optimized one is shown with it.
            let row = &table["rows"][0];
            assert_eq!(row["name"], "optimized", "{table}");
            assert!(row["values"][0].is_number() && row["warning"].is_string(), "{table}");
            assert!(table["notes"].to_string().contains("No random placement counts; "), "{table}");
        }
        if kind == "channels" {
            table["notes"].to_string().says("`spinning`, the first model with channels of the rig");
            let beams: Vec<f64> =
                table["rows"].list().iter().map(|row| row["values"][0].number()).collect();
            assert_eq!(beams[..2], [16.0 * 90.0, 32.0 * 90.0]);
        }
    }
    fails(&dir, &study("height")).says("3 mounts of their own heights: roof, left, right");
}

#[test]
fn the_cheapest_rig_with_room_is_found_in_any_order_of_the_mounts() {
    let dir = garage();
    // The cheapest sensor has no room, and the dear one stands before the other in the file.
    let lidar = json!({ "channels": 8, "fov": [-30, 0], "azimuth_steps": 90, "range": 50 });
    let sensor = |name: &str, price: u32| json!({ "name": name, "price": price, "lidar": lidar });
    let mount = |sensor: &str, x: f64| json!({ "name": sensor, "min": [x, 0, 1.7], "max": [x + 0.5, 0.2, 2], "sensors": [sensor], "count": [0, 1] });
    let posts = json!({ "sightline": 1, "name": "posts",
        "sensors": [sensor("cheap", 1), sensor("dear", 80), sensor("mid", 40)],
        "mounts": [mount("cheap", -2.0), mount("dear", 0.0), mount("mid", 2.0)],
        "keep_out": [{ "min": [-3, -1, 1], "max": [-1, 1, 3] }] });
    write(&dir, "posts.json", &posts);
    let budget = "optimize room.json --vehicle posts.json --budget 39";
    fails(dir.path(), budget).says("39 is below the cheapest rig").says("costs 40");
}

#[test]
fn faults_are_said() {
    let dir = garage();
    fails(&dir, &optimize("2", "x")).says("--budget: 2 is below the cheapest rig").says("costs 3");
    fails(&dir, &(optimize("9", "x"), "--fix yaw=0"))
        .says("--fix, --symmetric and --equal-height are rules for the `mount` of a scene")
        .says("cart.json has mounts of its own");
    fails(&dir, "optimize room.json --budget 9").says("--budget").says("--vehicle");
    fails(&dir, "study cost room.json").says("room.json").says("has no vehicle").says("--vehicle");
    fails(&dir, &(optimize("9", "x"), "--objective m_sog_scaled"))
        .says("chosen by near_gain, near_gain_2, near_gain_3 or information_gain")
        .says("m_sog_scaled");
    write_rig(&dir, "sonar.json", "x", json!([{ "x": 0, "y": 0, "z": 1.5, "sensor": "sonar" }]));
    fails(&dir, "score room.json sonar.json --vehicle none.json").says("none.json: cannot be read");
    fails(&dir, "score room.json sonar.json --vehicle cart.json --backend cpu")
        .says("sonar.json: placement `x`, LiDAR 0: there is no sensor `sonar`")
        .says("`spinning`, `solid`");
    write(&dir, "slip.json", &read_text(&dir, "sonar.json").replace("sonar", "spining"));
    let score = "score room.json slip.json --vehicle cart.json --backend cpu";
    for command in [score, &format!("{} --baselines slip.json", optimize("16", "x"))] {
        fails(&dir, command)
            .says("slip.json: placement `x`, LiDAR 0: ")
            .says("did you mean `spinning`?");
    }
    // Files in each other's place.
    for (args, words) in [
        ("score room.json cart.json", "cart.json: is a vehicle; give a file of placements"),
        ("score room.json cart.json", "here, and this one by --vehicle"),
        (
            "optimize cart.json",
            "cart.json: is a vehicle, where a scene belongs; give it by --vehicle",
        ),
        (
            "optimize room.json sonar.json",
            "sonar.json: is a file of placements, where a scene belongs; give it by --baselines or --inject",
        ),
        (
            "score room.json sonar.json --vehicle sonar.json",
            "sonar.json: is a file of placements, where a vehicle belongs; give it behind the scenes",
        ),
        (
            "study height sonar.json",
            "sonar.json: holds placements, which `study height` does not take, as it searches its own",
        ),
        (
            "score room.json sonar.json --vehicle room.json",
            "room.json: is a scene, where a vehicle belongs; give it as SCENE",
        ),
    ] {
        fails(&dir, args).says(words);
    }
    changed(dir.path(), "bad.json", |vehicle| vehicle["mounts"] = json!([]));
    fails(&dir, "score room.json sonar.json --vehicle bad.json")
        .says("bad.json: mounts: a list of 0");
    changed(dir.path(), "knot.json", |vehicle| {
        vehicle["mounts"][1]["polygon"] =
            json!([[0, 0.5, 0.5], [-0.3, 0.5, 0.5], [0, 0.5, 0.6], [-0.1, 0.5, 0.7]]);
    });
    fails(&dir, "score room.json sonar.json --vehicle knot.json")
        .says("knot.json: mounts[1].polygon[3]: the side from corner 3 to corner 0")
        .says("must not cross or touch itself");
    write(&dir, "sonar.dat", "nonsense");
    changed(dir.path(), "vendor.json", |vehicle| {
        vehicle["sensors"][1]["lidar"] = json!({ "file": "sonar.dat", "range": 8 });
    });
    fails(&dir, "score room.json sonar.json --vehicle vendor.json")
        .says("vendor.json: sensors[1].lidar.file: ")
        .says("sonar.dat: the content is not that of a sensor file");
    changed(dir.path(), "far.json", |vehicle| {
        vehicle["require"] = json!([{ "name": "behind the wall", "min": [90, 90, 0], "max": [91, 91, 1], "share": 0.5 }]);
    });
    write(&dir, "fits.json", &read_text(&dir, "sonar.json").replace("sonar", "spinning"));
    fails(&dir, "score room.json fits.json --vehicle far.json --backend cpu")
        .says("far.json: require[0]: `behind the wall` holds no voxel of the scene's roi")
        .says("; move it into");
    changed(dir.path(), "mm.json", |vehicle| {
        let area = json!({ "name": "near", "min": [500, -500, 0], "max": [1500, 500, 1000], "share": 0.5 });
        vehicle["require"] = json!([area]);
    });
    fails(&dir, "score room.json fits.json --vehicle mm.json --backend cpu")
        .says("`near` holds no voxel")
        .says("is it in millimetres? lengths are in metres, 1500 mm are 1.5");
}
