//! Sums from the pose atlas against those of a backend.

use lidar_cast::cover::BitOrder;
use lidar_cast::engine::ReferenceBackend;
use lidar_cast::task::{KINDS, REPEATS};
use sightline::engine::gpu::GpuBackend;
use sightline::internals::{Atlas, PoseGrid, Spacing, Union};
use sightline::problem::Tally;
use sightline::score::Needed;

use crate::common::*;

fn grid() -> PoseGrid {
    let constraints =
        Constraints::in_box([-0.5, -0.5, 0.0, -0.3, 0.0, 0.0], [0.5, 0.5, 0.5, 0.3, 0.0, 0.0], 3);
    PoseGrid::new(&constraints, Spacing { metres: 0.5, radians: 0.3 }).unwrap()
}

/// Two frames, 40 × 36 × 23 voxels: not a whole number of words.
fn problem(content: impl FnOnce(&Roi) -> Content) -> Arc<Problem> {
    let roi = Roi::new([-10.0, -9.0, -2.0], [0.5; 3], [40, 36, 23]).unwrap();
    let channels: Vec<(f64, f64)> = (0..12).map(|k| (-30.0 + 4.0 * f64::from(k), 0.0)).collect();
    let table = BeamTable::spinning(&channels, 90, 30.0).unwrap();
    let frames = [3, 4].map(|seed| Arc::new(Bvh::build(&random_soup(seed, 60, 9.0), 30.0)));
    Arc::new(Problem::from(Task::new(roi, content(&roi), table, frames.to_vec(), true)))
}

/// Occupied voxels of seven worths only, one of them zero.
fn few_worths(roi: &Roi) -> Content {
    let occupied = (0..roi.voxel_count() as u32).step_by(3);
    let worth = |index: u32| (index % 7) << 26;
    let occupied = occupied
        .map(|index| OccupiedVoxel { index, entropy: [worth(index), index % 2, 5, 7 * index] });
    Content::new(vec!["a".into()], occupied.collect(), &[vec![]], true)
}

fn sums(tally: &Tally) -> (u64, u64, [u64; KINDS], [u64; REPEATS]) {
    (tally.covered, tally.covered_nonzero, tally.entropy, tally.near_repeated)
}

#[test]
fn a_union_has_the_sums_of_the_backend() {
    let contents: [fn(&Roi) -> Content; 2] = [|roi| random_content(5, roi), few_worths];
    for content in contents {
        let problem = problem(content);
        let range = problem.sensors().table(0).range();
        let mut cpu = CpuBackend::new(problem.task().clone(), MEMORY);
        let mut gpu = GpuBackend::new(problem.task().clone(), None, MEMORY).unwrap();
        let mut from_gpu = Atlas::new(problem.clone(), grid(), Needed::all(true), MEMORY);
        let mut from_cpu = Atlas::new(problem.clone(), grid(), Needed::all(true), MEMORY);
        let mut lean = Atlas::new(problem, grid(), Needed::all(false), MEMORY);
        for poses in [vec![0], vec![1, 1], vec![7, 3, 40], vec![53, 26, 9, 12, 30]] {
            let lidars = poses.iter().map(|&pose| grid().pose(pose)).collect();
            let placement = Placement { name: "x".into(), lidars };
            let want = cpu.tally(&[placement], Some(range)).unwrap().remove(0);
            let (last, others) = poses.split_last().unwrap();
            let mut union = Union::default();
            from_cpu.hold(&mut cpu, &poses).unwrap();
            from_cpu.union(others, &mut union);
            assert_eq!(sums(&from_cpu.tally_with(&union, *last)), sums(&want), "{poses:?}");
            from_gpu.hold(&mut gpu, &poses).unwrap();
            from_gpu.union(others, &mut union);
            assert_eq!(sums(&from_gpu.tally_with(&union, *last)), sums(&want), "{poses:?}");
            lean.hold(&mut cpu, &poses).unwrap();
            lean.union(others, &mut union);
            let got = lean.tally_with(&union, *last);
            assert_eq!(got.entropy, want.entropy, "{poses:?}");
            assert_eq!(got.covered_nonzero, want.covered_nonzero, "{poses:?}");
        }
    }
}

#[test]
fn another_engine_may_take_over_between_poses() {
    let problem = problem(few_worths);
    let range = problem.sensors().table(0).range();
    let mut reference = ReferenceBackend::new(problem.task().clone());
    let mut cpu = CpuBackend::new(problem.task().clone(), MEMORY);
    assert_ne!(BitOrder::rows(problem.roi()), BitOrder::linear(problem.roi()));
    let mut atlas = Atlas::new(problem.clone(), grid(), Needed::all(true), MEMORY);
    atlas.hold(&mut cpu, &[7, 3]).unwrap();
    atlas.hold(&mut reference, &[40, 9]).unwrap();
    atlas.hold(&mut cpu, &[12]).unwrap();
    let mut union = Union::default();
    atlas.union(&[7, 40, 12, 9], &mut union);
    let lidars = [7, 40, 12, 9, 3].map(|pose| grid().pose(pose)).to_vec();
    let want = cpu.tally(&[Placement { name: "x".into(), lidars }], Some(range)).unwrap().remove(0);
    assert_eq!(sums(&atlas.tally_with(&union, 3)), sums(&want));
}

#[test]
fn memory_is_bounded_and_what_was_used_last_stays() {
    let problem = problem(few_worths);
    let mut cpu = CpuBackend::new(problem.task().clone(), MEMORY);
    let mut atlas = Atlas::new(problem, grid(), Needed::all(true), 0);
    let capacity = atlas.capacity() as u32;
    assert_eq!(capacity, 16, "room for one placement");
    atlas.hold(&mut cpu, &(0..capacity).collect::<Vec<_>>()).unwrap();
    atlas.hold(&mut cpu, &[0, 1]).unwrap();
    assert_eq!(atlas.poses_cast(), 16);
    // Everything but 0 and 1 was used longer ago.
    atlas.hold(&mut cpu, &(20..34).collect::<Vec<_>>()).unwrap();
    atlas.hold(&mut cpu, &[0, 1]).unwrap();
    assert_eq!(atlas.poses_cast(), 30, "0 and 1 were still there");
    let error = atlas.hold(&mut cpu, &(0..17).collect::<Vec<_>>()).unwrap_err();
    assert!(error.to_string().contains("the pose atlas"), "{error}");
}

#[test]
fn a_search_along_a_grid_forgets_poses_and_casts_them_again() {
    let problem = problem(few_worths);
    let range = problem.sensors().table(0).range();
    let mut cpu = CpuBackend::new(problem.task().clone(), MEMORY);
    let mut atlas = Atlas::new(problem, grid(), Needed::all(true), MEMORY);
    atlas.forget_beyond(4, 1 << 40);
    (0..10).for_each(|pose| atlas.hold(&mut cpu, &[pose]).unwrap());
    assert_eq!(atlas.held(), 10, "few bytes");
    atlas.forget_beyond(4, 0);
    atlas.hold(&mut cpu, &[20]).unwrap();
    assert_eq!(atlas.held(), 4, "7, 8, 9 and 20");
    // Poses asked for at once stay, and poses that come back count once.
    let poses = [0, 1, 2, 3, 9];
    atlas.hold(&mut cpu, &poses).unwrap();
    assert_eq!((atlas.held(), atlas.poses_cast()), (5, 11));
    let mut union = Union::default();
    atlas.union(&poses[1..], &mut union);
    let lidars = poses.map(|pose| grid().pose(pose)).to_vec();
    let want = cpu.tally(&[Placement { name: "x".into(), lidars }], Some(range)).unwrap().remove(0);
    assert_eq!(sums(&atlas.tally_with(&union, 0)), sums(&want));
}
