//! The world in two levels: every engine casts into a frame's instances with the same bits, ties go to the
//! lowest triangle of the frame, and no cost grows with frames times triangles.

use std::path::Path;

use lidar_cast::bvh::Ray;
use lidar_cast::cast::{Caster, cast_frame_closest};
use lidar_cast::engine::ReferenceBackend;
use lidar_cast::task::beam_direction;
use serde_json::{Value, json};
use sightline::geom::Pose;
use sightline::problem::{Frame, Instance, World};
use sightline::scene::{EgoBody, Scene};

use crate::common::*;

const RANGE: f64 = 40.0;

fn roi() -> Roi {
    Roi::new([-6.0, -5.0, -3.25], [0.5; 3], [24, 20, 13]).unwrap()
}

fn table() -> BeamTable {
    let channels: Vec<(f64, f64)> = (0..9).map(|k| (-40.0 + 10.0 * f64::from(k), 0.1)).collect();
    BeamTable::spinning(&channels, 45, RANGE).unwrap()
}

fn problem(world: World) -> Arc<Problem> {
    Arc::new(Problem::from(Task::new(roi(), random_content(3, &roi()), table(), world, true)))
}

/// Placements of turned sensors, and of 40 that share a rotation.
fn placements(seed: u64) -> Vec<Placement> {
    let mut placements = random_placements(seed, 8, 5.0);
    for mut placement in random_placements(seed + 1, 40, 3.0) {
        placement.lidars.truncate(1);
        (placement.lidars[0].roll, placement.lidars[0].pitch, placement.lidars[0].yaw) =
            (0.0, 0.1, 0.4);
        placements.push(placement);
    }
    placements
}

/// Compares hits in each frame and all sums with the reference; returns the hits by frame.
fn compare(problem: &Arc<Problem>, placements: &[Placement]) -> Vec<Vec<Hit>> {
    let mut reference = ReferenceBackend::new(problem.task().clone());
    let poses: Vec<_> = placements.iter().flat_map(|p| &p.lidars).copied().collect();
    let frames = 0..problem.geometry_frame_count();
    let hits = frames.map(|frame| reference.hits(&poses, frame).unwrap());
    let hits: Vec<Vec<Hit>> = hits.collect();
    let tallies = reference.tally(placements, Some(RANGE as f32)).unwrap();
    for mut engine in engines(problem) {
        for (frame, want) in hits.iter().enumerate() {
            let got = engine.hits(&poses, frame).unwrap();
            assert!(bits(&got) == bits(want), "{}, frame {frame}", engine.name());
        }
        assert_eq!(
            engine.tally(placements, Some(RANGE as f32)).unwrap(),
            tallies,
            "{}",
            engine.name()
        );
    }
    hits
}

/// A soup as a tree at a place.
fn instance(soup: &TriangleSoup, ego_from_instance: Pose, first_prim: u32) -> Instance {
    let tree = Arc::new(Bvh::build(soup, RANGE as f32));
    Instance { tree, ego_from_instance, first_prim }
}

#[test]
fn equal_distances_go_to_the_lowest_triangle_of_the_frame() {
    // Equal triangles three times: in the static world and in two actors, at the same place.
    let soup = random_soup(5, 120, 6.0);
    let count = soup.faces.len() as u32;
    let tree = Arc::new(Bvh::build(&soup, RANGE as f32));
    let at = |first_prim: u32| Instance {
        tree: tree.clone(),
        ego_from_instance: Pose::IDENTITY,
        first_prim,
    };
    let alone = World::new(vec![Arc::new(Frame::from(tree.clone()))]);
    let want = compare(&problem(alone), &placements(7)).remove(0);
    assert!(want.iter().filter(|hit| hit.is_hit()).count() > want.len() / 5);
    for order in [[0, count, 2 * count], [2 * count, count, 0]] {
        let world = World::new(vec![Arc::new(Frame::new(order.map(at)))]);
        let hits = compare(&problem(world), &placements(7)).remove(0);
        assert!(bits(&hits) == bits(&want), "{order:?}");
    }
    // Two actors alone: the first of them.
    let world = World::new(vec![Arc::new(Frame::new([at(count), at(2 * count)]))]);
    let hits = compare(&problem(world), &placements(7)).remove(0);
    for (hit, want) in hits.iter().zip(&want).filter(|(_, want)| want.is_hit()) {
        assert_eq!((hit.t.to_bits(), hit.prim), (want.t.to_bits(), want.prim + count));
    }
}

/// A scene of many actors on a wide plain, some of them equal, and an ego that turns and tilts.
fn crowded(actors: usize, frames: usize) -> Scene {
    let mut rng = rng(11);
    let mut number = |half: f64| rng.random_range(-half..half);
    let ego: Vec<Value> = (0..frames)
        .map(|t| {
            json!({ "x": 3.0 * t as f64, "y": number(1.0), "z": 0.1 * number(1.0),
                    "roll": number(0.05), "pitch": number(0.05), "yaw": number(3.0) })
        })
        .collect();
    let list: Vec<Value> = (0..actors)
        .map(|k| {
            let (x, y) = (number(60.0), number(60.0));
            let poses: Vec<Value> = (0..frames)
                .map(|t| json!({ "x": x + t as f64, "y": y, "yaw": number(3.0) }))
                .collect();
            let size = [4.0 + (k % 7) as f64 * 0.1, 1.8, 1.5];
            let part = json!({ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": size } });
            json!({ "parts": [part], "poses": poses })
        })
        .collect();
    let mut scene = json!({
        "sightline": 1, "name": "crowded", "coverage": "first-hit", "frames": frames,
        "roi": { "min": [-6, -5, -3.25], "max": [6, 5, 3.25], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 9, "fov": [-40, 40], "azimuth_steps": 45, "range": RANGE },
        "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "lidars": 2 },
        "static": [{ "class": "ground", "plane": { "min": [-200, -200], "max": [200, 200], "z": 0 } },
                   { "class": "building", "box": { "foot": [20, 15, 0], "size": [10, 8, 9] } }]
    });
    scene["ego"] = json!({ "poses": ego,
        "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.2], "size": [4, 1.8, 1.2] } }] });
    scene["actors"] = Value::from(list);
    Scene::from_json(&scene.to_string(), Path::new(""), "crowded.json").unwrap()
}

fn world(scene: &Scene) -> World {
    let frames: Vec<usize> = (0..scene.frame_count()).collect();
    sightline::problem::world_of(scene, &frames, RANGE as f32, EgoBody::Include).unwrap()
}

/// Farthest that t may be from that of the triangles of [`Scene::frame`] in `f64`: both are rounded.
const OF_SOUP: f64 = 2e-5;

#[test]
fn three_hundred_actors_are_cast_alike_everywhere_and_where_the_soup_says() {
    let scene = crowded(300, 3);
    let world = world(&scene);
    assert_eq!(world.frames()[1].instances().len(), 302);
    let trees: std::collections::HashSet<_> =
        world.frames()[1].instances().iter().map(|i| Arc::as_ptr(&i.tree)).collect();
    assert_eq!(trees.len(), 2 + 7, "equal shapes are one tree");
    let placements = placements(13);
    let problem = problem(world);
    let hits = compare(&problem, &placements);
    let sensors = placements.iter().flat_map(|p| &p.lidars).map(|l| l.ego_from_sensor());
    let sensors: Vec<Pose> = sensors.collect();
    let (table, mut of_actors, mut worst) = (table(), 0, 0.0_f64);
    for (frame, hits) in hits.iter().enumerate() {
        let soup = scene.frame(frame, EgoBody::Include);
        assert_eq!(soup.faces.len() as u64, problem.geometry(frame).unwrap().triangle_count());
        of_actors +=
            hits.iter().filter(|h| h.is_hit() && (14..14 + 3600).contains(&h.prim)).count();
        // Some beams against all triangles: the distance along the plane of the triangle that was hit.
        let beams = sensors.iter().flat_map(|s| table.directions().iter().map(move |d| (s, d)));
        for ((sensor, direction), hit) in beams.zip(hits).step_by(7).filter(|(_, h)| h.is_hit()) {
            let [a, b, c] = soup.corners(hit.prim).map(|v| glam::Vec3::from(v).as_dvec3());
            let normal = (b - a).cross(c - a);
            let along = sensor.rotation * glam::Vec3::from(*direction).as_dvec3();
            let t = normal.dot(a - sensor.translation) / normal.dot(along);
            let flat = normal.normalize().dot(along).abs();
            worst = worst.max((t - f64::from(hit.t)).abs() * flat);
        }
    }
    assert!(of_actors > 1000, "{of_actors} beams end at actors");
    assert!(worst < OF_SOUP, "{worst} m across the surface");
}

#[test]
fn the_definition_needs_no_tree_and_no_order() {
    let scene = crowded(40, 2);
    let world = world(&scene);
    let (table, placements) = (table(), placements(17));
    let sensors = placements.iter().flat_map(|p| &p.lidars).map(|l| l.ego_from_sensor());
    let sensors: Vec<Pose> = sensors.collect();
    for frame in world.frames() {
        let got = cast_frame_closest(&sensors, &table, frame, RANGE as f32);
        let beams = sensors.iter().flat_map(|s| table.directions().iter().map(move |d| (s, *d)));
        for ((sensor, direction), got) in beams.zip(&got) {
            let mut best = Hit::none(RANGE as f32);
            for instance in frame.instances().iter().rev() {
                let pose = instance.pose_of(sensor);
                let origin = glam::Vec3::from(pose.rows.map(|row| row[3]));
                let ray = Ray::new(origin, beam_direction(&pose, direction), RANGE as f32);
                let mut hit = instance.tree.closest_hit_brute_force(&ray);
                if hit.is_hit() {
                    hit.prim += instance.first_prim;
                    let closer = (hit.t, hit.prim) < (best.t, best.prim);
                    best = if closer { hit } else { best };
                }
            }
            assert_eq!((got.t.to_bits(), got.prim), (best.t.to_bits(), best.prim));
        }
        let mut fast = Vec::new();
        Caster::new(&table).cast_frame(&sensors, frame, RANGE as f32, &mut fast);
        assert!(bits(&fast) == bits(&got));
    }
}

/// More instances in reach than an invocation has steps: those beams are left to the host.
#[test]
fn more_instances_than_steps_are_cast_too() {
    let mut rng = rng(19);
    let soups = [random_soup(21, 3, 0.4), random_soup(22, 1, 0.4)];
    let trees = soups.map(|soup| Arc::new(Bvh::build(&soup, RANGE as f32)));
    let instances = (0..4500_u32).map(|k| {
        let at = random_vec(&mut rng, 20.0).as_dvec3();
        let ego_from_instance = Pose::new(at, 0.1, 0.2, f64::from(k));
        Instance { tree: trees[k as usize % 2].clone(), ego_from_instance, first_prim: 3 * k }
    });
    let world = World::new(vec![Arc::new(Frame::new(instances.collect::<Vec<_>>()))]);
    let mut placements = random_placements(23, 1, 2.0);
    placements[0].lidars.truncate(1);
    let hits = compare(&problem(world), &placements).remove(0);
    assert!(hits.iter().filter(|hit| hit.is_hit()).count() > 20);
}

#[test]
fn memory_does_not_grow_with_frames() {
    let bytes = |frames: usize| problem(world(&crowded(5, frames))).bytes();
    let (few, many) = (bytes(2), bytes(42));
    // Seven instances of a pose, a tree and a number each.
    assert!(many - few <= 40 * 7 * 128, "{} bytes a frame", (many - few) / 40);
}

#[test]
fn nothing_and_far_away_things_are_fine() {
    // An empty frame beside a full one, things at absurd places, a soup without triangles.
    let (soup, empty) = (random_soup(31, 50, 4.0), TriangleSoup::default());
    let far = |x: f64| Pose::new(glam::DVec3::new(x, -x, 0.5 * x), 0.0, 0.0, 1.0);
    let absurd = [1e5, -1e7, 1e9].map(far);
    let mut instances = vec![instance(&soup, Pose::IDENTITY, 0)];
    instances.extend(absurd.map(|pose| instance(&soup, pose, 50)));
    instances.push(instance(&empty, Pose::IDENTITY, 100));
    let full = Frame::new([instance(&soup, Pose::IDENTITY, 0)]);
    let frames = [Frame::new(instances), full, Frame::default()].map(Arc::new);
    let hits = compare(&problem(World::new(frames.to_vec())), &placements(37));
    assert!(bits(&hits[0]) == bits(&hits[1]));
    assert!(hits[2].iter().all(|hit| !hit.is_hit()));
}
