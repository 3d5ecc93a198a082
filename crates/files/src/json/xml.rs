//! Bounds of an XML text, checked in one pass before the XML library reads it.

/// Most attributes of one element: the library compares each with all before it.
const MAX_ATTRIBUTES: usize = 256;
/// Most declarations of namespaces: the library looks each up for every name.
const MAX_NAMESPACES: usize = 64;
/// Deepest element: readers recurse into elements.
const MAX_DEPTH: usize = 128;

/// Refuses constructs that an XML library takes more than linear time or stack for.
pub fn check_xml(text: &str) -> Result<(), String> {
    let (mut rest, mut depth, mut namespaces) = (text, 0_usize, 0);
    while let Some(at) = rest.find('<') {
        let line = || 1 + text[..text.len() - rest.len() + at].matches('\n').count();
        let tag = &rest[at..];
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">")];
        if let Some((start, end)) = skipped.iter().find(|(start, _)| tag.starts_with(start)) {
            let Some(to) = tag[start.len()..].find(end) else { return Ok(()) };
            rest = &tag[start.len() + to + end.len()..];
            continue;
        }
        let (inside, attributes) = tag_of(tag);
        if attributes > MAX_ATTRIBUTES {
            return Err(format!(
                "line {}: an element has {attributes} attributes, at most {MAX_ATTRIBUTES} are read; split the element",
                line()
            ));
        }
        namespaces += inside.matches("xmlns").count();
        if namespaces > MAX_NAMESPACES {
            return Err(format!(
                "line {}: more than {MAX_NAMESPACES} namespaces are declared; declare each once, at the root",
                line()
            ));
        }
        if tag.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if !inside.ends_with('/') {
            depth += 1;
        }
        if depth > MAX_DEPTH {
            return Err(format!(
                "line {}: elements are nested more than {MAX_DEPTH} deep; leave the nesting out",
                line()
            ));
        }
        rest = &tag[(inside.len() + 1).min(tag.len())..];
    }
    Ok(())
}

/// A tag without its closing bracket, and the number of its attributes.
fn tag_of(tag: &str) -> (&str, usize) {
    let (mut quote, mut attributes) = (None, 0);
    for (at, byte) in tag.bytes().enumerate() {
        match (quote, byte) {
            (Some(open), _) if byte == open => quote = None,
            (Some(_), _) => {}
            (None, b'"' | b'\'') => quote = Some(byte),
            (None, b'=') => attributes += 1,
            (None, b'>') => return (&tag[..at], attributes),
            _ => {}
        }
    }
    (tag, attributes)
}

#[cfg(test)]
mod tests {
    use super::*;

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
            let error = check_xml(&text).unwrap_err();
            assert!(error.contains(told), "{error}");
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
