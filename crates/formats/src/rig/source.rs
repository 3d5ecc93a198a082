//! Files of a rig as texts, read and to be written.

use std::path::{Path, PathBuf};

use super::RigError;
use super::fields::PHASE;
use sightline_files::json::{
    DescriptionError, Document, Place, Quantity, parse_documents, parse_yaml, read_limited,
};

/// Largest file in bytes: robots with many links have hundreds of kilobytes.
const MAX_FILE: u64 = 16 << 20;
/// Endings that a folder of a rig is searched for.
const ENDINGS: [&str; 2] = ["yaml", "yml"];

/// A text and the name that its file usually has.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedText {
    /// Name of the file.
    pub name: String,
    /// Its text.
    pub text: String,
}

/// A text and the file that it is from.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// File as the user named it.
    pub file: String,
    /// Its text, without a byte order mark.
    pub text: String,
}

impl Source {
    /// Reads a file.
    ///
    /// # Errors
    /// The file cannot be read, is too large, or is no UTF-8.
    pub fn read(path: &Path) -> Result<Self, RigError> {
        let file = path.display().to_string();
        let bytes = read_limited(path, MAX_FILE)?;
        let text = String::from_utf8(bytes).map_err(|error| RigError::Syntax {
            at: Box::new(Place::top(&file)),
            what: "UTF-8 text",
            problem: format!("byte {} is of another encoding", error.utf8_error().valid_up_to()),
        })?;
        let text = text.strip_prefix('\u{feff}').map(str::to_owned).unwrap_or(text);
        Ok(Self { file, text })
    }

    /// The text as one YAML document; JSON is YAML, too.
    pub(super) fn yaml(&self) -> Result<Document, RigError> {
        Ok(parse_yaml(&self.text, &self.file, quantity)?)
    }

    /// All documents of a YAML text that are not empty.
    pub(super) fn documents(&self) -> Result<Vec<Document>, RigError> {
        Ok(parse_documents(&self.text, &self.file, quantity)?)
    }
}

/// Quantity under a key of a pose, as all YAML of rigs names them.
fn quantity(parent: &str, key: &str) -> Option<Quantity> {
    match (parent, key) {
        ("rotation", "x" | "y" | "z" | "w") => Some(Quantity::Bare),
        (_, "x" | "y" | "z") => Some(Quantity::Length),
        (_, "roll" | "pitch" | "yaw" | PHASE) => Some(Quantity::Angle),
        _ => None,
    }
}

/// Reads files; a folder stands for the YAML files in it, as Autoware's pair lies in one.
///
/// # Errors
/// A file or folder that cannot be read.
pub fn sources(paths: &[PathBuf]) -> Result<Vec<Source>, RigError> {
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let fail = |source| DescriptionError::Read { file: path.clone(), source };
        let mut inside = Vec::new();
        for entry in std::fs::read_dir(path).map_err(fail)? {
            let file = entry.map_err(fail)?.path();
            let ending = file.extension().and_then(|ending| ending.to_str());
            if ending.is_some_and(|ending| ENDINGS.contains(&ending)) {
                inside.push(file);
            }
        }
        if inside.is_empty() {
            return Err(fail(std::io::Error::other("is a folder without .yaml files")).into());
        }
        inside.sort();
        files.extend(inside);
    }
    files.iter().map(|file| Source::read(file)).collect()
}
