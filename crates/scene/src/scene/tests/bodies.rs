//! Bodies of the own vehicle in poses: against shapes written where they stand, and every fault.

use super::*;

const TRAILER: &str =
    r#"{ "class": "vehicle", "box": { "center": [0, 0, 0], "size": [8, 2.5, 3] } }"#;
const TRACTOR: &str =
    r#"{ "class": "vehicle", "box": { "min": [-2, -1, 0], "max": [2, 1, 1.5] } }"#;

fn with(body: &str, bodies: &str, more: &str) -> Checked<Scene> {
    let wall = r#"{ "class": "wall", "box": { "foot": [20, 0, 0], "size": [1, 40, 5] } }"#;
    read(&full(wall, &format!(r#", {more} "ego": {{ "body": [{body}], "bodies": [{bodies}] }}"#)))
}

fn trailer(poses: &str) -> String {
    format!(r#"{{ "name": "trailer", "parts": [{TRAILER}], "poses": [{poses}] }}"#)
}

#[test]
fn a_trailer_in_one_pose_is_the_same_box_written_turned_to_the_bit() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let turned = format!(r#"{{ "x": -3, "y": -6, "z": 1.6, "yaw": {quarter} }}"#);
    let posed = with(TRACTOR, &trailer(&turned), "").unwrap();
    let written = format!(
        r#"{TRACTOR}, {{ "class": "vehicle", "box": {{ "center": [-3, -6, 1.6], "size": [8, 2.5, 3], "yaw": {quarter} }} }}"#
    );
    let written = with(&written, "", "").unwrap();
    let whole = |scene: &Scene| scene.frame(0, EgoBody::Include);
    assert_eq!(whole(&posed), whole(&written));
    assert_eq!(posed.body(), written.body());
    assert_eq!((posed.parts(EgoBody::Include), posed.has_moving_bodies()), (0..2, false));
    let corners = posed.body().into_iter().flatten();
    let low = corners.fold([f32::MAX; 2], |low, [x, y, _]| [low[0].min(x), low[1].min(y)]);
    // Eight metres long across: from y = −10 to −2, 2.5 m wide around x = −3.
    assert!((low[0] + 4.25).abs() < 1e-6 && (low[1] + 10.0).abs() < 1e-6, "{low:?}");
}

#[test]
fn a_trailer_that_bends_is_in_each_frame_the_box_written_there_to_the_bit() {
    let poses = [
        r#"{ "x": -6, "y": 0, "z": 1.6 }"#,
        r#"{ "x": -5.5, "y": -1, "z": 1.6, "yaw": 0.4 }"#,
        r#"{ "x": -5, "y": -2, "z": 1.7, "yaw": 0.8, "pitch": -0.1, "roll": 0.05 }"#,
    ];
    let bending = with(TRACTOR, &trailer(&poses.join(", ")), r#""frames": 3,"#).unwrap();
    assert_eq!((bending.frame_count(), bending.parts(EgoBody::Include)), (3, 0..3));
    assert_eq!(bending.owner(2), PartOwner::EgoBody(0));
    for (frame, pose) in poses.iter().enumerate() {
        let still = with(TRACTOR, &trailer(pose), "").unwrap();
        assert_eq!(bending.frame(frame, EgoBody::Include), still.frame(0, EgoBody::Include));
    }
    assert_eq!(bending.frame(1, EgoBody::Exclude).faces.len(), 12);
    assert_holds!(notes(&bending), "s.json: ego.bodies[0]: moves from frame to frame");
}

#[test]
fn a_trailer_over_the_tractor_is_doubted_in_its_pose() {
    let doubts =
        |poses: &str| super::doubts(&with(TRACTOR, &trailer(poses), r#""frames": 2,"#).unwrap());
    let behind = r#"{ "x": -6.5, "y": 0, "z": 1.6 }"#;
    let over = r#"{ "x": -2, "y": 0, "z": 1.6 }"#;
    assert_eq!(doubts(&format!("{behind}, {behind}")), "");
    // From x = −6 to 2 m and 0.1 to 3.1 m up it holds all of the tractor but 0.1 of its 1.5 m; places are 0.25 m apart.
    for (poses, pose) in [(format!("{behind}, {over}"), 1), (over.to_owned(), 0)] {
        let words = format!(
            "ego.bodies[0].poses[{pose}]: 100 % of the smaller one of this body and the first body lie in both"
        );
        assert_holds!(doubts(&poses), &words);
    }
    // The nose of a trailer on a fifth wheel holds the middle of the tractor, and 2.1 / 4 · 0.9 / 1.5 of its room.
    let nose = r#"{ "x": -3.9, "y": 0, "z": 2.1 }"#;
    assert_eq!(doubts(&format!("{behind}, {nose}")), "");
}

#[test]
fn the_bodies_of_a_vehicle_take_the_place_of_the_scenes() {
    let vehicle = r#"{ "sensors": [{ "name": "a", "lidar": { "channels": 4, "fov": [-20, 0], "azimuth_steps": 8, "range": 50 } }],
        "mounts": [{ "name": "roof", "min": [0, 0, 2], "max": [0, 0, 2], "count": 1 }],
        "bodies": [{ "parts": [{ "class": "vehicle", "box": { "min": [-1, -1, 0], "max": [1, 1, 1] } }], "poses": [{ "x": -4, "y": 0 }] }] }"#;
    let text = with_vehicle(vehicle, "", &format!(r#", "ego": {{ "body": [{TRACTOR}] }}"#));
    let scene = read(&text).unwrap();
    let least = scene.body().into_iter().flatten().map(|corner| corner[0]).fold(f32::MAX, f32::min);
    assert_eq!((scene.body().len(), least), (12, -5.0));
    let two = vehicle.replace("\"poses\": [", "\"poses\": [{ \"x\": 0, \"y\": 0 }, ");
    let words = "s.json: vehicle.bodies[0].poses: a list of 2 is not one pose for all frames";
    assert_begins!(message(&text.replace(vehicle, &two)), words);
}

#[test]
fn faults_of_bodies_name_their_field_and_the_mend() {
    let pose = r#"{ "x": -6, "y": 0 }"#;
    let two = trailer(&format!("{pose}, {pose}"));
    let good = trailer(pose);
    for (bodies, more, expected) in [
        (
            good.replace(&format!(", \"poses\": [{pose}]"), ""),
            "",
            "s.json: ego.bodies[0]: `poses` is missing: say where the body is in the ego frame, with one pose, or one for \
             each frame",
        ),
        (
            two.clone(),
            r#""frames": 3,"#,
            "s.json: ego.bodies[0].poses: a list of 2 is not one pose for all frames, or one for each of the 3 frames of s.json; for scenes of several lengths give one pose, or",
        ),
        (
            trailer(""),
            "",
            "s.json: ego.bodies[0].poses: an empty list is not a list of at least one pose",
        ),
        (
            good.replace(TRAILER, ""),
            "",
            "s.json: ego.bodies[0].parts: an empty list is not a shape of the body; add one",
        ),
        (good.replace("\"name\"", "\"nam\""), "", "did you mean `name`?"),
        (
            good.replace("\"class\": \"vehicle\"", "\"class\": \"trailer\""),
            "",
            "s.json: ego.bodies[0].parts[0].class: no class is called `trailer`; the own body is usually of class `vehicle`; known \
             are `building`, `fence`, `other`, `pedestrian`, `pole`, `vegetation`, `vehicle`, ",
        ),
        (
            good.replace("\"class\": \"vehicle\"", "\"class\": \"vehicel\""),
            "",
            "parts[0].class: no class is called `vehicel`; did you mean `vehicle`?",
        ),
        (
            good.replace(&format!("[{pose}]"), pose),
            "",
            "ego.bodies[0].poses: an object stands where a list belongs; write `[{ … }]`",
        ),
        (
            good.replace("\"x\": -6", "\"x\": 2e9"),
            "",
            "s.json: ego.bodies[0].poses[0].x: 2000000000 is not a coordinate",
        ),
        (
            good.replace("\"y\": 0", "\"y\": 0, \"roll\": 90"),
            "",
            "s.json: ego.bodies[0].poses[0].roll: 90 is not an angle",
        ),
        (
            good.replace("\"y\": 0", "\"y\": 0, \"yaw\": -30"),
            "",
            "s.json: ego.bodies[0].poses[0].yaw: -30 is not an angle in radians within one turn",
        ),
    ] {
        assert_holds!(with(TRACTOR, &bodies, more).unwrap_err(), expected);
    }
    assert!(with(TRACTOR, &two, r#""frames": 2,"#).is_ok());
}
