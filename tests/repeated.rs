//! Gains in which a voxel counts again for a second, and a third, LiDAR that covers it, against loops over voxels.

use std::collections::BTreeSet;

use sightline::EngineChoice;
use sightline::score::{Objective, Scores};
use sightline::search::{Evaluator, Gain, Settings, Suite};
use sightline::shared::{RedundancySite, redundancy_question};

use crate::common::*;
use crate::own_scenes::{Own, description, table_7};

/// Numbers of LiDARs that cover each occupied voxel in each frame, each with its weight: a set of voxels a LiDAR.
fn counted(problem: &Arc<Problem>, placement: &Placement) -> Vec<(usize, f64)> {
    let mut engine = cpu(problem);
    let mut counted = Vec::new();
    for frame in 0..problem.frame_count() {
        let alone = |lidar| Placement { name: "alone".into(), lidars: vec![lidar] };
        let sets: Vec<BTreeSet<u64>> = (placement.lidars.iter())
            .map(|&lidar| engine.covered(&alone(lidar), frame).unwrap().into_iter().collect())
            .collect();
        for voxel in problem.content().occupied() {
            let seers = sets.iter().filter(|set| set.contains(&u64::from(voxel.index))).count();
            counted.push((seers, f64::from(voxel.entropy[3])));
        }
    }
    counted
}

/// Σ w·min(c, k) / (k·Σ w).
fn gain(counted: &[(usize, f64)], most: usize) -> f64 {
    let sum: f64 = counted.iter().map(|&(seers, weight)| weight * seers.min(most) as f64).sum();
    sum / (most as f64 * counted.iter().map(|(_, weight)| weight).sum::<f64>())
}

fn near_gains(scores: &Scores) -> [f64; 3] {
    [scores.near_gain, scores.near_gain_2, scores.near_gain_3].map(Option::unwrap)
}

fn scores(problem: &Arc<Problem>, placements: &[Placement]) -> Vec<Scores> {
    Evaluator::new(problem.clone(), Box::new(cpu(problem))).scores(placements).unwrap()
}

/// The LiDARs of some placements together.
fn joined(placements: &[&Placement]) -> Placement {
    let lidars = placements.iter().flat_map(|placement| placement.lidars.clone()).collect();
    Placement { name: "joined".into(), lidars }
}

#[test]
fn near_gains_are_those_of_a_loop_over_voxels() {
    let problem = random_problem(71, true);
    let placements = random_placements(5, 8, 3.0);
    let mut most = None;
    for (placement, scores) in placements.iter().zip(scores(&problem, &placements)) {
        let counted = counted(&problem, placement);
        let want = [1, 2, 3].map(|most| gain(&counted, most));
        for (found, want) in near_gains(&scores).iter().zip(want) {
            assert!((found - want).abs() < 1e-12, "{}: {found} is not {want}", placement.name);
        }
        most = counted.iter().map(|(seers, _)| *seers).max().max(most);
    }
    assert!(most > Some(2), "no voxel is seen thrice");
}

#[test]
fn all_engines_give_the_same_repeated_sums() {
    let problem = random_problem(73, true);
    let placements = random_placements(7, 8, 3.0);
    let want = cpu(&problem).tally(&placements, None).unwrap();
    assert!(want[3].near_repeated[0] > want[3].near_repeated[1] && want[3].near_repeated[1] > 0);
    let mut reference = lidar_cast::engine::ReferenceBackend::new(problem.task().clone());
    assert_eq!(reference.tally(&placements, None).unwrap(), want);
    #[cfg(feature = "gpu")]
    assert_eq!(gpu(&problem).tally(&placements, None).unwrap(), want);
}

#[test]
fn a_placement_given_twice_over_sees_all_twice() {
    let problem = random_problem(75, true);
    for placement in random_placements(9, 4, 3.0) {
        let twice = joined(&[&placement, &placement]);
        let thrice = joined(&[&twice, &placement]);
        let [once, twice, thrice] = [placement, twice, thrice].map(|p| {
            let scores = scores(&problem, &[p]).remove(0);
            (near_gains(&scores), scores.unique_share.len())
        });
        assert_eq!(twice.0[1], once.0[0], "to the bit");
        assert!((thrice.0[2] - once.0[0]).abs() < 1e-15);
        assert_eq!([twice.0[0], thrice.0[0]], [once.0[0]; 2]);
        if once.1 == 1 {
            assert_eq!(once.0[1], once.0[0] / 2.0);
            assert!((once.0[2] - once.0[0] / 3.0).abs() < 1e-15);
            assert!((twice.0[2] - 2.0 * once.0[0] / 3.0).abs() < 1e-15);
        } else {
            assert!(once.0[1] > once.0[0] / 2.0 && once.0[1] < once.0[0]);
        }
    }
}

#[test]
fn a_lidar_more_gains_less_beside_more_of_them() {
    let problem = random_problem(77, true);
    let mut rng = rng(4);
    let pool: Vec<Placement> = (random_placements(11, 40, 3.0).into_iter())
        .map(|p| Placement { lidars: vec![p.lidars[0]], ..p })
        .collect();
    let mut differs = [0; 3];
    for _ in 0..60 {
        let [few, more] = [rng.random_range(1..4), rng.random_range(1..3)];
        let mut drawn = || &pool[rng.random_range(0..pool.len())];
        let few: Vec<&Placement> = (0..few).map(|_| drawn()).collect();
        let more: Vec<&Placement> = few.iter().copied().chain((0..more).map(|_| drawn())).collect();
        let one = drawn();
        let sets =
            [few.clone(), [&few[..], &[one]].concat(), more.clone(), [&more[..], &[one]].concat()];
        let all: Vec<Placement> = sets.iter().map(|set| joined(set)).collect();
        let values: Vec<[f64; 3]> = scores(&problem, &all).iter().map(near_gains).collect();
        for k in 0..3 {
            let (beside_few, beside_more) =
                (values[1][k] - values[0][k], values[3][k] - values[2][k]);
            assert!(beside_more >= -1e-15, "level {k} falls by {beside_more}");
            assert!(beside_few >= beside_more - 1e-15, "level {k}: {beside_few}, {beside_more}");
            differs[k] += u32::from(beside_few > beside_more + 1e-6);
        }
    }
    assert!(differs.iter().all(|&differs| differs > 10), "{differs:?}");
}

/// The study counts bits of voxels, whatever they weigh: where all weigh the same it gives the score.
#[test]
fn the_study_of_redundancy_counts_the_same_voxels() {
    let own = Own::new(&description("residential"));
    let content = own.problem.content();
    let equal = |voxel: &OccupiedVoxel| OccupiedVoxel { entropy: [5, 5, 5, 7], ..*voxel };
    let occupied: Vec<OccupiedVoxel> = content.occupied().iter().map(equal).collect();
    let content = Content::new(vec![], occupied, &[], true);
    let problem = Arc::new((*own.problem).clone().with_content(content));
    let site = RedundancySite::new(&own.scene, problem.clone(), None);
    for placement in table_7().iter().take(3) {
        let question = redundancy_question(vec![]);
        let mut engine = CpuBackend::new(problem.task().clone(), MEMORY);
        let [none, one, two, three] =
            site.look(&mut engine, &question, placement).unwrap().occupied.by;
        assert!(two > 100.0 && three > 100.0, "{two} and {three} voxels");
        let all = none + one + two + three;
        let found = near_gains(&scores(&problem, std::slice::from_ref(placement))[0]);
        let want = [
            (one + two + three) / all,
            (one + 2.0 * (two + three)) / (2.0 * all),
            (one + 2.0 * two + 3.0 * three) / (3.0 * all),
        ];
        for (found, want) in found.iter().zip(want) {
            assert!((found - want).abs() < 1e-12, "{}: {found} is not {want}", placement.name);
        }
    }
}

/// A search over scenes and their mirror images, with frames on demand: its value is the weighted sum of the means of the
/// scores, it is compared by them, and no placement on the grid is above its bound.
#[test]
fn a_search_over_scenes_maximizes_the_weighted_sum() {
    let rules = Constraints {
        min_distance: 0.5,
        ..Constraints::in_box([-2.0, -2.0, -1.0, -0.3, 0.0, 0.0], [2.0, 2.0, 1.0, 0.3, 0.0, 0.0], 3)
    };
    let scene = |seed: u64| (format!("room {seed}"), mounted(&random_problem(seed, true), &rules));
    let suite = Suite::new([41, 51].map(scene)).unwrap().with_mirror_images();
    let lidars = [-1.0, 0.0, 1.0].map(|x| SensorPose::at(x, 0.0, 0.5)).to_vec();
    let baselines = vec![Placement { name: "row".into(), lidars }];
    for (text, [once, twice], gain) in [
        ("near_gain + 0.5*near_gain_2", [1.0, 0.5], Gain::Near),
        ("near_gain_2", [0.0, 1.0], Gain::NearTwice),
    ] {
        let engine = EngineChoice { memory: Some(1 << 28), ..EngineChoice::cpu() };
        let objective: Objective = text.parse().unwrap();
        let baselines = baselines.clone();
        let settings =
            Settings { evaluations: 60, objective, engine, baselines, ..Settings::default() };
        let on = &mut |_: &sightline::Event| true;
        let outcome = sightline::optimize(suite.clone(), &settings, on).unwrap();
        let best = outcome.best.unwrap();
        let placements = [&best, &outcome.baselines[0]].map(|scored| scored.placement.clone());
        let judged = Evaluator::suite_on_cpu(&suite, MEMORY).judged(&placements).unwrap();
        let value = |placement: usize, member: usize| {
            let [near, both, _] = near_gains(&judged[placement].by_scene[member].scores);
            once * near + twice * both
        };
        let [ours, theirs] =
            [0, 1].map(|p| (0..4).map(|member| value(p, member)).sum::<f64>() / 4.0);
        assert!((best.objective.unwrap() - ours).abs() < 1e-12, "{text}");
        assert!(ours > theirs, "{text}: the search finds nothing better than a row");
        let bound = outcome.certificate.unwrap().gain.expect("a bound");
        assert!(bound.upper >= bound.best.value && bound.upper < 1.5 * ours, "{bound:?}");
        let spread = outcome.spread.unwrap();
        assert_eq!(spread.gain, gain, "{text}");
        if once == 0.0 {
            assert!((spread.difference.mean - (ours - theirs)).abs() < 1e-12, "{}", spread.words);
        }
    }
}
