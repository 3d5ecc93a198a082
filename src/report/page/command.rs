//! The command that repeats a run, put together from its settings.

use serde_json::{Value, json};

use crate::report::RunRecord;
use crate::report::word::word;

/// The command line that a run's settings come from.
pub fn command(run: &RunRecord) -> String {
    let all = &run.settings;
    let search = &all["search"];
    let mut words = vec!["sightline".to_owned(), "optimize".to_owned()];
    let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
    words.push(of_value(&all["scene"]));
    words.extend(list(&all["more_scenes"]).iter().map(of_value));
    let mut give = |option: &str, value: &Value| {
        if !value.is_null() {
            words.extend([format!("--{option}"), of_value(value)]);
        }
    };
    give("vehicle", &all["vehicle"]);
    give("budget", &all["budget"]);
    give("objective", &search["objective"]);
    give("method", &all["method"]);
    give("seed", &search["seed"]);
    give("evaluations", &search["evaluations"]);
    give("population", &search["population"]);
    give("target", &all["target"]);
    give("max-seconds", &all["max_seconds"]);
    let delta = &search["delta"];
    let spacing = delta.is_object().then(|| format!("{},{}", delta["metres"], delta["radians"]));
    give("delta", &json!(spacing));
    match all["frames"].as_u64() {
        Some(frames) if frames == u64::from(u32::MAX) => give("fidelity", &json!("full")),
        _ => give("frames", &all["frames"]),
    }
    for condition in list(&all["conditions"]) {
        give("condition", &condition);
    }
    for rule in list(&all["rules"]["fixed"]) {
        give("fix", &json!(format!("{}={}", rule[0].as_str().unwrap_or_default(), rule[1])));
    }
    give("baselines", &all["baselines_file"]);
    give("inject", &all["starts_file"]);
    give("backend", &json!(run.backend));
    let flags = [
        ("mirror", &all["mirror"]),
        ("symmetric", &all["rules"]["symmetric"]),
        ("equal-height", &all["rules"]["equal_height"]),
    ];
    let flags = flags.into_iter().filter(|(_, value)| value.as_bool() == Some(true));
    words.extend(flags.map(|(name, _)| format!("--{name}")));
    words.join(" ")
}

/// A value as one word of a shell.
fn of_value(value: &Value) -> String {
    word(&value.as_str().map_or_else(|| value.to_string(), str::to_owned))
}
