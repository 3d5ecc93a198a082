//! The page about a placement that was not searched for.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::figures::{self, Figure};
use super::given::{Given, held};
use super::inputs::{file_and_name, named_placements, note_repeated};
use super::opening;
use super::{Computing, RunError};
use crate::files::{Session, writable_file, write_whole};
use crate::job::Job;
use crate::report::{Figures, Looks, SceneRecord, Subject, view_html};
use crate::scan::conditions::{Condition, in_words};
use crate::score::Objective;
use crate::search::{Evaluator, Scored};
use crate::vehicle::Placement;

/// A placement to be shown.
#[derive(Debug, Clone, Default)]
pub struct ViewRequest {
    /// Scene files, and last a file of placements with the name of the one to show behind a colon.
    pub files: Vec<String>,
    /// Files of placements to compare with, perhaps with a name behind a colon; Table 7 of the paper if none.
    pub baselines: Vec<String>,
    /// Page to write.
    pub out: PathBuf,
    /// Folder for each figure of the page.
    pub figures: Option<PathBuf>,
    /// Weather and faults.
    pub conditions: Vec<Condition>,
    /// Command that makes the page again, which stands on it.
    pub command: String,
}

/// Writes the page about a placement.
///
/// # Errors
/// Files that cannot be read or written, no placement to show, scenes that do not go together.
pub fn view(request: &ViewRequest, computing: &Computing<'_>) -> Result<(), RunError> {
    let _session = Session::begin();
    let Some((placements, scenes)) = request.files.split_last() else {
        return Err(RunError::Usage("give scenes, and a file of placements".into()));
    };
    let mut given = named_placements(placements)?;
    let shown = given.first_mut().ok_or_else(|| {
        RunError::Usage(format!("{placements}: holds no placement; there is nothing to show"))
    })?;
    let rivals = request.baselines.iter().map(|text| read(text));
    let mut rivals = rivals.collect::<Result<Vec<_>, RunError>>()?;
    let paths: Vec<PathBuf> = scenes.iter().map(PathBuf::from).collect();
    note_repeated(&paths, computing.watcher);
    let files = opening::files(&paths, &request.conditions, None, computing);
    let mut loaded = opening::job(&files, computing)?;
    let mut evaluator = loaded.evaluator(computing)?;
    let (job, problem) = (loaded.job, evaluator.problem());
    let look = |file: &str| Given::in_problem(Path::new(file), problem, computing);
    look(file_and_name(placements).0).all([&mut *shown])?;
    for (file, all) in &mut rivals {
        look(file).all(all)?;
    }
    let baselines = match rivals.is_empty() {
        true => held(job.scene().vehicle(), problem.sensors(), computing)?,
        false => rivals.into_iter().flat_map(|(_, placements)| placements).collect(),
    };
    // The placement shown is not compared with itself.
    let baselines: Vec<Placement> =
        baselines.into_iter().filter(|baseline| baseline != shown).collect();
    let out = &request.out;
    writable_file(out)?;
    figures::wanted(request.figures.as_deref())?;
    let (page, figures) = page(request, &job, &mut evaluator, shown, &baselines)?;
    figures::write(request.figures.as_deref(), figures)?;
    write_whole(out, |file| file.write_all(page.as_bytes()).map_err(RunError::io(out)))
}

/// Placements of a file, perhaps with a name behind a colon, beside the file.
fn read(text: &str) -> Result<(&str, Vec<Placement>), RunError> {
    Ok((file_and_name(text).0, named_placements(text)?))
}

/// The page, and its figures by name.
fn page(
    request: &ViewRequest,
    job: &Job,
    evaluator: &mut Evaluator,
    shown: &Placement,
    baselines: &[Placement],
) -> Result<(String, Vec<Figure>), RunError> {
    let suite = &job.suite()?;
    let all: Vec<Placement> = std::iter::once(shown).chain(baselines).cloned().collect();
    let objective = Objective::default();
    let scored = all.iter().zip(evaluator.judged(&all)?);
    let scored = scored.map(|(p, judged)| Scored::new(p, judged, &objective, suite.constraints()));
    let mut scored: Vec<Scored> = scored.collect();
    let all = scored.iter_mut().map(|Scored { placement, scores, .. }| (&*placement, scores));
    job.look_closely(evaluator.backend_mut(), all)?;
    let (result, baselines) = (&scored[0], &scored[1..]);
    let looks = Looks::new(job, suite, shown, baselines)?;
    let figures = Figures::new(Some(result), suite.constraints(), &job.scene().body(), Some(looks));
    let records = SceneRecord::several(suite);
    let names: Vec<&str> = job.scenes().iter().map(|scene| scene.scene().name()).collect();
    let names = names.join(", ");
    let objective = objective.to_string();
    let conditions = in_words(&request.conditions);
    let subject =
        Subject::given(&names, &records, result, baselines, &objective, request.command.clone());
    Ok((view_html(&subject.under(&conditions), &figures), figures.files(Some(result))))
}
