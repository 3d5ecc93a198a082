//! ROS 2 launch files of static transform publishers: Python and XML are read, Python is written.

use std::collections::HashMap;
use std::fmt::Write;

use serde_json::Value;

use super::angles::of_quaternion;
use super::fields::{number, wrong};
use super::frames::{Frame, Frames, Holds};
use super::literal::{literal, skip_blank};
use super::{BASE_LINK, Mounting, Rig, RigError, Source, xml};
use crate::json::Place;
use crate::vehicle::SensorPose;

/// Program of `tf2_ros` that publishes a transform.
pub(super) const PUBLISHER: &str = "static_transform_publisher";
/// Flags that take a value; what else there is, is left alone.
const FLAGS: [&str; 12] = [
    "--x",
    "--y",
    "--z",
    "--roll",
    "--pitch",
    "--yaw",
    "--qx",
    "--qy",
    "--qz",
    "--qw",
    "--frame-id",
    "--child-frame-id",
];
/// Begins what a node tells ROS itself.
const ROS_ARGS: &str = "--ros-args";

/// Reads every publisher of a launch file.
pub(super) fn read(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    if source.text.trim_start().starts_with('<') {
        read_xml(source, frames)
    } else {
        read_python(source, frames)
    }
}

fn read_xml(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    let document = xml::parse(&source.text, &source.file)?;
    let nodes = document.descendants().filter(|node| node.has_tag_name("node"));
    for (index, node) in nodes.enumerate() {
        let program = node.attribute("exec").or(node.attribute("type"));
        if program == Some(PUBLISHER) {
            let at = Place::top(&source.file).key("<node>").item(index);
            let args = xml::attribute(node, "args", &at)?;
            let words = args.split_whitespace().map(str::to_owned).collect();
            frames.add(publisher(words, at)?)?;
        }
    }
    Ok(())
}

/// Reads `Node(… arguments=[ … ] …)`; the lists must be literals.
fn read_python(source: &Source, frames: &mut Frames) -> Result<(), RigError> {
    let text = without_comments(&source.text);
    let mut line = 1;
    for (index, call) in text.split("Node(").enumerate() {
        let at = Place::top(&source.file).key(&format!("Node, line {line}"));
        line += call.matches('\n').count();
        if index == 0 || !call.contains(PUBLISHER) {
            continue;
        }
        let list = call.match_indices("arguments").find_map(|(start, word)| {
            let rest = skip_blank(&call[start + word.len()..]).strip_prefix('=')?;
            Some(skip_blank(rest)).filter(|rest| rest.starts_with('['))
        });
        let missing =
            || RigError::Missing { at: Box::new(at.clone()), key: "arguments=[…]".into() };
        let (list, _) = literal(list.ok_or_else(missing)?).map_err(|problem| RigError::Syntax {
            at: Box::new(at.clone()),
            what: "list of arguments",
            problem,
        })?;
        let word = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let words = list.as_array().into_iter().flatten().map(word).collect();
        frames.add(publisher(words, at)?)?;
    }
    Ok(())
}

/// Python without its comments; a `#` in quotes is none.
fn without_comments(text: &str) -> String {
    let mut kept = String::with_capacity(text.len());
    let (mut quote, mut comment, mut escape) = (None, false, false);
    for c in text.chars() {
        if c == '\n' {
            (quote, comment, escape) = (None, false, false);
        } else if let Some(open) = quote {
            if !escape && c == open {
                quote = None;
            }
            escape = c == '\\' && !escape;
        } else if c == '#' {
            comment = true;
        } else if !comment && (c == '"' || c == '\'') {
            quote = Some(c);
        }
        if !comment {
            kept.push(c);
        }
    }
    kept
}

/// The frame of a publisher's arguments: flags, or `x y z yaw pitch roll PARENT CHILD` as before ROS 2
/// Humble, or that with a quaternion x y z w.
fn publisher(words: Vec<String>, at: Place) -> Result<Frame, RigError> {
    let end = words.iter().position(|word| word == ROS_ARGS).unwrap_or(words.len());
    let words = &words[..end];
    let positional: &[&str] = match words.len() {
        8 => &["--x", "--y", "--z", "--yaw", "--pitch", "--roll", "--frame-id", "--child-frame-id"],
        _ => {
            &["--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw", "--frame-id", "--child-frame-id"]
        }
    };
    let has_flags = words.iter().any(|word| FLAGS.contains(&word.as_str()));
    let given: HashMap<&str, &str> = if has_flags {
        let mut given = HashMap::new();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            if let Some(flag) = FLAGS.iter().find(|flag| *flag == word) {
                let value =
                    words.next().ok_or_else(|| wrong(&at, word, "a flag with its value"))?;
                given.insert(*flag, value.as_str());
            }
        }
        given
    } else if words.len() == positional.len() {
        positional.iter().copied().zip(words.iter().map(String::as_str)).collect()
    } else {
        return Err(wrong(&at, words.join(" "), "a list of flags as --x 1 --frame-id base_link"));
    };
    let frame = |flag: &str| {
        let missing = || RigError::Missing { at: Box::new(at.clone()), key: flag.to_owned() };
        given.get(flag).map(|name| (*name).to_owned()).ok_or_else(missing)
    };
    let (name, parent) = (frame("--child-frame-id")?, frame("--frame-id")?);
    Ok(Frame { name, parent, pose: pose(&given, &at)?, holds: Holds::Unsaid, at })
}

/// The transform of flags; what is not given is 0, a quaternion counts before angles.
fn pose(given: &HashMap<&str, &str>, at: &Place) -> Result<SensorPose, RigError> {
    let value = |flag: &str, other: f64| match given.get(flag) {
        Some(text) => number(&at.key(flag), text),
        None => Ok(other),
    };
    let (x, y, z) = (value("--x", 0.0)?, value("--y", 0.0)?, value("--z", 0.0)?);
    if ["--qx", "--qy", "--qz", "--qw"].iter().any(|flag| given.contains_key(flag)) {
        let [qx, qy, qz] = ["--qx", "--qy", "--qz"].map(|flag| value(flag, 0.0));
        let pose = of_quaternion([x, y, z], [qx?, qy?, qz?, value("--qw", 1.0)?]);
        return pose.ok_or_else(|| wrong(at, "a quaternion of length 0", "a rotation"));
    }
    let [roll, pitch, yaw] = ["--roll", "--pitch", "--yaw"].map(|flag| value(flag, 0.0));
    Ok(SensorPose::from_values([x, y, z, roll?, pitch?, yaw?]))
}

/// A launch file in Python, one publisher a LiDAR.
pub(super) fn write(rig: &Rig, mounting: &Mounting) -> String {
    let mut text =
        "from launch import LaunchDescription\nfrom launch_ros.actions import Node\n\n\n\
                    def generate_launch_description():\n    return LaunchDescription([\n"
            .to_owned();
    for lidar in &rig.lidars {
        let (foot, _) = mounting.foot(&lidar.frame, lidar.sensor.as_deref(), &lidar.pose);
        let number = |(key, value)| format!("                '--{key}', '{value}',\n");
        let numbers: String = foot.fields().into_iter().map(number).collect();
        let _ = write!(
            text,
            "        Node(\n            package='tf2_ros',\n            executable='{PUBLISHER}',\n            \
             arguments=[\n{numbers}                '--frame-id', '{BASE_LINK}',\n                \
             '--child-frame-id', {},\n            ],\n        ),\n",
            Value::from(lidar.frame.as_str())
        );
    }
    text + "    ])\n"
}
