//! The folder of a run in place of a file of placements: its optimum, and what the run says about it.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::files::read;
use crate::job::Tolerance;
use crate::runs::RunError;
use crate::runs::inputs::file_and_name;
use crate::score::{Lost, SEEN, Seen};

/// Largest result that is read, in bytes.
const MOST: u64 = 1 << 30;
/// Files of a folder of `optimize`.
const RESULT: &str = "result.json";
const PLACEMENTS: &str = "placements.json";

/// Rig to hand over, as given: a file of placements, or the folder of a run.
pub(super) struct GivenRig {
    /// File of placements, with the name of one behind a colon where there are several.
    pub text: String,
    /// The run, where a folder was given.
    pub run: Option<RunFound>,
}

/// A run as its folder tells it.
pub(super) struct RunFound {
    /// The folder.
    pub folder: PathBuf,
    /// Vehicle file; `None` where the scene says its vehicle.
    pub vehicle: Option<PathBuf>,
    /// First scene.
    pub scene: PathBuf,
    /// Seed of the search.
    pub seed: u64,
    /// Mounting tolerance that requirements were looked at within.
    pub tolerance: Option<Tolerance>,
    /// Requirements as the run measured them, over all its frames.
    pub required: Vec<Seen>,
}

impl GivenRig {
    /// Looks whether a folder is given, with or without `:NAME` of another of its placements.
    ///
    /// # Errors
    /// A folder that holds no result of a search; a search that found nothing.
    pub fn new(text: &str) -> Result<Self, RunError> {
        let (folder, name) = file_and_name(text);
        let folder = Path::new(folder);
        if !folder.is_dir() {
            return Ok(Self { text: text.to_owned(), run: None });
        }
        let placements = folder.join(PLACEMENTS).display().to_string();
        if let Some(name) = name {
            return Ok(Self { text: format!("{placements}:{name}"), run: None });
        }
        if !folder.join(RESULT).is_file() && folder.join(PLACEMENTS).is_file() {
            return Ok(Self { text: placements, run: None });
        }
        let result = result_of(folder)?;
        let best = result["best"]["placement"]["name"].as_str().ok_or_else(|| {
            RunError::Usage(format!(
                "{}: its search found no placement; there is nothing to hand over",
                folder.display()
            ))
        })?;
        let text = format!("{placements}:{best}");
        Ok(Self { text, run: Some(RunFound::new(folder, &result)) })
    }
}

/// The result of a folder.
fn result_of(folder: &Path) -> Result<Value, RunError> {
    let file = folder.join(RESULT);
    let wrong = |why: &str| {
        RunError::Usage(format!(
            "{}: {why}; give a file of placements, or the folder of a finished run of optimize",
            folder.display()
        ))
    };
    if !file.is_file() {
        return Err(wrong(&format!("is a folder without {RESULT}")));
    }
    let bytes = read(&file, MOST).map_err(|error| wrong(&format!("{RESULT}: {error}")))?;
    serde_json::from_slice(&bytes).map_err(|error| wrong(&format!("{RESULT}: {error}")))
}

impl RunFound {
    fn new(folder: &Path, result: &Value) -> Self {
        let settings = &result["settings"];
        let path = |key: &str| settings[key].as_str().map(PathBuf::from);
        let tolerance = settings["tolerance"].as_str().and_then(|text| text.parse().ok());
        let required = result["best"]["scores"]["requirements"].as_array();
        Self {
            folder: folder.to_owned(),
            vehicle: path("vehicle"),
            scene: path("scene").unwrap_or_default(),
            seed: result["seed"].as_u64().unwrap_or_default(),
            tolerance,
            required: required.into_iter().flatten().map(seen).collect(),
        }
    }
}

/// A requirement as a result has it.
fn seen(of: &Value) -> Seen {
    let number = |key: &str| of[key].as_f64();
    let worst = of["worst_without"].as_u64().map(|lidar| lidar as usize);
    Seen {
        name: of["name"].as_str().unwrap_or_default().to_owned(),
        share: number("found").unwrap_or_default(),
        done: SEEN,
        least: number("required").unwrap_or_default(),
        missing: None,
        holds_in: number("holds_in"),
        lost: number("intact").map(|intact| Lost { intact, worst, mount: None }),
    }
}

/// The command that hands over one of several placements of a file.
pub(super) fn command(files: &[String], text: &str, name: &str) -> String {
    use crate::report::words::word;
    let scenes: String =
        files[..files.len() - 1].iter().map(|file| format!("{} ", word(file))).collect();
    let own = word(&format!("{}:{name}", file_and_name(text).0));
    format!("sightline rig handover {scenes}{own}")
}
