//! YAML descriptions as JSON values, with limits, units and the line of each value.

use saphyr_parser::{Event, Marker, Parser, ScalarStyle, Span};
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

use super::numbers::{Quantity, shown};
use super::objects::Objects;
use super::{DescriptionError, Location, check, numbers, plain_words};

/// Most bytes of a YAML file; vendors' files have 40 000.
const MAX_YAML: usize = 1 << 20;
/// Deepest lists and objects in each other.
const MAX_DEPTH: usize = 64;
/// Bytes that aliases may repeat, for each byte of the file and beside them.
const REPEATS: (usize, usize) = (4, 1 << 16);
/// Bytes that a repeated value counts beside its text.
const NODE: usize = 16;

/// Quantity under a key, by the key of the object that holds it and the key itself.
type Quantities = fn(&str, &str) -> Option<Quantity>;

/// A YAML document as JSON: numbers that are not finite stay texts, as do keys that are none.
#[derive(Debug)]
pub struct YamlDocument {
    /// The whole document.
    pub value: Value,
    file: String,
    /// Line and column of every value, each before those inside it.
    marks: Vec<(u32, u32)>,
}

impl YamlDocument {
    /// The document as a `T`, or the key that does not fit, with its line.
    pub fn read<T: DeserializeOwned>(&self) -> Result<T, DescriptionError> {
        serde_path_to_error::deserialize(Objects(&self.value)).map_err(|error| {
            let path = error.path().to_string();
            let path = if path == "." { String::new() } else { path };
            let (line, column) = self.line_of(&path);
            let at = Box::new(Location { file: self.file.clone(), path });
            let problem = plain_words(&error.into_inner().to_string());
            DescriptionError::Json { at, problem, line, column }
        })
    }

    /// Line and column, from 1, of the value at a path, or of the deepest one on the way to it.
    pub fn line_of(&self, path: &str) -> (usize, usize) {
        let (mut value, mut rest, mut mark) = (&self.value, path, 0);
        while let Some((child, behind, skipped)) = step(value, rest) {
            (value, rest, mark) = (child, behind, mark + 1 + skipped);
        }
        let (line, column) = self.marks.get(mark).copied().unwrap_or((1, 1));
        (line as usize, column as usize)
    }
}

/// The child that a path leads to, the rest of the path, and the number of values before that child.
fn step<'a, 'p>(value: &'a Value, path: &'p str) -> Option<(&'a Value, &'p str, usize)> {
    let behind = |name: &str| {
        let rest = path.strip_prefix(name)?;
        let ends = rest.is_empty() || rest.starts_with(['.', '[']);
        ends.then(|| rest.strip_prefix('.').unwrap_or(rest))
    };
    let mut skipped = 0;
    let mut look = |child: &'a Value, name: &str| {
        let found = behind(name).map(|rest| (child, rest, skipped));
        skipped += if found.is_none() { values_in(child) } else { 0 };
        found
    };
    match value {
        Value::Array(list) => {
            list.iter().enumerate().find_map(|(i, child)| look(child, &format!("[{i}]")))
        }
        Value::Object(map) => map.iter().find_map(|(key, child)| look(child, key)),
        _ => None,
    }
}

/// Number of values in a value, itself among them.
fn values_in(value: &Value) -> usize {
    1 + match value {
        Value::Array(list) => list.iter().map(values_in).sum(),
        Value::Object(map) => map.values().map(values_in).sum(),
        _ => 0,
    }
}

/// Reads a text of one document.
///
/// # Errors
/// No YAML, a second document, or a limit.
pub fn parse_yaml(
    text: &str,
    file: &str,
    quantities: Quantities,
) -> Result<YamlDocument, DescriptionError> {
    let mut documents = parse_documents(text, file, quantities)?.into_iter();
    let empty = || YamlDocument { value: Value::Null, file: file.to_owned(), marks: Vec::new() };
    let first = documents.next().unwrap_or_else(empty);
    match documents.next() {
        None => Ok(first),
        Some(second) => {
            let (line, column) = second.line_of("");
            let problem = "a second document begins behind `---`; keep one".to_owned();
            let at = Box::new(Location::top(file));
            Err(DescriptionError::Json { at, problem, line, column })
        }
    }
}

/// Reads every document of a text that is not empty.
///
/// # Errors
/// No YAML, or a limit.
pub fn parse_documents(
    text: &str,
    file: &str,
    quantities: Quantities,
) -> Result<Vec<YamlDocument>, DescriptionError> {
    if text.len() > MAX_YAML {
        let (at, count, limit) = (Location::top(file), text.len() as u64, MAX_YAML as u64);
        let mend = "split or simplify the file";
        return Err(check::too_many(&at, "bytes of YAML", count, limit, mend));
    }
    let (parts, anchors) = parts(text).map_err(|fault| fault.in_file(file))?;
    let budget = REPEATS.0 * text.len() + REPEATS.1;
    let mut tree =
        YamlBuilder { parts: &parts, anchors: &anchors, quantities, budget, marks: Vec::new() };
    let (mut documents, mut next) = (Vec::new(), 0);
    while next < parts.len() {
        let read = tree.value(&mut next, &Spot { parent: "", key: "", depth: 0, repeats: false });
        let value = read.map_err(|fault| fault.in_file(file))?;
        let marks = std::mem::take(&mut tree.marks);
        if !value.is_null() {
            documents.push(YamlDocument { value, file: file.to_owned(), marks });
        }
    }
    Ok(documents)
}

#[derive(Debug)]
struct YamlFault {
    problem: String,
    mark: (u32, u32),
}

type Read<T> = Result<T, YamlFault>;

impl YamlFault {
    fn in_file(self, file: &str) -> DescriptionError {
        let (at, problem) = (Box::new(Location::top(file)), self.problem);
        let (line, column) = (self.mark.0 as usize, self.mark.1 as usize);
        DescriptionError::Json { at, problem, line, column }
    }
}

/// A part of the text: a scalar, an alias, or an end of a list or object.
struct YamlEvent<'a> {
    event: Event<'a>,
    mark: (u32, u32),
}

/// Line and column from 1; the parser counts columns from 0.
fn mark(at: Marker) -> (u32, u32) {
    (at.line() as u32, at.col() as u32 + 1)
}

/// All parts of a text, and the part that each anchor stands before.
fn parts(text: &str) -> Read<(Vec<YamlEvent<'_>>, Vec<usize>)> {
    let (mut parts, mut anchors, mut depth) = (Vec::new(), Vec::new(), 0);
    for event in Parser::new_from_str(text) {
        let (event, Span { start, .. }) = event.map_err(|error| YamlFault {
            problem: format!("is no YAML: {}", error.info()),
            mark: mark(*error.marker()),
        })?;
        let (anchor, deeper) = match &event {
            Event::Scalar(_, _, anchor, _) => (*anchor, 0),
            Event::SequenceStart(anchor, _) | Event::MappingStart(anchor, _) => (*anchor, 1),
            Event::SequenceEnd | Event::MappingEnd => (0, -1),
            Event::Alias(_) => (0, 0),
            _ => continue,
        };
        depth += deeper;
        if depth > MAX_DEPTH as isize {
            return Err(too_deep(mark(start)));
        }
        // The parser counts anchors from 1.
        if anchor > 0 {
            anchors.resize(anchors.len().max(anchor), parts.len());
            anchors[anchor - 1] = parts.len();
        }
        parts.push(YamlEvent { event, mark: mark(start) });
    }
    Ok((parts, anchors))
}

fn too_deep(mark: (u32, u32)) -> YamlFault {
    let problem = format!(
        "lists and objects are more than {MAX_DEPTH} deep in each other; simplify the file"
    );
    YamlFault { problem, mark }
}

#[derive(Clone, Copy)]
struct Spot<'a> {
    /// Key of the object that holds `key`.
    parent: &'a str,
    key: &'a str,
    depth: usize,
    repeats: bool,
}

/// From parts to values.
struct YamlBuilder<'a> {
    parts: &'a [YamlEvent<'a>],
    anchors: &'a [usize],
    quantities: Quantities,
    /// Bytes that aliases may still repeat.
    budget: usize,
    marks: Vec<(u32, u32)>,
}

impl YamlBuilder<'_> {
    /// The value that begins at the part `next`, which moves behind it.
    fn value(&mut self, next: &mut usize, spot: &Spot) -> Read<Value> {
        let parts = self.parts;
        let Some(YamlEvent { event, mark }) = parts.get(*next) else { return Ok(Value::Null) };
        *next += 1;
        let fault = |problem| YamlFault { problem, mark: *mark };
        let deeper = Spot { depth: spot.depth + 1, ..*spot };
        if deeper.depth > MAX_DEPTH + 1 {
            return Err(too_deep(*mark));
        }
        let tag = |tag: &Option<std::borrow::Cow<saphyr_parser::Tag>>| {
            tag.as_ref().map(|tag| format!("{}{}", tag.handle, tag.suffix))
        };
        let check = |its_tag, kind| {
            tag(its_tag).map_or(Ok(()), |tag| numbers::check_collection(&tag, kind))
        };
        match event {
            Event::Alias(anchor) => self.repeated(*anchor, &deeper, *mark),
            Event::Scalar(text, style, _, its_tag) => {
                self.take(spot, text.len(), *mark)?;
                self.marks.push(*mark);
                let quantity = (self.quantities)(spot.parent, spot.key);
                let is_plain = *style == ScalarStyle::Plain;
                numbers::value(text, is_plain, tag(its_tag).as_deref(), quantity).map_err(fault)
            }
            Event::SequenceStart(_, its_tag) => {
                check(its_tag, "seq").map_err(fault)?;
                self.take(spot, 0, *mark)?;
                self.marks.push(*mark);
                let mut list = Vec::new();
                while parts.get(*next).is_some_and(|part| part.event != Event::SequenceEnd) {
                    list.push(self.value(next, &deeper)?);
                }
                *next += 1;
                Ok(Value::Array(list))
            }
            Event::MappingStart(_, its_tag) => {
                check(its_tag, "map").map_err(fault)?;
                self.take(spot, 0, *mark)?;
                self.marks.push(*mark);
                let mut map = Map::new();
                while parts.get(*next).is_some_and(|part| part.event != Event::MappingEnd) {
                    self.entry(next, &deeper, &mut map)?;
                }
                *next += 1;
                Ok(Value::Object(map))
            }
            // Ends are taken with their beginnings.
            _ => Ok(Value::Null),
        }
    }

    fn entry(&mut self, next: &mut usize, spot: &Spot, map: &mut Map<String, Value>) -> Read<()> {
        let parts = self.parts;
        let Some(part) = parts.get(*next) else { return Ok(()) };
        *next += 1;
        let fault = |problem| Err(YamlFault { problem, mark: part.mark });
        let named = match &part.event {
            Event::Alias(anchor) => {
                self.anchors.get(*anchor - 1).map(|&at| (&parts[at].event, true))
            }
            event => Some((event, false)),
        };
        let Some((Event::Scalar(key, _, _, None), repeats)) = named else {
            return fault("a key is no plain text; lists, objects and tags are none".to_owned());
        };
        self.take(&Spot { repeats: repeats || spot.repeats, ..*spot }, key.len(), part.mark)?;
        if key == "<<" {
            return fault(
                "the key `<<` merges objects, which is not done here; write the keys out"
                    .to_owned(),
            );
        }
        if map.contains_key(key.as_ref()) {
            return fault(format!("duplicate key {}; keep one of the two", shown(key)));
        }
        let inside = Spot { parent: spot.key, key, ..*spot };
        let value = self.value(next, &inside)?;
        map.insert(key.clone().into_owned(), value);
        Ok(())
    }

    fn repeated(&mut self, anchor: usize, spot: &Spot, mark: (u32, u32)) -> Read<Value> {
        let Some(mut at) = anchor.checked_sub(1).and_then(|k| self.anchors.get(k)).copied() else {
            return Err(YamlFault { problem: "an alias names no anchor".to_owned(), mark });
        };
        self.value(&mut at, &Spot { repeats: true, ..*spot })
    }

    /// Takes a repeated value from the budget.
    fn take(&mut self, spot: &Spot, bytes: usize, mark: (u32, u32)) -> Read<()> {
        if !spot.repeats {
            return Ok(());
        }
        let left = self.budget.checked_sub(bytes + NODE);
        self.budget = left.ok_or_else(|| YamlFault {
            problem: format!(
                "aliases repeat more than {} times the bytes of the file; write less of them",
                REPEATS.0
            ),
            mark,
        })?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use serde::Deserialize;
    use serde_json::json;

    use super::*;

    #[derive(Debug, Deserialize)]
    struct File {
        lasers: Vec<Laser>,
    }

    #[derive(Debug, Deserialize)]
    struct Laser {
        angle: f64,
    }

    fn quantity(parent: &str, key: &str) -> Option<Quantity> {
        match (parent, key) {
            (_, "angle") => Some(Quantity::Angle),
            ("bare", "x") => Some(Quantity::Bare),
            (_, "x") => Some(Quantity::Length),
            _ => None,
        }
    }

    fn read(text: &str) -> Result<File, DescriptionError> {
        parse_yaml(text, "f", quantity)?.read()
    }

    fn value(text: &str) -> Result<Value, String> {
        parse_yaml(text, "f", quantity).map(|d| d.value).map_err(|error| error.to_string())
    }

    #[test]
    fn flow_and_block_are_read_and_errors_say_where() {
        let block = read("lasers:\n- angle: 1\n- {angle: -2.5}\n").unwrap();
        assert_eq!((block.lasers[0].angle, block.lasers[1].angle), (1.0, -2.5));
        let error = read("lasers:\n- angle: 1\n- angle: up\n").unwrap_err();
        assert_eq!(
            error.to_string(),
            "f: lasers[1].angle: string \"up\" stands where a number belongs (line 3, column 10)"
        );
        let document = parse_yaml("a: [[1, 2], {b: 3}]\nc:\n  d: 4\n", "f", quantity).unwrap();
        let lines =
            ["a", "a[0][1]", "a[1].b", "c.d", "c.e", "z"].map(|path| document.line_of(path));
        assert_eq!(lines, [(1, 4), (1, 9), (1, 17), (3, 6), (3, 3), (1, 1)]);
    }

    #[test]
    fn json_is_yaml() {
        let text = "{\n\t\"a\": [1, -2.5e-3, true, null],\n\t\"b\\u0041\": {\"c\": \"1\"}\n}\n";
        assert_eq!(value(text), Ok(json!({"a": [1, -2.5e-3, true, null], "bA": {"c": "1"}})));
    }

    #[test]
    fn units_follow_aliases_to_keys_of_another_quantity() {
        let turned = "a: &a !degrees 180\nb: {angle: *a}\n";
        assert_eq!(value(turned).unwrap()["b"]["angle"], json!(std::f64::consts::PI));
        let error = value("a: &a !degrees 180\nb:\n  x: *a\n").unwrap_err();
        assert_holds!(error, "`!degrees` is the unit of an angle", "line 1");
        assert!(value("bare: {x: !inches 1}").unwrap_err().contains("without a unit"));
        assert!(value("a: !inches [1]").unwrap_err().contains("before each number"));
        assert!(value("a: !turns [1]").unwrap_err().contains("`!turns` is not known"));
    }

    #[test]
    fn what_readers_differ_in_is_an_error_with_its_line() {
        let cases = [
            ("a: 1\nb: 2\na: 3\n", "duplicate key `a`", "(line 3, column 1)"),
            ("a: &m {x: 1}\nb:\n  <<: *m\n", "`<<`", "(line 3, column 3)"),
            ("[a]: 1", "a key is no plain text", "line 1"),
            ("a: 1\n---\nb: 2\n", "a second document", "(line 3, column 1)"),
            ("a: *b", "anchor", "line 1"),
            ("a: &a [*a]", "deep", "line 1"),
            ("a: [1", "is no YAML", "line"),
        ];
        for (text, problem, place) in cases {
            let error = value(text).unwrap_err();
            assert!(error.starts_with("f: "), "{error}");
            assert!(error.contains(problem) && error.contains(place), "{text}: {error}");
        }
        assert_eq!(value("---\na: 1\n---\n").unwrap(), json!({"a": 1}));
        assert_eq!(value("").unwrap(), Value::Null);
    }

    /// Aliases are counted by the bytes that they repeat.
    #[test]
    fn aliases_repeat_no_more_than_the_file_is_large() {
        let long = "x".repeat(300_000);
        let many = |alias: &str, count| format!("a: &a {long}\nl:\n{}", alias.repeat(count));
        assert!(value(&many("- *a\n", 3)).is_ok());
        assert!(value(&many("- *a\n", 100)).unwrap_err().contains("aliases repeat"));
        assert!(value(&many("- {*a : 1}\n", 100)).unwrap_err().contains("aliases repeat"));
    }

    /// Without the limits these take minutes.
    #[test]
    fn hostile_text_ends_soon() {
        let bomb: String = (1..40).fold("a0: &a0 [x]\n".to_owned(), |text, k| {
            format!("{text}a{k}: &a{k} [{}]\n", vec![format!("*a{}", k - 1); 20].join(","))
        });
        let many = |unit: &str| unit.repeat(MAX_YAML / unit.len());
        let texts =
            ["[", "{a: ", "- ", "? ", "&a ", "!a ", "[],", "{}\n", "a\n", "\"", "'", "%a\n", "|"];
        let begin = Instant::now();
        for text in texts.map(many).into_iter().chain([bomb]) {
            read(&text).unwrap_err();
            let _ = read(&format!("lasers: []\nmore:\n  {text}"));
            let _ = read(&format!("lasers: []\nmore: [{text}"));
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    }
}
