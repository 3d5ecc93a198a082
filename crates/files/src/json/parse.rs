//! From a file to a description: reading, parsing, and plain words for the messages of serde.
//!
//! The kind of a JSON file is known by its keys, to explain a file given in the wrong place on the command line.

use std::collections::HashMap;
use std::fmt;
use std::io::Read;
use std::path::Path;

use serde::de::{DeserializeOwned, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use super::check::{did_you_mean, refused};
use super::objects::{IS_A_LIST, Objects};
use super::{
    DescriptionError, Location, from_text, is_utf_16, kind_of_bytes, leading_comment, nearest,
    not_json,
};

/// Reads `text` as a `T`, naming `file` in errors. A list is no struct.
pub fn parse<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, DescriptionError> {
    if text.trim_ascii().is_empty() {
        let (at, problem) = (Box::new(Location::top(file)), "the file is empty".to_owned());
        return Err(DescriptionError::Json { at, problem, line: 1, column: 1 });
    }
    let mut json = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(Objects(&mut json)).map_err(|e| {
        let path = e.path().to_string();
        explain(text, file, &path, &e.into_inner())
    })?;
    json.end().map_err(|e| explain(text, file, ".", &e))?;
    Ok(value)
}

/// Words that the error of a repeated key begins with.
const TWICE: &str = "this key comes twice: ";

/// Any JSON of a user's file: a key that comes twice in an object is an error, where `Value` keeps the last one.
#[derive(Debug)]
pub struct UniqueKeys(pub Value);

impl<'de> Deserialize<'de> for UniqueKeys {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(AnyValue).map(Self)
    }
}

struct AnyValue;

/// Methods that keep a value as it is.
macro_rules! scalars {
    ($($method:ident: $kind:ty;)*) => {$(
        fn $method<E>(self, value: $kind) -> Result<Value, E> {
            Ok(value.into())
        }
    )*};
}

impl<'de> Visitor<'de> for AnyValue {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("any value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    scalars! { visit_bool: bool; visit_u64: u64; visit_i64: i64; visit_f64: f64; visit_str: &str; }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(UniqueKeys(value)) = list.next_element()? {
            values.push(value);
        }
        Ok(values.into())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Value, A::Error> {
        let mut map = Map::new();
        while let Some(key) = object.next_key::<String>()? {
            if map.contains_key(&key) {
                return Err(A::Error::custom(format!("{TWICE}`{key}`; leave one out")));
            }
            let UniqueKeys(value) = object.next_value()?;
            map.insert(key, value);
        }
        Ok(map.into())
    }
}

/// End of an error about the version of a file.
const VERSION_1: &str = "this program reads version 1, write `\"sightline\": 1`";

/// Checks the version key, and that the file is none of another kind: a file of a later version is refused for its
/// version, one of another kind for its kind, not for their keys.
pub fn check_version(text: &str, file: &str, wanted: FileKind) -> Result<(), DescriptionError> {
    #[derive(Deserialize)]
    struct Version {
        sightline: Option<Value>,
    }
    refuse_comment(text, file)?;
    if let Some(told) = not_json(text) {
        return Err(DescriptionError::NotJson { file: file.to_owned(), told, wanted });
    }
    refuse_foreign(text, file, &wanted.to_string())?;
    // Values that are passed over have no place; all values have.
    let placed = |error| parse::<serde_json::Value>(text, file).err().unwrap_or(error);
    let version: Version = parse(text, file).map_err(placed)?;
    let top = Location::top(file);
    let other = FileKind::of(text).filter(|kind| *kind != wanted);
    match (version.sightline, other) {
        (Some(v), _) if v != 1 => {
            Err(refused(&top.key("sightline"), format_args!("version {v} is unknown; {VERSION_1}")))
        }
        (_, Some(found)) => Err(other_kind(file, found, &wanted.to_string())),
        (Some(_), None) => Ok(()),
        (None, None) => {
            Err(refused(&top, format_args!("the key `sightline` is missing; {VERSION_1}")))
        }
    }
}

/// Version of a file that may leave it out; 1 is the only one.
///
/// # Errors
/// Any other version.
pub fn version_1<'de, D: Deserializer<'de>>(from: D) -> Result<Option<u64>, D::Error> {
    match u64::deserialize(from)? {
        1 => Ok(Some(1)),
        other => Err(D::Error::custom(format!("version {other} is unknown; {VERSION_1}"))),
    }
}

/// Turns an error of serde into one with place, nearest known key and plain words.
fn explain(text: &str, file: &str, path: &str, error: &serde_json::Error) -> DescriptionError {
    let (line, column) = (error.line(), error.column());
    let full = error.to_string();
    let told = full.rsplit_once(" at line ").map_or(full.as_str(), |(told, _)| told);
    // The path ends in a question mark before the first key is read.
    let path = path.trim_end_matches('?').trim_end_matches('.');
    let place = |path: &str| Box::new(Location { file: file.to_owned(), path: path.to_owned() });
    // serde_json says "trailing characters" after the whole object and after a list that is too long.
    let told = match told {
        "trailing characters" if path.is_empty() => "something follows the end of the object",
        "trailing characters" => "the list is longer than it should be",
        other => other,
    };
    let Some((key, known)) = unknown_key(told) else {
        let problem = comma_too_many(text, error).or_else(|| comment(text, error));
        let problem = problem.unwrap_or_else(|| plain_words(told) + in_brackets(path, told));
        return DescriptionError::Json { at: place(path), problem, line, column };
    };
    // The path of an unknown key ends in the key itself; the message names it anyway.
    let parent = path.strip_suffix(key).map_or(path, |p| p.strip_suffix('.').unwrap_or(p));
    let mend = did_you_mean(&nearest(key, known.iter().map(String::as_str)), &known);
    let problem = format!("unknown key `{key}`{mend}");
    DescriptionError::Json { at: place(parent), problem, line, column }
}

/// Keys of lists of objects.
const LISTS: [&str; 11] = [
    "poses", "static", "actors", "parts", "body", "bodies", "mounts", "require", "keep_out",
    "other_sensors", "lidars",
];

/// Mend of an object in the place of a list of objects; empty for any other fault.
fn in_brackets(path: &str, told: &str) -> &'static str {
    let is_list = LISTS.contains(&path.rsplit('.').next().unwrap_or_default());
    let is_object = told == "invalid type: map, expected a sequence";
    if is_list && is_object { "; write `[{ … }]`" } else { "" }
}

/// Fault of a comma before a closing bracket; `None` for any other error of this text. In values that are skipped serde_json
/// has other words for it.
pub fn comma_too_many(text: &str, error: &serde_json::Error) -> Option<String> {
    let (before, rest) = text.split_at_checked(place_of(text, error)?)?;
    let end = rest.chars().next().filter(|end| "]}".contains(*end))?;
    let has_comma = before.trim_end().ends_with(',');
    has_comma.then(|| format!("the comma before `{end}` is one too many; remove it"))
}

/// Byte of a text at which an error is found.
fn place_of(text: &str, error: &serde_json::Error) -> Option<usize> {
    let lines = text.split_inclusive('\n').take(error.line().checked_sub(1)?);
    Some(lines.map(str::len).sum::<usize>() + error.column().checked_sub(1)?)
}

/// Fault of a comment behind the beginning of the text; `None` for any other error.
fn comment(text: &str, error: &serde_json::Error) -> Option<String> {
    let rest = text.get(place_of(text, error)?..)?;
    let is_comment = rest.starts_with("//") || rest.starts_with("/*");
    is_comment.then(|| "a comment stands here, and JSON has none; remove it".to_owned())
}

/// The key that serde does not know, and those that it knows in its place.
pub fn unknown_key(text: &str) -> Option<(&str, Vec<String>)> {
    // Without known keys serde writes "there are no fields"; no struct here is empty.
    let (key, expected) = text.strip_prefix("unknown field `")?.split_once("`, expected ")?;
    Some((key, expected.split('`').skip(1).step_by(2).map(str::to_owned).collect()))
}

const NO_KEY: &str = "a key in double quotes belongs here; JSON has no comments, and numbers have a point: 1.5, not 1,5";

/// Translates serde's message from Rust types to JSON words: `u64` becomes "a whole number, 0 or more".
pub fn plain_words(text: &str) -> String {
    let whole = match text {
        "expected value" => Some("no value that JSON knows; numbers are finite, as 1.5"),
        "key must be a string" => Some(NO_KEY),
        "number out of range" => Some("a number too large; write a finite one, as 1.5"),
        "trailing characters" => Some("something follows the end of the value; remove it"),
        "invalid escape" => Some("a backslash that JSON does not know; write two, or a slash"),
        "unexpected end of hex escape" | "lone leading surrogate in hex escape" => {
            Some("half of a pair of \\u escapes; write both, or the sign itself")
        }
        "recursion limit exceeded" => {
            Some("more than 128 lists and objects in each other; flatten them")
        }
        other if other.starts_with("control character") => {
            Some("a line break or a tab in a text in quotes; write \\n or \\t")
        }
        own if own.starts_with(IS_A_LIST) || own.starts_with(TWICE) => Some(own),
        _ => None,
    };
    if let Some(whole) = whole {
        return whole.to_owned();
    }
    let (head, expected) = text.split_once(", expected ").unwrap_or((text, ""));
    let head = head
        .replace("EOF while parsing", "the file ends inside of")
        .replace("invalid type: ", "")
        .replace("invalid value: ", "")
        .replace("invalid length ", "a list of length ")
        .replace("floating point", "the fraction")
        .replace("integer `", "the number `")
        .replace("missing field", "missing key")
        .replace("duplicate field", "this key comes twice:")
        .replace("sequence", "a list")
        .replace("map", "an object");
    if expected.is_empty() {
        return head;
    }
    let expected = match expected {
        "u64" | "u32" => "a whole number, 0 or more".to_owned(),
        "f64" => "a number".to_owned(),
        "a sequence" => "a list".to_owned(),
        "a map" => "an object".to_owned(),
        "a string" => "a text in quotes".to_owned(),
        other if other.starts_with("struct ") => "an object".to_owned(),
        other => other.replace("an array of length", "a list of length"),
    };
    format!("{head} stands where {expected} belongs")
}

/// Reads a whole file; refuses folders, devices and files larger than `limit` bytes.
pub fn read_limited(file: &Path, limit: u64) -> Result<Vec<u8>, DescriptionError> {
    crate::files::read(file, limit).map_err(|source| match source.kind() {
        std::io::ErrorKind::FileTooLarge => too_large(file, limit),
        _ => DescriptionError::Read { file: file.to_owned(), source },
    })
}

fn too_large(file: &Path, limit: u64) -> DescriptionError {
    let told = format_args!("is larger than the limit of {limit} bytes; split or simplify it");
    refused(&Location::top(&file.display().to_string()), told)
}

/// Line and column, both from 1, of the place behind a text.
fn line_and_column(before: &str) -> (usize, usize) {
    let last = before.rsplit('\n').next().unwrap_or_default();
    (1 + before.matches('\n').count(), 1 + last.chars().count())
}

/// Reads a whole text without its byte order mark.
///
/// # Errors
/// Like [`read_limited`], and a text that is no UTF-8.
pub fn read_text(file: &Path, limit: u64) -> Result<String, DescriptionError> {
    decoded(read_limited(file, limit)?, file)
}

/// Like [`read_text`], from a stream that errors call `name`, as `standard input`.
pub fn stream_text(stream: impl Read, name: &str, limit: u64) -> Result<String, DescriptionError> {
    let (file, mut bytes) = (Path::new(name), Vec::new());
    let read = stream.take(limit + 1).read_to_end(&mut bytes);
    read.map_err(|source| DescriptionError::Read { file: file.to_owned(), source })?;
    if bytes.len() as u64 > limit {
        return Err(too_large(file, limit));
    }
    decoded(bytes, file)
}

/// The text of a file's bytes, without a byte order mark.
fn decoded(bytes: Vec<u8>, file: &Path) -> Result<String, DescriptionError> {
    let at = Location::top(&file.display().to_string());
    if is_utf_16(&bytes) {
        return Err(refused(&at, "is UTF-16 text; save it as UTF-8"));
    }
    let text = String::from_utf8(bytes).map_err(|error| {
        let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
        let (line, column) = line_and_column(&String::from_utf8_lossy(before));
        let other = kind_of_bytes(error.as_bytes(), file);
        let other = other.map(|kind| format!("is no text, it looks like {kind}; give a text file"));
        // Latin-1, for example.
        let problem = other.unwrap_or_else(|| "is not UTF-8 text; save it as UTF-8".to_owned());
        DescriptionError::Json { at: Box::new(at), problem, line, column }
    })?;
    Ok(text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text))
}

/// Error for a file with the keys of another kind.
fn other_kind(file: &str, found: FileKind, wanted: &str) -> DescriptionError {
    DescriptionError::OtherKind { file: file.to_owned(), found, wanted: wanted.to_owned() }
}

/// Refuses a text of JSON that begins with a comment.
///
/// # Errors
/// Such a comment, with its line.
pub fn refuse_comment(text: &str, file: &str) -> Result<(), DescriptionError> {
    leading_comment(text).map_or(Ok(()), |line| {
        let told = format_args!("line {line} is a comment, and JSON has no comments; remove it");
        Err(refused(&Location::top(file), told))
    })
}

/// Refuses a text that is a [`ForeignJson`], where a thing of another kind is `wanted`.
///
/// # Errors
/// One of these kinds, named with the advice for it.
pub fn refuse_foreign(text: &str, file: &str, wanted: &str) -> Result<(), DescriptionError> {
    ForeignJson::of(text).map_or(Ok(()), |found| {
        let told = format_args!("is {found}, where {wanted} belongs; {}", found.mend());
        Err(refused(&Location::top(file), told))
    })
}

/// Refuses a text that is a scene, a vehicle, placements, a target or a [`ForeignJson`], where a thing of another kind is
/// `wanted`.
///
/// # Errors
/// One of these kinds, named with the option that takes it.
pub fn refuse_own_kinds(text: &str, file: &str, wanted: &str) -> Result<(), DescriptionError> {
    refuse_foreign(text, file, wanted)?;
    FileKind::of(text).map_or(Ok(()), |found| Err(other_kind(file, found, wanted)))
}

/// JSON that is no description of this program, and is given as one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ForeignJson {
    /// The `result.json` of a run or a front; its other keys stand in files of several kinds.
    RunResult,
    /// A glTF mesh in JSON.
    Gltf,
}

impl ForeignJson {
    /// The kind of a text, if it is JSON and its keys tell it.
    pub fn of(text: &str) -> Option<Self> {
        #[derive(Deserialize)]
        struct ForeignKeys {
            settings: Option<IgnoredAny>,
            stopped: Option<IgnoredAny>,
            asset: Option<Value>,
        }
        let ForeignKeys { settings, stopped, asset } = from_text(text).ok()?;
        if settings.is_some() && stopped.is_some() {
            return Some(Self::RunResult);
        }
        // Every glTF file has an asset with its version.
        asset.filter(|asset| asset["version"].is_string()).map(|_| Self::Gltf)
    }

    /// Advice for such a file.
    pub fn mend(self) -> &'static str {
        match self {
            Self::RunResult => {
                "give the folder of the run, or its placements.json, for the placements"
            }
            Self::Gltf => "name it as `file` of a `mesh` in a scene, a vehicle or a target",
        }
    }
}

impl fmt::Display for ForeignJson {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if *self == Self::Gltf { "a glTF mesh" } else { "the result of a run" })
    }
}

/// Kinds of files that a user writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileKind {
    /// A region of interest and its content.
    Scene,
    /// Sensors and mounts.
    Vehicle,
    /// Poses of LiDARs.
    Placements,
    /// A thing of known size.
    Target,
}

impl FileKind {
    /// The kind of a text, if it is JSON and its keys tell it.
    pub fn of(text: &str) -> Option<Self> {
        let keys: HashMap<String, Option<IgnoredAny>> = from_text(text).ok()?;
        let has = |key: &str| keys.get(key).is_some_and(Option::is_some);
        // Keys that only one kind of file has, or that the kinds before it lack. A result has mounts and is no vehicle.
        let kinds = [
            (has("settings") && has("stopped"), None),
            (has("roi"), Some(Self::Scene)),
            (has("mounts") || has("sensors"), Some(Self::Vehicle)),
            (has("placements"), Some(Self::Placements)),
            (has("shapes") && !has("lidar") && !has("mount"), Some(Self::Target)),
        ];
        kinds.into_iter().find_map(|(is_one, kind)| is_one.then_some(kind))?
    }

    /// How such a file is given to the program.
    pub fn place(self) -> &'static str {
        self.words()[1]
    }

    /// The word before `file`, and the place.
    pub(super) fn words(self) -> [&'static str; 2] {
        match self {
            Self::Scene => ["scene", "as SCENE"],
            Self::Vehicle => ["vehicle", "by --vehicle"],
            Self::Placements => {
                ["placements", "behind the scenes, or by --placement, --baselines or --inject"]
            }
            Self::Target => ["target", "by --target"],
        }
    }
}

impl fmt::Display for FileKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = if *self == Self::Placements { "file of " } else { "" };
        write!(f, "a {of}{}", self.words()[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comma_before_a_bracket_is_told_in_values_that_are_read_or_skipped() {
        for (text, end) in [("{\"a\": 1,\n }", '}'), ("{\"a\":\n[1, ]}", ']')] {
            let told = format!("the comma before `{end}` is one too many; remove it (line 2,");
            let read = parse::<Value>(text, "f").unwrap_err().to_string();
            let skipped = parse::<IgnoredAny>(text, "f").unwrap_err().to_string();
            assert!(read.contains(&told) && skipped.contains(&told), "{read}; {skipped}");
        }
    }

    #[test]
    fn slips_inside_of_texts_are_told_with_a_remedy() {
        for (text, told) in [
            (
                r#"{"a": "C:\Users"}"#.to_owned(),
                "a backslash that JSON does not know; write two, or a slash",
            ),
            (r#"{"a": "\ud83d"}"#.to_owned(), "half of a pair of \\u escapes; write both"),
            (
                "{\"a\": \"one\ntwo\"}".to_owned(),
                "a line break or a tab in a text in quotes; write \\n",
            ),
            (
                format!("{{\"a\": {}", "[".repeat(200)),
                "more than 128 lists and objects in each other",
            ),
        ] {
            let read = parse::<Value>(&text, "f").unwrap_err().to_string();
            assert_holds!(read, told);
        }
    }

    #[test]
    fn a_comment_is_told_wherever_it_stands() {
        for text in ["{\"a\": 1 /* b */}", "{\"a\": 1, // b\n}", "{\"a\": 1} // b", "[/* b */]"] {
            let told = parse::<Value>(text, "f").unwrap_err().to_string();
            assert!(told.contains("a comment stands here, and JSON has none; remove it"), "{told}");
        }
    }

    #[test]
    fn a_key_that_comes_twice_is_an_error_at_any_depth() {
        let text = "{\"map\": 1, \"b\": [-2, 0.5, null, true, \"c\"]}";
        let UniqueKeys(value) = parse(text, "f").unwrap();
        assert_eq!(value, serde_json::from_str::<Value>(text).unwrap());
        let error =
            parse::<UniqueKeys>("[{\"map\": 1,\n\"map\": 2}]", "f").unwrap_err().to_string();
        assert!(error.contains("this key comes twice: `map`; leave one out (line 2,"), "{error}");
    }
}
