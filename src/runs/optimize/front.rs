//! The front of two or three objectives in a folder of its own: searched in one go, recorded at its end.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::bars::Bars;
use super::begun::Saved;
use super::command::command;
use super::record::priced;
use super::request::NewRun;
use crate::files::{Input, RunDir, Session};
use crate::job::{Front, FrontObjectives, FrontStopped};
use crate::report::front::front_plot;
use crate::report::word::word;
use crate::report::{FrontContext, FrontRecord, front_html};
use crate::runs::inputs::note_repeated;
use crate::runs::{Computing, Error, GRACE, opening};
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
    let engine = computing.engine.clone();
    let job = loaded.job.search(settings.clone()).engine(engine).within(time);
    job.check_front(objectives)?;
    watcher.listen(GRACE);
    // Before the search, so that a folder that cannot be written is found out now.
    let folder = RunDir::<Saved>::create("optimize", new.out.as_deref(), &begun.folder(), inputs)?;
    let mut bars = Bars::new(watcher);
    let found = job.front(objectives, &mut |event: &Event| {
        bars.show(event);
        watcher.goes_on()
    })?;
    bars.clear();
    if found.points.is_empty() {
        if found.stopped == FrontStopped::Interrupted {
            watcher.note("stopped before any placement was scored; nothing is written");
            return Ok(None);
        }
        return Err(Error::Usage(format!(
            "{}: no placement found has a value of each of {}; give the scene frames in which something moves, or move \
             the mounts",
            begun.files.scene.display(),
            objectives.names().join(", ")
        )));
    }
    if found.stopped != FrontStopped::Complete {
        watcher.note(&format!("stopped: {}; a front is not resumed", found.stopped));
    }
    let limit = max_seconds.filter(|_| found.stopped == FrontStopped::Time);
    let names = objectives.names().join(",");
    let command = format!("{} --front {}", command(&begun, &settings, limit), word(&names));
    let mut all = json!(begun.files);
    all["front"] = json!(objectives);
    all["search"] = json!({ "evaluations": settings.evaluations, "seed": settings.seed,
        "method": settings.method, "frames": settings.frames, "objective": settings.objective });
    all["max_seconds"] = json!(max_seconds);
    let record = FrontRecord::new(
        &found,
        FrontContext {
            scene: job.scene().name().to_owned(),
            settings: all,
            command,
            conditions: begun.files.conditions.clone(),
            seconds: start.elapsed().as_secs_f64(),
        },
    );
    let placements: Vec<Value> =
        found.points.iter().map(|point| priced(&job, &point.placement)).collect();
    folder.write_json("placements.json", &json!({ "placements": placements }))?;
    folder.write_text("front.svg", &front_plot(&found).svg())?;
    folder.write_text("report.html", &front_html(&found, &record))?;
    folder.write_json("result.json", &record.json())?;
    Ok(Some(Fronted { front: found, record, folder: folder.path().to_owned() }))
}
