//! Values of a description by their keys and of XML elements by their tags, with the place of whatever is wrong.

use roxmltree::{Document, Node, ParsingOptions};
use serde_json::{Map, Value};

use super::RigError;
use super::frames::IDENTITY;
use sightline_files::json::{Location, check_xml, nearest, written};
use sightline_scene::vehicle::SensorPose;

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
pub(super) fn wrong(at: &Location, value: impl ToString, wanted: &'static str) -> RigError {
    let mut value = value.to_string();
    if value.chars().count() > MOST_SHOWN {
        value = value.chars().take(MOST_SHOWN).chain(['…']).collect();
    }
    RigError::Value { at: Box::new(at.clone()), value: format!("`{value}`"), wanted }
}

/// A finite number of a text.
pub(super) fn number(at: &Location, text: &str) -> Result<f64, RigError> {
    let number = text.parse().ok().filter(|v: &f64| v.is_finite());
    number.ok_or_else(|| wrong(at, text, "a finite number"))
}

/// An object and its place.
#[derive(Clone)]
pub(super) struct Fields<'a> {
    map: &'a Map<String, Value>,
    pub(super) at: Location,
}

impl<'a> Fields<'a> {
    pub(super) fn of(value: &'a Value, at: Location) -> Result<Self, RigError> {
        match value.as_object() {
            Some(map) => Ok(Self { map, at }),
            None => Err(wrong(&at, value, "an object of keys and values")),
        }
    }

    /// Refuses keys that are neither read nor passed over.
    pub(super) fn refuse_others(&self, read: &[&str], passed: &[&str]) -> Result<(), RigError> {
        let is_known = |key: &&String| read.iter().chain(passed).any(|known| known == key);
        let Some(key) = self.map.keys().find(|key| !is_known(key)) else { return Ok(()) };
        Err(RigError::UnknownKey {
            at: Box::new(self.at.clone()),
            // A key that is there already was not meant.
            nearest: nearest(key, read.iter().copied().filter(|key| !self.has(key))),
            key: key.chars().take(MOST_SHOWN).collect(),
            known: read.iter().map(|&key| key.to_owned()).collect(),
        })
    }

    pub(super) fn has(&self, key: &str) -> bool {
        self.map.contains_key(key)
    }

    /// The value of a key that must be there.
    pub(super) fn value(&self, key: &str) -> Result<&'a Value, RigError> {
        self.map
            .get(key)
            .ok_or_else(|| RigError::Missing { at: Box::new(self.at.clone()), key: key.to_owned() })
    }

    /// The object under a key.
    pub(super) fn inner(&self, key: &str) -> Result<Self, RigError> {
        Self::of(self.value(key)?, self.at.key(key))
    }

    /// Each key with its value and place.
    pub(super) fn each(&self) -> impl Iterator<Item = (&'a String, &'a Value, Location)> {
        self.map.iter().map(|(key, value)| (key, value, self.at.key(key)))
    }

    /// The number under a key; a text that is one counts, as attributes of CARLA are texts.
    pub(super) fn number(&self, key: &str) -> Result<f64, RigError> {
        let value = self.value(key)?;
        let of_text = || value.as_str()?.trim().parse().ok();
        let number = value.as_f64().or_else(of_text).filter(|v| v.is_finite());
        number.ok_or_else(|| wrong(&self.at.key(key), plain(value), "a finite number"))
    }

    /// The number, or another one where there is none.
    fn number_or(&self, key: &str, other: f64) -> Result<f64, RigError> {
        if self.has(key) { self.number(key) } else { Ok(other) }
    }

    pub(super) fn text(&self, key: &str) -> Result<&'a str, RigError> {
        let value = self.value(key)?;
        value.as_str().ok_or_else(|| wrong(&self.at.key(key), plain(value), "a text"))
    }

    /// `x`, `y`, `z`, `roll`, `pitch` and `yaw`, all of them, and a `phase` if there is one.
    pub(super) fn six(&self) -> Result<SensorPose, RigError> {
        let mut values = [0.0; 6];
        for (value, key) in values.iter_mut().zip(SensorPose::FIELDS) {
            *value = self.number(key)?;
        }
        Ok(SensorPose { phase: self.phase()?, ..SensorPose::from_values(values) })
    }

    /// Like [`Self::six`]; angles that are missing are 0.
    pub(super) fn six_or_level(&self) -> Result<SensorPose, RigError> {
        let mut values = [0.0; 6];
        for (k, (value, key)) in values.iter_mut().zip(SensorPose::FIELDS).enumerate() {
            *value = if k < 3 { self.number(key)? } else { self.number_or(key, 0.0)? };
        }
        Ok(SensorPose { phase: self.phase()?, ..SensorPose::from_values(values) })
    }

    fn phase(&self) -> Result<Option<f64>, RigError> {
        self.has(PHASE).then(|| self.number(PHASE)).transpose()
    }
}

/// A value as a user would write it.
fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Most elements, texts and comments of a file.
const MAX_NODES: u32 = 1_000_000;

/// Parses a text. Documents with a DTD are refused, since entities of entities grow without bounds.
pub(super) fn parse<'a>(text: &'a str, file: &str) -> Result<Document<'a>, RigError> {
    let fault =
        |problem| RigError::Syntax { at: Box::new(Location::top(file)), what: "XML", problem };
    check_xml(text).map_err(fault)?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| fault(error.to_string()))
}

/// Place of an element, by its tag and name; a line would take a walk through the text.
pub(super) fn place(node: Node, file: &str) -> Location {
    let name = node.attribute("name").map(|name| format!(" `{name}`")).unwrap_or_default();
    Location::top(file).key(&format!("<{}>{name}", node.tag_name().name()))
}

/// First child element of a name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// An attribute that must be there.
pub(super) fn attribute<'a>(
    node: Node<'a, '_>,
    key: &str,
    at: &Location,
) -> Result<&'a str, RigError> {
    let missing = || RigError::Missing { at: Box::new(at.clone()), key: key.to_owned() };
    node.attribute(key).ok_or_else(missing)
}

/// `N` numbers with spaces between them.
pub(super) fn numbers_of_text<const N: usize>(
    text: &str,
    at: &Location,
    wanted: &'static str,
) -> Result<[f64; N], RigError> {
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
pub(super) fn pose_of_text(text: &str, at: &Location) -> Result<SensorPose, RigError> {
    if text.trim().is_empty() {
        return Ok(IDENTITY);
    }
    numbers_of_text(text, at, "six numbers: x y z roll pitch yaw").map(SensorPose::from_values)
}

/// A text for attributes and elements.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&apos;",
            c => escaped.push(c),
        }
    }
    escaped
}
