//! The front of two or three objectives in a folder of its own: begun or resumed, saved on the way, recorded at its end.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::request::{Begun, OptimizeRequest, command, in_full};
use super::{BETWEEN_CHECKPOINTS, Bars, TIMES, earlier_times, priced};
use crate::files::{FileError, RunDir, Session, command_of as command_in};
use crate::job::{Front, FrontObjective, FrontObjectives, FrontState, FrontStopped, Job};
use crate::report::front::{front_csv, front_plot};
use crate::report::words::{from_here, word};
use crate::report::{FrontRecord, front_html};
use crate::runs::inputs::note_unpriced;
use crate::runs::{Computing, GRACE, RunError, Watcher, opening, outputs};
use crate::search::{Event, Settings, TimeLimit};

/// Front, record and folder of a finished search.
#[derive(Debug)]
pub struct Fronted {
    /// The points.
    pub front: Front,
    /// All of `result.json`.
    pub record: FrontRecord,
    /// The folder.
    pub folder: PathBuf,
}

pub(super) const COMMAND: &str = "optimize --front";

/// Content of a checkpoint.
#[derive(Serialize, Deserialize)]
struct SavedFront {
    begun: Begun,
    objectives: FrontObjectives,
    settings: Settings,
    state: FrontState,
}

impl SavedFront {
    /// True if the front is by price, or within a budget.
    fn counts_prices(&self) -> bool {
        self.objectives.all().contains(&FrontObjective::Price) || self.begun.files.budget.is_some()
    }
}

/// True if a folder holds a front that goes on.
pub fn holds_front(folder: &Path) -> bool {
    command_in(folder).is_some_and(|command| command == COMMAND)
}

/// The folder and the state of a front that goes on; of a new one the state at its beginning.
fn opened(
    request: &OptimizeRequest,
    computing: &Computing<'_>,
) -> Result<(Option<RunDir<SavedFront>>, SavedFront), RunError> {
    if let Some(path) = &request.resume {
        let (folder, saved) = RunDir::<SavedFront>::resume(COMMAND, path)?;
        return Ok((Some(folder), saved));
    }
    let (begun, settings) = request.checked(computing)?;
    let words = "give the objectives of the front, as price,near_gain";
    let objectives = request.front.clone().ok_or_else(|| RunError::Usage(words.to_owned()))?;
    Ok((None, SavedFront { begun, objectives, settings, state: FrontState::default() }))
}

/// Searches the front of the request's objectives, or goes on with one, and writes it into its folder, and its picture into
/// the folder of figures. `None` if the watcher stopped it before any placement was scored.
///
/// # Errors
/// Files that cannot be read or written, objectives that the vehicle does not have, no placement with a value of each.
pub fn front(
    request: &OptimizeRequest,
    computing: &Computing<'_>,
) -> Result<Option<Fronted>, RunError> {
    let _session = Session::begin();
    let (start, watcher) = (Instant::now(), computing.watcher);
    let (max_seconds, figures) = (request.max_seconds, request.figures.figures.as_deref());
    outputs::check_figures(figures)?;
    let (folder, mut saved) = opened(request, computing)?;
    let time = max_seconds.map(|s| TimeLimit { start, length: Duration::from_secs_f64(s) });
    let loaded = request.open(&saved.begun.files, time, computing)?;
    let inputs = loaded.inputs()?;
    loaded.job.check_front(&saved.objectives)?;
    if folder.is_none() {
        request.look(&mut saved.settings, &*loaded.job.problem()?, computing)?;
    }
    let job = loaded.job.search(saved.settings.clone());
    let job = job.engine(computing.engine.clone()).within(time);
    let is_given = saved.begun.baselines.is_some();
    let job = if is_given { job.baselines(saved.settings.baselines.clone()) } else { job };
    if folder.is_none() {
        note_unpriced(job.scene().vehicle(), saved.counts_prices(), watcher);
        opening::note_before_search(&job, watcher)?;
    }
    job.check_room()?;
    watcher.listen(GRACE);
    let folder = request.folder((COMMAND, folder), &saved.begun, inputs)?;
    let earlier: f64 = earlier_times(folder.path(), request.resume.is_none());
    let found = search(&job, &mut saved, &folder, watcher);
    let Some(found) = found.map_err(|error| error.discarding(&folder))? else { return Ok(None) };
    let seconds = earlier + start.elapsed().as_secs_f64();
    folder.write_json(TIMES, &seconds)?;
    let limit = max_seconds.filter(|_| found.stopped == FrontStopped::Time);
    let (begun, objectives) = (&saved.begun, &saved.objectives);
    let record = FrontRecord {
        scene: job.scene().name().to_owned(),
        settings: settings_json(begun, &job, objectives, limit),
        command: command_of(begun, &job, objectives, limit, in_full),
        conditions: begun.files.conditions.clone(),
        seconds,
        ..FrontRecord::new(&found)
    };
    // The page is read where the run was made.
    let here = command_of(begun, &job, objectives, limit, from_here);
    let page = front_html(&found, &FrontRecord { command: here, ..record.clone() });
    write(&folder, &job, (&found, &record), &page)?;
    let (drawn, table) = (front_plot(&found).svg(), front_csv(&found));
    outputs::write_figures(figures, vec![("front".to_owned(), drawn)], Some(("front", table)))?;
    Ok(Some(Fronted { front: found, record, folder: folder.path().to_owned() }))
}

/// Searches to the end or until the watcher stops it; finished parts are saved on the way. `None` where nothing was found
/// before a stop.
fn search(
    job: &Job,
    saved: &mut SavedFront,
    folder: &RunDir<SavedFront>,
    watcher: &dyn Watcher,
) -> Result<Option<Front>, RunError> {
    let (mut bars, objectives) = (Bars::new(watcher), saved.objectives.clone());
    let failed = std::cell::RefCell::new(None::<FileError>);
    let (mut last, mut state) = (Instant::now(), std::mem::take(&mut saved.state));
    let mut is_saved = false;
    let mut keep = |state: &FrontState| {
        if !is_saved || last.elapsed() > BETWEEN_CHECKPOINTS {
            saved.state = state.clone();
            *failed.borrow_mut() = folder.save(saved).err();
            (last, is_saved) = (Instant::now(), true);
            watcher.resumes(&format!("go on with --resume {}", folder.path().display()));
        }
    };
    let found = job.front_from(&objectives, &mut state, &mut keep, &mut |event: &Event| {
        bars.show(event);
        watcher.goes_on() && failed.borrow().is_none()
    });
    bars.clear();
    if let Some(error) = failed.into_inner() {
        return Err(error.into());
    }
    let found = found?;
    saved.state = state;
    if !(saved.state.is_empty() && found.points.is_empty()) {
        folder.save(saved)?;
    }
    Ok(is_worth_writing(&found, &saved.begun, folder, watcher)?.then_some(found))
}

/// False where the search was stopped before it found anything; notes an end before all limits were looked at.
fn is_worth_writing(
    found: &Front,
    begun: &Begun,
    folder: &RunDir<SavedFront>,
    watcher: &dyn Watcher,
) -> Result<bool, RunError> {
    let go_on = || format!("go on with --resume {}", folder.path().display());
    match (found.points.len(), found.stopped) {
        (0, FrontStopped::Interrupted) if holds_front(folder.path()) => {
            watcher.note(&format!("stopped before any placement was scored; {}", go_on()));
            Ok(false)
        }
        (0, FrontStopped::Interrupted) => {
            watcher.note("stopped before any placement was scored; nothing is written");
            Ok(false)
        }
        (0, _) => Err(RunError::Usage(format!(
            "{}: no placement found has a value of each of {}; give the scene frames in which something moves, or move \
             the mounts",
            begun.files.scene.display(),
            found.objectives.names().join(", ")
        ))),
        (_, FrontStopped::Complete) => Ok(true),
        (_, stopped) => {
            watcher.note(&format!("stopped: {stopped}; {}", go_on()));
            Ok(true)
        }
    }
}

/// The command that repeats the search; with `max_seconds` where time ended it.
fn command_of(
    begun: &Begun,
    job: &Job,
    objectives: &FrontObjectives,
    max_seconds: Option<f64>,
    name: fn(&Path) -> String,
) -> String {
    let names = objectives.names().join(",");
    format!("{} --front {}", command(begun, job.settings(), max_seconds, name), word(&names))
}

/// Every setting that decides about the front.
fn settings_json(
    begun: &Begun,
    job: &Job,
    objectives: &FrontObjectives,
    max_seconds: Option<f64>,
) -> Value {
    let (mut all, settings) = (begun.settings(job.scene().vehicle()), job.settings());
    all["front"] = json!(objectives);
    if let Some(file) = &begun.baselines {
        all["baselines_file"] = json!(file.to_string_lossy());
    }
    all["max_seconds"] = json!(max_seconds);
    all["search"] = json!({
        "objective": settings.objective,
        "method": settings.method,
        "evaluations": settings.evaluations,
        "population": settings.population,
        "delta": settings.delta,
        "frames": settings.frames,
        "seed": settings.seed,
    });
    all
}

/// Writes placements, picture, page and record, the record last.
fn write(
    folder: &RunDir<SavedFront>,
    job: &Job,
    (found, record): (&Front, &FrontRecord),
    page: &str,
) -> Result<(), RunError> {
    let placements = found.points.iter().map(|point| priced(job, &point.placement));
    let placements: Vec<Value> = placements.collect();
    folder.write_json("placements.json", &json!({ "placements": placements }))?;
    folder.write_text("front.svg", &front_plot(found).svg())?;
    folder.write_text("report.html", page)?;
    Ok(folder.write_json("result.json", &record.json())?)
}
