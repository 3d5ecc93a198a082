//! What must hold for every scene and placement.

use std::sync::Arc;

use rand::seq::SliceRandom;
use sightline::engine::Backend;
use sightline::problem::{Problem, Tally};
use sightline::psog::Roi;
use sightline::score::Scores;
use sightline::vehicle::{BeamTable, Placement, SensorPose};

use crate::common::{cpu, random_content, random_placements, random_problem, rng};

fn tally(problem: &Arc<Problem>, placement: &Placement, range: f32) -> Tally {
    cpu(problem).tally(std::slice::from_ref(placement), range).unwrap().remove(0)
}

#[test]
fn a_sensor_more_never_lowers_the_information() {
    for (seed, ends_at_hits) in [(71, true), (72, false)] {
        let problem = random_problem(seed, ends_at_hits);
        let range = problem.table().range();
        let mut grew = 0;
        for placement in random_placements(seed, 24, 6.0) {
            let mut before = Tally::default();
            for count in 1..=placement.lidars.len() {
                let part =
                    Placement { lidars: placement.lidars[..count].to_vec(), ..placement.clone() };
                let now = tally(&problem, &part, range);
                assert!((0..3).all(|kind| now.entropy[kind] >= before.entropy[kind]));
                assert!(now.covered >= before.covered);
                grew += u32::from(count > 1 && now.entropy[0] > before.entropy[0]);
                before = now;
            }
        }
        assert!(grew > 20, "only {grew} sensors added anything");
    }
}

#[test]
fn a_shorter_range_never_raises_the_information() {
    for (seed, ends_at_hits) in [(73, true), (74, false)] {
        let problem = random_problem(seed, ends_at_hits);
        for placement in random_placements(seed, 16, 6.0) {
            let gains = [1.0, 2.0, 4.0, 8.0, 12.0].map(|range| {
                let tally = tally(&problem, &placement, range);
                (tally.covered, tally.entropy[0], tally.hits)
            });
            assert!(gains.windows(2).all(|pair| pair[0].0 <= pair[1].0), "{gains:?}");
            assert!(gains.windows(2).all(|pair| pair[0].1 <= pair[1].1), "{gains:?}");
            assert!(gains.windows(2).all(|pair| pair[0].2 <= pair[1].2), "{gains:?}");
        }
    }
}

#[test]
fn the_order_of_sensors_changes_nothing() {
    let problem = random_problem(75, true);
    let mut rng = rng(75);
    for placement in random_placements(75, 24, 6.0) {
        let scores = |placement: &Placement| {
            let tally = tally(&problem, placement, 12.0);
            let mut scores =
                Scores::new("same", &tally, problem.content(), problem.frame_count(), true, None);
            scores.unique_share.sort_by(f64::total_cmp);
            scores.guards.clear();
            scores
        };
        let mut shuffled = placement.clone();
        shuffled.lidars.shuffle(&mut rng);
        assert_eq!(scores(&placement), scores(&shuffled));
    }
}

/// A grid that mirrors onto itself in y, and a fine sensor that turns onto itself.
fn symmetric_problem() -> Arc<Problem> {
    let roi = Roi::new([-20.0, -20.0, -1.0], [0.4, 0.4, 0.4], [100, 100, 10]).unwrap();
    let channels: Vec<(f64, f64)> = (0..12).map(|k| (-22.0 + 2.0 * f64::from(k), 0.0)).collect();
    let table = BeamTable::spinning(&channels, 180, 100.0).unwrap();
    let content = random_content(76, &roi);
    Arc::new(Problem::new(roi, content, table, vec![], false))
}

/// Voxels in one set only, as a share of all.
fn unlike(ours: &[u64], theirs: &[u64]) -> f64 {
    let shared = ours.iter().filter(|v| theirs.binary_search(v).is_ok()).count();
    let either = ours.len() + theirs.len() - shared;
    (either - shared) as f64 / either as f64
}

fn single(pose: SensorPose) -> Placement {
    Placement { name: "single".into(), lidars: vec![pose] }
}

#[test]
fn a_turn_by_one_azimuth_step_changes_nothing() {
    let problem = symmetric_problem();
    for (x, y, z) in [(0.1, -0.3, 2.31), (1.7, 0.45, 1.93)] {
        let pose = SensorPose { x, y, z, roll: 0.0, pitch: 0.0, yaw: 0.0 };
        let turned = SensorPose { yaw: std::f64::consts::TAU / 180.0, ..pose };
        let covered = |pose| cpu(&problem).covered(&single(pose), 0).unwrap();
        let (straight, turned) = (covered(pose), covered(turned));
        assert!(straight.len() > 10_000);
        // Rounding moves beams by micrometres: a voxel clipped by less may change.
        let share = unlike(&straight, &turned);
        assert!(share < 1e-3, "{share}");
    }
}

#[test]
fn a_mirror_image_covers_the_mirrored_voxels() {
    let problem = symmetric_problem();
    let roi = problem.roi();
    let pose = SensorPose { x: 0.37, y: 0.61, z: 2.13, roll: 0.21, pitch: -0.1, yaw: 0.4 };
    let mirrored = SensorPose { y: -pose.y, roll: -pose.roll, yaw: -pose.yaw, ..pose };
    let covered = |pose| cpu(&problem).covered(&single(pose), 0).unwrap();
    let mut flipped: Vec<u64> = covered(mirrored)
        .into_iter()
        .map(|voxel| {
            let [i, j, k] = roi.coords(voxel);
            roi.linear([i, 99 - j, k])
        })
        .collect();
    flipped.sort_unstable();
    let share = unlike(&covered(pose), &flipped);
    assert!(share < 1e-3, "{share}");
}
