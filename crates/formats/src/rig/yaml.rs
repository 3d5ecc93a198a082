//! Rigs in YAML: Autoware's pair of files, static transforms of ROS, and PandaSet's extrinsics.
//!
//! - Autoware: `base_link` holds the sensor kit, and the kit holds the sensors.
//! - Transforms of ROS 1 and ROS 2, as `ros2 topic echo /tf_static` prints them.
//! - PandaSet's `static_extrinsic_calibration`: quaternions in the frame of the LiDAR on the roof.

use roxmltree::{Document, Node, ParsingOptions};
use serde_json::{Map, Value};
use sightline_files::Note;
use sightline_files::json::{Location, check_xml, did_you_mean, has_no_prefix, nearest, written};
use sightline_scene::vehicle::SensorPose;

use super::frames::{FrameContent, FrameTree, IDENTITY, RigFrame, of_quaternion};
use super::{BASE_LINK, Checked, FormatError, Mounting, NamedText, Rig, RigSource};

/// Frame of Autoware's sensor kit.
pub(super) const KIT: &str = "sensor_kit_base_link";

/// Keys of a frame that are passed over: they say which sensor it is, and where its data go.
const AUTOWARE_PASSED: [&str; 12] = [
    "comment", "description", "frame_id", "manufacturer", "model", "name", "sensor_model",
    "sensor_type", "serial_number", "topic", "type", "vendor",
];

/// True if a value is a frame: it has at least one of the six numbers.
fn is_frame(value: &Value) -> bool {
    SensorPose::FIELDS.iter().any(|field| value.get(field).is_some())
}

pub(super) fn holds_frames(document: &Value) -> bool {
    let inside = |value: &Value| value.as_object().is_some_and(|map| map.values().any(is_frame));
    document.as_object().is_some_and(|map| map.values().any(inside))
}

/// Reader of one document.
type Reader = fn(&Value, Location, &mut FrameTree) -> Checked<()>;

/// Reads a file of one document.
pub(super) fn read(source: &RigSource, frames: &mut FrameTree, reader: Reader) -> Checked<()> {
    let document = source.yaml()?;
    let top = Location::top(&source.file);
    reader(&document.value, top, frames).map_err(|error| error.at_line(&document))
}

/// Reads each frame in each frame of Autoware's files.
pub(super) fn read_frames(document: &Value, top: Location, frames: &mut FrameTree) -> Checked<()> {
    let read: Vec<&str> = SensorPose::FIELDS.into_iter().chain([PHASE]).collect();
    for (parent, children, at) in Fields::of(document, top)?.each() {
        let Some(map) = children.as_object().filter(|map| map.values().any(is_frame)) else {
            if is_frame(children) {
                frames.notes.push(Note::doubt(format!(
                    "{at}: stands under no parent frame and is not read; write it under `{BASE_LINK}`"
                )));
                continue;
            }
            let text = format!("{at}: holds no frame with x, y, z, roll, pitch and yaw; not read");
            // Objects in an object may be frames of other keys.
            let inside = children.as_object().is_some_and(|map| map.values().any(Value::is_object));
            frames.notes.push(if inside { Note::doubt(text) } else { Note::fact(text) });
            continue;
        };
        for (name, value) in map {
            let at = at.key(name);
            let fields = Fields::of(value, at.clone())?;
            fields.refuse_others(&read, &AUTOWARE_PASSED)?;
            let (name, parent, pose) = (name.clone(), parent.clone(), fields.pose(6)?);
            frames.add(RigFrame { name, parent, pose, holds: FrameContent::Unsaid, at })?;
        }
    }
    Ok(())
}

/// The pair: the kit stands at `base_link`, all LiDARs on the kit.
pub(super) fn write_autoware(rig: &Rig, mounting: &Mounting) -> Vec<NamedText> {
    let frame = |name: &str, pose: &SensorPose| {
        let number = |(key, value)| format!("    {key}: {}\n", decimal(value));
        let numbers: String = named(pose).map(number).collect();
        format!("  {}:\n{numbers}", key(name))
    };
    let kit = format!("{BASE_LINK}:\n{}", frame(KIT, &IDENTITY));
    let mut sensors = format!("{KIT}:\n");
    for lidar in &rig.lidars {
        let (foot, _) = mounting.foot(lidar);
        sensors += &frame(&lidar.frame, &foot);
    }
    vec![
        NamedText { name: "sensors_calibration.yaml".to_owned(), text: kit },
        NamedText { name: "sensor_kit_calibration.yaml".to_owned(), text: sensors },
    ]
}

/// A number that YAML 1.1 takes for one: with a point, also before an exponent.
fn decimal(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((digits, power)) => {
            let point = if digits.contains('.') { "" } else { ".0" };
            let sign = if power.starts_with('-') { "" } else { "+" };
            format!("{digits}{point}e{sign}{power}")
        }
        None => text,
    }
}

/// A key; in quotes where some YAML reader would take it for a number, a truth value or a sign.
fn key(name: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "_/.-".contains(c);
    let is_plain = name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.contains('_')
        && name.chars().all(plain);
    if is_plain { name.to_owned() } else { Value::from(name).to_string() }
}

/// Key of a message's list of transforms.
const LIST: &str = "transforms";
/// Key that a transform has, and nothing else.
const CHILD: &str = "child_frame_id";
/// Keys of a header that are passed over: a static transform holds at all times.
const PASSED_HEADER: [&str; 2] = ["seq", "stamp"];

/// True if a document is a message of transforms, a list of them, or one.
pub(super) fn holds_transforms(document: &Value) -> bool {
    let is_one = |value: &Value| value.get(CHILD).is_some();
    let any = |list: &Value| list.as_array().is_some_and(|list| list.iter().any(is_one));
    is_one(document) || any(document) || document.get(LIST).is_some_and(any)
}

pub(super) fn read_transforms(source: &RigSource, frames: &mut FrameTree) -> Checked<()> {
    for document in source.documents()? {
        let top = Location::top(&source.file);
        read_message(&document.value, top, frames).map_err(|error| error.at_line(&document))?;
    }
    Ok(())
}

fn read_message(message: &Value, at: Location, frames: &mut FrameTree) -> Checked<()> {
    if message.get(CHILD).is_some() {
        return add(transform(message, at)?, frames);
    }
    let (list, at) = if message.is_array() {
        (message, at)
    } else {
        let fields = Fields::of(message, at.clone())?;
        fields.refuse_others(&[LIST], &[])?;
        (fields.value(LIST)?, at.key(LIST))
    };
    let Some(list) = list.as_array() else {
        return Err(wrong(&at, list, "a list of transforms"));
    };
    for (i, value) in list.iter().enumerate() {
        add(transform(value, at.item(i))?, frames)?;
    }
    Ok(())
}

/// Adds a frame; several publishers may send one transform, so the same twice is one.
fn add(frame: RigFrame, frames: &mut FrameTree) -> Checked<()> {
    let is_same = |old: &RigFrame| old.parent == frame.parent && old.pose == frame.pose;
    if frames.get(&frame.name).is_some_and(is_same) { Ok(()) } else { frames.add(frame) }
}

fn transform(value: &Value, at: Location) -> Checked<RigFrame> {
    if value == "..." {
        let wanted = "a transform (`ros2 topic echo --full-length` prints all)";
        return Err(wrong(&at, "...", wanted));
    }
    let fields = Fields::of(value, at.clone())?;
    fields.refuse_others(&["header", CHILD, "transform"], &[])?;
    let (header, transform) = (fields.inner("header")?, fields.inner("transform")?);
    header.refuse_others(&["frame_id"], &PASSED_HEADER)?;
    let pose = pose(&transform)?;
    // Names of ROS 1 may begin with a slash.
    let name = |fields: &Fields, key: &str| {
        fields.text(key).map(|name| name.strip_prefix('/').unwrap_or(name).to_owned())
    };
    let (name, parent) = (name(&fields, CHILD)?, name(&header, "frame_id")?);
    Ok(RigFrame { name, parent, pose, holds: FrameContent::Unsaid, at })
}

/// Pose of a `translation` and a quaternion `rotation`.
fn pose(transform: &Fields) -> Checked<SensorPose> {
    transform.refuse_others(&["translation", "rotation"], &[])?;
    let (translation, rotation) = (transform.inner("translation")?, transform.inner("rotation")?);
    translation.refuse_others(&["x", "y", "z"], &[])?;
    rotation.refuse_others(&["x", "y", "z", "w"], &[])?;
    let [x, y, z] = ["x", "y", "z"].map(|key| translation.number(key));
    let [qx, qy, qz, qw] = ["x", "y", "z", "w"].map(|key| rotation.number(key));
    of_quaternion([x?, y?, z?], [qx?, qy?, qz?, qw?], &rotation.at)
}

/// The sensor that all others are given in.
pub(super) const PANDASET_BASE: &str = "main_pandar64";

/// Keys of the file that are passed over: they say where it comes from.
const PANDASET_PASSED: [&str; 5] = ["comment", "description", "license", "source", "version"];
/// Keys of a sensor that are passed over: they say which sensor it is, and how a camera sees.
const PASSED_SENSOR: [&str; 6] =
    ["comment", "description", "device", "intrinsic", "intrinsics", "name"];

pub(super) fn is_pandaset(document: &Value) -> bool {
    let sensors = document.get("sensors").and_then(Value::as_object);
    sensors.is_some_and(|map| map.values().any(|sensor| sensor.get("transform").is_some()))
}

/// Reads every sensor of PandaSet; all but cameras are LiDARs.
pub(super) fn read_sensors(document: &Value, top: Location, frames: &mut FrameTree) -> Checked<()> {
    let top = Fields::of(document, top)?;
    for (key, _, at) in top.each() {
        if key != "sensors" && !PANDASET_PASSED.contains(&key.as_str()) {
            frames.notes.push(Note::fact(format!("{at}: not known here, and not read")));
        }
    }
    for (name, sensor, at) in top.inner("sensors")?.each() {
        let fields = Fields::of(sensor, at.clone())?;
        fields.refuse_others(&["transform"], &PASSED_SENSOR)?;
        let pose = pose(&fields.inner("transform")?)?;
        let holds = if name.contains("camera") {
            FrameContent::Other
        } else {
            FrameContent::Lidar { sensor: None, optical: None }
        };
        // A base in itself would be a loop.
        let parent = if name == PANDASET_BASE { "vehicle" } else { PANDASET_BASE };
        let (name, parent) = (name.clone(), parent.to_owned());
        frames.add(RigFrame { name, parent, pose, holds, at })?;
    }
    Ok(())
}

/// Most characters of a value that a message repeats.
const MOST_SHOWN: usize = 40;

/// Key of the angle at which a LiDAR is locked. No other program reads it, and none trips over it.
pub(super) const PHASE: &str = "phase";

/// The six numbers of a pose by name, and its phase if it has one, as people write them.
pub(super) fn named(pose: &SensorPose) -> impl Iterator<Item = (&'static str, f64)> {
    let all = pose.fields().into_iter().chain(pose.phase.map(|phase| (PHASE, phase)));
    all.map(|(key, value)| (key, written(value)))
}

/// Pose and phase as JSON keys and numbers.
pub(super) fn pose_entries(pose: &SensorPose) -> impl Iterator<Item = (String, Value)> {
    named(pose).map(|(key, value)| (key.to_owned(), value.into()))
}

/// Error of a value that is not `wanted`.
pub(super) fn wrong(at: &Location, value: impl ToString, wanted: &'static str) -> FormatError {
    let mut value = value.to_string();
    if value.chars().count() > MOST_SHOWN {
        value = value.chars().take(MOST_SHOWN).chain(['…']).collect();
    }
    FormatError::at(at, &format!("`{value}` stands where {wanted} belongs"))
}

/// Error of a key, element or placement that the place lacks.
pub(super) fn missing(at: &Location, key: &str) -> FormatError {
    FormatError::at(at, &format!("`{key}` is missing; add it"))
}

pub(super) fn number(at: &Location, text: &str) -> Checked<f64> {
    let number = text.parse().ok().filter(|v: &f64| v.is_finite());
    number.ok_or_else(|| wrong(at, text, "a finite number"))
}

#[derive(Clone)]
pub(super) struct Fields<'a> {
    map: &'a Map<String, Value>,
    pub(super) at: Location,
    /// True if texts count as numbers.
    texts: bool,
}

impl<'a> Fields<'a> {
    pub(super) fn of(value: &'a Value, at: Location) -> Checked<Self> {
        match value.as_object() {
            Some(map) => Ok(Self { map, at, texts: false }),
            None => Err(wrong(&at, value, "an object of keys and values")),
        }
    }

    /// Keys and values of a file of CARLA: its attributes are texts, so that a text counts as a number.
    pub(super) fn of_carla(value: &'a Value, at: Location) -> Checked<Self> {
        Ok(Self { texts: true, ..Self::of(value, at)? })
    }

    /// Refuses keys that are neither read nor passed over.
    pub(super) fn refuse_others(&self, read: &[&str], passed: &[&str]) -> Checked<()> {
        let is_known = |key: &&String| read.iter().chain(passed).any(|known| known == key);
        let Some(key) = self.map.keys().find(|key| !is_known(key)) else { return Ok(()) };
        // A key that is there already was not meant.
        let nearest = nearest(key, read.iter().copied().filter(|key| !self.has(key)));
        let known: Vec<String> = read.iter().map(|&key| key.to_owned()).collect();
        let key: String = key.chars().take(MOST_SHOWN).collect();
        let told = format!("{}: unknown key `{key}`{}", self.at, did_you_mean(&nearest, &known));
        Err(FormatError::At { path: self.at.key(&key).path, told })
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.map.contains_key(key)
    }

    /// The value of a key that must be there.
    pub(super) fn value(&self, key: &str) -> Checked<&'a Value> {
        self.map.get(key).ok_or_else(|| missing(&self.at, key))
    }

    pub(super) fn inner(&self, key: &str) -> Checked<Self> {
        Ok(Self { texts: self.texts, ..Self::of(self.value(key)?, self.at.key(key))? })
    }

    /// Each key with its value and place.
    pub(super) fn each(&self) -> impl Iterator<Item = (&'a String, &'a Value, Location)> {
        self.map.iter().map(|(key, value)| (key, value, self.at.key(key)))
    }

    /// The number under a key. A text counts in files of CARLA alone, and never with a leading zero: 010 is 8 to some
    /// readers of YAML.
    pub(super) fn number(&self, key: &str) -> Checked<f64> {
        let value = self.value(key)?;
        let of_text = || {
            let text = value.as_str().filter(|_| self.texts)?.trim();
            let digits = text.trim_start_matches(['+', '-']).as_bytes();
            let is_octal = matches!(digits, [b'0', b'0'..=b'9', ..]);
            text.parse().ok().filter(|_| !is_octal)
        };
        let number = value.as_f64().or_else(of_text).filter(|v| v.is_finite());
        number.ok_or_else(|| wrong(&self.at.key(key), plain(value), "a finite number"))
    }

    pub(super) fn text(&self, key: &str) -> Checked<&'a str> {
        let value = self.value(key)?;
        value.as_str().ok_or_else(|| wrong(&self.at.key(key), plain(value), "a text"))
    }

    /// `x`, `y`, `z`, `roll`, `pitch` and `yaw`, of which the first `needed` must be there, and a `phase` if there is one.
    pub(super) fn pose(&self, needed: usize) -> Checked<SensorPose> {
        let mut values = [0.0; 6];
        for (k, (value, key)) in values.iter_mut().zip(SensorPose::FIELDS).enumerate() {
            *value = if k < needed || self.has(key) { self.number(key)? } else { 0.0 };
        }
        let phase = self.has(PHASE).then(|| self.number(PHASE)).transpose()?;
        Ok(SensorPose { phase, ..SensorPose::from_values(values) })
    }
}

/// A value as a user would write it.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Most elements, texts and comments of a file.
const MAX_NODES: u32 = 1_000_000;

/// Parses a text. Documents with a DTD are refused, since entities of entities grow without bounds.
pub(super) fn parse<'a>(text: &'a str, file: &str) -> Checked<Document<'a>> {
    let fault = |problem: String| refused!("{file}: is no XML: {problem}");
    check_xml(text).map_err(fault)?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| fault(error.to_string()))
}

/// Place of an element, by its tag and name; a line would take a walk through the text.
pub(super) fn place(node: Node, file: &str) -> Location {
    let name = node.attribute("name").map(|name| format!(" `{name}`")).unwrap_or_default();
    Location::top(file).key(&format!("<{}>{name}", node.tag_name().name()))
}

/// Refuses an attribute of the element at `at` that is none of `known`; those with a prefix are passed over.
pub(super) fn refuse_attributes(
    node: Node,
    at: &Location,
    known: &[&str],
    wanted: &'static str,
) -> Checked<()> {
    let is_odd = |odd: &roxmltree::Attribute| {
        odd.namespace().is_none() && has_no_prefix(odd.name()) && !known.contains(&odd.name())
    };
    let odd = node.attributes().find(is_odd);
    odd.map_or(Ok(()), |odd| Err(wrong(&at.key(odd.name()), odd.value(), wanted)))
}

pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// The text of an element, around its comments.
pub(super) fn text(node: Node) -> String {
    node.children().filter(Node::is_text).filter_map(|part| part.text()).collect()
}

/// An attribute that must be there.
pub(super) fn attribute<'a>(node: Node<'a, '_>, key: &str, at: &Location) -> Checked<&'a str> {
    node.attribute(key).ok_or_else(|| missing(at, key))
}

/// `N` numbers with spaces between them.
pub(super) fn numbers_of_text<const N: usize>(
    text: &str,
    at: &Location,
    wanted: &'static str,
) -> Checked<[f64; N]> {
    let mut values = [0.0; N];
    let mut words = text.split_whitespace();
    for value in &mut values {
        let word = words.next().ok_or_else(|| wrong(at, text.trim(), wanted))?;
        *value = number(at, word)?;
    }
    match words.next() {
        None => Ok(values),
        Some(_) => Err(wrong(at, text.trim(), wanted)),
    }
}

/// Six numbers of a `<pose>` in radians; none stand for the pose that changes nothing.
pub(super) fn pose_of_text(text: &str, at: &Location) -> Checked<SensorPose> {
    if text.trim().is_empty() {
        return Ok(IDENTITY);
    }
    numbers_of_text(text, at, "six numbers: x y z roll pitch yaw").map(SensorPose::from_values)
}

/// A text for attributes and elements.
pub(super) fn escape(text: &str) -> String {
    let signs = [("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ("\"", "&quot;"), ("'", "&apos;")];
    signs.into_iter().fold(text.to_owned(), |text, (sign, name)| text.replace(sign, name))
}
