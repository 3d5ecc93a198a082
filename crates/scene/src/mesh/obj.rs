//! Wavefront OBJ: positions, faces, and the names in `usemtl`, on which the classes hang.

use std::borrow::Cow;
use std::collections::BTreeMap;

use glam::DVec3;

use super::polygon::Cutter;
use super::{MOST_TOLD, MeshFault, Parsed, RawMesh};
use sightline_files::Note;

/// Statements without a surface of their own, passed over in silence.
const PASSED: [&str; 34] = [
    // Texture coordinates, normals, points of parameter spaces.
    "vt", "vn", "vp", // Points and lines have no area.
    "p", "l", "curv", "cdc", // Groups and shading.
    "g", "o", "s", "mg", "bevel", "c_interp", "d_interp", "lod", "shadow_obj", "trace_obj",
    "ctech", "stech", // Looks: the classes hang on the names in `usemtl`.
    "mtllib", "usemap", "maplib",
    // Parts of curves and of surfaces; a surface itself is refused.
    "cstype", "deg", "bmat", "step", "curv2", "parm", "trim", "hole", "scrv", "sp", "end", "con",
];
/// Statements that bring a surface which is not read.
const REFUSED: [(&[&str], &str); 3] = [
    (
        &["surf", "bsp", "bzp", "cdp"],
        "is a free-form surface, which is not read; export the model as polygons",
    ),
    (&["call"], "includes another file, which is not read; put all into one file"),
    (&["csh"], "runs a program, which is not done; put all into one file"),
];
/// Statements that end in a name or a path, where a backslash at the end continues nothing.
const NAMED: [&[u8]; 6] = [b"usemtl", b"mtllib", b"usemap", b"maplib", b"g", b"o"];

/// A space that separates no words, as text from pages has it.
const FIXED_SPACE: char = '\u{a0}';
const HAS_FIXED: &str = "has non-breaking spaces; write plain ones";

pub(super) fn read(bytes: &[u8]) -> Parsed<RawMesh> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(MeshFault::new("line 1", "is UTF-16; save the file as UTF-8"));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    if let Some(at) = bytes.iter().position(|&b| b == 0) {
        let line = Lines { rest: &bytes[..=at], line: 0 }.count();
        return Err(MeshFault::new(format!("line {line}"), "is not text; is this an OBJ file?"));
    }
    let mut reader = ObjReader::default();
    // Faces may come before their vertices, and a polygon is cut by where its corners are.
    for (line, text) in (Lines { rest: bytes, line: 0 }) {
        let mut words = words(&text);
        if words.next().is_some_and(|word| word.eq_ignore_ascii_case(b"v")) {
            let fault = |problem| MeshFault::new(format!("line {line}"), problem);
            reader.mesh.vertices.push(position(&mut words).map_err(fault)?);
            reader.weigh(line, words);
        }
    }
    for (line, text) in (Lines { rest: bytes, line: 0 }) {
        reader
            .statement(line, &text)
            .map_err(|problem| MeshFault::new(format!("line {line}"), problem))?;
    }
    Ok(reader.finish())
}

/// Lines with their numbers; ends are LF, CR LF or CR. A backslash at the end joins a line with the next one.
struct Lines<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Lines<'a> {
    fn single(&mut self) -> Option<&'a [u8]> {
        if self.rest.is_empty() {
            return None;
        }
        self.line += 1;
        let rest = self.rest;
        let end = rest.iter().position(|b| matches!(b, b'\n' | b'\r')).unwrap_or(rest.len());
        let wide = if rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
        self.rest = &rest[(end + wide).min(rest.len())..];
        Some(&rest[..end])
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let mut piece = self.single()?;
        let (line, is_named, mut text) = (self.line, is_named(piece), Cow::Borrowed(piece));
        while piece.trim_ascii_end().ends_with(b"\\") && !is_named && !has_comment(piece) {
            let keep = text.trim_ascii_end().len() - 1;
            text.to_mut().truncate(keep);
            let Some(next) = self.single() else { break };
            text.to_mut().extend_from_slice(next);
            piece = next;
        }
        Some((line, text))
    }
}

/// Words of a line up to a comment.
fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let words = text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
    words.take_while(|word| !word.starts_with(b"#"))
}

/// True for a statement that ends in a name or a path.
fn is_named(text: &[u8]) -> bool {
    let first = words(text).next().unwrap_or_default();
    NAMED.iter().any(|name| name.eq_ignore_ascii_case(first))
}

/// True if a line has a comment, by its words.
fn has_comment(text: &[u8]) -> bool {
    text.split(u8::is_ascii_whitespace).any(|word| word.starts_with(b"#"))
}

/// Text of any bytes: UTF-8, or Latin-1 where it is none.
fn decode(bytes: &[u8]) -> Cow<'_, str> {
    match std::str::from_utf8(bytes) {
        Ok(text) => text.into(),
        Err(_) => bytes.iter().map(|&b| char::from(b)).collect::<String>().into(),
    }
}

/// The first three numbers; a weight or a colour may follow.
fn position<'a>(mut words: impl Iterator<Item = &'a [u8]>) -> Result<DVec3, String> {
    let mut number = || {
        let word = decode(words.next().ok_or("lacks one of the numbers x, y, z")?);
        word.parse::<f64>().map_err(|_| match word.contains(FIXED_SPACE) {
            true => HAS_FIXED.to_owned(),
            false => format!("{word:?} is not a number such as 1.5 or -2e3"),
        })
    };
    Ok(DVec3::new(number()?, number()?, number()?))
}

#[derive(Default)]
struct ObjReader {
    mesh: RawMesh,
    cutter: Cutter,
    /// Vertices in front of the present line.
    so_far: i64,
    /// Present name, and its index once a face has it.
    name: Option<String>,
    material: Option<u32>,
    corners: Vec<u32>,
    /// Unknown statements with the line of the first and their count.
    unknown: BTreeMap<String, (usize, usize)>,
    /// First name that is no UTF-8, as it was read.
    odd_name: Option<String>,
    /// First known keyword in capitals, with its line.
    capital: Option<(String, usize)>,
    /// First weight of a position that is not 1, with its line.
    weight: Option<(f64, usize)>,
}

impl ObjReader {
    /// Keeps the only number behind a position, which is a weight; three or more are a colour.
    fn weigh<'a>(&mut self, line: usize, mut words: impl Iterator<Item = &'a [u8]>) {
        let (Some(word), None) = (words.next(), words.next()) else { return };
        let weight = decode(word).parse().ok().filter(|weight| *weight != 1.0);
        self.weight = self.weight.or(weight.map(|weight| (weight, line)));
    }

    fn statement(&mut self, line: usize, text: &[u8]) -> Result<(), String> {
        let mut words = words(text);
        let Some(keyword) = words.next() else { return Ok(()) };
        if has_comment(text) && text.trim_ascii_end().ends_with(b"\\") && !is_named(text) {
            let fault = "has a comment that ends with a backslash, which some programs join with the next line";
            return Err(format!("{fault}; take the backslash away"));
        }
        let is_capital = keyword.iter().any(u8::is_ascii_uppercase);
        let small = match is_capital {
            true => Cow::Owned(keyword.to_ascii_lowercase()),
            false => Cow::Borrowed(keyword),
        };
        match &small[..] {
            b"v" => self.so_far += 1,
            // `fo` is the word for a face in old files.
            b"f" | b"fo" => self.face(words)?,
            b"usemtl" => {
                let name = text.trim_ascii_start()[keyword.len()..].trim_ascii();
                let known = decode(name).into_owned();
                if std::str::from_utf8(name).is_err() {
                    self.odd_name.get_or_insert_with(|| known.clone());
                }
                self.name = Some(known).filter(|name| !name.is_empty());
                self.material = None;
            }
            small => {
                let small = decode(small);
                if let Some((_, problem)) =
                    REFUSED.iter().find(|(known, _)| known.contains(&&*small))
                {
                    return Err(format!("`{}` {problem}", decode(keyword)));
                }
                if small.contains(FIXED_SPACE) {
                    return Err(HAS_FIXED.to_owned());
                }
                if !PASSED.contains(&&*small) {
                    let short: String = decode(keyword).chars().take(20).collect();
                    if self.unknown.len() <= MOST_TOLD || self.unknown.contains_key(&short) {
                        self.unknown.entry(short).or_insert((line, 0)).1 += 1;
                    }
                    return Ok(());
                }
            }
        }
        if is_capital {
            self.capital.get_or_insert_with(|| (decode(keyword).into_owned(), line));
        }
        Ok(())
    }

    fn face<'a>(&mut self, words: impl Iterator<Item = &'a [u8]>) -> Result<(), String> {
        let total = self.mesh.vertices.len();
        self.corners.clear();
        for word in words {
            // Numbers of texture coordinates and normals follow behind slashes.
            let first = decode(word.split(|&b| b == b'/').next().unwrap_or_default());
            let index: i64 = first
                .parse()
                .map_err(|_| format!("{:?} is not a vertex of a face", decode(word)))?;
            let place = if index < 0 { index.saturating_add(self.so_far + 1) } else { index };
            if place < 1 || place > total as i64 {
                let mend = if index == 0 { "; OBJ counts from 1" } else { "" };
                return Err(format!("refers to vertex {index}, there are {total}{mend}"));
            }
            self.corners.push(place as u32 - 1);
        }
        let material = match self.material {
            Some(material) => material,
            None if self.corners.len() < 3 => 0,
            None => *self.material.insert(self.mesh.material(self.name.as_deref())),
        };
        self.cutter.add(&mut self.mesh, &self.corners, material)
    }

    fn finish(mut self) -> RawMesh {
        self.cutter.notes(&mut self.mesh);
        let mut list: Vec<_> =
            self.unknown.into_iter().map(|(word, (line, count))| (line, word, count)).collect();
        list.sort_unstable();
        let more = if list.len() > MOST_TOLD { " and others" } else { "" };
        let told: Vec<String> = list
            .into_iter()
            .take(MOST_TOLD)
            .map(|(line, word, count)| format!("{word:?} (line {line}, {count} in all)"))
            .collect();
        if !told.is_empty() {
            self.mesh.notes.push(Note::doubt(format!(
                "statements that OBJ does not know are passed over: {}{more}",
                told.join(", ")
            )));
        }
        if let Some((weight, line)) = self.weight {
            self.mesh.notes.push(Note::doubt(format!(
                "a fourth number of a position is a weight and moves no corner, {weight} first (line {line}); where it is \
                 the w of x, y, z, w, divide by it"
            )));
        }
        if let Some((word, line)) = self.capital {
            self.mesh.notes.push(Note::fact(format!(
                "keywords in capitals are read like small ones, {word:?} first (line {line}); write them small for other \
                 programs"
            )));
        }
        if let Some(name) = self.odd_name {
            self.mesh.notes.push(Note::fact(format!(
                "names in `usemtl` are no UTF-8 and are read as Latin-1, {name:?} first; save the file as UTF-8 to \
                 name them otherwise"
            )));
        }
        self.mesh
    }
}
