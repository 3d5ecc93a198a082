//! URDF: places of links in closed form, and every fault with its link or joint.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_6};

use glam::DVec3;

use super::near;
use crate::mesh::{Geometry, RobotFile, RobotPart};

fn robot(body: &str) -> String {
    format!("<?xml version=\"1.0\"?><robot name=\"r\">{body}</robot>")
}

fn link(name: &str) -> String {
    let shape = "<geometry><box size=\"1 2 3\"/></geometry>";
    format!("<link name=\"{name}\"><visual>{shape}</visual><collision>{shape}</collision></link>")
}

fn joint(kind: &str, parent: &str, child: &str, origin: &str) -> String {
    format!(
        "<joint name=\"{parent}_{child}\" type=\"{kind}\"><origin {origin}/><parent link=\"{parent}\"/>\
         <child link=\"{child}\"/><axis xyz=\"0 0 1\"/><limit lower=\"-0.4\" upper=\"1\"/></joint>"
    )
}

fn read(text: &str, without: &[&str]) -> Result<Vec<RobotPart>, String> {
    read_at(text, without, &[])
}

fn read_at(text: &str, without: &[&str], joints: &[(&str, f64)]) -> Result<Vec<RobotPart>, String> {
    let joints: Vec<_> = joints.iter().map(|(name, at)| ((*name).to_owned(), *at)).collect();
    let without: Vec<String> = without.iter().map(|name| (*name).to_owned()).collect();
    let file = std::path::Path::new("nowhere/robot.urdf");
    RobotFile { file, packages: None, tag: "visual", without: &without, joints: &joints }
        .shapes(text)
        .map(|shapes| shapes.parts)
        .map_err(|fault| format!("{}: {}", fault.element, fault.problem))
}

/// A boom on a slew turned by 90° about z, raised by 30° about y. The tip is 4 m along x of the second joint. With
/// s = sin 30° and c = cos 30° it lies at [1 − 0, 0 + 2 + 4c, 3 + …]. All by hand: Rz(90°) takes x to y and y to −x; a
/// pitch of −30° takes x to (c, 0, s).
#[test]
fn a_chain_of_two_turned_joints_lies_where_trigonometry_says() {
    let (s, c) = FRAC_PI_6.sin_cos();
    let tip = "<link name=\"boom\"><visual><origin xyz=\"4 0 0\" rpy=\"0 0 0\"/>\
               <geometry><cylinder radius=\"0.1\" length=\"2\"/></geometry></visual></link>";
    let slew = format!("xyz=\"1 0 3\" rpy=\"0 0 {FRAC_PI_2}\"");
    let raise = format!("xyz=\"2 0 0.5\" rpy=\"0 {} 0\"", -FRAC_PI_6);
    // Children come before parents: order does not matter.
    let text = robot(
        &[
            tip.to_owned(),
            joint("revolute", "slew", "boom", &raise),
            link("base"),
            link("slew"),
            joint("continuous", "base", "slew", &slew),
        ]
        .concat(),
    );
    let parts = read(&text, &[]).unwrap();
    assert_eq!(parts.len(), 3);
    assert_eq!(parts[0].geometry, Geometry::Cylinder(0.1, 2.0));
    let boom = &parts[0].root_from_part;
    near(boom.translation, [1.0, 2.0 + 4.0 * c, 3.5 + 4.0 * s], 1e-12);
    // The boom's joint turns its child about its own z by half a radian.
    let (sin, cos) = 0.5_f64.sin_cos();
    let turned = read_at(&text, &[], &[("slew_boom", 0.5)]).unwrap();
    let wanted = [1.0 - 4.0 * sin, 2.0 + 4.0 * c * cos, 3.5 + 4.0 * s * cos];
    near(turned[0].root_from_part.translation, wanted, 1e-12);
    for (name, value, told) in [
        ("slew_bom", 0.5, "joints: no joint is called \"slew_bom\"; did you mean `slew_boom`?"),
        (
            "slew_boom",
            1.5,
            "joints: `slew_boom` cannot stand at 1.5 rad; its limits are -0.4 and 1 rad",
        ),
        (
            "base_slew",
            90.0,
            "joints: `base_slew` at 90 rad is more than a turn; angles are in radians",
        ),
    ] {
        assert_eq!(read_at(&text, &[], &[(name, value)]).unwrap_err(), told);
    }
    // The boom's own axes: x along (0, c, s), y along −x of the base, z along (0, −s, c).
    near(boom.rotation * DVec3::X, [0.0, c, s], 1e-12);
    near(boom.rotation * DVec3::Y, [-1.0, 0.0, 0.0], 1e-12);
    near(boom.rotation * DVec3::Z, [0.0, -s, c], 1e-12);
    near(parts[2].root_from_part.translation, [1.0, 0.0, 3.0], 1e-12);
    assert_eq!(read(&text, &["boom", "base"]).unwrap().len(), 1);
}

/// Joint c follows b, which stands at 0, by an offset of 0.7 rad about z; a slide from 0.5 m on stands there.
#[test]
fn joints_that_cannot_stand_at_0_stand_next_to_it() {
    let two = link("a") + &link("b") + &link("c") + &joint("revolute", "a", "b", "xyz=\"1 0 0\"");
    let mimic = "<mimic joint=\"a_b\" multiplier=\"2\" offset=\"0.7\"/></joint>";
    let follower = joint("revolute", "a", "c", "xyz=\"2 0 0\"").replace("</joint>", mimic);
    let part = read(&robot(&(two.clone() + &follower)), &[]).unwrap()[2].root_from_part;
    near(part.translation, [2.0, 0.0, 0.0], 1e-12);
    near(part.rotation * DVec3::X, [0.7_f64.cos(), 0.7_f64.sin(), 0.0], 1e-12);
    let slide = joint("prismatic", "a", "c", "xyz=\"2 0 0\"").replace("-0.4", "0.5");
    let part = read(&robot(&(two.clone() + &slide)), &[]).unwrap()[2].root_from_part;
    near(part.translation, [2.0, 0.0, 0.5], 1e-12);
    let given = read_at(&robot(&(two.clone() + &follower)), &[], &[("a_c", 0.2)]).unwrap_err();
    assert_eq!(given, "joints: `a_c` mimics `a_b`; give that one a value");
    let lost = follower.replace("mimic joint=\"a_b\"", "mimic joint=\"ab\"");
    let told = read(&robot(&(two + &lost)), &[]).unwrap_err();
    assert!(told.starts_with("joint `a_c`: mimics \"ab\", which is no joint"), "{told}");
}

#[test]
fn rpy_turns_about_fixed_axes_and_a_quaternion_says_the_same() {
    let turned = |origin: &str| {
        let text = robot(&(link("a") + &link("b") + &joint("fixed", "a", "b", origin)));
        read(&text, &[]).unwrap()[1].root_from_part.rotation
    };
    // Roll of 90°, then yaw of 90°: y goes to z and stays, z goes to −y and then to x.
    let rpy = turned(&format!("rpy=\"{FRAC_PI_2} 0 {FRAC_PI_2}\""));
    near(rpy * DVec3::X, [0.0, 1.0, 0.0], 1e-12);
    near(rpy * DVec3::Y, [0.0, 0.0, 1.0], 1e-12);
    near(rpy * DVec3::Z, [1.0, 0.0, 0.0], 1e-12);
    let quaternion = turned("quat_xyzw=\"0.5 0.5 0.5 0.5\"");
    assert!((rpy - quaternion).to_cols_array().iter().all(|v| v.abs() < 1e-12));
}

#[test]
fn faults_name_their_link_or_joint_and_the_mend() {
    let shape = |shape: &str| robot(&format!("<link name=\"l\"><visual>{shape}</visual></link>"));
    let geometry = |inner: &str| shape(&format!("<geometry>{inner}</geometry>"));
    let two = link("a") + &link("b");
    let fixed = |parent: &str, child: &str| joint("fixed", parent, child, "");
    let of_kind = |kind: &str, origin: &str| robot(&(two.clone() + &joint(kind, "a", "b", origin)));
    let turned = |origin: &str| of_kind("fixed", origin);
    let two_parents = fixed("a", "b").replace("<child", "<parent link=\"b\"/><child");
    let circle = link("root") + &two + &fixed("a", "b") + &fixed("b", "a");
    let both = link("c") + &two + &fixed("a", "b") + &fixed("c", "b");
    let cases = [
        ("<robot".to_owned(), "file: is not XML: "),
        ("<sdf/>".to_owned(), "file: is a <sdf>, not a <robot>; give a URDF"),
        (robot("<xacro:include/>"), "file: is xacro; expand it with `xacro FILE > robot.urdf`"),
        (geometry("<sphere radius=\"${r}\"/>"), "file: is xacro"),
        (robot(""), "file: has no <link>; give a URDF with shapes"),
        (
            robot("<link name=\"l\"/>"),
            "file: has no <visual> in the links that are meant; write `\"geometry\": \"collision\"`",
        ),
        (
            robot(&two),
            "link `b`: no joint leads to it, nor to link `a`; connect all links to one root",
        ),
        (robot(&(link("a") + &link("a"))), "link `a`: comes twice"),
        (robot(&circle), "link `a`: joints lead in a circle to it; connect it to the root"),
        (robot(&both), "joint `c_b`: joint `a_b` has the same child; leave one out"),
        (
            robot(&(two.clone() + &fixed("a", "bb"))),
            "joint `a_bb`: no link is called \"bb\", its child; did you mean `b`?",
        ),
        (of_kind("ball", ""), "joint `a_b`: type \"ball\" is none of fixed, "),
        (turned("xyz=\"1 2\""), "joint `a_b`: xyz of \"1 2\" is not 3 numbers"),
        (turned("rpy=\"0 0 nan\""), "joint `a_b`: rpy of \"0 0 nan\" is not"),
        (turned("quat_xyzw=\"1 1 0 0\""), "is no unit quaternion"),
        (turned("rotation=\"1\""), "<origin> has \"rotation\"; give xyz, rpy or quat_xyzw"),
        (robot("<link/>"), "link: <link> lacks `name`; add it"),
        (shape(""), "link `l`: <visual> has no <geometry>; give a box, cylinder, sphere or mesh"),
        (
            geometry("<box size=\"1 1 1\"/><sphere radius=\"1\"/>"),
            "link `l`: <geometry> has a second shape, <sphere>; give each a <visual> of its own",
        ),
        (
            shape("<geometry><sphere radius=\"1\"/></geometry><geometry/>"),
            "link `l`: has a second <geometry>; leave one out",
        ),
        (robot(&(two.clone() + &two_parents)), "joint `a_b`: has a second <parent>; leave one out"),
        (geometry("<capsule/>"), "link `l`: <capsule> is not read; give a box,"),
        (geometry("<box size=\"1 0 1\"/>"), "link `l`: size of 0 is not a length above 0"),
        (geometry("<sphere/>"), "link `l`: <sphere> lacks `radius`; add it"),
        (
            geometry("<mesh filename=\"a.stl\" scale=\"1 0 1\"/>"),
            "link `l`: scale of [1, 0, 1] is not three numbers other than 0",
        ),
        (
            geometry("<mesh filename=\"../a.stl\"/>"),
            "leaves the folder nowhere; copy the file into it, or give --trust-paths",
        ),
        (
            geometry("<mesh filename=\"http://x/a.stl\"/>"),
            "is not a file; copy the mesh beside the URDF",
        ),
        (
            geometry("<mesh filename=\"package://car/a.stl\"/>"),
            "no folder `car` is beside the file, and none with a package.xml above it; give `\"packages\"`",
        ),
        (geometry("<mesh filename=\"package://../a.stl\"/>"), "no folder `..` is beside the file"),
        (
            geometry("<mesh filename=\"hull.stl\"/>"),
            "link `l`: \"hull.stl\" is no file; copy the mesh to nowhere/hull.stl",
        ),
    ];
    for (text, told) in cases {
        assert_holds!(read(&text, &[]).unwrap_err(), told);
    }
    let message = read(&robot(&link("wheel")), &["whel"]).unwrap_err();
    assert_eq!(message, "without: no link is called \"whel\"; did you mean `wheel`?");
}

/// Prefixes need no declaration, and an element with one is none of URDF's.
#[test]
fn names_with_prefixes_are_passed_over() {
    let other = "<drake:joint name=\"d\" type=\"planar\"/><sensor:ray a:b=\"1\"/>";
    let origin = "xyz=\"1 2 3\" drake:note=\"x\"";
    let text = robot(&(link("a") + other + &link("b") + &joint("fixed", "a", "b", origin)));
    near(read(&text, &[]).unwrap()[1].root_from_part.translation, [1.0, 2.0, 3.0], 0.0);
    let declared = text.replace("<robot", "<robot xmlns:drake=\"http://drake.mit.edu\"");
    assert_eq!(read(&declared, &[]).unwrap().len(), 2);
}
