//! A run or a front that has nothing left to do: its folder is not computed again.

use std::path::Path;

use serde_json::Value;

use super::front;
use crate::files::{RunDir, command_of as command_in, read_own};
use crate::runs::RunError;
use crate::runs::run_folder::{MOST_OF_RESULT, PLACEMENTS, RESULT};

/// Page of a run.
const PAGE: &str = "report.html";
/// First words of an end after which a run goes on.
const UNFINISHED: [&str; 2] = ["time", "interrupted"];

/// The end of a run that is finished.
#[derive(Debug)]
pub struct Finished {
    /// All of `result.json`, as it was written.
    pub result: String,
    /// Sentence on where the result is.
    pub words: String,
    /// True if all requirements are met, or there are none; of a front, by one point.
    pub is_met: bool,
}

/// The end of the run in a folder; `None` where something is left to do.
///
/// # Errors
/// A folder of another command, a damaged checkpoint, files that were changed since the run began.
pub fn finished(folder: &Path) -> Result<Option<Finished>, RunError> {
    let command = match command_in(folder).as_deref() {
        Some(front::COMMAND) => front::COMMAND,
        Some(super::COMMAND) => super::COMMAND,
        _ => return Ok(None),
    };
    if ![RESULT, PLACEMENTS, PAGE].iter().all(|name| folder.join(name).is_file()) {
        return Ok(None);
    }
    let read = || String::from_utf8(read_own(&folder.join(RESULT), MOST_OF_RESULT).ok()?).ok();
    let Some(text) = read() else { return Ok(None) };
    let Ok(result) = serde_json::from_str::<Value>(&text) else { return Ok(None) };
    let stopped = result["stopped"].as_str().unwrap_or(UNFINISHED[0]);
    let is_own = result["sightline"] == env!("CARGO_PKG_VERSION");
    if !is_own || UNFINISHED.iter().any(|end| stopped.starts_with(end)) {
        return Ok(None);
    }
    let (dir, _) = RunDir::<Value>::resume(command, folder)?;
    dir.check_own()?;
    let is_met = is_met(&result);
    let missed =
        if is_met { "" } else { ". NOT MET: its result misses a requirement; exit code 1" };
    let words = format!(
        "{of}: the run is finished (stopped: {stopped}); nothing is left to do, and nothing was computed. Result: \
         {of}/{RESULT}, {of}/{PLACEMENTS}, report: {of}/{PAGE}{missed}",
        of = folder.display()
    );
    Ok(Some(Finished { result: text, words, is_met }))
}

/// True if a result meets all requirements, or a point of a front does.
fn is_met(result: &Value) -> bool {
    match result["front"].as_array() {
        Some(points) => points.iter().any(|point| point["requirements_met"] == true),
        None => {
            let required = result["best"]["scores"]["requirements"].as_array();
            required.into_iter().flatten().all(|seen| seen["met"] == true)
        }
    }
}
