//! Attempts to fool the scores, and rankings under changes of the model, in scene files.

use std::path::{Path, PathBuf};

use super::inputs::Files;
use super::inputs::{Given, published};
use super::{Computing, RunError, opening};
use crate::audit::{AUDIT_FRAMES, AUDIT_PARTS, Audit, AuditEvent, audit};
use crate::score::Objective;
use crate::vehicle::{Placement, read_placements};

/// Files and settings of an audit.
#[derive(Debug, Clone, Default)]
pub struct AuditRequest {
    /// Scene files, and placements to start from; without them Table 7 of the paper.
    pub files: Vec<PathBuf>,
    /// Score by which the best placement is chosen; the default one if none.
    pub objective: Option<String>,
    /// Frames to average over; [`AUDIT_FRAMES`] if none.
    pub frames: Option<u32>,
}

/// Audits scene after scene, and calls `each` with every result.
///
/// # Errors
/// Files that cannot be read, errors of [`audit`] and of `each`.
pub fn audit_scenes(
    request: &AuditRequest,
    computing: &Computing<'_>,
    mut each: impl FnMut(&Audit) -> Result<(), RunError>,
) -> Result<Vec<Audit>, RunError> {
    let Files { scenes, placements } = Files::sort(&request.files, computing.watcher)?;
    let honest = placements.as_deref().map(read_placements).transpose()?;
    let objective = request.objective.as_deref().map(str::parse).transpose()?;
    let objective: Objective = objective.unwrap_or_default();
    let mut all = Vec::new();
    for path in &scenes {
        let given = placements.as_deref();
        let given = given.zip(honest.as_deref());
        let found = of_scene(path, given, &objective, request.frames, computing)?;
        each(&found)?;
        all.push(found);
    }
    Ok(all)
}

/// The audit of one scene.
fn of_scene(
    path: &Path,
    given: Option<(&Path, &[Placement])>,
    objective: &Objective,
    frames: Option<u32>,
    computing: &Computing<'_>,
) -> Result<Audit, RunError> {
    let watcher = computing.watcher;
    let files = opening::files(&[path.to_owned()], &[], frames, computing);
    let job = opening::job(&files, computing)?.job.frames(frames.or(Some(AUDIT_FRAMES)));
    let job = job.objective(objective.clone());
    let scene = job.scene();
    let sensors = scene.sensors()?;
    let honest = match given {
        Some((file, given)) => {
            let mut given = given.to_vec();
            Given::new(file, &sensors, &scene.constraints(), computing).all(&mut given)?;
            given
        }
        None => published(&sensors, computing)?,
    };
    let bar = watcher.bar(AUDIT_PARTS, Some("parts"));
    let tell = |event: AuditEvent| match event {
        AuditEvent::Note(note) => watcher.note(note),
        AuditEvent::PartDone => bar.advance(1),
    };
    Ok(audit(&job, &honest, &tell)?)
}
