//! Mounts on patches of meshes: where sensors stand, how they rest, and what is wrong with such a mount.

use std::path::Path;

use glam::DVec3;

use super::*;
use crate::vehicle::{PoseGrid, Region, SensorName, SensorPose, Spacing};

/// A van whose one mount is `mount` on the roof of `tests/data/roof.obj`.
fn van(mount: &str) -> Result<Scene, DescriptionError> {
    let vehicle = format!(
        r#"{{ "name": "van", "sensors": [{{ "name": "a", "lidar": {{ "directions": [[1, 0, 0]], "range": 30 }} }}],
          "mounts": [{{ "name": "roof", {mount}, "count": 2 }}] }}"#
    );
    let scene = full(BOX, "");
    let (from, to) = (scene.find("\"lidar\"").unwrap(), scene.find("\"static\"").unwrap());
    let text = format!("{}\"vehicle\": {vehicle}, {}", &scene[..from], &scene[to..]);
    Scene::from_json(&text, &Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data"), "van.json")
}

const ROOF: &str = r#""mesh": { "file": "roof.obj", "facing": { "direction": [0, 0, 1] },
    "within": { "min": [-0.7, -0.55, 1], "max": [0.9, 0.55, 2] } },
    "offset": [0, 0.2], "roll": [-0.2, 0.2], "yaw": [-1, 1]"#;

fn roof() -> Region {
    Region::clone(&van(ROOF).unwrap().constraints().slots[0].region)
}

/// Height of the dome that the mesh is made of.
fn dome(x: f64, y: f64) -> f64 {
    1.5 - 0.1 * x * x - 0.2 * y * y
}

#[test]
fn sensors_stand_on_a_curved_roof_and_rest_on_its_normal() {
    let region = roof();
    let [low, high] = region.corners();
    assert!((low[0] + 0.7).abs() < 0.01 && (high[0] - 0.9).abs() < 0.01, "{low:?} {high:?}");
    assert!((low[1] + 0.55).abs() < 1e-9 && (high[2] - 1.5 - 0.2).abs() < 0.01, "{high:?}");
    let (mut steps, mut tilted) = (0, 0.0_f64);
    for i in 0..40 {
        let share = |k: usize| f64::from(i * (7 + 4 * k as i32) % 40) / 39.0;
        let field = |k: usize| region.lower[k] + share(k) * (region.upper[k] - region.lower[k]);
        let pose = region.pose([field(0), field(1), 0.0, 0.0, 0.0, 0.0], SensorName::default());
        let at = pose.position();
        // Chords of a grid with 0.25 m and 0.2 m between its lines lie below the dome by h²/8 · curvature.
        let below = dome(at.x, at.y) - at.z;
        assert!((-1e-6..0.0036).contains(&below), "{below} at {at}");
        let axis = pose.ego_from_sensor().rotation.z_axis;
        let normal = DVec3::new(0.2 * at.x, 0.4 * at.y, 1.0).normalize();
        assert!(axis.angle_between(normal) < 0.02, "{axis} is not {normal}");
        let rotation = pose.ego_from_sensor().rotation;
        let is_ahead = rotation.y_axis.x.abs() < 1e-12 && rotation.x_axis.x > 0.9;
        assert!(is_ahead, "as far ahead as the normal allows: {rotation}");
        tilted = tilted.max(axis.angle_between(DVec3::Z));
        steps += 1;
    }
    assert!(steps == 40 && tilted > 0.15, "the roof is curved: {tilted}");
}

#[test]
fn poses_on_a_mesh_are_found_again_and_others_moved_to_it() {
    let region = roof();
    let name = SensorName::default();
    for fields in [[0.1, -0.2, 0.05, 0.1, 0.0, 0.7], [-0.5, 0.4, 0.2, -0.2, 0.0, -1.0]] {
        let pose = region.pose(fields, name);
        assert_eq!(region.outside(&pose), []);
        let back = region.fields(&pose);
        assert!(fields.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-9), "{back:?}");
    }
    // Two metres to the left there is no roof: the nearest point of it, at the same x.
    let beside = region.pose([0.1, 2.0, 0.0, 0.0, 0.0, 0.0], name);
    assert!((beside.y - 0.55).abs() < 1e-6, "{beside:?}");
    assert_eq!(region.outside(&beside), []);
    let floating = SensorPose { z: beside.z + 0.3, ..beside };
    let found = region.outside(&floating);
    // As the mean normal leans a little, so does the foot, and the normal there.
    assert!(found[0].0 == "z" && (found[0].1 - 0.1).abs() < 1e-3, "{found:?}");
    let found = region.outside(&SensorPose { y: 0.75, ..beside });
    assert!(found.iter().any(|(field, by)| *field == "x" && (by - 0.2).abs() < 0.02), "{found:?}");
}

#[test]
fn every_pose_of_a_grid_on_a_mesh_keeps_the_rules() {
    let constraints = van(ROOF).unwrap().constraints();
    let grid = PoseGrid::new(&constraints, Spacing { metres: 0.13, radians: 0.2 }).unwrap();
    assert!(grid.len() > 1000);
    for number in (0..grid.len()).step_by(61) {
        let pose = grid.pose(number);
        assert_eq!(constraints.slots[0].region.outside(&pose), [], "pose {number}");
        assert_eq!(grid.nearest(0, &pose), number);
    }
    let bounds = constraints.variable_bounds();
    assert_eq!(bounds.len(), 2 * 5, "two in the plane, the offset, roll and yaw");
    let middle: Vec<f64> = bounds.iter().map(|(low, high)| 0.4 * low + 0.6 * high).collect();
    let lidars = constraints.poses_of(&middle);
    let placement = crate::vehicle::Placement { name: "x".into(), lidars };
    let back = constraints.variables_of(&placement).unwrap();
    assert!(middle.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-9));
}

#[test]
fn a_side_of_a_mesh_looks_along_its_normal() {
    let side = r#""mesh": { "file": "roof.obj", "facing": { "direction": [0, 1, 0], "angle": 0.3 },
        "within": { "min": [-0.5, 0, 0.6], "max": [0.5, 2, 1.1] } }, "offset": [0, 0.1]"#;
    let region = Region::clone(&van(side).unwrap().constraints().slots[0].region);
    let pose = region.pose([0.1, 0.2, 0.0, 0.0, 0.0, 0.0], SensorName::default());
    let rotation = pose.ego_from_sensor().rotation;
    assert!(
        (rotation.x_axis - DVec3::Y).length() < 1e-9
            && (rotation.z_axis - DVec3::Z).length() < 1e-9
    );
    assert!((pose.y - 0.9).abs() < 1e-9, "0.8 is the wall, 0.1 the offset: {pose:?}");
    // x of a sensor that looks left is to the right of the vehicle's tail: y of its plane points backwards.
    assert!((pose.x + 0.2).abs() < 1e-9, "{pose:?}");
}

#[test]
fn mounts_on_meshes_that_cannot_be_say_why() {
    let cases = [
        (r#""mesh": { "file": "roof.obj" }"#, "its normals cancel out"),
        (
            r#""mesh": { "file": "roof.obj", "within": { "min": [5, 5, 5], "max": [6, 6, 6] } }"#,
            "with 0 triangles there",
        ),
        (r#""mesh": { "file": "none.obj" }"#, "none.obj"),
        (
            r#""mesh": { "file": "roof.obj", "facing": { "direction": [0, 0, 0] } }"#,
            "mounts[0].mesh.facing.direction",
        ),
        (
            r#""mesh": { "file": "roof.obj", "facing": { "direction": [0, 0, 1], "angle": 3 } }"#,
            "at most π/2",
        ),
        (r#""mesh": { "file": "roof.obj" }, "polygon": []"#, "or a `mesh`"),
        (r#""mesh": { "file": "roof.obj", "scale": -1 }"#, "a scale above 0"),
        (
            r#""mesh": { "file": "roof.obj", "facing": { "direction": [0, 0, 1] } }, "offset": [1, 0]"#,
            "offset",
        ),
    ];
    for (mount, want) in cases {
        let error = van(mount).unwrap_err().to_string();
        assert!(error.contains(want), "{mount}: {error}");
        assert!(error.contains("van.json") || error.contains("none.obj"), "{mount}: {error}");
    }
}
