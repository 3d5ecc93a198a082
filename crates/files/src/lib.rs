//! Files: written whole, guarded against overwriting, read within bounds; JSON, YAML and NumPy in them; sentences about
//! an input ([`Note`]).
//!
//! | module | holds |
//! |---|---|
//! | [`csv`] | tables as CSV |
//! | [`files`] | one guard of inputs and outputs, whole files, folders of runs |
//! | [`json`] | JSON and YAML whose errors name the place, the nearest known key, and the mend |
//! | [`npy`] | headers of NumPy arrays |

#![cfg_attr(test, allow(clippy::disallowed_methods))]

/// Asserts in a test that a text holds parts. A failure shows the text.
#[doc(hidden)]
#[macro_export]
macro_rules! assert_holds {
    ($text:expr, $($part:expr),+) => {{
        let text = $text.to_string();
        $(assert!(text.contains($part), "{text}\n  lacks {}", $part);)+
    }};
}

/// Asserts in a test that a text begins with a part. A failure shows the text.
#[doc(hidden)]
#[macro_export]
macro_rules! assert_begins {
    ($text:expr, $part:expr) => {{
        let text = $text.to_string();
        assert!(text.starts_with($part), "{text}\n  does not begin with {}", $part);
    }};
}

/// Asserts in a test that a text ends with a part. A failure shows the text.
#[doc(hidden)]
#[macro_export]
macro_rules! assert_ends {
    ($text:expr, $part:expr) => {{
        let text = $text.to_string();
        assert!(text.ends_with($part), "{text}\n  does not end with {}", $part);
    }};
}

pub mod csv;
pub mod files;
pub mod json;
pub mod npy;

use std::fmt;

use serde::Serialize;

/// A sentence about an input: the file, the place in it, and a remedy.
///
/// JSON has the sentence alone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Note {
    text: String,
    #[serde(skip)]
    is_doubt: bool,
}

impl Note {
    /// A fact that changes no number: a part of a file that was passed over, a default that was taken.
    pub fn fact(text: impl Into<String>) -> Self {
        Self { text: text.into(), is_doubt: false }
    }

    /// A likely mistake in the input, such as millimetres in place of metres. `--strict` turns it into an error.
    pub fn doubt(text: impl Into<String>) -> Self {
        Self { text: text.into(), is_doubt: true }
    }

    /// The sentence.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// True if the input is likely a slip of its author.
    pub fn is_doubt(&self) -> bool {
        self.is_doubt
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
