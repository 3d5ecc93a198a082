//! `dataset.json`: content of a data set folder, and whether it is the one to be continued.

use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::folder::{ABOUT, HIDDEN};
use super::plan::Planned;
use super::{DatasetSettings, ExportError, SceneFacts, Split};
use sightline_files::files::{self, FileError, Input};

/// Largest `dataset.json`: one of a thousand scenes has a megabyte.
const MOST_BYTES: u64 = 1 << 28;

/// Keys of the provenance that hold paths as they were given: recorded, but not compared.
const PATHS: [&str; 2] = ["scenes", "vehicle"];

/// All of `dataset.json`.
#[derive(Serialize, Deserialize)]
pub(super) struct About {
    dataset: u32,
    pub complete: bool,
    settings: DatasetSettings,
    /// Name and split of each scene in the data set.
    called: Vec<Called>,
    scenes: Vec<SceneFacts>,
}

#[derive(Serialize, Deserialize, PartialEq)]
struct Called {
    scene: String,
    name: String,
    split: Split,
}

impl About {
    /// A data set that is not whole.
    pub fn new(settings: &DatasetSettings, scenes: &[SceneFacts], plan: &[Planned]) -> Self {
        let called = scenes.iter().zip(plan).map(|(scene, planned)| Called {
            scene: scene.name.clone(),
            name: planned.name.clone(),
            split: planned.split,
        });
        Self {
            dataset: 1,
            complete: false,
            settings: settings.clone(),
            called: called.collect(),
            scenes: scenes.to_vec(),
        }
    }

    pub fn read(dir: &Path) -> Result<Self, ExportError> {
        let path = dir.join(ABOUT);
        let text = files::read_own(&path, MOST_BYTES).map_err(FileError::io(&path))?;
        serde_json::from_slice(&text).map_err(|why| ExportError::About { path, why })
    }

    /// True if the folder holds this very data set; an empty one or none holds nothing.
    ///
    /// # Errors
    /// A folder of something else, of other settings, or of scenes whose files have changed since.
    pub fn is_in(&self, dir: &Path) -> Result<bool, ExportError> {
        let mut entries = match std::fs::read_dir(dir) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(false),
            Err(error) => {
                // For a place below a file, that file is in the way.
                return Err(match dir.ancestors().find(|place| place.is_file()) {
                    Some(file) => ExportError::NoFolder { path: file.to_owned() },
                    None => ExportError::io(dir)(error),
                });
            }
            Ok(entries) => entries,
        };
        if !dir.join(ABOUT).is_file() {
            // A run that ended before it wrote `dataset.json` leaves only the hidden folder.
            let foreign = entries.any(|entry| entry.is_ok_and(|entry| entry.file_name() != HIDDEN));
            return if foreign {
                Err(ExportError::Foreign { path: dir.to_owned() })
            } else {
                Ok(false)
            };
        }
        let path = dir.to_owned();
        let found = Self::read(dir)?;
        if let Some(difference) = self.difference(&found) {
            return Err(ExportError::OtherSettings { path, difference });
        }
        match Input::change(&found.settings.files, &self.settings.files) {
            Some(change) => Err(ExportError::OtherFile { path, change }),
            None => Ok(true),
        }
    }

    /// Names of the settings that differ from the existing data set; scene files are not compared.
    fn difference(&self, found: &Self) -> Option<String> {
        let others = others(&self.settings.compared(), &found.settings.compared());
        let difference = if !others.is_empty() {
            return Some(others.join(", "));
        } else if self.scenes != found.scenes {
            "scenes or frames"
        } else if self.called != found.called || self.dataset != found.dataset {
            "another version of the program"
        } else if found.settings.files.is_empty() && !self.settings.files.is_empty() {
            "an earlier version of the program, which did not record the files of its scenes"
        } else {
            return None;
        };
        Some(difference.to_owned())
    }
}

impl DatasetSettings {
    /// The settings and the provenance as they are compared, without files and the paths of [`PATHS`]. A provenance
    /// that is no object is one of the settings.
    fn compared(&self) -> [Value; 2] {
        let mut settings = serde_json::json!(self);
        let mut provenance: Value = serde_json::from_str(&self.provenance).unwrap_or_default();
        if let Some(keys) = settings.as_object_mut() {
            keys.retain(|key, _| {
                key != "files" && (key != "provenance" || !provenance.is_object())
            });
        }
        if let Some(keys) = provenance.as_object_mut() {
            keys.retain(|key, _| !PATHS.contains(&key.as_str()));
        }
        [settings, provenance]
    }
}

/// Names of the values that are not alike in both, each once.
fn others(ours: &[Value; 2], theirs: &[Value; 2]) -> Vec<String> {
    let mut names = Vec::new();
    for (a, b) in ours.iter().zip(theirs) {
        for key in [a, b].into_iter().filter_map(Value::as_object).flat_map(|keys| keys.keys()) {
            if a.get(key) != b.get(key) && !names.contains(key) {
                names.push(key.clone());
            }
        }
    }
    names
}
