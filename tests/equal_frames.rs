//! Frames of the same geometry are cast once: with the sums of casting each.

use std::path::Path;

use lidar_cast::engine::ReferenceBackend;
use sightline::internals::{Atlas, Pilot, PoseGrid, Spacing, Union};
use sightline::problem::Tally;
use sightline::scan::scan_scene;
use sightline::scene::{EgoBody, PsogSource, Scene};
use sightline::score::Needed;
use sightline::vehicle::random_placements;

use crate::common::*;

/// The ego waits; the walker is in one of two places, so that frames 0, 1 and 3 are equal, and 2 and 4.
fn scene() -> Scene {
    let text = r#"{
        "sightline": 1, "name": "waiting",
        "roi": { "min": [-4, -3, 0], "max": [4, 3, 3], "voxel": [0.5, 0.5, 0.5] },
        "psog": { "scan": { "channels": 24, "fov": [-60, 40], "azimuth_steps": 120 } },
        "lidar": { "channels": 8, "fov": [-30, 10], "azimuth_steps": 60, "range": 20 },
        "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "lidars": 2 },
        "coverage": "first-hit", "frames": 5,
        "static": [
            { "class": "ground", "plane": { "min": [-4, -3], "max": [4, 3], "z": 0.1 } },
            { "class": "wall", "box": { "center": [3.9, 0, 1.5], "size": [0.2, 6, 3] } }],
        "actors": [
            { "name": "walker", "parts": [
                { "class": "pedestrian", "box": { "center": [0, 0, 0.9], "size": [0.5, 0.5, 1.8] } }],
              "poses": [{ "x": 2, "y": -1 }, { "x": 2, "y": -1 }, { "x": 2, "y": 1 },
                        { "x": 2, "y": -1 }, { "x": 2, "y": 1 }] }]
    }"#;
    Scene::from_json(text, Path::new(""), "waiting.json").unwrap()
}

/// One problem twice: as a scene poses it, and with a tree for every frame.
fn problems() -> [Arc<Problem>; 2] {
    let scene = scene();
    let bounds = scene.roi();
    let roi = Roi::from_bounds(bounds.min, bounds.max, bounds.voxel).unwrap();
    let PsogSource::Scan(settings) = scene.psog_source() else { panic!("a scan") };
    let (psog, _) = scan_scene(&scene, &roi, settings, |_| true).unwrap();
    let channels: Vec<(f64, f64)> = (0..8).map(|k| (-30.0 + 5.0 * f64::from(k), 0.0)).collect();
    let table = BeamTable::spinning(&channels, 60, 20.0).unwrap();
    let shared = Problem::from_scene(&scene, &psog, table.clone(), &[0, 1, 2, 3, 4]).unwrap();
    let tree = |t| Arc::new(Bvh::build(&scene.frame(t, EgoBody::Include), shared.far_range()));
    let content = shared.content().clone();
    let single =
        Problem::from(Task::new(roi, content, table, (0..5).map(tree).collect::<Vec<_>>(), true));
    [Arc::new(shared), Arc::new(single)]
}

fn placements() -> Vec<Placement> {
    let constraints =
        Constraints::in_box([-0.6, -0.6, 1.2, -0.3, -0.3, -3.0], [0.6, 0.6, 1.8, 0.3, 0.3, 3.0], 2);
    random_placements(&constraints, 9, 3)
}

#[test]
fn equal_frames_are_cast_once_with_the_same_sums() {
    let [shared, single] = problems();
    assert_eq!(shared.distinct_frames(), [(0, 3), (2, 2)]);
    assert_eq!(single.distinct_frames().len(), 5);
    assert_eq!((shared.modelled().frames, shared.modelled().distinct_frames), (5, 2));
    assert!(shared.bytes() < single.bytes());
    let (placements, range) = (placements(), 20.0);
    let want =
        ReferenceBackend::new(single.task().clone()).tally(&placements, Some(range)).unwrap();
    for mut backend in both(&shared) {
        assert_eq!(backend.tally(&placements, Some(range)).unwrap(), want, "{}", backend.name());
    }
    let pilot = Pilot::new(&(&shared).into(), placements.clone(), MEMORY, &mut |_| true);
    let pilot = pilot.unwrap().unwrap();
    let sums: Vec<Tally> = pilot.tallies().into_iter().flat_map(|(_, tally)| tally).collect();
    assert_eq!(sums, want);
    // Some of the frames: of those that are equal, as many as are named.
    let some = shared.over(&[1, 2, 3]);
    assert_eq!(some.distinct_frames(), [(0, 2), (1, 1)]);
}

#[test]
fn an_atlas_casts_equal_frames_once() {
    let [shared, single] = problems();
    let constraints =
        Constraints::in_box([-0.5, -0.5, 1.2, 0.0, 0.0, 0.0], [0.5, 0.5, 1.7, 0.0, 0.0, 0.0], 2);
    let grid = PoseGrid::new(&constraints, Spacing { metres: 0.5, radians: 0.3 }).unwrap();
    let tally = |problem: &Arc<Problem>| {
        let mut atlas = Atlas::new(problem.clone(), grid.clone(), Needed::all(true), MEMORY);
        let mut union = Union::default();
        atlas.hold(&mut *both(problem)[0], &[0, 7]).unwrap();
        atlas.union(&[0], &mut union);
        atlas.tally_with(&union, 7)
    };
    assert_eq!(tally(&shared), tally(&single));
    assert!(tally(&shared).entropy[0] > 0);
}
