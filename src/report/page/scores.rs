//! The result against every baseline: differences with intervals, guards in words, all scores, each scene.

use maud::{Markup, html};

use super::parts::{difference, table, text};
use super::subject::Subject;
use crate::json::spoken;
use crate::report::against::{Against, against as compared};
use crate::report::by_scene::rows_by_scene;
use crate::report::{RunRecord, ScoreColumn};
use crate::search::Scored;

/// Scenes from which on an interval of resampled scenes is about as wide as it should be.
const MANY_SCENES: usize = 10;

/// The gain over each baseline, or the near gain where that was maximized.
pub(super) fn against(subject: &Subject<'_>, run: Option<&RunRecord>) -> Markup {
    let Some(best) = subject.result else { return html! {} };
    let seed = run.map_or(1, |run| run.seed);
    let column = ScoreColumn::argued(subject.objective);
    let all = compared(best, subject.baselines, subject.scenes, seed, column);
    let ends = |one: &Against| one.interval.map_or([one.difference; 2], |i| [i.low, i.high]);
    let widest = all.iter().flat_map(ends).map(f64::abs).fold(1e-12, f64::max);
    let several = !subject.scenes.is_empty();
    let places = subject.scenes.iter().filter(|scene| !scene.mirrored).count();
    let titles = ["", column.title(), "more by", "95 % interval", ""];
    let percent = |share: f64| format!("{:+.2}", 100.0 * share);
    let rows = all.iter().map(|one| {
        let interval = one.interval.map(|i| [i.low, i.high]);
        let words = interval
            .map_or("–".into(), |[low, high]| format!("{} to {}", percent(low), percent(high)));
        let scaled = interval.map(|ends| ends.map(|end| end / widest));
        let mut row = vec![text(one.name), text(format!("{:.2}", 100.0 * one.gain))];
        row.push(text(percent(one.difference)));
        row.extend(several.then(|| text(words)));
        row.push(difference(one.difference / widest, scaled));
        (false, row)
    });
    let rows: Vec<(bool, Vec<Markup>)> = rows.collect();
    let titles: Vec<&str> =
        titles.into_iter().filter(|t| several || !t.starts_with("95")).collect();
    html! {
        @if !rows.is_empty() {
            section aria-labelledby="against" {
                h2 #against { "Against every baseline" }
                p {
                    @if let Some(meaning) = near_gain(column) {
                        "Near gain (" (meaning) "), in per cent of what "
                    } @else {
                        "Information gained, in per cent of what "
                    }
                    (if several { "the scenes hold, a mean over them" } else { "the scene holds" })
                    ": the result has "
                    (column.cell(&best.scores)) " %. "
                    @if several {
                        "The interval resamples the " (places) " scenes: one that does not hold 0 is more than their \
                         own spread"
                        @if places < MANY_SCENES { "; so few make it too narrow rather than too wide" }
                        "."
                    } @else {
                        "One scene gives no interval: give several to learn whether a difference is more than \
                         the scenes' own spread."
                    }
                }
                (table("Percentage points that the result gains more than each baseline", &titles, &rows))
            }
        }
    }
}

/// Meaning of the near gain.
const NEAR_GAIN: &str = "the information gained where what is farther than 10 m from the vehicle counts for \
                                    less, by its distance, and the ground within 10 m for a fifth by itself";

/// Meaning of a near gain; `None` of another score.
pub(super) fn near_gain(column: ScoreColumn) -> Option<String> {
    let times = match column {
        ScoreColumn::NearGain => return Some(NEAR_GAIN.to_owned()),
        ScoreColumn::NearGain2 => "two",
        ScoreColumn::NearGain3 => "three",
        _ => return None,
    };
    Some(format!("{NEAR_GAIN}; each voxel counts for every LiDAR that covers it, up to {times}"))
}

/// Violated guards and broken rules of the result and the baselines.
pub(super) fn guards(subject: &Subject<'_>) -> Markup {
    let all = subject.result.iter().copied().chain(subject.baselines);
    let spoken: Vec<(&Scored, Vec<String>)> =
        all.map(|scored| (scored, scored.reasons())).filter(|(_, why)| !why.is_empty()).collect();
    html! {
        section aria-labelledby="guards" {
            h2 #guards { "Warnings" }
            @if spoken.is_empty() {
                p { "None: the result and every baseline keep all rules and pass all checks." }
            } @else {
                p { "Guards and broken rules are reasons not to believe a score." }
                ul.guards {
                    @for (scored, why) in &spoken {
                        li { b { (scored.placement.name) } ": " (why.join("; ")) }
                    }
                }
            }
        }
    }
}

/// Every score of the result and the baselines, a row each.
pub(super) fn scores(subject: &Subject<'_>) -> Markup {
    let all = || subject.result.into_iter().chain(subject.baselines);
    let columns = ScoreColumn::shown(all().map(|scored| &scored.scores), subject.objective);
    let mut titles: Vec<&str> = columns.iter().map(|column| column.title()).collect();
    let argued = ScoreColumn::argued(subject.objective);
    titles.push("objective");
    let row = |(scored, is_best): (&Scored, bool)| {
        let mut cells: Vec<Markup> =
            columns.iter().map(|column| text(column.cell(&scored.scores))).collect();
        cells.push(text(scored.objective.map_or("–".into(), spoken)));
        (is_best, cells)
    };
    let result = subject.result.into_iter().map(|best| (best, true));
    let rows: Vec<_> =
        result.chain(subject.baselines.iter().map(|b| (b, false))).map(row).collect();
    html! {
        section aria-labelledby="scores" {
            h2 #scores { "All scores" }
            (table("Scores of the result and the baselines", &titles, &rows))
            p.small {
                "Scores are means over frames; larger is better. The gain is ΣH over covered voxels, in nats: \
                 the more of what changes in the scene the beams reach, the larger it is. Near gain is "
                (near_gain(argued).unwrap_or_else(|| NEAR_GAIN.to_owned())) ". M-SOG is the negative mean of the gain, −(1/N)·ΣH, and can be raised by looking at \
                 what never changes. The objective is " code { (subject.objective) } "."
            }
        }
    }
}

/// Gains in each of several scenes.
pub(super) fn scenes(subject: &Subject<'_>) -> Markup {
    let column = ScoreColumn::argued(subject.objective);
    let rows = rows_by_scene(subject.scenes, subject.result, subject.baselines, column);
    let Some((titles, rows)) = rows.as_deref().and_then(<[_]>::split_first) else {
        return html! {};
    };
    let titles: Vec<&str> = titles.iter().map(String::as_str).collect();
    let row = |(index, row): (usize, &Vec<String>)| {
        (index == 0 && subject.result.is_some(), row.iter().map(text).collect())
    };
    let rows: Vec<_> = rows.iter().enumerate().map(row).collect();
    html! {
        section aria-labelledby="scenes" {
            h2 #scenes { "Scene by scene" }
            @if near_gain(column).is_some() {
                (table("Near gain in each scene", &titles, &rows))
            } @else {
                (table("Share of each scene's information that is gained", &titles, &rows))
            }
            p.small {
                "Over all is the mean, each scene counting the same; the gain in nats above is the share of the \
                 information times the mean total."
            }
        }
    }
}
