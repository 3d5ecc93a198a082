//! Audits as text.

use super::ScoreColumn;
use super::text::{align_columns, numbered};
use crate::audit::{Audit, TrialResult};
use crate::score::Scores;

/// A row a scene: attempts caught and fooled, and the least Kendall's τ under changes.
pub fn audits_text(all: &[Audit]) -> String {
    let titles = ["scene", "base", "caught", "fooled", "least τ", "verdict"];
    let mut rows = vec![titles.map(str::to_owned).to_vec()];
    let names = numbered(all.iter().map(|found| found.scene.clone()));
    for (name, found) in names.into_iter().zip(all) {
        let count = |verdict| found.trials.iter().filter(|t| t.verdict == verdict).count();
        let taus = found.stability.iter().filter_map(|change| change.kendall_tau);
        let least = taus.min_by(f64::total_cmp);
        rows.push(vec![
            name,
            found.base.name.clone(),
            count(TrialResult::Caught).to_string(),
            count(TrialResult::Fooled).to_string(),
            least.map_or("–".into(), |tau| format!("{tau:.2}")),
            if found.passed { "passed" } else { "FAILED" }.to_owned(),
        ]);
    }
    format!("\nall scenes\n{}", align_columns(&rows))
}

/// Every attempt to look better while seeing less, and the ranking under every change of the model.
pub fn audit_text(found: &Audit) -> String {
    let (scene, base) = (&found.scene, &found.base.name);
    let mut text = format!("{scene}: attempts to look better than {base} while seeing less\n");
    let metrics = ScoreColumn::METRICS.map(ScoreColumn::title);
    let titles = [&["attempt"][..], &metrics, &["verdict", "looks better by", "guards"]].concat();
    let mut rows = vec![titles.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    rows.push(cells(&found.base.name, &found.base));
    for trial in &found.trials {
        let mut row = cells(&trial.name, &trial.scores);
        let verdict = match trial.verdict {
            TrialResult::NotFooled => "not fooled",
            TrialResult::Caught => "caught",
            TrialResult::Fooled => "FOOLED",
        };
        row.extend([verdict.to_owned(), trial.fooled.join(", "), guard_names(&trial.scores)]);
        rows.push(row);
    }
    text += &align_columns(&rows);
    text += &format!(
        "\n{0} under changes of the model, and `{1}` of all the placements: its change, Kendall's τ with \
         the unchanged ranking (median and worst), Spearman with mean height alone\n",
        found.base.name, found.objective
    );
    let changes = ["median %", "worst %", "τ median", "τ worst", "height", "first", "guards"];
    let titles = [&["change"][..], &metrics, &changes].concat();
    let mut rows = vec![titles.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    let two = |v: Option<f64>| v.map_or("–".into(), |v| format!("{v:.2}"));
    let mut none = cells("none", &found.base);
    none.extend(vec![String::new(); 4]);
    none.push(two(found.ranking_against_mean_height));
    rows.push(none);
    rows.extend(found.stability.iter().map(|change| {
        let mut row = cells(&change.change, &change.base);
        row.extend([
            format!("{:.2}", 100.0 * change.median_relative_change),
            format!("{:.2}", 100.0 * change.worst_relative_change),
            two(change.median_kendall_tau),
            two(change.kendall_tau),
            two(change.ranking_against_mean_height),
            change.first.clone(),
            guard_names(&change.base),
        ]);
        row
    }));
    text += &align_columns(&rows);
    text + if found.passed { "\npassed\n" } else { "\nFAILED: a score was fooled unnoticed\n" }
}

/// A name and the value of each metric.
fn cells(name: &str, scores: &Scores) -> Vec<String> {
    let values = ScoreColumn::METRICS.iter().map(|metric| metric.cell(scores));
    std::iter::once(name.to_owned()).chain(values).collect()
}

/// Names of the guards that a placement violates.
fn guard_names(scores: &Scores) -> String {
    let guards = scores.guards.iter().map(ToString::to_string);
    let mut names: Vec<_> = guards.filter_map(|g| g.split(':').next().map(str::to_owned)).collect();
    names.dedup();
    names.join(", ")
}
