//! The GPU against the CPU reference, bit by bit.

use sightline::engine::BackendError;
use sightline::engine::gpu::GpuBackend;

use crate::common::*;

#[test]
fn hits_coverage_and_tallies_are_the_same_bits() {
    for (seed, ends_at_hits) in [(21, true), (22, true), (23, false)] {
        let problem = random_problem(seed, ends_at_hits);
        let placements = random_placements(seed, 40, 5.0);
        let [mut cpu, mut gpu] = both(&problem);
        for placement in &placements[..8] {
            for frame in 0..2 {
                let hits = cpu.hits(&placement.lidars, frame).unwrap();
                let share = hits.iter().filter(|h| h.is_hit()).count() as f64 / hits.len() as f64;
                assert!(share > 0.2, "only {share} of the beams hit: the scene is trivial");
                assert_eq!(bits(&hits), bits(&gpu.hits(&placement.lidars, frame).unwrap()));
            }
            let frame = problem.frame_count() - 1;
            let covered = cpu.covered(placement, frame).unwrap();
            assert!(covered.len() > 50, "only {} voxels are covered", covered.len());
            assert_eq!(covered, gpu.covered(placement, frame).unwrap());
        }
        let range = problem.sensors().table(0).range();
        let tallies = cpu.tally(&placements, Some(range)).unwrap();
        assert!(tallies.iter().all(|t| t.entropy[0] > 0 && t.unique.iter().any(|&u| u > 0)));
        assert_eq!(tallies, gpu.tally(&placements, Some(range)).unwrap());
        // A shorter range is another answer, and again the same on both.
        let shorter = cpu.tally(&placements, Some(3.0)).unwrap();
        assert!(shorter.iter().zip(&tallies).all(|(s, t)| s.covered < t.covered));
        assert_eq!(shorter, gpu.tally(&placements, Some(3.0)).unwrap());
    }
}

#[test]
fn a_split_batch_is_the_whole_batch() {
    let problem = random_problem(31, true);
    let placements = random_placements(31, 50, 8.0);
    let range = problem.sensors().table(0).range();
    let whole = cpu(&problem).tally(&placements, Some(range)).unwrap();
    // Room for the buffers of five sensors at most: many chunks.
    let each = 4 * problem.roi().voxel_count().div_ceil(32) as usize
        + 64 * problem.sensors().table(0).directions().len();
    let mut small = GpuBackend::new(problem.task().clone(), None, 5 * each as u64 + 8192).unwrap();
    assert_eq!(small.tally(&placements, Some(range)).unwrap(), whole);
    let one_by_one: Vec<_> = placements
        .iter()
        .flat_map(|p| gpu(&problem).tally(std::slice::from_ref(p), Some(range)).unwrap())
        .take(3)
        .collect();
    assert_eq!(one_by_one, whole[..3]);
}

#[test]
fn a_budget_below_one_placement_is_an_error() {
    let problem = random_problem(32, true);
    let placements = random_placements(32, 4, 8.0);
    let mut tiny = GpuBackend::new(problem.task().clone(), None, 1000).unwrap();
    let error = tiny.tally(&placements, Some(12.0)).unwrap_err();
    assert!(matches!(error, BackendError::TooLarge { .. }), "{error}");
    assert!(error.to_string().contains("--memory"), "{error}");
}

/// One level sensor at the origin of a row of thin voxels.
fn one_sensor() -> Placement {
    let pose = SensorPose { x: 0.05, y: 0.05, z: 0.05, ..SensorPose::default() };
    Placement { name: "one".into(), lidars: vec![pose] }
}

#[test]
fn a_walk_longer_than_an_invocation_may_loop_is_whole() {
    // 200 000 voxels along x: more than the 65 535 loop steps that some drivers allow.
    let roi = Roi::new([0.0; 3], [0.1; 3], [200_000, 2, 2]).unwrap();
    let content = random_content(41, &roi);
    let table = BeamTable::spinning(&[(0.0, 0.0)], 3, 1e5).unwrap();
    let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![], false)));
    let [mut cpu, mut gpu] = both(&problem);
    let covered = gpu.covered(&one_sensor(), 0).unwrap();
    assert!(covered.len() >= 200_000, "only {} voxels are covered", covered.len());
    assert_eq!(covered, cpu.covered(&one_sensor(), 0).unwrap());
    let placements = [one_sensor()];
    assert_eq!(
        cpu.tally(&placements, Some(1e5)).unwrap(),
        gpu.tally(&placements, Some(1e5)).unwrap()
    );
}

#[test]
fn a_traversal_longer_than_an_invocation_may_loop_is_whole() {
    // 70 000 triangles one behind the other, the nearest last, none of which ends the ray early:
    // their boxes all begin at the origin.
    let mut soup = TriangleSoup::default();
    for face in 0..70_000_u32 {
        let far = 60.0 - face as f32 * 1e-4;
        soup.vertices.extend([[0.0, -50.0, -50.0], [far, 50.0, -50.0], [far, 50.0, 50.0]]);
        soup.faces.push([3 * face, 3 * face + 1, 3 * face + 2]);
        soup.face_class.push(0);
    }
    let roi = Roi::new([-1.0; 3], [0.5; 3], [80, 80, 80]).unwrap();
    let content = random_content(42, &roi);
    let table = BeamTable::spinning(&[(-1.0, 0.0), (1.0, 0.0)], 8, 100.0).unwrap();
    let frames = vec![Arc::new(Bvh::build(&soup, 100.0))];
    let problem = Arc::new(Problem::from(Task::new(roi, content, table, frames, true)));
    let [mut cpu, mut gpu] = both(&problem);
    let placement = one_sensor();
    let hits = cpu.hits(&placement.lidars, 0).unwrap();
    assert!(hits.iter().any(Hit::is_hit));
    assert_eq!(bits(&hits), bits(&gpu.hits(&placement.lidars, 0).unwrap()));
    let placements = [placement];
    assert_eq!(
        cpu.tally(&placements, Some(100.0)).unwrap(),
        gpu.tally(&placements, Some(100.0)).unwrap()
    );
}

#[test]
fn a_lost_device_is_an_error() {
    let problem = random_problem(51, true);
    let placements = random_placements(51, 4, 8.0);
    let mut backend = gpu(&problem);
    backend.tally(&placements, Some(12.0)).unwrap();
    backend.lose_device_after(0);
    let error = backend.tally(&placements, Some(12.0)).unwrap_err();
    assert!(matches!(error, BackendError::Device { .. }), "{error}");
    assert!(error.to_string().contains("--backend cpu"), "{error}");
}

#[test]
fn an_empty_frame_ends_no_beam() {
    let roi = Roi::new([-4.0; 3], [0.5; 3], [16, 16, 16]).unwrap();
    let content = random_content(61, &roi);
    let table = BeamTable::spinning(&[(0.0, 0.0), (5.0, 0.0)], 36, 20.0).unwrap();
    let empty = Arc::new(Bvh::build(&TriangleSoup::default(), 20.0));
    let full = Arc::new(Bvh::build(&random_soup(61, 50, 4.0), 20.0));
    let problem = Arc::new(Problem::from(Task::new(roi, content, table, vec![empty, full], true)));
    let [mut cpu, mut gpu] = both(&problem);
    let placements = random_placements(61, 5, 3.0);
    let tallies = cpu.tally(&placements, Some(20.0)).unwrap();
    assert_eq!(tallies, gpu.tally(&placements, Some(20.0)).unwrap());
    assert!(cpu.hits(&placements[0].lidars, 0).unwrap().iter().all(|hit| !hit.is_hit()));
}
