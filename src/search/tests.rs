//! Scores in parts: the bits of scores at once, and no part more once it is told to stop.

use std::sync::Arc;

use super::evaluator::Evaluator;
use super::on_demand::FramesOnDemand;
use super::pilot::{Known, Pilot};
use super::settings::Settings;
use super::suite::Suite;
use crate::bvh::Bvh;
use crate::geom::TriangleSoup;
use crate::problem::{Content, OccupiedVoxel, Problem, Task};
use crate::psog::Roi;
use crate::vehicle::{BeamTable, Constraints, Placement, SensorPose};

/// Memory of an evaluator.
const MEMORY: u64 = 1 << 28;
/// Frames that differ, and those that are equal to the first.
const FRAMES: [usize; 2] = [70, 5];

/// A wall that stands elsewhere in each frame; beams end before the far voxels.
fn problem() -> Arc<Problem> {
    let roi = Roi::new([-6.0, -5.0, -2.0], [0.5; 3], [24, 20, 8]).unwrap();
    let channels: Vec<(f64, f64)> = (0..5).map(|k| (-20.0 + 10.0 * f64::from(k), 0.3)).collect();
    let table = BeamTable::spinning(&channels, 30, 5.0).unwrap();
    let tree = |frame: usize| {
        let x = 1.0 + 0.05 * frame as f32;
        let vertices = vec![[x, -4.0, -2.0], [x, 4.0, -2.0], [x, 0.0, 2.0]];
        let (faces, face_class) = (vec![[0, 1, 2]], vec![0]);
        Arc::new(Bvh::build(&TriangleSoup { vertices, faces, face_class }, 12.0))
    };
    let mut trees: Vec<Arc<Bvh>> = (0..FRAMES[0]).map(tree).collect();
    (0..FRAMES[1]).for_each(|_| trees.push(trees[0].clone()));
    let voxel = |index: u32| OccupiedVoxel { index, entropy: [1 + index % 7; 4] };
    let occupied: Vec<OccupiedVoxel> =
        (0..roi.voxel_count() as u32).step_by(3).map(voxel).collect();
    let content = Content::new(vec![], occupied, &[], false);
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
