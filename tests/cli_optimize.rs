//! Runs of the search: their folder, their repeatability, Ctrl-C and resume.

use crate::cli::*;

fn optimize_args(out: &str, evaluations: u64) -> String {
    format!(
        "optimize room.json --backend cpu --seed 5 --frames 2 --out {out} --evaluations {evaluations}"
    )
}

#[test]
fn optimize_writes_its_folder_and_repeats_itself() {
    let dir = in_room();
    let first = ok(&dir, &optimize_args("first", 90));
    let second = ok(&dir, &(optimize_args("second", 90), "--threads 1"));
    let third = ok(&dir, &optimize_args("third", 90).replace("cpu", "gpu"));
    for file in [
        "result.json", "history.jsonl", "checkpoint.json", "report.html", "convergence.svg",
        "placement.svg", "map.svg",
    ] {
        assert!(dir.path().join("first").join(file).exists(), "{file} is missing");
    }
    // Other commands take the placement found.
    let found = ok(&dir, "score room.json first/placements.json --backend cpu");
    assert_eq!(found["scores"][0]["name"], "optimized");
    assert_eq!(found["scores"][0]["information_gain"], first["best"]["scores"]["information_gain"]);
    let history =
        |run: &str| fs::read_to_string(dir.path().join(run).join("history.jsonl")).unwrap();
    assert_eq!(history("first"), history("second"), "another number of threads");
    assert_eq!(history("first"), history("third"), "another backend");
    assert_eq!(first["best"], second["best"]);
    assert_eq!(first["best"], third["best"]);
    for part in ["methods", "certificate"] {
        assert_eq!(first[part], second[part]);
        assert_eq!(first[part], third[part]);
    }
    // The best so far never falls, and is the best of all generations.
    let records: Vec<Value> =
        history("first").lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let numbers = |key: &str| records.iter().map(|r| r[key].number()).collect::<Vec<_>>();
    let (best, so_far) = (numbers("best"), numbers("best_so_far"));
    for k in 0..best.len() {
        let highest = best[..=k].iter().fold(f64::NEG_INFINITY, |m, b| m.max(*b));
        assert_eq!(so_far[k], highest, "generation {k}");
    }
    // The result keeps the rules and is at least as good as what it started from.
    assert_eq!(first["best"]["violations"], json!([]));
    let report = read_text(&dir, "first/report.html");
    report.says("<svg").says("optimized").lacks("src=").lacks("<link");
    let swaps = first["methods"].list().iter().find(|of| of["method"] == "swaps");
    let words = format!(
        "{} evaluations and {} of swaps; {} generations, ",
        first["evaluations"],
        swaps.unwrap()["evaluations"],
        first["generations"]
    );
    assert!(report.contains(&words), "{words}");
    assert_eq!(first["baselines"].list().len(), 11);
    // A finished run is not made again: its result stays as it is, to the times in it.
    let before = fs::read(dir.path().join("first/result.json")).unwrap();
    let text = stdout(&dir, "optimize --resume first");
    assert!(text.starts_with("first: the run is finished (stopped: "), "{text}");
    text.says("Result: first/result.json").lacks("optimized placement");
    assert_eq!(fs::read(dir.path().join("first/result.json")).unwrap(), before);
    fails(&dir, &optimize_args("first", 90)).says("--resume");
}

#[test]
fn what_two_lidars_see_is_searched_scored_and_bounded() {
    let dir = in_room();
    let run = |objective: &str, out: &str| {
        ok(&dir, &(optimize_args(out, 60), ["--objective", objective]))
    };
    let (plain, twice) = (run("near_gain", "plain"), run("near_gain_2", "twice"));
    let score = |run: &Value, name: &str| run["best"]["scores"][name].number();
    assert_eq!(twice["best"]["objective"].as_f64(), Some(score(&twice, "near_gain_2")));
    assert!(score(&twice, "near_gain_2") > score(&plain, "near_gain_2"), "no redundancy is found");
    let gain = &twice["certificate"]["gain"];
    assert!(gain["upper"].as_f64() >= gain["best"]["value"].as_f64(), "{gain}");
    let page = read_text(&dir, "twice/report.html");
    page.says("near gain ×2 %").says("every LiDAR that covers it, up to two");
    let page = read_text(&dir, "plain/report.html");
    assert!(!page.contains("near gain ×2 %"));
}

/// Exit code of a run into `broken` that is interrupted after its first checkpoint.
#[cfg(unix)]
fn interrupted(dir: &Path, args: &str) -> Option<i32> {
    let mut child = begun(dir, args);
    wait_for(|| dir.join("broken/checkpoint.json").exists());
    interrupt(&child, "-INT");
    child.wait().unwrap().code()
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_goes_on_to_the_same_bytes() {
    let dir = in_room();
    ok(&dir, &optimize_args("whole", 400));
    let code = interrupted(dir.path(), &optimize_args("broken", 400));
    // Too late an interrupt would prove nothing; 400 evaluations leave room for it.
    assert_eq!(code, Some(130));
    let state = read_json(dir.path().join("broken/result.json"));
    assert_eq!(state["stopped"], "interrupted");
    assert!(state["evaluations"].as_u64().unwrap() < 400);
    let resumed = ok(&dir, "optimize --resume broken --backend cpu");
    let read = |run: &str, file: &str| fs::read(dir.path().join(run).join(file)).unwrap();
    for file in ["history.jsonl", "checkpoint.json", "convergence.svg", "placement.svg", "map.svg"]
    {
        assert_eq!(read("whole", file), read("broken", file), "{file}");
    }
    let whole: Value = serde_json::from_slice(&read("whole", "result.json")).unwrap();
    assert_eq!(whole["best"], resumed["best"]);
}

#[test]
fn a_bound_asked_for_is_closer_and_changes_nothing_else() {
    let dir = TempDir::new().unwrap();
    let path = room(dir.path());
    // Three LiDARs of few beams do not see all.
    let mut scene = read_json(&path);
    (scene["lidar"]["channels"], scene["lidar"]["azimuth_steps"]) = (json!(4), json!(24));
    scene["mount"]["lidars"] = json!(3);
    fs::write(&path, scene.to_string()).unwrap();
    let with = |out: &str, more: &str| ok(&dir, &(optimize_args(out, 12), "--delta 0.3,0.3", more));
    let (plain, close) = (with("plain", ""), with("close", "--bound 0.7"));
    let repeats = |run: &Value| run["command"].text().contains(" --bound 0.7 ");
    assert!(repeats(&close) && !repeats(&plain), "{} {}", close["command"], plain["command"]);
    assert_eq!(close["settings"]["search"]["gap"], json!(0.7 / 100.0));
    assert_eq!(plain["best"]["placement"], close["best"]["placement"]);
    let of = |run: &Value, key: &str| run["certificate"]["gain"][key].clone();
    let upper = |run: &Value| of(run, "upper").number();
    assert!(upper(&close) < upper(&plain), "{} {}", upper(&close), upper(&plain));
    let best = of(&close, "best")["value"].number();
    assert!(upper(&close) <= 1.007 * best * (1.0 + 1e-9), "{} {best}", upper(&close));
    assert_eq!(of(&close, "upper_at_root"), of(&plain, "upper_at_root"));
}

/// Coordinates and rolls of all LiDARs of the result.
fn numbers_of(run: &Value) -> Vec<[f64; 4]> {
    let lidars = run["best"]["placement"]["lidars"].list();
    let number = |lidar: &Value, key: &str| lidar[key].number();
    lidars.iter().map(|l| ["x", "y", "z", "roll"].map(|key| number(l, key))).collect()
}

#[test]
fn every_method_says_what_it_found_and_the_better_one_wins() {
    let dir = in_room();
    let with = |out: &str, more: &str| ok(&dir, &(optimize_args(out, 60), more));
    let both = with("both", "--objective m_sog_scaled");
    let methods = both["methods"].list();
    assert_eq!(methods.len(), 2);
    let best = methods.iter().map(|m| m["objective"].number()).fold(f64::MIN, f64::max);
    assert_eq!(both["best"]["objective"].number(), best);
    let cma = with("cma", "--method cma --objective m_sog_scaled");
    assert_eq!(cma["methods"].list().len(), 1);
    assert!(cma["best"]["objective"].as_f64().is_some_and(|found| found <= best), "{best}");
    assert!(cma["certificate"]["gain"].is_null(), "m_sog_scaled has no such bound");
    let says = cma["certificate"]["gain_says"].text();
    says.says("no bound is known");

    let swaps = with("swaps", "--method swaps --delta 0.5,0.3 --objective information_gain");
    let found = swaps["best"]["objective"].number();
    let upper = swaps["certificate"]["gain"]["upper"].number();
    let best_on_grid = swaps["certificate"]["gain"]["best"]["value"].number();
    assert!(upper >= best_on_grid, "{upper} bounds {best_on_grid} from above");
    assert!(found > 0.0 && swaps["generations"] == 0);

    let snapped = with("snapped", "--method cma --delta 0.25,0.1");
    let scene = read_json(dir.path().join("room.json"));
    for numbers in numbers_of(&snapped) {
        for (k, value) in numbers.into_iter().enumerate() {
            let (low, step) = match k {
                3 => (scene["mount"]["roll"][0].as_f64().unwrap_or(0.0), 0.1),
                k => (scene["mount"]["min"][k].number(), 0.25),
            };
            let steps = (value - low) / step;
            assert!((steps - steps.round()).abs() < 1e-9, "{value} is not on the grid");
        }
    }
}

/// A room of eight frames, in which a few are enough to begin with.
fn long_room(dir: &Path) {
    room(dir);
    change(dir, "room.json", |scene| {
        scene["frames"] = json!(8);
        scene["actors"][0]["poses"] = (0..8)
            .map(|t| json!({ "x": 2.0 - 0.5 * f64::from(t), "y": 0.2 * f64::from(t) }))
            .collect();
    });
}

/// Share of the objective that a search over frames on demand may end below one over all frames.
const LOST: f64 = 0.01;

#[test]
fn auto_searches_fewer_frames_and_ends_as_well() {
    let dir = TempDir::new().unwrap();
    long_room(dir.path());
    let run = |fidelity: &str, seed: &str| {
        let out = format!("{fidelity}-{seed}");
        let _ = fs::remove_dir_all(dir.path().join(&out));
        let own = format!("--out {out} --fidelity {fidelity} --seed {seed}");
        ok(&dir, &("optimize room.json --backend cpu --evaluations 120", own))
    };
    let value = |run: &Value| run["best"]["objective"].number();
    // One seed more or less lucky says nothing.
    let median = |fidelity: &str| {
        let mut values = ["1", "2", "3"].map(|seed| value(&run(fidelity, seed)));
        values.sort_by(f64::total_cmp);
        values[1]
    };
    let (auto, full) = (run("auto", "1"), run("full", "1"));
    assert!(full["fidelity"].is_null());
    assert_eq!(full["search_frames"], 8);
    // The walker is elsewhere in each frame; of 16 × 12 × 6 voxels few are ever occupied.
    let modelled = &full["modelled"];
    assert_eq!((&modelled["voxels"], &modelled["distinct_frames"]), (&json!(1152), &json!(8)));
    let count = |key: &str| modelled[key].as_u64().unwrap();
    assert!(count("informative_voxels") < count("occupied_voxels"), "{modelled}");
    for key in modelled.as_object().unwrap().keys() {
        assert_eq!(modelled[key], auto["modelled"][key], "{key}");
    }
    let report = &auto["fidelity"];
    let levels: Vec<u64> = serde_json::from_value(report["levels"].clone()).unwrap();
    assert!(levels.len() > 1 && levels.last() == Some(&8), "{report}");
    assert!(report["share_of_full"].number() < 0.9, "{report}");
    assert!(report["words"].text().contains("finalists"));
    // A run that ends before the first check: its finalists at the end tell the loss.
    let short = "optimize room.json --backend cpu --evaluations 1 --out short";
    let short = ok(&dir, &short);
    assert!(short["fidelity"]["worst_loss_seen"].is_number(), "{}", short["fidelity"]);
    // The bound holds over the frames that the search began with, and says so.
    let says = |run: &Value| run["certificate"]["gain_says"].text().to_owned();
    let first = levels[0];
    says(&auto).says(&format!("(over {first} of 8 frames, in which the result has "));
    assert!(!says(&full).contains("frames)"), "{}", says(&full));
    // Both are reported over all frames.
    assert_eq!((&auto["frames"], &full["frames"]), (&json!(8), &json!(8)));
    let (auto, full) = (median("auto"), median("full"));
    let lost = (full - auto) / full.abs();
    assert!(lost <= LOST, "{auto} is {lost} worse than {full}");
}

#[test]
fn a_run_from_another_folder_writes_the_same_record() {
    let dir = in_room();
    let below = dir.path().join("below");
    fs::create_dir(&below).unwrap();
    let lidars = json!([{ "x": 0.3, "y": 0.3, "z": 1.5 }, { "x": -0.3, "y": -0.3, "z": 1.5 }]);
    write_rig(&dir, "mine.json", "mine", lidars);
    let run = |from: &Path, to_room: &str| {
        let [scene, rigs, out] = ["room.json", "mine.json", "run"].map(|f| format!("{to_room}{f}"));
        let out = format!("{out}-{}", to_room.len());
        let args = format!("optimize {scene} --backend cpu --evaluations 12 --frames 1");
        let printed = ok(from, &(args, format!("--inject {rigs} --out {out}")));
        let read = |file: &str| fs::read_to_string(from.join(&out).join(file)).unwrap();
        let mut record: Value = serde_json::from_str(&read("result.json")).unwrap();
        assert_eq!(record["command"], printed["command"]);
        let is_time = |key: &str| {
            ["second", "memory", "time", "timings", "rate"].iter().any(|part| key.contains(part))
        };
        record.as_object_mut().unwrap().retain(|key, _| !is_time(key));
        (record, read("report.html"))
    };
    let ((here, page), (there, _)) = (run(dir.path(), ""), run(&below, "../"));
    assert_eq!(here, there);
    let whole = dir.path().canonicalize().unwrap().join("room.json");
    let words = format!("sightline optimize {} ", whole.display());
    assert!(here["command"].text().starts_with(&words), "{}", here["command"]);
    page.says("<code>sightline optimize room.json ");
}

#[cfg(unix)]
#[test]
fn an_interrupted_auto_run_goes_on_to_the_same_bytes() {
    let dir = TempDir::new().unwrap();
    long_room(dir.path());
    let args = |out| format!("optimize room.json --backend cpu --evaluations 300 --out {out}");
    ok(&dir, &args("whole"));
    let code = interrupted(dir.path(), &args("broken"));
    assert_eq!(code, Some(130));
    let resumed = ok(&dir, "optimize --resume broken --backend cpu");
    let read = |run: &str, file: &str| fs::read(dir.path().join(run).join(file)).unwrap();
    for file in ["history.jsonl", "checkpoint.json", "placement.svg"] {
        assert_eq!(read("whole", file), read("broken", file), "{file}");
    }
    let whole: Value = serde_json::from_slice(&read("whole", "result.json")).unwrap();
    assert_eq!(whole["best"], resumed["best"]);
    assert_eq!(whole["fidelity"], resumed["fidelity"]);
}

/// Swaps alone end at rigs that lose a car behind or ahead on the right.
#[test]
fn a_search_closes_the_blind_sectors_that_it_ends_with() {
    let dir = TempDir::new().unwrap();
    let highway = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/highway.json");
    let found = ok(
        &dir,
        &format!("optimize {highway} --evaluations 24 --frames 2 --seed 2 --backend cpu --out run"),
    );
    let scores = &found["best"]["scores"];
    assert_eq!(scores["range_card"]["blind"], json!([]));
    // It costs at most 1 % of 32.11 %.
    assert!(scores["near_gain"].as_f64().unwrap() > 0.317, "{}", scores["near_gain"]);
    let swaps = &found["methods"][1];
    assert_eq!((&swaps["method"], &swaps["won"]), (&json!("swaps"), &json!(true)));
}

#[test]
fn a_damaged_checkpoint_is_refused() {
    let dir = in_room();
    ok(&dir, &optimize_args("run", 30));
    let path = dir.path().join("run/checkpoint.json");
    let whole = fs::read_to_string(&path).unwrap();
    for (from, to) in [("\"n\":", "\"n\":9"), ("\"population\":", "\"population\":7"), ("0.", "1.")]
    {
        let damaged = whole.replacen(from, to, 1);
        assert_ne!(damaged, whole, "{from}");
        fs::write(&path, damaged).unwrap();
        let refused = sightline(&dir, "optimize --resume run --backend cpu");
        assert_eq!(refused.status.code(), Some(2), "{from}");
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        message.says("checkpoint.json");
    }
}
