//! The command that repeats a run, from its files and settings.

use std::path::Path;

use serde_json::json;

use super::begun::Begun;
use crate::report::word::word;
use crate::search::{FrameChoice, Settings};
use crate::vehicle::MountRules;

/// The command line of a run's files and settings; with `max_seconds` where time ended the run.
pub(super) fn command(begun: &Begun, settings: &Settings, max_seconds: Option<f64>) -> String {
    let path = |path: &Path| path.to_string_lossy().into_owned();
    let mut words = vec!["sightline".to_owned(), "optimize".to_owned()];
    words.extend(begun.files.scenes().map(|scene| word(&path(scene))));
    let mut give = |option: &str, value: Option<String>| {
        words.extend(value.map(|value| format!("--{option} {}", word(&value))));
    };
    let number = |value: Option<f64>| value.map(|value| value.to_string());
    give("vehicle", begun.files.vehicle.as_deref().map(path));
    give("budget", number(begun.files.budget));
    give("tolerance", begun.files.tolerance.map(|tolerance| tolerance.to_string()));
    give("objective", Some(settings.objective.to_string()));
    give("method", json!(settings.method).as_str().map(str::to_owned));
    give("seed", Some(settings.seed.to_string()));
    give("evaluations", Some(settings.evaluations.to_string()));
    give("population", settings.population.map(|count| count.to_string()));
    give("target", number(settings.target));
    give("max-seconds", number(max_seconds));
    give("delta", settings.delta.map(|delta| format!("{},{}", delta.metres, delta.radians)));
    match settings.frames {
        FrameChoice::OnDemand => {}
        FrameChoice::All => give("fidelity", Some("full".to_owned())),
        FrameChoice::Count(frames) => give("frames", Some(frames.to_string())),
    }
    for condition in &begun.files.conditions {
        give("condition", Some(condition.clone()));
    }
    let MountRules { equal_height, symmetric, fixed } = &begun.files.rules;
    for (field, value) in fixed {
        give("fix", Some(format!("{field}={value}")));
    }
    give("baselines", begun.baselines.as_deref().map(path));
    give("inject", begun.inject.as_deref().map(path));
    let flags = [
        ("mirror", begun.files.mirror),
        ("fewest", begun.files.fewest),
        ("symmetric", *symmetric),
        ("equal-height", *equal_height),
    ];
    words
        .extend(flags.into_iter().filter(|(_, given)| *given).map(|(name, _)| format!("--{name}")));
    words.join(" ")
}
