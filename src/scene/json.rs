//! From JSON text to a description; serde's messages turned into a place and plain words.

use serde::Deserialize;
use serde::de::DeserializeOwned;

use super::error::{Place, SceneError, nearest};

/// Reads `text` as a `T`, naming `file` in errors.
pub(crate) fn parse<T: DeserializeOwned>(text: &str, file: &str) -> Result<T, SceneError> {
    if text.trim_ascii().is_empty() {
        let (at, problem) = (Box::new(Place::top(file)), "the file is empty".to_owned());
        return Err(SceneError::Json { at, problem, line: 1, column: 1 });
    }
    let mut json = serde_json::Deserializer::from_str(text);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|e| {
        let path = e.path().to_string();
        explain(file, &path, &e.into_inner())
    })?;
    json.end().map_err(|e| explain(file, ".", &e))?;
    Ok(value)
}

/// Checks the version key alone, so that a file of a later version is not blamed for its keys.
pub(crate) fn check_version(text: &str, file: &str) -> Result<(), SceneError> {
    #[derive(Deserialize)]
    struct Version {
        sightline: Option<serde_json::Value>,
    }
    let version: Version = parse(text, file)?;
    let top = Place::top(file);
    match version.sightline {
        Some(v) if v == 1 => Ok(()),
        Some(v) => Err(SceneError::Version {
            at: Box::new(top.key("sightline")),
            found: format!("version {v} is unknown"),
        }),
        None => Err(SceneError::Version {
            at: Box::new(top),
            found: "the key `sightline` is missing".to_owned(),
        }),
    }
}

fn explain(file: &str, path: &str, error: &serde_json::Error) -> SceneError {
    let (line, column) = (error.line(), error.column());
    let full = error.to_string();
    let text = full.rsplit_once(" at line ").map_or(full.as_str(), |(text, _)| text);
    // Where serde did not get to a key, the path ends in a question mark.
    let path = path.trim_end_matches('?').trim_end_matches('.');
    let at = Box::new(Place { file: file.to_owned(), path: path.to_owned() });
    // Said of what follows the whole, and of a list with more items than were asked for.
    let text = match text {
        "trailing characters" if path.is_empty() => "something follows the end of the object",
        "trailing characters" => "the list is longer than it should be",
        other => other,
    };
    let unknown = text.strip_prefix("unknown field `").and_then(|rest| {
        // Without known keys serde writes "there are no fields"; no struct here is empty.
        rest.split_once("`, expected ")
    });
    let Some((key, expected)) = unknown else {
        return SceneError::Json { at, problem: plain_words(text), line, column };
    };
    let known: Vec<String> = expected.split('`').skip(1).step_by(2).map(str::to_owned).collect();
    // The path of an unknown key ends in the key itself; the message names it anyway.
    let parent = path.strip_suffix(key).map_or(path, |p| p.strip_suffix('.').unwrap_or(p));
    SceneError::UnknownKey {
        at: Box::new(Place { file: file.to_owned(), path: parent.to_owned() }),
        nearest: nearest(key, known.iter().map(String::as_str)),
        key: key.to_owned(),
        known,
        line,
        column,
    }
}

/// serde's words for Rust types, in the words of someone who writes JSON.
pub(crate) fn plain_words(text: &str) -> String {
    match text {
        "expected value" => {
            return "no value that JSON knows; numbers are finite, as 1.5".to_owned();
        }
        "number out of range" => {
            return "a number too large; write a finite one, as 1.5".to_owned();
        }
        _ => (),
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
