//! Reading of YAML descriptions, with limits: the parser takes time with the square of open brackets.

use serde::de::DeserializeOwned;
use serde_json::{Number, Value};
use serde_yaml_ng::Value as Yaml;

use super::{DescriptionError, Place, plain_words};

/// Most bytes of a YAML file; those of vendors have 40 000.
const MAX_YAML: usize = 1 << 20;
/// Most opening brackets of a YAML file; those of vendors have one for each of 128 lasers.
const MAX_BRACKETS: usize = 1024;

/// Reads `text` as a `T`, naming `file` in errors.
pub(crate) fn parse_yaml<T: DeserializeOwned>(
    text: &str,
    file: &str,
) -> Result<T, DescriptionError> {
    let too_many = |what, count: usize, limit: usize, mend| DescriptionError::TooMany {
        at: Box::new(Place::top(file)),
        what,
        count: count as u64,
        limit: limit as u64,
        mend,
    };
    if text.len() > MAX_YAML {
        return Err(too_many("bytes of YAML", text.len(), MAX_YAML, "split or simplify the file"));
    }
    let brackets = text.bytes().filter(|b| b"[{".contains(b)).count();
    if brackets > MAX_BRACKETS {
        let mend = "write lists and objects on lines of their own";
        return Err(too_many("brackets `[` and `{` of YAML", brackets, MAX_BRACKETS, mend));
    }
    let yaml = serde_yaml_ng::Deserializer::from_str(text);
    serde_path_to_error::deserialize(yaml).map_err(|error| {
        let path = error.path().to_string();
        let path = if path == "." { String::new() } else { path };
        let error = error.into_inner();
        let (line, column) = error.location().map_or((1, 1), |at| (at.line(), at.column()));
        let full = error.to_string();
        // The parser writes the path in front and the place behind.
        let text = full.strip_prefix(&format!("{path}: ")).unwrap_or(&full);
        let text = text.split(" at line ").next().unwrap_or(text);
        let at = Box::new(Place { file: file.to_owned(), path });
        DescriptionError::Json { at, problem: plain_words(text), line, column }
    })
}

/// Reads `text` as JSON: numbers that are not finite become texts, keys that are no texts are written out.
pub(crate) fn yaml_as_json(text: &str, file: &str) -> Result<Value, DescriptionError> {
    parse_yaml(text, file).map(json)
}

fn json(yaml: Yaml) -> Value {
    match yaml {
        Yaml::Null => Value::Null,
        Yaml::Bool(value) => Value::Bool(value),
        Yaml::String(value) => Value::String(value),
        Yaml::Number(value) => {
            let number = value.as_f64().and_then(Number::from_f64);
            number.map_or_else(|| Value::String(value.to_string()), Value::Number)
        }
        Yaml::Sequence(values) => Value::Array(values.into_iter().map(json).collect()),
        Yaml::Tagged(tagged) => json(tagged.value),
        Yaml::Mapping(map) => {
            let key = |key: Yaml| match json(key) {
                Value::String(text) => text,
                other => other.to_string(),
            };
            Value::Object(map.into_iter().map(|(k, v)| (key(k), json(v))).collect())
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::{Duration, Instant};

    use serde::Deserialize;

    use super::*;

    #[derive(Debug, Deserialize)]
    struct File {
        lasers: Vec<Laser>,
    }

    #[derive(Debug, Deserialize)]
    struct Laser {
        angle: f64,
    }

    #[test]
    fn flow_and_block_are_read_and_errors_say_where() {
        let block: File = parse_yaml("lasers:\n- angle: 1\n- {angle: -2.5}\n", "f").unwrap();
        assert_eq!((block.lasers[0].angle, block.lasers[1].angle), (1.0, -2.5));
        let error = parse_yaml::<File>("lasers:\n- angle: 1\n- angle: up\n", "f").unwrap_err();
        assert_eq!(
            error.to_string(),
            "f: lasers[1].angle: string \"up\" stands where a number belongs (line 3, column 10)"
        );
    }

    /// Without the limits these take minutes.
    #[test]
    fn hostile_text_ends_soon() {
        let bomb: String = (1..40).fold("a0: &a0 [x]\n".to_owned(), |text, k| {
            format!("{text}a{k}: &a{k} [{}]\n", vec![format!("*a{}", k - 1); 20].join(","))
        });
        let many = |unit: &str| unit.repeat(MAX_YAML / unit.len());
        let texts = [many("["), many("{a: "), many("- "), many("? "), many("&a "), bomb];
        let begin = Instant::now();
        for text in &texts {
            parse_yaml::<File>(text, "f").unwrap_err();
            // What is not asked for may be skipped, but not in minutes.
            let _ = parse_yaml::<File>(&format!("lasers: []\nmore:\n  {text}"), "f");
        }
        assert!(begin.elapsed() < Duration::from_secs(20), "{:?}", begin.elapsed());
    }
}
