//! Worlds: read back, driven through, compared.

mod map_parts;
mod opendrive;

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::LazyLock;

use glam::{DVec2, DVec3};
use tempfile::TempDir;

use super::{GeneratedWorld, WorldKind, generate, write_ply};
use lidar_cast::geom::Pose;
use sightline_scene::scene::{DEFAULT_CLASSES, EgoBody, Scene};

/// A map of a road that forks: two lines and two arcs, one of them rising.
fn fork() -> String {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/fork.xodr");
    std::fs::read_to_string(file).unwrap()
}

/// Writes a world to a folder and reads it as any scene.
fn read_back(world: &GeneratedWorld) -> Scene {
    let dir = TempDir::new().unwrap();
    write_to(world, dir.path());
    Scene::read(dir.path().join("w.json")).unwrap()
}

fn write_to(world: &GeneratedWorld, dir: &Path) {
    let mut file = BufWriter::new(File::create(dir.join("w.ply")).unwrap());
    write_ply(world.mesh(), &mut file).unwrap();
    file.flush().unwrap();
    std::fs::write(dir.join("w.json"), world.scene("w", "w.ply").to_string()).unwrap();
}

fn corners(world: &GeneratedWorld, face: usize) -> [DVec3; 3] {
    world.mesh().faces[face].map(|v| DVec3::from(world.mesh().vertices[v as usize].map(f64::from)))
}

/// Height of a triangle over a place in plan.
fn height_over([a, b, c]: [DVec3; 3], p: DVec2) -> Option<f64> {
    let area = (b - a).truncate().perp_dot((c - a).truncate());
    let u = (b - p.extend(0.0)).truncate().perp_dot((c - p.extend(0.0)).truncate()) / area;
    let v = (c - p.extend(0.0)).truncate().perp_dot((a - p.extend(0.0)).truncate()) / area;
    let inside = u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9;
    inside.then_some(a.z * u + b.z * v + c.z * (1.0 - u - v))
}

/// Class and height of the first surface below each place, by trying every triangle.
fn below(world: &GeneratedWorld, places: &[DVec3]) -> Vec<Option<(&'static str, f64)>> {
    let mut found: Vec<Option<(&str, f64)>> = vec![None; places.len()];
    for face in 0..world.mesh().faces.len() {
        let triangle = corners(world, face);
        let low = triangle.iter().fold(triangle[0], |m, p| m.min(*p)).truncate();
        let high = triangle.iter().fold(triangle[0], |m, p| m.max(*p)).truncate();
        for (place, found) in places.iter().zip(&mut found) {
            let p = place.truncate();
            if p.cmplt(low).any() || p.cmpgt(high).any() {
                continue;
            }
            let Some(z) = height_over(triangle, p) else { continue };
            if z <= place.z && found.is_none_or(|(_, best)| z > best) {
                let class = world.mesh().face_class[face];
                *found = Some((DEFAULT_CLASSES[usize::from(class)], z));
            }
        }
    }
    found
}

/// Checks that the ego's middle stands on the road in every fifth frame, within `tolerance` metres.
fn ego_stands_on_the_road(world: &GeneratedWorld, scene: &Scene, tolerance: f64, name: &str) {
    let frames = (0..scene.frame_count()).step_by(5);
    let places: Vec<DVec3> = frames.map(|t| scene.ego_pose(t).translation).collect();
    let raised: Vec<DVec3> = places.iter().map(|p| *p + DVec3::Z * 0.5).collect();
    for (place, found) in places.iter().zip(below(world, &raised)) {
        let (class, z) = found.unwrap_or_else(|| panic!("{name}: nothing below {place}"));
        assert!(["road", "road_line"].contains(&class), "{name}: {class} below {place}");
        assert!((z - place.z).abs() < tolerance, "{name}: road at {z} below {place}");
    }
}

/// Checks that no point of a grid on one box lies in another, in every frame.
fn nobody_runs_into_another(scene: &Scene, name: &str) {
    let ego = (DVec3::new(4.5, 1.8, 1.5), DVec3::Z * 0.75);
    let mut sizes: Vec<(DVec3, DVec3)> =
        scene.tracks().iter().map(|t| (t.size, t.center)).collect();
    sizes.push(ego);
    let poses = |t: usize| -> Vec<Pose> {
        let actors = (0..sizes.len() - 1).map(|a| scene.actor_glide(a, t).at(0.0));
        actors.chain([scene.ego_pose(t)]).collect()
    };
    for t in 0..scene.frame_count() {
        let poses = poses(t);
        for (i, a) in poses.iter().enumerate() {
            for (j, b) in poses.iter().enumerate() {
                let reach = 0.5 * (sizes[i].0.length() + sizes[j].0.length());
                if i == j || a.translation.distance(b.translation) > reach {
                    continue;
                }
                let from_a = b.inverse().compose(a);
                let inside = grid(sizes[i]).any(|p| {
                    let q = from_a.apply(p) - sizes[j].1;
                    q.abs().cmplt(0.5 * sizes[j].0 - 0.01).all()
                });
                assert!(!inside, "{name}: {i} and {j} overlap in frame {t}");
            }
        }
    }
}

/// Points of a box: 21 × 9 in plan, at half its height.
fn grid((size, center): (DVec3, DVec3)) -> impl Iterator<Item = DVec3> {
    (0..=20).flat_map(move |i| {
        (0..=8).map(move |j| {
            let share = DVec3::new(f64::from(i) / 20.0 - 0.5, f64::from(j) / 8.0 - 0.5, 0.0);
            center + size * share
        })
    })
}

/// Checks that houses and trunks stand clear of the road.
fn nothing_stands_on_the_road(world: &GeneratedWorld, name: &str) {
    let houses = world.houses().iter().flat_map(|c| {
        let middle = (c[0] + c[1] + c[2] + c[3]) * 0.25;
        // Edges a metre apart, so that no lane passes between two points.
        let edges = (0..4).flat_map(move |k| {
            let steps = c[k].distance(c[(k + 1) % 4]).ceil() as u32;
            (0..steps).map(move |s| c[k].lerp(c[(k + 1) % 4], f64::from(s) / f64::from(steps)))
        });
        edges.chain([middle])
    });
    let places: Vec<DVec2> = houses.chain(world.trees().iter().copied()).collect();
    assert!(!places.is_empty(), "{name}: neither house nor tree");
    let cell = |p: DVec2| [(p.x / 8.0).floor() as i64, (p.y / 8.0).floor() as i64];
    let mut by_cell = std::collections::HashMap::<[i64; 2], Vec<DVec2>>::new();
    places.iter().for_each(|p| by_cell.entry(cell(*p)).or_default().push(*p));
    for face in 0..world.mesh().faces.len() {
        if world.mesh().face_class[face] != crate::network::class::ROAD {
            continue;
        }
        let triangle = corners(world, face);
        let low = triangle.iter().fold(triangle[0], |m, p| m.min(*p)).truncate();
        let high = triangle.iter().fold(triangle[0], |m, p| m.max(*p)).truncate();
        let ([i0, j0], [i1, j1]) = (cell(low), cell(high));
        for key in (i0..=i1).flat_map(|i| (j0..=j1).map(move |j| [i, j])) {
            for p in by_cell.get(&key).into_iter().flatten() {
                let over = height_over(triangle, *p);
                assert!(over.is_none(), "{name}: something on the road at {p}");
            }
        }
    }
}

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
