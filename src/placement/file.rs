use std::collections::HashSet;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{Placement, PlacementError};

/// Longest line of a `.jsonl` file, in bytes: 16 LiDARs need far less.
const MAX_LINE: u64 = 1 << 20;
/// Largest document that is read at once, in bytes: some million placements.
const MAX_DOCUMENT: u64 = 1 << 30;

/// Why placements could not be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be opened or read.
    #[error("{}: {source}", path.display())]
    Io {
        /// File.
        path: PathBuf,
        /// From the operating system.
        source: std::io::Error,
    },
    /// Not JSON, or not of the form of a placement.
    #[error("{}{}{}: {source}", path.display(), at_line(*line), in_placement(near))]
    Json {
        /// File.
        path: PathBuf,
        /// Line of a `.jsonl` file, from 1.
        line: Option<u64>,
        /// Name of the placement that is being read, as far as the text tells.
        near: Option<String>,
        /// Where and why.
        source: serde_json::Error,
    },
    /// A placement that cannot be used.
    #[error("{}{}: {source}", path.display(), at_line(*line))]
    Placement {
        /// File.
        path: PathBuf,
        /// Line of a `.jsonl` file, from 1.
        line: Option<u64>,
        /// Which and why.
        source: PlacementError,
    },
    /// A line too long to be a placement.
    #[error("{}, line {line}: longer than {MAX_LINE} bytes; give one placement a line", path.display())]
    LongLine {
        /// File.
        path: PathBuf,
        /// From 1.
        line: u64,
    },
    /// A document too large to be held.
    #[error(
        "{}: larger than {MAX_DOCUMENT} bytes; give one placement a line in a .jsonl file, which is \
         read as a stream",
        path.display()
    )]
    TooLarge {
        /// File.
        path: PathBuf,
    },
    /// A file without placements.
    #[error("{}: holds no placement; add at least one", path.display())]
    Empty {
        /// File.
        path: PathBuf,
    },
}

fn at_line(line: Option<u64>) -> String {
    line.map(|l| format!(", line {l}")).unwrap_or_default()
}

fn in_placement(name: &Option<String>) -> String {
    name.as_ref().map(|n| format!(", placement `{n}`")).unwrap_or_default()
}

/// The last name given before a line and column of a text, or else the first one in it: a text with
/// NaN in it is no JSON, but its user still wants to know where.
fn name_near(text: &str, line: usize, column: usize) -> Option<String> {
    let before: usize =
        text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum::<usize>()
            + column;
    let value = |at: usize| {
        let rest = text[at..].strip_prefix("\"name\"")?.trim_start().strip_prefix(':')?;
        let name = rest.trim_start().strip_prefix('"')?.split('"').next()?;
        Some(name.chars().take(64).collect())
    };
    let mut names = text.match_indices("\"name\"").map(|(at, _)| at).peekable();
    let first = names.peek().copied();
    names.take_while(|&at| at < before).last().or(first).and_then(value)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlacementFile {
    placements: Vec<Placement>,
}

/// Placements of a file one by one, each checked, in order.
///
/// `.jsonl` is read a line at a time and holds no more than one placement in memory; anything else is
/// read as one JSON document `{"placements": […]}`.
pub struct PlacementReader {
    path: PathBuf,
    source: Source,
    names: HashSet<String>,
}

enum Source {
    Whole(std::vec::IntoIter<Placement>),
    Lines { reader: BufReader<File>, line: u64 },
}

impl PlacementReader {
    /// Opens a file; a JSON document is parsed here, a `.jsonl` file while it is read.
    ///
    /// # Errors
    /// The file cannot be opened, or is no JSON of the expected form.
    pub fn open(path: &Path) -> Result<Self, ReadError> {
        let io = |source| ReadError::Io { path: path.to_owned(), source };
        let file = File::open(path).map_err(io)?;
        let source = if path.extension().is_some_and(|e| e == "jsonl") {
            Source::Lines { reader: BufReader::new(file), line: 0 }
        } else {
            let mut text = String::new();
            BufReader::new(file).take(MAX_DOCUMENT + 1).read_to_string(&mut text).map_err(io)?;
            if text.len() as u64 > MAX_DOCUMENT {
                return Err(ReadError::TooLarge { path: path.to_owned() });
            }
            let parsed: PlacementFile = serde_json::from_str(&text).map_err(|source| {
                let near = name_near(&text, source.line(), source.column());
                ReadError::Json { path: path.to_owned(), line: None, near, source }
            })?;
            Source::Whole(parsed.placements.into_iter())
        };
        Ok(Self { path: path.to_owned(), source, names: HashSet::new() })
    }

    fn next_placement(&mut self) -> Option<Result<Placement, ReadError>> {
        let (placement, line) = match &mut self.source {
            Source::Whole(rest) => (rest.next()?, None),
            Source::Lines { reader, line } => match next_line(reader, line, &self.path)? {
                Ok(placement) => (placement, Some(*line)),
                Err(error) => return Some(Err(error)),
            },
        };
        let checked = placement.validate().and_then(|()| {
            if self.names.insert(placement.name.clone()) {
                Ok(())
            } else {
                Err(PlacementError::UsedTwice { name: placement.name.clone() })
            }
        });
        Some(match checked {
            Ok(()) => Ok(placement),
            Err(source) => Err(ReadError::Placement { path: self.path.clone(), line, source }),
        })
    }
}

fn next_line(
    reader: &mut BufReader<File>,
    line: &mut u64,
    path: &Path,
) -> Option<Result<Placement, ReadError>> {
    let mut bytes = Vec::new();
    loop {
        bytes.clear();
        match reader.by_ref().take(MAX_LINE + 1).read_until(b'\n', &mut bytes) {
            Err(source) => return Some(Err(ReadError::Io { path: path.to_owned(), source })),
            Ok(0) => return None,
            Ok(_) => *line += 1,
        }
        if bytes.len() as u64 > MAX_LINE {
            return Some(Err(ReadError::LongLine { path: path.to_owned(), line: *line }));
        }
        if !bytes.trim_ascii().is_empty() {
            return Some(serde_json::from_slice(&bytes).map_err(|source| ReadError::Json {
                path: path.to_owned(),
                line: Some(*line),
                near: name_near(&String::from_utf8_lossy(&bytes), source.line(), source.column()),
                source,
            }));
        }
    }
}

impl Iterator for PlacementReader {
    type Item = Result<Placement, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_placement()
    }
}

/// All placements of a file at once.
///
/// # Errors
/// As [`PlacementReader`], and a file without any placement.
pub fn read_placements(path: &Path) -> Result<Vec<Placement>, ReadError> {
    let placements = PlacementReader::open(path)?.collect::<Result<Vec<_>, _>>()?;
    if placements.is_empty() {
        return Err(ReadError::Empty { path: path.to_owned() });
    }
    Ok(placements)
}
