//! Several scenes in one run: mirror images, means over scenes, bounds over them, runs that go on.

use sightline::internals::{
    Atlases, Effort, GridPlacement, GridSearch, PoseGrid, Spacing, bound_gain,
};
use sightline::problem::Tally;
use sightline::score::{Objective, Scores};
use sightline::search::{Evaluator, Gain, Run, Settings, State, Suite};
use sightline::vehicle::random_placements;
use sightline::{EngineChoice, SensorPose};

use crate::common::*;
use crate::own_scenes::{FRAMES, Own, description, mirrored};

/// A sensor that looks ahead and to its left, so that its mirror image is another one.
fn lopsided() -> BeamTable {
    let channels: Vec<(f64, f64)> =
        (0..8).map(|k| (-20.0 + 3.0 * f64::from(k), 0.5 * f64::from(k))).collect();
    BeamTable::sector(&channels, [-10.0, 2.0], 60, 100.0).unwrap()
}

fn tallies(problem: &Arc<Problem>, placements: &[Placement]) -> Vec<Tally> {
    cpu(problem).tally(placements, None).unwrap()
}

/// The sums agree but for voxels on whose faces rounding decides.
fn close(what: &str, a: &Tally, b: &Tally) -> bool {
    let share = |a: u64, b: u64| a.abs_diff(b) as f64 / a.max(1) as f64;
    let change = [(a.covered, b.covered), (a.entropy[0], b.entropy[0]), (a.hits, b.hits)];
    assert!(a.covered > 1000 && a.hits > 100, "{what}: {a:?}");
    change.into_iter().all(|(a, b)| share(a, b) <= 1e-4)
}

#[test]
fn a_mirror_image_scores_as_the_mirrored_world_does() {
    for name in ["urban-crossing", "residential"] {
        let mut own = Own::new(&description(name));
        let built = Problem::from_scene(&own.scene, &own.psog, lopsided(), &FRAMES).unwrap();
        own.problem = Arc::new(built);
        // The mirrored triangles and voxels with the sensor as it is: mirrored twice.
        let world = Arc::new(own.mirrored().problem.mirrored());
        let image = Arc::new(own.problem.mirrored());
        let placements = random_placements(&own.constraints, 6, 5);
        let seen: Vec<Placement> = placements.iter().map(Placement::mirrored).collect();
        assert_eq!(seen, placements.iter().map(mirrored).collect::<Vec<_>>());
        let (want, got) = (tallies(&world, &placements), tallies(&image, &seen));
        for (want, got) in want.iter().zip(&got) {
            assert!(close(name, want, got), "{name}: {want:?} is not {got:?}");
        }
        // The scene as it is, and the placement or the sensor mirrored alone, are something else.
        for other in [tallies(&own.problem, &placements), tallies(&own.problem, &seen)] {
            assert!(!close(name, &want[0], &other[0]), "{name} looks like its mirror image");
        }
    }
}

fn suite(seeds: &[u64], rules: &Constraints) -> Suite {
    let problem =
        |&seed: &u64| (format!("room {seed}"), mounted(&random_problem(seed, true), rules));
    Suite::new(seeds.iter().map(problem)).unwrap()
}

#[test]
fn scores_over_scenes_are_means_of_the_scores_in_each() {
    let both = suite(&[21, 31], &Constraints::default()).with_mirror_images();
    let placements = crate::common::random_placements(3, 8, 5.0);
    let judged = Evaluator::suite_on_cpu(&both, MEMORY).judged(&placements).unwrap();
    let alone: Vec<Vec<Scores>> = both
        .members()
        .iter()
        .map(|member| {
            let problem = member.problem();
            let mut evaluator = Evaluator::new(problem.clone(), Box::new(cpu(problem)));
            let seen: Vec<Placement> = match member.is_mirrored() {
                true => placements.iter().map(Placement::mirrored).collect(),
                false => placements.clone(),
            };
            evaluator.scores(&seen).unwrap()
        })
        .collect();
    for (index, judged) in judged.iter().enumerate() {
        let mut shares = 0.0;
        for (scene, scores) in judged.by_scene.iter().zip(&alone) {
            assert_eq!(scene.scores.segmentation, scores[index].segmentation, "{}", scene.scene);
            shares += scores[index].segmentation.information_gain_share.unwrap() / 4.0;
        }
        let share = judged.scores.segmentation.information_gain_share.unwrap();
        assert!((share - shares).abs() < 1e-12, "{share} is not {shares}");
    }
    let changed = |j: &sightline::search::Judged| {
        j.by_scene[0].scores.segmentation != j.by_scene[1].scores.segmentation
    };
    assert!(judged.iter().all(changed), "a mirror image changes nothing");
}

fn rules() -> Constraints {
    Constraints {
        min_distance: 0.5,
        ..Constraints::in_box([-2.0, -2.0, -1.0, -0.3, 0.0, 0.0], [2.0, 2.0, 1.0, 0.3, 0.0, 0.0], 2)
    }
}

#[test]
fn the_grid_and_its_bound_are_those_of_all_scenes() {
    let tasks = "0.5*information_gain + 2*detection.information_gain";
    for (seeds, objective) in
        [([41, 51], "information_gain"), ([61, 71], tasks), ([41, 71], "near_gain_2 + near_gain")]
    {
        let both = suite(&seeds, &rules()).with_mirror_images();
        let objective: Objective = objective.parse().unwrap();
        let mut evaluator = Evaluator::suite_on_cpu(&both, MEMORY);
        let grid = PoseGrid::new(&rules(), Spacing { metres: 2.0, radians: 0.6 }).unwrap();
        let atlas = Atlases::new(&evaluator, &grid, objective.needed(), MEMORY);
        let mut search = GridSearch::new(atlas, objective.clone(), &evaluator);
        let mut best = GridPlacement { poses: vec![], value: f64::NEG_INFINITY };
        for a in 0..grid.len() {
            let fitting: Vec<u32> = (a + 1..grid.len()).filter(|&b| search.fits(b, &[a])).collect();
            for b in fitting {
                let value = search.value(&mut evaluator, &[a, b]).unwrap();
                if value > best.value {
                    best = GridPlacement { poses: vec![a, b], value };
                }
            }
        }
        let scores = evaluator.scores(&[best.placement(&grid, "best")]).unwrap().remove(0);
        let value = objective.value(&scores).unwrap();
        assert!((value - best.value).abs() <= 1e-12 * value, "{value} is not {}", best.value);
        let all: Vec<u32> = (0..grid.len()).collect();
        let greedy = search.greedy(&mut evaluator, &all).unwrap().unwrap();
        let plain = !objective.to_string().contains("gain_");
        for gap in [None, Some(0.0)] {
            let effort = Effort::of(1000, gap, MEMORY);
            let go_on = &mut |_| true;
            let bound = bound_gain(&mut search, &mut evaluator, &greedy, &effort, go_on).unwrap();
            assert!(bound.upper >= best.value * (1.0 - 1e-9), "{gap:?}");
            assert!(bound.upper_at_root <= 1.15 * best.value, "{}", bound.upper_at_root);
            if gap.is_some() && plain {
                let about = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b;
                assert!(bound.proven && about(bound.best.value, best.value));
                assert!(about(bound.upper, best.value));
            }
        }
    }
}

fn settings() -> Settings {
    let pose = |x| SensorPose::at(x, 0.0, 0.5);
    let layout = |name: &str, x| Placement { name: name.into(), lidars: vec![pose(x), pose(-x)] };
    Settings {
        evaluations: 36,
        baselines: vec![layout("near", 0.5), layout("far", 1.5)],
        engine: EngineChoice { memory: Some(1 << 28), ..EngineChoice::cpu() },
        ..Settings::default()
    }
}

#[test]
fn a_run_over_scenes_goes_on_from_any_step_to_the_same_bits() {
    let suite = suite(&[81, 91], &rules()).with_mirror_images();
    let mut run = Run::new(suite.clone(), &settings()).unwrap();
    let mut states = Vec::new();
    let whole = loop {
        states.push(serde_json::to_string(run.state()).unwrap());
        if let Some(outcome) = run.step(&mut |_: &sightline::Event| true).unwrap() {
            break outcome;
        }
    };
    let best = whole.best.as_ref().unwrap();
    assert_eq!(best.by_scene.len(), 4);
    let spread = whole.spread.as_ref().unwrap();
    assert_eq!((spread.scenes, spread.by_scene.len()), (2, 2));
    assert_eq!(spread.gain, Gain::Near, "what the search makes large");
    // Each scene's difference is that of the shares of scene and image.
    let rival = whole.baselines.iter().find(|b| b.placement.name == spread.baseline).unwrap();
    for (scene, difference) in spread.by_scene.iter().enumerate() {
        let share = |scored: &sightline::search::Scored, member: usize| {
            scored.by_scene[member].scores.near_gain.unwrap()
        };
        let each = [2 * scene, 2 * scene + 1].map(|m| share(best, m) - share(rival, m));
        assert!((0.5 * (each[0] + each[1]) - difference).abs() < 1e-12, "{each:?}, {difference}");
    }
    // No level forgets a scene: two frames each, numbered through.
    for frames in &whole.frames_used.as_ref().unwrap().frames {
        assert!((0..4).all(|m| frames.iter().any(|f| f / 2 == m)), "{frames:?}");
    }
    for state in states.iter().step_by(4).chain(states.last()) {
        let state: State = serde_json::from_str(state).unwrap();
        let mut run = Run::resume(suite.clone(), state);
        run.open_with(settings().engine, None, None);
        let resumed = loop {
            if let Some(outcome) = run.step(&mut |_: &sightline::Event| true).unwrap() {
                break outcome;
            }
        };
        assert_eq!((&resumed.best, &resumed.spread), (&whole.best, &whole.spread));
        assert_eq!(resumed.certificate, whole.certificate);
        assert_eq!(resumed.history, whole.history);
    }
}

/// One scene through a suite is one scene, to the bit.
#[test]
fn a_suite_of_one_is_the_problem_itself() {
    let problem = mounted(&random_problem(95, true), &rules());
    let one = Suite::new([("any".to_owned(), problem.clone())]).unwrap();
    let on = &mut |_: &sightline::Event| true;
    let a = sightline::optimize(&problem, &settings(), on).unwrap();
    let b = sightline::optimize(one, &settings(), on).unwrap();
    assert_eq!((&a.best, &a.history, &a.certificate), (&b.best, &b.history, &b.certificate));
    assert_eq!((a.spread, a.best.unwrap().by_scene.len()), (None, 0));
}
