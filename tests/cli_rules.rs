//! Rules of a run and what ends it: kept by every candidate, named in the result, the same on resume.

use sightline::internals::{Generations, Ties};
use sightline::search::{Evaluator, Settings};

use crate::cli::*;
use crate::common::*;

/// A room whose mount has other keys, too.
fn room_with(dir: &Path, mount: &[(&str, Value)]) {
    let mut scene = read_json(room(dir));
    for (key, value) in mount {
        scene["mount"][*key] = value.clone();
    }
    write(dir, "room.json", &scene);
}

fn args(out: &str, more: &str) -> String {
    format!("optimize room.json --backend cpu --evaluations 48 --out {out} {more}")
}

fn read(dir: &Path, run: &str, file: &str) -> String {
    fs::read_to_string(dir.join(run).join(file)).unwrap()
}

fn keep_out() -> (&'static str, Value) {
    ("keep_out", json!([{ "min": [-0.3, -0.3, 1.0], "max": [0.3, 0.3, 2.0] }]))
}

#[test]
fn no_candidate_that_is_evaluated_breaks_a_rule() {
    let ties = |equal_height, symmetric| Ties { equal_height, symmetric };
    for (lidars, ties) in [
        (3, ties(false, false)),
        (3, ties(true, false)),
        (4, ties(false, true)),
        (3, ties(true, true)),
    ] {
        let rules = Constraints {
            min_distance: 0.8,
            keep_out: vec![[[-1.0, -1.5, -1.5], [1.0, 1.5, 0.5]]],
            ties,
            ..Constraints::in_box(
                [-2.0, -2.0, -1.0, -0.3, 0.0, -1.0],
                [2.0, 2.0, 1.0, 0.3, 0.0, 1.0],
                lidars,
            )
        };
        let problem = random_problem(3, true);
        let backend = Box::new(CpuBackend::new(problem.task().clone(), MEMORY));
        let mut evaluator = Evaluator::new(mounted(&problem, &rules), backend);
        let settings = Settings {
            evaluations: 400,
            population: Some(30),
            seed: 4,
            baselines: Vec::new(),
            ..Settings::default()
        };
        let mut search = Generations::new(&settings, &rules, [].iter()).unwrap();
        let (mut evaluated, mut infeasible) = (0, 0);
        while search.stopped().is_none() {
            let generation = search.step(&mut evaluator, &settings, &mut || true).unwrap().unwrap();
            infeasible += generation.record.infeasible;
            for (placement, _) in generation.scored {
                assert_eq!(rules.violations(&placement), [], "{placement:?}");
                evaluated += 1;
            }
        }
        assert!(evaluated > 100 && infeasible > 10, "{evaluated} and {infeasible}");
        let best = search.best().unwrap();
        assert_eq!(rules.violations(&best.placement), []);
    }
}

#[test]
fn rules_of_scene_and_options_are_kept_on_every_backend_and_named() {
    let dir = TempDir::new().unwrap();
    room_with(dir.path(), &[("lidars", json!(3)), keep_out(), ("symmetric", json!(true))]);
    let more = "--equal-height --fix roll=0.0";
    let first = ok(&dir, &args("first", more));
    let one = ok(&dir, &(args("one", more), "--threads 1"));
    let gpu = ok(&dir, &args("gpu", more).replace("cpu", "gpu"));
    for (run, other) in [("one", &one), ("gpu", &gpu)] {
        assert_eq!(
            read(dir.path(), "first", "history.jsonl"),
            read(dir.path(), run, "history.jsonl")
        );
        assert_eq!(first["best"], other["best"]);
    }
    assert_eq!(first["best"]["violations"], json!([]));
    let lidars = first["best"]["placement"]["lidars"].list();
    let number = |lidar: &Value, key: &str| lidar[key].number();
    let mut ys: Vec<f64> = lidars.iter().map(|lidar| number(lidar, "y")).collect();
    ys.sort_by(f64::total_cmp);
    assert_eq!((ys[0], ys[1]), (-ys[2], 0.0));
    for lidar in lidars {
        assert_eq!((number(lidar, "roll"), number(lidar, "z")), (0.0, number(&lidars[0], "z")));
        let inside = |key: &str| number(lidar, key).abs() < 0.3;
        assert!(!(inside("x") && inside("y")), "{lidar}");
    }
    let words = first["constraints"].to_string();
    for word in ["keep_out[0]", "one height", "mirrored", "roll = 0", "0.2 m apart"] {
        assert!(words.contains(word), "{word}: {words}");
    }
    assert!(read(dir.path(), "first", "report.html").contains("all LiDARs at one height"));
    // Both ways of searching took part.
    let methods = first["methods"].list();
    assert!(methods.iter().any(|m| m["method"] == "swaps" && m["poses_cast"].as_u64() > Some(10)));
    let swaps = ok(&dir, &args("swaps", "--method swaps --equal-height"));
    assert_eq!(swaps["best"]["violations"], json!([]));
    let grid = ok(&dir, &args("grid", "--delta 0.25,0.2 --equal-height"));
    assert_eq!(grid["best"]["violations"], json!([]));
}

#[test]
fn a_run_out_of_time_says_so_and_goes_on_to_the_same_bytes() {
    let dir = TempDir::new().unwrap();
    room_with(dir.path(), &[("lidars", json!(4)), keep_out(), ("symmetric", json!(true))]);
    ok(&dir, &args("whole", ""));
    let stopped = |args: &str| {
        let (code, run, stderr) = answer(&dir, args);
        assert_eq!(code, Some(0), "{stderr}");
        stderr.says("time: ").says("--resume broken");
        assert!(run["stopped"].text().starts_with("time: "), "{}", run["stopped"]);
        assert!(run["evaluations"].as_u64().unwrap() < 120);
        assert_eq!(run["best"]["violations"], json!([]));
        run["generations"].as_u64().unwrap()
    };
    assert_eq!(stopped(&args("broken", "--max-seconds 0")), 1);
    let resume = "optimize --resume broken --backend cpu";
    assert_eq!(stopped(&format!("{resume} --time 0")), 2, "a generation a sitting");
    // A better rig of an earlier sitting is the result of one without time.
    let of = |file: &str| read_json(dir.path().join(file));
    let best = of("whole/result.json")["best"]["placement"].clone();
    change(&dir, "broken/times.json", |spent| spent["kept"] = best.clone());
    assert_eq!(stopped(&format!("{resume} --max-seconds 0")), 3);
    assert_eq!(of("broken/result.json")["best"]["placement"], best);
    assert_eq!(of("broken/times.json")["kept"], best);
    let resumed = ok(&dir, resume);
    for file in ["history.jsonl", "checkpoint.json", "convergence.svg", "placement.svg", "map.svg"]
    {
        assert_eq!(read(dir.path(), "whole", file), read(dir.path(), "broken", file), "{file}");
    }
    let whole = of("whole/result.json");
    for key in ["best", "stopped", "constraints", "active_bounds", "ended"] {
        assert_eq!(whole[key], resumed[key], "{key}");
    }
    assert_eq!(resumed["stopped"], "evaluations: the limit is reached");
}

#[test]
fn a_target_ends_the_search_once_it_holds_over_all_frames() {
    let dir = in_room();
    let whole = ok(&dir, &args("whole", "--method cma"));
    let best = whole["best"]["objective"].number();
    let missed = ok(&dir, &args("missed", &format!("--target {}", 1.5 * best)));
    assert_eq!(missed["stopped"], "evaluations: the limit is reached");
    for (out, more) in [("auto", ""), ("one", "--frames 1")] {
        let run = ok(&dir, &args(out, &format!("{more} --target {}", 0.9 * best)));
        assert_eq!(run["stopped"], "target: a placement reached the score that was wanted");
        assert!(run["evaluations"].as_u64().unwrap() < 120);
        assert!(run["best"]["objective"].number() >= 0.9 * best);
        // Two LiDARs of a few beams lose a car far away, which speaks against no score.
        let guards = run["best"]["scores"]["guards"].list();
        assert!(guards.iter().all(|guard| guard.text().starts_with("blind_sector")));
        let again = ok(&dir, &format!("optimize --resume {out} --backend cpu"));
        assert_eq!((&again["best"], &again["stopped"]), (&run["best"], &run["stopped"]));
    }
}

#[test]
fn injected_layouts_that_are_not_used_are_named_with_the_reason() {
    let dir = TempDir::new().unwrap();
    room_with(dir.path(), &[("symmetric", json!(true))]);
    let lidar = |x: f64, y: f64| json!({ "x": x, "y": y, "z": 1.5 });
    let file = json!({ "placements": [
        { "name": "fine", "lidars": [lidar(0.1, 0.4), lidar(0.1, -0.4)] },
        { "name": "far", "lidars": [lidar(0.9, 0.4), lidar(0.9, -0.4)] },
        { "name": "single", "lidars": [lidar(0.0, 0.0)] },
        { "name": "row", "lidars": [lidar(0.5, 0.0), lidar(-0.5, 0.0)] },
        { "name": "askew", "lidars": [lidar(0.5, 0.3), lidar(-0.5, -0.3)] } ] });
    write(&dir, "mine.json", &file);
    let (code, run, stderr) = answer(&dir, &args("run", "--inject mine.json"));
    assert_eq!(code, Some(0), "{stderr}");
    let left_out = run["left_out"].list();
    assert_eq!(left_out.len(), 4, "{left_out:?}");
    for (name, why) in [
        ("far", "x is 0.300 m outside the mount"),
        ("single", "it has 1 LiDAR, the mount 2"),
        ("row", "plane of symmetry"),
        ("askew", "from a mirror image at the plane y = 0"),
    ] {
        let found = left_out.iter().find(|l| l["name"] == name).expect(name);
        assert!(found["why"].to_string().contains(why), "{found}");
        stderr.says(&format!("not starting from {name}: "));
    }
    let report = read(dir.path(), "run", "report.html");
    assert!(report.contains("Not started from single"), "the report says it, too");
    assert_eq!(run["settings"]["starts"].as_array().map(Vec::len), Some(5));
    assert!(report.contains("--inject "), "the command has them, too");
}

#[test]
fn rules_that_contradict_each_other_are_answered_with_key_and_mend() {
    /// Keys of the mount, options, and what the answer holds.
    type Case<'a> = (&'a [(&'a str, Value)], &'a str, &'a str);
    let dir = TempDir::new().unwrap();
    let wide = json!([{ "min": [-9, -9, 0], "max": [9, 9, 9] }]);
    let cases: &[Case] = &[
        (&[("keep_out", wide)], "", "room.json: mount.keep_out: "),
        (&[("min", json!([-0.6, -0.5, 1.2]))], "--symmetric", "room.json: mount.symmetric: "),
        (&[("min_distance", json!(1.3))], "--symmetric", "min_distance, 1.3 m"),
        (&[], "--fix z=9", "room.json: mount.z: 9 is not within the mount"),
        (&[], "--symmetric --fix roll=0.1", "room.json: mount.symmetric: "),
        (&[], "--fix tilt=1", "as z=2.5"),
        (&[], "--max-seconds soon", "give 0 to 1000000000 seconds, as 30"),
    ];
    for (mount, options, wanted) in cases {
        room_with(dir.path(), mount);
        fails(&dir, &args("run", options)).says(wanted);
        assert!(!dir.path().join("run").exists(), "{options} left a folder");
    }
}
