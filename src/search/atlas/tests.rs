//! Pages in a store that is not to be trusted.

use std::fs;

use super::*;
use crate::engine::CpuBackend;
use crate::problem::{Content, OccupiedVoxel};
use crate::psog::Roi;
use crate::vehicle::{BeamTable, Constraints, Spacing};

const MEMORY: u64 = 1 << 24;

fn problem() -> Arc<Problem> {
    let roi = Roi::new([-4.0; 3], [0.5; 3], [16; 3]).unwrap();
    let occupied = (0..roi.voxel_count() as u32).step_by(3);
    let occupied = occupied.map(|index| OccupiedVoxel { index, entropy: [index % 7, 1, 1] });
    let content = Content::new(vec!["a".into()], occupied.collect(), &[vec![]], true);
    let channels = [(-10.0, 0.0), (0.0, 0.0), (10.0, 0.0)];
    let table = BeamTable::spinning(&channels, 60, 5.0).unwrap();
    Arc::new(Problem::new(roi, content, table, vec![], false))
}

fn atlas(problem: &Arc<Problem>, store: &Arc<PageStore>) -> Atlas {
    let constraints = Constraints {
        lower: [-1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        upper: [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        min_distance: 0.0,
        lidars: 1,
        ..Constraints::default()
    };
    let grid = PoseGrid::new(&constraints, Spacing { metres: 0.5, radians: 1.0 }).unwrap();
    let mut atlas = Atlas::new(problem.clone(), grid, true, MEMORY);
    atlas.keep_in(store.clone());
    atlas
}

#[test]
fn a_sound_file_that_is_not_what_the_pose_covers_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let store = Arc::new(PageStore::open(folder.path(), MEMORY).unwrap());
    let problem = problem();
    let mut backend = CpuBackend::new(problem.clone(), MEMORY);
    let mut first = atlas(&problem, &store);
    first.hold(&mut backend, &[0, 1]).unwrap();
    assert!(first.page(0).iter().any(|&word| word != 0) && first.page(0) != first.page(1));
    let key = PageKey::new(&hash_of(&problem, first.all_words), &first.grid.pose(0));
    store.write(&key, first.page(1));

    let mut second = atlas(&problem, &store);
    second.hold(&mut backend, &[0, 1]).unwrap();
    assert_eq!(second.page(0), first.page(0));
    assert_eq!(store.report().spoilt, 1);
    let mut third = atlas(&problem, &store);
    third.hold(&mut backend, &[0, 1]).unwrap();
    assert_eq!(third.page(0), first.page(0));
    assert_eq!(store.report().spoilt, 1, "it was written anew");
}

#[test]
fn only_pages_are_dropped() {
    let folder = tempfile::tempdir().unwrap();
    let foreign = folder.path().join("notes.page");
    fs::write(&foreign, [0; 4096]).unwrap();
    let store = Arc::new(PageStore::open(folder.path(), 1).unwrap());
    let problem = problem();
    let mut backend = CpuBackend::new(problem.clone(), MEMORY);
    atlas(&problem, &store).hold(&mut backend, &[0, 1, 2]).unwrap();
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().path()).collect();
    assert_eq!(left, [foreign], "no page fits into one byte");
    assert_eq!(store.report(), StoreReport { written: 3, ..StoreReport::default() });
}
