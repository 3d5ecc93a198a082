//! Scores under weather: the same bits from every engine, and less the worse the weather is.

use std::path::Path;

use lidar_cast::engine::ReferenceBackend;
#[cfg(feature = "gpu")]
use sightline::engine::gpu::GpuBackend;
use sightline::problem::Tally;
use sightline::psog::Psog;
use sightline::scan::conditions::Condition;
use sightline::scene::Scene;
use sightline::{Job, JobScene};

use crate::common::*;

/// A street with a house, a car and the own body, its sensor rated for `rated` metres.
fn scene(rated: f64) -> Scene {
    Scene::from_json(&scene_text(rated), Path::new(""), "street").unwrap()
}

fn scene_text(rated: f64) -> String {
    format!(
        r#"{{ "sightline": 1, "name": "street", "frames": 2, "coverage": "first-hit",
             "roi": {{ "min": [-20, -20, -0.5], "max": [20, 20, 3.5], "voxel": [0.5, 0.5, 0.5] }},
             "static": [{{ "class": "road", "plane": {{ "min": [-60, -60], "max": [60, 60], "z": 0 }} }},
                        {{ "class": "building", "box": {{ "min": [12, -10, 0], "max": [14, 10, 6] }} }}],
             "actors": [{{ "parts": [{{ "class": "vehicle", "box": {{ "foot": [0, 0, 0.2], "size": [4, 1.8, 1.4] }} }}],
                          "poses": [{{ "x": 6, "y": 4 }}, {{ "x": 6, "y": 3 }}] }}],
             "ego": {{ "body": [{{ "class": "vehicle", "box": {{ "foot": [0, 0, 0.3], "size": [4, 1.8, 1.3] }} }}] }},
             "vehicle": {{ "sensors": [{{ "name": "s", "phase": 0,
                               "lidar": {{ "channels": 16, "fov": [-25, 5], "azimuth_steps": 120, "range": 60 }},
                               "response": {{ "rated_range": {rated} }} }}],
                           "mounts": [{{ "name": "roof", "min": [-1, -1, 2], "max": [1, 1, 3], "count": 2 }}] }} }}"#
    )
}

fn psog(scene: &Scene) -> Psog {
    Psog::clone(&JobScene::from(scene.clone()).psog(|_| true).unwrap())
}

fn problem(scene: &Scene, psog: &Psog, conditions: &[&str]) -> Arc<Problem> {
    let conditions: Vec<Condition> = conditions.iter().map(|text| text.parse().unwrap()).collect();
    let job = Job::new(scene.clone()).psog(psog.clone());
    job.frames(Some(2)).conditions(&conditions).problem().unwrap()
}

fn placements() -> Vec<Placement> {
    let poses = [
        SensorPose::at(0.5, 0.4, 2.3),
        SensorPose { roll: 0.2, ..SensorPose::at(-0.5, -0.4, 2.4) },
    ];
    vec![
        Placement { name: "one".into(), lidars: poses[..1].to_vec() },
        Placement { name: "two".into(), lidars: poses.to_vec() },
    ]
}

fn tallies(problem: &Arc<Problem>) -> Vec<Tally> {
    CpuBackend::new(problem.task().clone(), 1 << 28).tally(&placements(), None).unwrap()
}

#[test]
fn every_engine_sees_the_same_through_weather() {
    let scene = scene(36.0);
    let psog = psog(&scene);
    for conditions in [
        &["fog:mor=40"][..],
        &["snow:rate=2.5", "wet:water=1.2", "rain:rate=50"],
        &["crosstalk:share=0.1", "echo"],
    ] {
        let problem = problem(&scene, &psog, conditions);
        let expected =
            ReferenceBackend::new(problem.task().clone()).tally(&placements(), None).unwrap();
        assert_eq!(tallies(&problem), expected, "{conditions:?}");
        let lidars = &placements()[1].lidars;
        let mut cpu = CpuBackend::new(problem.task().clone(), 1 << 28);
        let mut reference = ReferenceBackend::new(problem.task().clone());
        for frame in 0..2 {
            let [fast, plain] = [
                cpu.bitmaps(lidars, frame).unwrap().union(),
                reference.bitmaps(lidars, frame).unwrap().union(),
            ];
            assert_eq!(fast, plain, "{conditions:?}, frame {frame}");
        }
        #[cfg(feature = "gpu")]
        on_a_device(&problem, &expected);
    }
}

/// Chunks of all sensors, and of one, through weather; hits stay those of clear air.
#[cfg(feature = "gpu")]
fn on_a_device(problem: &Arc<Problem>, expected: &[Tally]) {
    for memory in [MEMORY, 1 << 16] {
        let mut gpu = GpuBackend::new(problem.task().clone(), None, memory).unwrap();
        let lidars = &placements()[1].lidars;
        for frame in 0..2 {
            let mut reference = ReferenceBackend::new(problem.task().clone());
            let ours = gpu.bitmaps(lidars, frame).unwrap().union();
            let plain = reference.bitmaps(lidars, frame).unwrap().union();
            assert_eq!(ours, plain, "frame {frame}");
            let hits = reference.hits(lidars, frame).unwrap();
            assert_eq!(gpu.hits(lidars, frame).unwrap(), hits, "frame {frame}");
        }
        assert_eq!(gpu.tally(&placements(), None).unwrap(), expected, "{memory} bytes");
    }
}

#[test]
fn the_denser_the_fog_the_less_is_covered_and_none_is_like_clear_air() {
    let scene = scene(36.0);
    let psog = psog(&scene);
    let covered = |conditions: &[&str]| tallies(&problem(&scene, &psog, conditions))[1].covered;
    let clear = covered(&["fog:mor=inf"]);
    let fogs = [300.0, 100.0, 40.0, 15.0].map(|mor| covered(&[&format!("fog:mor={mor}")]));
    assert!(fogs.windows(2).all(|pair| pair[1] <= pair[0]), "{clear} {fogs:?}");
    assert!(fogs[3] < clear * 9 / 10, "{clear} {fogs:?}");
    assert!(covered(&["wet:water=1.2"]) < clear);
    assert!(covered(&["rain:rate=100"]) < clear);
    assert!(covered(&["crosstalk:share=0.5"]) < clear);
    // A sensor that sees everything has the coverage of one without a response.
    let far = self::scene(10_000.0);
    let all = tallies(&problem(&far, &psog, &["fog:mor=inf"]));
    let plain = tallies(&problem(&far, &psog, &[]));
    for (all, plain) in all.iter().zip(&plain) {
        assert_eq!((all.covered, all.hits), (plain.covered, plain.hits));
    }
}

#[test]
fn which_vehicles_are_dark_is_another_in_every_draw() {
    // No other chance than that: an echo is seen or not by its power alone.
    let text = scene_text(14.0).replace("\"rated_range\"", "\"softness\": 0, \"rated_range\"");
    let scene = Scene::from_json(&text, Path::new(""), "street").unwrap();
    let problem = problem(&scene, &psog(&scene), &["echo:ratio=0.5"]);
    let covered = |seed: u64| {
        let sensors = problem.sensors().with_seed(seed);
        tallies(&Arc::new(Problem::clone(&problem).with_sensors(sensors)))[1].covered
    };
    let first = covered(0);
    assert_eq!(first, covered(0));
    assert!((1..8).any(|seed| covered(seed) != first), "one and the same in eight draws");
}

#[test]
fn weather_acts_on_beams_that_meet_nothing() {
    // Beams above the horizon; the street is there for the P-SOG alone.
    let text = scene_text(10.0).replace("\"fov\": [-25, 5]", "\"fov\": [1, 8]");
    let text = text.replace(
        "\"min\": [12, -10, 0], \"max\": [14, 10, 6]",
        "\"min\": [12, -10, 0], \"max\": [14, 10, 1]",
    );
    let scene = Scene::from_json(&text, Path::new(""), "street").unwrap();
    let psog = psog(&scene);
    let seen = |condition: &str| tallies(&problem(&scene, &psog, &[condition])).swap_remove(0);
    let clear = seen("fog:mor=inf");
    assert!(clear.hits == 0 && clear.covered > 500, "{clear:?}");
    // Voxels are left that the two LiDARs stand in, in two frames.
    assert!(seen("crosstalk:share=1").covered <= 4);
    let half = seen("crosstalk:share=0.5").covered;
    assert!(half > 0 && half < clear.covered, "{half}");
    assert!(seen("snow:rate=2.5,speed=1.6").covered < clear.covered);
}

#[test]
fn what_scores_have_no_answer_to_is_refused() {
    let scene = scene(36.0);
    let psog = psog(&scene);
    let refused = |scene: &Scene, condition: &str| {
        let job = Job::new(scene.clone()).psog(psog.clone()).frames(Some(1));
        job.conditions(&[condition.parse().unwrap()]).problem().unwrap_err().to_string()
    };
    let through = scene_text(36.0).replace("first-hit", "through");
    let through = Scene::from_json(&through, Path::new(""), "street").unwrap();
    let error = refused(&through, "rain");
    assert!(error.contains("conditions need `\"coverage\": \"first-hit\"`"), "{error}");
}
