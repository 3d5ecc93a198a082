//! Mounts on patches of meshes: where sensors stand, how they rest, and errors of bad mounts.

use std::path::Path;

use glam::DVec3;

use super::*;
use crate::vehicle::{PoseGrid, Region, SensorName, SensorPose, Spacing, check_pairs};

/// A van whose one mount is `mount` on the roof of `tests/data/roof.obj`.
fn van(mount: &str) -> Checked<Scene> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data");
    van_with(&format!(r#"{{ "name": "roof", {mount}, "count": 2 }}"#), "", &data)
}

/// A van with some mounts and rules, its meshes in `dir`.
fn van_with(mounts: &str, rules: &str, dir: &Path) -> Checked<Scene> {
    let vehicle = format!(
        r#"{{ "name": "van", "sensors": [{{ "name": "a", "lidar": {{ "directions": [[1, 0, 0]], "range": 30 }} }}],
          "mounts": [{mounts}]{rules} }}"#
    );
    Scene::from_json(&with_vehicle(&vehicle, BOX, ""), dir, "van.json")
}

/// An OBJ file of a grid of `count` × `count` squares whose corners are at `at` of two shares from 0 to 1.
fn grid_obj(count: usize, at: impl Fn(f64, f64) -> [f64; 3]) -> String {
    let share = |k: usize| k as f64 / count as f64;
    let corners = (0..=count).flat_map(|i| (0..=count).map(move |j| (i, j)));
    let mut text: String = corners
        .map(|(i, j)| {
            let [x, y, z] = at(share(i), share(j));
            format!("v {x} {y} {z}\n")
        })
        .collect();
    for (i, j) in (0..count).flat_map(|i| (0..count).map(move |j| (i, j))) {
        let [a, b] = [i * (count + 1) + j + 1, (i + 1) * (count + 1) + j + 1];
        text += &format!("f {a} {b} {}\nf {b} {} {}\n", a + 1, b + 1, a + 1);
    }
    text
}

const ROOF: &str = r#""mesh": { "file": "roof.obj", "facing": { "direction": [0, 0, 1] },
    "within": { "min": [-0.7, -0.55, 1], "max": [0.9, 0.55, 2] } },
    "offset": [0, 0.2], "roll": [-0.2, 0.2], "yaw": [-1, 1]"#;

#[test]
fn a_right_angle_with_four_decimals_is_one() {
    let with = |angle: &str| {
        let roof = ROOF.replace("[0, 0, 1] }", &format!("[0, 0, 1], \"angle\": {angle} }}"));
        Region::clone(&van(&roof).unwrap().constraints().slots[0].region).corners()
    };
    assert_eq!(with("1.5708"), with("1.5707963267948966"));
}

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
    // The mean normal leans a little, so the foot and its normal lean too.
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
    let off = (rotation.x_axis - DVec3::Y).length() + (rotation.z_axis - DVec3::Z).length();
    assert!(off < 1e-9, "{rotation}");
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
        assert_holds!(error, want);
        assert!(error.contains("van.json") || error.contains("none.obj"), "{mount}: {error}");
    }
}

/// Radius of the cylinders that patches are cut from.
const RADIUS: f64 = 2.0;

#[test]
fn sensors_on_a_cylinder_stand_and_rest_as_its_formula_says() {
    let dir = tempfile::tempdir().unwrap();
    // Its axis lies along x at z = −0.5; 1.2 m of it in y.
    let roof = |u: f64, v: f64| {
        let y: f64 = 1.2 * v - 0.6;
        [2.0 * u - 1.0, y, (RADIUS * RADIUS - y * y).sqrt() - 0.5]
    };
    std::fs::write(dir.path().join("cylinder.obj"), grid_obj(60, roof)).unwrap();
    let mount = r#"{ "name": "roof", "count": 1, "offset": [0, 0.3], "yaw": [-1, 1],
        "mesh": { "file": "cylinder.obj", "facing": { "direction": [0, 0, 1] } } }"#;
    let scene = van_with(mount, "", dir.path()).unwrap();
    let region = Region::clone(&scene.constraints().slots[0].region);
    for k in 0..50 {
        let share = |step: f64| (f64::from(k) * step).fract();
        let [x, y] = [1.9 * share(0.755) - 0.95, 1.1 * share(0.570) - 0.55];
        let (offset, yaw) = (0.3 * share(0.3), 2.0 * share(0.7) - 1.0);
        let pose = region.pose([x, y, offset, 0.0, 0.0, yaw], SensorName::default());
        // The mean normal is straight up, and the middle of the patch in the plane y = 0.
        assert!((pose.y - y).abs() < 1e-9 && (pose.x - x).abs() < 1e-9, "{pose:?}");
        let height = (RADIUS * RADIUS - y * y).sqrt() - 0.5 + offset;
        // A chord of 2 cm lies 0.025 mm below the arc.
        assert!((0.0..3e-5).contains(&(height - pose.z)), "{} at {y}", height - pose.z);
        let rotation = pose.ego_from_sensor().rotation;
        let normal = DVec3::new(0.0, y / RADIUS, (1.0 - y * y / RADIUS / RADIUS).sqrt());
        assert!(rotation.z_axis.angle_between(normal) < 2e-4, "{} at {y}", rotation.z_axis);
        let ahead = DVec3::X * yaw.cos() + normal.cross(DVec3::X) * yaw.sin();
        assert!(rotation.x_axis.angle_between(ahead) < 2e-4, "{} at {y}", rotation.x_axis);
    }
}

#[test]
fn mirrored_pairs_stand_on_a_roof_that_is_about_its_own_image() {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/data");
    let symmetric = ", \"symmetric\": true";
    for count in [2, 3] {
        let mount = format!(r#"{{ "name": "roof", {ROOF}, "count": {count} }}"#);
        let scene = van_with(&mount, symmetric, &data).unwrap();
        check_pairs(&scene.constraints(), count);
        // The left half equals the mesh; the right half mirrors it, though the mesh's diagonals all run one way.
        let (own, mesh) = (&scene.constraints().slots[0].region, roof());
        let name = SensorName::default();
        let point = own.pose([0.2, 0.3, 0.0, 0.0, 0.0, 0.0], name);
        let fields = mesh.fields(&point);
        assert!(point.y > 0.2 && fields[2].abs() < 1e-6, "{fields:?}");
        let point = point.mirrored();
        assert!(mesh.fields(&point)[2].abs() < 0.002 && own.fields(&point)[2].abs() < 1e-9);
    }
    // Surfaces below the roof are ignored.
    let dir = tempfile::tempdir().unwrap();
    let layers = |u: f64, v: f64| {
        let y: f64 = 1.2 * v - 0.6;
        if u < 0.5 { [4.0 * u - 1.0, y, 1.5 - 0.1 * y * y] } else { [2.0 - 2.0 * u, y, 1.0] }
    };
    std::fs::write(dir.path().join("layers.obj"), grid_obj(20, layers)).unwrap();
    let mount = r#"{ "name": "roof", "count": 2, "roll": [-0.1, 0.1],
        "mesh": { "file": "layers.obj", "facing": { "direction": [0, 0, 1] } } }"#;
    check_pairs(&van_with(mount, symmetric, dir.path()).unwrap().constraints(), 2);
    let roof = format!(r#"{{ "name": "roof", {ROOF}, "count": 2 }}"#);
    let level = van_with(&roof, ", \"equal_height\": true", &data);
    assert_holds!(level.unwrap_err(), "`roof`, a patch of a mesh");
    let aside = roof.replace("-0.55, 1]", "-0.45, 1]");
    assert_holds!(van_with(&aside, symmetric, &data).unwrap_err(), "(of meshes to within 0.005 m)");
}

#[test]
fn mirrored_pairs_stand_on_two_doors_and_a_tail() {
    let dir = tempfile::tempdir().unwrap();
    // Doors bulge; the right one is bent a millimetre more, and has other triangles.
    let door = |side: f64, more: f64| {
        move |u: f64, v: f64| {
            let x: f64 = 1.0 * u - 0.5;
            let y = (RADIUS * RADIUS - x * x).sqrt() - 1.1 + more * v;
            [x, side * y, 0.5 + 0.4 * v]
        }
    };
    let write = |name: &str, text: String| std::fs::write(dir.path().join(name), text).unwrap();
    write("left.obj", grid_obj(20, door(1.0, 0.0)));
    write("tail.obj", grid_obj(9, |u, v| [-2.0 - 0.1 * v, 1.6 * u - 0.8, 0.4 + 0.5 * v]));
    let side = |name: &str, y: f64| {
        format!(
            r#"{{ "name": "{name}", "count": 2, "offset": [0, 0.05], "yaw": [-0.3, 0.3], "pitch": [0, 0.1],
                "mesh": {{ "file": "{name}.obj", "facing": {{ "direction": [0, {y}, 0] }} }} }}"#
        )
    };
    let tail = r#"{ "name": "tail", "count": 3, "offset": [0, 0.1], "yaw": [-0.2, 0.2],
        "mesh": { "file": "tail.obj", "facing": { "direction": [-1, 0, 0] } } }"#;
    let mounts = format!("{}, {}, {tail}", side("left", 1.0), side("right", -1.0));
    let van = || van_with(&mounts, ", \"symmetric\": true", dir.path());
    write("right.obj", grid_obj(13, door(-1.0, 0.001)));
    let scene = van().unwrap();
    assert!(scene.constraints().kinds().len() == 3);
    check_pairs(&scene.constraints(), 7);
    write("right.obj", grid_obj(13, door(-1.0, 0.02)));
    assert_holds!(van().unwrap_err(), "possible with `left`, which has no mirror image");
}
