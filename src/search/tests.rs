//! Work in parts: the bits of work at once, and no further part after a stop.

use std::path::Path;
use std::sync::Arc;

use serde_json::{Value, json};

use super::atlas::POSES_AT_ONCE;
use super::atlases::Atlases;
use super::bound::{Effort, GainBound, GridSample, bound_gain, bounds};
use super::climb::Moves;
use super::evaluator::Evaluator;
use super::grid_search::{GridPlacement, GridSearch};
use super::observer::{Event, Watch};
use super::on_demand::FramesOnDemand;
use super::pilot::{Known, Pilot};
use super::run::Run;
use super::settings::Settings;
use super::suite::Suite;
use super::swaps::{SwapSettings, swap_from};
use crate::bvh::Bvh;
use crate::geom::TriangleSoup;
use crate::problem::{Content, OccupiedVoxel, Problem, Requirement, Task};
use crate::psog::{Psog, Roi};
use crate::scene::Scene;
use crate::score::Objective;
use crate::vehicle::{BeamTable, Constraints, Placement, PoseGrid, SensorPose, Spacing};

const MEMORY: u64 = 1 << 28;
/// Frames that differ, and those that are equal to the first.
const FRAMES: [usize; 2] = [70, 5];

fn problem() -> Arc<Problem> {
    problem_over(FRAMES)
}

fn problem_over(frames: [usize; 2]) -> Arc<Problem> {
    problem_with(frames, &[])
}

/// A wall that stands elsewhere in each frame; beams end before the far voxels.
fn problem_with(frames: [usize; 2], required: &[Requirement]) -> Arc<Problem> {
    let roi = Roi::new([-6.0, -5.0, -2.0], [0.5; 3], [24, 20, 8]).unwrap();
    let channels: Vec<(f64, f64)> = (0..5).map(|k| (-20.0 + 10.0 * f64::from(k), 0.3)).collect();
    let table = BeamTable::spinning(&channels, 30, 5.0).unwrap();
    let tree = |frame: usize| {
        let x = 1.0 + 0.05 * frame as f32;
        let vertices = vec![[x, -4.0, -2.0], [x, 4.0, -2.0], [x, 0.0, 2.0]];
        let (faces, face_class) = (vec![[0, 1, 2]], vec![0]);
        Arc::new(Bvh::build(&TriangleSoup { vertices, faces, face_class }, 12.0))
    };
    let mut trees: Vec<Arc<Bvh>> = (0..frames[0]).map(tree).collect();
    (0..frames[1]).for_each(|_| trees.push(trees[0].clone()));
    let voxel = |index: u32| OccupiedVoxel { index, entropy: [1 + index % 7; 4] };
    let occupied: Vec<OccupiedVoxel> =
        (0..roi.voxel_count() as u32).step_by(3).map(voxel).collect();
    let content = Content::new(vec![], occupied, &[], false).with_areas(&roi, required);
    let rules =
        Constraints::in_box([-1.0, -1.0, -0.5, 0.0, 0.0, 0.0], [1.0, 1.0, 0.5, 0.0, 0.0, 0.0], 2);
    Arc::new(Problem::from(Task::new(roi, content, table, trees, true)).with_constraints(rules))
}

fn placements() -> Vec<Placement> {
    let pose =
        |k: usize, lidar: usize| SensorPose::at(0.2 * k as f64 - 0.9, 0.4 * lidar as f64, 0.3);
    let placed = |k: usize| Placement {
        name: format!("p{k}"),
        lidars: (0..1 + k % 3).map(|lidar| pose(k, lidar)).collect(),
    };
    (0..9).map(placed).collect()
}

#[test]
fn scores_in_parts_have_the_bits_of_scores_at_once() {
    let (suite, placements) = (Suite::from(problem()).with_mirror_images(), placements());
    assert_eq!(suite.frame_count(), 2 * (FRAMES[0] + FRAMES[1]));
    let mut evaluator = Evaluator::suite_on_cpu(&suite, MEMORY);
    let want = evaluator.judged(&placements).unwrap();
    assert!(want.iter().any(|judged| !judged.scores.guards.is_empty()), "guards take casts, too");
    let pilot = Pilot::new(&suite, placements[2..5].to_vec(), MEMORY, &mut |_| true);
    let known = pilot.unwrap().unwrap().tallies();
    let mut questions = [0, 0];
    for (known, asked) in [Known::new(), known].iter().zip(&mut questions) {
        let mut evaluator = Evaluator::suite_on_cpu(&suite, MEMORY);
        let mut go_on = || {
            *asked += 1;
            true
        };
        let judged = evaluator.judged_while(&placements, known, &mut go_on).unwrap();
        assert_eq!(judged.unwrap(), want);
    }
    assert!(questions[0] > 20 && questions[1] <= questions[0], "{questions:?}");
}

#[test]
fn scores_in_parts_stop_where_they_are_told_to() {
    let (suite, placements) = (Suite::from(problem()), placements());
    let score = |last: u32| {
        let (mut evaluator, mut asked) = (Evaluator::suite_on_cpu(&suite, MEMORY), 0);
        let mut go_on = || {
            asked += 1;
            asked < last
        };
        let scores = evaluator.scores_while(&placements, &mut go_on).unwrap();
        (scores.is_some(), asked)
    };
    let (is_whole, all) = score(u32::MAX);
    assert!(is_whole && all > 8, "{all} questions");
    for last in [1, 2, 3, all / 2, all - 1, all] {
        assert_eq!(score(last), (false, last), "told to stop at question {last} of {all}");
    }
}

#[test]
fn a_pilot_stops_where_it_is_told_to() {
    let (suite, placements) = (Suite::from(problem()), placements());
    let frames = suite.frame_count();
    for last in [0, 1, 40, frames - 1] {
        let mut asked = Vec::new();
        let mut go_on = |done| {
            asked.push(done);
            done < last
        };
        let settings = Settings { baselines: placements[..2].to_vec(), ..Settings::default() };
        let chosen = FramesOnDemand::choose(&suite, &settings, MEMORY, &mut go_on).unwrap();
        assert!(chosen.is_none());
        assert_eq!(asked, (0..=last).collect::<Vec<_>>());
    }
    let whole = Pilot::new(&suite, placements, MEMORY, &mut |done| done < frames);
    assert!(whole.unwrap().is_some());
}

/// A search over frames of [`problem_over`] on a grid spaced `metres` apart.
fn search_over(frames: [usize; 2], metres: f64) -> (GridSearch, Evaluator) {
    search_in(problem_over(frames), Spacing { metres, radians: 0.1 })
}

fn search_in(problem: Arc<Problem>, spacing: Spacing) -> (GridSearch, Evaluator) {
    let suite = Suite::from(problem);
    let evaluator = Evaluator::suite_on_cpu(&suite, MEMORY);
    let grid = PoseGrid::new(suite.constraints(), spacing).unwrap();
    let objective: Objective = "information_gain".parse().unwrap();
    let atlases = Atlases::new(&evaluator, &grid, objective.needed(), MEMORY);
    (GridSearch::new(atlases, objective, &evaluator), evaluator)
}

/// Poses that a climb starts from.
const START: [u32; 2] = [3, 50];

/// End of a climb that is stopped at a question, and the poses cast at each question.
fn climbed(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    last: usize,
) -> (GridPlacement, Vec<u64>) {
    let mut asked = Vec::new();
    let mut go_on = |cast| {
        asked.push(cast);
        asked.len() < last
    };
    let end = search.climb(evaluator, &START, Moves::Anywhere, &mut go_on).unwrap();
    (end.expect("the start takes few casts"), asked)
}

#[test]
fn a_climb_that_is_told_to_stop_ends_where_its_turn_began() {
    let (mut search, mut evaluator) = search_over(FRAMES, 0.25);
    let (top, questions) = climbed(&mut search, &mut evaluator, usize::MAX);
    let most = questions.windows(2).map(|pair| pair[1] - pair[0]).max();
    assert!(most <= Some(POSES_AT_ONCE as u64), "poses cast with no question: {questions:?}");
    assert_eq!(search.atlas().poses_cast(), 405, "a turn casts the whole grid");
    let (mut values, second) = (Vec::new(), questions.iter().position(|&cast| cast == 405));
    let second = 1 + second.expect("the second turn begins");
    for last in [1, 2, second - 1, second] {
        let (mut search, mut evaluator) = search_over(FRAMES, 0.25);
        let (end, asked) = climbed(&mut search, &mut evaluator, last);
        // The guards of the end are asked about once more.
        assert!((last..=last + 1).contains(&asked.len()), "{asked:?}");
        assert_eq!(asked[..last], questions[..last]);
        assert_eq!(search.atlas().poses_cast(), asked[last - 1], "cast after question {last}");
        let again = search.value(&mut evaluator, &end.poses).unwrap();
        assert_eq!(end.value, again, "of the placement itself");
        assert_eq!(end.poses == START, last < second, "told to stop at question {last}");
        values.push(end.value);
        if last == 2 {
            let (whole, _) = climbed(&mut search, &mut evaluator, usize::MAX);
            assert_eq!(whole, top, "on from a cut at question {last}");
        }
    }
    assert!(values[3] > values[0], "the first turn gains: {values:?}");
}

#[test]
fn a_bound_that_is_told_to_stop_is_one() {
    let bound = |last: usize| -> (GainBound, usize) {
        let (mut search, mut evaluator) = search_over([3, 2], 0.5);
        let found = [START[0], START[1]];
        let value = search.value(&mut evaluator, &found).unwrap();
        let found = GridPlacement { poses: found.to_vec(), value };
        let mut asked = 0;
        let mut go_on = |_| {
            asked += 1;
            asked < last
        };
        let effort = Effort::of(1000, Some(0.0), 1 << 34);
        let bound = bound_gain(&mut search, &mut evaluator, &found, &effort, &mut go_on).unwrap();
        (bound, asked)
    };
    let (whole, questions) = bound(usize::MAX);
    assert!(questions > 20, "{questions} questions");
    let mut uppers = Vec::new();
    for last in 1..questions {
        let (cut, asked) = bound(last);
        // Each split tried, the last one and the sets are asked about once more.
        assert!((last..last + 4).contains(&asked), "{asked} questions, stopped at {last}");
        assert!(cut.upper >= whole.best.value, "{cut:?} beside {whole:?}");
        uppers.push(cut.upper);
    }
    assert!(uppers[0] > whole.upper, "the first is cut short: {uppers:?}");
}

/// Two LiDARs on the roof of a vehicle on level ground, with requirements.
fn parked(require: &Value) -> Arc<Problem> {
    let scene = json!({ "sightline": 1, "name": "level", "coverage": "first-hit",
        "roi": { "min": [-8, -8, -0.5], "max": [8, 8, 2.5], "voxel": [0.5, 0.5, 0.5] },
        "static": [{ "class": "road", "plane": { "min": [-60, -60], "max": [60, 60], "z": 0 } }],
        "ego": { "poses": [{ "x": 0, "y": 0, "z": 0 }] },
        "vehicle": {
            "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.2], "size": [2.4, 1.2, 1.3] } }],
            "sensors": [{ "name": "s", "phase": 0,
                "lidar": { "channels": 10, "fov": [-75, 5], "azimuth_steps": 36, "range": 30 } }],
            "mounts": [{ "name": "roof", "min": [-1, -0.5, 1.7], "max": [1, 0.5, 1.7],
                "pitch": [-0.3, 0.3], "count": 2 }],
            "require": require } });
    let scene = Scene::from_json(&scene.to_string(), Path::new(""), "level.json").unwrap();
    let (roi, classes) = (scene.roi().grid().unwrap(), scene.classes().to_vec());
    // Occupied in one of two frames, by the first class; no pattern is its own mirror image.
    let index: Vec<u64> = (0..roi.voxel_count()).filter(|v| v * 7 % 11 < 4).collect();
    let row = (0..classes.len()).map(|class| u16::from(class == 0));
    let counts = row.collect::<Vec<u16>>().repeat(index.len());
    let psog = Psog::new(roi, 2, classes, index, counts).unwrap();
    Arc::new(Problem::from_scene(&scene, &psog, scene.sensors().unwrap(), &[0]).unwrap())
}

/// Grid of [`parked`]: six positions, three pitches.
const ROOF: Spacing = Spacing { metres: 1.0, radians: 0.3 };

/// Two LiDARs on a grid, their gain, and the share of each requirement that they meet.
fn pairs_in(problem: Arc<Problem>) -> Vec<(GridPlacement, Vec<f64>)> {
    let (search, mut evaluator) = search_in(problem, ROOF);
    let grid = search.atlas().grid();
    assert_eq!(grid.len(), 18);
    let pairs: Vec<Vec<u32>> = (0..18).flat_map(|a| (0..a).map(move |b| vec![b, a])).collect();
    let fitting = pairs.into_iter().filter(|pair| search.fits(pair[0], &pair[1..]));
    let mut all: Vec<GridPlacement> =
        fitting.map(|poses| GridPlacement { poses, value: 0.0 }).collect();
    let placed: Vec<Placement> = all.iter().map(|pair| pair.placement(grid, "pair")).collect();
    let scores = evaluator.scores(&placed).unwrap();
    let shares = |k: usize| scores[k].required.iter().map(|seen| seen.share).collect();
    for (pair, scores) in all.iter_mut().zip(&scores) {
        pair.value = search.objective.value(scores).unwrap();
    }
    all.into_iter().enumerate().map(|(k, pair)| (pair, shares(k))).collect()
}

/// Each requirement alone asks for more than the best pair of all meets: bounds are held against every pair that meets it.
#[test]
fn a_bound_is_on_the_placements_that_meet_the_requirements() {
    let rules = json!([
        { "name": "left", "min": [-4, 1, 0], "max": [4, 6, 1], "share": 0.01 },
        { "ground": 1, "share": 0.01 },
        { "ground": 3, "share": 0.01 },
        { "ground": 2, "share": 0.01, "without_any_one": true },
        { "blind_zone": "left", "depth": 0.6, "share": 0.01 },
        { "target": "child", "within": 8, "bearing": [-40, 40], "beams": 3, "share": 0.01 },
        { "target": "tyre", "within": 7, "bearing": [60, 120], "beams": 2, "share": 0.01 },
        { "target": "car", "within": 7, "beams": 4, "share": 0.01, "without_any_one": true }]);
    let pairs = pairs_in(parked(&rules));
    let of = |of: &(GridPlacement, Vec<f64>)| of.0.value;
    let (best, shares) = pairs.iter().max_by(|a, b| of(a).total_cmp(&of(b))).unwrap();
    let mut tried = 0;
    for (k, rule) in rules.as_array().unwrap().iter().enumerate() {
        let most = pairs.iter().map(|pair| pair.1[k]).fold(0.0, f64::max);
        let least = 0.5 * (shares[k] + most);
        if shares[k] + 1e-6 >= most {
            continue;
        }
        tried += 1;
        let mut meeting: Vec<&GridPlacement> =
            pairs.iter().filter(|pair| pair.1[k] + 1e-9 >= least).map(|pair| &pair.0).collect();
        meeting.sort_by(|a, b| a.value.total_cmp(&b.value));
        let (worst, top) = (meeting[0], meeting[meeting.len() - 1]);
        assert!(top.value < 0.999 * best.value, "{rule}");
        let mut rule = rule.clone();
        rule["share"] = json!(least);
        let (mut search, mut evaluator) = search_in(parked(&json!([rule])), ROOF);
        let mut bound = |found: &GridPlacement, gap| {
            let effort = Effort::of(1000, gap, 1 << 34);
            bound_gain(&mut search, &mut evaluator, found, &effort, &mut |_| true).unwrap()
        };
        let rough = bound(worst, None);
        assert!(rough.upper >= top.value * (1.0 - 1e-12), "{rule}: {rough:?} and {top:?}");
        assert_eq!(rough.heeds.as_deref(), Some("the requirements"));
        let close = bound(worst, Some(0.0));
        assert!(close.upper >= top.value * (1.0 - 1e-12), "{rule}: {close:?} and {top:?}");
        assert!(close.upper <= top.value * (1.0 + 1e-6), "{rule}: {close:?} and {top:?}");
        assert!(close.proven && meeting.iter().any(|pair| pair.poses == close.best.poses));
        assert!((close.best.value - top.value).abs() <= 1e-9 * top.value);
        // The best of all is no placement that the bound is on.
        let beyond = bound(best, Some(0.0));
        assert!(beyond.upper >= best.value && !beyond.proven, "{rule}: {beyond:?}");
    }
    assert!(tried >= 6, "{tried} requirements that the best of all misses");
    let (mut search, mut evaluator) = search_in(parked(&json!([])), ROOF);
    let (worst, effort) = (&pairs[0].0, Effort::of(1000, Some(0.0), 1 << 34));
    let free = bound_gain(&mut search, &mut evaluator, worst, &effort, &mut |_| true).unwrap();
    assert!((free.upper - best.value).abs() <= 1e-6 * best.value, "{free:?} and {best:?}");
    assert_eq!(free.heeds, None);
}

#[test]
fn a_run_bounds_what_meets_the_requirements_or_says_that_nothing_does() {
    let gain_of = |require: Value| {
        let settings = Settings {
            objective: "information_gain".parse().unwrap(),
            delta: Some(ROOF),
            gap: Some(0.0),
            ..Settings::default()
        };
        let (mut evaluator, mut goes_on) = (Evaluator::on_cpu(parked(&require)), |_: &Event| true);
        let mut watch = Watch::new(&mut goes_on, false);
        bounds(&mut evaluator, &settings, 1 << 34, &mut watch).unwrap().gain
    };
    let ground = |share: f64| json!([{ "ground": 1, "share": share }]);
    let [free, asked] = [0.01, 0.35].map(|share| gain_of(ground(share)).unwrap());
    assert!(asked.proven && asked.upper < 0.999 * free.upper, "{asked:?} and {free:?}");
    // An atlas has a sample of the surfaces that overlap is measured on.
    let overlap = json!({ "overlap": 0.9 });
    let heeds = |require: Value| gain_of(require).unwrap().heeds;
    assert_eq!(heeds(json!([overlap])), None);
    let both = heeds(json!([{ "ground": 1, "share": 0.01 }, overlap]));
    assert_eq!(both.as_deref(), Some("the requirements but those on overlap"));
    // No beam goes into the own body; two LiDARs see less than all poses together.
    let body =
        json!({ "name": "inside", "min": [-1, -0.5, 0.5], "max": [1, 0.5, 1], "share": 0.9 });
    let far = json!({ "name": "far", "min": [5, -8, 0], "max": [8, 8, 1.5], "share": 0.85 });
    for (rule, words) in [
        (body, "inside: even a LiDAR at every pose looked at on each mount leaves it 0.0 % seen"),
        (far, "far: shares of the best poses add up to less than the 85.0 % required"),
    ] {
        let why = gain_of(json!([rule])).unwrap_err();
        let start = "no placement on the grid of 18 sensor poses, with these sensors on their mounts, meets the requirements \
                     over 1 frame: ";
        assert!(why.starts_with(&format!("{start}{words}")), "{why}");
    }
}

#[test]
fn nothing_is_begun_over_more_frames_than_are_cast_between_questions() {
    let (mut search, mut evaluator) = search_over([1100, 0], 0.5);
    let end = search.climb(&mut evaluator, &START, Moves::Anywhere, &mut |_| false).unwrap();
    assert_eq!(end, None);
    let sample = GridSample::draw(&mut search, &mut evaluator, 2, 1, &|| false).unwrap();
    assert_eq!((sample.placements().count(), sample.lipschitz()), (0, None));
    assert_eq!(search.hold_while(&mut evaluator, &[1, 2, 3], &mut |_| false).unwrap(), [1]);
    assert_eq!(search.atlas().poses_cast(), 1);
}

#[test]
fn an_interrupted_run_scores_the_first_of_many_baselines_and_a_resumed_one_all() {
    let problem = problem_over([2, 0]);
    let baselines: Vec<Placement> =
        (0..40).map(|k| Placement { name: format!("b{k}"), ..placements()[1].clone() }).collect();
    let settings = Settings { baselines, evaluations: 12, ..Settings::default() };
    let run_to_end = |run: &mut Run, goes_on: bool| {
        let observer = &mut |_: &Event| goes_on;
        loop {
            if let Some(outcome) = run.step(observer).unwrap() {
                return (outcome.baselines.len(), outcome.unscored_baselines);
            }
        }
    };
    let mut run = Run::new(problem.clone(), &settings).unwrap();
    let (scored, left) = run_to_end(&mut run, false);
    assert!(scored > 0 && left > 0 && scored + left == 40, "{scored} and {left}");
    let mut resumed = Run::resume(problem, run.state().clone());
    assert_eq!(run_to_end(&mut resumed, true), (40, 0));
}

#[test]
fn ends_of_climbs_are_told_apart_by_requirements_though_their_poses_were_forgotten() {
    let seen = |reach: f64, share: f64| {
        let inside = [[-3.0, -2.0, -1.0], [reach, 2.0, 1.0]];
        let required = [Requirement { name: "near".into(), inside, without: vec![], share }];
        let mut evaluator = Evaluator::on_cpu(problem_with([2, 0], &required));
        let spacing = Spacing { metres: 0.25, radians: 0.1 };
        let settings = SwapSettings {
            spacing,
            casts: 500,
            whole: false,
            memory: MEMORY,
            seed: 1,
            roomy: false,
            looks_away: false,
        };
        let starts: Vec<Placement> = [[-1.0, 1.0], [0.5, -0.5], [1.0, 0.0]]
            .map(|[x, y]| Placement {
                name: "start".into(),
                lidars: vec![SensorPose::at(x, y, 0.0), SensorPose::at(-x, -y, 0.5)],
            })
            .to_vec();
        let objective = Objective::default();
        let swapped = swap_from(&mut evaluator, &objective, &settings, 1, &starts, &mut |_| true);
        let climbs = swapped.unwrap().unwrap().climbs;
        (climbs.count, climbs.met)
    };
    assert_eq!(seen(1.0, 0.01), (3, Some(3)));
    assert_eq!(seen(6.0, 1.0), (3, Some(0)), "no beam goes through the wall");
}
