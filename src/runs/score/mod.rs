//! Scores of a batch of placements: as a stream in one scene, with their mean in several.

mod journal;
mod request;
mod several;
mod stream;

use std::io::Write;
use std::path::Path;
use std::time::Instant;

pub use request::ScoreRequest;

use super::inputs::Files;
use super::{Computing, RunError};
use crate::files::Session;
use crate::vehicle::placement_file::count_placements;

/// Scores placements and writes the scores as they are computed, to the request's file or else to `out`.
///
/// # Errors
/// What cannot be read, computed or written; all that can be wrong in files is found before the first score.
pub fn score(
    request: &ScoreRequest,
    computing: &Computing<'_>,
    out: &mut dyn Write,
) -> Result<(), RunError> {
    let _session = Session::begin();
    let start = Instant::now();
    let (scenes, placements) = Files::with_placements(&request.files, computing.watcher)?;
    // Everything that can be wrong is found before the first score is computed or printed; a pipe can
    // be read only once.
    let is_file = placements != Path::new("-") && placements.is_file();
    let total = if is_file { count_placements(&placements)? } else { 0 };
    if request.draw > 0 && scenes.len() > 1 {
        return Err(RunError::Usage("--draw: takes one scene".to_owned()));
    }
    match &scenes[..] {
        [scene] => stream::score(request, computing, scene, &placements, total, start, out),
        _ => several::score(request, computing, &scenes, &placements, start, out),
    }
}
