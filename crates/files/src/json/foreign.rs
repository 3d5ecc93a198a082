//! Texts and bytes that are no JSON object: their likely format, for the message.

use std::path::Path;

use serde::de::IgnoredAny;

/// Bytes or words that files of other kinds begin with.
#[rustfmt::skip] // Words of a list stand side by side.
const BEGINNINGS: &[(&str, &str)] = &[
    ("ply\n", "a PLY mesh"), ("ply\r", "a PLY mesh"), ("PK\u{3}\u{4}", "a ZIP archive"), ("glTF", "a glTF mesh"),
    ("solid ", "an STL mesh"), ("<", "XML"), ("NUMPY", "a NumPy array"), ("\u{1f}", "a gzip file"), ("---", "YAML"),
    ("v ", "an OBJ mesh"), ("o ", "an OBJ mesh"), ("mtllib ", "an OBJ mesh"), ("# .PCD", "a PCD point cloud"),
    ("VERSION ", "a PCD point cloud"),
];

/// Endings of binary files that need not begin with a known word.
const ENDINGS: &[(&str, &str)] =
    &[("stl", "an STL mesh"), ("ply", "a PLY mesh"), ("pcd", "a PCD point cloud")];

/// Kinds that may be binary; all others are texts, which another encoding may have spoilt.
const BINARY: [&str; 6] = [
    "a PLY mesh", "a ZIP archive", "a glTF mesh", "an STL mesh", "a NumPy array",
    "a PCD point cloud",
];

/// First bytes that tell the kind of a file.
const HEAD: usize = 64;

/// Kind of a binary file whose bytes are no text in UTF-8: by the ending of its name, else by its first bytes. `None` for a
/// text in another encoding.
pub fn kind_of_bytes(bytes: &[u8], file: &Path) -> Option<&'static str> {
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(HEAD)]);
    let ending = file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    let by_name = || ENDINGS.iter().find(|(known, _)| *known == ending).map(|(_, kind)| *kind);
    let is_binary = |kind: &&str| BINARY.contains(kind);
    let by_bytes = || match bytes.starts_with(b"\x1f\x8b") {
        true => Some("a gzip file"),
        false => beginning(without_noise(&head)).filter(is_binary),
    };
    by_name().or_else(by_bytes)
}

/// Kind of file that begins with these words.
fn beginning(text: &str) -> Option<&'static str> {
    BEGINNINGS.iter().find(|(start, _)| text.starts_with(start)).map(|(_, kind)| *kind)
}

/// A text without the signs before its first letter; the first byte of gzip stays.
fn without_noise(text: &str) -> &str {
    text.trim_start_matches(|c: char| !c.is_ascii_graphic() && c != '\u{1f}')
}

/// True if bytes are a text in UTF-16, with a byte order mark or without one.
pub fn is_utf_16(bytes: &[u8]) -> bool {
    // Without a mark: signs of ASCII, each with a byte of 0 before or behind it.
    let pairs = || bytes.as_chunks::<2>().0.iter().take(8);
    let ascii = |byte: u8| byte.is_ascii_graphic() || byte.is_ascii_whitespace();
    bytes.starts_with(b"\xff\xfe")
        || bytes.starts_with(b"\xfe\xff")
        || (bytes.len() >= 4 && pairs().all(|[a, b]| ascii(*a) && *b == 0))
        || (bytes.len() >= 4 && pairs().all(|[a, b]| *a == 0 && ascii(*b)))
}

/// Line, from 1, of the comment that a text of JSON begins with: `//`, `/*`, or `#` before an object or a list.
pub fn leading_comment(text: &str) -> Option<usize> {
    let rest = text.trim_start();
    let line = 1 + text[..text.len() - rest.len()].matches('\n').count();
    let mut lines = rest.lines().map(str::trim_start);
    // YAML, OBJ and PCD have comments of `#`, too.
    let first = lines.find(|line| !line.is_empty() && !line.starts_with('#'));
    let is_comment = match rest.starts_with('#') {
        true => first.is_some_and(|line| line.starts_with(['{', '['])),
        false => rest.starts_with("//") || rest.starts_with("/*"),
    };
    is_comment.then_some(line)
}

/// Why a text cannot be an object of JSON; `None` where its first sign says that it may be one, or a list.
pub fn not_json(text: &str) -> Option<String> {
    let text = text.trim_start();
    if text.is_empty() || text.starts_with(['{', '[']) {
        return None;
    }
    let looks = like(without_noise(text));
    if looks.is_none() && serde_json::from_str::<IgnoredAny>(text).is_ok() {
        return None;
    }
    let looks = looks.map(|kind| format!(", it looks like {kind}"));
    Some(format!("is not JSON{}", looks.unwrap_or_default()))
}

/// Kind of file that a text looks like.
fn like(text: &str) -> Option<&'static str> {
    if let Some(kind) = beginning(text) {
        return Some(kind);
    }
    let line =
        text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'))?;
    if let Some(kind) = beginning(line) {
        return Some(kind);
    }
    let is_key = |key: &str| {
        !key.is_empty() && key.chars().all(|c| c.is_alphanumeric() || "_- \"'".contains(c))
    };
    let key = line.split_once(':').filter(|(_, rest)| rest.is_empty() || rest.starts_with(' '));
    match key {
        Some((key, _)) if is_key(key) => Some("YAML"),
        _ if line.starts_with("- ") => Some("YAML"),
        _ if line.contains(',') => Some("CSV"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn utf_16_is_told_from_other_bytes() {
        let little =
            |text: &str| text.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
        let big = |text: &str| text.encode_utf16().flat_map(u16::to_be_bytes).collect::<Vec<u8>>();
        for text in ["{}", "\u{feff}{\"a\": 1}", "<robot name='r'/>", "x, y\n"] {
            assert!(is_utf_16(&little(text)) && is_utf_16(&big(text)), "{text}");
            assert!(!is_utf_16(text.as_bytes()), "{text}");
        }
        for bytes in [
            &b""[..],
            b"\0\0\0\0",
            b"{\0",
            b"PK\x03\x04",
            b"\x93NUMPY\x01\0",
            &1.0_f32.to_le_bytes(),
        ] {
            assert!(!is_utf_16(bytes), "{bytes:?}");
        }
    }

    #[test]
    fn a_comment_before_json_is_found_with_its_line() {
        for (text, line) in [
            ("// rig\n{}", Some(1)),
            ("\n\n  /* rig */ {}", Some(3)),
            ("# rig\n\n# of two\n[1]", Some(1)),
            ("# rig\nsightline: 1\n", None),
            ("# .PCD v0.7\nVERSION 0.7\n", None),
            ("{ // rig\n}", None),
            ("", None),
        ] {
            assert_eq!(leading_comment(text), line, "{text:?}");
        }
    }

    #[test]
    fn other_kinds_of_files_are_named() {
        for (text, told) in [
            ("x,y,z\n1,2,3\n", "is not JSON, it looks like CSV"),
            ("1,2,3\n4,5,6\n", "is not JSON, it looks like CSV"),
            ("# rig\nsightline: 1\nmounts:\n  - name: a\n", "is not JSON, it looks like YAML"),
            ("- name: a, b\n", "is not JSON, it looks like YAML"),
            ("ply\nformat ascii 1.0\n", "is not JSON, it looks like a PLY mesh"),
            ("PK\u{3}\u{4}\0\0", "is not JSON, it looks like a ZIP archive"),
            ("\u{fffd}NUMPY\u{1}", "is not JSON, it looks like a NumPy array"),
            ("<?xml version='1.0'?>", "is not JSON, it looks like XML"),
            ("# Blender\nmtllib a.mtl\n", "is not JSON, it looks like an OBJ mesh"),
            ("# .PCD v0.7\nVERSION 0.7\n", "is not JSON, it looks like a PCD point cloud"),
            ("hello", "is not JSON"),
            ("\u{1}\u{2}", "is not JSON"),
        ] {
            assert_eq!(not_json(text).as_deref(), Some(told), "{text:?}");
        }
        for json in ["{", " \n[1]", "", "1.5", "null", "\"a\""] {
            assert_eq!(not_json(json), None, "{json:?}");
        }
    }

    #[test]
    fn bytes_are_known_by_their_beginning_or_the_name_of_their_file() {
        for (bytes, file, kind) in [
            (&b"ply\nformat binary_little_endian 1.0\n\xff"[..], "a", Some("a PLY mesh")),
            (b"PK\x03\x04\xff\xfe", "a.json", Some("a ZIP archive")),
            (b"\xff\xff\x01\x02", "part.STL", Some("an STL mesh")),
            (b"{\"placements\": [\xff]}", "a.json", None),
            (b"\x1f\x8b\x08\xff", "a", Some("a gzip file")),
            (b"<?xml version=\"1.0\"?><robot name=\"r\xe9\"/>", "l.urdf", None),
            (b"v 1 2 3 # \xe9", "l.obj", None),
            (b"", "a", None),
        ] {
            assert_eq!(kind_of_bytes(bytes, Path::new(file)), kind, "{file}");
        }
    }
}
