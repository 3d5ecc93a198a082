//! `score` and `view`: scores of placements, and a page about one of them.

use super::args::Computed;
use super::output::{Exit, stdout, unless_closed};
use crate::job::Tolerance;
use crate::report::words::word;
use crate::runs::cast::{ViewRequest, view};
use crate::runs::score::{ScoreRequest, score};
use crate::runs::{RunError, Watcher};

pub(super) type ScoreArgs = Computed<ScoreRequest>;

pub(super) fn run(args: &ScoreArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let computing = args.computing(&terminal);
    let mut is_met = true;
    let scored = score(&args.request, &computing, &mut stdout());
    unless_closed(scored.map(|met| is_met = met))?;
    Ok(if terminal.goes_on() && !is_met { Exit::CheckFailed } else { terminal.exit() })
}

pub(super) type ViewArgs = Computed<ViewRequest>;

pub(super) fn run_view(args: &ViewArgs) -> Result<Exit, RunError> {
    let terminal = args.compute.start()?;
    let (command, tolerance) = (command(args), tolerance(args));
    let request = ViewRequest { command, tolerance, ..args.request.clone() };
    let is_met = view(&request, &args.computing(&terminal))?;
    Ok(if is_met { Exit::Done } else { Exit::CheckFailed })
}

/// The command that was given, to be copied into a shell in the same folder; the page is written anew.
fn command(args: &ViewArgs) -> String {
    let mut words = vec!["sightline".to_owned(), "view".to_owned()];
    words.extend(args.request.files.iter().map(|file| word(file)));
    let mut give = |option: &str, value: &str| words.extend([format!("--{option}"), word(value)]);
    args.request.baselines.iter().for_each(|baseline| give("baselines", baseline));
    let tolerance = args.request.mounting.tolerance;
    if tolerance != Tolerance::default() {
        give("tolerance", &tolerance.to_string());
    }
    words.extend(of_rig(args));
    words.extend(["--out".to_owned(), word(&args.request.out.to_string_lossy())]);
    words.push("--force".to_owned());
    words.join(" ")
}

/// The command that asks how far each LiDAR may be off.
fn tolerance(args: &ViewArgs) -> String {
    let mut words = vec!["sightline study tolerance".to_owned()];
    words.extend(args.request.files.iter().map(|file| word(file)));
    words.extend(of_rig(args));
    words.join(" ")
}

/// Options on weather, models and vehicle.
fn of_rig(args: &ViewArgs) -> Vec<String> {
    let mut words = Vec::new();
    let mut give = |option: &str, value: &str| words.extend([format!("--{option}"), word(value)]);
    args.request.conditions.condition.iter().for_each(|one| give("condition", &one.to_string()));
    args.named.sensor.iter().for_each(|choice| give("sensor", &choice.to_string()));
    args.compute.vehicle.iter().for_each(|file| give("vehicle", &file.to_string_lossy()));
    words
}
