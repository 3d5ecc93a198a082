//! The page of a run, or of placements alone: one file that opens offline and loads nothing.
//!
//! | file | holds |
//! |---|---|
//! | `figures` | the drawings, and the data computed for them |
//! | `front` | the page of a front |
//! | `subject` | subject of a page, and the command that makes it again |
//! | `required` | requirements: met or not, margins, what is missing |
//! | `stage` | the first screen: result in a sentence, 3-D view |
//! | `scores` | result against baselines, guards, scene by scene |
//! | `layout` | poses of the result, and the gain of each LiDAR |
//! | `gains` | gain by class and by distance |
//! | `search` | convergence, findings, how the run was made |
//! | `repeat` | the command that makes the page again, and every setting |
//! | `parts` | tables and bars |

mod layout;
mod scores;
mod search;
mod subject;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::targets::{range_card_rows, range_card_svg};
use super::{RunRecord, spread_in_words};
use crate::scan::conditions::under;

pub use search::front_html;
pub use subject::{Figures, Looks, Subject};

/// The page of a run: the result in a sentence and a picture, then all that is known of it.
pub fn report_html(run: &RunRecord, figures: &Figures) -> String {
    page(&Subject::of(run), figures, Some(run)).into_string()
}

/// The page of a placement that was not searched for.
pub fn view_html(subject: &Subject<'_>, figures: &Figures) -> String {
    page(subject, figures, None).into_string()
}

/// Policy that loads and sends nothing: styles, scripts and pictures are part of the page.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; \
                      base-uri 'none'; form-action 'none'";

/// Head of every page.
fn head(title: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta http-equiv="Content-Security-Policy" content=(POLICY);
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta name="color-scheme" content="light dark";
            title { (title) }
            style { (PreEscaped(include_str!("style.css"))) }
        }
    }
}

fn page(subject: &Subject<'_>, figures: &Figures, run: Option<&RunRecord>) -> Markup {
    let (first, rest) = subject.verdict.split_once(". ").unwrap_or((&subject.verdict, ""));
    let stop = if rest.is_empty() { "" } else { "." };
    html! {
        (DOCTYPE)
        html lang="en" {
            (head(&format!("sightline: {}", subject.scene)))
            body {
                header {
                    p.scene { "sightline · " (subject.scene) (under(subject.conditions)) }
                    h1 { (unbroken(first)) (stop) }
                    @if !rest.is_empty() { p { (rest) } }
                }
                main {
                    (scores::required(subject))
                    (layout::stage(subject, figures))
                    (scores::usual(subject))
                    @if let Some(words) = run.and_then(|run| run.equipment.as_ref()) { p { "Equipment: " (words) "." } }
                    @if let Some(words) = run.and_then(spread_in_words) { p { (words) } }
                    @if let Some(phases) = run.and_then(|run| run.phases.as_ref()) { p { (phases.words) } }
                    (range_card(subject))
                    (scores::against(subject, run))
                    (scores::guards(subject))
                    (layout::layout(subject, figures, run))
                    (scores::gains(subject, figures))
                    (near_field(figures))
                    (maps(figures))
                    (scores::scores(subject))
                    (scores::scenes(subject))
                    @if let Some(run) = run { (search::search(run, figures)) }
                    (search::repeat_repeat(subject, run))
                }
                footer { p { "Made by sightline " (env!("CARGO_PKG_VERSION")) "." } }
                (layout::script(figures))
            }
        }
    }
}

/// Words of a heading; names with a hyphen stay on one line.
fn unbroken(words: &str) -> Markup {
    html! {
        @for (index, word) in words.split(' ').enumerate() {
            @if index > 0 { " " }
            @if word.contains('-') { span.name { (word) } } @else { (word) }
        }
    }
}

/// Distances of detection, and the sectors in which the result is blind.
fn range_card(subject: &Subject<'_>) -> Markup {
    let Some((best, card)) =
        subject.result.and_then(|best| Some((best, best.scores.range_card.as_ref()?)))
    else {
        return html! {};
    };
    let rows = range_card_rows(card);
    let titles: Vec<&str> = rows[0].iter().map(String::as_str).collect();
    let cells = |row: &Vec<String>| (false, row.iter().map(layout::text).collect());
    html! {
        section aria-labelledby="range" {
            h2 #range { "Range card" }
            @if card.blind.is_empty() {
                p { "A car is met by " (card.beams) " beams or more everywhere between 5 and 50 m, all round." }
            } @else {
                p { "Blind sectors:" }
                ul.guards { @for sector in &card.blind { li { (sector.to_string()) } } }
            }
            p {
                "Metres from the vehicle's origin to the middle of a target on level ground, alone, at which "
                (card.beams) " beams or more end at it, the own body in the way. Bearings count to the left from \
                 straight ahead."
            }
            div.polar {
                (layout::figure(&range_card_svg(&best.placement.name, card), "Distances at which targets are met"))
            }
            (layout::table("Metres at which a target is met", &titles, &rows[1..].iter().map(cells).collect::<Vec<_>>()))
        }
    }
}

/// The blind zone from above.
fn near_field(figures: &Figures) -> Markup {
    html! {
        section aria-labelledby="near" {
            h2 #near { "Ground near the vehicle" }
            @match &figures.near_field {
                Ok(svg) => {
                    p {
                        "From above, forward is right: ground within 10 m that no beam sees, and the zone in \
                         which nothing on the ground is seen, over " (figures.near_frames) " frame(s) spread evenly"
                        @if figures.views.len() > 1 { " over the first scene" }
                        "."
                    }
                    (layout::figure(svg, "Blind zone from above"))
                }
                Err(why) => p { "Not drawn: " (why) "." }
            }
        }
    }
}

/// Information gained from above, scene by scene.
fn maps(figures: &Figures) -> Markup {
    html! {
        @if !figures.maps.is_empty() {
            section #map aria-labelledby="seen" {
                h2 #seen { "What it sees, from above" }
                p {
                    "Information of each column of voxels: red where the beams gain it, grey where it stays \
                     unseen."
                }
                @for (scene, map) in &figures.maps {
                    @if figures.maps.len() > 1 { h3 { (scene) } }
                    div.paper { (layout::figure(map, "Information gained, from above")) }
                }
            }
        }
    }
}
