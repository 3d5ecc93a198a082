//! XML names with prefixes, read as robot files mean them.

use std::borrow::Cow;
use std::collections::HashMap;

/// Prefix of macros: a file that has them is no robot yet, and its reader says so.
const XACRO: &str = "xacro";
/// Sign in place of the colon: valid in a name, and as long, so that places in the text stay.
const DOT: u8 = b'.';

/// True for the name of an element or attribute that has no prefix, in a text of [`plain_names`].
pub fn has_no_prefix(name: &str) -> bool {
    !name.bytes().any(|byte| byte == DOT)
}

/// The text with `.` for the colon in names of elements with a prefix, and of attributes with an undeclared one.
///
/// Robot files use prefixes without declaring them, which XML parsers refuse. Simulators read such names as plain
/// words: `<drake:joint>` is no `<joint>`. Elements of the root's own prefix and of xacro keep theirs.
/// Two hyphens in a comment, and space before the declaration, are read as they read them, too.
pub fn plain_names(text: &str) -> Cow<'_, str> {
    let declared = declared(text);
    let mut changed: Vec<(usize, u8)> = odd_places(text).map(|at| (at, b' ')).collect();
    let mut root: Option<&str> = None;
    for (start, tag) in tags(text) {
        let from = usize::from(tag.starts_with('/'));
        for (k, (at, name)) in names(tag, from).into_iter().enumerate() {
            let Some((prefix, _)) = name.split_once(':') else {
                root.get_or_insert("");
                continue;
            };
            let is_known = declared.contains_key(prefix) || ["xmlns", "xml"].contains(&prefix);
            let is_macro = prefix == XACRO || declared.get(prefix).is_some_and(|known| *known);
            let stays = match k {
                0 => *root.get_or_insert(prefix) == prefix && is_known || is_macro,
                _ => is_known || is_macro,
            };
            if !stays {
                let all = name.bytes().enumerate().filter(|(_, byte)| *byte == b':');
                changed.extend(all.map(|(colon, _)| (start + at + colon, DOT)));
            }
        }
    }
    if changed.is_empty() {
        return Cow::Borrowed(text);
    }
    let mut bytes = text.as_bytes().to_vec();
    changed.into_iter().for_each(|(at, byte)| bytes[at] = byte);
    String::from_utf8(bytes).map_or(Cow::Borrowed(text), Cow::Owned)
}

/// Hyphens inside comments, and a declaration behind white space: bytes that may be spaces.
fn odd_places(text: &str) -> impl Iterator<Item = usize> {
    let mut places = Vec::new();
    let start = text.len() - text.trim_start().len();
    if start > 0 && text[start..].starts_with("<?xml ") {
        let end = text[start..].find("?>").map_or(start, |end| start + end + 2);
        places.extend((start..end).filter(|at| text.is_char_boundary(*at)));
    }
    let mut at = 0;
    while let Some(open) = text[at..].find('<') {
        at += open;
        let Some((skipped, end)) = [("<!--", "-->"), ("<![CDATA[", "]]>")]
            .into_iter()
            .find(|(start, _)| text[at..].starts_with(start))
        else {
            at += 1;
            continue;
        };
        let from = at + skipped.len();
        let Some(length) = text[from..].find(end) else { break };
        let hyphens = text[from..from + length].bytes().enumerate();
        if skipped == "<!--" {
            places.extend(hyphens.filter(|(_, byte)| *byte == b'-').map(|(k, _)| from + k));
        }
        at = from + length + end.len();
    }
    places.into_iter()
}

/// Prefixes that the text declares anywhere, and whether each is one of xacro.
fn declared(text: &str) -> HashMap<&str, bool> {
    let after = text.split("xmlns:").skip(1);
    let one = |rest: &'_ str| -> Option<(usize, bool)> {
        let end = rest.find(|c: char| c == '=' || c.is_whitespace())?;
        let uri = rest[end..].split(['"', '\'']).nth(1).unwrap_or_default();
        Some((end, uri.contains(XACRO)))
    };
    after.filter_map(|rest| one(rest).map(|(end, is_macro)| (&rest[..end], is_macro))).collect()
}

/// Tags and their places behind `<`, without comments, data, instructions and declarations.
fn tags(text: &str) -> Vec<(usize, &str)> {
    let (mut tags, mut at) = (Vec::new(), 0);
    while let Some(open) = text[at..].find('<') {
        at += open + 1;
        let rest = &text[at..];
        let skipped = [("!--", "-->"), ("![CDATA[", "]]>"), ("?", "?>"), ("!", ">")];
        if let Some((start, end)) = skipped.iter().find(|(start, _)| rest.starts_with(start)) {
            let Some(to) = rest[start.len()..].find(end) else { break };
            at += start.len() + to + end.len();
            continue;
        }
        let mut quote = None;
        let close = rest.bytes().position(|byte| match quote {
            Some(open) => {
                quote = quote.filter(|_| byte != open);
                false
            }
            None => {
                quote = Some(byte).filter(|byte| matches!(byte, b'"' | b'\''));
                byte == b'>'
            }
        });
        let Some(close) = close else { break };
        tags.push((at, &rest[..close]));
        at += close;
    }
    tags
}

/// Names of an element and of its attributes, with their places in the tag.
fn names(tag: &str, from: usize) -> Vec<(usize, &str)> {
    let (mut names, mut start, mut quote) = (Vec::new(), Some(from), None);
    for (at, byte) in tag.bytes().enumerate().skip(from) {
        let ends = matches!(byte, b'=' | b'/' | b'"' | b'\'') || byte.is_ascii_whitespace();
        match quote {
            Some(open) => quote = quote.filter(|_| byte != open),
            None => {
                if let Some(from) = start.take_if(|_| ends) {
                    names.push((from, &tag[from..at]));
                } else if start.is_none() && !ends {
                    start = Some(at);
                }
                quote = Some(byte).filter(|byte| matches!(byte, b'"' | b'\''));
            }
        }
    }
    names.extend(start.map(|from| (from, &tag[from..])));
    names
}

#[cfg(test)]
mod tests {
    use super::plain_names;

    #[test]
    fn undeclared_prefixes_become_part_of_the_name() {
        let cases = [
            ("<r><drake:joint name='a:b'/></r>", "<r><drake.joint name='a:b'/></r>"),
            (
                "<r><a:b c:d = \"x:y>\" e='1'>t:u</a:b></r>",
                "<r><a.b c.d = \"x:y>\" e='1'>t:u</a.b></r>",
            ),
            ("<r xmlns:a='u'><a:b a:c='' d:e=''/></r>", "<r xmlns:a='u'><a.b a:c='' d.e=''/></r>"),
            ("<r a='-- <'><!-- a -- b ---></r>", "<r a='-- <'><!-- a    b  --></r>"),
            ("<r><gz::s a::b=''/></r>", "<r><gz..s a..b=''/></r>"),
            ("\n<?xml version='1'?><r/>", "\n                   <r/>"),
            ("<!-- <a:b> --><r><![CDATA[<a:b>]]></r>", "<!-- <a:b> --><r><![CDATA[<a:b>]]></r>"),
            ("<s:r xmlns:s='u'><s:b/></s:r>", "<s:r xmlns:s='u'><s:b/></s:r>"),
            (
                "<r xmlns:x='http://xacro'><x:if/><xacro:if/></r>",
                "<r xmlns:x='http://xacro'><x:if/><xacro:if/></r>",
            ),
            ("<r><é:b/></r><", "<r><é.b/></r><"),
        ];
        for (text, wanted) in cases {
            assert_eq!(plain_names(text), wanted);
        }
    }
}
