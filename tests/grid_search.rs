//! Search on a grid of poses and its bounds, against trying every placement.

use sightline::internals::{
    Atlas, Climbing, Effort, GridPlacement, GridSample, GridSearch, Moves, PoseGrid, Spacing,
    SwapSettings, Ties, bound_gain, swap_anywhere,
};
use sightline::score::{Needed, Objective};
use sightline::search::Evaluator;

use crate::common::*;

fn constraints(lidars: usize, min_distance: f64) -> Constraints {
    Constraints {
        min_distance,
        ..Constraints::in_box(
            [-2.0, -2.0, -1.0, -0.3, 0.0, 0.0],
            [2.0, 2.0, 1.0, 0.3, 0.0, 0.0],
            lidars,
        )
    }
}

fn search(problem: &Arc<Problem>, rules: &Constraints, objective: &str) -> (GridSearch, Evaluator) {
    let backend = Box::new(CpuBackend::new(problem.task().clone(), MEMORY));
    let evaluator = Evaluator::new(mounted(problem, rules), backend);
    let grid = PoseGrid::new(rules, Spacing { metres: 2.0, radians: 0.6 }).unwrap();
    assert_eq!(grid.len(), 36);
    let objective: Objective = objective.parse().unwrap();
    let atlas = Atlas::new(problem.clone(), grid, objective.needed(), MEMORY);
    (GridSearch::new(atlas, objective, &evaluator), evaluator)
}

/// The best of all placements that extend `chosen` by poses of higher number, by trying each.
fn best_of_all(
    search: &mut GridSearch,
    evaluator: &mut Evaluator,
    lidars: usize,
    chosen: &mut Vec<u32>,
) -> Option<GridPlacement> {
    if chosen.len() == lidars {
        let value = search.value(evaluator, chosen).unwrap();
        return Some(GridPlacement { poses: chosen.clone(), value });
    }
    let first = chosen.last().map_or(0, |last| last + 1);
    let mut best: Option<GridPlacement> = None;
    for pose in first..search.atlas().grid().len() {
        if !search.fits(pose, chosen) {
            continue;
        }
        chosen.push(pose);
        let found = best_of_all(search, evaluator, lidars, chosen);
        chosen.pop();
        let is_better = |found: &GridPlacement| best.as_ref().is_none_or(|b| found.value > b.value);
        best = found.filter(is_better).or(best);
    }
    best
}

#[test]
fn bounds_bracket_the_best_of_all_placements() {
    let gain = "information_gain";
    let tasks = "0.5*information_gain + 2*detection.information_gain";
    let mixed = "near_gain + 0.5*near_gain_2 + near_gain_3";
    for (seed, lidars, apart, objective, most_at_root) in [
        (1, 2, 0.0, gain, 1.12),
        (2, 3, 0.0, gain, 1.12),
        (3, 3, 2.5, gain, 1.12),
        (4, 2, 3.0, gain, 1.12),
        (5, 1, 0.0, gain, 1.12),
        (6, 4, 0.5, tasks, 1.12),
        (7, 3, 0.0, "near_gain", 1.12),
        // Two and three LiDARs, which all count: a sum over them, which the best single poses bound to the bit or so.
        (8, 2, 0.0, "near_gain_2", 1.0 + 1e-11),
        (9, 3, 0.0, "near_gain_3", 1.0 + 1e-11),
        (10, 3, 0.0, "near_gain_2", 1.12),
        (11, 4, 0.5, "near_gain_2", 1.12),
        (12, 4, 0.0, "near_gain_3", 1.12),
        (13, 3, 0.0, mixed, 1.12),
        // Kinds of different shares in a voxel: overlaps count at the least share, which is weak.
        (14, 3, 2.5, "near_gain_2 + information_gain_share", 1.2),
        (15, 1, 0.0, "near_gain_2", 1.12),
    ] {
        let problem = random_problem(seed, true);
        let rules = constraints(lidars, apart);
        let (mut search, mut evaluator) = search(&problem, &rules, objective);
        let all: Vec<u32> = (0..36).collect();
        let best = best_of_all(&mut search, &mut evaluator, lidars, &mut Vec::new()).unwrap();
        let greedy = search.greedy(&mut evaluator, &all).unwrap().unwrap();
        assert!(greedy.value <= best.value);
        if apart == 0.0 {
            assert!(greedy.value >= (1.0 - (-1f64).exp()) * best.value, "seed {seed}");
        }
        let about = |a: f64, b: f64| (a - b).abs() <= 1e-6 * b;
        let mut uppers = Vec::new();
        for gap in [None, Some(0.1), Some(0.02), Some(0.0)] {
            let effort = Effort {
                first_words: gap.map_or(0, |_| u64::MAX),
                ..Effort::of(1000, gap, MEMORY)
            };
            let go_on = &mut |_| true;
            let bound = bound_gain(&mut search, &mut evaluator, &greedy, &effort, go_on).unwrap();
            assert!(bound.upper >= best.value * (1.0 - 1e-12), "seed {seed}, gap {gap:?}");
            assert!(bound.best.value >= greedy.value && bound.upper <= bound.upper_at_root);
            let root = bound.upper_at_root / best.value;
            assert!(root <= most_at_root, "seed {seed}: {root} times the best");
            uppers.push(bound.upper);
            if !objective.contains("gain_")
                && let Some(gap) = gap
            {
                let most = bound.best.value * (1.0 + gap);
                assert!(bound.upper <= most * (1.0 + 1e-6), "seed {seed}, gap {gap}: {bound:?}");
                assert!(bound.proven || gap > 0.0, "seed {seed}: {bound:?}");
            }
            if gap == Some(0.0) && !objective.contains("gain_") {
                assert!(about(bound.best.value, best.value) && about(bound.upper, best.value));
            }
        }
        assert!(uppers.is_sorted_by(|a, b| a >= b), "more work, tighter bounds: {uppers:?}");
    }
}

#[test]
fn bounds_over_several_mounts_bracket_the_best_of_all_placements() {
    for (seed, counts, apart) in
        [(1, [1, 2], 0.0), (2, [2, 2], 0.0), (3, [2, 1], 2.5), (4, [1, 1], 0.0)]
    {
        let problem = random_problem(seed, true);
        let mut rules = constraints(counts[0], apart);
        let low = [-2.0, -2.0, -1.0, 0.0, 0.0, 0.0];
        let other = Constraints::in_box(low, [2.0, 2.0, -1.0, 0.0, 0.0, 0.0], counts[1]);
        rules.slots.extend(other.slots);
        let backend = Box::new(CpuBackend::new(problem.task().clone(), MEMORY));
        let mut evaluator = Evaluator::new(mounted(&problem, &rules), backend);
        let grid = PoseGrid::new(&rules, Spacing { metres: 2.0, radians: 0.6 }).unwrap();
        let objective: Objective = "near_gain".parse().unwrap();
        let atlas = Atlas::new(problem.clone(), grid, objective.needed(), MEMORY);
        let mut search = GridSearch::new(atlas, objective, &evaluator);
        let all: Vec<u32> = (0..search.atlas().grid().len()).collect();
        assert_eq!(all.len(), 36 + 9);
        let lidars = counts[0] + counts[1];
        let best = best_of_all(&mut search, &mut evaluator, lidars, &mut Vec::new()).unwrap();
        // From the first poses that fit: the best is still to be found.
        let mut poses: Vec<u32> = Vec::new();
        for &pose in &all {
            if search.fits(pose, &poses) {
                poses.push(pose);
            }
        }
        let value = search.value(&mut evaluator, &poses).unwrap();
        assert!(poses.len() == lidars && value < 0.95 * best.value, "{value} beside {best:?}");
        let start = GridPlacement { poses, value };
        for gap in [None, Some(0.1), Some(0.0)] {
            let effort = Effort {
                first_words: gap.map_or(0, |_| u64::MAX),
                ..Effort::of(1000, gap, MEMORY)
            };
            let bound =
                bound_gain(&mut search, &mut evaluator, &start, &effort, &mut |_| true).unwrap();
            assert!(
                bound.upper >= best.value * (1.0 - 1e-12),
                "seed {seed}, gap {gap:?}: {bound:?}"
            );
            let most = bound.best.value * (1.0 + gap.unwrap_or(f64::INFINITY));
            assert!(bound.upper <= most * (1.0 + 1e-6), "seed {seed}, gap {gap:?}: {bound:?}");
            assert_eq!(bound.short, None, "seed {seed}");
            let is_in_order =
                bound.best.poses.is_sorted_by_key(|&pose| search.atlas().grid().kind(pose));
            assert!(is_in_order, "{bound:?}");
            if gap == Some(0.0) {
                assert!(
                    bound.proven && (bound.best.value - best.value).abs() <= 1e-12 * best.value
                );
            }
        }
        let effort = Effort::of(1000, Some(0.0), 1);
        let bound =
            bound_gain(&mut search, &mut evaluator, &start, &effort, &mut |_| true).unwrap();
        assert!(bound.proven || bound.short.unwrap().contains("raise --memory"), "seed {seed}");
    }
}

#[test]
fn lazy_greedy_takes_what_greedy_takes() {
    let problem = random_problem(7, true);
    let rules = constraints(4, 1.0);
    // Twice the gain less the gain is no gain to the parser, so it is searched without laziness.
    let (mut lazy, mut evaluator) = search(&problem, &rules, "information_gain");
    let (mut plain, _) = search(&problem, &rules, "2*information_gain + -1*information_gain");
    let all: Vec<u32> = (0..36).collect();
    let lazily = lazy.greedy(&mut evaluator, &all).unwrap().unwrap();
    let plainly = plain.greedy(&mut evaluator, &all).unwrap().unwrap();
    assert_eq!(lazily.poses, plainly.poses);
}

#[test]
fn a_climb_ends_where_no_swap_gains() {
    let problem = random_problem(9, true);
    let rules = constraints(3, 0.5);
    let weighted = "near_gain + 0.5*near_gain_2 + m_sog";
    for objective in
        ["information_gain", "m_sog_scaled", "near_gain", "near_gain_2", "near_gain_3", weighted]
    {
        let (mut search, mut evaluator) = search(&problem, &rules, objective);
        let start = [0, 17, 35];
        let from = search.value(&mut evaluator, &start).unwrap();
        let top =
            search.climb(&mut evaluator, &start, Moves::Anywhere, &mut |_| true).unwrap().unwrap();
        assert!(top.value >= from, "{objective}");
        let placement = top.placement(search.atlas().grid(), "top");
        assert!(rules.violations(&placement).is_empty());
        let scores = evaluator.scores(std::slice::from_ref(&placement)).unwrap().remove(0);
        let value = objective.parse::<Objective>().unwrap().value(&scores).unwrap();
        assert_eq!(value, top.value, "{objective}: as plain scoring says");
        for lidar in 0..3 {
            let mut others = top.poses.clone();
            others.remove(lidar);
            let fitting: Vec<u32> = (0..36).filter(|&pose| search.fits(pose, &others)).collect();
            for pose in fitting {
                let poses = [&others[..], &[pose]].concat();
                let value = search.value(&mut evaluator, &poses).unwrap();
                let placement =
                    GridPlacement { poses, value }.placement(search.atlas().grid(), "x");
                let guarded = !evaluator.scores(&[placement]).unwrap()[0].guards.is_empty();
                assert!(value <= top.value || guarded, "{objective}: {value} after {}", top.value);
            }
        }
        let stopped =
            search.climb(&mut evaluator, &start, Moves::Along(1), &mut |_| false).unwrap().unwrap();
        assert_eq!(stopped.poses, start);
    }
}

#[test]
fn the_sampled_constants_are_those_of_the_sample() {
    let problem = random_problem(11, true);
    let rules = constraints(2, 0.0);
    let (mut search, mut evaluator) = search(&problem, &rules, "information_gain");
    let sample = GridSample::draw(&mut search, &mut evaluator, 50, 3, &|| true).unwrap();
    let bound = sample.lipschitz().unwrap();
    assert_eq!((bound.samples, bound.delta), (50, 2.0));
    assert_eq!(bound.bound, bound.c_m + bound.k_g * 2.0);
    let scored = sample.scored();
    let values = || scored.iter().map(|(_, value)| *value);
    let c_m = values().fold(f64::MIN, f64::max) - values().fold(f64::MAX, f64::min);
    assert_eq!(bound.c_m, c_m);
    assert!(bound.k_g > 0.0);
    // Neighbours differ in one number by one step, so no pair is steeper than k_G.
    for pair in scored.chunks(2) {
        assert!((pair[0].1 - pair[1].1).abs() <= bound.k_g * 2.0 * (1.0 + 1e-12));
    }
    let again = GridSample::draw(&mut search, &mut evaluator, 50, 3, &|| true).unwrap();
    assert_eq!(sample, again, "same seed, same sample");
}

#[test]
fn a_climb_keeps_ties_and_leaves_boxes_free() {
    let pose = |x, y, z, roll| SensorPose { roll, ..SensorPose::at(x, y, z) };
    let start = Placement {
        name: "start".into(),
        lidars: vec![
            pose(-2.0, -2.0, -1.0, 0.0),
            pose(2.0, 0.0, -1.0, 0.0),
            pose(-2.0, 2.0, -1.0, 0.0),
        ],
    };
    for (equal_height, symmetric) in [(true, false), (false, true), (true, true)] {
        let rules = Constraints {
            keep_out: vec![[[-0.5, -0.5, -2.0], [0.5, 0.5, 2.0]]],
            ties: Ties { equal_height, symmetric },
            ..constraints(3, 0.5)
        };
        for seed in 0..2 {
            let problem = random_problem(20 + seed, true);
            let backend = Box::new(CpuBackend::new(problem.task().clone(), MEMORY));
            let mut evaluator = Evaluator::new(mounted(&problem, &rules), backend);
            let spacing = Spacing { metres: 1.0, radians: 0.15 };
            let grid = PoseGrid::new(&rules, spacing).unwrap();
            let objective: Objective = "information_gain".parse().unwrap();
            // Room for few poses: they are cast in parts.
            let room = Atlas::new(problem.clone(), grid.clone(), objective.needed(), 0).page_bytes()
                as u64
                * 40;
            let atlas = Atlas::new(problem, grid, objective.needed(), room);
            let mut search = GridSearch::new(atlas, objective.clone(), &evaluator);
            let from = search.start_of(&start).expect("it keeps the rules");
            let least = search.value(&mut evaluator, &from).unwrap();
            for moves in [Moves::Along(1), Moves::Along(2), Moves::Anywhere] {
                let top =
                    search.climb(&mut evaluator, &from, moves, &mut |_| true).unwrap().unwrap();
                let placement = top.placement(search.atlas().grid(), "top");
                assert_eq!(rules.violations(&placement), [], "{rules:?}");
                let scores = evaluator.scores(&[placement]).unwrap().remove(0);
                assert_eq!(objective.value(&scores), Some(top.value), "as plain scoring says");
                assert!(top.value > least, "it moves: {} and {least}", top.value);
            }
        }
        let off = Placement { lidars: vec![pose(0.0, 0.0, 0.0, 0.0); 3], ..start.clone() };
        let backend = Box::new(CpuBackend::new(random_problem(1, true).task().clone(), MEMORY));
        let evaluator = Evaluator::new(mounted(&random_problem(1, true), &rules), backend);
        let grid = PoseGrid::new(&rules, Spacing { metres: 1.0, radians: 0.3 }).unwrap();
        let atlas = Atlas::new(random_problem(1, true), grid, Needed::all(false), MEMORY);
        let search = GridSearch::new(atlas, "information_gain".parse().unwrap(), &evaluator);
        assert_eq!(search.start_of(&off), None, "in the box, and all in one place");
    }
}

#[test]
fn swaps_tell_other_ends_that_are_about_as_good() {
    let objective: Objective = "information_gain".parse().unwrap();
    let spacing = Spacing { metres: 1.0, radians: 0.3 };
    let mut told = 0;
    for seed in 1..=6 {
        let problem = random_problem(seed, true);
        let rules = constraints(3, 0.0);
        let backend = Box::new(CpuBackend::new(problem.task().clone(), MEMORY));
        let mut evaluator = Evaluator::new(mounted(&problem, &rules), backend);
        let start = [-1.0, 0.0, 1.0].map(|x| SensorPose::at(x, 0.0, 0.0));
        let start = Placement { name: "start".into(), lidars: start.to_vec() };
        let settings = SwapSettings {
            spacing,
            casts: 2000,
            whole: true,
            memory: MEMORY,
            seed,
            roomy: false,
            looks_away: false,
        };
        let swapped = swap_anywhere(
            &mut evaluator,
            &objective,
            &settings,
            &[start],
            &Climbing::default(),
            &mut |_| true,
        );
        let swapped = swapped.unwrap().unwrap();
        let all = [vec![swapped.placement], swapped.others].concat();
        let scores = evaluator.scores(&all).unwrap();
        let values: Vec<f64> = scores.iter().map(|s| objective.value(s).unwrap()).collect();
        assert!((values[0] - swapped.value).abs() <= 1e-9 * swapped.value);
        assert!(values[1..].is_sorted_by(|a, b| a >= b), "{values:?}");
        assert!(values.iter().all(|v| (v - values[0]).abs() <= 0.0301 * values[0]), "{values:?}");
        for (index, other) in all.iter().enumerate() {
            let same = |p: &Placement| other.lidars.iter().all(|l| p.lidars.contains(l));
            assert_eq!(all.iter().position(same), Some(index), "told twice");
        }
        told += all.len() - 1;
    }
    assert!(told > 0);
}

/// The best end of swaps among some poses of a grid of 2 835: its neighbours were cast, and none of them is better.
#[test]
fn swaps_among_some_poses_go_on_until_no_neighbour_is_better() {
    let objective: Objective = "information_gain".parse().unwrap();
    let spacing = Spacing { metres: 0.5, radians: 0.1 };
    for seed in 1..=4 {
        let problem = random_problem(seed, true);
        let rules = constraints(3, 0.0);
        let backend = Box::new(CpuBackend::new(problem.task().clone(), MEMORY));
        let mut evaluator = Evaluator::new(mounted(&problem, &rules), backend);
        let grid = PoseGrid::new(&rules, spacing).unwrap();
        assert_eq!(grid.len(), 9 * 9 * 5 * 7);
        let settings = SwapSettings {
            spacing,
            casts: 600,
            whole: false,
            memory: MEMORY,
            seed,
            roomy: false,
            looks_away: false,
        };
        let (climbing, mut climbs) = (Climbing::default(), Vec::new());
        let mut go_on = |_| {
            climbs.extend(climbing.progress());
            true
        };
        let swapped =
            swap_anywhere(&mut evaluator, &objective, &settings, &[], &climbing, &mut go_on);
        // Climbs among poses that are cast tell how far they are, and end.
        let total = climbs[0][1];
        assert!(climbs.is_sorted() && climbs.iter().all(|[done, all]| done < all && *all == total));
        assert!(climbs.iter().any(|[done, _]| *done + 2 >= total), "{climbs:?}");
        assert_eq!(climbing.progress(), None);
        let swapped = swapped.unwrap().unwrap();
        assert!(swapped.poses_cast > 450, "{} poses: none beside the first", swapped.poses_cast);
        assert!(swapped.poses_cast <= 750, "{} poses", swapped.poses_cast);
        let mut tried = vec![swapped.placement.clone()];
        for (lidar, pose) in swapped.placement.lidars.iter().enumerate() {
            let number = grid.nearest(lidar, pose);
            assert_eq!(grid.pose(number), *pose, "on the grid");
            for next in grid.along(number, 1) {
                let mut moved = swapped.placement.clone();
                moved.lidars[lidar] = grid.pose(next);
                tried.push(moved);
            }
        }
        let scores = evaluator.scores(&tried).unwrap();
        let value = objective.value(&scores[0]).unwrap();
        assert!((value - swapped.value).abs() <= 1e-9 * value);
        let is_sound = |s: &&sightline::score::Scores| s.guards.is_empty();
        let best = scores.iter().filter(is_sound).filter_map(|s| objective.value(s));
        let best = best.fold(0.0, f64::max);
        assert!(best <= value * (1.0 + 1e-9), "seed {seed}: {best} beside {value}");
    }
}

#[test]
fn a_whole_grid_that_does_not_fit_into_memory_is_refused_before_a_cast() {
    let problem = random_problem(1, true);
    let rules = constraints(3, 0.0);
    let backend = Box::new(CpuBackend::new(problem.task().clone(), MEMORY));
    let mut evaluator = Evaluator::new(mounted(&problem, &rules), backend);
    let spacing = Spacing { metres: 0.5, radians: 0.1 };
    let settings = SwapSettings {
        spacing,
        casts: 600,
        whole: true,
        memory: 1 << 10,
        seed: 1,
        roomy: false,
        looks_away: false,
    };
    let objective: Objective = "information_gain".parse().unwrap();
    let never = &mut |_| panic!("nothing is cast");
    let error =
        swap_anywhere(&mut evaluator, &objective, &settings, &[], &Climbing::default(), never)
            .unwrap_err();
    let words = error.to_string();
    assert!(words.contains("2835 sensor poses") && words.contains("raise --memory"), "{words}");
}
