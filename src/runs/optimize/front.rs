//! The front of two or three objectives in a folder of its own: searched in one go, recorded at its end.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::bars::Bars;
use super::begun::{Begun, Saved};
use super::command::command;
use super::record::priced;
use super::request::NewRun;
use crate::files::{Input, RunDir, Session};
use crate::job::{Front, FrontObjectives, FrontStopped, Job};
use crate::report::front::front_plot;
use crate::report::word::word;
use crate::report::{FrontContext, FrontRecord, front_html};
use crate::runs::inputs::note_repeated;
use crate::runs::{Computing, Error, GRACE, Watcher, opening};
use crate::search::{Event, TimeLimit};

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

/// Searches the front of some objectives and writes it into a folder; `None` if the watcher stopped it before any
/// placement was scored.
///
/// # Errors
/// Files that cannot be read or written, objectives that the vehicle does not have, no placement with a value of each.
pub fn front(
    new: &NewRun,
    objectives: &FrontObjectives,
    max_seconds: Option<f64>,
    computing: &Computing<'_>,
) -> Result<Option<Fronted>, Error> {
    let _session = Session::begin();
    let (start, watcher) = (Instant::now(), computing.watcher);
    let scenes: Vec<PathBuf> = new.files.scenes().cloned().collect();
    note_repeated(&scenes, watcher);
    let (begun, settings) = (new.begun()?, new.settings()?);
    let time = max_seconds.map(|s| TimeLimit { start, length: Duration::from_secs_f64(s) });
    let mut loaded = opening::job_within(&begun.files, time, computing)?;
    loaded.suite(computing)?;
    let mut inputs = Vec::new();
    for scene in loaded.job.scenes() {
        inputs.extend(Input::of(scene.scene().files())?);
    }
    let job = loaded.job.search(settings).engine(computing.engine.clone()).within(time);
    job.check_front(objectives)?;
    watcher.listen(GRACE);
    // Before the search, so that a folder that cannot be written is found out now.
    let folder = RunDir::create("optimize", new.out.as_deref(), &begun.folder(), inputs)?;
    let mut bars = Bars::new(watcher);
    let found = job.front(objectives, &mut |event: &Event| {
        bars.show(event);
        watcher.goes_on()
    })?;
    bars.clear();
    if !is_worth_writing(&found, &begun, watcher)? {
        return Ok(None);
    }
    let limit = max_seconds.filter(|_| found.stopped == FrontStopped::Time);
    let context = FrontContext {
        scene: job.scene().name().to_owned(),
        settings: settings_json(&begun, &job, objectives, max_seconds),
        command: command_of(&begun, &job, objectives, limit),
        conditions: begun.files.conditions.clone(),
        seconds: start.elapsed().as_secs_f64(),
    };
    let record = FrontRecord::new(&found, context);
    write(&folder, &job, &found, &record)?;
    Ok(Some(Fronted { front: found, record, folder: folder.path().to_owned() }))
}

/// False where the search was stopped before it found anything; notes an end before all limits were looked at.
fn is_worth_writing(found: &Front, begun: &Begun, watcher: &dyn Watcher) -> Result<bool, Error> {
    match (found.points.len(), found.stopped) {
        (0, FrontStopped::Interrupted) => {
            watcher.note("stopped before any placement was scored; nothing is written");
            Ok(false)
        }
        (0, _) => Err(Error::Usage(format!(
            "{}: no placement found has a value of each of {}; give the scene frames in which something moves, or move \
             the mounts",
            begun.files.scene.display(),
            found.objectives.names().join(", ")
        ))),
        (_, FrontStopped::Complete) => Ok(true),
        (_, stopped) => {
            watcher.note(&format!("stopped: {stopped}; a front is not resumed"));
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
) -> String {
    let names = objectives.names().join(",");
    format!("{} --front {}", command(begun, job.settings(), max_seconds), word(&names))
}

/// Every setting that decides about the front.
fn settings_json(
    begun: &Begun,
    job: &Job,
    objectives: &FrontObjectives,
    max_seconds: Option<f64>,
) -> Value {
    let (mut all, settings) = (json!(begun.files), job.settings());
    all["front"] = json!(objectives);
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
    folder: &RunDir<Saved>,
    job: &Job,
    found: &Front,
    record: &FrontRecord,
) -> Result<(), Error> {
    let placements = found.points.iter().map(|point| priced(job, &point.placement));
    let placements: Vec<Value> = placements.collect();
    folder.write_json("placements.json", &json!({ "placements": placements }))?;
    folder.write_text("front.svg", &front_plot(found).svg())?;
    folder.write_text("report.html", &front_html(found, record))?;
    Ok(folder.write_json("result.json", &record.json())?)
}
