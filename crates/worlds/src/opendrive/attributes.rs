//! Attributes of an OpenDRIVE document that are not read: in other capitals, misspelt, or of nobody's.

use std::collections::BTreeMap;

use roxmltree::{Document, Node};
use sightline_files::Note;
use sightline_files::json::{counted, nearest};

use super::document::{NUMBERS, shown};
use super::values::WORDS;

/// Attributes of OpenDRIVE 1.4 to 1.9 that are neither numbers nor words of a list, by element. Other attributes of these
/// elements are told.
const OTHERS: &[(&str, &[&str])] = &[
    ("road", &["name", "id", "junction", "rule"]),
    ("geometry", &[]),
    ("spiral", &[]),
    ("arc", &[]),
    ("poly3", &[]),
    ("paramPoly3", &[]),
    ("elevation", &[]),
    ("superelevation", &[]),
    ("crossfall", &[]),
    ("shape", &[]),
    ("laneOffset", &[]),
    ("laneSection", &[]),
    (
        "lane",
        &["type", "direction", "dynamicLaneDirection", "dynamicLaneType", "roadWorks", "advisory"],
    ),
    ("width", &[]),
    ("border", &["width", "type", "outlineId", "useCompleteOutline"]),
    ("height", &[]),
    ("roadMark", &["type", "weight", "color", "material", "laneChange"]),
    ("object", &["id", "name", "type", "subtype", "dynamic", "orientation", "temporary"]),
    ("repeat", &[]),
    ("outline", &["id", "fillType", "laneType"]),
    ("cornerRoad", &["id"]),
    ("cornerLocal", &["id"]),
    (
        "signal",
        &[
            "id", "name", "type", "subtype", "country", "countryRevision", "value", "unit", "text",
            "temporary",
        ],
    ),
];

/// Attributes of an element whose values are looked at.
fn read(element: &str) -> Vec<&'static str> {
    let of_numbers = NUMBERS.iter().filter(|(name, ..)| *name == element);
    let of_words = WORDS.iter().filter(|(name, ..)| *name == element);
    let numbers = of_numbers.flat_map(|(_, must, may)| must.iter().chain(*may).copied());
    numbers.chain(of_words.map(|(_, attribute, _)| *attribute)).collect()
}

/// The first attribute of an element that OpenDRIVE does not know.
fn unknown<'a>(node: Node<'a, '_>) -> Option<&'a str> {
    let element = node.tag_name().name();
    let (_, others) = OTHERS.iter().find(|(name, _)| *name == element)?;
    let read = read(element);
    let own = node.attributes().filter(|attribute| attribute.namespace().is_none());
    let is_known = |name: &&str| read.contains(name) || others.contains(name);
    own.map(|attribute| attribute.name()).find(|name| !is_known(name))
}

/// Doubt about an attribute in other capitals than OpenDRIVE has, or nearly of its name: its value is lost.
pub(super) fn miswritten(node: Node<'_, '_>) -> Option<String> {
    let element = node.tag_name().name();
    let absent = || read(element).into_iter().filter(|known| node.attribute(*known).is_none());
    let meant = |odd: &str| absent().find(|known| known.eq_ignore_ascii_case(odd));
    let capitals =
        node.attributes().find_map(|odd| Some((odd.name(), meant(odd.name())?.to_owned())));
    let near = || unknown(node).and_then(|odd| Some((odd, nearest(odd, absent())?)));
    let (odd, right) = capitals.or_else(near)?;
    let line = node.document().text_pos_at(node.range().start).row;
    Some(format!(
        "line {line}: `{}` of the <{element}> is not read; OpenDRIVE calls it `{right}`",
        shown(odd)
    ))
}

/// Most attributes that the note names.
const NAMED: usize = 6;

/// A note of attributes that OpenDRIVE does not know, each with the number of its places.
pub(super) fn unknown_ones(xml: &Document<'_>, file: &str) -> Option<Note> {
    let mut counts: BTreeMap<(&str, &str), usize> = BTreeMap::new();
    for node in xml.descendants().filter(Node::is_element) {
        if let Some(odd) = unknown(node) {
            *counts.entry((node.tag_name().name(), odd)).or_default() += 1;
        }
    }
    let told = |((element, odd), count): (&(&str, &str), &usize)| {
        format!("`{}` of <{element}> {}", shown(odd), counted(*count, "time"))
    };
    let list: Vec<String> = counts.iter().take(NAMED).map(told).collect();
    (!list.is_empty()).then(|| {
        Note::fact(format!("{file}: unknown attributes are not read: {}", list.join(", ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(element: &str) -> [String; 2] {
        let text = format!(
            "<OpenDRIVE xmlns:v='urn:v'><road id='7' length='9'>{element}</road></OpenDRIVE>"
        );
        let xml = Document::parse(&text).unwrap();
        let doubt = xml.descendants().filter(Node::is_element).find_map(miswritten);
        let note = unknown_ones(&xml, "m").map(|note| note.text().to_owned());
        [doubt, note].map(Option::unwrap_or_default)
    }

    #[test]
    fn attributes_that_nobody_reads_are_told() {
        let object = "<object id='3' name='x' s='1' t='2' temporary='no' v:paint='red'/>";
        assert_eq!(told(object), ["", ""]);
        for (element, right) in [
            (
                "<object id='3' s='1' t='2' zoffset='1'/>",
                "`zoffset` of the <object> is not read; OpenDRIVE calls it `zOffset`",
            ),
            (
                "<object id='3' s='1' t='2' heigth='1'/>",
                "`heigth` of the <object> is not read; OpenDRIVE calls it `height`",
            ),
            (
                "<repeat s='1' length='2' distance='3' heightStarts='4'/>",
                "OpenDRIVE calls it `heightStart`",
            ),
        ] {
            assert_holds!(told(element)[0], right);
        }
        // No name of OpenDRIVE is near.
        let [doubt, note] = told(&"<lane id='1' paint='red'/>".repeat(2));
        assert_eq!(doubt, "");
        assert_eq!(note, "m: unknown attributes are not read: `paint` of <lane> 2 times");
    }
}
