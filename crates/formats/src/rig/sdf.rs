//! Rigs in SDF: read, out of worlds too, and written. Sensors are SDF in URDF, too.

use std::fmt::Write;

use roxmltree::{Document, Node};
use sightline_files::Note;
use sightline_files::json::{misplaced, plain_names, written};
use sightline_scene::vehicle::SensorPose;

use super::frames::{
    AT_ZERO, FrameContent, FrameTree, IDENTITY, MovingJoint, RigFrame, of_quaternion,
};
use super::yaml::{PHASE, missing, number, wrong};
use super::{
    BASE_LINK, Checked, ImportSettings, Models, Mounting, Rig, RigLidar, RigSource, beams, carla,
    import, yaml,
};
use crate::error::listed;

/// Frame that everything in a model hangs on unless it says otherwise.
pub(super) const MODEL: &str = "__model__";

/// Where elements stand that are read.
const PATHS: [&[&str]; 7] = [
    &["model", "link", "sensor"],
    &["model", "joint", "parent"],
    &["model", "pose"],
    &["link", "pose"],
    &["joint", "pose"],
    &["frame", "pose"],
    &["sensor", "pose"],
];

/// Reads the links, joints, frames and sensors of the model that is the vehicle, and of the models in it.
pub(super) fn read(
    source: &RigSource,
    settings: &ImportSettings,
    frames: &mut FrameTree,
) -> Checked<()> {
    let file = &source.file;
    let text = plain_names(&source.text);
    let document = yaml::parse(&text, file)?;
    let model = vehicle(&document, file, settings, frames)?;
    frames.name = model.attribute("name").map(str::to_owned);
    frames.model = frames.name.clone();
    frames.doubt_misplaced(file, misplaced(&text, &PATHS, &["plugin", "state"]));
    read_model(model, "", file, frames)
}

/// True if joints are frames in a document: since version 1.7. Before, a joint and a link may share a name.
fn joints_are_frames(node: Node) -> bool {
    let root = node.document().root_element();
    let minor = root.attribute("version").and_then(|text| text.trim().strip_prefix("1."));
    minor.and_then(|minor| minor.parse::<u32>().ok()).is_none_or(|minor| minor >= 7)
}

/// Reads a model. Names in it begin with `scope`, which is empty or ends with `::`.
fn read_model(model: Node, scope: &str, file: &str, frames: &mut FrameTree) -> Checked<()> {
    let scoped = |name: &str| format!("{scope}{name}");
    for node in model.children().filter(Node::is_element) {
        let at = yaml::place(node, file);
        let kind = node.tag_name().name();
        doubt_origin(node, file, frames);
        let child = yaml::child(node, "child").map(yaml::text);
        if kind == "joint" {
            read_hold(node, scope, frames);
        }
        let usual_parent = match kind {
            "link" | "model" => MODEL,
            "frame" => node.attribute("attached_to").filter(|to| !to.is_empty()).unwrap_or(MODEL),
            // A joint is a frame at its child.
            "joint" if !joints_are_frames(node) => continue,
            "joint" => match child.as_deref().map(str::trim).filter(|child| !child.is_empty()) {
                Some(child) => child,
                None => return Err(missing(&at, "<child>")),
            },
            "include" => {
                let uri = yaml::child(node, "uri").map(yaml::text).unwrap_or_default();
                frames.notes.push(Note::doubt(format!(
                    "{file}: <include> of `{}` is not read; a LiDAR in it is missing. Merge it with `gz sdf -p`",
                    uri.trim()
                )));
                continue;
            }
            _ => continue,
        };
        if node.attribute("placement_frame").is_some_and(|frame| !frame.is_empty()) {
            let told = "has a placement_frame, which is not read; give its pose without one";
            return Err(refused!("{at}: {told}"));
        }
        let name = yaml::attribute(node, "name", &at)?;
        let (pose, parent) = pose(node, file, frames)?;
        let parent = scoped(parent.unwrap_or(usual_parent));
        let holds = if kind == "link" { FrameContent::Unsaid } else { FrameContent::Other };
        frames.add(RigFrame { name: scoped(name), parent, pose, holds, at: at.clone() })?;
        match kind {
            "joint" => {
                if let Some(joint) = moving(node) {
                    frames.moves(&scoped(name), joint);
                }
            }
            "model" => {
                let inner = format!("{}::", scoped(name));
                let (name, parent) = (format!("{inner}{MODEL}"), scoped(name));
                let (pose, holds) = (IDENTITY, FrameContent::Other);
                frames.add(RigFrame { name, parent, pose, holds, at })?;
                read_model(node, &inner, file, frames)?;
            }
            "link" => read_sensors(node, &scoped(name), scope, file, frames)?,
            _ => {}
        }
    }
    Ok(())
}

/// A doubt about the `<origin>` of URDF and of the first SDF, in an element whose `<pose>` is read.
fn doubt_origin(node: Node, file: &str, frames: &mut FrameTree) {
    if yaml::child(node, "origin").is_some() {
        let at = yaml::place(node, file);
        frames.notes.push(Note::doubt(format!(
            "{at}: <origin> is not read here; write its pose as <pose>x y z roll pitch yaw</pose>"
        )));
    }
}

/// The joint of an element, where it moves.
fn moving(node: Node) -> Option<MovingJoint> {
    let name = node.attribute("name").unwrap_or_default();
    let kind = node.attribute("type").filter(|kind| *kind != "fixed")?;
    let axis = yaml::child(node, "axis");
    let begin = axis.and_then(|axis| yaml::child(axis, "initial_position"));
    let begin = begin.map(yaml::text).filter(|text| text.trim().parse() != Ok(0.0));
    let limit = axis.and_then(|axis| yaml::child(axis, "limit"));
    let end = |key: &str| yaml::text(yaml::child(limit?, key)?).trim().parse::<f64>().ok();
    let at = match (begin, end("lower").filter(|v| *v > 0.0), end("upper").filter(|v| *v < 0.0)) {
        (Some(begin), ..) => format!("0, not at its <initial_position> of {}", begin.trim()),
        (None, Some(lower), _) => format!("0, below the <lower> end of its <limit>, {lower}"),
        (None, None, Some(upper)) => format!("0, above the <upper> end of its <limit>, {upper}"),
        (None, None, None) => AT_ZERO.to_owned(),
    };
    Some(MovingJoint { joint: format!("`{name}` ({kind})"), at })
}

/// Keeps which link a joint holds on which other one.
fn read_hold(node: Node, scope: &str, frames: &mut FrameTree) {
    let link = |key: &str| yaml::child(node, key).map(|link| yaml::text(link).trim().to_owned());
    if node.attribute("type").is_none() {
        let name = node.attribute("name").unwrap_or_default();
        frames.notes.push(Note::doubt(format!(
            "the joint `{name}` has no `type` and is taken as fixed; write type=\"fixed\", or the type that it has"
        )));
    }
    if let (Some(parent), Some(child)) = (link("parent"), link("child")) {
        let (parent, child) = (format!("{scope}{parent}"), format!("{scope}{child}"));
        // A gearbox couples two links that other joints hold.
        if node.attribute("type") != Some("gearbox") {
            frames.holds(&child, parent, moving(node));
        }
    }
}

/// Adds the sensors of a link `name`; the element is the link, or the element of URDF in its place.
pub(super) fn read_sensors(
    link: Node,
    name: &str,
    scope: &str,
    file: &str,
    frames: &mut FrameTree,
) -> Checked<()> {
    for sensor in link.children().filter(|node| node.has_tag_name("sensor")) {
        let (optical, parent) = pose(sensor, file, frames)?;
        doubt_origin(sensor, file, frames);
        match parent {
            // Its own pose hangs on another frame than its link.
            Some(parent) if format!("{scope}{parent}") != name => {
                let at = yaml::place(sensor, file);
                let own = sensor.attribute("name").unwrap_or_default();
                let frame = format!("{name}/{own}");
                let (parent, holds) = (format!("{scope}{parent}"), FrameContent::Other);
                frames.add(RigFrame { name: frame.clone(), parent, pose: optical, holds, at })?;
                add_sensor(frames, sensor, &frame, IDENTITY, file)?;
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
) -> Checked<(SensorPose, Option<&'a str>)> {
    let Some(element) = yaml::child(node, "pose") else { return Ok((IDENTITY, None)) };
    let at = yaml::place(node, file).key("pose");
    if node.children().filter(|child| child.has_tag_name("pose")).count() > 1 {
        return Err(wrong(&at, "a second <pose>", "one <pose>"));
    }
    let known = ["relative_to", "frame", "degrees", "rotation_format"];
    let wanted = "no attribute but relative_to, degrees or rotation_format";
    yaml::refuse_attributes(element, &at, &known, wanted)?;
    let text = yaml::text(element);
    let named = |key: &str| element.attribute(key).filter(|frame| !frame.is_empty());
    let old = named("frame");
    if let Some(frame) = old {
        frames.notes.push(Note::doubt(format!(
            "{at}: frame=\"{frame}\" of before SDF 1.7 is followed as relative_to; write relative_to"
        )));
    }
    let relative_to = named("relative_to").or(old);
    let is_quaternion = match element.attribute("rotation_format").map(str::trim) {
        None | Some("euler_rpy") => false,
        Some("quat_xyzw") => true,
        Some(other) => {
            return Err(wrong(&at.key("rotation_format"), other, "euler_rpy or quat_xyzw"));
        }
    };
    if is_quaternion && !text.trim().is_empty() {
        let wanted = "seven numbers: x y z and a quaternion x y z w";
        let [x, y, z, qx, qy, qz, qw] = yaml::numbers_of_text(&text, &at, wanted)?;
        return Ok((of_quaternion([x, y, z], [qx, qy, qz, qw], &at)?, relative_to));
    }
    let pose = yaml::pose_of_text(&text, &at)?;
    let degrees = element.attribute("degrees").unwrap_or("false");
    match degrees.trim().to_lowercase().as_str() {
        "false" | "0" => Ok((pose, relative_to)),
        "true" | "1" => Ok((carla::turned(pose, f64::to_radians), relative_to)),
        _ => Err(wrong(&at.key("degrees"), degrees, "true or false")),
    }
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
        let (foot, height) = mounting.foot(lidar);
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

/// True for the `<sensor>` of a LiDAR: by its type, or by a `<ray>` or `<lidar>` in it where it has no type.
pub(super) fn is_lidar(sensor: Node) -> bool {
    let casts = |node: Node| node.has_tag_name("ray") || node.has_tag_name("lidar");
    sensor.has_tag_name("sensor")
        && match sensor.attribute("type") {
            Some(kind) => LIDARS.contains(&kind),
            None => sensor.children().any(casts),
        }
}

/// Adds a LiDAR for a `<sensor>` whose pose in the frame `link` is `optical`. Reads its model from a name
/// `FRAME-MODEL`, as in Velodyne's description, and its phase from this program's own attribute.
pub(super) fn add_sensor(
    frames: &mut FrameTree,
    sensor: Node,
    link: &str,
    optical: SensorPose,
    file: &str,
) -> Checked<()> {
    // A sensor of another type says nothing about its link: many LiDARs hold an IMU.
    if !is_lidar(sensor) {
        return Ok(());
    }
    let name = sensor.attribute("name").unwrap_or_default();
    let phase = sensor.attribute((OWN, PHASE));
    let place = || yaml::place(sensor, file).key(PHASE);
    let phase = phase.map(|text| number(&place(), text)).transpose()?;
    let optical = SensorPose { phase, ..optical };
    let model = name.strip_prefix(link).and_then(|rest| rest.strip_prefix('-'));
    let model = model.filter(|model| !model.is_empty()).map(beams::usual);
    let holds = FrameContent::Lidar { sensor: model, optical: Some(optical) };
    match frames.get_mut(link) {
        Some(frame) if link != BASE_LINK && !matches!(frame.holds, FrameContent::Lidar { .. }) => {
            frame.holds = holds;
        }
        // A second LiDAR of a link, or one of the base itself, has a frame of its own.
        _ => frames.add(RigFrame {
            name: format!("{link}/{name}"),
            parent: link.to_owned(),
            pose: IDENTITY,
            holds,
            at: yaml::place(sensor, file),
        })?,
    }
    Ok(())
}

/// The element that [`add_sensor`] reads, for a LiDAR `up` metres above its foot.
pub(super) fn sensor_element(lidar: &RigLidar, up: f64, models: &Models, indent: &str) -> String {
    let RigLidar { frame, sensor, pose } = lidar;
    let name = sensor.as_ref().map_or(frame.clone(), |sensor| format!("{frame}-{sensor}"));
    let phase = pose.phase.map(|phase| format!(" {PREFIX}:{PHASE}=\"{}\"", written(phase)));
    let phase = phase.unwrap_or_default();
    format!(
        "{indent}<sensor name=\"{}\" type=\"gpu_lidar\"{phase}>\n{indent}  <pose>0 0 {} 0 0 0</pose>\n{}\
         {indent}</sensor>\n",
        yaml::escape(&name),
        written(up),
        models.gazebo(lidar, &format!("{indent}  "))
    )
}

/// Declaration of the XML namespace for phases; empty if no LiDAR of the rig has one.
pub(super) fn namespace(rig: &Rig) -> String {
    let phased = rig.lidars.iter().any(|lidar| lidar.pose.phase.is_some());
    if phased { format!(" xmlns:{PREFIX}=\"{OWN}\"") } else { String::new() }
}

/// True for a model of the file or of its world; a `<state>` repeats names only.
fn is_outer(node: &Node) -> bool {
    let above = node.parent_element().map(|parent| parent.tag_name().name());
    node.has_tag_name("model") && matches!(above, Some("sdf" | "world" | "population"))
}

fn name<'a>(model: &Node<'a, '_>) -> &'a str {
    model.attribute("name").unwrap_or("without a name")
}

/// The model to read: the one of `--base-frame`, else the only one with LiDARs by type, else by the names of its links.
///
/// # Errors
/// No model, several with LiDARs, or LiDARs that only an included file may have.
fn vehicle<'a, 'i>(
    document: &'a Document<'i>,
    file: &str,
    settings: &ImportSettings,
    frames: &mut FrameTree,
) -> Checked<Node<'a, 'i>> {
    let models: Vec<Node> = document.descendants().filter(is_outer).collect();
    let included = included(document);
    let base = settings.base_frame.as_deref().unwrap_or_default();
    let is_meant = |model: &Node| {
        let rest = model.attribute("name").and_then(|name| base.strip_prefix(name));
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
    };
    let typed = |model: &Node| model.descendants().any(|node| is_lidar(node));
    let named = |model: &Node| {
        let links = model.descendants().filter(|node| node.has_tag_name("link"));
        links.filter_map(|link| link.attribute("name")).any(import::is_name_of_lidar)
    };
    let of = |is: &dyn Fn(&Node) -> bool| -> Vec<Node> {
        models.iter().copied().filter(|model| is(model)).collect()
    };
    let ways: [&dyn Fn(&Node) -> bool; 3] = [&is_meant, &typed, &named];
    let found = ways.iter().map(|way| of(*way)).find(|found| !found.is_empty());
    let nothing = found.is_none();
    let found = found.unwrap_or_else(|| models.clone());
    if nothing && settings.frames.is_empty() && !included.is_empty() {
        return Err(refused!(
            "{file}: no model in it has a LiDAR, and its <include>s are not read: {}; merge the files with `gz sdf -p \
             {file}`",
            listed(&included)
        ));
    }
    let Some(&model) = found.first() else {
        return Err(missing(&yaml::place(document.root_element(), file), "<model>"));
    };
    if found.len() > 1 && !nothing {
        let models: Vec<String> = found.iter().map(|model| name(model).to_owned()).collect();
        return Err(refused!(
            "{file}: several of its models have LiDARs: {}; pick one with --base-frame {}",
            listed(&models),
            models[0]
        ));
    }
    let others: Vec<&str> = models
        .iter()
        .filter(|other| **other != model)
        .map(name)
        .chain(included.iter().map(String::as_str))
        .collect();
    if !others.is_empty() {
        let text = format!(
            "{file}: of its models `{}` is read; left out are {}",
            name(&model),
            others.join(", ")
        );
        frames.notes.push(if nothing { Note::doubt(text) } else { Note::fact(text) });
    }
    note_pose(model, file, frames);
    Ok(model)
}

fn included(document: &Document) -> Vec<String> {
    let of_world = |node: &Node| {
        let above = node.parent_element().map(|parent| parent.tag_name().name());
        node.has_tag_name("include") && matches!(above, Some("sdf" | "world"))
    };
    let uri = |node: Node| {
        let uri = yaml::child(node, "uri").map(yaml::text).unwrap_or_default();
        format!("<include> of {}", uri.trim())
    };
    document.descendants().filter(of_world).map(uri).collect()
}

/// Says that the place of the model in its world is none of a LiDAR on it.
fn note_pose(model: Node, file: &str, frames: &mut FrameTree) {
    let text = yaml::child(model, "pose").map(yaml::text).unwrap_or_default();
    let numbers: Vec<f64> = text.split_whitespace().map_while(|word| word.parse().ok()).collect();
    if numbers.iter().any(|number| *number != 0.0) {
        let up = numbers.get(2).copied().unwrap_or_default();
        frames.notes.push(Note::fact(format!(
            "{file}: positions count from the frame of the model `{}`, not from the world, where it stands at {}; where \
             the ground is at z = 0, --base-link=0,0,{up} counts heights from it",
            name(&model),
            text.split_whitespace().collect::<Vec<_>>().join(" ")
        )));
    }
}
