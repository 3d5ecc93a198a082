//! XML of robots, models and launch files: parsing with places, numbers in attributes, escapes.

use roxmltree::{Document, Node, ParsingOptions};

use super::RigError;
use super::angles::IDENTITY;
use super::fields::{number, wrong};
use sightline_files::json::{Place, check_xml};
use sightline_scene::vehicle::SensorPose;

/// Most elements, texts and comments of a file.
const MAX_NODES: u32 = 1_000_000;

/// Parses a text. Documents with a DTD are refused, since entities of entities grow without bounds.
pub(super) fn parse<'a>(text: &'a str, file: &str) -> Result<Document<'a>, RigError> {
    let fault = |problem| RigError::Syntax { at: Box::new(Place::top(file)), what: "XML", problem };
    check_xml(text).map_err(fault)?;
    let options = ParsingOptions { nodes_limit: MAX_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| fault(error.to_string()))
}

/// Place of an element, by its tag and name; a line would take a walk through the text.
pub(super) fn place(node: Node, file: &str) -> Place {
    let name = node.attribute("name").map(|name| format!(" `{name}`")).unwrap_or_default();
    Place::top(file).key(&format!("<{}>{name}", node.tag_name().name()))
}

/// First child element of a name.
pub(super) fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    node.children().find(|child| child.has_tag_name(name))
}

/// An attribute that must be there.
pub(super) fn attribute<'a>(
    node: Node<'a, '_>,
    key: &str,
    at: &Place,
) -> Result<&'a str, RigError> {
    let missing = || RigError::Missing { at: Box::new(at.clone()), key: key.to_owned() };
    node.attribute(key).ok_or_else(missing)
}

/// `N` numbers with spaces between them.
pub(super) fn numbers<const N: usize>(
    text: &str,
    at: &Place,
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
pub(super) fn six(text: &str, at: &Place) -> Result<SensorPose, RigError> {
    if text.trim().is_empty() {
        return Ok(IDENTITY);
    }
    numbers(text, at, "six numbers: x y z roll pitch yaw").map(SensorPose::from_values)
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
