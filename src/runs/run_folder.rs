//! The folder of a run in place of files: it stands for its result, and alone for its scenes and its vehicle too.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::Value;

use super::{Computing, RunError};
use crate::files::{self, changed_input};
use crate::job::JobFiles;
use crate::vehicle::placement_file::file_and_name;
use sightline_files::json::counted;

/// Files of a folder of `optimize`.
pub(crate) const RESULT: &str = "result.json";
pub(crate) const PLACEMENTS: &str = "placements.json";
/// Largest result that is read, in bytes.
pub(crate) const MOST_OF_RESULT: u64 = 1 << 30;

/// A file of placements, perhaps with `:NAME`. The folder of a run stands for the result in its file, the folder of a front
/// for all points; `FOLDER:NAME` is any placement of its file.
pub(crate) fn rig_file(text: &str) -> Result<String, RunError> {
    let (folder, name) = file_and_name(text);
    let folder = Path::new(folder);
    let file = folder.join(PLACEMENTS);
    if !file.is_file() {
        return Ok(text.to_owned());
    }
    let result = result_of(folder)?;
    let name = name.or_else(|| best_of(&result));
    let file = file.display();
    Ok(name.map_or_else(|| file.to_string(), |name| format!("{file}:{name}")))
}

/// [`rig_file`] of a path, with its errors.
pub(crate) fn rig_path(path: &Path) -> Result<PathBuf, RunError> {
    path.to_str().map_or_else(|| Ok(path.to_owned()), |text| rig_file(text).map(PathBuf::from))
}

/// The result that the folder of a run holds.
pub(crate) fn result_of(folder: &Path) -> Result<Value, RunError> {
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
    let bytes =
        files::read(&file, MOST_OF_RESULT).map_err(|error| wrong(&format!("{RESULT}: {error}")))?;
    serde_json::from_slice(&bytes).map_err(|error| wrong(&format!("{RESULT}: {error}")))
}

/// Name of the placement that a search found; `None` of a front, and where none was found.
pub(crate) fn best_of(result: &Value) -> Option<&str> {
    result["best"]["placement"]["name"].as_str()
}

/// Vehicle file of the run that wrote a file of placements; `None` of other files, and of a run without one.
pub(super) fn vehicle_of_run(file: &Path) -> Option<String> {
    let file = Path::new(file_and_name(file.to_str()?).0);
    let folder = file.parent().filter(|_| file.ends_with(PLACEMENTS))?;
    let result = result_of(folder).ok()?;
    result["settings"]["vehicle"].as_str().map(str::to_owned)
}

/// Files of a command, and where it computes: the folder of a run, without a scene beside it, has the scenes of the run, and
/// its vehicle unless another is given. Other files are as they were given.
///
/// # Errors
/// A folder whose result cannot be read.
pub(super) fn with_run_scenes<'a>(
    files: &[PathBuf],
    computing: &Computing<'a>,
) -> Result<(Vec<PathBuf>, Computing<'a>), RunError> {
    brought(files, computing, |run| run.scenes().cloned().collect())
}

/// Like [`with_run_scenes`], for a command that looks at level ground where a vehicle is given without a scene.
///
/// # Errors
/// A folder whose result cannot be read.
pub(super) fn with_run<'a>(
    files: &[PathBuf],
    computing: &Computing<'a>,
) -> Result<(Vec<PathBuf>, Computing<'a>), RunError> {
    let Some(vehicle) = &computing.vehicle else { return with_run_scenes(files, computing) };
    if let Some(run) = run_of(files)? {
        let scenes: Vec<String> = run.scenes().map(|scene| scene.display().to_string()).collect();
        computing.watcher.note(&format!(
            "{}: {} is given without a scene, so that the ground is level; name {} first for the ground of the run",
            files[0].display(),
            vehicle.display(),
            scenes.join(" ")
        ));
    }
    Ok((files.to_vec(), computing.clone()))
}

/// Like [`with_run`], for a command that looks at level ground where the run has a vehicle, too.
///
/// # Errors
/// A folder whose result cannot be read.
pub(super) fn with_run_vehicle<'a>(
    files: &[PathBuf],
    computing: &Computing<'a>,
) -> Result<(Vec<PathBuf>, Computing<'a>), RunError> {
    if computing.vehicle.is_some() {
        return with_run(files, computing);
    }
    brought(files, computing, |run| match run.vehicle {
        Some(_) => Vec::new(),
        None => run.scenes().cloned().collect(),
    })
}

/// Files of a command behind the scenes that are taken of a run, and its vehicle, with a note.
fn brought<'a>(
    files: &[PathBuf],
    computing: &Computing<'a>,
    scenes: impl Fn(&JobFiles) -> Vec<PathBuf>,
) -> Result<(Vec<PathBuf>, Computing<'a>), RunError> {
    let Some(mut run) = run_of(files)? else {
        return Ok((files.to_vec(), computing.clone()));
    };
    if computing.vehicle.is_some() {
        run.vehicle = None;
    }
    let scenes = scenes(&run);
    note_taken(&files[0], &scenes, &run, computing);
    let vehicle = computing.vehicle.clone().or(run.vehicle);
    Ok(([&scenes, files].concat(), Computing { vehicle, ..computing.clone() }))
}

/// Files and options of a run whose folder, perhaps with `:NAME` of one of its placements, is all that is given; `None` of
/// other files, and of a run that does not say them.
fn run_of(files: &[PathBuf]) -> Result<Option<JobFiles>, RunError> {
    let [given] = files else { return Ok(None) };
    let folder = plain(given);
    if !folder.join(RESULT).is_file() {
        return Ok(None);
    }
    Ok(JobFiles::deserialize(&result_of(folder)?["settings"]).ok())
}

/// A path without `:NAME` behind it.
fn plain(given: &Path) -> &Path {
    given.to_str().map_or(given, |text| Path::new(file_and_name(text).0))
}

/// Notes the files of a run that are taken, a file that has changed since, and options of the run that are not taken.
fn note_taken(folder: &Path, scenes: &[PathBuf], run: &JobFiles, computing: &Computing<'_>) {
    let of = folder.display();
    let taken: Vec<String> =
        scenes.iter().chain(&run.vehicle).map(|file| file.display().to_string()).collect();
    let taken = taken.join(", ");
    let mut note = format!("{of}: the folder of a run alone; with {taken}, as in the run");
    if let Some(vehicle) = &computing.vehicle {
        note += &format!(", and {} as given", vehicle.display());
    }
    if !run.conditions.is_empty() {
        let weather = run.conditions.join(" and ");
        note += &format!("; the run was under {weather}, which --condition gives here");
    }
    if let Some(frames) = run.frames {
        note += &format!("; the run looked at {}", counted(frames as usize, "frame"));
    }
    computing.watcher.note(&note);
    if let Some(changed) = changed_input(plain(folder)) {
        let changed = changed.display();
        computing.watcher.note(&format!("{of}: {changed} is another file than its run began with"));
    }
}
