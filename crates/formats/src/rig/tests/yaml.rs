//! YAML of rigs: units, keys that nobody knows, static transforms.

use super::{error, read, source};
use crate::rig::{ImportSettings, RigFormat, import_texts};

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-12
}

/// Expected numbers by `load_yaml` of xacro 2.1.1.
#[test]
fn unit_tags_are_those_of_xacro() {
    let text = "base_link:\n  lidar:\n    x: !millimeters 900\n    y: !foot 1\n    z: !inches 70\n    \
                roll: !radians 0.5\n    pitch: !degrees 40\n    yaw: !degrees '-90'\n";
    let pose = read(text).unwrap().rig.lidars[0].pose;
    let wanted = [0.9, 0.3048, 1.778, 0.5, 0.698_131_700_797_731_8, -std::f64::consts::FRAC_PI_2];
    let found = [pose.x, pose.y, pose.z, pose.roll, pose.pitch, pose.yaw];
    assert!(found.iter().zip(wanted).all(|(a, b)| near(*a, b)), "{found:?}");
    let with = |tagged: &str| {
        let text = text.replace("!degrees 40", tagged);
        import_texts(&[source("kit.yaml", &text)], &ImportSettings::default()).unwrap_err()
    };
    for (tagged, parts) in [
        ("!meters 40", ["`!meters` is the unit of a length", "line 7"]),
        ("!gradians 40", ["`!gradians` is not known", "line 7"]),
        ("!degrees 20+20", ["`20+20`", "only xacro"]),
        ("4O", ["base_link.lidar.pitch: `4O`", "(line 7, column 12)"]),
    ] {
        assert_holds!(with(tagged), parts[0], parts[1]);
    }
}

/// `010` is 8 in YAML 1.1 and 10 in 1.2, and a text to this reader.
#[test]
fn texts_are_no_numbers_but_in_files_of_carla() {
    let kit = |x: &str| {
        format!("base_link:\n  lidar: {{x: {x}, y: 0, z: 2, roll: 0, pitch: 0, yaw: 0}}\n")
    };
    for text in ["010", "-012", "'1.5'", "!!str 5"] {
        assert_holds!(error(&kit(text)), "base_link.lidar.x: `", "a finite number");
    }
    let sound = transform("base_link", "lidar", [1.0, 0.0, 2.0], [0.0, 0.0, 0.0, 1.0]);
    assert_holds!(error(&sound.replace("x: 1.0", "x: 010")), "a finite number");
    let carla = |x: &str| {
        format!(r#"[{{"type": "sensor.lidar.ray_cast", "id": "L", "x": "{x}", "y": 0, "z": 2}}]"#)
    };
    for (text, wanted) in [("1.5", 1.5), ("0.5", 0.5), ("-0", 0.0)] {
        assert_eq!(read(&carla(text)).unwrap().rig.lidars[0].pose.x, wanted);
    }
    assert!(error(&carla("010")).contains("`010`"));
}

#[test]
fn keys_that_may_move_a_frame_are_errors_and_others_notes() {
    let six = "x: 1, y: 0, z: 2, roll: 0, pitch: 0, yaw: 0";
    let kit = |numbers: &str| format!("base_link:\n  lidar: {{{numbers}}}\n");
    let slip = error(&kit("x: 1, y: 0, z: 2, rol: 0, pitch: 0, yaw: 0"));
    assert!(slip.contains("unknown key `rol`; did you mean `roll`? (line 2"), "{slip}");
    for extra in ["unit: mm", "scale: 0.001", "qx: 0", "X: 3"] {
        assert_holds!(error(&kit(&format!("{six}, {extra}"))), "base_link.lidar: unknown key");
    }
    assert_eq!(read(&kit(&format!("{six}, type: VLP16"))).unwrap().notes.len(), 1);
    let notes = |more: &str| read(&(kit(six) + more)).unwrap().notes;
    let of = |more: &str| notes(more).into_iter().find(|note| note.text().contains("holds no"));
    assert!(of("").is_none());
    assert!(!of("version: 2\n").unwrap().is_doubt());
    let doubt = of("kit:\n  lidar_2: {east: 1, north: 2}\n").unwrap();
    assert!(doubt.is_doubt() && doubt.text().starts_with("file: kit: "), "{doubt}");
}

/// A transform as `ros2 topic echo` prints it.
fn transform(parent: &str, child: &str, xyz: [f64; 3], xyzw: [f64; 4]) -> String {
    let [x, y, z] = xyz;
    let [qx, qy, qz, qw] = xyzw;
    format!(
        "- header:\n    stamp:\n      sec: 1\n      nanosec: 5\n    frame_id: {parent}\n  \
         child_frame_id: {child}\n  transform:\n    translation:\n      x: {x:?}\n      y: {y:?}\n      \
         z: {z:?}\n    rotation:\n      x: {qx:?}\n      y: {qy:?}\n      z: {qz:?}\n      w: {qw:?}\n"
    )
}

const LEVEL: [f64; 4] = [0.0, 0.0, 0.0, 1.0];
/// A quarter turn to the left.
const LEFT: [f64; 4] = [0.0, 0.0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2];

#[test]
fn static_transforms_are_chained_over_messages() {
    let kit = transform("base_link", "kit", [1.0, 0.0, 2.0], LEFT);
    let lidar = transform("kit", "velodyne_top", [0.5, 0.0, 0.1], LEVEL);
    let camera = transform("/kit", "/camera", [0.0, 0.0, 0.0], LEVEL);
    // The second publisher repeats a transform of the first.
    let text = format!("transforms:\n{kit}---\ntransforms:\n{kit}{lidar}{camera}---\n");
    let imported = read(&text).unwrap();
    assert_eq!(imported.format, RigFormat::Tf);
    assert_eq!(imported.left_out, ["kit", "camera"]);
    let pose = imported.rig.lidars[0].pose;
    assert!(near(pose.x, 1.0) && near(pose.y, 0.5) && near(pose.z, 2.1), "{pose:?}");
    assert!(near(pose.yaw, std::f64::consts::FRAC_PI_2), "{pose:?}");
    // A list without its message, and one transform alone.
    assert_eq!(read(&(kit.clone() + &lidar)).unwrap().format, RigFormat::Tf);
    let alone = transform("base_link", "lidar", [1.0, 0.0, 2.0], LEVEL);
    let alone = alone.replace("- header", "  header");
    assert_eq!(read(&alone).unwrap().rig.lidars[0].pose.x, 1.0);
}

#[test]
fn faults_of_static_transforms_say_their_line() {
    let one = transform("base_link", "lidar", [1.0, 0.0, 2.0], LEVEL);
    let text = format!("transforms:\n{one}");
    let other = transform("base_link", "lidar", [1.5, 0.0, 2.0], LEVEL);
    let cases = [
        (format!("{text}- '...'\n"), "--full-length` prints all) belongs (line 18, column 3)"),
        (text.replace("w: 1.0", "w: 2.0"), "a quaternion of length 2"),
        (text.replace("w: 1.0", "w: .nan"), "rotation.w: `.nan`"),
        (text.replace("w: 1.0", "w: !degrees 1"), "a number without a unit belongs here"),
        (text.replace("      w: 1.0\n", ""), "rotation: `w` is missing"),
        (text.replace("      y: 0.0\n      z: 2", "      Y: 0.0\n      z: 2"), "did you mean `y`?"),
        (text.replace("x: 0.0\n", "roll: 0.0\n"), "rotation: unknown key `roll`"),
        (text.replace("frame_id: base", "frame: base"), "unknown key"),
        (format!("{text}{other}"), "transforms[1]: the frame `lidar` is placed a second time"),
        (format!("{text}---\nname: 3\n"), "unknown key `name`"),
    ];
    for (text, part) in cases {
        let error = error(&text);
        assert!(error.contains(part) && error.contains("(line "), "{part}: {error}");
    }
}
