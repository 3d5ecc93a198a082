//! Texts that are no JSON object: what they look like, for the message.

use serde::de::IgnoredAny;

/// Bytes or words that files of other kinds begin with.
const BEGINNINGS: &[(&str, &str)] = &[
    ("ply\n", "a PLY mesh"),
    ("ply\r", "a PLY mesh"),
    ("PK\u{3}\u{4}", "a ZIP archive"),
    ("glTF", "a glTF mesh"),
    ("solid ", "an STL mesh"),
    ("<", "XML"),
    ("NUMPY", "a NumPy array"),
    ("\u{1f}", "a gzip file"),
    ("---", "YAML"),
    ("//", "JSON with comments, which JSON does not have"),
    ("/*", "JSON with comments, which JSON does not have"),
    ("v ", "an OBJ mesh"),
];

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

/// Why a text cannot be an object of JSON; `None` where its first sign says that it may be one, or a list.
pub fn not_json(text: &str) -> Option<String> {
    let text = text.trim_start();
    if text.is_empty() || text.starts_with(['{', '[']) {
        return None;
    }
    let looks = like(text.trim_start_matches(|c: char| !c.is_ascii_graphic() && c != '\u{1f}'));
    if looks.is_none() && serde_json::from_str::<IgnoredAny>(text).is_ok() {
        return None;
    }
    let looks = looks.map(|kind| format!(", it looks like {kind}"));
    Some(format!("is not JSON{}", looks.unwrap_or_default()))
}

/// Kind of file that a text looks like.
fn like(text: &str) -> Option<&'static str> {
    if let Some((_, kind)) = BEGINNINGS.iter().find(|(start, _)| text.starts_with(start)) {
        return Some(kind);
    }
    let line =
        text.lines().map(str::trim).find(|line| !line.is_empty() && !line.starts_with('#'))?;
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
            (
                "// rig\n{}",
                "is not JSON, it looks like JSON with comments, which JSON does not have",
            ),
            ("hello", "is not JSON"),
            ("\u{1}\u{2}", "is not JSON"),
        ] {
            assert_eq!(not_json(text).as_deref(), Some(told), "{text:?}");
        }
        for json in ["{", " \n[1]", "", "1.5", "null", "\"a\""] {
            assert_eq!(not_json(json), None, "{json:?}");
        }
    }
}
