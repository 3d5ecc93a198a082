//! The fast CPU stages against the reference that is written to be read: hits, voxels and sums.

use lidar_cast::cast::{Caster, cast_frame_closest};
use lidar_cast::cover::{BitOrder, WalkScratch, cover_sensor, cover_voxels};
use lidar_cast::reduce::reduce;
use lidar_cast::task::DevicePose;
use sightline::geom::Pose;
use sightline::internals::hostile_placements;
use sightline::scene::{EgoBody, Scene};
use sightline::vehicle::random_placements as scattered;

use crate::common::*;

/// Compares all stages of the backend with the reference; returns the voxels covered.
fn compare(problem: &Arc<Problem>, placements: &[Placement], range: f32) -> u64 {
    let (table, roi) = (problem.sensors().table(0), problem.roi());
    let (rows, linear) = (BitOrder::rows(roi), BitOrder::linear(roi));
    let words = linear.words();
    let poses: Vec<DevicePose> = placements
        .iter()
        .flat_map(|p| &p.lidars)
        .map(|l| DevicePose::new(&l.ego_from_sensor(), roi))
        .collect();
    let lidars = placements.iter().flat_map(|p| &p.lidars);
    let sensors: Vec<Pose> = lidars.map(|l| l.ego_from_sensor()).collect();
    let mut want = Vec::new();
    for frame in 0..problem.frame_count() {
        let geometry = problem.geometry(frame).filter(|_| problem.ends_at_hits());
        let hits = geometry.map(|frame| cast_frame_closest(&sensors, table, frame, range));
        if let (Some(frame), Some(hits)) = (geometry, &hits) {
            // Hits of before must not shine through.
            let mut fast = vec![Hit { t: f32::NAN, prim: 77 }; 5000];
            Caster::new(table).cast_frame(&sensors, frame, range, &mut fast);
            assert!(fast.iter().zip(hits).all(|(a, b)| a.t.to_bits() == b.t.to_bits()));
            assert!(fast.iter().zip(hits).all(|(a, b)| a.prim == b.prim));
        }
        let mut bitmaps = Vec::new();
        cover_voxels(&poses, table, roi, hits.as_deref(), range, &mut bitmaps);
        let (mut scratch, beams) = (WalkScratch::default(), table.directions());
        for (index, pose) in poses.iter().enumerate() {
            let own = hits.as_ref().map(|h| &h[index * beams.len()..(index + 1) * beams.len()]);
            let mut bitmap = vec![0; rows.words()];
            cover_sensor(pose, beams, roi, own, range, &mut scratch, &mut bitmap);
            let bitmap = rows.convert(&bitmap, &linear);
            assert!(*bitmap == bitmaps[index * words..(index + 1) * words], "sensor {index}");
        }
        let mut first = 0;
        let sum_of = |placement: &Placement| {
            let sensors = first..first + placement.lidars.len();
            first = sensors.end;
            let own = &bitmaps[sensors.start * words..sensors.end * words];
            let mut sum = reduce(sensors.len(), problem.content(), own);
            sum.beams = (sensors.len() * beams.len()) as u64;
            let own = hits
                .iter()
                .flat_map(|h| &h[sensors.start * beams.len()..sensors.end * beams.len()]);
            sum.hits = own.filter(|hit| hit.is_hit()).count() as u64;
            sum
        };
        let sums: Vec<_> = placements.iter().map(sum_of).collect();
        if want.is_empty() {
            want = sums;
        } else {
            want.iter_mut().zip(&sums).for_each(|(sum, tally)| *sum += tally);
        }
    }
    let mut backend = CpuBackend::new(problem.task().clone(), MEMORY);
    assert_eq!(backend.tally(placements, Some(range)).unwrap(), want);
    // Again with the working memory of the first time, and one by one.
    assert_eq!(backend.tally(placements, Some(range)).unwrap(), want);
    for (placement, want) in placements.iter().zip(&want).take(3) {
        let got = backend.tally(std::slice::from_ref(placement), Some(range)).unwrap();
        assert_eq!(&got[0], want);
    }
    want.iter().map(|tally| tally.covered).sum()
}

#[test]
fn random_problems_have_the_reference_s_bits() {
    for (seed, ends_at_hits) in [(51, true), (52, false)] {
        let problem = random_problem(seed, ends_at_hits);
        let placements = random_placements(seed, 60, 6.0);
        assert!(compare(&problem, &placements, 12.0) > 10_000);
        assert!(compare(&problem, &placements, 0.4) > 100);
    }
}

#[test]
fn hostile_poses_have_the_reference_s_bits() {
    let problem = random_problem(53, true);
    assert!(compare(&problem, &hostile_placements(problem.roi(), 56, 1), 12.0) > 1000);
    // Sensors on voxel faces of a grid with cubes, beams along the axes and into the corners.
    let roi = Roi::new([-4.0; 3], [0.5; 3], [16; 3]).unwrap();
    let channels = [(-90.0, 0.0), (-45.0, 0.0), (0.0, 0.0), (45.0, 0.0), (90.0, 0.0)];
    let table = BeamTable::spinning(&channels, 8, 20.0).unwrap();
    let problem =
        Arc::new(Problem::from(Task::new(roi, random_content(54, &roi), table, vec![], false)));
    assert!(compare(&problem, &hostile_placements(&roi, 56, 2), 20.0) > 1000);
}

#[test]
fn grids_of_any_shape_have_the_reference_s_bits() {
    // Words of 32 voxels begun and ended anywhere, diagonals through all corners; one voxel thin, so
    // that rows would be empty; too long for planes to be told apart by slopes.
    let channels = [(-90.0, 0.0), (-45.0, 0.0), (-20.0, 0.1), (0.0, 0.0), (3.0, 0.0), (60.0, 0.2)];
    let table = BeamTable::spinning(&channels, 24, 60.0).unwrap();
    for (seed, shape) in
        [[70, 41, 35], [41, 70, 35], [1, 1, 300_000], [33_000, 3, 2]].iter().enumerate()
    {
        let low = shape.map(|n| -0.25 * f64::from(n.min(100)));
        let roi = Roi::new(low, [0.5; 3], *shape).unwrap();
        let seed = 57 + seed as u64;
        let bvh = Arc::new(Bvh::build(&random_soup(seed, 40, 20.0), 60.0));
        let content = random_content(seed, &roi);
        let problem =
            Arc::new(Problem::from(Task::new(roi, content, table.clone(), vec![bvh], true)));
        let mut placements = hostile_placements(&roi, 21, 2);
        placements.extend(random_placements(seed, 12, 0.4 * f64::from(shape[1].min(20))));
        assert!(compare(&problem, &placements, 60.0) > 100, "{shape:?}");
    }
}

#[test]
fn long_beams_have_the_reference_s_bits() {
    // Far from the sensor, where crossings that are computed from slopes are least exact.
    for (axis, low) in [(0, -10.0), (0, -16_300.0), (1, -10.0), (1, -16_300.0)] {
        let (mut shape, mut min) = ([24, 24, 9], [-6.0, -6.0, -2.0]);
        (shape[axis], min[axis]) = (32_700, low);
        let roi = Roi::new(min, [0.5; 3], shape).unwrap();
        let directions = (0..600).map(|k| {
            let turn = f64::from(k) * 2.399_963;
            let slope = 1e-3 * f64::from(k) / 600.0;
            let mut direction =
                DVec3::new(slope * turn.cos(), slope * turn.cos(), slope * turn.sin());
            direction[axis] = if low > -100.0 { 1.0 } else { -1.0 };
            direction.normalize()
        });
        let table = BeamTable::from_directions(directions, 2e4).unwrap();
        let content = random_content(61, &roi);
        let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![], false)));
        let mut placements = random_placements(62, 3, 1.5);
        for lidar in placements.iter_mut().flat_map(|p| &mut p.lidars) {
            (lidar.roll, lidar.pitch, lidar.yaw) = (0.0, 0.0, 0.0);
        }
        assert!(compare(&problem, &placements, 2e4) > 1_000_000);
    }
}

#[test]
fn own_scenes_have_the_reference_s_bits() {
    let scenes = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let mut compared = 0;
    for entry in std::fs::read_dir(scenes).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|e| e != "json") || path.ends_with("placements.json") {
            continue;
        }
        let scene = Scene::read(&path).unwrap();
        let (bounds, constraints) = (scene.roi(), scene.constraints());
        let roi = Roi::from_bounds(bounds.min, bounds.max, [0.5; 3]).unwrap();
        let channels: Vec<_> = (0..16).map(|k| (-24.8 + 1.7 * f64::from(k), 0.0)).collect();
        let table = BeamTable::spinning(&channels, 90, 100.0).unwrap();
        let bvh = Arc::new(Bvh::build(&scene.frame(0, EgoBody::Include), 100.0));
        let content = random_content(55, &roi);
        let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![bvh], true)));
        // Nine of them are level, so that their directions are equal.
        let mut placements = scattered(&constraints, 14, 1);
        for lidar in placements.iter_mut().take(9).flat_map(|p| &mut p.lidars) {
            (lidar.roll, lidar.pitch, lidar.yaw) = (0.0, 0.0, 0.0);
        }
        placements.extend(hostile_placements(&roi, 7, 2));
        assert!(compare(&problem, &placements, 100.0) > 10_000, "{}", scene.name());
        compared += 1;
    }
    assert!(compared >= 4, "only {compared} scenes");
}
