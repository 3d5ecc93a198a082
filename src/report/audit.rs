//! Audits as text.

use super::ScoreColumn;
use super::columns::{align_with_notes, table_text};
use super::text::numbered;
use crate::audit::{Audit, LIKES_LOSS, TrialResult};
use crate::score::{Guard, Scores};

/// A row a scene: attempts caught and fooled, and the least Kendall's τ under changes.
pub(crate) fn audits_text(all: &[Audit]) -> String {
    let titles = ["scene", "base", "caught", "fooled", "least τ", "verdict"];
    let names = numbered(all.iter().map(|found| found.scene.clone()));
    let rows = names.into_iter().zip(all).map(|(name, found)| {
        let count = |verdict| found.trials.iter().filter(|t| t.verdict == verdict).count();
        let taus = found.stability.iter().filter_map(|change| change.kendall_tau);
        let least = taus.min_by(f64::total_cmp);
        vec![
            name,
            found.base.name.clone(),
            count(TrialResult::Caught).to_string(),
            count(TrialResult::Fooled).to_string(),
            least.map_or("–".into(), |tau| format!("{tau:.2}")),
            if found.passed { "passed" } else { "FAILED" }.to_owned(),
        ]
    });
    format!("\nall scenes\n{}", table_text(&titles, rows))
}

/// Every attempt to look better while seeing less, and the ranking under every change of the model.
pub(crate) fn audit_text(found: &Audit) -> String {
    let (scene, base) = (&found.scene, &found.base.name);
    let mut text = format!("{scene}: attempts to look better than {base} while seeing less\n");
    let mut rows = vec![titles("attempt", &["verdict"])];
    rows.push(cells(base, &found.base));
    let mut notes = vec![guards_line(&found.base)];
    for trial in &found.trials {
        let mut row = cells(&trial.name, &trial.scores);
        let verdict = match trial.verdict {
            TrialResult::NotFooled => "not fooled",
            TrialResult::Caught => "caught",
            TrialResult::Fooled => "FOOLED",
        };
        row.push(verdict.to_owned());
        rows.push(row);
        let mut below = guards_line(&trial.scores);
        if !trial.fooled.is_empty() {
            below.insert(0, format!("  looks better by {}", trial.fooled.join(", ")));
        }
        notes.push(below);
    }
    text += &align_with_notes(&rows, &notes);
    text += &format!(
        "\n{0} under changes of the model, and `{1}` of all the placements: its change, Kendall's τ with \
         the unchanged ranking (median and worst), Spearman with mean height alone\n",
        found.base.name, found.objective
    );
    text += &stability_text(found);
    text + &verdict(found)
}

/// Scores that say of themselves whether an attempt fooled them, and may be the objective.
const WATCHED: [&str; 4] = ["near_gain", "information_gain", "m_sog_scaled", "m_sog"];

/// Passed, or the scores that were fooled unnoticed; the objective is named where it was not.
fn verdict(found: &Audit) -> String {
    if found.passed {
        return "\npassed\n".to_owned();
    }
    let trials = found.trials.iter().filter(|trial| trial.verdict == TrialResult::Fooled);
    let mut fooled: Vec<&str> = Vec::new();
    for name in trials.flat_map(|trial| &trial.fooled).filter(|name| **name != LIKES_LOSS) {
        if !fooled.contains(name) {
            fooled.push(name);
        }
    }
    let objective = found.objective.as_str();
    let holds = WATCHED.contains(&objective) && !fooled.contains(&objective);
    let holds = if holds { format!("; {objective} was not") } else { String::new() };
    format!("\nFAILED: a score was fooled unnoticed: {}{holds}\n", fooled.join(", "))
}

/// The scores of the base under each change of the model, then the ranking of all placements.
fn stability_text(found: &Audit) -> String {
    let unchanged = std::iter::once(("none", &found.base));
    let changed = found.stability.iter().map(|change| (change.change.as_str(), &change.base));
    let (mut rows, mut notes) = (vec![titles("change", &[])], Vec::new());
    for (change, scores) in unchanged.chain(changed) {
        rows.push(cells(change, scores));
        notes.push(guards_line(scores));
    }
    let names = ["change", "median %", "worst %", "τ median", "τ worst", "height", "first"];
    let two = |v: Option<f64>| v.map_or("–".into(), |v| format!("{v:.2}"));
    let height = two(found.ranking_against_mean_height);
    let mut none = vec![String::new(); names.len()];
    (none[0], none[5], none[6]) = ("none".to_owned(), height, found.base.name.clone());
    let ranking = found.stability.iter().map(|change| {
        vec![
            change.change.clone(),
            format!("{:.2}", 100.0 * change.median_relative_change),
            format!("{:.2}", 100.0 * change.worst_relative_change),
            two(change.median_kendall_tau),
            two(change.kendall_tau),
            two(change.ranking_against_mean_height),
            change.first.clone(),
        ]
    });
    let ranking = table_text(&names, std::iter::once(none).chain(ranking));
    format!("{}\n{ranking}", align_with_notes(&rows, &notes))
}

fn titles(first: &str, last: &[&str]) -> Vec<String> {
    let metrics = ScoreColumn::METRICS.map(ScoreColumn::title);
    let all = [&[first][..], &metrics[..], last].concat();
    all.into_iter().map(str::to_owned).collect()
}

fn cells(name: &str, scores: &Scores) -> Vec<String> {
    let values = ScoreColumn::METRICS.iter().map(|metric| metric.cell(scores));
    std::iter::once(name.to_owned()).chain(values).collect()
}

fn guards_line(scores: &Scores) -> Vec<String> {
    let guards = scores.guards.iter().map(Guard::keyed);
    let mut names: Vec<_> = guards.filter_map(|g| g.split(':').next().map(str::to_owned)).collect();
    names.dedup();
    if names.is_empty() { names } else { vec![format!("  guards: {}", names.join(", "))] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::audit::Trial;

    #[test]
    fn the_start_of_an_audit_shows_its_own_guards() {
        let guards = vec![crate::score::Guard::ShortSight { lost: 0.05 }];
        let found = Audit {
            scene: "room".to_owned(),
            objective: "near_gain".to_owned(),
            base: Scores { name: "start".to_owned(), guards, ..Scores::default() },
            trials: Vec::new(),
            stability: Vec::new(),
            ranking_against_mean_height: None,
            passed: true,
        };
        let text = audit_text(&found);
        let lines: Vec<&str> = text.lines().collect();
        for name in ["start ", "none "] {
            let row = lines.iter().position(|line| line.starts_with(name)).unwrap();
            assert_eq!(lines[row + 1], "  guards: short_sight", "{name}: {text}");
        }
        let ranking = lines.iter().rposition(|line| line.starts_with("none ")).unwrap();
        assert!(lines[ranking].ends_with("  start"), "{text}");
        assert!(text.ends_with("\npassed\n"), "{text}");
        // A score that was fooled where a guard tells, or that likes blindness, is none of them.
        let trial = |fooled: &[&'static str], verdict| Trial {
            name: "down".to_owned(),
            scores: found.base.clone(),
            fooled: fooled.to_vec(),
            verdict,
        };
        let trials = vec![
            trial(&["m_sog", "s_mig"], TrialResult::Fooled),
            trial(&["information_gain"], TrialResult::Caught),
            trial(&["m_sog", "m_sog_scaled"], TrialResult::Fooled),
        ];
        let failed = Audit { trials, passed: false, ..found };
        let words = "\nFAILED: a score was fooled unnoticed: m_sog, m_sog_scaled";
        assert!(audit_text(&failed).ends_with(&format!("{words}; near_gain was not\n")));
        let failed = Audit { objective: "m_sog".to_owned(), ..failed };
        assert!(audit_text(&failed).ends_with(&format!("{words}\n")));
    }
}
