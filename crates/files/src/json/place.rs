//! A place in a JSON file.

use std::fmt;

/// Place of a value: the file and the JSON path inside it.
///
/// Prints as `scenes/x.json: static[3].box.size[1]`, and as the file alone at the top level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it.
    pub file: String,
    /// JSON path from the top of the file; empty at the top level.
    pub path: String,
}

impl Place {
    /// The top level of `file`.
    pub fn top(file: &str) -> Self {
        Self { file: file.to_owned(), path: String::new() }
    }

    /// The value under `key` of the object here.
    pub fn key(&self, key: &str) -> Self {
        let dot = if self.path.is_empty() { "" } else { "." };
        Self { file: self.file.clone(), path: format!("{}{dot}{key}", self.path) }
    }

    /// Item `i` of the list here, counted from 0.
    pub fn item(&self, i: usize) -> Self {
        Self { file: self.file.clone(), path: format!("{}[{i}]", self.path) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if !self.path.is_empty() {
            write!(f, ": {}", self.path)?;
        }
        Ok(())
    }
}
