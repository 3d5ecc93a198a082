//! Where points lie: on the triangles, at the moment their beam fired.

use glam::{DVec3, Vec3};

use super::{bits, ideal, placement, scan, scene};
use lidar_cast::bvh::{Bvh, Hit, Ray};
use std::sync::Arc;

use crate::{EGO_INSTANCE, Scanner, Scanning, Stage, Status};
use lidar_cast::cast::{Firing, FiringCaster};
use lidar_cast::geom::{Pose, TriangleSoup};
use sightline_scene::scene::{EgoBody, PartOwner, Scene};
use sightline_scene::vehicle::SensorPose;

/// A street with houses, poles and things that drive and turn.
const STREET: &str = r#"
    "static": [
        { "class": "road", "plane": { "min": [-60, -5], "max": [60, 5], "z": 0 } },
        { "class": "building", "box": { "min": [-30, 8, 0], "max": [-5, 20, 6] } },
        { "class": "building", "box": { "min": [4, 8, 0], "max": [40, 20, 8] } },
        { "class": "wall", "box": { "min": [-40, -9, 0], "max": [40, -8, 2.5] } },
        { "class": "pole", "cylinder": { "foot": [6, 5.5, 0], "radius": 0.1, "height": 5, "sides": 8 } } ],
    "actors": [
        { "name": "car", "parts": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.2], "size": [4.2, 1.8, 1.4] } }],
          "route": { "points": [[20, 2.5], [-60, 2.5]], "spacing": 2.5 } },
        { "name": "turning", "kind": "truck",
          "parts": [{ "class": "vehicle", "box": { "foot": [1, 0, 0.2], "size": [8, 2.4, 3] } }],
          "poses": [{ "x": -14, "y": -2 }, { "x": -13, "y": -2, "yaw": 0.3 }, { "x": -12, "y": -1.5, "yaw": 0.7 }] },
        { "parts": [{ "class": "pedestrian", "box": { "foot": [0, 0, 0], "size": [0.5, 0.6, 1.8] } }],
          "poses": [{ "x": 5, "y": 6 }, { "x": 5, "y": 6.2 }, { "x": 5, "y": 6.4 }] } ],
    "ego": { "body": [{ "class": "vehicle", "box": { "foot": [0, 0, 0.3], "size": [4, 1.8, 1.3] } }],
             "poses": [{ "x": 0, "y": -2.5 }, { "x": 2, "y": -2.4, "yaw": 0.1 }, { "x": 4, "y": -2.1, "yaw": 0.15 }] }"#;
const SPINNING: &str = r#"{ "channels": 12, "fov": [-25, 10], "azimuth_steps": 90, "range": 60 }"#;
/// No width, no noise, no threshold in reach: only motion remains.
const EXACT: &str = r#"{ "divergence": [0, 0], "noise": 0, "rated_range": 10000, "rate": 8 }"#;

fn poses() -> [SensorPose; 2] {
    [
        SensorPose { roll: 0.1, pitch: -0.05, yaw: 0.4, ..SensorPose::at(0.3, 0.4, 2.2) },
        SensorPose { roll: -0.2, yaw: 2.0, ..SensorPose::at(-0.6, -0.3, 2.5) },
    ]
}

/// Metres from a point to a triangle, by a fine search: its plane inside, its edges outside.
fn distance(point: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize();
    let inside = [(a, b), (b, c), (c, a)]
        .iter()
        .all(|&(from, to)| (to - from).cross(point - from).dot(normal) >= -1e-9);
    if inside {
        return (point - a).dot(normal).abs();
    }
    let to_edge = |(from, to): &(DVec3, DVec3)| {
        let along =
            ((point - *from).dot(*to - *from) / (*to - *from).length_squared()).clamp(0.0, 1.0);
        (*from + (*to - *from) * along - point).length()
    };
    [(a, b), (b, c), (c, a)].iter().map(to_edge).fold(f64::MAX, f64::min)
}

#[test]
fn ideal_scans_are_the_hits_of_the_reference_and_lie_on_triangles_of_their_class() {
    let scene = scene(STREET, SPINNING, EXACT);
    let scans = scan(&scene, &poses(), &ideal());
    assert_eq!(scans.len(), 3);
    let table = scene.sensors().unwrap().table(0).clone();
    let mut kinds = std::collections::HashSet::new();
    for (frame, scan) in scans.iter().enumerate() {
        let soup = scene.frame(frame, EgoBody::Include);
        let bvh = Bvh::build(&soup, 60.0);
        assert_eq!(scan.returns.len(), 2 * 12 * 90);
        for (k, beam) in scan.returns.iter().enumerate() {
            let (lidar, index) = (k / 1080, k % 1080);
            assert_eq!(usize::from(beam.lidar), lidar);
            assert_eq!(usize::from(beam.channel) * 90 + beam.column as usize, index);
            let pose = poses()[lidar].ego_from_sensor();
            let direction = pose.rotation * DVec3::from(table.directions()[index].map(f64::from));
            let ray = Ray::new(pose.translation.as_vec3(), direction.as_vec3(), 60.0);
            let hit = bvh.closest_hit_brute_force(&ray);
            assert_eq!(beam.status == Status::Hit, hit.is_hit());
            if !hit.is_hit() {
                assert!(beam.range.is_nan() && beam.position[0].is_nan());
                continue;
            }
            assert!((beam.range - hit.t).abs() < 1e-3, "{} {}", beam.range, hit.t);
            let class = soup.face_class[hit.prim as usize];
            let on = |face: u32| {
                let corners = soup.corners(face).map(|corner| DVec3::from(corner.map(f64::from)));
                soup.face_class[face as usize] == beam.class
                    && distance(DVec3::from(beam.position.map(f64::from)), corners) < 1e-3
            };
            assert!((0..soup.faces.len() as u32).any(on), "{beam:?}");
            assert_eq!((beam.class, beam.clean_class), (class, class));
            kinds.insert((beam.class, beam.instance));
        }
    }
    // Road, two kinds of houses, pole, three actors, the own body.
    assert!(kinds.len() >= 7, "{kinds:?}");
    assert!(kinds.iter().any(|(_, instance)| *instance == EGO_INSTANCE));
}

/// The triangles of a scene as the ego sees them a share of the way to the next frame.
fn soup_between(scene: &Scene, frame: usize, share: f64) -> TriangleSoup {
    let mut soup = TriangleSoup::default();
    let ego_from_world = scene.ego_glide(frame).at(share).inverse();
    for part in scene.parts(EgoBody::Include) {
        let own = scene.part(part);
        let mut world_from_part = match scene.owner(part) {
            PartOwner::World => Pose::IDENTITY,
            PartOwner::Ego => scene.ego_glide(frame).at(share),
            PartOwner::EgoBody(body) => {
                let ego_from_body = scene.own_body_glide(body, frame).at(share);
                scene.ego_glide(frame).at(share).compose(&ego_from_body)
            }
            PartOwner::Actor(actor) => scene.actor_glide(actor, frame).at(share),
        };
        world_from_part.translation = world_from_part.apply(scene.part_origin(part));
        let pose = ego_from_world.compose(&world_from_part);
        let base = soup.vertices.len() as u32;
        let moved = own.vertices.iter().map(|v| pose.apply(DVec3::from(v.map(f64::from))));
        soup.vertices.extend(moved.map(|v| v.as_vec3().to_array()));
        soup.faces.extend(own.faces.iter().map(|face| face.map(|v| v + base)));
        soup.face_class.extend(own.face_class);
    }
    soup
}

/// The street with a trailer that bends behind the ego while both move.
fn street_with_trailer() -> String {
    let trailer = r#""ego": { "bodies": [{ "name": "trailer",
        "parts": [{ "class": "vehicle", "box": { "center": [-3, 0, 1.6], "size": [5, 2.2, 2.4] } }],
        "poses": [{ "x": -2.2, "y": 0 }, { "x": -2.2, "y": 0, "yaw": -0.2 }, { "x": -2.2, "y": 0, "yaw": -0.5 }] }],"#;
    STREET.replace("\"ego\": {", trailer)
}

#[test]
fn each_column_meets_the_world_as_it_is_when_it_fires() {
    columns_meet_the_world(STREET);
}

#[test]
fn each_column_meets_a_trailer_that_bends_as_it_is_when_it_fires() {
    let street = street_with_trailer();
    columns_meet_the_world(&street);
    let scene = scene(&street, SPINNING, EXACT);
    let own = |at: &Scene| {
        let scans = scan(at, &poses(), &ideal());
        let count =
            |scan: &crate::Scan| scan.points().filter(|beam| beam.instance == EGO_INSTANCE).count();
        scans.iter().map(count).collect::<Vec<_>>()
    };
    let with = own(&scene);
    let without = own(&super::scene(STREET, SPINNING, EXACT));
    assert!(with.iter().zip(&without).all(|(with, without)| *with > without + 20), "{with:?}");
    assert!(with[0] != with[2], "{with:?}");
}

fn columns_meet_the_world(street: &str) {
    let scene = scene(street, SPINNING, EXACT);
    let scans = scan(&scene, &poses(), &Scanning::default());
    let table = scene.sensors().unwrap().table(0).clone();
    let (mut moved, mut compared) = (0, 0);
    for (frame, scan) in scans.iter().enumerate() {
        for column in (0..90).step_by(7) {
            // 8 turns and 5 frames a second.
            let share = f64::from(column) / 90.0 * 5.0 / 8.0;
            let bvh = Bvh::build(&soup_between(&scene, frame, share), 60.0);
            let start_from_ego =
                scene.ego_pose(frame).inverse().compose(&scene.ego_glide(frame).at(share));
            for beam in scan.returns.iter().filter(|beam| beam.column == column as u32) {
                let pose = poses()[usize::from(beam.lidar)].ego_from_sensor();
                let direction =
                    table.directions()[usize::from(beam.channel) * 90 + column as usize];
                let direction = pose.rotation * DVec3::from(direction.map(f64::from));
                let ray = Ray::new(pose.translation.as_vec3(), direction.as_vec3(), 60.0);
                let hit = bvh.closest_hit_brute_force(&ray);
                let time = column as f32 / 90.0 / 8.0;
                assert!((beam.time - time).abs() < 1e-6);
                // The ego body may be met at its edge by one and not by the other.
                if beam.status != Status::Hit || !hit.is_hit() {
                    assert_eq!(beam.status == Status::Hit, hit.is_hit(), "{beam:?} {hit:?}");
                    continue;
                }
                assert!((beam.range - hit.t).abs() < 2e-3, "{beam:?} {hit:?}");
                let place = pose.translation + direction * f64::from(beam.range);
                let expected = start_from_ego.apply(place).as_vec3();
                assert!((Vec3::from(beam.position) - expected).length() < 1e-3);
                assert!((Vec3::from(beam.raw) - place.as_vec3()).length() < 1e-3);
                moved += u32::from((place.as_vec3() - expected).length() > 0.1);
                compared += 1;
            }
        }
    }
    assert!(compared > 400 && moved > 100, "{compared} {moved}");
}

#[test]
fn a_wall_shears_by_the_way_driven_and_stands_straight_once_that_is_made_up_for() {
    // 5 frames a second, 3 m a frame: 15 m/s.
    let things = r#""static": [{ "class": "wall", "box": { "min": [30, -40, -5], "max": [31, 40, 20] } }],
        "ego": { "route": { "points": [[0, 0], [100, 0]], "spacing": 3 } }"#;
    let lidar = r#"{ "channels": 2, "fov": [-1, 1], "azimuth_steps": 400, "range": 60 }"#;
    let scene = scene(
        things,
        lidar,
        r#"{ "divergence": [0, 0], "noise": 0, "rated_range": 10000, "rate": 10 }"#,
    );
    let scans = scan(&scene, &[SensorPose::at(0.0, 0.0, 2.0)], &Scanning::default());
    let mut wall = 0;
    for beam in scans[0].points() {
        assert!((beam.position[0] - 30.0).abs() < 1e-4, "{beam:?}");
        let sheared = 30.0 - 15.0 * beam.time;
        assert!((beam.raw[0] - sheared).abs() < 1e-4, "{beam:?}");
        wall += 1;
    }
    assert!(wall > 200);
    // The last column fires almost a tenth of a second after the first.
    let latest = scans[0].points().map(|beam| beam.time).fold(0.0, f32::max);
    assert!(latest > 0.098, "{latest}");
}

#[test]
fn boxes_follow_the_actors_and_count_their_points() {
    let scene = scene(STREET, SPINNING, EXACT);
    let scans = scan(&scene, &poses(), &ideal());
    for scan in &scans {
        assert_eq!(scan.boxes.len(), 3);
        for tracked in &scan.boxes {
            let own = scan.points().filter(|beam| beam.instance == tracked.instance).count();
            // Points on the faces may be rounded out of the box, by less than a micrometre.
            let grown = tracked.size / 2.0 + 1e-4;
            let inside = scan.points().filter(|beam| {
                let p = DVec3::from(beam.position.map(f64::from));
                tracked.ego_from_box.inverse().apply(p).abs().cmple(grown).all()
            });
            assert!(inside.count() >= own);
            assert!(usize::try_from(tracked.points).unwrap() <= scan.returns.len());
        }
    }
    let car = |frame: usize| &scans[frame].boxes[0];
    assert_eq!((car(0).name.as_str(), car(0).kind.name()), ("car", "car"));
    assert_eq!(scans[0].boxes[1].kind.name(), "truck");
    assert_eq!(scans[0].boxes[2].kind.name(), "pedestrian");
    assert!((car(0).velocity - DVec3::new(-12.5, 0.0, 0.0)).length() < 1e-9);
    assert!((car(0).size - DVec3::new(4.2, 1.8, 1.4)).length() < 1e-9);
    let center = scene.ego_pose(1).apply(car(1).ego_from_box.translation);
    assert!((center - DVec3::new(17.5, 2.5, 0.9)).length() < 1e-9, "{center}");
}

#[test]
fn a_box_half_behind_a_wall_is_half_seen() {
    // The sensor looks at one face of each box: |y| ≤ 1 and z of 0.2 to 1.8 at x = 20, behind a wall at x = 10.
    let seen = |wall: &str, mount: SensorPose| {
        let boxed = |x: f64| {
            format!(
                r#"{{ "parts": [{{ "class": "vehicle", "box": {{ "foot": [0, 0, 0.2], "size": [4, 2, 1.6] }} }}],
                      "poses": [{{ "x": {x}, "y": 0 }}, {{ "x": {x}, "y": 0 }}, {{ "x": {x}, "y": 0 }}] }}"#
            )
        };
        let things = format!(
            r#""static": [{{ "class": "road", "plane": {{ "min": [-50, -50], "max": [50, 50], "z": 0 }} }},
                          {{ "class": "building", "box": {wall} }}],
               "actors": [{}, {}]"#,
            boxed(22.0),
            boxed(-900.0)
        );
        let scene = scene(&things, SPINNING, EXACT);
        let placement = placement(&[mount]);
        let scanner = Scanner::new(&scene, &placement, &ideal()).unwrap();
        let mut scan = scanner.scan(1);
        assert_eq!(scan.boxes[0].visible, None, "before anyone looked");
        scanner.look_at_boxes(&mut scan);
        [scan.boxes[0].visible.unwrap(), scan.boxes[1].visible.unwrap()]
    };
    let middle = SensorPose::at(0.0, 0.0, 1.0);
    let wall =
        |low: f64, high: f64| format!(r#"{{ "min": [10, {low}, -1], "max": [10.2, {high}, 5] }}"#);
    assert_eq!(seen(&wall(30.0, 31.0), middle), [1.0, 0.0], "the other is out of range");
    assert_eq!(seen(&wall(0.0, 20.0), middle), [0.5, 0.0]);
    assert_eq!(seen(&wall(-20.0, 20.0), middle), [0.0, 0.0]);
    // Lines to the points 1/6, 3/6 and 5/6 m beside the middle pass 1/12, 3/12 and 5/12 m beside it at 10 m.
    assert_eq!(seen(&wall(0.2, 20.0), middle), [4.0_f32 / 6.0, 0.0]);
}

#[test]
fn the_same_bytes_on_any_number_of_threads_and_in_any_order_of_frames() {
    let scene = scene(STREET, SPINNING, "{}");
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| bits(&scan(&scene, &poses(), &Scanning::default())))
    };
    assert_eq!(on(1), on(3));
    let placement = placement(&poses());
    let scanner = Scanner::new(&scene, &placement, &Scanning::default()).unwrap();
    let mut backwards: Vec<_> = (0..3).rev().map(|frame| scanner.scan(frame)).collect();
    backwards.reverse();
    assert_eq!(bits(&backwards), on(1));
    let other = Scanning { seed: 1, ..Scanning::default() };
    assert_ne!(bits(&scan(&scene, &poses(), &other)), on(1));
}

/// A device that casts a few times as the host does, and then no more.
struct Mortal {
    left: u32,
}

impl FiringCaster for Mortal {
    fn closest_hits(&mut self, firings: &[Firing<'_>], range: f32) -> Result<Vec<Hit>, String> {
        self.left = self.left.checked_sub(1).ok_or("it broke")?;
        let rays = firings.iter().flat_map(|firing| firing.rays.iter().map(move |r| (firing, *r)));
        Ok(rays.map(|(firing, ray)| firing.closest_hit(ray, range)).collect())
    }
}

#[test]
fn a_device_that_fails_in_the_middle_leaves_the_bytes_as_they_are() {
    let wide = r#"{ "divergence": [0.01, 0.006], "echoes": "dual" }"#;
    let (scene, placement) = (scene(STREET, SPINNING, wide), placement(&poses()));
    let scanner = || Scanner::new(&scene, &placement, &Scanning::default()).unwrap();
    let host = bits(&scanner().scans().collect::<Vec<_>>());
    for left in [0, 3, 1000] {
        let mut by_device = scanner();
        let trees = by_device.cast_by(Box::new(Mortal { left }));
        assert_eq!(trees, 5, "static world, three actors, the ego's body");
        assert!(host == bits(&by_device.scans().collect::<Vec<_>>()), "after {left} casts");
        assert_eq!(by_device.device_failure(), (left < 1000).then_some("it broke"));
    }
}

#[test]
fn scanners_that_share_a_stage_have_the_bytes_of_those_with_their_own() {
    let wide = r#"{ "divergence": [0.01, 0.006] }"#;
    let scene = scene(STREET, SPINNING, wide);
    let stage = Arc::new(Stage::new(&scene).unwrap());
    let (first, second) = (placement(&poses()), placement(&poses()[..1]));
    for placement in [&first, &second] {
        let scanning = Scanning { seed: 3, ..Scanning::default() };
        let alone = Scanner::new(&scene, placement, &scanning).unwrap();
        let sharing = Scanner::on(stage.clone(), &scene, placement, &scanning).unwrap();
        let scans = |scanner: &Scanner<'_>| bits(&scanner.scans().collect::<Vec<_>>());
        assert!(scans(&alone) == scans(&sharing));
    }
}

#[test]
#[should_panic(expected = "the stage is not of the scene")]
fn a_stage_of_another_scene_is_no_stage() {
    let road =
        r#""static": [{ "class": "road", "plane": { "min": [-9, -9], "max": [9, 9], "z": 0 } }]"#;
    let (here, there) = (scene(STREET, SPINNING, "{}"), scene(road, SPINNING, "{}"));
    let placement = placement(&poses());
    let stage = Arc::new(Stage::new(&there).unwrap());
    let _ = Scanner::on(stage, &here, &placement, &Scanning::default());
}

#[test]
fn as_many_actors_are_told_apart_as_there_are_instances() {
    let actors = |count: usize| {
        let actor = r#"{ "poses": [{ "x": 1, "y": 0 }], "parts": [{ "shape": "post" }] }"#;
        let text = format!(
            r#"{{ "sightline": 1, "name": "crowd", "frames": 1, "coverage": "first-hit",
                 "roi": {{ "min": [-9, -9, -1], "max": [9, 9, 5], "voxel": [1, 1, 1] }},
                 "lidar": {{ "channels": 1, "fov": [0, 0], "azimuth_steps": 1, "range": 9 }},
                 "mount": {{ "min": [-1, -1, 0], "max": [1, 1, 3], "lidars": 1 }},
                 "shapes": {{ "post": [{{ "class": "pole", "box": {{ "foot": [0, 0, 0], "size": [1, 1, 1] }} }}] }},
                 "actors": [{}] }}"#,
            vec![actor; count].join(",")
        );
        let scene = Scene::from_json(&text, "".as_ref(), "crowd").unwrap();
        Scanner::check(&scene, &placement(&poses()[..1]), &Scanning::default())
    };
    actors(usize::from(EGO_INSTANCE) - 1).unwrap();
    let error = actors(usize::from(EGO_INSTANCE)).unwrap_err().to_string();
    assert!(error.contains("has 65535 actors, a scan tells at most 65534 apart"), "{error}");
}
