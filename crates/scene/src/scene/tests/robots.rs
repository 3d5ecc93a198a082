//! Robots in URDF and meshes in STL as shapes of a scene.

use std::fs;

use super::*;

const TOP: &str = r#""sightline": 1, "roi": {"min": [-20, -20, 0], "max": [20, 20, 5], "voxel": [1, 1, 1]},
    "lidar": {"channels": 4, "fov": [-25, 5], "azimuth_steps": 8, "range": 100},
    "mount": {"min": [0, 0, 2], "max": [0, 0, 2], "lidars": 1}"#;

const STL: &str = "solid s\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1000 0 0\nvertex 0 2000 500\n\
                   endloop\nendfacet\nendsolid s\n";

fn with_body(folder: &std::path::Path, shape: &str) -> Checked<Scene> {
    let text = format!(r#"{{{TOP}, "ego": {{"body": [{{"class": "vehicle", {shape}}}]}}}}"#);
    Scene::from_json(&text, folder, "s.json")
}

fn body(scene: &Scene) -> Vec<[[f32; 3]; 3]> {
    scene.body()
}

/// A package as ROS lays it out: `car/package.xml`, `car/urdf/car.urdf`, `car/meshes/hull.stl`.
fn package(folder: &std::path::Path) {
    for inner in ["car/urdf", "car/meshes"] {
        fs::create_dir_all(folder.join(inner)).unwrap();
    }
    let robot = r#"<robot name="car">
        <link name="base">
          <visual><geometry><mesh filename="package://car/meshes/hull.stl" scale="0.001 -0.001 0.002"/></geometry></visual>
          <collision><geometry><box size="4 2 1"/></geometry></collision>
        </link>
        <link name="lidar"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>
        <joint name="mast" type="fixed"><origin xyz="0 0 1.5"/><parent link="base"/><child link="lidar"/></joint>
        </robot>"#;
    fs::write(folder.join("car/urdf/car.urdf"), robot).unwrap();
    fs::write(folder.join("car/meshes/hull.stl"), STL).unwrap();
}

#[test]
fn a_robot_is_the_body_as_its_shapes_written_out() {
    let folder = tempfile::tempdir().unwrap();
    package(folder.path());
    let collision = r#""urdf": {"file": "car/urdf/car.urdf", "geometry": "collision", "without": ["lidar"],
                                "translate": [1, 0, 0.75], "yaw": 0.5}"#;
    let robot = with_body(folder.path(), collision).unwrap();
    let written = r#""box": {"center": [1, 0, 0.75], "size": [4, 2, 1], "yaw": 0.5}"#;
    let written = with_body(folder.path(), written).unwrap();
    assert_eq!(body(&robot).len(), 12);
    let far = |a: &f32, b: &f32| (a - b).abs();
    let (a, b) = (body(&robot).concat().concat(), body(&written).concat().concat());
    assert!(a.iter().zip(&b).all(|(a, b)| far(a, b) < 1e-6));
    let all = with_body(folder.path(), &collision.replace("\"lidar\"", "")).unwrap();
    assert_eq!(body(&all).len(), 12 + 2 * 32 * 15);
    // The mast has no visual shape: it is missing there, and named unless it is left out.
    let doubts = |shape: &str| super::doubts(&with_body(folder.path(), shape).unwrap());
    let visual = r#""urdf": {"file": "car/urdf/car.urdf", "packages": "."}"#;
    let told = doubts(visual);
    assert_holds!(told, "car.urdf: no <visual>, so that no beam meets them: links `lidar`; write");
    assert!(!doubts(collision).contains("no beam meets them"), "{}", doubts(collision));
    let file = folder.path().join("car/urdf/car.urdf");
    let fixed = fs::read_to_string(&file).unwrap();
    let slide = fixed.replace("\"fixed\">", "\"prismatic\"><limit lower=\"0.5\" upper=\"1\"/>");
    fs::write(&file, slide).unwrap();
    let told = doubts(collision);
    assert_holds!(told, "<limit> or <mimic> keeps the joint `mast` at 0.5 m, not at 0; the");
    // An <include> of a plugin brings no shape of the robot.
    let plugin = "<gazebo><plugin><include/></plugin></gazebo><link name=\"lidar\">";
    fs::write(&file, fixed.replace("<link name=\"lidar\">", plugin)).unwrap();
    assert!(!doubts(collision).contains("<include>"), "{}", doubts(collision));
    let included = fixed
        .replace("<link name=\"lidar\">", "<include filename=\"o.urdf\"/><link name=\"lidar\">");
    fs::write(&file, included).unwrap();
    let told = doubts(collision);
    assert_holds!(told, "car.urdf: <include> is not read, 1 in all; shapes in it are missing");
    // An <origin> of a link, one inside of <parent> and a misspelt one place nothing.
    let box_ = "<visual><orgin/><geometry><box size=\"1 1 1\"/></geometry></visual>";
    let lost = fixed
        .replace("<link name=\"lidar\">", &format!("<link name=\"lidar\"><origin/>{box_}"))
        .replace("<parent link=\"base\"/>", "<parent link=\"base\"><origin/></parent>");
    fs::write(&file, lost).unwrap();
    let told = doubts(collision);
    assert!(told.contains("<origin> of link `lidar` (and 2 more) is not known there"), "{told}");
    fs::write(&file, fixed).unwrap();
    let without = visual.replace("\"}", "\", \"without\": [\"lidar\"]}");
    assert!(!doubts(&without).contains("no beam meets them"), "{}", doubts(&without));
}

/// Shapes in a group or in capitals would be missing, and a word such as `units` does nothing.
#[test]
fn shapes_at_another_place_and_unknown_words_are_doubted() {
    let folder = tempfile::tempdir().unwrap();
    package(folder.path());
    let file = folder.path().join("car/urdf/car.urdf");
    let fixed = fs::read_to_string(&file).unwrap();
    let visual = r#""urdf": {"file": "car/urdf/car.urdf", "packages": ".", "without": ["lidar"]}"#;
    let link = r#"<link name="x"><visual><geometry><box size="1 1 1"/></geometry></visual></link>"#;
    let more = |more: &str| fixed.replace("</robot>", &format!("{more}</robot>"));
    let joint = r#"<joint name="x" type="fixed"><parent link="base"/><child link="x"/></joint>"#;
    let hung = |link: &str| more(&format!("{link}{joint}"));
    for (text, wanted) in [
        (
            more(&format!("<group>{link}</group>")),
            "<group>/<link>/<visual>/<geometry>, in place of",
        ),
        (more(&link.replace("link", "Link")), "<robot>/<Link>/<visual>/<geometry>, in place of"),
        (
            fixed.replace("<mesh ", "<mesh units=\"mm\" "),
            "`units` in <mesh> of link `base` is not known",
        ),
        (hung(&link.replace("visual", "visuals")), "<visuals> of link `x`"),
        (hung("<link name=\"x\"><inertial/><contact/><my:look/></link>"), ""),
        (fixed.replace("<mesh ", "<mesh my:units=\"mm\" "), ""),
        (more(&format!("<gazebo>{link}</gazebo>")), ""),
    ] {
        fs::write(&file, text).unwrap();
        let told = super::doubts(&with_body(folder.path(), visual).unwrap());
        assert!(
            told.contains(wanted) && (told.contains("not known") != wanted.is_empty()),
            "{wanted}: {told}"
        );
    }
}

#[test]
fn a_package_without_its_xml_is_refused_and_found_with_it_or_in_packages() {
    let folder = tempfile::tempdir().unwrap();
    package(folder.path());
    let shape = r#""urdf": {"file": "car/urdf/car.urdf"}"#;
    let told = with_body(folder.path(), shape).unwrap_err();
    assert_begins!(told, "s.json: ego.body[0].urdf: mesh ");
    assert_holds!(told, "link `base`", "give `\"packages\"`, the folder that holds `car`");
    let named = shape.replace("urdf\"}", "urdf\", \"packages\": \".\"}");
    let in_packages = with_body(folder.path(), &named).unwrap();
    let wrong = named.replace("\"packages\": \".\"", "\"packages\": \"car\"");
    let told = with_body(folder.path(), &wrong).unwrap_err();
    assert_holds!(told, "car, holds no folder `car`; give the folder that does");
    fs::write(folder.path().join("car/package.xml"), "<package/>").unwrap();
    let found = with_body(folder.path(), shape).unwrap();
    let expected = [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -2.0, 1.0]]];
    assert_eq!((body(&found), body(&in_packages)), (expected.to_vec(), expected.to_vec()));
    let files: Vec<_> = found.files().iter().map(|file| file.file_name().unwrap()).collect();
    assert!(files.contains(&"car.urdf".as_ref()) && files.contains(&"hull.stl".as_ref()));
}

#[test]
fn a_body_in_millimetres_is_noted_and_wrong_keys_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    package(folder.path());
    let stl = r#""mesh": {"file": "car/meshes/hull.stl"}"#;
    let scene = with_body(folder.path(), stl).unwrap();
    assert_holds!(notes(&scene), "2000 mm would be 2.00 m");
    for (shape, told) in [
        (r#""urdf": {"file": "a.urdf", "geometri": "visual"}"#, "did you mean `geometry`?"),
        (
            r#""urdf": {"file": "car/urdf/car.urdf", "geometry": "visuals"}"#,
            "ego.body[0].urdf.geometry: \"visuals\" is not \"visual\" or \"collision\"",
        ),
        (r#""urdf": {"file": "no.urdf"}"#, "mesh no.urdf: file: cannot be read"),
        (r#""urdf": {"file": "car/meshes/hull.stl"}"#, "file: is not XML"),
    ] {
        let message = with_body(folder.path(), shape).unwrap_err().to_string();
        assert_holds!(message.replace(&format!("{}/", folder.path().display()), ""), told);
    }
}

#[test]
fn origins_in_degrees_are_doubted_with_their_joint() {
    let folder = tempfile::tempdir().unwrap();
    package(folder.path());
    let path = folder.path().join("car/urdf/car.urdf");
    let shape = r#""urdf": {"file": "car/urdf/car.urdf", "geometry": "collision"}"#;
    let text = fs::read_to_string(&path).unwrap();
    for (rpy, doubted) in [("0 0 1.5708", false), ("0 0 90", true)] {
        let origin = format!("xyz=\"0 0 1.5\" rpy=\"{rpy}\"");
        fs::write(&path, text.replace("xyz=\"0 0 1.5\"", &origin)).unwrap();
        let scene = with_body(folder.path(), shape).unwrap();
        let told = notes(&scene);
        let is_told = told.contains("joint `mast`: rpy is 90 rad; degrees?");
        assert_eq!(is_told, doubted, "{told}");
    }
}

#[test]
fn bodies_without_an_area_are_refused_and_one_triangle_is_doubted() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = r#""mesh": {"file": "a.obj"}"#;
    let told = |text: &str| {
        fs::write(folder.path().join("a.obj"), text).unwrap();
        with_body(folder.path(), mesh)
    };
    let line = told("v 0 0 0.1\nv 1 0.5 0.3\nv 4 2 0.9\nf 1 2 3\n").unwrap_err();
    let words =
        "s.json: ego.body: a list of triangles without an area is not a body that beams can hit";
    assert_begins!(line, words);
    let scene = told("v 0 0 0.1\nv 4 0 0.1\nv 0 2 0.1\nf 1 2 3\n").unwrap();
    assert_holds!(notes(&scene), "the ego body is 1 triangle");
}

/// `urdf` has no `axes`: the note on a glTF of a link names what there is.
#[test]
fn a_gltf_of_a_link_is_turned_by_its_origin() {
    let folder = tempfile::tempdir().unwrap();
    let corners = [0_f32, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 1.0, -2.0];
    fs::write(folder.path().join("t.bin"), corners.map(f32::to_le_bytes).concat()).unwrap();
    let mesh = r#"{"asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, -2], "max": [4, 1, 0]}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36, "uri": "t.bin"}]}"#;
    fs::write(folder.path().join("t.gltf"), mesh).unwrap();
    let robot = r#"<robot name="r"><link name="a"><visual><geometry><mesh filename="t.gltf"/></geometry></visual></link></robot>"#;
    fs::write(folder.path().join("r.urdf"), robot).unwrap();
    let scene = with_body(folder.path(), r#""urdf": {"file": "r.urdf"}"#).unwrap();
    let told = notes(&scene);
    let told = told.lines().find(|line| line.contains("forward")).unwrap();
    assert!(!told.contains("`axes`") && told.contains("turn the <origin> of the shape"), "{told}");
}
