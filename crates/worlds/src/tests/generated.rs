//! Promises of each generated kind of world, for several seeds.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use glam::DVec2;

use super::*;
use crate::{WorldKind, generate};
use sightline_scene::scene::EgoBody;

/// Classes that every world of a kind has, and metres that its ego drives in 40 frames.
fn promised(kind: WorldKind) -> (&'static [&'static str], f64) {
    match kind {
        WorldKind::Street => (
            &[
                "building", "pole", "road_line", "road", "sidewalk", "vegetation", "vehicle",
                "pedestrian", "terrain", "traffic_sign", "static",
            ],
            15.0,
        ),
        WorldKind::Highway => (
            &[
                "road", "road_line", "guard_rail", "bridge", "vegetation", "vehicle", "pole",
                "traffic_sign", "terrain", "wall",
            ],
            40.0,
        ),
        WorldKind::Residential => (
            &[
                "building", "fence", "pole", "road", "sidewalk", "vegetation", "vehicle",
                "pedestrian", "terrain",
            ],
            9.0,
        ),
        WorldKind::Yard => (
            &["building", "road", "ground", "vehicle", "rail_track", "static", "other", "pole"],
            5.0,
        ),
        WorldKind::Town => (
            &[
                "building", "pole", "road_line", "road", "sidewalk", "vegetation", "vehicle",
                "pedestrian", "traffic_light", "terrain",
            ],
            10.0,
        ),
    }
}

/// Worlds of every kind, made once for all tests.
static WORLDS: LazyLock<Vec<(WorldKind, u64, GeneratedWorld)>> = LazyLock::new(|| {
    let seeds = WorldKind::ALL.into_iter().flat_map(|kind| (1..=4).map(move |seed| (kind, seed)));
    seeds.map(|(kind, seed)| (kind, seed, generate(kind, seed, 40).unwrap())).collect()
});

fn each(check: impl Fn(WorldKind, u64, &GeneratedWorld)) {
    WORLDS.iter().for_each(|(kind, seed, world)| check(*kind, *seed, world));
}

#[test]
fn every_kind_has_its_classes_and_its_ego_drives_on_the_road() {
    each(|kind, seed, world| {
        let name = format!("{} {seed}", kind.name());
        let scene = read_back(world);
        assert_eq!((scene.frame_count(), scene.rate()), (40, 10.0), "{name}");
        let (classes, way) = promised(kind);
        let soup = scene.frame(0, EgoBody::Exclude);
        let found: BTreeSet<&str> =
            soup.face_class.iter().map(|c| DEFAULT_CLASSES[usize::from(*c)]).collect();
        for class in classes {
            assert!(found.contains(class), "{name} has no {class}");
        }
        let driven = scene.ego_pose(39).translation.distance(scene.ego_pose(0).translation);
        assert!(driven > way, "{name}: the ego drives {driven} m");
        ego_stands_on_the_road(world, &scene, 0.03, &name);
    });
}

#[test]
fn traffic_moves_without_a_touch_and_nothing_stands_on_the_road() {
    each(|kind, seed, world| {
        let name = format!("{} {seed}", kind.name());
        let scene = read_back(world);
        let kinds: BTreeSet<&str> = scene.tracks().iter().map(|t| t.kind.name()).collect();
        assert!(kinds.len() >= 2, "{name}: only {kinds:?}");
        let moves = (0..scene.tracks().len()).filter(|&a| {
            let [first, last] = [0, 39].map(|t| scene.actor_glide(a, t).at(0.0).translation);
            first.distance(last) > 1.0
        });
        let moving = moves.count();
        assert!(moving >= 3, "{name}: {moving} of {} move", world.people.actors.len());
        nobody_runs_into_another(&scene, &name);
        nothing_stands_on_the_road(world, &name);
    });
}

#[test]
fn seeds_lay_out_worlds_anew_and_repeat_themselves() {
    for kind in WorldKind::ALL {
        let [a, again, b] = [3, 3, 4].map(|seed| generate(kind, seed, 12).unwrap());
        assert_eq!(a.mesh(), again.mesh(), "{}", kind.name());
        assert_eq!(a.scene("w", "w.ply"), again.scene("w", "w.ply"), "{}", kind.name());
        // Counts lane points of world `a` within one metre of a lane point of world `b`.
        let points = |w: &GeneratedWorld| -> Vec<DVec2> {
            let lanes = w.network.lanes.iter().flat_map(|lane| lane.centre.points());
            lanes.map(|point| point.truncate()).collect()
        };
        let (mine, others) = (points(&a), points(&b));
        let near = |p: &DVec2| others.iter().any(|q| q.distance(*p) < 1.0);
        let same = mine.iter().filter(|p| near(p)).count();
        assert!(3 * same < mine.len(), "{}: {same} of {} points", kind.name(), mine.len());
    }
}
