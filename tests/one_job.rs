//! The program and the library pose one problem from the same files, to the last bit: scores and optimum.

use sightline::audit::TrialResult;
use sightline::chart::{ChartSettings, ChartState, SceneDetail, chart};
use sightline::internals::{Engine, Setting};
use sightline::score::Scores;
use sightline::search::{Event, Settings};
use sightline::vehicle::SensorPose;
use sightline::{EngineChoice, Job, JobFiles, Objective, Placement, Scene, read_placements};

use crate::cli::*;

/// Evaluations of the searches that are compared.
const EVALUATIONS: u64 = 12;

/// A cart with two models on three mounts: one turns freely, the others look ahead and back.
fn cart() -> Value {
    let turning = json!({ "channels": 6, "fov": [-40, 30], "azimuth_steps": 60, "range": 20 });
    let sector = json!({ "channels": 5, "fov": [-30, 30], "azimuth": [-50, 50], "azimuth_steps": 31, "range": 8 });
    let end = |name: &str, x: f64, yaw: [f64; 2]| {
        json!({ "name": name, "min": [x - 0.05, -0.3, 0.9], "max": [x + 0.05, 0.3, 1.2], "yaw": yaw,
                "sensors": ["sector"], "count": [0, 1] })
    };
    json!({
        "sightline": 1, "name": "cart",
        "sensors": [{ "name": "turning", "price": 10, "phase": "free", "lidar": turning },
                    { "name": "sector", "price": 3, "lidar": sector }],
        "mounts": [{ "name": "roof", "min": [-0.4, -0.4, 1.4], "max": [0.4, 0.4, 1.7], "roll": [-0.2, 0.2],
                     "sensors": ["turning"], "count": [1, 2] },
                   end("front", 0.5, [-0.3, 0.3]), end("rear", -0.5, [2.84, 3.44])],
        "min_distance": 0.2
    })
}

fn placement(name: &str, lidars: &[(&str, [f64; 6])]) -> Value {
    let lidar = |(sensor, [x, y, z, roll, pitch, yaw]): &(&str, [f64; 6])| {
        let mut lidar = json!({ "x": x, "y": y, "z": z, "roll": roll, "pitch": pitch, "yaw": yaw });
        if !sensor.is_empty() {
            lidar["sensor"] = json!(sensor);
        }
        lidar
    };
    json!({ "name": name, "lidars": lidars.iter().map(lidar).collect::<Vec<_>>() })
}

/// A room and a longer one, placements with and without models, the cart.
fn rooms() -> TempDir {
    let dir = TempDir::new().unwrap();
    let write = |name: &str, value: &Value| write(&dir, name, &value);
    let mut other = read_json(room(dir.path()));
    other["name"] = json!("other");
    other["static"][1]["box"]["center"][0] = json!(2.4);
    write("other.json", &other);
    write("cart.json", &cart());
    let plain = [
        placement(
            "apart",
            &[("", [0.4, 0.0, 1.7, 0.0, 0.0, 0.0]), ("", [-0.4, 0.1, 1.3, 0.1, 0.0, 0.3])],
        ),
        placement(
            "down",
            &[("", [0.0, 0.0, 1.3, 0.0, 0.6, 0.0]), ("", [0.3, 0.4, 1.7, -0.2, 0.0, 0.0])],
        ),
    ];
    write("plain.json", &json!({ "placements": plain }));
    let mixed = [
        placement(
            "roof",
            &[
                ("turning", [0.3, 0.0, 1.6, 0.1, 0.0, 0.0]),
                ("turning", [-0.3, 0.2, 1.5, 0.0, 0.0, 0.0]),
            ],
        ),
        placement(
            "both",
            &[
                ("turning", [0.0, 0.0, 1.5, 0.0, 0.0, 0.0]),
                ("sector", [0.5, 0.1, 1.0, 0.0, 0.0, 0.2]),
            ],
        ),
        placement(
            "three",
            &[
                ("turning", [0.1, 0.2, 1.7, 0.0, 0.0, 0.0]),
                ("sector", [0.5, 0.0, 1.0, 0.0, 0.0, 0.0]),
                ("sector", [-0.5, 0.0, 1.0, 0.0, 0.0, 3.1]),
            ],
        ),
    ];
    write("mixed.json", &json!({ "placements": mixed }));
    dir
}

fn files(dir: &Path, scenes: &[&str], vehicle: Option<&str>) -> JobFiles {
    let scenes: Vec<PathBuf> = scenes.iter().map(|scene| dir.join(scene)).collect();
    let vehicle = vehicle.map(|vehicle| dir.join(vehicle));
    JobFiles::new(&scenes, vehicle.as_deref())
}

/// Compares scores and optimum of the program with those of the library.
fn same(dir: &Path, files: &JobFiles, placements: &str) {
    let scenes: Vec<String> = files.scenes().map(|scene| scene.display().to_string()).collect();
    let mut options = vec!["--backend".to_owned(), "cpu".to_owned()];
    if let Some(vehicle) = &files.vehicle {
        options.extend(["--vehicle".to_owned(), vehicle.display().to_string()]);
    }
    for condition in &files.conditions {
        options.extend(["--condition".to_owned(), condition.clone()]);
    }
    let program = |command: &str, more: &[&str], options: &[String]| {
        let mut all: Vec<&str> = vec![command];
        all.extend(scenes.iter().map(String::as_str));
        all.extend(more);
        all.extend(options.iter().map(String::as_str));
        ok(dir, &all)
    };
    let job = files.read().unwrap();
    // `score` takes no mirror images.
    let judged = job.clone().mirrored(false).score(&read_placements(dir.join(placements)).unwrap());
    let scores: Vec<Value> = judged.unwrap().iter().map(|judged| json!(judged.scores)).collect();
    let told = program("score", &[placements], &options);
    let mut told = told[if scenes.len() > 1 { "mean" } else { "scores" }].clone();
    for one in told.as_array_mut().unwrap() {
        one.as_object_mut().unwrap().remove("price");
    }
    assert_eq!(told, json!(scores), "{scenes:?}");
    assert!(scores.iter().any(|score| score["covered"].number() > 0.0));

    if let Some(budget) = files.budget {
        options.extend(["--budget".to_owned(), budget.to_string()]);
    }
    if files.mirror {
        options.push("--mirror".to_owned());
    }
    let evaluations = EVALUATIONS.to_string();
    let told = program("optimize", &["--evaluations", &evaluations, "--seed", "3"], &options);
    let settings = Settings { evaluations: EVALUATIONS, seed: 3, ..Settings::default() };
    let found = job.clone().search(settings).optimize(&mut |_: &Event| true).unwrap().unwrap();
    let best = found.outcome.best.as_ref().unwrap();
    // The result is scored at the draw of scores: phases and weather have one value in both.
    let again = job.score(std::slice::from_ref(&best.placement)).unwrap().remove(0).scores;
    let sums = |scores: &Scores| (scores.segmentation, scores.near_gain, scores.covered);
    assert_eq!(sums(&again), sums(&best.scores), "{scenes:?}");
    assert_eq!(told["best"], json!(found.outcome.best), "{scenes:?}");
    assert_eq!(told["baselines"], json!(found.outcome.baselines), "{scenes:?}");
}

#[test]
fn program_and_library_pose_one_problem_in_a_plain_scene() {
    let dir = rooms();
    same(dir.path(), &files(dir.path(), &["room.json"], None), "plain.json");
}

#[test]
fn program_and_library_pose_one_problem_for_a_mixed_vehicle() {
    let dir = rooms();
    let files =
        JobFiles { budget: Some(16.0), ..files(dir.path(), &["room.json"], Some("cart.json")) };
    same(dir.path(), &files, "mixed.json");
}

#[test]
fn program_and_library_pose_one_problem_in_weather_and_in_mirrored_scenes() {
    let dir = rooms();
    let clear = files(dir.path(), &["room.json", "other.json"], None);
    let conditions = vec!["fog:mor=8".to_owned()];
    let files = JobFiles { conditions, mirror: true, ..clear.clone() };
    same(dir.path(), &files, "plain.json");
    let score = |files: &JobFiles| {
        let placements = read_placements(dir.path().join("plain.json")).unwrap();
        files.read().unwrap().score(&placements).unwrap()
    };
    assert_ne!(score(&files), score(&clear), "fog of 8 m hides walls");
    let members = |files: &JobFiles| {
        let evaluator = files.read().unwrap().evaluator(|_| {}).unwrap().0;
        evaluator.members().map(|(member, _)| member.is_mirrored()).collect::<Vec<bool>>()
    };
    let plain = JobFiles { mirror: false, ..files.clone() };
    assert_eq!((members(&files).len(), members(&plain)), (4, vec![false; 2]));
    assert_eq!(members(&files).iter().filter(|mirrored| **mirrored).count(), 2);
}

#[test]
fn program_and_library_pose_one_problem_on_a_psog_of_a_file() {
    let dir = corridor();
    same(dir.path(), &files(dir.path(), &["scene.json"], None), "placements.json");
}

#[test]
fn a_job_is_the_same_after_it_was_saved() {
    let dir = rooms();
    let whole = JobFiles {
        conditions: vec!["rain:rate=5".to_owned()],
        budget: Some(16.0),
        mirror: true,
        ..files(dir.path(), &["room.json", "other.json"], Some("cart.json"))
    };
    let saved: JobFiles = serde_json::from_str(&json!(whole).to_string()).unwrap();
    assert_eq!(saved, whole);
    let placements = read_placements(dir.path().join("mixed.json")).unwrap();
    let scores = |files: &JobFiles| files.read().unwrap().score(&placements).unwrap();
    assert_eq!(scores(&saved), scores(&whole));
}

/// Scores of placements of the cart in the room, by the default objective.
fn cart_scores(dir: &Path, placements: &[Placement]) -> Vec<f64> {
    let job = files(dir, &["room.json"], Some("cart.json")).read().unwrap();
    let value = |judged: &sightline::search::Judged| Objective::default().value(&judged.scores);
    job.score(placements).unwrap().iter().map(|judged| value(judged).unwrap()).collect()
}

#[test]
fn a_chart_of_a_mixed_vehicle_ranks_what_score_ranks() {
    let dir = rooms();
    let given = read_placements(dir.path().join("mixed.json")).unwrap();
    let scene = Scene::read_with(dir.path().join("room.json"), Some(&dir.path().join("cart.json")));
    let job = Job::new(scene.unwrap());
    let psog = job.scenes()[0].psog(|_| true).unwrap();
    let (finest, full) = (Some(0.5), true);
    let settings =
        ChartSettings { given: given.clone(), random: 4, finest, full, ..ChartSettings::default() };
    let mut state = ChartState::default();
    let found = chart(job.scene().clone(), psog, &settings, 0.01, &mut state, &()).unwrap();
    let of = |engine: Engine| {
        let setting = Setting { fidelity: SceneDetail::of_scene(job.scene()), engine };
        let rated = found.rated.iter().find(|rated| rated.measured.setting == setting);
        let scores =
            &rated.unwrap_or_else(|| panic!("{setting:?}: {:?}", found.left_out)).measured.scores;
        scores[..given.len()].iter().map(|score| score.unwrap()).collect::<Vec<f64>>()
    };
    let scores = cart_scores(dir.path(), &given);
    assert_eq!(of(Engine::Cpu), scores, "to the bit");
    for (exact, score) in of(Engine::F64).iter().zip(&scores) {
        assert!(
            (exact - score).abs() < 2e-3 * score,
            "the f64 scorer knows models and phases: {exact} {score}"
        );
    }
    // The atlas has poses of the roof and of both ends.
    assert!(
        of(Engine::Atlas)
            .iter()
            .zip(&scores)
            .all(|(atlas, score)| (atlas - score).abs() < 0.2 * score)
    );
    // A placement that loses its sectors, as in a vehicle of the first model alone, scores less.
    let mut roof = given[2].clone();
    roof.lidars.truncate(1);
    assert!(cart_scores(dir.path(), &[roof])[0] < 0.95 * scores[2]);
}

#[test]
fn an_atlas_that_lacks_a_model_is_left_out_with_a_sentence() {
    let dir = rooms();
    let mut vehicle = cart();
    for mount in [1, 2] {
        vehicle["mounts"][mount]["count"] = json!([0, 0]);
    }
    write(&dir, "bare.json", &vehicle);
    let scene = Scene::read_with(dir.path().join("room.json"), Some(&dir.path().join("bare.json")));
    let job = Job::new(scene.unwrap());
    let psog = job.scenes()[0].psog(|_| true).unwrap();
    let given = read_placements(dir.path().join("mixed.json")).unwrap();
    let (finest, full) = (Some(0.5), true);
    let settings = ChartSettings { given, random: 0, finest, full, ..ChartSettings::default() };
    let mut state = ChartState::default();
    let found = chart(job.scene().clone(), psog, &settings, 0.01, &mut state, &()).unwrap();
    assert!(found.rated.iter().all(|rated| rated.measured.setting.engine != Engine::Atlas));
    let told = found.left_out.join("\n");
    told.says("placement `both` has a `sector`, which no mount");
}

#[test]
fn an_audit_of_a_mixed_vehicle_ranks_what_score_ranks() {
    let dir = rooms();
    let honest = read_placements(dir.path().join("mixed.json")).unwrap();
    let job = files(dir.path(), &["room.json"], Some("cart.json")).read().unwrap();
    let job = job.engine(EngineChoice::cpu());
    let found = sightline::audit::audit(&job, &honest, &|_| {}).unwrap();
    let scores = job.evaluator(|_| {}).unwrap().0.scores(&honest).unwrap();
    let value = |scores: &sightline::Scores| Objective::default().value(scores).unwrap();
    let unguarded = scores.iter().filter(|scores| scores.guards.is_empty());
    let best = unguarded.max_by(|a, b| value(a).total_cmp(&value(b))).unwrap();
    // The base has a range card beside its scores.
    let base = sightline::Scores { range_card: None, guards: Vec::new(), ..found.base.clone() };
    assert!(found.base.range_card.is_some());
    assert_eq!(&base, best, "to the bit");
    for turn in ["to the sky", "45° up", "45° down", "lean to the left", "look to the left"] {
        let name = format!("all sensors {turn}");
        let trial = found.trials.iter().find(|trial| trial.name == name);
        let trial = trial.unwrap_or_else(|| panic!("{name} is not tried"));
        assert_ne!(trial.verdict, TrialResult::Fooled, "{name}: {:?}", trial.fooled);
        assert_eq!(trial.scores.beams, found.base.beams, "{name}: the models of the base");
    }
    let by_value = cart_scores(dir.path(), &honest);
    assert_eq!(scores.iter().map(value).collect::<Vec<_>>(), by_value);
    let several = Job::join([job.clone(), job]).unwrap();
    let error = sightline::audit::audit(&several, &honest, &|_| {}).unwrap_err().to_string();
    assert_eq!(error, "an audit is of one scene, not of 2; audit them one by one");
}

#[test]
fn a_vehicle_without_prices_takes_no_budget() {
    let dir = rooms();
    let job = files(dir.path(), &["room.json"], None).read().unwrap().budget(Some(5.0));
    let error = job.optimize(&mut |_: &Event| true).unwrap_err().to_string();
    error.says("budget: the LiDARs of the scene have no prices");
    let unknown = Placement { name: "p".into(), lidars: vec![SensorPose::at(0.0, 0.0, 1.5)] };
    let job = files(dir.path(), &["room.json", "other.json"], None).read().unwrap();
    assert_eq!(job.score(&[unknown]).unwrap()[0].by_scene.len(), 2);
}
