//! Audits and verifications as text, and a placement against others.

use super::text::{align_columns, numbered};
use super::{SceneRecord, ScoreColumn};
use crate::audit::{Audit, TrialResult};
use crate::scan::conditions::under;
use crate::score::{Interval, Scores, bootstrap};
use crate::search::Scored;
use crate::verify::Verification;

/// Times that scenes are drawn.
const RESAMPLES: usize = 10_000;

/// A result against one baseline.
#[derive(Debug, Clone, PartialEq)]
pub struct Against<'a> {
    /// Name of the baseline.
    pub name: &'a str,
    /// Gain of the baseline, as a share.
    pub gain: f64,
    /// Gain of the result less that of the baseline.
    pub difference: f64,
    /// 95 % interval of the difference over scenes, mirror images counting with their scene; `None` for one scene.
    pub interval: Option<Interval>,
}

/// The result against every baseline that gains anything, in their order, by a share: see [`ScoreColumn::argued`].
pub fn against<'a>(
    best: &Scored,
    baselines: &'a [Scored],
    scenes: &[SceneRecord],
    seed: u64,
    column: ScoreColumn,
) -> Vec<Against<'a>> {
    let share = |scores: &Scores| column.share(scores);
    let compare = |baseline: &'a Scored| {
        let (ours, theirs) = (share(&best.scores)?, share(&baseline.scores)?);
        // A scene and its mirror image are two frames of one place.
        let mut differences: Vec<Vec<f64>> = Vec::new();
        let pairs = best.by_scene.iter().zip(&baseline.by_scene);
        for (scene, (ours, theirs)) in scenes.iter().zip(pairs) {
            let difference =
                share(&ours.scores).unwrap_or(0.0) - share(&theirs.scores).unwrap_or(0.0);
            match differences.last_mut().filter(|_| scene.mirrored) {
                Some(place) => place.push(difference),
                None => differences.push(vec![difference]),
            }
        }
        let several = differences.len() > 1;
        let interval = several.then(|| bootstrap(&differences, RESAMPLES, seed)).flatten();
        let (name, difference) = (baseline.placement.name.as_str(), ours - theirs);
        Some(Against { name, gain: theirs, difference, interval })
    };
    baselines.iter().filter_map(compare).collect()
}

/// Differences of a GPU from the CPU reference, and of that from `f64`, a line each.
pub fn verification_text(scene: &str, conditions: &[String], found: &Verification) -> String {
    let lines = |rows: &[(&str, String)]| {
        let row = |(name, value): &(&str, String)| vec![format!("  {name}"), value.clone()];
        align_columns(&rows.iter().map(row).collect::<Vec<_>>())
    };
    let (gpu, reference) = (&found.gpu_against_cpu, &found.cpu_against_f64);
    let mut text = format!(
        "{scene}: {} placements × {} frame(s){}\nGPU ({}) against the CPU reference:\n",
        found.placements,
        found.frames,
        under(conditions),
        found.adapter
    );
    text += &lines(&[
        ("beams", gpu.beams.to_string()),
        ("differing triangle ids", gpu.triangles.to_string()),
        ("differing distances", gpu.distances.to_string()),
        ("largest distance between answers, m", gpu.largest_distance.to_string()),
        ("covered voxels", gpu.voxels.to_string()),
        ("differing voxels", gpu.differing_voxels.to_string()),
        ("scores", gpu.scores.to_string()),
        ("differing scores", gpu.differing_scores.to_string()),
    ]);
    for cause in &found.causes {
        text += &format!("  cause: {cause}\n");
    }
    text += "CPU reference against all triangles in f64:\n";
    let grazing = format!("differing, grazing (an edge within {} m)", found.edge_tolerance);
    text += &lines(&[
        ("beams", reference.beams.to_string()),
        (&grazing, reference.grazing.to_string()),
        ("differing, tie", reference.tie.to_string()),
        ("differing, unexplained", reference.unexplained.to_string()),
    ]);
    text + if found.passed { "passed\n" } else { "FAILED\n" }
}

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
