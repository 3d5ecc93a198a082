use std::fmt;
use std::path::{Path, PathBuf};

/// Where in a scene file something stands: the file and the JSON path inside it.
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
    pub(crate) fn top(file: &str) -> Self {
        Self { file: file.to_owned(), path: String::new() }
    }

    /// The value under `key` of the object here.
    pub(crate) fn key(&self, key: &str) -> Self {
        let dot = if self.path.is_empty() { "" } else { "." };
        Self { file: self.file.clone(), path: format!("{}{dot}{key}", self.path) }
    }

    /// Item `i` of the list here, counted from 0.
    pub(crate) fn item(&self, i: usize) -> Self {
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

/// Why a scene could not be read.
///
/// Every message is one sentence with the file, the place in it, the value and the mend.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file could not be opened or read.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is larger than this program reads.
    #[error("{file}: is larger than the limit of {limit} bytes; split or simplify it")]
    TooLarge {
        /// The file.
        file: PathBuf,
        /// Largest size in bytes.
        limit: u64,
    },
    /// The text is not JSON, or a value has the wrong JSON type.
    #[error("{at}: {problem} (line {line}, column {column})")]
    Json {
        /// Where.
        at: Box<Place>,
        /// What is wrong there.
        problem: String,
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
    },
    /// A key that no scene has at this place.
    #[error(
        "{at}: unknown key `{key}`{} (line {line}, column {column})",
        did_you_mean(.nearest, .known)
    )]
    UnknownKey {
        /// The object that holds the key.
        at: Box<Place>,
        /// The key as written.
        key: String,
        /// The known key that it resembles most, if any does.
        nearest: Option<String>,
        /// Every key known at this place.
        known: Vec<String>,
        /// Line, counted from 1.
        line: usize,
        /// Column, counted from 1.
        column: usize,
    },
    /// The file is of another version, or no scene file.
    #[error("{at}: {found}; this program reads version 1, write `\"sightline\": 1`")]
    Version {
        /// Where.
        at: Box<Place>,
        /// What stands there instead.
        found: String,
    },
    /// A number, name or list outside of what is allowed there.
    #[error("{at}: {value} is not {wanted}")]
    Value {
        /// Where.
        at: Box<Place>,
        /// The value as written.
        value: String,
        /// What would be allowed.
        wanted: String,
    },
    /// Something that is required is not there.
    #[error("{at}: `{key}` is missing: {mend}")]
    Missing {
        /// The object that lacks it.
        at: Box<Place>,
        /// The key that is missing.
        key: &'static str,
        /// What to add.
        mend: String,
    },
    /// Keys that exclude each other, or a key that has no meaning here.
    #[error("{at}: `{key}` cannot stand here: {mend}")]
    Misplaced {
        /// The object that holds it.
        at: Box<Place>,
        /// The key that is too much.
        key: &'static str,
        /// What to do instead.
        mend: String,
    },
    /// None or several of a choice of keys.
    #[error("{at}: has {}; give exactly one of {}", listed(.found, "none of the keys"), listed(.of, ""))]
    Choice {
        /// The object.
        at: Box<Place>,
        /// The keys of the choice that are there.
        found: Vec<&'static str>,
        /// The choice.
        of: &'static [&'static str],
    },
    /// A name that nothing defines.
    #[error("{at}: no {kind} is called `{name}`{}", did_you_mean(.nearest, .known))]
    UnknownName {
        /// Where the name is used.
        at: Box<Place>,
        /// `class` or `shape`.
        kind: &'static str,
        /// The name as written.
        name: String,
        /// The known name that it resembles most, if any does.
        nearest: Option<String>,
        /// Every known name.
        known: Vec<String>,
    },
    /// More of something than this program holds.
    #[error("{at}: {count} {what} are more than the limit of {limit}; {mend}")]
    TooMany {
        /// Where.
        at: Box<Place>,
        /// What is counted.
        what: &'static str,
        /// How many were asked for.
        count: u64,
        /// How many are allowed.
        limit: u64,
        /// What to change.
        mend: &'static str,
    },
    /// The mount box does not touch the region above the ROI where sensors may stand.
    #[error(
        "{at}: the mount runs from {min:?} to {max:?}, outside of the ROI ({roi_min:?} to \
         {roi_max:?}) in {axis}; move the mount or enlarge the ROI"
    )]
    MountOutside {
        /// Where.
        at: Box<Place>,
        /// `x`, `y` or `z`.
        axis: char,
        /// Lower corner of the mount in metres.
        min: [f64; 3],
        /// Upper corner of the mount in metres.
        max: [f64; 3],
        /// Lower corner of the ROI in metres.
        roi_min: [f64; 3],
        /// Upper corner of the ROI in metres.
        roi_max: [f64; 3],
    },
    /// A mesh file that cannot be used.
    #[error("{at}: mesh {mesh}: {element}: {problem}")]
    Mesh {
        /// The place in the scene that names the mesh.
        at: Box<Place>,
        /// The mesh file.
        mesh: PathBuf,
        /// Line, vertex, face or header entry of the mesh.
        element: String,
        /// What is wrong there.
        problem: String,
    },
    /// A material of a mesh has no class, and the shape has no default.
    #[error(
        "{at}: mesh {mesh}: material `{material}` has no class; name it in `classes` or give the \
         shape a `class` for the rest"
    )]
    Unclassed {
        /// The place in the scene that names the mesh.
        at: Box<Place>,
        /// The mesh file.
        mesh: PathBuf,
        /// Material or label of the mesh.
        material: String,
    },
}

fn listed(keys: &[&str], none: &str) -> String {
    if keys.is_empty() {
        return none.to_owned();
    }
    keys.iter().map(|k| format!("`{k}`")).collect::<Vec<_>>().join(", ")
}

fn did_you_mean(nearest: &Option<String>, known: &[String]) -> String {
    match nearest {
        Some(name) => format!("; did you mean `{name}`?"),
        None if known.is_empty() => "; nothing is known here".to_owned(),
        None => {
            let known: Vec<_> = known.iter().map(|k| format!("`{k}`")).collect();
            format!("; known are {}", known.join(", "))
        }
    }
}

/// Longest name that is compared with others: the time to compare two grows with both lengths.
const LONGEST_NAME: usize = 256;

/// The one of `known` that resembles `name` most, if any is close enough to be a slip.
pub(crate) fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<String> {
    if name.len() > LONGEST_NAME {
        return None;
    }
    let lower = name.to_lowercase();
    known
        .into_iter()
        .filter(|known| known.len() <= LONGEST_NAME)
        .map(|k| (strsim::jaro_winkler(&lower, &k.to_lowercase()), k))
        .filter(|(likeness, _)| *likeness > 0.7)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k.to_owned())
}

/// Reads a whole file, refusing what is no plain file or larger than `limit` bytes.
pub(crate) fn read_limited(file: &Path, limit: u64) -> Result<Vec<u8>, SceneError> {
    use std::io::Read as _;
    let fail = |source| SceneError::Read { file: file.to_owned(), source };
    let meta = std::fs::metadata(file).map_err(fail)?;
    if !meta.is_file() {
        return Err(fail(std::io::Error::other("is not a plain file")));
    }
    let mut bytes = Vec::new();
    let opened = std::fs::File::open(file).map_err(fail)?;
    opened.take(limit + 1).read_to_end(&mut bytes).map_err(fail)?;
    if bytes.len() as u64 > limit {
        return Err(SceneError::TooLarge { file: file.to_owned(), limit });
    }
    Ok(bytes)
}
