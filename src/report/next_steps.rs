//! Steps to take next where a result misses requirements.

use serde_json::Value;

use super::RunRecord;

/// Next steps for a user: more time if it ended before the sensors were chosen; requirements out of reach; then changes that let
/// a search find more. Empty if the time sufficed and all requirements are met.
pub fn next_in_words(run: &RunRecord) -> Vec<String> {
    let cut = cut_in_words(&run.settings);
    let is_cut = cut.is_some();
    let mut steps: Vec<String> = cut.into_iter().collect();
    let required = run.best.iter().flat_map(|best| &best.scores.required);
    let unmet: Vec<String> =
        required.filter(|seen| !seen.is_met()).map(|seen| format!("{}: ", seen.name)).collect();
    if unmet.is_empty() {
        return steps;
    }
    let beyond = run.settings["equipped"]["out_of_reach"].as_array();
    let beyond: Vec<&str> = beyond.into_iter().flatten().filter_map(Value::as_str).collect();
    steps.extend(beyond.iter().map(|words| format!("Out of reach: {words}.")));
    let is_beyond = |name: &String| beyond.iter().any(|words| words.starts_with(name));
    if !unmet.iter().all(is_beyond) {
        let evaluations = 2 * run.settings["search"]["evaluations"].as_u64().unwrap_or(180);
        let budget = run.settings["budget"]
            .as_f64()
            .filter(|_| !is_cut)
            .map_or(String::new(), |budget| format!("a --budget above {budget}, "));
        let time = match run.settings["max_seconds"].is_number() {
            true => "more time (--resume goes on), ",
            false => "",
        };
        // Limits that LiDARs stand at tell that the mounts are in the way, not the length of the search.
        let [mounts, last] = match run.active_bounds.len() {
            0 => ["", ", more or wider mounts"],
            _ => {
                ["wider mounts where LiDARs stand at a limit (named below), or more of them, ", ""]
            }
        };
        steps.push(format!(
            "Next, since requirements are not met, in this order: {time}{mounts}{budget}another seed (--seed {}), more \
             evaluations (--evaluations {evaluations}){last}.",
            run.seed + 1
        ));
    }
    steps
}

/// Sentence on a time that ended before the sensors were chosen; `None` where they were.
fn cut_in_words(settings: &Value) -> Option<String> {
    let equipped = &settings["equipped"];
    let [cost, budget] = [&equipped["cost"], &settings["budget"]].map(Value::as_f64);
    let spent = cost.zip(budget).map(|(cost, budget)| format!(" ({cost} of {budget} spent)"));
    let spent = spent.unwrap_or_default();
    let had = settings["max_seconds"].as_f64();
    let had = had.map_or("it had".to_owned(), |seconds| format!("the {seconds} s it had"));
    (equipped["is_cut"] == true).then(|| {
        format!(
            "The time ended while the sensors were chosen{spent}: go on with --resume and more time than {had}; \
             poses for the choice are cast anew."
        )
    })
}
