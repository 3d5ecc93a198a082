//! Placement files: `.json` as one document, `.jsonl` as a stream.

use std::collections::HashSet;
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::{Placement, SensorError};
use PlacementFileError::Refused;
use sightline_files::files;
use sightline_files::json::{
    self, FileKind, ForeignJson, Objects, comma_too_many, did_you_mean, from_text, kind_of_bytes,
    leading_comment, nearest, not_json, plain_words, unknown_key,
};

/// Longest line of a `.jsonl` file, in bytes: 16 LiDARs need far less.
const MAX_LINE: u64 = 1 << 20;
/// Largest document that is read at once, in bytes: some million placements.
const MAX_DOCUMENT: u64 = 1 << 30;

/// Most names that an error lists.
const MOST_KNOWN: usize = 20;

/// Why a placement file could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum PlacementFileError {
    /// The file cannot be opened or read.
    #[error("{}: cannot be read: {source}", path.display())]
    Io { path: PathBuf, source: io::Error },
    #[error("{}: {source}; give a file of placements, such as the placements.json of a run", path.display())]
    Folder { path: PathBuf, source: io::Error },
    /// Any other text or placement; the sentence names file, line and mend.
    #[error("{0}")]
    Refused(String),
}

impl PlacementFileError {
    /// A fault of a file, in words.
    pub fn of(path: &Path, told: impl Display) -> Self {
        Refused(format!("{}: {told}", path.display()))
    }

    /// A folder in place of a file.
    pub fn folder(path: &Path) -> Self {
        Self::Folder { path: path.to_owned(), source: io::ErrorKind::IsADirectory.into() }
    }

    /// A file without any placement.
    pub fn empty(path: &Path) -> Self {
        Self::of(path, "holds no placement; add at least one")
    }

    fn io(path: &Path) -> impl Fn(io::Error) -> Self + Copy {
        move |source| Self::Io { path: path.to_owned(), source }
    }
}

fn at_line(line: Option<u64>) -> String {
    line.map(|l| format!(", line {l}")).unwrap_or_default()
}

/// Error of a text that is no object of JSON, from a line on if one is given.
fn no_json(path: &Path, line: Option<u64>, told: &str) -> PlacementFileError {
    let place = format!("{}{}", path.display(), at_line(line));
    // Rigs of other programs are not read as they are.
    let is_of_others = ["YAML", "CSV", "XML"].iter().any(|kind| told.ends_with(kind));
    let mend =
        if is_of_others { "; `sightline rig import` reads rigs of other programs" } else { "" };
    Refused(format!("{place}: {told}; a file of placements begins with {{{mend}"))
}

fn too_large(path: &Path) -> PlacementFileError {
    let mend = "give one placement a line in a .jsonl file, which is read as a stream";
    PlacementFileError::of(path, format!("larger than {MAX_DOCUMENT} bytes; {mend}"))
}

/// The `index`-th name in a text that need not be JSON: an error in the text still names its placement.
fn name_in(text: &str, index: usize) -> Option<String> {
    let (at, _) = text.match_indices("\"name\"").nth(index)?;
    let rest = text[at..].strip_prefix("\"name\"")?.trim_start().strip_prefix(':')?;
    let name = rest.trim_start().strip_prefix('"')?.split('"').next()?;
    Some(name.chars().take(64).collect())
}

/// Parses a document, or one line of a `.jsonl` file; `line` is the number of its first line.
fn parse<T: DeserializeOwned>(text: &str, line: u64, path: &Path) -> Result<T, PlacementFileError> {
    // Parsing with the place takes longer, so it runs on errors alone.
    from_text(text).map_err(|error| {
        if let Some(at) = leading_comment(text) {
            let line = line + at as u64 - 1;
            let told = format!("line {line} is a comment, and JSON has no comments; remove it");
            return PlacementFileError::of(path, told);
        }
        if let Some(told) = not_json(text) {
            return no_json(path, (line > 1).then_some(line), &told);
        }
        if let Some(found) = ForeignJson::of(text) {
            return PlacementFileError::of(path, format!("is {found}; {}", found.mend()));
        }
        let mut json = serde_json::Deserializer::from_str(text);
        let place = match serde_path_to_error::deserialize::<_, T>(Objects(&mut json)) {
            Err(error) => error.path().to_string(),
            Ok(_) => ".".to_owned(),
        };
        let full = error.to_string();
        let words = full.rsplit_once(" at line ").map_or(&full[..], |(words, _)| words);
        if let Some(found) = FileKind::of(text).filter(|kind| *kind != FileKind::Placements) {
            let wanted = "give a file of placements, {\"placements\": [ … ]}, here, and this one";
            let told = format!("is {found}; {wanted} {}", found.place());
            return PlacementFileError::of(path, told);
        }
        let problem = match unknown_key(words) {
            // A document in a `.jsonl` file, and a placement alone in another one.
            Some(("placements", _)) if place == "placements" => {
                "belongs to a document; give the file the ending .json".to_owned()
            }
            Some(("name" | "lidars", known)) if known.iter().any(|key| key == "placements") => {
                "belongs to a placement; write {\"placements\": [ … ]} around it".to_owned()
            }
            Some((key, known)) => {
                let nearest = nearest(key, known.iter().map(String::as_str));
                format!("unknown key `{key}`{}", did_you_mean(&nearest, &known))
            }
            None if words == "trailing characters" => {
                "something follows the end of the object; a .jsonl file has one a line, without commas between them"
                    .to_owned()
            }
            None => comma_too_many(text, &error)
                .unwrap_or_else(|| plain_words(words).replace("the file ends", "the text ends")),
        };
        let place = place.trim_end_matches('?').trim_end_matches('.');
        let index = place.strip_prefix("placements[").and_then(|rest| rest.split(']').next());
        // A line of a `.jsonl` file is one placement.
        let is_document = FileKind::of(text).is_some();
        let index = index.map_or((!is_document).then_some(0), |index| index.parse().ok());
        let near = index.filter(|_| !(place.is_empty() || problem.contains("`name`")));
        let (line, column) = (line - 1 + error.line() as u64, error.column());
        let near = near.and_then(|index| name_in(text, index));
        let near = near.map(|name| format!(", placement `{name}`")).unwrap_or_default();
        let place = if place.is_empty() { String::new() } else { format!("{place}: ") };
        let shown = path.display();
        let place = format!("{shown}, line {line}, column {column}{near}: {place}");
        Refused(place + &problem)
    })
}

#[derive(Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(crate) struct PlacementFile {
    /// JSON Schema of this file, which editors read.
    #[serde(rename = "$schema")]
    _schema: Option<String>,
    /// Version of the format: 1.
    #[serde(default, rename = "sightline", deserialize_with = "json::version_1")]
    _version: Option<u64>,
    /// Placements, each of a name of its own.
    pub(super) placements: Vec<Placement>,
}

/// A file, and the name of one placement behind its colon: `rigs.json:roof`. A file whose own name is the whole text has
/// none behind it.
pub fn file_and_name(text: &str) -> (&str, Option<&str>) {
    match text.rsplit_once(':') {
        Some((file, name)) if !Path::new(text).exists() => (file, Some(name)),
        _ => (text, None),
    }
}

/// Like [`file_and_name`], for a path.
fn split(path: &Path) -> (&Path, Option<&str>) {
    let (file, name) = path.to_str().map(file_and_name).unwrap_or_default();
    if name.is_some() { (Path::new(file), name) } else { (path, None) }
}

/// Iterator over the checked placements of a file, in order; `-` is stdin.
///
/// `.jsonl` is read a line at a time, with one placement in memory; `.json` is one document
/// `{"placements": […]}`. Under any other name, such as a pipe's, the first bytes tell the form.
///
/// A name behind the path and a colon picks one placement: `rigs.json:roof`.
pub struct PlacementReader {
    path: PathBuf,
    source: PlacementSource,
    names: HashSet<String>,
    picked: Option<Picked>,
}

/// The one placement that is wanted.
struct Picked {
    name: String,
    is_found: bool,
    /// First names of the file.
    known: Vec<String>,
}

enum PlacementSource {
    Whole(std::vec::IntoIter<Placement>),
    Lines { reader: Box<dyn BufRead>, line: u64 },
}

const DOCUMENT: &[u8] = b"\"placements\"";
/// Key that may stand before it, with a text.
const SCHEMA: &[u8] = b"\"$schema\":\"";
/// Key that may stand before it, with a whole number.
const VERSION: &[u8] = b"\"sightline\":";
/// Mark that some editors write before UTF-8 text.
const BYTE_ORDER_MARK: &str = "\u{feff}";

/// True if bytes without spaces begin a document of placements; `None` if more bytes must tell.
fn begins_document(seen: &[u8]) -> Option<bool> {
    let Some(mut keys) = seen.strip_prefix(b"{") else {
        return seen.first().map(|first| *first == b'[');
    };
    loop {
        let value = if let Some(text) = keys.strip_prefix(SCHEMA) {
            let ends = |at: usize| text[at] == b'"' && !text[..at].ends_with(b"\\");
            &text[(0..text.len()).find(|&at| ends(at))? + 1..]
        } else if let Some(number) = keys.strip_prefix(VERSION) {
            &number[number.iter().position(|byte| !byte.is_ascii_digit())?..]
        } else {
            break;
        };
        keys = value.strip_prefix(b",").unwrap_or(value);
    }
    let is_short = [DOCUMENT, SCHEMA, VERSION]
        .iter()
        .any(|key| keys.len() < key.len() && key.starts_with(keys));
    (!is_short).then(|| keys.starts_with(DOCUMENT))
}

/// Reads the first bytes of a stream; returns them, and whether a document begins there.
fn sniff(reader: &mut impl BufRead) -> io::Result<(Vec<u8>, bool)> {
    let (mut head, mut seen) = (Vec::new(), Vec::new());
    for byte in reader.bytes().take(MAX_LINE as usize) {
        let byte = byte?;
        head.push(byte);
        if byte.is_ascii_whitespace() || BYTE_ORDER_MARK.as_bytes().contains(&byte) {
            continue;
        }
        seen.push(byte);
        if let Some(is_document) = begins_document(&seen) {
            return Ok((head, is_document));
        }
    }
    Ok((head, false))
}

/// True if a file is one of placements rather than a scene: standard input and pipes, `.jsonl` by its name, a
/// document by its first key. False where it cannot be read.
pub fn holds_placements(path: &Path) -> bool {
    let path = split(path).0;
    let is_stream = path == Path::new("-") || (path.exists() && !path.is_file() && !path.is_dir());
    if is_stream || path.extension().is_some_and(|ending| ending == "jsonl") {
        return true;
    }
    // Nothing is read of a pipe, which could be read only once.
    let head = files::open(path).and_then(|file| sniff(&mut BufReader::new(file)));
    head.is_ok_and(|(_, is_document)| is_document)
}

/// True if a path names a file that the shell has opened: standard input, or the `<( … )` of a shell.
fn is_open_file(path: &Path) -> bool {
    ["/dev/stdin", "/dev/fd", "/proc/self/fd"].iter().any(|open| path.starts_with(open))
}

impl PlacementReader {
    /// Opens a file; parses a document at once, lines one by one on demand.
    ///
    /// # Errors
    /// The file cannot be opened, or is no JSON of the expected form.
    pub fn open(path: &Path) -> Result<Self, PlacementFileError> {
        let (path, name) = split(path);
        let picked =
            name.map(|name| Picked { name: name.to_owned(), is_found: false, known: Vec::new() });
        if path.is_dir() {
            return Err(PlacementFileError::folder(path));
        }
        let io = PlacementFileError::io(path);
        let mut length = 0;
        let mut reader: Box<dyn BufRead> = if path == Path::new("-") {
            Box::new(BufReader::new(io::stdin()))
        } else if is_open_file(path) {
            Box::new(BufReader::new(File::open(path).map_err(io)?))
        } else {
            let file = files::open(path).map_err(io)?;
            length = file.metadata().map_err(io)?.len();
            Box::new(BufReader::new(file))
        };
        let is_document = match path.extension().and_then(|ending| ending.to_str()) {
            Some("jsonl") => false,
            // A mesh is looked at as a whole, so that it is named.
            Some("json" | "gltf") => true,
            _ => {
                let (head, is_document) = sniff(&mut reader).map_err(io)?;
                reader = Box::new(io::Cursor::new(head).chain(reader));
                is_document
            }
        };
        if is_document && length > MAX_DOCUMENT {
            return Err(too_large(path));
        }
        let source = if is_document {
            PlacementSource::Whole(document(reader, path)?.placements.into_iter())
        } else {
            PlacementSource::Lines { reader, line: 0 }
        };
        Ok(Self { path: path.to_owned(), source, names: HashSet::new(), picked })
    }

    fn next_placement(&mut self) -> Option<Result<Placement, PlacementFileError>> {
        let (placement, line) = match &mut self.source {
            PlacementSource::Whole(rest) => (rest.next()?, None),
            PlacementSource::Lines { reader, line } => match next_line(reader, line, &self.path)? {
                Ok(placement) => (placement, Some(*line)),
                Err(error) => return Some(Err(error)),
            },
        };
        let checked = placement.validate().and_then(|()| {
            if self.names.insert(placement.name.clone()) {
                Ok(())
            } else {
                Err(SensorError::UsedTwice { name: placement.name.clone() })
            }
        });
        let place = || format!("{}{}", self.path.display(), at_line(line));
        let refused = |fault| Refused(format!("{}: {fault}", place()));
        Some(checked.map(|()| placement).map_err(refused))
    }
}

/// Error for the bytes of a mesh, a point cloud or an archive.
fn foreign(bytes: &[u8], path: &Path) -> Option<PlacementFileError> {
    let kind = kind_of_bytes(bytes, path)?;
    Some(no_json(path, None, &format!("is not JSON, it looks like {kind}")))
}

fn document(reader: impl Read, path: &Path) -> Result<PlacementFile, PlacementFileError> {
    let mut bytes = Vec::new();
    let read = reader.take(MAX_DOCUMENT + 1).read_to_end(&mut bytes);
    read.map_err(PlacementFileError::io(path))?;
    if bytes.len() as u64 > MAX_DOCUMENT {
        return Err(too_large(path));
    }
    let text = std::str::from_utf8(&bytes).map_err(|error| {
        let (byte, mend) = (error.valid_up_to(), "save it as UTF-8");
        let told = format!("is not UTF-8 text from byte {byte} on; {mend}");
        foreign(&bytes, path).unwrap_or_else(|| PlacementFileError::of(path, told))
    })?;
    let text = text.strip_prefix(BYTE_ORDER_MARK).unwrap_or(text);
    if text.trim_ascii().is_empty() {
        return Err(PlacementFileError::empty(path));
    }
    if text.trim_start().starts_with('[') {
        let mend = "write {\"placements\": [ … ]} around it";
        return Err(PlacementFileError::of(path, format!("is a bare list; {mend}")));
    }
    parse(text, 1, path)
}

fn next_line(
    reader: &mut impl BufRead,
    line: &mut u64,
    path: &Path,
) -> Option<Result<Placement, PlacementFileError>> {
    let mut bytes = Vec::new();
    let at = |line: u64, told: String| Refused(format!("{}, line {line}: {told}", path.display()));
    loop {
        bytes.clear();
        match reader.by_ref().take(MAX_LINE + 1).read_until(b'\n', &mut bytes) {
            Err(source) => return Some(Err(PlacementFileError::io(path)(source))),
            Ok(0) => return None,
            Ok(_) => *line += 1,
        }
        if bytes.len() as u64 > MAX_LINE {
            let told = format!("longer than {MAX_LINE} bytes; give one placement a line");
            return Some(Err(at(*line, told)));
        }
        let text = match std::str::from_utf8(&bytes) {
            Ok(text) => text.trim_start_matches(BYTE_ORDER_MARK),
            Err(_) => {
                let other = (*line == 1).then(|| foreign(&bytes, path)).flatten();
                let told = "is not UTF-8 text; save it as UTF-8".to_owned();
                return Some(Err(other.unwrap_or_else(|| at(*line, told))));
            }
        };
        if text.starts_with('#') {
            // No JSON: the lines behind a comment tell which kind of file it is.
            let mut more = text.to_owned();
            _ = reader.by_ref().take(MAX_LINE).read_to_string(&mut more);
            return Some(parse(&more, *line, path));
        }
        if !text.trim_ascii().is_empty() {
            return Some(parse(text, *line, path));
        }
    }
}

impl Iterator for PlacementReader {
    type Item = Result<Placement, PlacementFileError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let next = self.next_placement();
            let Some(picked) = &mut self.picked else { return next };
            match next {
                Some(Ok(placement)) if placement.name == picked.name => {
                    picked.is_found = true;
                    return Some(Ok(placement));
                }
                Some(Ok(placement)) if picked.known.len() < MOST_KNOWN => {
                    picked.known.push(placement.name);
                }
                Some(Ok(_)) => {}
                None if !picked.is_found && !self.names.is_empty() => {
                    picked.is_found = true;
                    let (name, known) = (&picked.name, picked.known.join(", "));
                    let told = format!("has no placement `{name}`; it has {known}");
                    return Some(Err(PlacementFileError::of(&self.path, told)));
                }
                other => return other,
            }
        }
    }
}

/// All placements of a file at once.
///
/// # Errors
/// Like [`PlacementReader`], and a file without any placement.
pub fn read_placements(path: impl AsRef<Path>) -> Result<Vec<Placement>, PlacementFileError> {
    let path = path.as_ref();
    let placements = PlacementReader::open(path)?.collect::<Result<Vec<_>, _>>()?;
    if placements.is_empty() {
        return Err(PlacementFileError::empty(path));
    }
    Ok(placements)
}

/// Placements of a file, each read and checked once; none is kept.
pub fn count_placements(path: &Path) -> Result<u64, PlacementFileError> {
    let mut count = 0;
    for placement in PlacementReader::open(path)? {
        placement?;
        count += 1;
    }
    if count == 0 {
        return Err(PlacementFileError::empty(path));
    }
    Ok(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_neither_a_lidar_nor_a_placement() {
        let told = |text: &str| {
            let read = parse::<PlacementFile>(text, 1, Path::new("p.json")).map(|_| ());
            read.unwrap_err()
        };
        let lidar = told(r#"{"placements":[{"name":"p","lidars":[[1,2,2,1.57]]}]}"#);
        assert_holds!(
            lidar,
            "placement `p`: placements[0].lidars[0]: is a list; write an object with `x`, `y`, "
        );
        let placement = told(r#"{"placements":[["p",[{"x":1,"y":2,"z":2}]]]}"#);
        assert_holds!(placement, "placements[0]: is a list; write an object with `name`");
        let line = parse::<Placement>(r#"["p", []]"#, 3, Path::new("p.jsonl")).unwrap_err();
        assert_holds!(line, "line 3, column", "is a list; write an object with `name`");
        // Lines of a list of JSON, and lines that a carriage return ends.
        for behind in [",", "\r{\"name\":\"q\",\"lidars\":[]}"] {
            let text = format!(r#"{{"name":"p","lidars":[]}}{behind}"#);
            let line = parse::<Placement>(&text, 3, Path::new("p.jsonl")).unwrap_err();
            assert_holds!(
                line,
                "line 3, column",
                "something follows the end of the object; a .jsonl"
            );
        }
    }
}
