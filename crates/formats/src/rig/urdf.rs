//! Rigs in URDF: read and written.
//!
//! Joints with `<origin xyz rpy>`, `R = Rz·Ry·Rx`, in metres and radians. The content of `<gazebo>` is SDF.
//!
//! Read: `<joint>` (type, origin, parent, child, axis, limit, mimic), `<gazebo reference>` with `<sensor>` and its `<pose>`, URDF's own
//! `<sensor>` (parent, origin, ray). Passed over, because no pose depends on it: links' shapes and masses, transmissions, materials.

use std::collections::BTreeSet;
use std::fmt::Write;

use roxmltree::Node;
use sightline_files::Note;
use sightline_files::json::{Location, has_no_prefix, misplaced, plain_names, written};
use sightline_scene::vehicle::{SensorPose, UrdfJoint};

use super::frames::{
    AT_ZERO, FrameContent, FrameTree, MovingJoint, RigFrame, compose, of_quaternion,
};
use super::yaml::{missing, wrong};
use super::{BASE_LINK, Checked, FormatError, Models, Mounting, Rig, RigSource, sdf, yaml};

/// Kinds of joints that move. Each frame behind one is taken where the joint stands nearest to 0.
const MOVING: [&str; 5] = ["continuous", "floating", "planar", "prismatic", "revolute"];

/// A rotation as a quaternion, in place of `rpy`.
const QUATERNION: &str = "quat_xyzw";
/// Elements of a joint: origin, parent, child, axis, limit and mimic are read, no pose at rest depends on the others.
const OF_JOINT: [&str; 10] = [
    "origin", "parent", "child", "axis", "calibration", "dynamics", "hardwareInterface", "limit",
    "mimic", "safety_controller",
];

/// Reads every joint, and the LiDARs that Gazebo is told of.
pub(super) fn read(source: &RigSource, frames: &mut FrameTree) -> Checked<()> {
    let file = &source.file;
    let unexpanded = || {
        refused!(
            "{file}: holds elements or values of xacro, which is a program; expand it first, `xacro {file} > \
             robot.urdf`, and read that"
        )
    };
    let text = plain_names(&source.text);
    // A prefix that no attribute declares is no XML with namespaces.
    let has_macros = source.text.contains("<xacro:");
    let document =
        yaml::parse(&text, file).map_err(|error| if has_macros { unexpanded() } else { error })?;
    if document.descendants().any(is_xacro) {
        return Err(unexpanded());
    }
    let robot = document.root_element();
    frames.name = robot.attribute("name").map(str::to_owned);
    refuse_links_twice(robot, file)?;
    doubt_sensors_of_links(robot, file, frames);
    frames.doubt_misplaced(file, misplaced(&text, &[&["robot", "joint", "parent"]], &["gazebo"]));
    frames.doubt_misplaced(file, misplaced(&text, &[&["gazebo", "sensor", "pose"]], &["plugin"]));
    if robot.children().any(|node| node.has_tag_name("include")) {
        frames.notes.push(Note::doubt(format!(
            "{file}: <include> is not read; a LiDAR in it is missing. Merge the files, and read that"
        )));
    }
    read_joints(robot, file, frames)?;
    for gazebo in robot.children().filter(|node| node.has_tag_name("gazebo")) {
        let reference = gazebo.attribute("reference");
        doubt_unread(gazebo, reference, file, frames);
        if let Some(link) = reference {
            sdf::read_sensors(gazebo, link, "", file, frames)?;
        }
    }
    for sensor in robot.children().filter(|node| node.has_tag_name("sensor")) {
        read_sensor(sensor, file, frames)?;
    }
    Ok(())
}

/// Refuses a second link of a name: nothing says which of the two a joint holds.
fn refuse_links_twice(robot: Node, file: &str) -> Checked<()> {
    let mut names = BTreeSet::new();
    for link in robot.children().filter(|node| node.has_tag_name("link")) {
        if link.attribute("name").is_some_and(|name| !names.insert(name)) {
            let told = "comes twice; give each link a name of its own";
            return Err(FormatError::at(&yaml::place(link, file), told));
        }
    }
    Ok(())
}

/// Adds URDF's own `<sensor>`, beside links and joints: it hangs on a link, by an `<origin>`.
fn read_sensor(sensor: Node, file: &str, frames: &mut FrameTree) -> Checked<()> {
    let at = yaml::place(sensor, file);
    let is_other = |node: Node| node.has_tag_name("camera");
    if !sdf::is_lidar(sensor) && sensor.children().any(is_other) {
        return Ok(());
    }
    let parent = sensor.children().find(|node| node.has_tag_name("parent"));
    let link = parent.and_then(|parent| parent.attribute("link"));
    let (Some(link), true) = (link, sdf::is_lidar(sensor)) else {
        frames.notes.push(Note::doubt(format!(
            "{at}: is not read, nor its <origin>; a LiDAR has a <ray> and a <parent link=\"…\"/>"
        )));
        return Ok(());
    };
    if sensor.children().any(|node| node.has_tag_name("pose")) {
        frames.notes.push(Note::doubt(format!("{at}: <pose> is not read; write an <origin>")));
    }
    let pose = pose_of(sole_origin(sensor, &at)?, &at)?;
    sdf::add_sensor(frames, sensor, link, pose, file)
}

/// Doubts of sensors inside of links, which URDF does not know.
fn doubt_sensors_of_links(robot: Node, file: &str, frames: &mut FrameTree) {
    let links = robot.children().filter(|node| node.has_tag_name("link"));
    let inside = links.flat_map(|link| link.children()).filter(|node| node.has_tag_name("sensor"));
    frames.notes.extend(inside.map(|sensor| {
        let link = sensor.parent_element().and_then(|link| link.attribute("name"));
        Note::doubt(format!(
            "{}: stands in the link `{}` and is not read, nor its pose; write it in a <gazebo reference=\"…\">",
            yaml::place(sensor, file),
            link.unwrap_or_default()
        ))
    }));
}

/// Doubts of elements that Gazebo places by, and that are not read here.
fn doubt_unread(gazebo: Node, reference: Option<&str>, file: &str, frames: &mut FrameTree) {
    let (unread, place): (&[&str], _) = match reference {
        Some(link) => (&["pose"], format!("<gazebo> of `{link}`")),
        None => (&["frame", "include", "joint", "link", "model", "sensor"], "<gazebo>".to_owned()),
    };
    let tags = gazebo.children().filter(Node::is_element).map(|node| node.tag_name().name());
    let tags: BTreeSet<&str> = tags.filter(|tag| unread.contains(tag)).collect();
    frames.notes.extend(tags.into_iter().map(|tag| {
        Note::doubt(format!(
            "{file}: {place}: <{tag}> is not read; place it by a <joint>, and give a <sensor> a reference"
        ))
    }));
}

/// True if an element is one of xacro, or an attribute of it waits for xacro.
fn is_xacro(node: Node) -> bool {
    let waits = |value: &str| value.contains("${") || value.contains("$(");
    node.tag_name().namespace().is_some_and(|space| space.contains("xacro"))
        || node.attributes().any(|attribute| waits(attribute.value()))
}

/// The `<origin>` of a joint. Other elements than URDF's are doubts; a second origin, or one of unknown attributes, is an
/// error, since the pose would be another.
fn origin_of<'a, 'i>(
    joint: Node<'a, 'i>,
    at: &Location,
    frames: &mut FrameTree,
) -> Checked<Option<Node<'a, 'i>>> {
    let elements = joint.children().filter(Node::is_element);
    for element in elements.filter(|element| element.tag_name().namespace().is_none()) {
        let name = element.tag_name().name();
        if !OF_JOINT.contains(&name) && has_no_prefix(name) {
            frames.notes.push(Note::doubt(format!("{at}: <{name}>: not known here, and not read")));
        }
        if let ("parent" | "child", Some(inner)) = (name, element.first_element_child()) {
            let inner = inner.tag_name().name();
            let text =
                format!("{at}: <{inner}> stands in <{name}> and is not read; write it beside");
            frames.notes.push(Note::doubt(text));
        }
    }
    sole_origin(joint, at)
}

/// The `<origin>` of an element.
///
/// # Errors
/// A second one, or an unknown attribute.
fn sole_origin<'a, 'i>(node: Node<'a, 'i>, at: &Location) -> Checked<Option<Node<'a, 'i>>> {
    let mut origins = node.children().filter(|node| node.has_tag_name("origin"));
    let origin = origins.next();
    let at = at.key("origin");
    if origins.next().is_some() {
        return Err(wrong(&at, "a second <origin>", "one <origin>"));
    }
    if let Some(origin) = origin {
        let wanted = "no attribute but xyz, rpy or quat_xyzw";
        yaml::refuse_attributes(origin, &at, &["xyz", "rpy", QUATERNION], wanted)?;
    }
    Ok(origin)
}

/// The pose of an `<origin>`; without one, that which changes nothing.
fn pose_of(origin: Option<Node>, at: &Location) -> Checked<SensorPose> {
    let triple = |key: &str| {
        let text = origin.and_then(|origin| origin.attribute(key));
        text.map_or(Ok([0.0; 3]), |text| {
            yaml::numbers_of_text(text, &at.key(&format!("origin.{key}")), "three numbers")
        })
    };
    let ([x, y, z], [roll, pitch, yaw]) = (triple("xyz")?, triple("rpy")?);
    match origin.and_then(|origin| origin.attribute(QUATERNION)) {
        None => Ok(SensorPose::from_values([x, y, z, roll, pitch, yaw])),
        Some(text) => {
            let at = at.key("origin").key(QUATERNION);
            let quaternion = yaml::numbers_of_text(text, &at, "four numbers: x y z w")?;
            of_quaternion([x, y, z], quaternion, &at)
        }
    }
}

/// Adds the frame of each joint's child, with all joints at rest.
fn read_joints(robot: Node, file: &str, frames: &mut FrameTree) -> Checked<()> {
    let all: Vec<Node> = robot.children().filter(|node| node.has_tag_name("joint")).collect();
    let told = |joint: Node, words: String| FormatError::at(&yaml::place(joint, file), &words);
    let mut joints = Vec::new();
    for &joint in &all {
        let get =
            |tag: &str, key: &str| yaml::child(joint, tag).and_then(|node| node.attribute(key));
        let name = joint.attribute("name").unwrap_or_default();
        let kind = joint.attribute("type").unwrap_or_default();
        let names = |tag: &str| {
            let element = yaml::child(joint, tag);
            element.map_or_else(Vec::new, |node| node.attributes().map(|a| a.name()).collect())
        };
        let read = UrdfJoint::refuse_others(names).and_then(|()| UrdfJoint::read(name, kind, get));
        joints.push(read.map_err(|words| told(joint, words))?);
    }
    let values = UrdfJoint::values(&joints, &[]).map_err(|(k, words)| told(all[k], words))?;
    for ((node, joint), value) in all.into_iter().zip(&joints).zip(values) {
        read_joint(node, joint, value, file, frames)?;
    }
    Ok(())
}

/// Adds the frame of a joint's child, where the joint stands at `value`.
fn read_joint(
    joint: Node,
    rest: &UrdfJoint,
    value: f64,
    file: &str,
    frames: &mut FrameTree,
) -> Checked<()> {
    let at = yaml::place(joint, file);
    let link = |key: &str| {
        let mut all = joint.children().filter(|node| node.has_tag_name(key));
        let element = all.next().ok_or_else(|| missing(&at, &format!("<{key}>")))?;
        if all.next().is_some() {
            let (value, wanted) = (format!("a second <{key}>"), "one of each element");
            return Err(wrong(&at.key(key), value, wanted));
        }
        yaml::attribute(element, "link", &at.key(key)).map(str::to_owned)
    };
    let origin = origin_of(joint, &at, frames)?;
    let kind = yaml::attribute(joint, "type", &at)?;
    if kind != "fixed" && !MOVING.contains(&kind) {
        let wanted = "fixed, continuous, revolute, prismatic, planar or floating";
        return Err(wrong(&at.key("type"), kind, wanted));
    }
    let mut pose = pose_of(origin, &at)?;
    let (name, parent) = (link("child")?, link("parent")?);
    if value != 0.0 {
        pose = compose(&pose, &SensorPose::from(&rest.pose(value)));
    }
    if kind != "fixed" {
        let at = if value == 0.0 { AT_ZERO.to_owned() } else { rest.words(value) };
        let joint = format!("`{}` ({kind})", rest.name);
        frames.moves(&name, MovingJoint { joint, at });
    }
    frames.add(RigFrame { name, parent, pose, holds: FrameContent::Unsaid, at })
}

/// A robot of `base_link` and one link a LiDAR.
pub(super) fn write(rig: &Rig, mounting: &Mounting, models: &Models) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{}\"{}>\n  <link name=\"{BASE_LINK}\"/>\n",
        yaml::escape(&rig.name),
        sdf::namespace(rig)
    );
    for lidar in &rig.lidars {
        let (foot, height) = mounting.foot(lidar);
        let [x, y, z, roll, pitch, yaw] = foot.values().map(written);
        let frame = yaml::escape(&lidar.frame);
        let _ = write!(
            text,
            "  <link name=\"{frame}\"/>\n  <joint name=\"{frame}_joint\" type=\"fixed\">\n    \
             <origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>\n    \
             <parent link=\"{BASE_LINK}\"/>\n    <child link=\"{frame}\"/>\n  </joint>\n  \
             <gazebo reference=\"{frame}\">\n{}  </gazebo>\n",
            sdf::sensor_element(lidar, height, models, "    ")
        );
    }
    text + "</robot>\n"
}
