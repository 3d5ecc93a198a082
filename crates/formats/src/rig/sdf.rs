//! Rigs in SDF and in URDF: read and written.
//!
//! URDF: joints with `<origin xyz rpy>`, `R = Rz·Ry·Rx`, in metres and radians.
//!
//! Read: `<joint>` (type, origin, parent, child), `<gazebo reference>` with `<sensor>` and its `<pose>`. Passed over, because
//! no pose depends on it: links' shapes and masses, limits, axes, transmissions, materials.

use std::fmt::Write;

use roxmltree::Node;
use sightline_files::Note;
use sightline_files::json::{Location, written};
use sightline_scene::vehicle::SensorPose;

use super::frames::{FrameContent, FrameTree, RigFrame, of_quaternion};
use super::yaml::{PHASE, number, wrong};
use super::{BASE_LINK, Models, Mounting, Rig, RigError, RigLidar, RigSource, beams, yaml};

/// Frame that everything in a model hangs on unless it says otherwise.
pub(super) const MODEL: &str = "__model__";

/// Reads the links, joints, frames and sensors of the first model, and of the models in it.
pub(super) fn read(source: &RigSource, frames: &mut FrameTree) -> Result<(), RigError> {
    let file = &source.file;
    let document = yaml::parse(&source.text, file)?;
    let is_outer = |node: &Node| {
        node.has_tag_name("model") && !node.ancestors().skip(1).any(|a| a.has_tag_name("model"))
    };
    let mut models = document.descendants().filter(is_outer);
    let Some(model) = models.next() else {
        let at = Box::new(yaml::place(document.root_element(), file));
        return Err(RigError::Missing { at, key: "<model>".to_owned() });
    };
    let name = model.attribute("name").unwrap_or_default();
    frames.name = model.attribute("name").map(str::to_owned);
    let others: Vec<&str> =
        models.map(|model| model.attribute("name").unwrap_or("without a name")).collect();
    if !others.is_empty() {
        frames.notes.push(Note::doubt(format!(
            "{file}: holds several models; `{name}` is read, and left out are {}; put the vehicle into a file of its own",
            others.join(", ")
        )));
    }
    read_model(model, "", file, frames)
}

/// Reads a model. Names in it begin with `scope`, which is empty or ends with `::`.
fn read_model(
    model: Node,
    scope: &str,
    file: &str,
    frames: &mut FrameTree,
) -> Result<(), RigError> {
    let scoped = |name: &str| format!("{scope}{name}");
    for node in model.children().filter(Node::is_element) {
        let at = yaml::place(node, file);
        let kind = node.tag_name().name();
        let usual_parent = match kind {
            "link" | "model" => MODEL,
            "frame" => node.attribute("attached_to").filter(|to| !to.is_empty()).unwrap_or(MODEL),
            // A joint is a frame at its child, since version 1.7.
            "joint" => match yaml::child(node, "child").and_then(|child| child.text()) {
                Some(child) => child.trim(),
                None => {
                    return Err(RigError::Missing { at: Box::new(at), key: "<child>".to_owned() });
                }
            },
            "include" => {
                let uri = yaml::child(node, "uri").and_then(|uri| uri.text()).unwrap_or_default();
                frames.notes.push(Note::doubt(format!(
                    "{file}: <include> of `{}` is not read; a LiDAR in it is missing. Merge it with `gz sdf -p`",
                    uri.trim()
                )));
                continue;
            }
            _ => continue,
        };
        if node.attribute("placement_frame").is_some_and(|frame| !frame.is_empty()) {
            let (what, mend) = ("has a placement_frame", "give its pose without one");
            return Err(RigError::Unread { at: Box::new(at), what, mend });
        }
        let name = yaml::attribute(node, "name", &at)?;
        let (pose, parent) = pose(node, file, frames)?;
        let parent = scoped(parent.unwrap_or(usual_parent));
        let holds = if kind == "link" { FrameContent::Unsaid } else { FrameContent::Other };
        frames.add(RigFrame { name: scoped(name), parent, pose, holds, at: at.clone() })?;
        match kind {
            "joint" => {
                let moves = node.attribute("type").filter(|kind| *kind != "fixed");
                if let Some(kind) = moves {
                    frames.moves(&scoped(name), format!("`{name}` ({kind})"));
                }
            }
            "model" => {
                let inner = format!("{}::", scoped(name));
                let (name, parent) = (format!("{inner}{MODEL}"), scoped(name));
                let (pose, holds) = (super::frames::IDENTITY, FrameContent::Other);
                frames.add(RigFrame { name, parent, pose, holds, at })?;
                read_model(node, &inner, file, frames)?;
            }
            "link" => read_sensors(node, &scoped(name), scope, file, frames)?,
            _ => {}
        }
    }
    Ok(())
}

/// Adds the sensors of a link.
fn read_sensors(
    link: Node,
    name: &str,
    scope: &str,
    file: &str,
    frames: &mut FrameTree,
) -> Result<(), RigError> {
    for sensor in link.children().filter(|node| node.has_tag_name("sensor")) {
        let (optical, parent) = pose(sensor, file, frames)?;
        match parent {
            // Its own pose hangs on another frame than its link.
            Some(parent) if format!("{scope}{parent}") != name => {
                let at = yaml::place(sensor, file);
                let own = sensor.attribute("name").unwrap_or_default();
                let frame = format!("{name}/{own}");
                let (parent, holds) = (format!("{scope}{parent}"), FrameContent::Other);
                frames.add(RigFrame { name: frame.clone(), parent, pose: optical, holds, at })?;
                add_sensor(frames, sensor, &frame, super::frames::IDENTITY, file)?;
            }
            _ => add_sensor(frames, sensor, name, optical, file)?,
        }
    }
    Ok(())
}

/// The `<pose>` of an element, and the frame that it is relative to, if it names one.
fn pose<'a>(
    node: Node<'a, '_>,
    file: &str,
    frames: &mut FrameTree,
) -> Result<(SensorPose, Option<&'a str>), RigError> {
    let Some(element) = yaml::child(node, "pose") else {
        return Ok((super::frames::IDENTITY, None));
    };
    let at = yaml::place(node, file).key("pose");
    if node.children().filter(|child| child.has_tag_name("pose")).count() > 1 {
        return Err(wrong(&at, "a second <pose>", "one <pose>"));
    }
    let text = element.text().unwrap_or_default();
    let named = |key: &str| element.attribute(key).filter(|frame| !frame.is_empty());
    let old = named("frame");
    if let Some(frame) = old {
        frames.notes.push(Note::doubt(format!(
            "{at}: frame=\"{frame}\" of before SDF 1.7 is followed as relative_to; write relative_to"
        )));
    }
    let relative_to = named("relative_to").or(old);
    if element.attribute("rotation_format") == Some("quat_xyzw") {
        let wanted = "seven numbers: x y z and a quaternion x y z w";
        let [x, y, z, qx, qy, qz, qw] = yaml::numbers_of_text(text, &at, wanted)?;
        return Ok((of_quaternion([x, y, z], [qx, qy, qz, qw], &at)?, relative_to));
    }
    if let Some(format) = element.attribute("rotation_format").filter(|f| *f != "euler_rpy") {
        return Err(wrong(&at.key("rotation_format"), format, "euler_rpy or quat_xyzw"));
    }
    let mut pose = yaml::pose_of_text(text, &at)?;
    match element.attribute("degrees") {
        None | Some("false" | "0") => {}
        Some("true" | "1") => {
            let [roll, pitch, yaw] = [pose.roll, pose.pitch, pose.yaw].map(f64::to_radians);
            pose = SensorPose { roll, pitch, yaw, ..pose };
        }
        Some(other) => return Err(wrong(&at.key("degrees"), other, "true or false")),
    }
    Ok((pose, relative_to))
}

/// A model of `base_link` and one link a LiDAR.
pub(super) fn write(rig: &Rig, mounting: &Mounting, models: &Models) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<sdf version=\"1.9\"{}>\n  <model name=\"{}\">\n    \
         <link name=\"{BASE_LINK}\"/>\n",
        namespace(rig),
        yaml::escape(&rig.name)
    );
    for lidar in &rig.lidars {
        let sensor = lidar.sensor.as_deref();
        let (foot, height) = mounting.foot(&lidar.frame, sensor, &lidar.pose);
        let [x, y, z, roll, pitch, yaw] = foot.values().map(written);
        let frame = yaml::escape(&lidar.frame);
        let _ = write!(
            text,
            "    <link name=\"{frame}\">\n      \
             <pose relative_to=\"{BASE_LINK}\">{x} {y} {z} {roll} {pitch} {yaw}</pose>\n{}    </link>\n    \
             <joint name=\"{frame}_joint\" type=\"fixed\">\n      <parent>{BASE_LINK}</parent>\n      \
             <child>{frame}</child>\n    </joint>\n",
            sensor_element(lidar, height, models, "      ")
        );
    }
    text + "  </model>\n</sdf>\n"
}

/// Values of `type` that mean a LiDAR, in the versions of Gazebo.
const LIDARS: [&str; 4] = ["ray", "gpu_ray", "lidar", "gpu_lidar"];

/// Namespace of attributes that other programs pass over, and the prefix of it that is written.
const OWN: &str = "urn:sightline";
const PREFIX: &str = "sightline";

/// True if a `<sensor>` is a LiDAR.
fn is_lidar(sensor: Node) -> bool {
    sensor.attribute("type").is_some_and(|kind| LIDARS.contains(&kind))
}

/// Adds a LiDAR for a `<sensor>` whose pose in the frame `link` is `optical`. Reads its model from a name
/// `FRAME-MODEL`, as in Velodyne's description, and its phase from this program's own attribute.
fn add_sensor(
    frames: &mut FrameTree,
    sensor: Node,
    link: &str,
    optical: SensorPose,
    file: &str,
) -> Result<(), RigError> {
    let name = sensor.attribute("name").unwrap_or_default();
    let phase = sensor.attribute((OWN, PHASE));
    let place = || yaml::place(sensor, file).key(PHASE);
    let phase = phase.map(|text| number(&place(), text)).transpose()?;
    let optical = SensorPose { phase, ..optical };
    let holds = if is_lidar(sensor) {
        let model = name.strip_prefix(link).and_then(|rest| rest.strip_prefix('-'));
        let model = model.filter(|model| !model.is_empty()).map(beams::usual);
        FrameContent::Lidar { sensor: model, optical: Some(optical) }
    } else {
        FrameContent::Other
    };
    match frames.get_mut(link) {
        Some(frame) if link != BASE_LINK && !matches!(frame.holds, FrameContent::Lidar { .. }) => {
            frame.holds = holds;
        }
        // A second LiDAR of a link, or one of the base itself, has a frame of its own.
        _ if is_lidar(sensor) => frames.add(RigFrame {
            name: format!("{link}/{name}"),
            parent: link.to_owned(),
            pose: super::frames::IDENTITY,
            holds,
            at: yaml::place(sensor, file),
        })?,
        _ => {}
    }
    Ok(())
}

/// The element that [`add_sensor`] reads, for a LiDAR `height` metres above its foot.
fn sensor_element(lidar: &RigLidar, height: f64, models: &Models, indent: &str) -> String {
    let RigLidar { frame, sensor, pose } = lidar;
    let name = sensor.as_ref().map_or(frame.clone(), |sensor| format!("{frame}-{sensor}"));
    let phase = pose
        .phase
        .map(|phase| format!(" {PREFIX}:{PHASE}=\"{}\"", written(phase)))
        .unwrap_or_default();
    format!(
        "{indent}<sensor name=\"{}\" type=\"gpu_lidar\"{phase}>\n{indent}  <pose>0 0 {} 0 0 0</pose>\n{}\
         {indent}</sensor>\n",
        yaml::escape(&name),
        written(height),
        models.gazebo(lidar, &format!("{indent}  "))
    )
}

/// Declaration of the XML namespace for phases; empty if no LiDAR of the rig has one.
pub(super) fn namespace(rig: &Rig) -> String {
    let phased = rig.lidars.iter().any(|lidar| lidar.pose.phase.is_some());
    if phased { format!(" xmlns:{PREFIX}=\"{OWN}\"") } else { String::new() }
}

/// Kinds of joints that move. Each frame behind one is taken where the joint stands at 0.
const MOVING: [&str; 5] = ["continuous", "floating", "planar", "prismatic", "revolute"];

/// A rotation as a quaternion, in place of `rpy`.
const QUATERNION: &str = "quat_xyzw";
/// Elements of a joint: the first three are read, no pose at rest depends on the others.
const OF_JOINT: [&str; 10] = [
    "origin",
    "parent",
    "child",
    "axis",
    "calibration",
    "dynamics",
    "hardwareInterface",
    "limit",
    "mimic",
    "safety_controller",
];

/// Reads every joint, and the LiDARs that Gazebo is told of.
pub(super) fn read_urdf(source: &RigSource, frames: &mut FrameTree) -> Result<(), RigError> {
    let file = &source.file;
    let unexpanded = || RigError::Xacro { file: file.clone() };
    let document = yaml::parse(&source.text, file).map_err(|error| match error {
        // A prefix that no attribute declares is no XML with namespaces.
        RigError::Syntax { .. } if source.text.contains("<xacro:") => unexpanded(),
        error => error,
    })?;
    if document.descendants().any(is_xacro) {
        return Err(unexpanded());
    }
    let robot = document.root_element();
    frames.name = robot.attribute("name").map(str::to_owned);
    for joint in robot.children().filter(|node| node.has_tag_name("joint")) {
        read_joint(joint, file, frames)?;
    }
    for gazebo in robot.children().filter(|node| node.has_tag_name("gazebo")) {
        let Some(link) = gazebo.attribute("reference") else { continue };
        for sensor in gazebo.children().filter(|node| node.has_tag_name("sensor")) {
            let pose = yaml::child(sensor, "pose").and_then(|pose| pose.text()).unwrap_or_default();
            let optical = yaml::pose_of_text(pose, &yaml::place(sensor, file).key("pose"))?;
            add_sensor(frames, sensor, link, optical, file)?;
        }
    }
    Ok(())
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
) -> Result<Option<Node<'a, 'i>>, RigError> {
    let elements = joint.children().filter(Node::is_element);
    for element in elements.filter(|element| element.tag_name().namespace().is_none()) {
        let name = element.tag_name().name();
        if !OF_JOINT.contains(&name) {
            frames.notes.push(Note::doubt(format!("{at}: <{name}>: not known here, and not read")));
        }
    }
    let mut origins = joint.children().filter(|node| node.has_tag_name("origin"));
    let origin = origins.next();
    let at = at.key("origin");
    if origins.next().is_some() {
        return Err(wrong(&at, "a second <origin>", "one <origin>"));
    }
    let known = |name: &str| ["xyz", "rpy", QUATERNION].contains(&name);
    let odd = origin.and_then(|origin| origin.attributes().find(|a| !known(a.name())));
    match odd {
        Some(odd) => {
            Err(wrong(&at.key(odd.name()), odd.value(), "no attribute but xyz, rpy or quat_xyzw"))
        }
        None => Ok(origin),
    }
}

/// Adds the frame of a joint's child.
fn read_joint(joint: Node, file: &str, frames: &mut FrameTree) -> Result<(), RigError> {
    let at = yaml::place(joint, file);
    let link = |key: &str| {
        let missing = || RigError::Missing { at: Box::new(at.clone()), key: format!("<{key}>") };
        let element = yaml::child(joint, key).ok_or_else(missing)?;
        yaml::attribute(element, "link", &at.key(key)).map(str::to_owned)
    };
    let origin = origin_of(joint, &at, frames)?;
    let triple = |key: &str| {
        let text = origin.and_then(|origin| origin.attribute(key));
        text.map_or(Ok([0.0; 3]), |text| {
            yaml::numbers_of_text(text, &at.key(&format!("origin.{key}")), "three numbers")
        })
    };
    let kind = yaml::attribute(joint, "type", &at)?;
    if kind != "fixed" && !MOVING.contains(&kind) {
        let wanted = "fixed, continuous, revolute, prismatic, planar or floating";
        return Err(wrong(&at.key("type"), kind, wanted));
    }
    let ([x, y, z], [roll, pitch, yaw]) = (triple("xyz")?, triple("rpy")?);
    let pose = match origin.and_then(|origin| origin.attribute(QUATERNION)) {
        None => SensorPose::from_values([x, y, z, roll, pitch, yaw]),
        Some(text) => {
            let at = at.key("origin").key(QUATERNION);
            let quaternion = yaml::numbers_of_text(text, &at, "four numbers: x y z w")?;
            of_quaternion([x, y, z], quaternion, &at)?
        }
    };
    let (name, parent) = (link("child")?, link("parent")?);
    if kind != "fixed" {
        let joint = joint.attribute("name").unwrap_or_default();
        frames.moves(&name, format!("`{joint}` ({kind})"));
    }
    frames.add(RigFrame { name, parent, pose, holds: FrameContent::Unsaid, at })
}

/// A robot of `base_link` and one link a LiDAR.
pub(super) fn write_urdf(rig: &Rig, mounting: &Mounting, models: &Models) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<robot name=\"{}\"{}>\n  <link name=\"{BASE_LINK}\"/>\n",
        yaml::escape(&rig.name),
        namespace(rig)
    );
    for lidar in &rig.lidars {
        let sensor = lidar.sensor.as_deref();
        let (foot, height) = mounting.foot(&lidar.frame, sensor, &lidar.pose);
        let [x, y, z, roll, pitch, yaw] = foot.values().map(written);
        let frame = yaml::escape(&lidar.frame);
        let _ = write!(
            text,
            "  <link name=\"{frame}\"/>\n  <joint name=\"{frame}_joint\" type=\"fixed\">\n    \
             <origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>\n    \
             <parent link=\"{BASE_LINK}\"/>\n    <child link=\"{frame}\"/>\n  </joint>\n  \
             <gazebo reference=\"{frame}\">\n{}  </gazebo>\n",
            sensor_element(lidar, height, models, "    ")
        );
    }
    text + "</robot>\n"
}
