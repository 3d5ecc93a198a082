//! The page of a front: its picture, points, sensors and scores.

use maud::{DOCTYPE, Markup, html};

use super::search::repeat;
use super::{head, heading, layout};
use crate::job::Front;
use crate::report::front::{
    all_shown, blind_in_words, front_plot, front_rows, front_verdict, has_requirements, picks_of,
    refined_in_words,
};
use crate::report::text::{notes, requirements_in_words};
use crate::report::{FrontRecord, ScoreColumn};

/// The page of a front, one file that loads nothing.
pub(crate) fn front_html(front: &Front, record: &FrontRecord) -> String {
    let verdict = front_verdict(front);
    let stopped = format!("Stopped: {}.", record.stopped);
    let command = format!("{} --backend {}", record.command, record.backend);
    html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("sightline: front in {}", record.scene)))
            body {
                (heading(&record.scene, &record.conditions, &format!("{verdict}.")))
                main {
                    (trade(front, record))
                    (sensors(front))
                    (scores(front))
                    (repeat(Some(&stopped), &command, None, Some(&record.settings)))
                }
                footer { p { "Made by sightline " (env!("CARGO_PKG_VERSION")) "." } }
            }
        }
    }
    .into_string()
}

/// The picture, and the table with the picks.
fn trade(front: &Front, record: &FrontRecord) -> Markup {
    let is_picked = |k: usize| !picks_of(front, k).is_empty();
    html! {
        section aria-labelledby="front" {
            h2 #front { "The front" }
            p {
                "Each point is a placement that no other one found beats in all objectives together."
                @if has_requirements(front) {
                    " One that misses a requirement takes the place of none that meets all."
                }
                " The knee is farthest from the line or plane between the best of each objective, each axis scaled to \
                 [0, 1]. Sensors are chosen on a coarse grid of poses: other placements may be better. "
                (layout::prose(&sentence(&refined_in_words(front, record))))
                @if has_requirements(front) {
                    " copies %: copies mounted within the tolerance that meet all requirements."
                }
                " " (blind_in_words(front)) "."
                @if !front.baselines.is_empty() {
                    " Diamonds are the baselines: placements to compare with, which take no part in the search."
                }
            }
            div.chart { (layout::figure(&front_plot(front).svg(), "The objectives against each other")) }
            (layout::table_of("Points of the front", &front_rows(front), is_picked))
        }
    }
}

/// Words that begin with a small letter, as a sentence.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    format!("{}{}.", first.unwrap_or_default(), letters.as_str())
}

fn sensors(front: &Front) -> Markup {
    html! {
        section aria-labelledby="sensors" {
            h2 #sensors { "Sensors" }
            ul { @for point in all_shown(front) { li { (point.placement.name) ": " (point.equipment) } } }
        }
    }
}

/// Scores of points and baselines as a table, and below for each its requirements, guards and broken rules.
fn scores(front: &Front) -> Markup {
    let all = || all_shown(front).map(|point| &point.scores);
    let columns = ScoreColumn::shown(all(), "");
    let titles: Vec<&str> = columns.iter().map(|column| column.title()).collect();
    let cells = |scores| columns.iter().map(|column| layout::text(column.cell(scores))).collect();
    let rows = all().map(|scores| (false, cells(scores)));
    html! {
        section aria-labelledby="scores" {
            h2 #scores { "Scores, requirements and guards" }
            (layout::table("Scores of the points", &titles, rows))
            @for words in requirements_in_words(all()) { p.small { (words) } }
            @for scores in all() {
                @let notes = notes(scores);
                @if !notes.is_empty() {
                    h3 { (scores.name) }
                    ul.guards {
                        @for note in &notes { li { (note.trim_start_matches([' ', '+', '!', '*'])) } }
                    }
                }
            }
        }
    }
}
