//! STL, binary and text: triangles with a corner list each, joined where corners have equal bits.
//!
//! A file is binary if its length fits its count of triangles: 84 bytes, and 50 for each. Many exporters begin
//! binary files with the word `solid`, too. STL states no unit and no up axis.

use std::collections::HashMap;

use glam::DVec3;

use super::{MOST_TRIANGLES, MeshFault, Parsed, RawMesh};
use sightline_files::Note;
use sightline_files::json::counted;

/// Bytes before the first triangle: a header of 80, and the count.
const HEAD: usize = 84;
/// Bytes of a triangle: normal and three corners in `f32`, and two bytes of attributes.
const TRIANGLE: usize = 50;

pub(super) fn read(bytes: &[u8]) -> Parsed<RawMesh> {
    let count = bytes.get(80..HEAD).and_then(|count| count.try_into().ok());
    let count = count.map(|count| u64::from(u32::from_le_bytes(count)));
    let expected = count.map(|count| HEAD as u64 + TRIANGLE as u64 * count);
    if expected == Some(bytes.len() as u64) {
        return binary(bytes);
    }
    // Some writers fill up the last block of a text with zeros.
    let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
    let text = bytes[..end].strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes[..end]);
    if first_word(text).eq_ignore_ascii_case(b"solid") && !text.contains(&0) {
        return TextReader::default().read(text);
    }
    let problem = match (count, expected) {
        (Some(count), Some(expected)) => format!(
            "says {count} triangles, which take {expected} bytes, and the file has {}; export it again",
            bytes.len()
        ),
        _ => "is neither binary STL, which has 84 bytes or more, nor text that begins with `solid`; export it again"
            .to_owned(),
    };
    Err(MeshFault::new("header", problem))
}

fn first_word(text: &[u8]) -> &[u8] {
    let text = text.trim_ascii_start();
    &text[..text.iter().position(u8::is_ascii_whitespace).unwrap_or(text.len())]
}

/// Corners by their bits: triangles of an STL repeat them.
#[derive(Default)]
struct Corners {
    known: HashMap<[u64; 3], u32>,
}

impl Corners {
    fn add(
        &mut self,
        mesh: &mut RawMesh,
        corners: [DVec3; 3],
        material: u32,
    ) -> Result<(), String> {
        if let Some(at) = corners.iter().position(|corner| !corner.is_finite()) {
            return Err(format!(
                "corner {at} is at {}, which is not a finite position; export it again",
                super::exponents(corners[at])
            ));
        }
        let face = corners.map(|corner| {
            // Both zeros are one place.
            let key = corner.to_array().map(|v| (v + 0.0).to_bits());
            *self.known.entry(key).or_insert_with(|| {
                mesh.vertices.push(corner);
                mesh.vertices.len() as u32 - 1
            })
        });
        mesh.triangle(face, material)
    }
}

fn binary(bytes: &[u8]) -> Parsed<RawMesh> {
    let mut mesh = RawMesh::default();
    let material = mesh.material(None);
    let (mut corners, mut attributes) = (Corners::default(), 0_usize);
    for (row, triangle) in bytes[HEAD..].chunks_exact(TRIANGLE).enumerate() {
        let number = |k: usize| {
            let bytes = [0, 1, 2, 3].map(|byte| triangle[4 * k + byte]);
            f64::from(f32::from_le_bytes(bytes))
        };
        // The first three numbers are the normal, which the corners say better.
        let corner = |k: usize| DVec3::new(number(k), number(k + 1), number(k + 2));
        attributes += usize::from(triangle[48..] != [0, 0]);
        corners
            .add(&mut mesh, [3, 6, 9].map(corner), material)
            .map_err(|problem| MeshFault::new(format!("triangle {row}"), problem))?;
    }
    if attributes > 0 {
        mesh.notes.push(Note::fact(format!(
            "passed over: attribute bytes of {}, which hold colours in some programs",
            counted(attributes, "triangle")
        )));
    }
    Ok(mesh)
}

/// Words of a text with their lines.
struct Tokens<'a> {
    rest: &'a [u8],
    line: usize,
}

impl<'a> Tokens<'a> {
    fn next(&mut self) -> Option<&'a [u8]> {
        self.skip_space();
        let end = self.rest.iter().position(u8::is_ascii_whitespace).unwrap_or(self.rest.len());
        let (word, rest) = self.rest.split_at(end);
        self.rest = rest;
        (!word.is_empty()).then_some(word)
    }

    fn skip_space(&mut self) {
        let end = self.rest.iter().position(|b| !b.is_ascii_whitespace());
        let (space, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        let ends = |(i, b): &(usize, &u8)| {
            **b == b'\n' || **b == b'\r' && space.get(i + 1) != Some(&b'\n')
        };
        self.line += space.iter().enumerate().filter(ends).count();
        self.rest = rest;
    }

    fn line(&mut self) -> &'a [u8] {
        let end = self.rest.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let (line, rest) = self.rest.split_at(end.unwrap_or(self.rest.len()));
        self.rest = rest;
        line.trim_ascii()
    }

    /// Passes over words that must come next.
    fn expect(&mut self, words: &[&str]) -> Result<(), String> {
        words.iter().try_for_each(|wanted| match self.next() {
            Some(word) if word.eq_ignore_ascii_case(wanted.as_bytes()) => Ok(()),
            found => Err(instead(found, wanted)),
        })
    }

    fn number(&mut self) -> Result<f64, String> {
        let word = self.next();
        let text = word.and_then(|word| std::str::from_utf8(word).ok());
        text.and_then(|text| text.parse().ok()).ok_or_else(|| instead(word, "a number"))
    }

    fn point(&mut self) -> Result<DVec3, String> {
        Ok(DVec3::new(self.number()?, self.number()?, self.number()?))
    }
}

fn instead(found: Option<&[u8]>, wanted: &str) -> String {
    /// Characters of a word that a message repeats.
    const MOST: usize = 40;
    match found {
        None => format!("ends where `{wanted}` belongs; export it again"),
        Some(word) => {
            let word: String = String::from_utf8_lossy(word).chars().take(MOST).collect();
            format!("has {word:?} where `{wanted}` belongs; export it again")
        }
    }
}

/// Reader of a text; each solid's name is the material of its triangles.
#[derive(Default)]
struct TextReader {
    mesh: RawMesh,
    corners: Corners,
}

impl TextReader {
    fn read(mut self, text: &[u8]) -> Parsed<RawMesh> {
        let mut words = Tokens { rest: text, line: 1 };
        while let Some(word) = words.next() {
            let read = match word.eq_ignore_ascii_case(b"solid") {
                true => self.solid(&mut words),
                false => Err(instead(Some(word), "solid")),
            };
            read.map_err(|problem| {
                // A line that ends the text begins no other.
                let is_ended = matches!(text.last(), Some(b'\n' | b'\r'));
                let after = usize::from(words.rest.is_empty() && is_ended);
                MeshFault::new(format!("line {}", words.line - after), problem)
            })?;
        }
        Ok(self.mesh)
    }

    /// Triangles from behind the word `solid` to the end of the line of its `endsolid`.
    fn solid(&mut self, words: &mut Tokens<'_>) -> Result<(), String> {
        let name = String::from_utf8_lossy(words.line()).into_owned();
        let mut material = None;
        loop {
            match words.next() {
                Some(word) if word.eq_ignore_ascii_case(b"facet") => {}
                Some(word) if word.eq_ignore_ascii_case(b"endsolid") => {
                    words.line();
                    return Ok(());
                }
                found => return Err(instead(found, "facet` or `endsolid")),
            }
            words.expect(&["normal"])?;
            // The corners say the normal better; many exporters write nan or zeros.
            (0..3).try_for_each(|_| {
                words.next().map(|_| ()).ok_or_else(|| instead(None, "a number"))
            })?;
            words.expect(&["outer", "loop"])?;
            let mut corners = [DVec3::ZERO; 3];
            for corner in &mut corners {
                words.expect(&["vertex"])?;
                *corner = words.point()?;
            }
            words.expect(&["endloop", "endfacet"])?;
            let name = Some(name.as_str()).filter(|name| !name.is_empty());
            let material = *material.get_or_insert_with(|| self.mesh.material(name));
            self.corners.add(&mut self.mesh, corners, material)?;
        }
    }
}

const _: () = assert!(MOST_TRIANGLES < u32::MAX as usize / 3);
