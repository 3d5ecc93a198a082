//! The search: convergence, properties that go with the score, and how the run was made.

use maud::{DOCTYPE, Markup, html};

use super::layout::{figure, table, text};
use super::{Figures, Subject, head, layout, unbroken};
use crate::job::Front;
use crate::report::front::{front_plot, front_rows, front_verdict, has_requirements, picks_of};
use crate::report::record::steps_of_generations;
use crate::report::{
    FrontRecord, RunRecord, certificate_in_words, methods_in_words, optional, scores_text,
};
use crate::scan::conditions::under;

/// Section of the page on how the result was found.
pub(super) fn search(run: &RunRecord, figures: &Figures) -> Markup {
    html! {
        section aria-labelledby="search" {
            h2 #search { "The search" }
            @if let Some(svg) = &figures.convergence {
                (figure(svg, "Convergence of the search"))
                (steps(run))
            }
            (notes(run))
            (facts(run))
            (findings(run))
        }
    }
}

/// Frames that the lines of the convergence are taken over.
fn steps(run: &RunRecord) -> Markup {
    let steps = run.fidelity.as_ref().map_or(&[][..], |frames| &frames.steps);
    let steps = steps_of_generations(steps, run.generations);
    let first = steps.first().map_or(run.search_frames, |(_, frames)| *frames as usize);
    html! {
        p.small {
            "The best and the median are over " (first) " frame(s)"
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
        @for (title, lines) in [("Rules kept", &run.constraints), ("Restarts", &run.ended)] {
            @if !lines.is_empty() { p { (title) ": " (lines.join("; ")) "." } }
        }
        @for layout in &run.left_out {
            p { "Not started from " (layout.name) ": " (layout.why.join("; ")) "." }
        }
        @if let Some(words) = run.fidelity.as_ref().map(|frames| frames.words.as_str()) {
            p { "Fidelity: " (words) "." }
        }
    }
}

/// Properties of layouts that go with the objective.
fn findings(run: &RunRecord) -> Markup {
    let row = |finding: &crate::search::Finding| {
        let mut row = vec![text(finding.property)];
        row.push(text(optional(finding.correlation, 2)));
        row.push(text(optional(finding.beside_height, 2)));
        (false, row)
    };
    let rows: Vec<_> = run.findings.iter().map(row).collect();
    html! {
        @if !rows.is_empty() {
            h3 { "What goes with the score" }
            p {
                "Rank correlations (Spearman) of properties of layouts with the objective over random \
                 placements, and what is left of them with mean height, the null model, held fixed."
            }
            (table("Properties of layouts", &["property", "correlation", "beside mean height"], &rows))
        }
    }
}

/// Facts of how the run was made, a line each.
fn facts(run: &RunRecord) -> Markup {
    let times = &run.timings;
    let facts = [
        ("stopped by", run.stopped.clone()),
        (
            "evaluations",
            format!(
                "{} in {} generations, at last over {} frame(s); scores above are over {}",
                run.evaluations, run.generations, run.search_frames, run.frames
            ),
        ),
        ("rate", format!("{:.1} placements × frames/s", run.rate)),
        ("backend", format!("{}: {}", run.backend, run.adapter)),
        ("seed", run.seed.to_string()),
        (
            "time",
            format!(
                "{:.1} s: load {:.1}, build {:.1}, search {:.1}, confirm {:.1}, page {:.1}",
                times.total, times.load, times.build, times.search, times.confirm, times.page
            ),
        ),
        ("found by", methods_in_words(run)),
        ("draw", run.climbs.map_or("nothing was swapped".into(), |climbs| climbs.to_string())),
        ("certificate", certificate_in_words(run)),
    ];
    html! {
        dl { @for (name, value) in facts { div { dt { (name) } dd { (value) } } } }
    }
}

/// The page of a front, one file that loads nothing.
pub fn front_html(front: &Front, record: &FrontRecord) -> String {
    let verdict = front_verdict(front);
    let (first, rest) = verdict.split_once(". ").unwrap_or((&verdict, ""));
    html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("sightline: front in {}", record.scene)))
            body {
                header {
                    p.scene { "sightline · " (record.scene) (under(&record.conditions)) }
                    h1 { (unbroken(first)) "." }
                    @if !rest.is_empty() { p { (rest) "." } }
                }
                main {
                    (trade(front))
                    (sensors(front))
                    (scores(front))
                    (repeat(record))
                }
                footer { p { "Made by sightline " (env!("CARGO_PKG_VERSION")) "." } }
            }
        }
    }
    .into_string()
}

/// The picture, and the table with the picks.
fn trade(front: &Front) -> Markup {
    let (titles, rows) = front_rows(front);
    let titles: Vec<&str> = titles.iter().map(String::as_str).collect();
    let is_picked = |k: usize| !picks_of(front, k).is_empty();
    let rows: Vec<(bool, Vec<Markup>)> = rows
        .iter()
        .enumerate()
        .map(|(k, row)| (is_picked(k), row.iter().map(layout::text).collect()))
        .collect();
    html! {
        section aria-labelledby="front" {
            h2 #front { "The front" }
            p {
                "Each point is a placement that no other one found beats in all objectives together."
                @if has_requirements(front) {
                    " One that misses a requirement takes the place of none that meets all."
                }
                " The knee is farthest from the line or plane between the best of each objective, each axis scaled to \
                 [0, 1]. Sensors are chosen on a coarse grid of poses: other placements may be better."
            }
            div.paper { (layout::figure(&front_plot(front).svg(), "The objectives against each other")) }
            (layout::table("Points of the front", &titles, &rows))
        }
    }
}

/// Sensors of each point.
fn sensors(front: &Front) -> Markup {
    html! {
        section aria-labelledby="sensors" {
            h2 #sensors { "Sensors" }
            ul { @for point in &front.points { li { (point.placement.name) ": " (point.equipment) } } }
        }
    }
}

/// Scores, requirements and guards of all points.
fn scores(front: &Front) -> Markup {
    let all: Vec<_> = front.points.iter().map(|point| point.scores.clone()).collect();
    html! {
        section aria-labelledby="scores" {
            h2 #scores { "Scores, requirements and guards" }
            pre.wide tabindex="0" role="group" aria-label="Scores" { code { (scores_text(&all)) } }
        }
    }
}

/// The command, and every setting behind it.
fn repeat(record: &FrontRecord) -> Markup {
    html! {
        section aria-labelledby="repeat" {
            h2 #repeat { "How to repeat it" }
            p { "Stopped: " (record.stopped) "." }
            pre.wide tabindex="0" role="group" aria-label="Command" {
                code { (record.command) " --backend " (record.backend) }
            }
            details {
                summary { "Every setting" }
                pre.wide tabindex="0" role="group" aria-label="Settings" {
                    code { (format!("{:#}", record.settings)) }
                }
            }
        }
    }
}

/// The command, and every setting behind it.
pub(super) fn repeat_repeat(subject: &Subject<'_>, run: Option<&RunRecord>) -> Markup {
    html! {
        section aria-labelledby="repeat" {
            h2 #repeat { "How to repeat it" }
            pre.wide tabindex="0" role="group" aria-label="Command" { code { (subject.command) } }
            @if let Some(run) = run {
                p { (promise(run)) }
                details {
                    summary { "Every setting" }
                    pre.wide tabindex="0" role="group" aria-label="Settings" {
                        code { (format!("{:#}", run.settings)) }
                    }
                }
            }
        }
    }
}

/// Sentence on how close a repeated run comes to this one.
fn promise(run: &RunRecord) -> String {
    let mut words =
        format!("Needed: sightline {}, the same files and the same backend. ", run.sightline);
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
