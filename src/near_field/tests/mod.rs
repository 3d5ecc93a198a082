//! The near field against closed forms on level ground: rings, shadows of a box, beams on a cylinder.

mod bodies;
#[cfg(feature = "mesh")]
mod slopes;

use std::f64::consts::TAU;
use std::path::Path;
use std::sync::Arc;

use super::*;
use crate::engine::CpuBackend;
use crate::problem::Problem;
use crate::psog::Psog;
use crate::scene::Scene;
use crate::vehicle::{BeamTable, Placement, SensorPose};

/// Half length, half width and height of the own body, a box that stands on the ground.
const BODY: [f64; 3] = [2.0, 1.0, 1.5];
const OFFSET: f64 = 0.37;

/// Level ground, the own body, and other static shapes.
pub(super) fn scene(others: &str) -> Scene {
    scene_on(0.0, others)
}

/// Like [`scene`], with the ground at a height in metres.
fn scene_on(ground: f64, others: &str) -> Scene {
    let plane = format!(r#""plane": {{ "min": [-60, -60], "max": [60, 60], "z": {ground} }}"#);
    let rest = format!(
        r#""coverage": "first-hit", "static": [{{ "class": "road", {plane} }} {others}],
        "ego": {{ "body": [{}] }}"#,
        body()
    );
    written(Path::new(""), &rest)
}

fn body() -> String {
    let [x, y, z] = BODY;
    format!(
        r#"{{ "class": "vehicle", "box": {{ "min": [-{x}, -{y}, 0], "max": [{x}, {y}, {z}] }} }}"#
    )
}

/// A scene with one LiDAR, whose static shapes and ego are given; its files lie in a folder.
fn written(folder: &Path, rest: &str) -> Scene {
    let text = format!(
        r#"{{ "sightline": 1, "roi": {{ "min": [-16, -16, -0.4], "max": [16, 16, 2.8], "voxel": [0.4, 0.4, 0.4] }},
        "lidar": {{ "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 }},
        "mount": {{ "min": [-2, -1, 0.1], "max": [3, 1, 2.7], "lidars": 1 }}, {rest} }}"#
    );
    Scene::from_json(&text, folder, "test.json").unwrap_or_else(|e| panic!("{e}"))
}

pub(super) fn problem(scene: &Scene) -> Problem {
    let roi = scene.roi().grid().unwrap();
    let psog = Psog::new(roi, 1, scene.classes().to_vec(), vec![], vec![]).unwrap();
    Problem::from_scene(scene, &psog, scene.sensors().unwrap(), &[0]).unwrap()
}

fn cpu(problem: &Arc<Problem>) -> CpuBackend {
    CpuBackend::new(problem.task().clone(), 1 << 30)
}

fn one(pose: SensorPose) -> Placement {
    Placement { name: "one".into(), lidars: vec![pose] }
}

fn look(scene: &Scene, table: BeamTable, pose: SensorPose) -> NearField {
    let problem = Arc::new(problem(scene).with_sensors(table));
    let site = NearSite::new(scene, &problem).unwrap();
    site.look(&mut cpu(&problem), &one(pose)).unwrap()
}

/// Where the beams of a level spinning sensor over the middle of the roof reach the ground; `None` for those
/// that end at the roof: at its height they have not left it yet.
fn reach(elevations: &[f64], steps: u32, height: f64) -> Vec<Option<[f64; 2]>> {
    let mut ends = Vec::new();
    for elevation in elevations {
        let slope = (-elevation).to_radians().tan();
        let (ring, at_roof) = (height / slope, (height - BODY[2]) / slope);
        for step in 0..steps {
            let azimuth = TAU * f64::from(step) / f64::from(steps) + OFFSET.to_radians();
            let [x, y] = [azimuth.cos(), azimuth.sin()];
            let on_roof = (at_roof * x).abs() <= BODY[0] && (at_roof * y).abs() <= BODY[1];
            ends.push((!on_roof).then_some([ring * x, ring * y]));
        }
    }
    ends
}

/// Share of the cells within a distance of the box that have a point within half a metre.
fn share(points: &[[f64; 2]], within: f64) -> f64 {
    let (mut all, mut seen) = (0.0, 0.0);
    for i in -60..60 {
        for j in -60..60 {
            let [x, y] = [i, j].map(|k| 0.25 * f64::from(k) + 0.125);
            let [beyond_x, beyond_y] = [(x.abs() - BODY[0]).max(0.0), (y.abs() - BODY[1]).max(0.0)];
            let distance = beyond_x.hypot(beyond_y);
            if distance > 0.0 && distance <= within {
                let is_close = |p: &[f64; 2]| (p[0] - x).powi(2) + (p[1] - y).powi(2) <= 0.25;
                all += 1.0;
                seen += f64::from(u8::from(points.iter().any(is_close)));
            }
        }
    }
    seen / all
}

#[test]
fn rings_and_the_shadow_of_the_body_in_closed_form() {
    let elevations: Vec<f64> = (0..40).map(|k| -62.3 + 1.5 * f64::from(k)).collect();
    let channels: Vec<(f64, f64)> = elevations.iter().map(|&e| (e, OFFSET)).collect();
    let table = BeamTable::spinning(&channels, 250, 100.0).unwrap();
    let scene = scene("");
    for height in [1.6, 2.0, 2.63] {
        let near = look(&scene, table.clone(), SensorPose::at(0.0, 0.0, height));
        let ends = reach(&elevations, 250, height);
        let points: Vec<[f64; 2]> = ends.iter().flatten().copied().collect();
        let wasted = (ends.len() - points.len()) as f64 / ends.len() as f64;
        // Beams that reach the ground beyond its edge, 60 m away, end at nothing.
        let on_ground = points.iter().filter(|p| p[0].abs() <= 60.0 && p[1].abs() <= 60.0).count();
        let on_ground = on_ground as f64 / ends.len() as f64;
        let [shares] = near.beams[..] else { panic!("one LiDAR") };
        assert!((shares.own - wasted).abs() < 1e-12, "{height}: {} {wasted}", shares.own);
        assert!((shares.ground - on_ground).abs() < 1e-12, "{height}: {shares:?} {on_ground}");
        assert!((shares.ground + shares.own + shares.nothing - 1.0).abs() < 1e-12);
        assert!((near.near_field - share(&points, 10.0)).abs() < 1e-3, "{height}: {near:?}");
        let ring = near.ring.unwrap();
        assert!((ring - share(&points, 3.0)).abs() < 1e-3, "{height}: {ring}");
        // Similar triangles: the roof's edge, at BODY from the sensor's foot, ends the shadow.
        let shadow = |half: f64| half * height / (height - BODY[2]) - half;
        for (found, half) in [(near.zone.ahead, BODY[0]), (near.zone.left, BODY[1])] {
            let edge = shadow(half);
            match found {
                Some(found) => {
                    assert!(found > edge - CLOSE - CELL, "{height}: {found} {edge}");
                    assert!(found < 1.2 * edge + CLOSE + CELL, "{height}: {found} {edge}");
                }
                None => assert!(edge > NEAR - 1.0, "{height}: {edge}"),
            }
        }
    }
}

#[test]
fn the_drawing_has_no_blind_zone_beside_a_body_that_narrows() {
    let base = "[[-2, -1], [1, -1], [4, -0.2], [4, 0.2], [1, 1], [-2, 1]]";
    let scene = written(
        Path::new(""),
        &format!(
            r#""coverage": "first-hit",
            "static": [{{ "class": "road", "plane": {{ "min": [-60, -60], "max": [60, 60], "z": 0 }} }}],
            "ego": {{ "body": [{{ "class": "vehicle", "prism": {{ "base": {base}, "z": [0, 1.5] }} }}] }}"#
        ),
    );
    let channels: Vec<(f64, f64)> = (0..40).map(|k| (-62.3 + 1.5 * f64::from(k), OFFSET)).collect();
    let problem = problem(&scene).with_sensors(BeamTable::spinning(&channels, 250, 100.0).unwrap());
    let problem = Arc::new(problem);
    let site = NearSite::new(&scene, &problem).unwrap();
    let placement = one(SensorPose::at(-1.9, 0.9, 2.0));
    let near = site.look(&mut cpu(&problem), &placement).unwrap();
    let svg = crate::report::coverage::near_field_svg(site.footprint(), &[(&placement, &near)]);
    // Loops of the filled path; drawings have 14 pixels a metre, 10.5 m around the box, and 56 pixels above.
    let path = svg.split("fill-rule=\"evenodd\"").next().unwrap();
    let path = path.rsplit_once("d=\"M").unwrap().1.split_once("z\"").unwrap().0;
    let loops: Vec<Vec<[f64; 2]>> = path.split("zM").map(corners_of).collect();
    assert_eq!(loops.len(), 2);
    let is_filled = |[x, y]: [f64; 2]| {
        let [x, y] = [(x + 2.0 + 10.5) * 14.0, 56.0 + (1.0 - y + 10.5) * 14.0];
        let crosses = |a: &[f64; 2], b: &[f64; 2]| {
            (a[1] > y) != (b[1] > y) && x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        };
        let of = |all: &Vec<[f64; 2]>| {
            let next = all.iter().cycle().skip(1);
            all.iter().zip(next).filter(|(a, b)| crosses(a, b)).count()
        };
        loops.iter().map(of).sum::<usize>() % 2 == 1
    };
    // Beside the nose, within the box around the body; then just before the edges, where the zone begins.
    assert!([0.8, -0.8].iter().all(|y| !is_filled([3.5, *y])), "{path}");
    assert!(is_filled([-1.0, -1.01]) && is_filled([4.01, 0.0]), "{path}");
}

#[test]
fn ground_under_a_boom_is_measured() {
    let with = |more: &str| {
        let scene = written(
            Path::new(""),
            &format!(r#""coverage": "first-hit", "ego": {{ "body": [{} {more}] }}"#, body()),
        );
        let corners = scene.body().into_iter().flatten();
        let footprint = Footprint::of(corners.map(|[x, y, _]| [x, y].map(f64::from))).unwrap();
        under_raised(&scene, &footprint)
    };
    // The hull narrows from 2 m at the body to 0.4 m at the end of the boom, 3 m ahead of it.
    let boom = |z: f64| {
        let top = z + 0.4;
        format!(
            r#", {{ "class": "vehicle", "box": {{ "min": [2, -0.2, {z}], "max": [5, 0.2, {top}] }} }}"#
        )
    };
    assert_eq!(with(""), 0.0);
    assert!((with(&boom(2.0)) - 3.0 * 1.2).abs() < 1e-6, "{}", with(&boom(2.0)));
    assert_eq!(with(&boom(0.9)), 0.0);
}

/// Corners `x,y x,y …`.
fn corners_of(text: &str) -> Vec<[f64; 2]> {
    let number = |text: &str| text.parse().unwrap();
    let corner = |text: &str| text.split_once(',').map(|(x, y)| [number(x), number(y)]).unwrap();
    text.split_whitespace().map(corner).collect()
}

#[test]
fn a_sensor_close_above_the_roof_wastes_beams_and_says_so() {
    let scene = scene("");
    let channels: Vec<(f64, f64)> = (0..16).map(|k| (-24.7 + 1.6 * f64::from(k), OFFSET)).collect();
    let table = BeamTable::spinning(&channels, 250, 100.0).unwrap();
    let problem = Arc::new(problem(&scene).with_sensors(table));
    let mut engine = cpu(&problem);
    let elevations: Vec<f64> = channels.iter().map(|c| c.0).collect();
    let ends = reach(&elevations, 250, 1.6);
    let wasted = ends.iter().filter(|end| end.is_none()).count() as f64 / ends.len() as f64;
    assert!(wasted > crate::score::MOST_SELF_HITS && wasted < 0.9, "{wasted}");
    let guards = self_hits(&scene, &problem, &mut engine, &one(SensorPose::at(0.0, 0.0, 1.6)));
    let [crate::score::Guard::SelfHit { lidar: 0, mount: None, share, frame: None }] =
        guards.unwrap()[..]
    else {
        panic!()
    };
    assert!((share - wasted).abs() < 1e-12);
    let high = self_hits(&scene, &problem, &mut engine, &one(SensorPose::at(0.0, 0.0, 2.7)));
    assert_eq!(high.unwrap(), []);
}

#[test]
fn a_lidar_below_the_ground_under_the_wheels_has_a_guard() {
    use crate::score::Guard;
    let pose = |z: f64| SensorPose::at(3.0, 0.0, z);
    let placement = Placement { name: "low".into(), lidars: vec![pose(2.0), pose(-0.5)] };
    let told = |ground: f64| {
        let scene = scene_on(ground, "");
        below_ground(&scene, &problem(&scene), &placement)
    };
    let [Guard::BelowGround { lidar: 1, mount: None, depth }] = told(0.0)[..] else { panic!() };
    assert!((depth - 0.5).abs() < 1e-6, "{depth}");
    // An ego frame with its origin at the height of a sensor.
    assert_eq!(told(-1.73), []);
}

#[test]
fn beams_on_poles_in_closed_form() {
    let scene = scene("");
    let elevations: Vec<f64> = (0..12).map(|k| -20.2 + 2.7 * f64::from(k)).collect();
    let channels: Vec<(f64, f64)> = elevations.iter().map(|&e| (e, OFFSET)).collect();
    let table = BeamTable::spinning(&channels, 900, 100.0).unwrap();
    // Before the front edge and lower than a pole: nothing ends at a top, nor hides the ground ahead.
    let height = 0.55;
    let near = look(&scene, table, SensorPose::at(2.01, 0.0, height));
    let ahead: Vec<&Pole> = near.poles.iter().filter(|p| p.standard == Standard::R159).collect();
    assert_eq!(ahead.len(), 9);
    for pole in ahead {
        let [x, y] = [pole.at[0] - 2.01, pole.at[1]];
        let (away, towards) = (x.hypot(y), y.atan2(x));
        let mut count = 0;
        for elevation in &elevations {
            for step in 0..900 {
                let aside = TAU * f64::from(step) / 900.0 + OFFSET.to_radians() - towards;
                let inside = 0.15_f64.powi(2) - (away * aside.sin()).powi(2);
                if inside > 0.0 && aside.cos() > 0.0 {
                    let entry = away * aside.cos() - inside.sqrt();
                    let z = height + entry * elevation.to_radians().tan();
                    count += u32::from((0.0..=0.8).contains(&z));
                }
            }
        }
        assert!(count > 20, "{:?}", pole.at);
        assert_eq!(pole.beams, [count], "{:?}", pole.at);
        assert!(pole.seen);
    }
    // The body hides all that is straight behind it.
    let behind = near.poles.iter().filter(|p| p.standard == Standard::R158Detection);
    assert!(behind.clone().count() == 15 && behind.clone().all(|p| p.beams == [0] && !p.seen));
}

#[test]
fn ground_inside_and_on_top_of_things_is_none() {
    let area = |others: &str| {
        let scene = scene(others);
        let problem = Arc::new(problem(&scene));
        NearSite::new(&scene, &problem).unwrap().ground_area()
    };
    let free = area("");
    // The body's box, grown by 10 m with round corners, without the box.
    let exact = 4.0 * (BODY[0] + BODY[1]) * NEAR + std::f64::consts::PI * NEAR * NEAR;
    assert!((free - exact).abs() < 0.01 * exact, "{free} {exact}");
    let house = |top: f64| {
        format!(
            r#", {{ "class": "building", "box": {{ "min": [5, -3, 0], "max": [9, 3, {top}] }} }}"#
        )
    };
    for top in [0.5, 1.9, 6.0] {
        assert_eq!(free - area(&house(top)), 24.0, "{top}");
    }
    let roof = r#", { "class": "vegetation", "box": { "min": [5, -3, 3], "max": [9, 3, 6] } }"#;
    assert_eq!(area(roof), free);
    let low = r#", { "class": "sidewalk", "box": { "min": [5, -3, 0], "max": [9, 3, 0.15] } }"#;
    assert_eq!(area(low), free);
}

#[test]
fn scenes_without_body_or_ground_are_refused() {
    let whole = r#"{ "sightline": 1,
        "roi": { "min": [-4, -4, 0], "max": [4, 4, 3], "voxel": [0.5, 0.5, 0.5] },
        "lidar": { "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 100 },
        "mount": { "min": [-1, -1, 2], "max": [1, 1, 2.5], "lidars": 1 },
        "static": [{ "class": "CLASS", "plane": { "min": [-9, -9], "max": [9, 9], "z": 0 } }]EGO }"#;
    let ego = |size: &str| {
        format!(
            r#", "ego": {{ "body": [{{ "class": "vehicle", "box": {{ "foot": [0, 0, 0], "size": {size} }} }}] }}"#
        )
    };
    let refusal = |class: &str, ego: &str| {
        let text = whole.replace("CLASS", class).replace("EGO", ego);
        let scene = Scene::from_json(&text, Path::new(""), "s.json").unwrap();
        let problem = Arc::new(problem(&scene));
        NearSite::new(&scene, &problem).err().map(|error| error.to_string())
    };
    assert_eq!(refusal("road", &ego("[2, 1, 1]")), None);
    let says = |text: Option<String>, words: &str| {
        let text = text.expect("a refusal");
        assert!(text.contains(words) && text.starts_with("s: "), "{text}");
    };
    says(refusal("road", ""), "no body");
    says(refusal("wall", &ego("[2, 1, 1]")), "no ground within 10 m");
    says(refusal("road", &ego("[80, 1, 1]")), "80 m long");
}

#[test]
fn a_cylinder_is_met_at_its_side_its_top_or_not() {
    use glam::DVec3;
    let distance = |from: [f64; 3], along: [f64; 3]| {
        ground::distance(DVec3::from(from), DVec3::from(along).normalize(), [1.0, 0.0])
    };
    assert!((distance([0.0, 0.0, 0.4], [1.0, 0.0, 0.0]).unwrap() - 0.85).abs() < 1e-12);
    assert_eq!(distance([0.0, 0.0, 0.9], [1.0, 0.0, 0.0]), None);
    assert_eq!(distance([0.0, 0.16, 0.4], [1.0, 0.0, 0.0]), None);
    assert_eq!(distance([2.0, 0.0, 0.4], [1.0, 0.0, 0.0]), None);
    assert!((distance([1.1, 0.0, 2.0], [0.0, 0.0, -1.0]).unwrap() - 1.2).abs() < 1e-12);
    assert_eq!(distance([1.1, 0.0, 2.0], [0.0, 0.0, 1.0]), None);
    assert_eq!(distance([1.0, 0.0, 0.4], [1.0, 0.0, 0.0]), None, "from inside");
    // Down at 45° over the near edge onto the top, 0.1 m behind it.
    let top = distance([0.95 - 1.0, 0.0, 1.8], [1.0, 0.0, -1.0]).unwrap();
    assert!((top - 2_f64.sqrt()).abs() < 1e-12, "{top}");
}
