//! The near field on slopes: as on level ground where the vehicle is tilted with it, found where it is not.

use std::fs;

use super::*;

/// A road of 120 by 120 m through the origin that climbs `degrees` along x, as a mesh, and motion of the ego.
fn on_slope(degrees: f64, ego: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let (sin, cos) = degrees.to_radians().sin_cos();
    let corner = |x: f64, y: f64| format!("v {} {y} {}\n", x * cos, x * sin);
    let corners = [[-60.0, -60.0], [60.0, -60.0], [60.0, 60.0], [-60.0, 60.0]];
    let obj = corners.map(|[x, y]| corner(x, y)).concat() + "f 1 2 3\nf 1 3 4\n";
    fs::write(folder.path().join("road.obj"), obj).unwrap();
    let rest = format!(
        r#""static": [{{ "class": "road", "mesh": {{ "file": "road.obj" }} }}],
        "ego": {{ {ego}, "body": [{}] }}"#,
        body()
    );
    written(folder.path(), &rest)
}

fn spinning() -> BeamTable {
    let channels: Vec<(f64, f64)> = (0..24).map(|k| (-62.3 + 2.5 * f64::from(k), OFFSET)).collect();
    BeamTable::spinning(&channels, 250, 100.0).unwrap()
}

fn looked(scene: &Scene) -> NearField {
    look(scene, spinning(), SensorPose::at(0.3, -0.2, 2.1))
}

/// Numbers of a near field that must agree on level ground and on a slope.
fn numbers(near: &NearField) -> [f64; 7] {
    let depth = |depth: Option<f64>| depth.unwrap_or(99.0);
    let zone = &near.zone;
    [
        near.near_field,
        near.ring.unwrap(),
        near.blind_area,
        zone.area,
        depth(zone.ahead),
        depth(zone.left),
        near.beams[0].own,
    ]
}

#[test]
fn a_road_that_climbs_gives_the_near_field_of_a_level_one() {
    let level = numbers(&looked(&scene("")));
    assert!(level[0] > 0.4 && level[0] < 0.99 && level[2] > 1.0, "{level:?}");
    // Up, down and across; poses of a slope that is across the vehicle have a roll.
    let tilt = 8_f64.to_radians();
    let (sin, cos) = tilt.sin_cos();
    let route = |sign: f64| {
        let end = [10.0 * sign * cos, 10.0 * sign * sin];
        format!(
            r#""route": {{ "points": [[0, 0, 0], [{}, 0, {}]], "spacing": 0 }}"#,
            end[0], end[1]
        )
    };
    let across =
        format!(r#""poses": [{{ "x": 0, "y": 0, "yaw": 1.5707963267948966, "roll": -{tilt} }}]"#);
    for ego in [route(1.0), route(-1.0), across] {
        let near = numbers(&looked(&on_slope(8.0, &ego)));
        for (k, (found, expected)) in near.iter().zip(level).enumerate() {
            // A beam in hundreds may fall on the other side of an edge.
            let slack = 2e-3 * expected.abs().max(1.0);
            assert!((found - expected).abs() <= slack, "{ego}, {k}: {found} {expected}");
        }
    }
}

/// Straight down from a level vehicle the ground 12 m ahead of a slope of 15° lies 3.2 m up.
#[test]
fn steep_ground_counts_though_the_vehicle_is_level() {
    let area =
        |scene: &Scene| NearSite::new(scene, &Arc::new(problem(scene))).unwrap().ground_area();
    let level = area(&scene(""));
    assert_eq!(area(&on_slope(15.0, r#""poses": [{ "x": 0, "y": 0 }]"#)), level);
    // A corner without ground: nothing is known of a slope.
    let edge = area(&on_slope(0.0, r#""poses": [{ "x": 59, "y": 0 }]"#));
    assert!(edge > 0.4 * level && edge < 0.6 * level, "{edge} {level}");
}
