//! Why a rig or a data set cannot be read or written.

use std::path::PathBuf;

use sightline_files::files::FileError;
use sightline_files::json::{DescriptionError, Location, YamlDocument, quoted};
use sightline_scene::psog::PsogError;
use sightline_scene::vehicle::{SensorError, UnknownSensor};

/// Why a rig or a data set cannot be read or written; each message is one sentence with the file, the place and the mend.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the message tells the fields")]
pub enum FormatError {
    Description(#[from] DescriptionError),
    File(#[from] FileError),
    Sensor(#[from] SensorError),
    UnknownSensor(#[from] UnknownSensor),
    Psog(#[from] PsogError),
    #[error("{}: cannot be read: {source}; give a folder that holds all files of its set", path.display())]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}: the table is missing ({source}); give a folder that holds the version's tables, samples and lidarseg", path.display())]
    Table {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{file}: no frame is called `{frame}`; there are {}", listed(known))]
    UnknownFrame {
        file: String,
        frame: String,
        known: Vec<String>,
    },
    /// A value or key in a rig's file, by its JSON path; the sentence names it, too.
    #[error("{told}")]
    At {
        path: String,
        told: String,
    },
    /// Any other file, frame, class or setting; the sentence names it and the mend.
    #[error("{0}")]
    Refused(String),
}

pub(crate) type Checked<T> = Result<T, FormatError>;

/// A [`FormatError::Refused`] of a format string and its values.
macro_rules! refused {
    ($($sentence:tt)*) => { $crate::FormatError::Refused(format!($($sentence)*)) };
}

impl FormatError {
    /// Fault of the value or key at a place.
    pub(crate) fn at(at: &Location, fault: &str) -> Self {
        Self::At { path: at.path.clone(), told: format!("{at}: {fault}") }
    }

    /// The fault with the line of its place in a document.
    pub(crate) fn at_line(self, document: &YamlDocument) -> Self {
        let Self::At { path, told } = self else { return self };
        let (line, column) = document.line_of(&path);
        refused!("{told} (line {line}, column {column})")
    }
}

const MOST_LISTED: usize = 24;

/// Names in words, as many as a reader takes in.
pub(crate) fn listed(names: &[String]) -> String {
    if names.is_empty() {
        return "none".to_owned();
    }
    let more = names.len().saturating_sub(MOST_LISTED);
    let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
    quoted(names.iter().take(MOST_LISTED)) + &rest
}
