//! Work in parts: the bits of work at once, and no further part after a stop.

use std::sync::Arc;

use super::atlas::POSES_AT_ONCE;
use super::atlases::Atlases;
use super::bound::{Effort, GainBound, GridSample, bound_gain};
use super::climb::Moves;
use super::evaluator::Evaluator;
use super::grid_search::{GridPlacement, GridSearch};
use super::observer::Event;
use super::on_demand::FramesOnDemand;
use super::pilot::{Known, Pilot};
use super::run::Run;
use super::settings::Settings;
use super::suite::Suite;
use super::swaps::{SwapSettings, swap_from};
use crate::bvh::Bvh;
use crate::geom::TriangleSoup;
use crate::problem::{Content, OccupiedVoxel, Problem, Requirement, Task};
use crate::psog::Roi;
use crate::score::Objective;
use crate::vehicle::{BeamTable, Constraints, Placement, PoseGrid, SensorPose, Spacing};

/// Memory of an evaluator.
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
    let suite = Suite::from(problem_over(frames));
    let evaluator = Evaluator::suite_on_cpu(&suite, MEMORY);
    let spacing = Spacing { metres, radians: 0.1 };
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
