//! The page of a front: its picture, points, sensors and scores.

use maud::{Markup, html};

use super::search::repeat;
use super::{heading, layout, on_backend, section, whole};
use crate::job::Front;
use crate::report::front::{
    all_shown, blind_in_words, front_plot, front_rows, front_verdict, has_copies, has_requirements,
    picks_of, refined_in_words,
};
use crate::report::text::{notes, requirements_in_words};
use crate::report::{FrontRecord, ScoreColumn};

/// The page of a front; without a command where the record has none.
pub fn front_html(front: &Front, record: &FrontRecord) -> String {
    let verdict = front_verdict(front);
    let stopped = format!("Stopped: {}.", record.stopped);
    let command = on_backend(&record.command, &record.backend);
    let again = repeat(Some(&stopped), &command, None, Some(&record.settings));
    let head = heading(("", &record.scene), &record.conditions, &format!("{verdict}."));
    let main = html! {
        (section("front", "The front", &trade(front, record)))
        (section("sensors", "Sensors", &sensors(front)))
        (section("scores", "Scores, requirements and guards", &scores(front)))
        (section("repeat", "How to repeat it", &again))
    };
    whole(&format!("front in {}", record.scene), &head, &main, &html! {}).into_string()
}

fn trade(front: &Front, record: &FrontRecord) -> Markup {
    let is_picked = |k: usize| !picks_of(front, k).is_empty();
    html! {
        p {
            "Each point is a placement that no other one found beats in all objectives together."
            @if has_requirements(front) {
                " One that misses a requirement takes the place of none that meets all."
            }
            " The knee is farthest from the line or plane between the best of each objective, each axis scaled to \
             [0, 1]. Sensors are chosen on a coarse grid of poses: other placements may be better. "
            (layout::prose(&sentence(&refined_in_words(front, record))))
            @if has_copies(front) {
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

/// Words that begin with a small letter, as a sentence.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    format!("{}{}.", first.unwrap_or_default(), letters.as_str())
}

fn sensors(front: &Front) -> Markup {
    html! {
        ul { @for point in all_shown(front) { li { (point.placement.name) ": " (point.equipment) } } }
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
        (layout::table("Scores of the points", &titles, rows))
        @for words in requirements_in_words(all()) { p.small { (layout::prose(&words)) } }
        @for scores in all() {
            @let notes = notes(scores);
            @if !notes.is_empty() {
                h3 { (scores.name) }
                ul.guards {
                    @for note in &notes { li { (layout::prose(note.trim_start_matches([' ', '+', '!', '*']))) } }
                }
            }
        }
    }
}
