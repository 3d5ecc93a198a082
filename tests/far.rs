//! Loss of `f32` far from the origin of the static world's frame, and worlds that it cannot hold.

use std::path::Path;

use lidar_cast::cast::Caster;
use serde_json::{Value, json};
use sightline::geom::Pose;
use sightline::problem::World;
use sightline::problem::world_of;
use sightline::scene::{EgoBody, Scene};

use crate::common::*;

const RANGE: f32 = 100.0;
/// Metres from the middle of the way to its ends.
const HALF: f64 = 1000.0;
const FRAMES: usize = 17;

/// A town of turned houses, sheds and a plain, 2 km across, and a way from end to end; all moved.
fn town(shift: [f64; 3]) -> Scene {
    let mut rng = rng(41);
    let at = |x: f64, y: f64, z: f64| [x + shift[0], y + shift[1], z + shift[2]];
    let mut shapes: Vec<Value> = (0..800)
        .map(|k| {
            let x = rng.random_range(-HALF..HALF);
            let y = rng.random_range(8.0..60.0) * if k % 2 == 0 { 1.0 } else { -1.0 };
            let size = [0; 3].map(|_| rng.random_range(2.0..12.0));
            let yaw: f64 = rng.random_range(-3.0..3.0);
            json!({ "class": "building", "box": { "foot": at(x, y, 0.0), "size": size, "yaw": yaw } })
        })
        .collect();
    let (low, high) = (at(-1300.0, -300.0, 0.0), at(1300.0, 300.0, 0.0));
    shapes.push(json!({ "class": "ground",
        "plane": { "min": low[..2], "max": high[..2], "z": low[2] } }));
    let poses: Vec<Value> = (0..FRAMES)
        .map(|t| {
            let x = HALF * (2.0 * t as f64 / (FRAMES - 1) as f64 - 1.0) + 0.37 * (t % 2) as f64;
            let [x, y, z] = at(x, 0.21, 0.0);
            json!({ "x": x, "y": y, "z": z, "yaw": 0.4 * (t as f64).sin() })
        })
        .collect();
    let scene = json!({
        "sightline": 1, "name": "town", "coverage": "first-hit", "frames": FRAMES,
        "roi": { "min": [-40, -40, -0.5], "max": [40, 40, 5.5], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 16, "fov": [-25, 15], "azimuth_steps": 180, "range": RANGE },
        "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "lidars": 2 },
        "static": shapes, "ego": { "poses": poses }
    });
    Scene::from_json(&scene.to_string(), Path::new(""), "town.json").unwrap()
}

/// Largest errors in a frame: metres across the surface that was hit, and metres of t where the beam meets
/// it at 6° or more.
fn errors(scene: &Scene, world: &World, frame: usize) -> [f64; 2] {
    let channels: Vec<(f64, f64)> = (0..16).map(|k| (-25.0 + 2.5 * f64::from(k), 0.0)).collect();
    let table = BeamTable::spinning(&channels, 180, f64::from(RANGE)).unwrap();
    let placements = random_placements(43, 4, 1.0);
    let lidars = placements.iter().flat_map(|p| &p.lidars);
    let lift = |mut pose: Pose| {
        pose.translation.z += 2.5;
        pose
    };
    let sensors: Vec<Pose> = lidars.map(|l| lift(l.ego_from_sensor())).collect();
    let mut hits = Vec::new();
    Caster::new(&table).cast_frame(&sensors, &world.frames()[frame], RANGE, &mut hits);
    // Corners within some 100 m of the ego, rounded there: exact to 4 µm.
    let soup = scene.frame(frame, EgoBody::Include);
    let (mut worst, mut found) = ([0.0_f64; 2], 0);
    let beams = sensors.iter().flat_map(|s| table.directions().iter().map(move |d| (s, d)));
    for ((sensor, direction), hit) in beams.zip(&hits).filter(|(_, hit)| hit.is_hit()) {
        let [a, b, c] = soup.corners(hit.prim).map(|v| Vec3::from(v).as_dvec3());
        let normal = (b - a).cross(c - a).normalize();
        let along = sensor.rotation * Vec3::from(*direction).as_dvec3();
        let t = normal.dot(a - sensor.translation) / normal.dot(along);
        let flat = normal.dot(along).abs();
        let error = (t - f64::from(hit.t)).abs();
        worst[0] = worst[0].max(error * flat);
        worst[1] = worst[1].max(if flat > 0.1 { error } else { 0.0 });
        found += 1;
    }
    assert!(found * 3 > hits.len(), "only {found} of {} beams hit", hits.len());
    worst
}

#[test]
fn a_town_two_kilometres_across_is_met_within_a_fraction_of_a_millimetre() {
    for shift in [[0.0; 3], [450_000.0, 5_400_000.0, 310.5]] {
        let scene = town(shift);
        let frames: Vec<usize> = (0..FRAMES).collect();
        let world = world_of(&scene, &frames, RANGE, EgoBody::Include).unwrap();
        for frame in frames {
            let place = scene.ego_pose(frame).translation - DVec3::from(shift);
            let [across, along] = errors(&scene, &world, frame);
            println!(
                "{:6.0} m from the origin: {across:.1e} m across, {along:.1e} m along",
                place.x
            );
            // Corners and the sensor are off by up to 2⁻²⁵ of their coordinates on each axis; 25 µm are the
            // rounding of directions and hits over 100 m.
            let most = 2.5e-5 + 8e-8 * place.length();
            assert!(across < most, "{across} m at {place}, {shift:?}");
            assert!(along < 10.0 * most, "{along} m at {place}, {shift:?}");
        }
    }
}

fn scene_with(more: &Value) -> Result<Scene, String> {
    let mut scene = json!({
        "sightline": 1, "name": "far", "frames": 3,
        "roi": { "min": [-4, -4, 0], "max": [4, 4, 2], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 4, "fov": [-25, 15], "azimuth_steps": 18, "range": 50 },
        "mount": { "min": [-0.6, -0.6, 1.2], "max": [0.6, 0.6, 1.8], "lidars": 1 },
        "static": [{ "class": "building", "box": { "foot": [10, 0, 0], "size": [2, 3, 4] } }]
    });
    for (key, value) in more.as_object().unwrap() {
        scene[key] = value.clone();
    }
    let read = Scene::from_json(&scene.to_string(), Path::new(""), "far.json");
    read.map_err(|error| error.to_string())
}

#[test]
fn a_way_too_long_for_f32_is_an_error_with_a_mend() {
    let route =
        |to: f64| json!({ "ego": { "route": { "points": [[0, 0], [1e6, 0]], "spacing": to } } });
    scene_with(&route(9000.0)).unwrap();
    let poses = json!({ "ego": { "poses": [{ "x": 0, "y": 0 }, { "x": 0, "y": 4e5 }, { "x": 5, "y": 0 }] } });
    let error = scene_with(&poses).unwrap_err();
    assert_eq!(
        error,
        "far.json: ego.poses: a way that leads 200000 m from its middle is not one within 50000 m, where \
         coordinates keep 2 mm; cut the scene into several"
    );
    // Without a static world there is nothing to hold.
    let mut empty = poses;
    empty["static"] = json!([]);
    empty["actors"] = json!([{ "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0], "size": [4, 2, 1] } }],
        "poses": [{ "x": 5, "y": 0 }, { "x": 5, "y": 4e5 }, { "x": 9, "y": 0 }] }]);
    let scene = scene_with(&empty).unwrap();
    let world = world_of(&scene, &[0, 1, 2], 50.0, EgoBody::Include).unwrap();
    let at = world.frames()[1].instances()[0].ego_from_instance.translation;
    assert!((at.x - 5.0).abs() < 1e-9 && at.y.abs() < 1e-9, "{at}");
}

#[test]
fn things_in_national_coordinates_of_their_own_are_cast() {
    // An actor whose parts lie far from its own origin, which its pose brings back.
    let cuboid = json!({ "class": "vehicle", "box": { "foot": [450_000.25, 5_400_000.0, 0], "size": [4, 2, 3] } });
    let back = json!({ "x": -449_990.0, "y": -5_400_000.0 });
    let away = json!({ "x": 1e9, "y": -1e9 });
    let scene = scene_with(&json!({ "coverage": "first-hit", "actors": [
        { "parts": [cuboid], "poses": [back, away, back] }] }))
    .unwrap();
    let world = world_of(&scene, &[0, 1], 50.0, EgoBody::Include).unwrap();
    assert_eq!(world.frames()[0].instances().len(), 2, "without the missing body");
    let table = BeamTable::from_directions([DVec3::X], 50.0).unwrap();
    let sensor = Pose::new(DVec3::new(0.0, 0.25, 1.5), 0.0, 0.0, 0.0);
    let mut hits = Vec::new();
    for (frame, (t, prims)) in [(8.25, 12..24), (9.0, 0..12)].into_iter().enumerate() {
        Caster::new(&table).cast_frame(&[sensor], &world.frames()[frame], 50.0, &mut hits);
        assert!((hits[0].t - t).abs() < 1e-6 && prims.contains(&hits[0].prim), "{hits:?}");
    }
}
