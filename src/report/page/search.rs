//! The search: convergence, properties that go with the score, and how the run was made.

use maud::{Markup, html};
use serde_json::Value;

use super::layout::{figure, prose, table, text};
use super::{Figures, Looks, Subject, report_html};
use crate::job::{Found, Job, JobError};
use crate::json::counted;
use crate::report::record::{evaluations_in_words, steps_of_generations};
use crate::report::text::{finding_rows, limit_of, rule_lines};
use crate::report::words::{climbs_in_words, frames_in_words};
use crate::report::{RunRecord, certificate_in_words, methods_in_words};
use crate::search::Scored;

pub(super) fn search(run: &RunRecord, figures: &Figures) -> Markup {
    html! {
        @if let Some(svg) = &figures.convergence {
            (figure(svg, "Convergence of the search"))
            (steps(run))
        }
        (notes(run))
        (facts(run))
        (findings(run))
    }
}

/// Frames that the lines of the convergence are taken over.
fn steps(run: &RunRecord) -> Markup {
    let steps = run.fidelity.as_ref().map_or(&[][..], |frames| &frames.steps);
    let steps = steps_of_generations(steps, run.generations);
    let first = steps.first().map_or(run.search_frames, |(_, frames)| *frames as usize);
    html! {
        p.small {
            "The best and the median are over " (counted(first, "frame"))
            @if steps.len() > 1 {
                " at first, and over other numbers of them behind each upright line, whose two sides do not compare"
            }
            "; the lines across are over "
            @if run.confirmed_frames == run.frames { "all " }
            (run.confirmed_frames) "."
        }
    }
}

/// Rules, restarts, layouts left out and frames, a sentence each.
fn notes(run: &RunRecord) -> Markup {
    html! {
        @if !run.constraints.is_empty() {
            p { "Rules kept:" }
            ul.guards { @for line in rule_lines(&run.constraints) { li { (prose(&line)) } } }
        }
        @if !run.ended.is_empty() { p { "Restarts: " (run.ended.join("; ")) "." } }
        @for layout in &run.left_out {
            p { "Not started from " (layout.name) ": " (layout.why.join("; ")) "." }
        }
        @if let Some(words) = run.fidelity.as_ref().map(|frames| frames.words.as_str()) {
            p { "Fidelity: " (prose(words)) "." }
        }
    }
}

fn findings(run: &RunRecord) -> Markup {
    let rows = finding_rows(&run.findings).into_iter();
    let rows: Vec<_> = rows.map(|row| (false, row.into_iter().map(text).collect())).collect();
    html! {
        @if !rows.is_empty() {
            h3 { "Properties that go with the score" }
            p {
                "Rank correlations (Spearman) of properties of layouts with the objective over random \
                 placements, and what is left of them with mean height, the null model, held fixed."
            }
            (table("Properties of layouts", &["property", "rank correlation", "with mean height held fixed"], rows))
        }
    }
}

/// Facts of how the run was made, a line each.
fn facts(run: &RunRecord) -> Markup {
    let times = &run.timings;
    let equip = match times.equip > 0.0 {
        true => format!(", choice of sensors {:.1}", times.equip),
        false => String::new(),
    };
    let facts = [
        ("stopped by", limit_of(run).map_or(run.stopped.clone(), |words| words.concat())),
        (
            "evaluations",
            format!(
                "{}; {}, at last over {}; scores above are over {}",
                evaluations_in_words(run),
                counted(run.generations as usize, "generation"),
                counted(run.search_frames, "frame"),
                frames_in_words(run.confirmed_frames, run.frames)
            ),
        ),
        ("rate", format!("{:.1} placements × frames/s", run.rate)),
        ("backend", format!("{}: {}", run.backend, run.adapter)),
        ("seed", run.seed.to_string()),
        (
            "time",
            format!(
                "{:.1} s: load {:.1}, build {:.1}{equip}, search {:.1}, confirm {:.1}, page {:.1}",
                times.total, times.load, times.build, times.search, times.confirm, times.page
            ),
        ),
        ("found by", methods_in_words(run)),
        ("how sure", climbs_in_words(run).unwrap_or_else(|| "nothing was swapped".into())),
        ("bound", certificate_in_words(run)),
    ];
    html! {
        dl { @for (name, value) in &facts { div { dt { (name) } dd { (prose(value)) } } } }
    }
}

/// Page of a search that a caller of the library ran, without a command. Losses of LiDARs are left out once `go_on`,
/// which is asked often, says no.
///
/// # Errors
/// An engine that fails.
pub fn found_html(
    job: &Job,
    found: &Found,
    record: &RunRecord,
    go_on: &mut dyn FnMut() -> bool,
) -> Result<String, JobError> {
    let (best, suite) = (record.best.as_ref(), &found.suite);
    let look = |best: &Scored| Looks::new(job, suite, &best.placement, &record.baselines, go_on);
    let looks = best.map(look).transpose()?;
    let figures = Figures::new(best, suite.constraints(), &job.scene().body(), looks)
        .with_search(record, &found.outcome.history);
    Ok(report_html(record, &figures, ""))
}

pub(super) fn run_again(subject: &Subject<'_>, run: Option<&RunRecord>) -> Markup {
    let promise = run.map(promise);
    repeat(None, &subject.command, promise.as_deref(), run.map(|run| &run.settings))
}

/// A command, where a program ran, with sentences before and after it, and the settings behind it.
pub(super) fn repeat(
    before: Option<&str>,
    command: &str,
    after: Option<&str>,
    settings: Option<&Value>,
) -> Markup {
    html! {
        @if let Some(sentence) = before { p { (sentence) } }
        @if !command.is_empty() {
            pre.wide tabindex="0" role="group" aria-label="Command" { code { (command) } }
        }
        @if let Some(sentence) = after { p { (sentence) } }
        @if let Some(settings) = settings {
            details {
                summary { "Every setting" }
                pre.wide tabindex="0" role="group" aria-label="Settings" {
                    code { (format!("{settings:#}")) }
                }
            }
        }
    }
}

/// Sentence on how close a repeated run comes to this one.
fn promise(run: &RunRecord) -> String {
    let mut words =
        format!("Needed: sightline {}, the same folder, files and backend. ", run.sightline);
    words += if run.settings["max_seconds"].is_number() {
        "Time ended this run, and a repeated one may come further or less far: its result can differ. Give \
         --evaluations in place of --max-seconds for a run that repeats to the byte."
    } else if run.stopped.starts_with("interrupted") {
        "This run was interrupted. The command runs to the end, and its result can differ."
    } else {
        "They give the same bytes, timings left aside."
    };
    words
}
