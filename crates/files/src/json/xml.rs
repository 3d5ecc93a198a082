//! XML: names with prefixes, read as robot files mean them, and limits of a document.

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
    let mut changed: Vec<(usize, u8)> = Vec::new();
    let begin = text.len() - text.trim_start().len();
    if begin > 0 && text[begin..].starts_with("<?xml ") {
        let end = text[begin..].find("?>").map_or(begin, |end| begin + end + 2);
        let inside = (begin..end).filter(|at| text.is_char_boundary(*at));
        changed.extend(inside.map(|at| (at, b' ')));
    }
    let mut root: Option<&str> = None;
    for (start, tag, attributes) in parts(text) {
        if attributes.is_none() {
            let inside = tag.strip_prefix("!--").unwrap_or_default().bytes().enumerate();
            let hyphens = inside.filter(|(_, byte)| *byte == b'-');
            changed.extend(hyphens.map(|(k, _)| (start + "!--".len() + k, b' ')));
            continue;
        }
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

/// Constructs that are no tags: how they begin behind `<`, and how they end.
const NO_TAGS: [(&str, &str); 4] = [("!--", "-->"), ("![CDATA[", "]]>"), ("?", "?>"), ("!", ">")];

/// Everything behind a `<`, without its end: the place, the text, and the number of attributes of a tag. A tag at the end
/// of the text may lack its bracket.
fn parts(text: &str) -> impl Iterator<Item = (usize, &str, Option<usize>)> {
    let mut next = 0;
    std::iter::from_fn(move || {
        let at = next + text[next..].find('<')? + 1;
        let rest = &text[at..];
        if let Some((start, end)) = NO_TAGS.iter().find(|(start, _)| rest.starts_with(start)) {
            let length = start.len() + rest[start.len()..].find(end)?;
            next = at + length + end.len();
            return Some((at, &rest[..length], None));
        }
        let (mut quote, mut attributes) = (None, 0);
        let close = rest.bytes().position(|byte| {
            match quote {
                Some(open) => quote = quote.filter(|_| byte != open),
                None => {
                    attributes += usize::from(byte == b'=');
                    quote = Some(byte).filter(|byte| matches!(byte, b'"' | b'\''));
                    return byte == b'>';
                }
            }
            false
        });
        let tag = &rest[..close.unwrap_or(rest.len())];
        next = at + tag.len();
        Some((at, tag, Some(attributes)))
    })
}

/// Most attributes of one element: the library compares each with all before it.
const MAX_ATTRIBUTES: usize = 256;
/// Most declarations of namespaces: the library looks each up for every name.
const MAX_NAMESPACES: usize = 64;
/// Deepest element: readers recurse into elements.
const MAX_DEPTH: usize = 128;

/// Refuses constructs that an XML library takes more than linear time or stack for.
pub fn check_xml(text: &str) -> Result<(), String> {
    let (mut depth, mut namespaces) = (0_usize, 0);
    for (at, tag, attributes) in parts(text) {
        let Some(attributes) = attributes else { continue };
        let refused =
            |fault: String| Err(format!("line {}: {fault}", 1 + text[..at].matches('\n').count()));
        if attributes > MAX_ATTRIBUTES {
            return refused(format!(
                "an element has {attributes} attributes, at most {MAX_ATTRIBUTES} are read; split the element"
            ));
        }
        namespaces += tag.matches("xmlns").count();
        if namespaces > MAX_NAMESPACES {
            return refused(format!(
                "more than {MAX_NAMESPACES} namespaces are declared; declare each once, at the root"
            ));
        }
        if tag.starts_with('/') {
            depth = depth.saturating_sub(1);
        } else if !tag.ends_with('/') {
            depth += 1;
        }
        if depth > MAX_DEPTH {
            return refused(format!(
                "elements are nested more than {MAX_DEPTH} deep; leave the nesting out"
            ));
        }
    }
    Ok(())
}

/// Elements that readers find by the path of their names, where they stand elsewhere or have capitals, in words. The last two
/// names of each of `paths` tell which elements are meant, and `passed` the elements whose insides are not looked at.
pub fn misplaced(text: &str, paths: &[&[&str]], passed: &[&str]) -> Vec<String> {
    let (mut open, mut told): (Vec<&str>, Vec<String>) = (Vec::new(), Vec::new());
    let (mut line, mut counted) = (1, 0);
    for (at, tag, attributes) in parts(text) {
        if attributes.is_none() {
            continue;
        }
        if tag.starts_with('/') {
            open.pop();
            continue;
        }
        open.extend(tag.split(|c: char| c.is_whitespace() || c == '/').next());
        let is_meant = |path: &[&str]| {
            let end = &path[path.len().saturating_sub(2)..];
            let own = open.iter().rev().take(end.len()).rev();
            own.len() == end.len() && own.zip(end).all(|(own, name)| own.eq_ignore_ascii_case(name))
        };
        let path = paths.iter().find(|path| is_meant(path));
        let is_inside = open.iter().any(|name| passed.contains(name));
        if let Some(path) = path.filter(|path| !is_inside && !open.ends_with(path)) {
            let shown = |names: &[&str]| format!("<{}>", names.join(">/<"));
            let own = &open[open.len().saturating_sub(path.len())..];
            line += text[counted..at].matches('\n').count();
            counted = at;
            told.push(format!("line {line}: {}, in place of {},", shown(own), shown(path)));
        }
        if tag.ends_with('/') {
            open.pop();
        }
    }
    told
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
    use super::{check_xml, misplaced, plain_names};

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

    #[test]
    fn elements_at_another_place_or_in_capitals_are_told() {
        let paths: &[&[&str]] = &[&["robot", "joint", "parent"], &["link", "pose"]];
        let told = |text: &str| misplaced(text, paths, &["gazebo"]).join(" ");
        for (text, wanted) in [
            ("<robot><joint><parent a='>'/></joint><link><pose/></link></robot>", ""),
            ("<robot><!-- <group><joint><parent/> --><sensor><parent/></sensor></robot>", ""),
            ("<robot><gazebo><joint><parent/></joint></gazebo></robot>", ""),
            ("<robot><joint><![CDATA[<Parent/>]]></joint></robot>", ""),
            (
                "<robot>\n<group>\n<joint><parent/></joint></group></robot>",
                "line 3: <group>/<joint>/<parent>, in place of <robot>/<joint>/<parent>,",
            ),
            (
                "<robot><Joint><parent/></Joint></robot>",
                "line 1: <robot>/<Joint>/<parent>, in place",
            ),
            ("<Link a='/'>\n<pose/></Link>", "line 2: <Link>/<pose>, in place of <link>/<pose>,"),
            ("<link><Pose>0</Pose></link>", "line 1: <link>/<Pose>, in place of <link>/<pose>,"),
        ] {
            assert!(told(text).starts_with(wanted), "{text}: {}", told(text));
            assert_eq!(told(text).is_empty(), wanted.is_empty(), "{text}");
        }
    }

    #[test]
    fn many_attributes_namespaces_and_levels_are_refused_with_their_line() {
        let attributes: String = (0..60_000).map(|k| format!(" a{k}='='")).collect();
        let namespaces: String =
            (0..70).map(|k| format!("<a xmlns:n{k}='u'>")).collect::<Vec<_>>().join("\n");
        for (text, told) in [
            (format!("<a>\n<b{attributes}/></a>"), "line 2: an element has 60000 attributes"),
            (namespaces, "line 65: more than 64 namespaces"),
            ("<a>".repeat(5000), "nested more than 128 deep"),
        ] {
            assert_holds!(check_xml(&text).unwrap_err(), told);
        }
    }

    #[test]
    fn signs_in_values_comments_and_data_count_nothing() {
        let equals = "=".repeat(300);
        let text = format!(
            "<?x {equals}?><!-- <a {equals} --><a b='{equals}>' c=\"'\"><![CDATA[<b {equals}>]]></a>"
        );
        assert_eq!(check_xml(&text), Ok(()));
        assert_eq!(check_xml("<a b='"), Ok(()));
        assert_eq!(check_xml(&"<a></a><b/>".repeat(500)), Ok(()));
    }
}
