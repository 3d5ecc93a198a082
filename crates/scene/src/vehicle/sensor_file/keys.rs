//! Parts of a sensor's JSON or YAML: keys that no reader knows, and answers that are an error's text.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, Visitor};

use sightline_files::Note;
use sightline_files::json::Place;

/// Unknown keys of a struct (`#[serde(flatten)]`); their values are not kept.
pub(super) type Rest = BTreeMap<Key, IgnoredAny>;

/// The start of a key: YAML repeats a long one by an alias of two letters.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key(String);

impl<'de> Deserialize<'de> for Key {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Start;
        impl Visitor<'_> for Start {
            type Value = Key;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a key")
            }

            fn visit_str<E>(self, text: &str) -> Result<Key, E> {
                Ok(Key(text.chars().take(LONGEST + 1).collect()))
            }
        }
        deserializer.deserialize_str(Start)
    }
}

impl AsRef<str> for Key {
    fn as_ref(&self) -> &str {
        &self.0
    }
}

/// Keys that are passed over, with blanks between them, and why.
pub(super) type Passed = &'static [(&'static str, &'static str)];

/// Most unknown keys that a note names.
const MOST_NAMED: usize = 8;
/// Longest name of a key in a note, in characters.
const LONGEST: usize = 40;

/// The keys of `rest` that `passed` does not list.
pub(super) fn unknown(at: &Place, rest: &Rest, passed: Passed) -> Option<Note> {
    let is_passed = |Key(key): &Key| {
        let comment = key.trim_start_matches('_').to_ascii_lowercase().starts_with("comment");
        comment || passed.iter().any(|(keys, _)| keys.split(' ').any(|known| known == key))
    };
    let unknown: Vec<&Key> = rest.keys().filter(|key| !is_passed(key)).collect();
    unread(at, &unknown)
}

/// A note on names that are not known here, keys or titles of columns.
pub(super) fn unread<S: AsRef<str>>(at: &Place, names: &[S]) -> Option<Note> {
    let short =
        |name: &S| format!("`{}`", name.as_ref().escape_debug().take(LONGEST).collect::<String>());
    let named: Vec<String> = names.iter().take(MOST_NAMED).map(short).collect();
    let more = match names.len().saturating_sub(MOST_NAMED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    let text = format!("{at}: {}{more}: not known here, and not read.", named.join(", "));
    (!names.is_empty()).then(|| Note::fact(text))
}

/// A part of metadata: an object, or the text that a sensor answers to a question it does not know.
#[derive(Debug)]
pub(super) enum Answer<T> {
    /// The part.
    Read(T),
    /// The text in its place.
    Text(String),
}

impl<T> Answer<T> {
    /// The part; a text in its place becomes a note.
    pub(super) fn or_note(self, at: &Place, notes: &mut Vec<Note>) -> Option<T> {
        match self {
            Self::Read(part) => Some(part),
            Self::Text(text) => {
                let text = super::pattern::quoted(&text);
                notes.push(Note::fact(format!(
                    "{at}: the text {text} stands in its place; not read."
                )));
                None
            }
        }
    }
}

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Answer<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Part<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for Part<T> {
            type Value = Answer<T>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a map")
            }

            fn visit_str<E>(self, text: &str) -> Result<Answer<T>, E> {
                Ok(Answer::Text(text.to_owned()))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Answer<T>, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Answer::Read)
            }
        }
        deserializer.deserialize_any(Part(PhantomData))
    }
}
