//! SDF of Gazebo: `<pose relative_to>`, in metres and radians.

use std::fmt::Write;

use roxmltree::Node;

use super::angles::of_quaternion;
use super::fields::wrong;
use super::frames::{Frame, Frames, Holds};
use super::numbers::written;
use super::simulated::{add_sensor, namespace, sensor_element};
use super::{BASE_LINK, Models, Mounting, Rig, RigError, Source, xml};
use crate::Note;
use crate::vehicle::SensorPose;

/// Frame that everything in a model hangs on unless it says otherwise.
pub(super) const MODEL: &str = "__model__";

/// Reads links, frames and sensors of the first model; models in the model are left out.
pub(super) fn read(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    let file = &source.file;
    let document = xml::parse(&source.text, file)?;
    let model = document.descendants().find(|node| node.has_tag_name("model"));
    let Some(model) = model else {
        let at = Box::new(xml::place(document.root_element(), file));
        return Err(RigError::Missing { at, key: "<model>".to_owned() });
    };
    frames.name = model.attribute("name").map(str::to_owned);
    if model.children().any(|node| node.has_tag_name("model") || node.has_tag_name("include")) {
        let text = format!("{file}: models inside of the model are left out");
        frames.notes.push(Note::fact(text));
    }
    for node in model.children().filter(Node::is_element) {
        let usual_parent = match node.tag_name().name() {
            "link" => MODEL,
            "frame" => node.attribute("attached_to").filter(|to| !to.is_empty()).unwrap_or(MODEL),
            _ => continue,
        };
        let at = xml::place(node, file);
        let name = xml::attribute(node, "name", &at)?.to_owned();
        let (pose, parent) = pose(node, file)?;
        let parent = parent.unwrap_or(usual_parent).to_owned();
        frames.add(Frame { name, parent, pose, holds: Holds::Unsaid, at })?;
    }
    for link in model.children().filter(|node| node.has_tag_name("link")) {
        let name = link.attribute("name").unwrap_or_default();
        for sensor in link.children().filter(|node| node.has_tag_name("sensor")) {
            let (optical, parent) = pose(sensor, file)?;
            add_sensor(frames, sensor, parent.unwrap_or(name), optical, file)?;
        }
    }
    Ok(())
}

/// The `<pose>` of an element, and the frame that it is relative to, if it names one.
fn pose<'a>(node: Node<'a, '_>, file: &str) -> Result<(SensorPose, Option<&'a str>), RigError> {
    let Some(element) = xml::child(node, "pose") else {
        return Ok((super::angles::IDENTITY, None));
    };
    let at = xml::place(node, file).key("pose");
    let text = element.text().unwrap_or_default();
    let relative_to = element.attribute("relative_to").filter(|frame| !frame.is_empty());
    if element.attribute("rotation_format") == Some("quat_xyzw") {
        let wanted = "seven numbers: x y z and a quaternion x y z w";
        let [x, y, z, qx, qy, qz, qw] = xml::numbers(text, &at, wanted)?;
        let pose = of_quaternion([x, y, z], [qx, qy, qz, qw]);
        return Ok((pose.ok_or_else(|| wrong(&at, text, wanted))?, relative_to));
    }
    let mut pose = xml::six(text, &at)?;
    if element.attribute("degrees") == Some("true") {
        let [roll, pitch, yaw] = [pose.roll, pose.pitch, pose.yaw].map(f64::to_radians);
        pose = SensorPose { roll, pitch, yaw, ..pose };
    }
    Ok((pose, relative_to))
}

/// A model of `base_link` and one link a LiDAR.
pub(super) fn write(rig: &Rig, mounting: &Mounting, models: &Models) -> String {
    let mut text = format!(
        "<?xml version=\"1.0\"?>\n<sdf version=\"1.9\"{}>\n  <model name=\"{}\">\n    \
         <link name=\"{BASE_LINK}\"/>\n",
        namespace(rig),
        xml::escape(&rig.name)
    );
    for lidar in &rig.lidars {
        let sensor = lidar.sensor.as_deref();
        let (foot, height) = mounting.foot(&lidar.frame, sensor, &lidar.pose);
        let [x, y, z, roll, pitch, yaw] = foot.values().map(written);
        let frame = xml::escape(&lidar.frame);
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
