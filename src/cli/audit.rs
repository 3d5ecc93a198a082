//! `sightline audit`: attempts to fool the scores, and rankings under changes of the model, scene by scene.

use std::path::{Path, PathBuf};

use crate::audit::{AUDIT_PARTS, Audit, AuditEvent, AuditSettings, Verdict, audit};
use crate::internals::{ScoreColumn, align_columns};
use crate::score::Scores;
use crate::vehicle::{Placement, read_placements, table_7};
use serde_json::json;

use super::args::{Compute, Format};
use super::error::Error;
use super::exit::Exit;
use super::files::{Files, told_apart};
use super::{load, progress};

#[derive(clap::Args)]
#[command(after_help = "Examples:
  sightline audit scenes/highway.json
  sightline audit scenes/highway.json scenes/residential.json scenes/placements.json")]
pub struct Args {
    /// Scene files, and placements to start from, which should be sound ones: the best of them is changed so
    /// that it sees less, and no score may rise unnoticed [default: Table 7 of the paper]
    #[arg(value_name = "SCENE… [PLACEMENTS]", required = true)]
    files: Vec<PathBuf>,
    /// Score by which the best placement is chosen, and that is watched while the model changes
    #[arg(long, default_value_t = AuditSettings::default().objective.to_string())]
    objective: String,
    /// Frames to average over, spread evenly over the scene [default: 2]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// How to print
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    compute: Compute,
}

pub fn run(args: &Args) -> Result<Exit, Error> {
    args.compute.start()?;
    let Files { scenes, placements } = Files::sort(&args.files)?;
    let honest = match &placements {
        Some(path) => read_placements(path)?,
        None => table_7(),
    };
    let settings = AuditSettings {
        objective: args.objective.parse()?,
        frames: args.frames.unwrap_or(AuditSettings::default().frames),
        engine: args.compute.engine(),
    };
    let mut all = Vec::new();
    for path in &scenes {
        let found = of_scene(path, &honest, &settings, args)?;
        if args.format == Format::Text {
            out!("{}", if all.is_empty() { "" } else { "\n" })?;
            print(&found)?;
        }
        all.push(found);
    }
    let passed = all.iter().all(|found| found.passed);
    match (args.format, &all[..]) {
        (Format::Json, [found]) => outln!("{}", json!(found))?,
        (Format::Json, all) => outln!("{}", json!({ "scenes": all, "passed": passed }))?,
        (Format::Text, [_]) => {}
        (Format::Text, all) => print_summary(all)?,
    }
    Ok(if passed { Exit::Done } else { Exit::CheckFailed })
}

/// The audit of one scene.
fn of_scene(
    path: &Path,
    honest: &[Placement],
    settings: &AuditSettings,
    args: &Args,
) -> Result<Audit, Error> {
    let talk = args.compute.talk;
    let (scene, psog, _) = load::scene_and_psog(path, &args.compute)?;
    load::note_frames(&scene, args.frames, talk);
    let bar = progress::bar(AUDIT_PARTS, "parts", talk);
    let tell = |event: AuditEvent| match event {
        AuditEvent::Note(note) => talk.note(note),
        AuditEvent::PartDone => bar.inc(1),
    };
    let found = audit(&scene, &psog, honest, settings, &tell)?;
    bar.finish_and_clear();
    Ok(found)
}

/// A row a scene: what each attempt came to, and the least that the ranking kept under changes.
fn print_summary(all: &[Audit]) -> Result<(), Error> {
    let titles = ["scene", "base", "caught", "fooled", "least τ", "verdict"];
    let mut rows = vec![titles.map(str::to_owned).to_vec()];
    let names = told_apart(all.iter().map(|found| found.scene.clone()));
    for (name, found) in names.into_iter().zip(all) {
        let count = |verdict| found.trials.iter().filter(|t| t.verdict == verdict).count();
        let taus = found.stability.iter().filter_map(|change| change.kendall_tau);
        let least = taus.min_by(f64::total_cmp);
        rows.push(vec![
            name,
            found.base.name.clone(),
            count(Verdict::Caught).to_string(),
            count(Verdict::Fooled).to_string(),
            least.map_or("–".into(), |tau| format!("{tau:.2}")),
            if found.passed { "passed" } else { "FAILED" }.to_owned(),
        ]);
    }
    outln!("\nall scenes")?;
    out!("{}", align_columns(&rows))
}

fn print(found: &Audit) -> Result<(), Error> {
    outln!("{}: attempts to look better than {} while seeing less", found.scene, found.base.name)?;
    let metrics = ScoreColumn::METRICS.map(ScoreColumn::title);
    let titles = [&["attempt"][..], &metrics, &["verdict", "looks better by", "guards"]].concat();
    let mut rows = vec![titles.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    rows.push(cells(&found.base.name, &found.base));
    for trial in &found.trials {
        let mut row = cells(&trial.name, &trial.scores);
        let verdict = match trial.verdict {
            Verdict::NotFooled => "not fooled",
            Verdict::Caught => "caught",
            Verdict::Fooled => "FOOLED",
        };
        row.extend([verdict.to_owned(), trial.fooled.join(", "), guard_names(&trial.scores)]);
        rows.push(row);
    }
    out!("{}", align_columns(&rows))?;
    outln!(
        "\n{0} under changes of the model, and `{1}` of all the placements: its change, Kendall's τ with \
         the unchanged ranking (median and worst), Spearman with mean height alone",
        found.base.name,
        found.objective
    )?;
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
    out!("{}", align_columns(&rows))?;
    outln!("{}", if found.passed { "\npassed" } else { "\nFAILED: a score was fooled unnoticed" })
}

/// A name and the value of each metric.
fn cells(name: &str, scores: &Scores) -> Vec<String> {
    let values = ScoreColumn::METRICS.iter().map(|metric| metric.cell(scores));
    std::iter::once(name.to_owned()).chain(values).collect()
}

/// Names of the guards that speak against a placement.
fn guard_names(scores: &Scores) -> String {
    let guards = scores.guards.iter().map(ToString::to_string);
    let mut names: Vec<_> = guards.filter_map(|g| g.split(':').next().map(str::to_owned)).collect();
    names.dedup();
    names.join(", ")
}
