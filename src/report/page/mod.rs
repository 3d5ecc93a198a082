//! The page of a run, or of placements alone: one file that opens offline and loads nothing.
//!
//! | file | holds |
//! |---|---|
//! | `figures` | the drawings, and what is computed for them |
//! | `stage` | the first screen: result in a sentence, 3-D view |
//! | `scores` | result against baselines, guards, scene by scene |
//! | `layout` | poses of the result, and what each LiDAR gives |
//! | `gains` | gain by class and by distance |
//! | `search` | convergence, findings, how the run was made |
//! | `repeat` | the command that repeats a run |
//! | `parts` | tables and bars |

mod figures;
mod gains;
mod layout;
mod parts;
mod repeat;
mod scores;
mod search;
mod stage;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use super::{RunRecord, SceneRecord, judged, spread_in_words, verdict};
use crate::search::Scored;
pub use figures::{Figures, Looks};
pub use repeat::command;

/// What a page is about, whether it was searched for or given.
#[derive(Debug, Clone)]
pub struct Subject<'a> {
    /// Name of the scene; of several all names.
    pub scene: &'a str,
    /// Each of several scenes.
    pub scenes: &'a [SceneRecord],
    /// What the comparison is by.
    pub objective: &'a str,
    /// The result in sentences, the first of which heads the page.
    pub verdict: String,
    /// What the page is about; `None` where a search found nothing.
    pub result: Option<&'a Scored>,
    /// Layouts to compare with.
    pub baselines: &'a [Scored],
    /// The command that makes this page again.
    pub command: String,
}

impl<'a> Subject<'a> {
    /// The subject of a run.
    pub fn of(run: &'a RunRecord) -> Self {
        Self {
            scene: &run.scene,
            scenes: &run.scenes,
            objective: &run.objective,
            verdict: verdict(run.best.as_ref(), &run.baselines, &run.objective),
            result: run.best.as_ref(),
            baselines: &run.baselines,
            command: command(run),
        }
    }

    /// A placement that was given, by information gain; `command` makes the page again.
    pub fn given(
        scene: &'a str,
        scenes: &'a [SceneRecord],
        result: &'a Scored,
        baselines: &'a [Scored],
        command: String,
    ) -> Self {
        let objective = "information_gain";
        let verdict = judged(&result.placement.name, result, baselines, objective);
        Self { scene, scenes, objective, verdict, result: Some(result), baselines, command }
    }

    /// The best baseline that keeps all rules.
    fn rival(&self) -> Option<&'a Scored> {
        Scored::yardstick(self.baselines)
    }
}

/// The page of a run: the result in a sentence and a picture, then all that is known of it.
pub fn report_html(run: &RunRecord, figures: &Figures) -> String {
    page(&Subject::of(run), figures, Some(run)).into_string()
}

/// The same page of a placement that was not searched for.
pub fn view_html(subject: &Subject<'_>, figures: &Figures) -> String {
    page(subject, figures, None).into_string()
}

fn page(subject: &Subject<'_>, figures: &Figures, run: Option<&RunRecord>) -> Markup {
    let (first, rest) = subject.verdict.split_once(". ").unwrap_or((&subject.verdict, ""));
    let stop = if rest.is_empty() { "" } else { "." };
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { "sightline: " (subject.scene) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                header {
                    p.scene { "sightline · " (subject.scene) }
                    h1 { (unbroken(first)) (stop) }
                    @if !rest.is_empty() { p { (rest) } }
                }
                main {
                    (stage::stage(subject, figures))
                    @if let Some(words) = run.and_then(spread_in_words) { p { (words) } }
                    @if let Some(phases) = run.and_then(|run| run.phases.as_ref()) { p { (phases.words) } }
                    (scores::against(subject, run))
                    (scores::guards(subject))
                    (layout::layout(subject, figures, run))
                    (gains::gains(subject, figures))
                    (near_field(figures))
                    (maps(figures))
                    (scores::scores(subject))
                    (scores::scenes(subject))
                    @if let Some(run) = run { (search::search(run, figures)) }
                    (repeat::repeat(subject, run))
                }
                footer { p { "Made by sightline " (env!("CARGO_PKG_VERSION")) "." } }
                (stage::script(figures))
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

/// The blind zone from above.
fn near_field(figures: &Figures) -> Markup {
    html! {
        section aria-labelledby="near" {
            h2 #near { "Ground near the vehicle" }
            @match &figures.near_field {
                Ok(svg) => {
                    p {
                        "From above, forward is right: ground within 10 m that no beam sees, and the zone in \
                         which nothing on the ground is seen."
                    }
                    (parts::figure(svg, "Blind zone from above"))
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
                    div.paper { (parts::figure(map, "Information gained, from above")) }
                }
            }
        }
    }
}
