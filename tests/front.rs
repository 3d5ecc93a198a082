//! The front of objectives: against every equipment on every pose of the grid, and as the program writes it.

use sightline::job::{Front, FrontObjective, FrontObjectives, FrontState, FrontStopped};
use sightline::search::Work;
use sightline::vehicle::{PoseGrid, Spacing};
use sightline::{Event, Job, JobFiles, Placement, Settings};

use crate::cli::*;

/// A street whose cart carries up to two LiDARs in front and one behind, of two models.
pub(crate) fn street(dir: &Path, prices: [u32; 2], require: Value) {
    let model = |name: &str, price: u32, side: u32| {
        json!({ "name": name, "price": price, "lidar": { "channels": 12, "fov": [-24, 4],
            "azimuth": [-(side as i32), side], "azimuth_steps": side, "range": 40 } })
    };
    let mount = |name: &str, x: f64, yaw: f64, most: u32| {
        json!({ "name": name, "min": [x, -0.1, 1], "max": [x, 0.1, 1], "yaw": [yaw - 0.1, yaw + 0.1],
            "sensors": ["half", "narrow"], "count": [0, most] })
    };
    let vehicle = json!({ "sightline": 1, "name": "cart", "require": require,
        "sensors": [model("half", prices[0], 90), model("narrow", prices[1], 30)],
        "mounts": [mount("front", 0.8, 0.0, 2), mount("rear", -0.8, 3.1, 1)] });
    write(dir, "cart.json", &vehicle);
    let crate_of = |box_min: [i32; 3], box_max: [i32; 3]| json!([{ "class": "vehicle", "box": { "min": box_min, "max": box_max } }]);
    let scene = json!({ "sightline": 1, "name": "street", "vehicle": "cart.json", "frames": 4,
        "roi": { "min": [-12, -12, -0.5], "max": [12, 12, 3.5], "voxel": [0.5, 0.5, 0.5] },
        "static": [{ "class": "ground", "plane": { "min": [-30, -30], "max": [30, 30], "z": 0 } }],
        "actors": [
            { "name": "ahead", "kind": "car", "parts": crate_of([-1, -1, 0], [1, 1, 2]),
              "poses": [{ "x": 8, "y": 0 }, { "x": 9, "y": 2 }, { "x": 10, "y": 3 }, { "x": 7, "y": -4 }] },
            { "name": "behind", "kind": "car", "parts": crate_of([-1, -1, 0], [1, 1, 2]),
              "poses": [{ "x": -6, "y": 3 }, { "x": -7, "y": 2 }, { "x": -8, "y": 1 }, { "x": -9, "y": 0 }] }] });
    write(dir, "street.json", &scene);
}

pub(crate) fn car_ahead(share: f64) -> Value {
    json!([{ "name": "car ahead", "target": "car", "from": 10, "within": 15, "bearing": [-20, 20], "share": share }])
}

fn job(dir: &Path, evaluations: u64) -> Job {
    let files = JobFiles::new(&[dir.join("street.json")], None);
    files.read().unwrap().search(Settings { evaluations, ..Settings::default() })
}

/// A front with nobody looking on.
fn front(job: &Job, objectives: &str) -> Front {
    let objectives: FrontObjectives = objectives.parse().unwrap();
    job.front(&objectives, &mut |_: &Event| true).unwrap()
}

/// Every placement of the cart whose sensors stand on poses of the coarse grid: none to two in front, none or one
/// behind.
fn all_on_grid(job: &Job) -> Vec<Placement> {
    let spacing = Spacing { metres: 0.1, radians: 0.1 };
    let grid = PoseGrid::new(&job.scene().vehicle().every_kind(), spacing).unwrap();
    let poses: Vec<_> = (0..grid.len()).map(|number| grid.pose(number)).collect();
    let on = |front: bool| poses.iter().filter(move |pose| (pose.x > 0.0) == front);
    let mut ahead = vec![vec![]];
    for (k, one) in on(true).enumerate() {
        ahead.push(vec![*one]);
        ahead.extend(on(true).skip(k + 1).map(|other| vec![*one, *other]));
    }
    let behind: Vec<Vec<_>> = [vec![]].into_iter().chain(on(false).map(|one| vec![*one])).collect();
    let both = ahead.iter().flat_map(|front| behind.iter().map(|rear| [&front[..], rear].concat()));
    let both = both.filter(|lidars| !lidars.is_empty()).enumerate();
    both.map(|(k, lidars)| Placement { name: format!("p{k}"), lidars }).collect()
}

/// Area that points (cost, gain) beat of the box between (0, 0) and (most, the largest gain).
fn hypervolume(points: &[(f64, f64)], most: f64) -> f64 {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (mut area, mut best) = (0.0, 0.0_f64);
    for (k, &(cost, gain)) in sorted.iter().enumerate() {
        best = best.max(gain);
        let next = sorted.get(k + 1).map_or(most, |next| next.0);
        area += best * (next - cost);
    }
    area
}

#[test]
fn a_hypervolume_is_the_area_of_steps() {
    assert_eq!(hypervolume(&[(1.0, 2.0), (3.0, 5.0), (2.0, 1.0)], 4.0), 2.0 + 2.0 + 5.0);
    assert_eq!(hypervolume(&[], 4.0), 0.0);
}

/// (cost, gain) of a placement: its price or number of sensors, and its score or the share of its requirements.
fn point(objectives: &FrontObjectives, values: &[f64]) -> (f64, f64) {
    let turned = |k: usize| match objectives.all()[k] {
        FrontObjective::Sensors => 10.0 * values[k],
        FrontObjective::Requirements => 1.0 - values[k],
        _ => values[k],
    };
    (turned(0), turned(1))
}

#[test]
fn the_front_of_a_small_vehicle_is_nearly_that_of_every_equipment_and_pose() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], json!([]));
    let free = job(dir.path(), 0);
    street(
        dir.path(),
        [30, 11],
        json!([
        { "target": "car", "from": 10, "within": 15, "bearing": [-180, 180], "beams": 12, "share": 0.9 },
        { "name": "ahead", "min": [2, -4, -0.3], "max": [8, 4, 0.3], "share": 0.3 }]),
    );
    let bound = job(dir.path(), 0);
    let placements = all_on_grid(&free);
    assert!(placements.len() > 3000, "{}", placements.len());
    let mut evaluators = [&free, &bound].map(|job| job.evaluator(|_| {}).unwrap().0);
    let scores = evaluators.each_mut().map(|evaluator| evaluator.scores(&placements).unwrap());
    let vehicle = free.scene().vehicle();
    for (names, requires, least) in [
        ("price,information_gain", 0, 0.99),
        ("sensors,near_gain", 0, 0.99),
        // Cars that nobody sees count against a placement; two LiDARs that see the same see fewer of them.
        ("price,near_gain_2", 0, 0.95),
        ("price,requirements", 1, 0.99),
    ] {
        let objectives: FrontObjectives = names.parse().unwrap();
        let found = front([&free, &bound][requires], names);
        assert_eq!(found.stopped, FrontStopped::Complete);
        let points: Vec<(f64, f64)> =
            found.points.iter().map(|p| point(&objectives, &p.values)).collect();
        let every = placements.iter().zip(&scores[requires]).map(|(placement, scores)| {
            let price = placement.lidars.iter().map(|lidar| vehicle.price(lidar.sensor)).sum();
            let value = |of: &FrontObjective| of.value(scores, placement.lidars.len(), price);
            let values: Option<Vec<f64>> = objectives.all().iter().map(value).collect();
            point(&objectives, &values.unwrap())
        });
        let exact = hypervolume(&every.collect::<Vec<_>>(), 100.0);
        let share = hypervolume(&points, 100.0) / exact;
        println!("{names}: {:.3} % of the hypervolume, {} points", 100.0 * share, points.len());
        assert!((least..1.0 + 1e-9).contains(&share), "{names}, {share}: {points:?}");
        // No point is beaten by another one, and all rise.
        assert!(points.windows(2).all(|pair| pair[0].0 < pair[1].0 && pair[0].1 < pair[1].1));
        assert!(points.len() >= 3, "{points:?}");
    }
}

#[test]
fn requirements_are_an_objective_or_keep_a_point_on_the_front() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], car_ahead(0.95));
    let job = job(dir.path(), 0);
    let traded = front(&job, "price,requirements");
    let last = traded.points.last().unwrap();
    assert!(last.meets && last.values[1] == 0.0, "{traded:?}");
    let values: Vec<&[f64]> = traded.points.iter().map(|point| &point.values[..]).collect();
    assert!(values.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] > pair[1][1]));
    let kept = front(&job, "price,information_gain");
    let cheapest = kept.picks.iter().find(|(pick, _)| pick.to_string().starts_with("cheapest"));
    let cheapest = &kept.points[cheapest.unwrap().1];
    assert!(cheapest.meets && cheapest.price <= last.price, "{kept:?}");
    let three = front(&job, "price,near_gain,targets");
    assert!(three.points.iter().all(|point| point.values.len() == 3));
    assert!(three.points.len() >= kept.points.len().min(traded.points.len()));
    // A score that is no gain is compared, too, and two gains are traded.
    let other = front(&job, "price,m_sog_scaled");
    assert!(other.points[0].values[1] < 0.0, "{other:?}");
    let gains = front(&job, "near_gain,information_gain");
    assert!(gains.points.windows(2).all(|pair| pair[0].values[0] > pair[1].values[0]));
}

#[test]
fn searches_around_the_points_lose_nothing_of_the_front() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], json!([]));
    let [coarse, fine] = [0, 30].map(|n| front(&job(dir.path(), n), "price,near_gain"));
    let area = |front: &Front| {
        let points: Vec<(f64, f64)> =
            front.points.iter().map(|point| (point.values[0], point.values[1])).collect();
        hypervolume(&points, 100.0)
    };
    assert!(fine.scored > coarse.scored && area(&fine) > area(&coarse) * 1.001);
}

#[test]
fn an_observer_stops_a_front_which_keeps_what_was_found() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], json!([]));
    let job = job(dir.path(), 400);
    let objectives: FrontObjectives = "price,near_gain".parse().unwrap();
    let stopped_at = |words: &str, after: u64| {
        let mut observe = |event: &Event| match event {
            Event::Progress { work, done, .. } => {
                !(work.to_string().starts_with(words) && *done >= after)
            }
            _ => true,
        };
        job.front(&objectives, &mut observe).unwrap()
    };
    let nothing = stopped_at("poses for the choice", 0);
    assert_eq!((nothing.stopped, nothing.points.len()), (FrontStopped::Interrupted, 0));
    for (words, after) in
        [("choices of sensors", 2), ("placements confirmed", 2), ("steps of the search", 3)]
    {
        let some = stopped_at(words, after);
        assert_eq!(some.stopped, FrontStopped::Interrupted, "{words}");
        assert!(!some.points.is_empty() && some.points.iter().all(|point| point.price > 0.0));
    }
}

/// Two folders of a front must hold the same bytes, but for the seconds and the memory that it took.
pub(crate) fn assert_same(dir: &Path, one: &str, other: &str) {
    let read = |folder: &str, name: &str| fs::read_to_string(dir.join(folder).join(name)).unwrap();
    for name in ["placements.json", "front.svg"] {
        assert_eq!(read(one, name), read(other, name), "{name}");
    }
    let without_spent = |folder: &str| {
        let mut result: Value = serde_json::from_str(&read(folder, "result.json")).unwrap();
        assert!(result["seconds"].take().as_f64() > Some(0.0));
        result["peak_memory"].take();
        result
    };
    assert_eq!(without_spent(one), without_spent(other));
}

#[test]
fn a_front_that_stops_again_and_again_has_the_points_of_one_that_never_did() {
    let dir = TempDir::new().unwrap();
    let hopeless =
        json!([{ "target": "tyre", "from": 15, "within": 15, "beams": 100, "share": 1 }]);
    for require in [hopeless, json!([])] {
        street(dir.path(), [30, 11], require.clone());
        let (job, objectives) = (job(dir.path(), 12), "price,near_gain".parse().unwrap());
        let mut whole_state = FrontState::default();
        let whole =
            job.front_from(&objectives, &mut whole_state, &mut |_| {}, &mut |_: &Event| true);
        let whole = whole.unwrap();
        let mut state = FrontState::default();
        let (mut sittings, mut casts) = (0, 0);
        let found = loop {
            // Every sitting ends a little after it has finished its third part.
            let parts = std::cell::Cell::new(0);
            let mut kept = state.clone();
            let (mut patience, mut is_cast) = (3_u32, false);
            let mut observe = |event: &Event| {
                is_cast |= matches!(event, Event::Progress { work: Work::Equipment, .. });
                patience = patience.saturating_sub(u32::from(parts.get() >= 3));
                patience > 0
            };
            let mut keep = |new: &FrontState| {
                parts.set(parts.get() + 1);
                // The state of a checkpoint, read again.
                kept = serde_json::from_str(&serde_json::to_string(new).unwrap()).unwrap();
                assert_eq!(kept, *new);
            };
            let found = job.front_from(&objectives, &mut state, &mut keep, &mut observe).unwrap();
            (state, sittings, casts) = (kept, sittings + 1, casts + u32::from(is_cast));
            if found.stopped == FrontStopped::Complete {
                break found;
            }
            assert!(sittings < 200 && !found.points.is_empty());
        };
        assert!(
            casts > 2 && sittings > casts,
            "once all sensors are chosen no pose is cast: {sittings} {casts}"
        );
        assert_eq!((found, state), (whole, whole_state), "{require}");
    }
}

#[test]
fn the_program_writes_a_front_whose_placements_score_alike() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], car_ahead(0.95));
    let search =
        "optimize street.json --front price,near_gain --backend cpu --evaluations 10 --out";
    let text = stdout(&dir, &(search, "run"));
    for words in [
        "cheapest that meets all requirements",
        "best near_gain",
        "The cheapest found that meets all requirements costs 11",
    ] {
        text.says(words);
    }
    let read = |name: &str| fs::read_to_string(dir.path().join("run").join(name)).unwrap();
    let listed: Value = serde_json::from_str(&read("placements.json")).unwrap();
    let listed = listed["placements"].list();
    let prices: Vec<f64> = listed.iter().map(|one| one["price"].number()).collect();
    assert!(prices.len() > 2 && prices.is_sorted(), "{prices:?}");
    let result: Value = serde_json::from_str(&read("result.json")).unwrap();
    let points = result["front"].list();
    let scored = ok(&dir, "score street.json run/placements.json --backend cpu");
    let scored = scored["scores"].list();
    assert_eq!((points.len(), scored.len()), (prices.len(), prices.len()));
    for ((point, scores), price) in points.iter().zip(scored).zip(&prices) {
        let mut plain = scores.clone();
        assert_eq!(plain.as_object_mut().unwrap().remove("price"), Some(json!(price)));
        assert_eq!(point["scores"], plain);
        assert_eq!(point["objectives"]["near_gain"], scores["near_gain"]);
        assert_eq!(
            (&point["price"], &point["objectives"]["price"]),
            (&json!(price), &json!(price))
        );
        assert_eq!(point["requirements_met"], scores["requirements"][0]["met"]);
        let is_met = point["requirements_met"] == true;
        let held = if is_met { &scores["requirements"][0]["holds_in"] } else { &Value::Null };
        assert_eq!(point["copies_that_meet_all"], *held);
        let blind = blind_degrees(scores);
        assert!((point["car_blind_deg"].number() - blind).abs() < 1e-9, "{point}");
    }
    let met: Vec<&Value> =
        points.iter().filter(|point| point["requirements_met"] == true).collect();
    let of_cheapest = 100.0 * met[0]["copies_that_meet_all"].number();
    for words in [
        format!(", in {of_cheapest:.0} % of copies mounted within the tolerance"),
        "cheapest that meets all requirements".to_owned(),
        "searched with 10 evaluations each; `sightline optimize` with --budget PRICE".to_owned(),
    ] {
        assert!(text.contains(&words), "{words}: {text}");
    }
    let picks = result["picks"].list();
    // A decision begins with no point that misses a requirement where others meet all.
    let names: Vec<&Value> = met.iter().map(|point| &point["name"]).collect();
    assert!(picks.len() > 2, "{picks:?}");
    assert!(picks.iter().all(|pick| names.contains(&&pick["name"])), "{picks:?} {names:?}");
    assert!(
        read("front.svg").contains("misses a requirement")
            || points.iter().all(|p| p["requirements_met"] == true)
    );
    let page = read("report.html");
    page.says("<svg").says("The front").says("--front price,near_gain");
    // The command of the page gives the same points.
    printed(&dir, &(search, "again"));
    let other = read_text(&dir, "again/placements.json");
    assert_eq!(other, read("placements.json"));
    // One of the points is handed over, and which ones there are is said.
    let told = fails(&dir, "rig handover run --out rig");
    let first = met[0]["name"].text();
    for words in [
        format!("holds a front of {} placements", points.len()),
        format!("as run:{first} (it has front-1, "),
    ] {
        assert!(told.contains(&words), "{words}: {told}");
    }
    let made = ok(&dir, &format!("rig handover run:{first} --backend cpu --out rig"));
    assert_eq!((&made["placement"], &made["price"]), (&json!(first), &met[0]["price"]));
    let readme = read_text(&dir, "rig/README.txt");
    readme.says("Found with seed 1 in the run run");
    let words = format!("Result: {first}: meets its requirement (car");
    let copies = format!(", {of_cheapest:.0} % of copies mounted within the tolerance meet all");
    readme.says(&words).says(&copies);
    let kept = read("checkpoint.json");
    // Gone on with at its end, it says where it is; drawings of one placement are refused.
    fails(&dir, "optimize --resume run --gltf a.glb").says("run: holds a front, of which --gltf");
    stdout(&dir, "optimize --resume run --backend cpu")
        .says("run: the run is finished (stopped: complete");
    assert_eq!((read("placements.json"), read("checkpoint.json")), (other, kept));
    fs::remove_file(dir.path().join("run/checkpoint.json")).unwrap();
    fails(&dir, "optimize --resume run")
        .says("run: holds a front without a checkpoint, which does not go on");
    fails(&dir, &(search, "run")).says("--force");
}

#[test]
fn no_point_that_meets_all_is_exit_code_1_and_time_is_said() {
    let dir = TempDir::new().unwrap();
    let hopeless =
        json!([{ "target": "tyre", "from": 15, "within": 15, "beams": 100, "share": 1 }]);
    street(dir.path(), [30, 11], hopeless);
    let line =
        "optimize street.json --front sensors,requirements --backend cpu --evaluations 10 --out";
    let (code, result, _) = answer(&dir, &format!("{line} run"));
    assert_eq!(code, Some(1));
    assert_eq!(result["front"][0]["requirements_met"], false);
    let (_, result, told) = answer(&dir, &format!("{line} late --max-seconds 0.3"));
    assert!(result["stopped"].text().starts_with("time"), "{result}");
    told.says("; go on with --resume late");
    assert!(!result["front"].list().is_empty(), "{result}");
    let (code, [_, told]) = ran(&dir, "optimize --resume late --backend cpu");
    assert_eq!(code, Some(1), "{told}");
    assert_same(dir.path(), "run", "late");
}

#[test]
fn a_front_of_nothing_is_refused_in_a_sentence() {
    let dir = TempDir::new().unwrap();
    street(dir.path(), [0, 0], json!([]));
    let refused = |front: &str| {
        let told = fails(&dir, &("optimize street.json --out never --front", front));
        assert!(!dir.path().join("never").exists(), "{front} left a folder");
        told
    };
    for (front, words) in [
        ("price,near_gain", "no sensor of `cart` has a price; write `price` beside each"),
        ("sensors,targets", "`cart` requires nothing; write what it must see under `require`"),
        (
            "sensors,gain",
            "`gain` is no objective; there are price, sensors, requirements (or targets)",
        ),
        ("sensors", "has 1 objective; name two or three"),
        ("sensors,near_gain,sensors", "`sensors` is named twice"),
    ] {
        refused(front).says(words);
    }
    refused("sensors,near_gain --fewest");
    let scene = read_text(&dir, "street.json");
    let plain = scene.replace(r#""vehicle":"cart.json""#,
        r#""lidar":{"channels":4,"fov":[-20,4],"azimuth_steps":90,"range":20},"mount":{"min":[0,0,1],"max":[0,0,1],"lidars":1}"#);
    assert_ne!(plain, scene);
    fs::write(dir.path().join("street.json"), plain).unwrap();
    refused("sensors,near_gain")
        .says("are of one model, with nothing to choose from; give a vehicle with sensors and mounts with --vehicle");
    fails(&dir, "optimize street.json --evaluations 0").says("--evaluations");
}

#[cfg(unix)]
#[test]
fn ctrl_c_writes_the_points_found_so_far_and_exits_with_130() {
    use std::io::{BufRead, BufReader};

    let dir = TempDir::new().unwrap();
    street(dir.path(), [30, 11], json!([]));
    let line = "optimize street.json --front price,near_gain --backend cpu --evaluations 1000000 --out run";
    let mut child = crate::cli_interrupted::spawn(dir.path(), line);
    let mut told = BufReader::new(child.stderr.take().unwrap()).lines();
    // The engine is named when the sensors are chosen.
    assert!(told.by_ref().any(|line| line.unwrap().contains("computing on cpu")));
    std::thread::sleep(std::time::Duration::from_millis(500));
    let id = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    let told: Vec<String> = told.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{told:?}");
    assert!(
        told.iter().any(|line| line.contains("interrupted; go on with --resume run")),
        "{told:?}"
    );
    let read = |name: &str| fs::read_to_string(dir.path().join("run").join(name)).unwrap();
    let result: Value = serde_json::from_str(&read("result.json")).unwrap();
    assert_eq!(result["stopped"], "interrupted");
    assert!(!result["front"].list().is_empty());
    let listed: Value = serde_json::from_str(&read("placements.json")).unwrap();
    assert_eq!(listed["placements"].list().len(), result["front"].list().len());
}
