//! `sightline optimize`: options to a request, the result on stdout.

use super::args::Computed;
use super::output::{Exit, Terminal};
use crate::report::front::{front_csv, front_text};
use crate::report::record::record_text;
use crate::report::run_tables::run_csv;
use crate::runs::optimize::{OptimizeRequest, finished, front, holds_front, optimize};
use crate::runs::{RunError, TableFormat, Watcher};
use crate::score::Seen;

pub(super) type OptimizeArgs = Computed<OptimizeRequest>;

/// Options of several commands that the state of a run decides here: --resume refuses them.
const OF_NEW_RUN: [&str; 4] = ["vehicle", "sensor", "tolerance", "condition"];

/// Refuses an option of [`OF_NEW_RUN`] beside --resume.
pub(super) fn of_new_run(arg: clap::Arg) -> clap::Arg {
    if OF_NEW_RUN.contains(&arg.get_id().as_str()) { arg.conflicts_with("resume") } else { arg }
}

pub(super) fn run(args: &OptimizeArgs) -> Result<Exit, RunError> {
    let (request, terminal) = (&args.request, args.compute.start()?);
    if request.front.is_some() {
        return run_front(args, &terminal);
    }
    let draws = request.gltf.gltf.is_some() || request.figures.figures.is_some();
    // Drawings and CSV need scores as values; result.json is not read back into them.
    let is_asked_for_more = draws || request.format == TableFormat::Csv;
    if let Some(folder) = request.resume.as_ref().filter(|_| !is_asked_for_more)
        && let Some(finished) = finished(folder)?
    {
        match request.format {
            TableFormat::Json => out!("{}", finished.result)?,
            _ => outln!("{}", finished.words)?,
        }
        return Ok(if finished.is_met { terminal.exit() } else { Exit::CheckFailed });
    }
    if let Some(folder) = request.resume.as_ref().filter(|folder| holds_front(folder)) {
        if request.gltf.gltf.is_some() {
            let words = "holds a front, of which --gltf draws nothing; leave it out";
            return Err(RunError::Usage(format!("{}: {words}", folder.display())));
        }
        return run_front(args, &terminal);
    }
    if request.evaluations == Some(0) {
        let words = "--evaluations: give a whole number from 1 on; 0 is for --front alone";
        return Err(RunError::Usage(words.to_owned()));
    }
    let found = optimize(request, &args.computing(&terminal))?;
    match (&found, request.format) {
        (None, _) => return Ok(Exit::Interrupted),
        (Some(found), TableFormat::Json) => outln!("{}", found.record.json())?,
        (Some(found), TableFormat::Csv) => out!("{}", run_csv(&found.record))?,
        (Some(found), TableFormat::Text) => out!("{}", record_text(&found.record, &found.folder))?,
    }
    let best = found.and_then(|found| found.record.best);
    let is_met = best.is_none_or(|best| best.scores.required.iter().all(Seen::is_met));
    Ok(if terminal.goes_on() && !is_met { Exit::CheckFailed } else { terminal.exit() })
}

/// `--front`: the front in place of one result.
fn run_front(args: &OptimizeArgs, terminal: &Terminal) -> Result<Exit, RunError> {
    let found = front(&args.request, &args.computing(terminal))?;
    let Some(found) = found else { return Ok(Exit::Interrupted) };
    match args.request.format {
        TableFormat::Json => outln!("{}", found.record.json())?,
        TableFormat::Csv => out!("{}", front_csv(&found.front))?,
        TableFormat::Text => out!("{}", front_text(&found.front, &found.record, &found.folder))?,
    }
    let is_met = found.front.points.iter().any(|point| point.meets);
    Ok(if terminal.goes_on() && !is_met { Exit::CheckFailed } else { terminal.exit() })
}
