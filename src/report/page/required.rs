//! Requirements: met or not, by how much, and what is missing; three to begin with where there are none.

use maud::{Markup, html};

use super::parts::{table, text};
use super::subject::Subject;
use crate::score::{HOLDS, Scores, Seen};
use crate::search::Scored;

/// Baselines that stand beside the result, at most.
const BESIDE: usize = 3;

/// Requirements that most vehicles have, as lines of a vehicle file.
const USUAL: &str = r#""require": [
  { "target": "child", "within": 40, "bearing": [-60, 60], "share": 0.95 },
  { "target": "car", "within": 50, "share": 0.95, "without_any_one": true },
  { "ground": 3, "share": 0.9 } ]"#;

/// Requirements of the result and of the first baselines.
pub(super) fn required(subject: &Subject<'_>) -> Markup {
    let Some(best) = subject.result else { return html! {} };
    let all = &best.scores.required;
    html! {
        @if !all.is_empty() {
            section aria-labelledby="required" {
                h2 #required { "Requirements" }
                (met_or_not(best, subject.baselines))
                ul.guards {
                    @for seen in all.iter().filter(|seen| !seen.is_met() || is_on_paper(seen)) { li { (seen) } }
                }
                @if let Some(words) = best.scores.holds_in_words() { p { (words) "." } }
            }
        }
    }
}

/// Requirements to begin with, for a subject that has none and where beams end at surfaces.
pub(super) fn usual(subject: &Subject<'_>) -> Markup {
    let scores = subject.result.map(|best| &best.scores);
    let has_none = |scores: &&Scores| scores.required.is_empty() && scores.range_card.is_some();
    html! {
        @if scores.filter(has_none).is_some() {
            section aria-labelledby="required" {
                h2 #required { "No requirement is set" }
                p {
                    "The score alone decided. Three requirements that most vehicles have, as lines of a vehicle file: a \
                     child ahead, a car all round whichever LiDAR fails, and the ground near the body. Fit the numbers \
                     to your operational domain."
                }
                pre { (USUAL) }
            }
        }
    }
}

/// True if a requirement is met, but not by enough copies within the mounting tolerance.
fn is_on_paper(seen: &Seen) -> bool {
    seen.is_met() && seen.holds_in.is_some_and(|share| share < HOLDS)
}

fn met_or_not(best: &Scored, baselines: &[Scored]) -> Markup {
    let beside: Vec<&Scored> = baselines
        .iter()
        .filter(|of| of.scores.required.len() == best.scores.required.len())
        .take(BESIDE)
        .collect();
    let mut titles = vec!["", "", "found %", "required %", "margin", "copies that hold %"];
    titles.extend(beside.iter().map(|of| &*of.placement.name));
    // Rounded down, so that a requirement that is not met never reads as met.
    let per_cent = |share: f64| format!("{:.1}", (1e3 * share + 1e-9).floor() / 10.0);
    let rows = best.scores.required.iter().enumerate().map(|(k, seen)| {
        let mut row = vec![text(&seen.name), text(if seen.is_met() { "met" } else { "NOT MET" })];
        row.push(text(per_cent(seen.share)));
        row.push(text(format!("{:.1}", 100.0 * seen.least)));
        row.push(text(format!("{:+.1}", 100.0 * (seen.share - seen.least))));
        row.push(text(seen.holds_in.map_or("–".into(), |share| format!("{:.0}", 100.0 * share))));
        row.extend(beside.iter().map(|of| text(per_cent(of.scores.required[k].share))));
        (false, row)
    });
    let rows: Vec<_> = rows.collect();
    table(
        "Requirements of the vehicle; margins in percentage points; baselines found %",
        &titles,
        &rows,
    )
}
